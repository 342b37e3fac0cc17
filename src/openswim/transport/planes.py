"""Fields on the grid's columns, read anywhere between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def bilinear(values: NDArray, ix: F64, iy: F64) -> F64:
    """values (..., ny, nx) at fractional indices (n,), clamped to the edge: (n, ...)."""
    ny, nx = values.shape[-2:]
    x, y = np.clip(ix, 0, nx - 1), np.clip(iy, 0, ny - 1)
    i, j = np.minimum(x.astype(int), max(nx - 2, 0)), np.minimum(y.astype(int), max(ny - 2, 0))
    at, right, up = j * nx + i, min(1, nx - 1), nx * min(1, ny - 1)
    flat = values.reshape(*values.shape[:-2], ny * nx)

    def between(here: NDArray[np.int64]) -> F64:
        low = flat[..., here]
        return np.asarray(low + (flat[..., here + right] - low) * (x - i))

    low = between(at)
    return np.moveaxis(low + (between(at + up) - low) * (y - j), -1, 0)
