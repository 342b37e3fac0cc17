"""All that a camera sees in the sky besides the sun and lit air: moon, planets, stars, Milky Way, airglow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.pixels import Pixels
from openswim.heavens.behind import sky_behind
from openswim.heavens.bent_rays import LongerWay, Refraction
from openswim.heavens.corona import MOST_SUN, drawn_corona, flattening, pole_direction
from openswim.heavens.lamps import Lamps
from openswim.heavens.moon_disc import drawn_moon
from openswim.heavens.points import FAINTEST, Drawn, Points, drawn_points, points_over
from openswim.heavens.sun_disc import Bite, Disc, Through
from openswim.lights import moon_irradiance, moon_position
from openswim.lights.eclipses import moonlight_left
from openswim.lights.moon import Moon
from openswim.scene.atmosphere import Atmosphere
from openswim.transport.lit.lit_grid import Once

F64 = NDArray[np.float64]

_HIGHEST_BENT_M = 5e4  # eyes above see too little air for refraction to be told
_DAY_DEG, _NIGHT_DEG = 0.0, -9.0  # altitudes of the sun between which stars come out
_ECLIPSED = 4.0  # powers of ten of sunlight lost in an eclipse, from which on all are out
DUSK_DEG = -2.0  # altitude of the sun from which on the night's sky is looked for
_FAINTEST_BY_DAY = -5.0  # magnitude of what is drawn; no point of light is as bright


@dataclass(frozen=True, eq=False)
class Heavens:
    """The sky of one place at a time. axes (3, 3): east, north, up there in the scene frame; toa (nw,): the sun's
    irradiance by which radiance is counted."""

    lamps: Lamps
    time: np.datetime64
    place: tuple[float, float]
    height_m: float
    axes: F64
    air: Atmosphere | None
    wavelengths_nm: F64
    toa: F64
    sun_altitude_deg: float
    origin_m: F64
    once: Once = field(default_factory=Once, repr=False)

    @cached_property
    def moon(self) -> Moon:
        """Where it stands for this place."""
        return moon_position(self.time, *self.place, self.height_m)

    @property
    def refraction(self) -> Refraction | None:
        if self.air is None or self.height_m > _HIGHEST_BENT_M:
            return None
        air = self.air
        return self.once("refraction", lambda: Refraction.at(air, self.height_m))

    def moon_altitude_deg(self) -> float:
        """Apparent."""
        true = self.moon.altitude_deg
        return true if self.refraction is None else float(self.refraction.apparent_altitude_deg(true))

    @cached_property
    def sun_left(self) -> F64:
        """What the moon leaves of the sun's light (nw,) at this place."""
        shadow = self.lamps.shadow
        if shadow is None:
            return np.ones(len(self.wavelengths_nm))
        return np.asarray(shadow.left(np.asarray(self.origin_m, float)[None], self.wavelengths_nm)[0])

    def bite(self) -> Bite | None:
        """The moon on the sun's disc."""
        if self.lamps.shadow is None:
            return None
        return Bite.of(self.lamps.shadow, np.asarray(self.origin_m, float), self.axes, self.sun_left)

    def moon_disc(self) -> Disc:
        """Where it appears."""
        return Disc(self.moon.azimuth_deg, self.moon_altitude_deg(), self.moon.angular_radius_deg, self.wavelengths_nm)

    def moon_strength(self) -> F64:
        """Its irradiance over the sun's (nw,), outside of the air."""
        left = moonlight_left(self.time, self.wavelengths_nm)
        return np.asarray(left * moon_irradiance(self.moon, self.wavelengths_nm) / self.toa)

    def behind(self, direction: F64, transmittance: NDArray, hit: NDArray[np.bool_]) -> F64:
        """Solar-relative radiance (n, nw) of the night's sky along rays (n, 3) in the scene frame."""
        found = sky_behind(
            self.lamps, self.wavelengths_nm, direction, self.axes[2], self.height_m, transmittance, hit
        )
        return np.asarray(4 * np.pi * found / self.toa)

    def drawn(self, camera: Camera, pixels: Pixels, sun: Disc, through: Through) -> list[Drawn]:
        """Moon, planets, stars and the corona of an eclipsed sun on the pixels of a picture."""
        lift = self.refraction
        bent = through if self.air is None or lift is None else _through_bent(through, lambda: self._longer)
        moon = drawn_moon(self.moon, self.time, camera, pixels, self.wavelengths_nm, self.toa, bent, lift)
        out = np.clip((self.sun_altitude_deg - _DAY_DEG) / (_NIGHT_DEG - _DAY_DEG), 0, 1)
        out = max(out, float(np.clip(-np.log10(self.sun_left.mean()) / _ECLIPSED, 0, 1)))
        faintest = _FAINTEST_BY_DAY + (FAINTEST - _FAINTEST_BY_DAY) * out
        if faintest <= _FAINTEST_BY_DAY:
            return [moon]
        shown = [moon]
        if self.lamps.shadow is not None and self.sun_left.mean() < MOST_SUN:
            night = self.lamps.night  # its axes are the place's own
            shown.append(drawn_corona(
                sun, pole_direction(night.to_icrs), flattening(night.flux_sfu), camera, pixels, bent
            ))  # fmt: skip
        lowest = -90.0 if lift is None else float(lift.apparent_deg[0])
        points = points_over(self.time, *self.place, self.height_m, lift, lowest)
        seen = np.flatnonzero(points.magnitude <= faintest)
        points = Points(*(getattr(points, name)[seen] for name in points.__dataclass_fields__))
        return [*shown, drawn_points(points, camera, pixels, self.wavelengths_nm, self.toa, bent)]

    @property
    def _longer(self) -> LongerWay:
        air = self.air
        assert air is not None
        return self.once("longer", lambda: LongerWay.at(air, self.height_m, self.wavelengths_nm))

    def attrs(self) -> dict[str, Any]:
        """What is to be known of the moon in a picture."""
        return {
            "moon_altitude_deg": round(self.moon_altitude_deg(), 4),
            "moon_azimuth_deg": round(self.moon.azimuth_deg, 4),
            "moon_illuminated": round(self.moon.illuminated, 4),
            "lights": ", ".join(lamp.name for lamp in self.lamps.every),
        }


def _through_bent(through: Through, longer: Callable[[], LongerWay]) -> Through:
    """What bent rays go through, where straight ones are followed."""

    def bent(direction: F64, width_rad: float) -> tuple[NDArray, NDArray[np.bool_]]:
        light, hit = through(direction, width_rad)
        return light * longer().transmittance(np.degrees(np.arcsin(np.clip(direction[:, 2], -1, 1)))), hit

    return bent
