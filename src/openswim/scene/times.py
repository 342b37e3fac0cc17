"""Times as users and files write them."""

from __future__ import annotations

import re
import warnings
from datetime import UTC, date, datetime
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError

Time = str | np.datetime64 | date | None

_STAMP = re.compile(  # Python would take any sign between day and hour, and 12.30 for a third of a second past twelve
    r"\d{4}-?\d\d-?\d\d([T _-]\d\d(:?\d\d(:?\d\d([.,]\d+)?)?)?\s*(Z|[+-]\d\d(:?\d\d){0,2})?)?", re.IGNORECASE
)
_LEAP_SECOND = re.compile(r"(?<=59)(:?)60([.,]\d+)?")
_ZONE = re.compile(r"(since\s+\d+-\d+-\d+[T\s]+\d\d?(?::\d\d?(?::\d\d?(?:\.\d*)?)?)?)\s+(\d\d?:\d\d)\s*$")
REAL_CALENDARS = ("standard", "gregorian", "proleptic_gregorian", "")
SAME_NAMES = ("noleap", "365_day", "all_leap", "366_day", "360_day")  # calendars whose dates are called as real ones
_UNITS_S = {"s": 1.0, "sec": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0}


def parse_time(time: Time, notes: list[str] | None = None) -> np.datetime64 | None:
    """A time as datetime64[ms], UTC; accepts ISO text (with "Z" or an offset), datetime and datetime64, arrays of one
    without dimensions, and the start of a period of pandas. Leap seconds, which no clock of ours has, end the second
    before."""
    if time is None:
        return None
    try:
        alone = _alone(time)
        stamp = _of_text(alone.strip()) if isinstance(alone, str) else alone
        if isinstance(stamp, datetime) and stamp.tzinfo is not None:
            stamp = stamp.astimezone(UTC).replace(tzinfo=None)
        told = _told_of_calendar(stamp)
        if told and notes is None:
            warnings.warn(told, stacklevel=2)
        elif told and notes is not None:
            notes.append(told)
        return np.datetime64(stamp).astype("datetime64[ms]")
    except (ValueError, OverflowError, TypeError) as error:
        raise UserError(f"time {shown(time)} is not understood: write it as 2005-08-28T18:00 (UTC)") from error


def _told_of_calendar(stamp: Any) -> str:
    """What is to be told of a date of cftime; raises UserError where there is no day of this name."""
    calendar = str(getattr(stamp, "calendar", ""))
    if calendar in REAL_CALENDARS:
        return ""
    day = stamp.isoformat()
    try:
        date(stamp.year, stamp.month, stamp.day)
        known = calendar in SAME_NAMES
    except ValueError:
        known = False
    if not known:
        raise UserError(f"time {day} is of the calendar {calendar}, and no day that the sun knows: give a date of the "
                        "Gregorian calendar")  # fmt: skip
    return f"time {day} is of the calendar {calendar}: taken for the day of this name in the Gregorian one"


def _alone(time: Any) -> Any:
    """What stands in an array without dimensions; the first moment of a period of pandas, whose hours numpy drops."""
    if isinstance(time, xr.DataArray):
        time = time.values
    if isinstance(time, np.ndarray) and time.ndim == 0:
        time = time[()]
    return getattr(time, "start_time", time)


def _of_text(text: str) -> datetime:
    plain = _LEAP_SECOND.sub(r"\g<1>59.999", text)
    if not _STAMP.fullmatch(plain):
        raise ValueError("no such time")
    return datetime.fromisoformat(plain.replace("_", "T"))


def with_signed_zone(units: str) -> str:
    """Units of times, such as "hours since 2019-01-01 17:00:00 0:00", with a sign before a zone that has none, which
    pandas would take for the clock."""
    return _ZONE.sub(r"\1 +\2", units)


def since_1970_s(time: np.datetime64) -> float:
    """Seconds since the beginning of 1970, as files have it."""
    return float((time - np.datetime64("1970-01-01", "ms")) / np.timedelta64(1, "s"))


def rounded(times: NDArray[np.datetime64]) -> NDArray[np.datetime64]:
    """To the millisecond: files keep times as floating-point numbers."""
    return (times.astype("datetime64[us]") + np.timedelta64(500, "us")).astype("datetime64[ms]")


def interval_s(name: str, text: str) -> float:
    """Seconds of "5min", "30s" or "1h": a millisecond to some thirty years."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([a-z]+)\s*", text.lower())
    seconds = float(match[1]) * _UNITS_S.get(match[2], 0.0) if match else 0.0
    if not 1e-3 <= seconds <= 1e9:
        raise UserError(f"{name} {shown(text)}: write a length of time, such as 5min, 30s or 1h")
    return seconds
