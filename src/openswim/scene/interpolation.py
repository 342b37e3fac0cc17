"""Interpolation: between the nodes of a grid or the pixels of an image, from a model's own levels to others, and
between wavelengths."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def smooth_step(t: Any) -> FloatArray:
    """0 up to t = 0, 1 from t = 1 on, a cubic without kinks between."""
    t = np.clip(t, 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


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


def on_levels(field: F32, heights: NDArray[Any], levels: FloatArray, extend: bool) -> F32:
    """Linear interpolation in height, column by column; zero above the top, the lowest value down to the ground.

    field (nz, ny, nx) at heights (nz,) or (nz, ny, nx), to levels (n,), m; extend: also below flat levels' lowest.
    """
    out = np.zeros((len(levels), *field.shape[1:]), np.float32)
    if heights.ndim == 1:
        k = np.clip(np.searchsorted(heights, levels, "right") - 1, 0, len(heights) - 2)
        c = np.clip((levels - heights[k]) / (heights[k + 1] - heights[k]), 0, 1).astype(np.float32)
        for n, z in enumerate(levels):
            out[n] = field[k[n]] * (1 - c[n]) + field[k[n] + 1] * c[n]
            if z > heights[-1] + 1e-6 or (z < heights[0] - 1e-6 and not extend):
                out[n] = 0
        return out
    for n, z in enumerate(levels):
        k = np.clip((heights <= z).sum(axis=0) - 1, 0, heights.shape[0] - 2)[None]
        h0, h1 = np.take_along_axis(heights, k, 0)[0], np.take_along_axis(heights, k + 1, 0)[0]
        c = np.clip((z - h0) / (h1 - h0), 0, 1)
        f0, f1 = np.take_along_axis(field, k, 0)[0], np.take_along_axis(field, k + 1, 0)[0]
        out[n] = np.where(z > h1, 0, f0 * (1 - c) + f1 * c)
    return out
