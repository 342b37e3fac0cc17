"""The moon's shadow over a scene: how much sunlight is left at each place, which differs from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.eclipses.solar import Discs, light_left
from openswim.lights.ephemeris import bodies, observer, skyfield_time
from openswim.lights.moon import MOON_RADIUS_KM
from openswim.lights.sun import SUN_RADIUS_KM
from openswim.scene.frame import horizon_vector
from openswim.scene.times import Time

F64 = NDArray[np.float64]

CORONA_SHARE = 1.1e-6  # of the sun's light, what its corona sends (F. Espenak & J. Meeus: 1e-6; half a full moon)
_NODES, _RINGS = 400, 400  # of how far the moon's edge is from the sun's, close together where the crescent is thin


@dataclass(frozen=True, eq=False)
class MoonShadow:
    """Sun and moon, m, from the origin of a scene's frame (`scene.frame`), in its axes; apparent."""

    to_sun_m: F64
    to_moon_m: F64
    tables: dict[tuple[float, ...], F64] = field(default_factory=dict, repr=False)

    @classmethod
    def over(cls, time: Time, lat: float, lon: float) -> MoonShadow:
        """At a time (UTC), of a frame whose origin is at a place at sea level."""
        here = observer(lat, lon, 0.0).at(skyfield_time(time))
        found = []
        for name in ("sun", "moon"):
            altitude, azimuth, distance = here.observe(bodies()[name]).apparent().altaz()
            found.append(distance.m * horizon_vector(azimuth.degrees, altitude.degrees))
        return cls(*found)

    @classmethod
    def near(cls, radius_m: float, time: Time, lat: float, lon: float) -> MoonShadow | None:
        """The same where it may lie on any place within a distance of the origin; else None, as nearly always."""
        found = cls.over(time, lat, lon)
        return found if found.touches(radius_m) else None

    def discs(self, place_m: F64) -> Discs:
        """Sun and moon from places (n, 3) in the frame, to some 500 km from its origin as exact as there."""
        sun, moon = self.to_sun_m - place_m, self.to_moon_m - place_m
        to_sun, to_moon = np.linalg.norm(sun, axis=-1), np.linalg.norm(moon, axis=-1)
        # by the chord, which is exact for small angles where the cosine is not
        chord = np.linalg.norm(sun / to_sun[..., None] - moon / to_moon[..., None], axis=-1)
        return Discs(
            np.degrees(2 * np.arcsin(np.minimum(0.5 * chord, 1.0))),
            np.degrees(np.arcsin(1000 * SUN_RADIUS_KM / to_sun)),
            np.degrees(np.arcsin(np.minimum(1000 * MOON_RADIUS_KM / to_moon, 1.0))),
        )  # fmt: skip

    def touches(self, radius_m: float) -> bool:
        """Whether it may lie on any place within a distance of the origin."""
        at = self.discs(np.zeros((1, 3)))
        apart = float((at.separation_deg - at.sun_deg - at.moon_deg)[0])
        return apart < np.degrees(radius_m / np.linalg.norm(self.to_moon_m))

    def left(self, place_m: F64, wavelengths_nm: ArrayLike) -> F64:
        """Share (n, nw) of the sun's light at places (n, 3), its corona's included; it falls to zero smoothly."""
        table = self.table(wavelengths_nm)
        sun, to_sun = _from(self.to_sun_m, place_m)
        moon, to_moon = _from(self.to_moon_m, place_m)
        chord2 = sum((a / to_sun - b / to_moon) ** 2 for a, b in zip(sun, moon, strict=True))
        of_sun, of_moon = 1000 * SUN_RADIUS_KM / to_sun, 1000 * MOON_RADIUS_KM / to_moon
        # from where the moon leaves nothing, or a ring, to where it leaves all; angles are small
        covered = np.clip((np.sqrt(chord2) - of_moon + of_sun) / (2 * of_sun), 0.0, 1.0)
        at = np.sqrt(covered) * (_NODES - 1)
        k = np.minimum(at.astype(int), _NODES - 2)
        low = table[k]
        return np.asarray(low + (at - k)[:, None] * (table[k + 1] - low))

    def table(self, wavelengths_nm: ArrayLike) -> F64:
        """Light left (n, nw) by where the moon's edge is on the sun's diameter. The moon is as wide as from the origin:
        elsewhere by some thousandths less or more, of which here nothing is to be seen. Even in the root of the way."""
        nm = tuple(np.asarray(wavelengths_nm, float).tolist())
        if nm not in self.tables:
            at = self.discs(np.zeros((1, 3)))
            ratio, edge = float((at.moon_deg / at.sun_deg)[0]), np.linspace(0, 1, _NODES) ** 2
            ones = np.ones(_NODES)
            found = Discs(np.maximum(2 * edge - 1 + ratio, 0.0), ones, ratio * ones)
            left = light_left(found, np.asarray(nm), _RINGS)
            self.tables[nm] = left + CORONA_SHARE * (1 - left)
        return self.tables[nm]


def _from(body_m: F64, place_m: F64) -> tuple[list[F64], F64]:
    """Components (3, n) of the way from places (n, 3) to a body, and its length (n,)."""
    way = [body - place for body, place in zip(body_m, np.asarray(place_m, float).T, strict=True)]
    return way, np.sqrt(sum(each * each for each in way))
