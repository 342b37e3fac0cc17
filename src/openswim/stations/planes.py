"""Planes that light falls on: the horizontal, and tilted ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import numbers, shown
from openswim.errors import UserError
from openswim.fluxes import Quadrature, quadrature_directions
from openswim.pictures.viewpoint import Viewpoint
from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Planes:
    """Tilts from the horizontal and azimuths that the planes face (clockwise from north), degrees, (n,)."""

    tilt_deg: F64
    azimuth_deg: F64

    @classmethod
    def of(cls, given: Any) -> Planes:
        """From pairs (tilt, azimuth) in degrees."""
        try:
            pairs = numbers("planes", list(given)).reshape(-1, 2).astype(float)
        except (TypeError, ValueError):
            pairs = np.full((1, 2), np.nan)
        tilt, azimuth = pairs.T + 0.0  # without the sign of -0
        if not ((np.abs(azimuth) <= 360) & (tilt >= 0) & (tilt <= 180)).all():
            raise UserError(
                f"planes {shown(given)}: give pairs (tilt within 0..180, azimuth within -360..360) in degrees"
            )
        return cls(tilt, azimuth)

    def __len__(self) -> int:
        return self.tilt_deg.size

    @property
    def normal(self) -> F64:
        """(n, 3), axes east, north, up."""
        return horizon_vector(self.azimuth_deg, 90.0 - self.tilt_deg)


HORIZONTAL = Planes(np.zeros(0), np.zeros(0))


def relative_diffuse(viewpoint: Viewpoint, planes: Planes, fineness: int) -> F64:
    """Diffuse irradiance over E_TOA (1 + 2 n, nw) at a viewpoint: on the horizontal; on planes, from above the horizon;
    on planes, from below it: the ground, as it is lit and coloured in the scene.

    `fineness` is that of `quadrature_directions`.
    """
    sun_azimuth, sun_altitude = viewpoint.sun
    above = quadrature_directions(fineness, sun_azimuth, sun_altitude)
    found = _caught(viewpoint, np.concatenate([[[0.0, 0.0, 1.0]], planes.normal]), above, 1.0)
    if not len(planes):
        return found
    return np.concatenate([found, _caught(viewpoint, planes.normal, quadrature_directions(fineness), -1.0)])


def _caught(viewpoint: Viewpoint, normal: F64, sky: Quadrature, upward: float) -> F64:
    altitude = upward * sky.altitude_deg
    radiance, _ = viewpoint.sky(sky.azimuth_deg, altitude)
    toward = horizon_vector(sky.azimuth_deg, altitude)
    return np.maximum(normal @ toward.T, 0.0) * sky.solid_angle_sr @ radiance / (4 * np.pi)
