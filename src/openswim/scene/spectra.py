"""What is known at some wavelengths, at others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def at_wavelengths(known_nm: FloatArray, known: FloatArray, wavelengths_nm: FloatArray) -> FloatArray:
    """Spectra (..., nknown) interpolated linearly to (..., nwl); the ends hold beyond."""
    if known_nm.size == 1:
        return np.repeat(known, wavelengths_nm.size, axis=-1)
    order = np.argsort(known_nm)
    position = np.interp(wavelengths_nm, known_nm[order], np.arange(known_nm.size))
    lower = np.minimum(position.astype(int), known_nm.size - 2)
    share = position - lower
    return known[..., order[lower]] * (1 - share) + known[..., order[lower + 1]] * share
