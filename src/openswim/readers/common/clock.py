"""The time of scenes whose files do not say it."""

from __future__ import annotations

import numpy as np

from openswim.readers.common.base import iso
from openswim.scene.times import Time, parse_time

DEFAULT_DATE = np.datetime64("2000-03-20T10:00:00", "ms")  # local mean solar time: the sun is up nearly everywhere


def undated(time: Time, lon: float | None, notes: list[str]) -> np.datetime64:
    """The time asked for; where none is, 10 o'clock local solar time on 20 March 2000. A note says so."""
    wanted = parse_time(time)
    if wanted is not None:
        notes.append("no date in the file: the time that was asked for")
        return wanted
    chosen = start_of_undated(lon)
    notes.append(f"no date in the file: {iso(chosen)} UTC (10 h local solar time at the equinox); give a time (--time)")
    return chosen


def start_of_undated(lon: float | None) -> np.datetime64:
    """10 o'clock local mean solar time at a longitude, as UTC."""
    return DEFAULT_DATE - np.timedelta64(round((lon or 0.0) / 15.0 * 3600.0), "s")
