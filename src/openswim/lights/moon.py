"""The moon as seen from one place: where it stands, its phase, and which way up it is."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.lights.ephemeris import bodies, observer_at, standard_pressure_pa
from openswim.lights.refraction import refracted_altitude_deg
from openswim.scene.times import Time

MOON_RADIUS_KM = 1737.4  # IAU 2015, mean
J2000_DAY = 2_451_545.0  # barycentric dynamical time

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Moon:
    """The moon from one place, apparent and topocentric; degrees unless the name says else.

    Angles on its disc count from the zenith counter-clockwise on the sky, toward smaller azimuth as one faces it.
    Selenographic places are east longitude and north latitude in the mean Earth frame.
    """

    altitude_deg: float  # geometric, without refraction
    azimuth_deg: float  # clockwise from north
    refracted_altitude_deg: float
    distance_km: float
    sun_distance_au: float  # of the moon from the sun
    angular_radius_deg: float
    phase_angle_deg: float  # at the moon, from sun to observer: 0 full, 180 new
    illuminated: float  # share of the disc
    axis_from_zenith_deg: float  # direction of the lunar north pole
    bright_limb_from_zenith_deg: float  # direction of the sun from the disc's centre
    sub_observer_lonlat_deg: tuple[float, float]  # the middle of the disc (libration)
    subsolar_lonlat_deg: tuple[float, float]


def moon_position(time: Time, lat: float, lon: float, height_m: float = 0.0) -> Moon:
    """The moon at a time (UTC; before 1972 UT1) from a place on the WGS84 ellipsoid, refracted as stars are."""
    here = observer_at(time, lat, lon, height_m)
    t = here.t
    moon = here.observe(bodies()["moon"])
    altitude, azimuth, distance = moon.apparent().altaz()
    toward_moon = _unit(moon.apparent().position.km)
    toward_sun = _unit(here.observe(bodies()["sun"]).apparent().position.km)
    zenith = _unit(here.from_altaz(alt_degrees=90.0, az_degrees=0.0).position.km)

    # as light left the moon: the moon's axes then, and the sun as it stood from there
    then = t.tdb - moon.light_time
    from_moon = -_unit(moon.position.km)
    at_moon = bodies()["moon"].at(t.ts.tdb_jd(then))
    sun_at_moon = at_moon.observe(bodies()["sun"]).position
    sun_of_moon = _unit(sun_at_moon.km)
    axes = moon_axes(then)
    phase = np.arctan2(np.linalg.norm(np.cross(from_moon, sun_of_moon)), from_moon @ sun_of_moon)
    return Moon(
        altitude_deg=float(altitude.degrees),
        azimuth_deg=float(azimuth.degrees),
        refracted_altitude_deg=float(refracted_altitude_deg(altitude.degrees, standard_pressure_pa(height_m))),
        distance_km=float(distance.km),
        sun_distance_au=float(np.linalg.norm(sun_at_moon.au)),
        angular_radius_deg=float(np.degrees(np.arcsin(MOON_RADIUS_KM / distance.km))),
        phase_angle_deg=float(np.degrees(phase)),
        illuminated=float((1 + np.cos(phase)) / 2),
        axis_from_zenith_deg=_turned(toward_moon, zenith, axes[2]),
        bright_limb_from_zenith_deg=_turned(toward_moon, zenith, toward_sun),
        sub_observer_lonlat_deg=_lonlat(axes @ from_moon),
        subsolar_lonlat_deg=_lonlat(axes @ sun_of_moon),
    )


def moon_axes(tdb_day: float) -> F64:
    """Rows x (mean sub-Earth meridian), y, z (north pole) of the moon's mean Earth frame in ICRF; Julian day, TDB.

    Archinal et al. 2011 (IAU working group, report of 2009, table 2 and its footnote); within .004 degrees of the
    ephemeris' own libration from 1900 to 2053.
    """
    days = tdb_day - J2000_DAY
    e = np.radians(_E_DEG[:, 0] + _E_DEG[:, 1] * days)
    sine, cosine = np.sin(e), np.cos(e)
    ascension = 269.9949 + 0.0031 * days / 36525 + _POLE_ASCENSION_DEG @ sine
    declination = 66.5392 + 0.0130 * days / 36525 + _POLE_DECLINATION_DEG @ cosine
    meridian = 38.3213 + 13.17635815 * days - 1.4e-12 * days**2 + _MERIDIAN_DEG @ sine
    a, d, w = np.radians([ascension, declination, meridian])
    pole = np.array([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)])
    node = np.array([-np.sin(a), np.cos(a), 0.0])  # of the lunar equator on the ICRF's
    x = np.cos(w) * node + np.sin(w) * np.cross(pole, node)
    return np.stack([x, np.cross(pole, x), pole])


# E1 to E13: degrees at J2000, and per day
_E_DEG = np.array([
    [125.045, -0.0529921], [250.089, -0.1059842], [260.008, 13.0120009], [176.625, 13.3407154], [357.529, 0.9856003],
    [311.589, 26.4057084], [134.963, 13.0649930], [276.617, 0.3287146], [34.226, 1.7484877], [15.134, -0.1589763],
    [119.743, 0.0036096], [239.961, 0.1643573], [25.053, 12.9590088],
])  # fmt: skip
_POLE_ASCENSION_DEG = np.array([
    -3.8787, -0.1204, 0.0700, -0.0172, 0, 0.0072, 0, 0, 0, -0.0052, 0, 0, 0.0043
])  # fmt: skip
_POLE_DECLINATION_DEG = np.array([
    1.5419, 0.0239, -0.0278, 0.0068, 0, -0.0029, 0.0009, 0, 0, 0.0008, 0, 0, -0.0009
])  # fmt: skip
_MERIDIAN_DEG = np.array([
    3.5610, 0.1208, -0.0642, 0.0158, 0.0252, -0.0066, -0.0047, -0.0046, 0.0028, 0.0052, 0.0040, 0.0019, -0.0044
])  # fmt: skip


def _unit(vector: Any) -> F64:
    return np.asarray(vector / np.linalg.norm(vector), float)


def _lonlat(place: F64) -> tuple[float, float]:
    return float(np.degrees(np.arctan2(place[1], place[0]))), float(np.degrees(np.arcsin(place[2])))


def _turned(toward: F64, start: F64, end: F64) -> float:
    """Angle (0-360) at the direction `toward` from that of `start` to that of `end`, counter-clockwise on the sky."""
    across = np.cross(toward, start)  # to the right of start, seen from inside the sphere with start on top
    return float(np.degrees(np.arctan2(-(across @ end), start @ end - (toward @ end) * (toward @ start))) % 360)
