"""Eclipses of the sun: when, how much is covered, and how much light is left."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.disc import disc_profile
from openswim.lights.eclipses.contacts import crossings, least, root, stamps
from openswim.lights.ephemeris import bodies, observer, skyfield_time
from openswim.lights.moon import MOON_RADIUS_KM
from openswim.lights.sun import SUN_RADIUS_KM
from openswim.scene.times import Time

F64 = NDArray[np.float64]

EARTH_RADIUS_KM = 6378.137  # equatorial
OUTER_MOON_KM = 0.2725076 * EARTH_RADIUS_KM  # of first and last contact (IAU 1982)
INNER_MOON_KM = 0.272281 * EARTH_RADIUS_KM  # of totality: sunlight comes through the valleys of the limb
_STEP_S, _REACH_H = 60.0, 4.0


@dataclass(frozen=True)
class SolarEclipse:
    """An eclipse of the sun from one place; times UTC (before 1972 UT1), None where there is no such contact."""

    first: np.datetime64  # the partial phase begins
    second: np.datetime64 | None  # the total or annular phase begins
    greatest: np.datetime64
    third: np.datetime64 | None
    last: np.datetime64
    total: bool
    magnitude: float  # share of the sun's diameter that is covered at most
    obscuration: float  # of its area


@dataclass(frozen=True)
class Discs:
    """Sun and moon from one place at times (n,): degrees between their centres, radii in degrees."""

    separation_deg: F64
    sun_deg: F64
    moon_deg: F64  # of a moon of 1737.4 km


def discs(time: Time, lat: float, lon: float, height_m: float = 0.0, seconds: ArrayLike = 0.0) -> Discs:
    """The discs so many ``seconds`` (n,) after a time (UTC; before 1972 UT1)."""
    start = skyfield_time(time)
    t = start.ts.tt_jd(start.tt + np.atleast_1d(np.asarray(seconds, float)) / 86400.0)
    here = observer(lat, lon, height_m).at(t)
    return _discs(here.observe(bodies()["sun"]).apparent(), here.observe(bodies()["moon"]).apparent())


def _discs(sun: Any, moon: Any) -> Discs:
    separation = np.asarray(sun.separation_from(moon).degrees)
    of_sun = np.degrees(np.arcsin(SUN_RADIUS_KM / sun.distance().km))
    return Discs(separation, of_sun, np.degrees(np.arcsin(MOON_RADIUS_KM / moon.distance().km)))


def obscuration(found: Discs) -> F64:
    """Share (n,) of the sun's area that the moon covers."""
    d, a, b = found.separation_deg, found.sun_deg, found.moon_deg
    safe = np.clip(d, np.maximum(np.abs(a - b), 1e-12), a + b)
    at_sun = np.arccos(np.clip((safe**2 + a**2 - b**2) / (2 * safe * a), -1, 1))
    at_moon = np.arccos(np.clip((safe**2 + b**2 - a**2) / (2 * safe * b), -1, 1))
    kite = 0.5 * np.sqrt(np.maximum((a + b) ** 2 - safe**2, 0) * np.maximum(safe**2 - (a - b) ** 2, 0))
    lens = (a**2 * at_sun + b**2 * at_moon - kite) / (np.pi * a**2)
    return np.asarray(np.where(d >= a + b, 0.0, np.where(d <= np.abs(a - b), np.minimum(b / a, 1) ** 2, lens)))


def light_left(found: Discs, wavelengths_nm: ArrayLike, rings: int = 96) -> F64:
    """Share (n, nw) of the sun's light that passes the moon: its disc is darker, and redder, toward the limb."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    rho = np.sqrt((nodes + 1) / 2)  # equal areas of the disc
    light = disc_profile(rho, np.asarray(wavelengths_nm, float)) * (weights / 2)[:, None]
    r, d, b = rho * found.sun_deg[:, None], found.separation_deg[:, None], found.moon_deg[:, None]
    cosine = (r**2 + d**2 - b**2) / np.maximum(2 * r * d, 1e-12)
    covered = np.arccos(np.clip(cosine, -1, 1)) / np.pi  # share of each ring
    covered = np.where(d + r <= b, 1.0, np.where(np.abs(d - r) >= b, 0.0, covered))
    apart = found.separation_deg >= found.sun_deg + found.moon_deg  # then the whole, and no sum's last digits
    return np.asarray(np.where(apart[:, None], 1.0, np.clip((1 - covered) @ light, 0.0, 1.0)))


def solar_eclipse(near: Time, lat: float, lon: float, height_m: float = 0.0) -> SolarEclipse | None:
    """The eclipse whose greatest phase lies within four hours of a time; None where there is none.

    Geometric: it may happen below the horizon. Contacts to a second or two, which the moon's limb adds.
    """
    seconds = np.arange(-_REACH_H * 3600, _REACH_H * 3600 + 1, _STEP_S)
    along = discs(near, lat, lon, height_m, seconds)

    def gap(s: ArrayLike, moon_km: float, inner: bool) -> F64:
        at = along if s is seconds else discs(near, lat, lon, height_m, s)
        moon = at.moon_deg * moon_km / MOON_RADIUS_KM
        return np.asarray(at.separation_deg - (np.abs(moon - at.sun_deg) if inner else moon + at.sun_deg))

    nearest = int(np.argmin(along.separation_deg))
    first, last = crossings(gap(seconds, OUTER_MOON_KM, False), nearest)
    if first is None or last is None:
        return None
    middle = least(lambda s: discs(near, lat, lon, height_m, s).separation_deg, float(seconds[nearest]))
    at = discs(near, lat, lon, height_m, middle)
    total = bool(at.moon_deg[0] > at.sun_deg[0])
    moon_km = INNER_MOON_KM if total else OUTER_MOON_KM  # a ring of sun breaks at the moon's mountains
    second = third = None
    if float(gap(middle, moon_km, True)[0]) < 0:
        parts = np.linspace(middle - 900, middle + 900, 91)  # the longest totality lasts 7.5 minutes, annularity 12.5
        ends = crossings(gap(parts, moon_km, True), 45)
        second, third = (None if k is None else root(lambda s: gap(s, moon_km, True), parts, k) for k in ends)
    magnitude = (at.sun_deg + at.moon_deg - at.separation_deg) / (2 * at.sun_deg)
    stamp = stamps(near)
    begin, end = (root(lambda s: gap(s, OUTER_MOON_KM, False), seconds, k) for k in (first, last))
    return SolarEclipse(
        stamp(begin), stamp(second), stamp(middle), stamp(third), stamp(end), total and second is not None,
        float(magnitude[0]), float(obscuration(at)[0]),
    )  # fmt: skip
