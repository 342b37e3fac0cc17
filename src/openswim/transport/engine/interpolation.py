"""Fields on the grid's columns, read anywhere between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def bilinear(values: NDArray, ix: F64, iy: F64, periodic: bool = False) -> F64:
    """values (..., ny, nx) at fractional indices (n,), clamped to the edge or repeated: (n, ...)."""
    ny, nx = values.shape[-2:]
    i, right, x = _between(ix, nx, periodic)
    j, up, y = _between(iy, ny, periodic)
    flat = values.reshape(*values.shape[:-2], ny * nx)

    def along(row: NDArray[np.int64]) -> F64:
        low = flat[..., row * nx + i]
        return np.asarray(low + (flat[..., row * nx + right] - low) * x)

    low = along(j)
    return np.moveaxis(low + (along(up) - low) * y, -1, 0)


def _between(at: F64, count: int, periodic: bool) -> tuple[NDArray[np.int64], NDArray[np.int64], F64]:
    """The nodes on both sides of fractional indices, and how far from the first of them."""
    if periodic:
        low = np.floor(at)
        first = low.astype(int) % count
        return first, (first + 1) % count, at - low
    at = np.clip(at, 0, count - 1)
    first = np.minimum(at.astype(int), max(count - 2, 0))
    return first, np.minimum(first + 1, count - 1), at - first
