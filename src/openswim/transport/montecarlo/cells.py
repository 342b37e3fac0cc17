"""What single cells hold, and how far empty ones reach, for rays that go from cell to cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.engine.threads import in_threads

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

BLOCK = 4
MIXED, EMPTY = 128, 192
_FINENESS = 0.05  # of the majorants' codes
_MOST = 255
_ROUNDS = 3  # about a periodic domain; each sees a period farther


def cell_majorants(extinction: F32, periodic: bool) -> F32:
    """Greatest extinction in cells (y, x, nz - 1) between nodes (nz, ny, nx); periodic ones have a cell per column.

    A column lies in a line or two of the cache.
    """
    return np.ascontiguousarray(over_corners(np.maximum, extinction, periodic) * np.float32(1.000001), np.float32)


def over_corners(most: np.ufunc, values: F32, periodic: bool) -> F32:
    """The greatest (or least) of what is at the nodes (nz, ny, nx) of cells (y, x, nz - 1)."""
    out = values
    for axis in range(3):
        n = out.shape[axis]
        if n > 1:
            out = most(out, np.roll(out, -1, axis))
            if axis == 0 or not periodic:
                out = out.take(np.arange(n - 1), axis)
    return np.moveaxis(out, 0, -1)


def free_cells(majorant: F32, periodic: bool, columns: tuple[int, int]) -> U8:
    """How many cells ahead are empty, itself included: (8, y, x, z), by octant: +1 toward x, +2 toward y, +4 upward.

    A cube of that many cells' edge is empty, or beyond an open domain. ``columns`` (ny, nx): a single one has no
    neighbours. Counts are right or too small, so that jumps stay exact.
    """
    free = np.zeros((8, *majorant.shape), np.uint8)
    in_threads(_count, majorant, periodic, columns[0] > 1, columns[1] > 1, free)
    return free


class Cells(NamedTuple):
    """What a flat world's cells hold, in blocks of four each way: rays find nearly all of it in a core's own cache."""

    ahead: U8  # (y, x, z, 8) by octant: how many cells ahead of a block's empty ones are empty; MIXED more with cloud
    code: U8  # (y, x, z, 64) a line of the cache: majorants, from EMPTY on 1, 2, ... empty cells in all directions
    majorant: F64  # (EMPTY,) by code


def cells_of(majorant: F32, free: U8) -> Cells:
    """Blocks of `cell_majorants` and `free_cells`."""
    most = float(majorant.max()) or 1.0
    table = most * np.exp(-_FINENESS * np.arange(EMPTY))
    code = (EMPTY - 1) + np.minimum(free.min(axis=0), 256 - EMPTY)
    full = majorant > 0
    code[full] = np.clip(np.log(most / majorant[full].astype(float)) / _FINENESS - 1e-6, 0, EMPTY - 1)
    ahead = np.where(full, MIXED - 1, np.minimum(free, MIXED - 1)).astype(np.uint8)
    pad = [(0, -n % BLOCK) for n in majorant.shape]
    code = np.pad(code, pad, constant_values=255).astype(np.uint8)
    ahead = np.pad(ahead, [(0, 0), *pad], constant_values=MIXED - 1)
    y, x, z = (n // BLOCK for n in code.shape)
    code = code.reshape(y, BLOCK, x, BLOCK, z, BLOCK).transpose(0, 2, 4, 1, 3, 5).reshape(y, x, z, BLOCK**3)
    ahead = ahead.reshape(8, y, BLOCK, x, BLOCK, z, BLOCK).min(axis=(2, 4, 6))
    ahead += np.where((code < EMPTY).any(axis=-1), np.uint8(MIXED), np.uint8(0))
    return Cells(np.ascontiguousarray(np.moveaxis(ahead, 0, -1)), np.ascontiguousarray(code), table)


def no_cells() -> Cells:
    u8 = np.uint8
    return Cells(np.zeros((1, 1, 1, 8), u8), np.full((1, 1, 1, BLOCK**3), 255, u8), np.zeros(EMPTY))


class Shade(NamedTuple):
    """Optical depths to the sun, exact at nodes: what the sun's light is guessed by before chance corrects it.

    Indices of the ground's nodes are those of the columns, from (first_y, first_x) on; it reaches beyond the domain.
    """

    depth: F32  # (nz, ny, nx, ns) at the reference wavelength
    doubt: U8  # (y, x, nz - 1) how far transmissions at a cell's corners lie apart, of 255
    ground_depth: F32  # (my, mx, ns)
    ground_doubt: U8  # (my - 1, mx - 1)
    first_y: int
    first_x: int
    beyond: float  # doubt where the ground has no nodes


def no_shade() -> Shade:
    f32, u8 = np.float32, np.uint8
    depth, ground_depth = np.zeros((1, 1, 1, 1), f32), np.zeros((1, 1, 1), f32)
    return Shade(depth, np.zeros((1, 1, 1), u8), ground_depth, np.zeros((1, 1), u8), 0, 0, 1.0)


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
