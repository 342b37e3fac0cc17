"""Times as users and files write them."""

from __future__ import annotations

import re
from datetime import UTC, date, datetime

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError

Time = str | np.datetime64 | date | None

_UNITS_S = {"s": 1.0, "sec": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0}


def parse_time(time: Time) -> np.datetime64 | None:
    """A time as datetime64[ms], UTC; accepts ISO text (with "Z" or an offset), datetime and datetime64."""
    if time is None:
        return None
    try:
        stamp = datetime.fromisoformat(time.strip().replace("_", "T")) if isinstance(time, str) else time
        if isinstance(stamp, datetime) and stamp.tzinfo is not None:
            stamp = stamp.astimezone(UTC).replace(tzinfo=None)
        return np.datetime64(stamp).astype("datetime64[ms]")
    except (ValueError, OverflowError, TypeError) as error:
        raise UserError(f"time {shown(time)} is not understood: write it as 2005-08-28T18:00 (UTC)") from error


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
