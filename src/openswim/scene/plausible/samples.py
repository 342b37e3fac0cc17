"""Columns that stand for all where a mean is asked for, and how a factor is told."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_SAMPLES = 64  # columns each way that stand for all where a mean is asked for


def times_text(factor: float) -> str:
    """ "1000 times too large", "100 times too small" of a factor that is near a power of ten; else ""."""
    power = round(float(np.log10(max(abs(factor), 1e-30))))
    return "" if power == 0 else f"{10.0 ** abs(power):g} times too {'large' if power > 0 else 'small'}"



def sampled(field: NDArray[Any]) -> NDArray[Any]:
    """Some columns of a field (..., y, x), spread evenly."""
    rows, columns = (max(1, size // _SAMPLES) for size in field.shape[-2:])
    return field[..., ::rows, ::columns]
