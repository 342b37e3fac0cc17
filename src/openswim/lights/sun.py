"""Where the sun stands, from JPL's DE421 as shipped by skyfield-data: offline, years 1900-2050."""

import functools
from dataclasses import dataclass
from datetime import datetime
from importlib import resources
from typing import Any

import numpy as np

from openswim.errors import UserError
from openswim.scene.times import Time, parse_time

SUN_RADIUS_KM = 695_700.0  # IAU 2015 nominal
FIRST_TIME, LAST_TIME = np.datetime64("1900-01-01"), np.datetime64("2050-01-01")


@dataclass(frozen=True)
class Sun:
    """The sun as seen from one place; all of it apparent (light time and aberration included)."""

    altitude_deg: float  # geometric, without refraction
    azimuth_deg: float  # clockwise from north
    refracted_altitude_deg: float
    distance_au: float
    angular_radius_deg: float


@functools.cache
def _ephemeris() -> tuple[Any, Any]:
    from skyfield.api import Loader, load

    folder = resources.files("skyfield_data").joinpath("data")
    return load.timescale(builtin=True), Loader(str(folder), verbose=False)("de421.bsp")


def _skyfield_time(time: Time) -> Any:
    """`time`: ISO text, a datetime or a numpy datetime64; UTC unless it names its zone."""
    stamp = parse_time(time)
    if stamp is None or np.isnat(stamp) or not FIRST_TIME <= stamp < LAST_TIME:
        raise UserError(f"time {stamp} lies outside the ephemeris; give a time from 1900 to 2049")
    t: datetime = stamp.astype(datetime)
    timescale, _ = _ephemeris()
    return timescale.utc(t.year, t.month, t.day, t.hour, t.minute, t.second + t.microsecond * 1e-6)


def _check_place(lat: float, lon: float) -> None:
    """Refuse what cannot be a latitude and a longitude in degrees."""
    if not -90 <= lat <= 90:
        raise UserError(f"latitude {lat} lies outside -90..90; give degrees north")
    if not -360 <= lon <= 360:
        raise UserError(f"longitude {lon} lies outside -360..360; give degrees east")


def sun_position(
    time: Time,
    lat: float,
    lon: float,
    height_m: float = 0.0,
    pressure_pa: float | None = None,
    temperature_k: float = 283.15,
) -> Sun:
    """The apparent sun at a place on the WGS84 ellipsoid.

    Parameters: `time` UTC; `lat`, `lon` geographic, degrees; `height_m` above the ellipsoid; `pressure_pa`
    and `temperature_k` of the air at the observer, for the refraction (None: 1010 hPa at sea level and less
    above; Bennett 1982, about 0.1' above 15 degrees, minutes of arc at the horizon, none below -1 degree).
    Accuracy: about 0.0003 degree (DE421; the limit is UT1, extrapolated after skyfield's built-in table
    ends).
    """
    from skyfield.api import wgs84

    _check_place(lat, lon)
    t = _skyfield_time(time)
    _, bodies = _ephemeris()
    place = bodies["earth"] + wgs84.latlon(lat, lon, elevation_m=height_m)
    apparent = place.at(t).observe(bodies["sun"]).apparent()
    altitude, azimuth, distance = apparent.altaz()
    pressure_mbar = "standard" if pressure_pa is None else pressure_pa / 100
    refracted, _, _ = apparent.altaz(temperature_C=temperature_k - 273.15, pressure_mbar=pressure_mbar)
    return Sun(
        altitude_deg=float(altitude.degrees),
        azimuth_deg=float(azimuth.degrees),
        refracted_altitude_deg=float(refracted.degrees),
        distance_au=float(distance.au),
        angular_radius_deg=float(np.degrees(np.arcsin(SUN_RADIUS_KM / distance.km))),
    )


def subsolar_point(time: Time) -> tuple[float, float]:
    """Latitude and longitude (degrees) of the vertical that points at the apparent sun.

    A model's geographic latitude is the direction of the vertical.  On a sphere with those latitudes, the
    unit vector (cos lat cos lon, cos lat sin lon, sin lat) of this point is the direction toward the sun for
    every observer, and gives the ephemeris azimuth and altitude to .0025 degree, the sun's parallax.
    """
    from skyfield.framelib import itrs

    t = _skyfield_time(time)
    _, bodies = _ephemeris()
    apparent = bodies["earth"].at(t).observe(bodies["sun"]).apparent()
    lat, lon, _ = apparent.frame_latlon(itrs)
    return float(lat.degrees), (float(lon.degrees) + 180.0) % 360.0 - 180.0
