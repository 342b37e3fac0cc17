"""Majorants of single cells, and how far empty cells reach, for rays that go from cell to cell."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.threads import in_threads

F32 = NDArray[np.float32]
_MOST = 255
_ROUNDS = 3  # about a periodic domain; each sees a period farther


def cell_majorants(extinction: F32, periodic: bool) -> F32:
    """Greatest extinction in cells (y, x, nz - 1) between nodes (nz, ny, nx); periodic ones have a cell per column.

    A column lies in a line or two of the cache.
    """
    out = extinction
    for axis in range(3):
        n = out.shape[axis]
        if n > 1:
            beyond = np.roll(out, -1, axis)
            out = np.maximum(out, beyond)
            if axis == 0 or not periodic:
                out = out.take(np.arange(n - 1), axis)
    return np.ascontiguousarray(np.moveaxis(out, 0, -1) * np.float32(1.000001), np.float32)


def free_cells(majorant: F32, periodic: bool, columns: tuple[int, int]) -> NDArray[np.uint8]:
    """How many cells ahead are empty, itself included: (8, y, x, z), by octant: +1 toward x, +2 toward y, +4 upward.

    A cube of that many cells' edge is empty, or beyond an open domain. ``columns`` (ny, nx): a single one has no
    neighbours. Counts are right or too small, so that jumps stay exact.
    """
    free = np.zeros((8, *majorant.shape), np.uint8)
    in_threads(_count, majorant, periodic, columns[0] > 1, columns[1] > 1, free)
    return free


@njit(cache=True, error_model="numpy", nogil=True)
def _count(t, threads, majorant, periodic, many_y, many_x, free):
    ny, nx, nz = majorant.shape
    for octant in range(t, 8, threads):
        sx, sy, sz = 2 * (octant & 1) - 1, (octant & 2) - 1, (octant & 4) // 2 - 1
        for _ in range(_ROUNDS if periodic else 1):
            for n in range(nz * ny * nx):
                k, j, i = n // (ny * nx), n // nx % ny, n % nx
                k = nz - 1 - k if sz > 0 else k
                j = ny - 1 - j if sy > 0 else j
                i = nx - 1 - i if sx > 0 else i
                if majorant[j, i, k] > 0.0:
                    continue
                least = _MOST
                for step in range(1, 8):
                    a, b, c = step & 1, step >> 1 & 1, step >> 2
                    if (a and not many_x) or (b and not many_y):
                        continue
                    p, q, r = i + a * sx, j + b * sy, k + c * sz
                    if periodic:
                        p, q = p % nx, q % ny
                    if 0 <= p < nx and 0 <= q < ny and 0 <= r < nz:
                        least = min(least, int(free[octant, q, p, r]))
                free[octant, j, i, k] = min(least + 1, _MOST)
