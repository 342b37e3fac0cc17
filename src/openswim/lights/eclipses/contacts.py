"""When gaps close and open: seconds after a time, and the times themselves."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.scene.times import Time, parse_time

F64 = NDArray[np.float64]
Gap = Callable[[Any], F64]


def stamps(near: Time) -> Any:
    """Seconds after a time as a time."""
    start = parse_time(near)
    assert start is not None  # skyfield_time has checked
    base = start.astype("datetime64[ms]")
    return lambda s: None if s is None else base + np.timedelta64(round(1000 * float(s)), "ms")


def crossings(gap: F64, middle: int) -> tuple[int | None, int | None]:
    """Indices before which a gap closes, and before which it opens again, about the middle."""
    if gap[middle] >= 0:
        return None, None
    closed = np.flatnonzero(gap >= 0)
    before, after = closed[closed < middle], closed[closed > middle]
    return (int(before[-1]) if before.size else None), (int(after[0]) - 1 if after.size else None)


def root(gap: Gap, seconds: F64, k: int) -> float:
    """Where the gap is zero between two of the seconds: lines, drawn anew."""
    low, high = float(seconds[k]), float(seconds[k + 1])
    for _ in range(3):
        parts = np.linspace(low, high, 9)
        values = gap(parts)
        n = int(np.flatnonzero(np.diff(np.sign(values)))[0])
        low, high = float(parts[n]), float(parts[n + 1])
    a, b = (float(v) for v in gap(np.array([low, high])))
    return low - a * (high - low) / (b - a) if b != a else low


def least(distance: Gap, start: float) -> float:
    """Where a distance is least, within a minute of the start: a parabola through its square."""
    parts = start + np.array([-60.0, 0.0, 60.0])
    p = np.polyfit(parts - start, distance(parts) ** 2, 2)
    return float(start - p[1] / (2 * p[0]))
