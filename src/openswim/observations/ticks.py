"""Round numbers for the axes of plots."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def round_step(least: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is not below."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(power * digit for digit in (1, 2, 5, 10) if power * digit >= least * (1 - 1e-9)))


def round_ticks(low: float, high: float, most: int = 6) -> F64:
    """Multiples of a round step from low to high, at most so many."""
    step = round_step((high - low) / max(most - 1, 1))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return np.asarray(np.arange(first, last + 1) * step + 0.0)  # no -0
