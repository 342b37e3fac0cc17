"""Linear interpolation: between the nodes of a grid or the pixels of an image, and between wavelengths."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def corners(
    ix: NDArray[Any], iy: NDArray[Any], shape: tuple[int, int], all_round: bool = False
) -> tuple[IntArray, IntArray, FloatArray]:
    """Rows, columns and weights (4, ...) of the nodes around fractional indices, for fields of a shape (ny, nx).

    Beyond the edge the edge holds; `all_round`: the columns close in a circle.
    """
    ny, nx = shape
    x, y = ix if all_round else np.clip(ix, 0, nx - 1), np.clip(iy, 0, ny - 1)
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    u, v = x - i, y - j
    right, above = (i + 1) % nx if all_round else np.minimum(i + 1, nx - 1), np.minimum(j + 1, ny - 1)
    i = i % nx if all_round else i
    weights = np.stack([(1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u])
    return np.stack([j, j, above, above]), np.stack([i, right, i, right]), weights


def at_wavelengths(known_nm: FloatArray, known: FloatArray, wavelengths_nm: FloatArray) -> FloatArray:
    """Spectra (..., nknown) interpolated linearly to (..., nwl); the ends hold beyond."""
    if known_nm.size == 1:
        return np.repeat(known, wavelengths_nm.size, axis=-1)
    order = np.argsort(known_nm)
    position = np.interp(wavelengths_nm, known_nm[order], np.arange(known_nm.size))
    lower = np.minimum(position.astype(int), known_nm.size - 2)
    share = position - lower
    return known[..., order[lower]] * (1 - share) + known[..., order[lower + 1]] * share
