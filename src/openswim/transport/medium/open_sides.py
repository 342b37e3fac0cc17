"""The sides of a grid beyond which there is no other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.medium.medium import Medium

F64 = NDArray[np.float64]


def open_sides(medium: Medium, wider: Medium | None) -> NDArray[np.bool_]:
    """Whether nothing is beyond a medium's sides (2, 2), of x and y, below and above: no ``wider`` grid, or one that
    ends there, within half a cell."""
    p = medium.place
    if wider is None or min(p.shape[:2]) < 2:
        return np.full((2, 2), wider is None)
    _, ny, nx = wider.shape

    def is_open(last: F64, before: F64) -> bool:
        x, y = wider.indices(1.5 * last - 0.5 * before)
        beside = (x < 0) | (y < 0) | (x > nx - 1) | (y > ny - 1)
        return bool(beside.mean() > 0.5)

    across = [is_open(p[:, 0], p[:, 1]), is_open(p[:, -1], p[:, -2])]
    return np.array([across, [is_open(p[0], p[1]), is_open(p[-1], p[-2])]])
