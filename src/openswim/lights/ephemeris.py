"""Times and bodies of JPL's DE421 as shipped by skyfield-data: offline, from 1900 to 9 October 2053."""

import functools
from datetime import datetime
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.times import Time, parse_time

FIRST_TIME, LAST_TIME = np.datetime64("1900-01-01"), np.datetime64("2053-10-09")
HEIGHTS_M = -2e4, 2e9  # of places; further away the time that light takes leaves the tables
FIRST_LEAP_SECONDS = np.datetime64("1972-01-01")  # before, civil time followed the Earth's rotation


@functools.cache
def timescale() -> Any:
    """Skyfield's, from its built-in tables."""
    from skyfield.api import load

    return load.timescale(builtin=True)


@functools.cache
def bodies() -> Any:
    """The ephemeris: `bodies()["moon"]`."""
    from skyfield.api import Loader

    folder = resources.files("skyfield_data").joinpath("data")
    return Loader(str(folder), verbose=False)("de421.bsp")


def skyfield_time(time: Time) -> Any:
    """`time`: ISO text, a datetime or a numpy datetime64; UTC unless it names its zone.

    Before 1972 there was no UTC with leap seconds, and times are UT1: read as UTC, they would turn the sky by .18
    degrees in 1900.
    """
    stamp = parse_time(time)
    if stamp is None or np.isnat(stamp) or not FIRST_TIME <= stamp < LAST_TIME:
        raise UserError(f"time {stamp} lies outside the ephemeris; give a time from 1900-01-01 to 2053-10-08")
    t: datetime = stamp.astype(datetime)
    calendar = timescale().ut1 if stamp < FIRST_LEAP_SECONDS else timescale().utc
    return calendar(t.year, t.month, t.day, t.hour, t.minute, t.second + t.microsecond * 1e-6)


def skyfield_times(times: NDArray[np.datetime64]) -> Any:
    """`times` (n,), UTC, as `skyfield_time` has one."""
    stamps = np.asarray(times).astype("datetime64[ms]")
    if not ((stamps >= FIRST_TIME) & (stamps < LAST_TIME)).all():
        raise UserError("times outside the ephemeris: give times from 1900-01-01 to 2053-10-08")
    if stamps.size and stamps.min() < FIRST_LEAP_SECONDS <= stamps.max():
        raise UserError("times before and after 1972 in one series: divide it there")
    day = stamps.astype("datetime64[D]")
    month = day.astype("datetime64[M]")
    seconds = (stamps - day) / np.timedelta64(1, "s")
    early = stamps.size and stamps.min() < FIRST_LEAP_SECONDS
    calendar = timescale().ut1 if early else timescale().utc
    year = month.astype("datetime64[Y]")
    return calendar(
        year.astype(int) + 1970, (month - year).astype(int) + 1, (day - month).astype(int) + 1, 0, 0, seconds
    )


def observer_at(time: Time, lat: float, lon: float, height_m: float = 0.0) -> Any:
    """`observer` at a time; the same object for sun, moon and planets of one picture."""
    return _observer_at(parse_time(time), float(lat), float(lon), float(height_m))


@functools.lru_cache(maxsize=4)
def _observer_at(time: np.datetime64 | None, lat: float, lon: float, height_m: float) -> Any:
    return observer(lat, lon, height_m).at(skyfield_time(time))


def observer(lat: float, lon: float, height_m: float = 0.0) -> Any:
    """A place on the WGS84 ellipsoid, degrees and metres, for skyfield."""
    from skyfield.api import wgs84

    if not -90 <= lat <= 90:
        raise UserError(f"latitude {lat} lies outside -90..90; give degrees north")
    if not -360 <= lon <= 360:
        raise UserError(f"longitude {lon} lies outside -360..360; give degrees east")
    low, high = HEIGHTS_M
    if not low <= height_m <= high:
        raise UserError(f"height {height_m:g} m lies outside {low:g}..{high:g}; give metres above sea level")
    return bodies()["earth"] + wgs84.latlon(lat, lon, elevation_m=height_m)


def standard_pressure_pa(height_m: float) -> float:
    """Of the air at a height, for refraction: 1010 hPa at sea level, a scale height of 9.1 km (as skyfield's)."""
    return float(101_000.0 * np.exp(-height_m / 9.1e3))
