"""How much of the world around a place matters to an eye there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from openswim.errors import UserError
from openswim.scene.frame import horizon_dip_deg
from openswim.scene.grid import EARTH_RADIUS_M

GROUND_RADIUS_M = 200_000.0  # clouds farther away stand less than 3 degrees high
MOST_RADIUS_M = 10_000_000.0  # a hemisphere
WIDER_SIDE = 240  # columns along a side of what is seen beyond
FARTHER = 1.25  # times a radius that is worth a wider grid
_SPACE_RADIUS_M = 1_330_000.0  # an eye 100 km up sees as far
_HIGHEST_CLOUD_M = 16_000.0


@dataclass(frozen=True)
class Neighbourhood:
    """A place (degrees) and how far around it matters; `if_large`: leave small domains whole; `in_parts`: as many
    columns as an eye in space may see part by part (`transport.large`); `far_m`: how far around it clouds may still be
    seen, in wider cells; `most_side`: columns along a side of what is not as the model has it."""

    lat: float
    lon: float
    radius_m: float = GROUND_RADIUS_M
    if_large: bool = False
    in_parts: bool = True
    far_m: float = 0.0
    most_side: int = 420

    def __post_init__(self) -> None:
        if not (-90.0 <= self.lat <= 90.0 and -360.0 <= self.lon <= 360.0):
            raise UserError(f"around: latitude {self.lat}, longitude {self.lon} is no place on Earth: give degrees")
        if not self.radius_m > 0:
            raise UserError(f"radius_km must be positive, got {self.radius_m / 1e3:g}")

    @classmethod
    def seen_from(cls, lat: float, lon: float, height_m: float, beyond: bool = True) -> Neighbourhood:
        """What an eye sees that is `height_m` up; small domains stay whole. `beyond`: with far clouds in wider cells,
        and what an eye in space sees, part by part."""
        return cls(lat, lon, reach_m(height_m), True, beyond, far_m(height_m) if beyond else 0.0)

    @classmethod
    def seen_along(cls, lat: Sequence[float], lon: Sequence[float], height_m: Sequence[float]) -> Neighbourhood:
        """What an eye sees on a way through places, up to `height_m` up: around the middle of them."""
        places = np.radians(np.stack([np.asarray(lat, float), np.asarray(lon, float)]))
        up = np.stack([np.cos(places[0]) * np.cos(places[1]), np.cos(places[0]) * np.sin(places[1]), np.sin(places[0])])
        middle = up.mean(axis=1)
        length = float(np.linalg.norm(middle))
        middle = up[:, 0] if length < 1e-9 else middle / length
        away_m = EARTH_RADIUS_M * float(np.arccos(np.clip(middle @ up, -1.0, 1.0)).max())
        highest = float(np.max(height_m))
        return cls(
            math.degrees(math.asin(middle[2])), math.degrees(math.atan2(middle[1], middle[0])),
            min(reach_m(highest) + away_m, MOST_RADIUS_M), True, True, min(far_m(highest) + away_m, MOST_RADIUS_M),
        )  # fmt: skip

    @property
    def from_space(self) -> bool:
        """Whether all is seen that stands above the horizon, as from 100 km up and higher."""
        return self.radius_m > _SPACE_RADIUS_M

    @property
    def beyond(self) -> Neighbourhood | None:
        """What is seen beyond it, if that is farther."""
        if self.far_m < FARTHER * self.radius_m:
            return None
        return replace(self, radius_m=self.far_m, far_m=0.0, most_side=WIDER_SIDE, in_parts=False)


def reach_m(height_m: float) -> float:
    """How far the clouds may be that an eye `height_m` up still shows well [m]."""
    horizon = EARTH_RADIUS_M * math.radians(horizon_dip_deg(height_m))
    return min(GROUND_RADIUS_M + horizon, MOST_RADIUS_M)


def far_m(height_m: float) -> float:
    """How far the highest clouds may be that stand above the horizon of an eye `height_m` up [m]."""
    both_deg = horizon_dip_deg(height_m) + horizon_dip_deg(_HIGHEST_CLOUD_M)
    return min(EARTH_RADIUS_M * math.radians(both_deg), MOST_RADIUS_M)
