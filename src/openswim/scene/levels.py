"""Fields from a model's own levels to heights that all columns share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]


def on_levels(field: F32, heights: NDArray[Any], levels: NDArray[np.float64], extend: bool) -> F32:
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
