"""One exposure curve for a film, so slow that nobody notices it: what each frame would like, within bounds.

What frames want is first taken as the median over about a second, in which bright things that pass by are lost while
dusk, however fast, stays as it is. The logarithm of the curve changes by `RATE` at most, and faster only where frames
would else be `MOST_OFF` too dark or too bright, as at twilight in a film of a day: there by as much as the taut
string through that corridor, which of all curves in it has the least of any convex measure of its slopes (Davies and
Kovac 2001). Of all curves of such slopes the one is taken that is least far from what the frames want at its worst:
the mean of the largest one below and the smallest one above. Its corners are rounded, but nowhere so far that a frame
leaves the corridor that it was in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]

RATE = 0.1  # stops per second of the film, which nobody notices
MOST_OFF = 1.0  # stops that a frame may be darker or brighter than it would be by itself
PASSING_S = 0.5  # what lasts no longer passes by, as marks of a runway do
ROUNDED_S = 0.3  # standard deviation of the mean that rounds the corners of the curve
LEAST_FRAMES = 1.0  # and at least so many frames, of either


def exposure_curve(wanted: ArrayLike, frames_per_second: float) -> F64:
    """Factors (n,) from L' to display light for a film, from what each frame by itself wants (n,), positive."""
    passing, rounding = (max(seconds * frames_per_second, LEAST_FRAMES) for seconds in (PASSING_S, ROUNDED_S))
    stops = _lasting(np.log2(np.asarray(wanted, float)), round(passing))
    needed = np.abs(np.diff(taut(stops - MOST_OFF, stops + MOST_OFF)))
    curve = slow(stops, np.maximum(needed, RATE / frames_per_second))
    off = np.maximum(np.abs(curve - stops), MOST_OFF)
    return np.asarray(2.0 ** np.clip(_smooth(curve, rounding), stops - off, stops + off))


def taut(low: F64, high: F64) -> F64:
    """The shortest path (n,) between two curves (n,); its ends slide up and down."""
    begin, end = _parting(low, high), _parting(low[::-1], high[::-1])  # where it leaves its level at the ends
    if begin is None or end is None:
        return np.full(len(low), 0.5 * (low.max() + high.min()))
    (at, value), (last, level) = begin, (len(low) - 1 - end[0], end[1])
    low, high = low.copy(), high.copy()
    low[last] = high[last] = level
    path = np.concatenate([np.full(at + 1, value), np.empty(last - at - 1), np.full(len(low) - last, level)])
    while at < last:
        length, slope = _straight(low[at + 1 : last + 1] - value, high[at + 1 : last + 1] - value)
        path[at + 1 : at + length + 1] = value + slope * np.arange(1, length + 1)
        at += length
        value = float(path[at])
    return path


def _straight(low: F64, high: F64) -> tuple[int, float]:
    """How many steps a path from 0 between two curves (n,) goes straight on, and its slope; to their end at most, where
    they meet."""
    ahead = 64
    while True:
        steps = np.arange(1, min(ahead, len(low)) + 1)
        bend = _parting(low[:ahead] / steps, high[:ahead] / steps)
        if bend is not None:
            return bend[0] + 1, bend[1]
        if ahead >= len(low):
            return len(low), float(high[-1] / len(low))
        ahead *= 4


def _parting(low: F64, high: F64) -> tuple[int, float] | None:
    """Where bounds (n,) from below and above first contradict each other: which of the earlier bounds binds, and its
    value; None where one value meets them all."""
    above, below = np.maximum.accumulate(low), np.minimum.accumulate(high)
    crossed = np.flatnonzero(above > below + 1e-12)
    if not crossed.size:
        return None
    at = int(crossed[0])
    binding = int(np.argmin(high[:at])) if low[at] > below[at - 1] else int(np.argmax(low[:at]))
    return binding, float(high[binding] if low[at] > below[at - 1] else low[binding])


def slow(curve: F64, steepest: F64) -> F64:
    """The function (n,) of steps up to ``steepest`` (n - 1,) that is least far from a curve (n,) at its worst."""
    tilt = np.append(0.0, np.cumsum(steepest))

    def below(values: F64) -> F64:
        forward = np.minimum.accumulate(values - tilt) + tilt
        return np.asarray(np.minimum.accumulate((forward + tilt)[::-1])[::-1] - tilt)

    return np.asarray(0.5 * (below(curve) - below(-curve)))


def _lasting(curve: F64, passing: int) -> F64:
    """A curve (n,) without what lasts no longer than ``passing`` steps: its median over so many to either side, or over
    as many as there are to both, so that what rises or falls all the while is as it was."""
    n = len(curve)
    reach = np.minimum(np.minimum(np.arange(n), np.arange(n)[::-1]), passing)
    return np.array([np.median(curve[k - r : k + r + 1]) for k, r in enumerate(reach)])


def _smooth(curve: F64, sigma: float) -> F64:
    """A Gaussian mean of so many frames; near the ends, where it has one side only, along the line through what there
    is, so that dusk goes on there as it does."""
    if len(curve) < 2:
        return curve
    reach = min(int(np.ceil(3 * sigma)), len(curve) - 1)
    ahead = np.arange(-reach, reach + 1.0)
    weights = np.exp(-0.5 * (ahead / sigma) ** 2)

    def summed(values: F64, power: int) -> F64:
        return np.convolve(np.pad(values, reach), (weights * ahead**power)[::-1], mode="valid")

    once = np.ones_like(curve)
    zeroth, first, second = (summed(once, power) for power in range(3))
    return np.asarray((second * summed(curve, 0) - first * summed(curve, 1)) / (second * zeroth - first**2))
