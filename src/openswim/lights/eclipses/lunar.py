"""Eclipses of the moon: when it is in the Earth's shadow, and how much light reaches it there."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.eclipses.contacts import crossings, least, root, stamps
from openswim.lights.eclipses.solar import EARTH_RADIUS_KM, Discs, light_left
from openswim.lights.ephemeris import bodies, skyfield_time
from openswim.lights.moon import MOON_RADIUS_KM
from openswim.lights.sun import SUN_RADIUS_KM
from openswim.scene.times import Time

F64 = NDArray[np.float64]

PARALLAX_SHARE = 0.99834 * 1.01  # of the equator's: a mean Earth (latitude 45), and 1 % of air (Danjon)
_STEP_S, _REACH_H = 60.0, 5.0


@dataclass(frozen=True)
class Shadow:
    """The Earth's shadow at the moon at times (n,), seen from the Earth's centre; degrees."""

    separation_deg: F64  # of the moon's centre from the shadow's
    umbra_deg: F64
    penumbra_deg: F64
    moon_deg: F64
    sun_deg: F64  # radius of the sun, as seen from the moon
    earth_deg: F64  # of the Earth with its air, as seen from the moon


@dataclass(frozen=True)
class LunarEclipse:
    """Contacts (UTC) of the moon with penumbra (p) and umbra (u); None where there is no such contact."""

    p1: np.datetime64
    u1: np.datetime64 | None
    u2: np.datetime64 | None
    greatest: np.datetime64
    u3: np.datetime64 | None
    u4: np.datetime64 | None
    p4: np.datetime64
    umbral_magnitude: float


def shadow(time: Time, seconds: ArrayLike = 0.0) -> Shadow:
    """The shadow so many ``seconds`` (n,) after a time (UTC)."""
    start = skyfield_time(time)
    t = start.ts.tt_jd(start.tt + np.atleast_1d(np.asarray(seconds, float)) / 86400.0)
    earth = bodies()["earth"].at(t)
    sun, moon = (earth.observe(bodies()[name]).apparent() for name in ("sun", "moon"))
    to_sun, to_moon = sun.distance().km, moon.distance().km
    parallax = np.degrees(np.arcsin(EARTH_RADIUS_KM / to_moon)) * PARALLAX_SHARE
    of_sun = np.degrees(np.arcsin(SUN_RADIUS_KM / to_sun))
    solar_parallax = np.degrees(np.arcsin(EARTH_RADIUS_KM / to_sun))
    separation = 180.0 - np.asarray(sun.separation_from(moon).degrees)
    return Shadow(
        separation, parallax + solar_parallax - of_sun, parallax + solar_parallax + of_sun,
        np.degrees(np.arcsin(MOON_RADIUS_KM / to_moon)), of_sun * to_sun / (to_sun + to_moon), parallax,
    )  # fmt: skip


def lunar_eclipse(near: Time) -> LunarEclipse | None:
    """The eclipse whose greatest phase lies within five hours of a time; None where the moon misses the shadow."""
    seconds = np.arange(-_REACH_H * 3600, _REACH_H * 3600 + 1, _STEP_S)
    along = shadow(near, seconds)

    def gap(s: ArrayLike, umbra: bool, whole: bool) -> F64:
        at = along if s is seconds else shadow(near, s)
        edge = at.umbra_deg if umbra else at.penumbra_deg
        return np.asarray(at.separation_deg - edge + (at.moon_deg if whole else -at.moon_deg))

    nearest = int(np.argmin(along.separation_deg))
    stamp = stamps(near)

    def contacts(umbra: bool, whole: bool) -> list[Any]:
        pair = crossings(gap(seconds, umbra, whole), nearest)
        return [None if k is None else stamp(root(lambda s: gap(s, umbra, whole), seconds, k)) for k in pair]

    p1, p4 = contacts(False, False)
    if p1 is None or p4 is None:
        return None
    middle = least(lambda s: shadow(near, s).separation_deg, float(seconds[nearest]))
    at = shadow(near, middle)
    magnitude = (at.umbra_deg + at.moon_deg - at.separation_deg) / (2 * at.moon_deg)
    u1, u4 = contacts(True, False)
    u2, u3 = contacts(True, True)
    return LunarEclipse(p1, u1, u2, stamp(middle), u3, u4, p4, float(magnitude[0]))


def shadow_light(at: Shadow, from_axis_deg: ArrayLike, wavelengths_nm: ArrayLike) -> F64:
    """Share (n, nw) of sunlight that reaches places on the moon at angles (n,) from the shadow's axis, at one time.

    Of the sun's disc what the Earth leaves free, and, in the umbra, what the Earth's air bends into it: a model of the
    usual brightness (V about -2 at mid-eclipse, 1e-3 of sunlight at the edge), reddened as light is that has passed the
    stratosphere and the troposphere. Great eruptions make it darker by magnitudes.
    """
    angle = np.atleast_1d(np.asarray(from_axis_deg, float))
    direct = light_left(
        Discs(angle, np.full(angle.shape, at.sun_deg[0]), np.full(angle.shape, at.earth_deg[0])), wavelengths_nm
    )
    depth = np.clip(1 - angle / at.umbra_deg[0], 0, 1)[:, None]  # 0 at the umbra's edge, 1 at its centre
    reddening = (np.asarray(wavelengths_nm, float) / 600.0) ** (3.0 + 6.0 * depth)
    bent = 6e-4 * np.exp(-3.2 * depth) * np.minimum(reddening, 3.0)
    outside = np.exp(-np.maximum(angle / at.umbra_deg[0] - 1, 0) * 8)[:, None]
    return np.asarray(direct + (1 - direct) * bent * outside)


def moonlight_left(time: Time, wavelengths_nm: ArrayLike) -> F64:
    """Share (nw,) of moonlight that the Earth's shadow leaves at a time: 1 outside of eclipses."""
    at = shadow(time)
    if at.separation_deg[0] >= at.penumbra_deg[0] + at.moon_deg[0]:
        return np.ones(np.shape(wavelengths_nm))
    n = 24
    nodes, weights = np.polynomial.legendre.leggauss(n)
    radius, turn = at.moon_deg[0] * np.sqrt((nodes + 1) / 2), (np.arange(n) + 0.5) * np.pi / n
    x = at.separation_deg[0] + radius[:, None] * np.cos(turn)
    angle = np.hypot(x, radius[:, None] * np.sin(turn))
    light = shadow_light(at, angle.ravel(), wavelengths_nm).reshape(n, n, -1).mean(axis=1)
    return np.asarray((weights / 2) @ light)
