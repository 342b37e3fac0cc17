"""Which measured moments had a clear sky: steady, and near the model's clear sky in every component measured.

Global light alone is not enough: thin cloud takes from the beam what it adds to the diffuse light. So all that was
measured has to agree, as in Bright et al. (2020), "Bright-Sun"; the limits are those of the ratio to the model's sky.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

WINDOW_MINUTES = 10.0
LIMITS = {  # standard deviation within the window, lowest and highest ratio of measured to modelled
    "ghi": (0.015, 0.8, 1.2),
    "dni": (0.03, 0.75, 1.25),
    "dhi": (0.06, 0.5, 1.7),
}


def clear_times(
    time: NDArray[np.datetime64], measured: Mapping[str, F64], model: Mapping[str, F64]
) -> NDArray[np.bool_]:
    """(n,) whether the sky was clear, from those of ghi, dni and dhi (n,) that were measured, beside the model's.

    Missing values are not clear. A day whose aerosol differs much from the model's wants the model fitted first.
    """
    clear = np.ones(time.size, bool)
    for name, (spread, low, high) in LIMITS.items():
        if name not in measured:
            continue
        with np.errstate(all="ignore"):
            ratio = measured[name] / model[name]
        clear &= _spread(time, ratio) < spread
        clear &= (ratio > low) & (ratio < high)
    return clear


def minutes_apart(time: NDArray[np.datetime64]) -> float:
    """From one time to the next, as a rule; 0 of a single one."""
    steps = np.diff(time) / np.timedelta64(1, "s") / 60.0
    return float(np.median(steps)) if steps.size else 0.0


def _spread(time: NDArray[np.datetime64], ratio: F64) -> F64:
    """Standard deviation (n,) within the window about each time; infinite where fewer than three values are in it."""
    minutes = (time - time[0]) / np.timedelta64(1, "s") / 60.0
    half = WINDOW_MINUTES / 2
    first, last = np.searchsorted(minutes, minutes - half), np.searchsorted(minutes, minutes + half, side="right")
    out = np.full(ratio.size, np.inf)
    for i, (start, end) in enumerate(zip(first, last, strict=True)):
        window = ratio[start:end]
        if np.isfinite(window).sum() >= 3:  # over the model's 0 before sunrise nothing is finite
            out[i] = np.std(window[np.isfinite(window)])
    return out
