"""Cloud or no cloud in both pictures: the contingency table and its scores."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.comparison.tiles import NO_PIXEL, Interval, Tiles

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
SCORES = ("pod", "far", "ets", "observed_cover", "simulated_cover")
_BOUNDS = dict.fromkeys(SCORES, (0.0, 1.0)) | {"ets": (-1 / 3, 1.0)}
_REASONS = {
    "pod": "no cloud was observed",
    "far": "no cloud is simulated",
    "ets": "both pictures are all clear or all cloud",
}


@dataclass(frozen=True)
class Contingency:
    """Shares of the weight: hits, false alarms, misses, both clear; and the scores by name."""

    hits: float
    false_alarms: float
    misses: float
    both_clear: float
    scores: dict[str, Interval]


def table(sums: F64) -> dict[str, F64]:
    """Scores of sums (n, 4) of hits a, false alarms b, misses c and correct d; NaN where not defined.

    POD = a / (a + c), FAR = b / (a + b), ETS = (a - r) / (a + b + c - r) with r = (a + b)(a + c) / (a + b + c + d).
    """
    a, b, c, d = sums.T
    n = a + b + c + d
    random = (a + b) * (a + c) / n
    with np.errstate(invalid="ignore", divide="ignore"):
        undecided = a + b + c - random
        return {
            "pod": np.where(a + c > 0, a / (a + c), np.nan),
            "far": np.where(a + b > 0, b / (a + b), np.nan),
            "ets": np.where(undecided > 1e-12 * n, (a - random) / undecided, np.nan),
            "observed_cover": (a + c) / n,
            "simulated_cover": (a + b) / n,
        }


def contingency(observed: Mask, simulated: Mask, weight: F64, tiles: Tiles) -> Contingency:
    """Of masks (n,) of valid pixels."""
    cells = (observed & simulated, ~observed & simulated, observed & ~simulated, ~observed & ~simulated)
    values = np.stack([cell * weight for cell in cells], axis=-1)
    if not weight.size:
        return Contingency(*(np.nan,) * 4, dict.fromkeys(SCORES, Interval(np.nan, reason=NO_PIXEL)))

    def every(sums: F64) -> F64:
        found = table(sums)
        return np.stack([found[name] for name in SCORES])

    bounds, reasons = [_BOUNDS[name] for name in SCORES], [_REASONS.get(name, "") for name in SCORES]
    intervals = tiles.intervals_of_sums(tiles.sums(values), every, bounds, reasons)
    hits, false_alarms, misses, both_clear = map(float, values.sum(axis=0) / weight.sum())
    return Contingency(hits, false_alarms, misses, both_clear, dict(zip(SCORES, intervals, strict=True)))
