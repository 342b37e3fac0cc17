"""Products of small matrices with rows of nodes: from moments to ordinates and back."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import REORDERED, part
from openswim.transport.engine.ordinates import harmonic_matrix
from openswim.transport.engine.pack import LANES, flat, read_quadruple, spread_quadruple, write
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

BLOCK = LANES  # nodes of a row that are kept, or swept as clear, together
_ZERO = FLOAT(0.0)
_TILE = 5  # rows of a matrix that are summed side by side: one alone waits for its own last sum


class Groups(NamedTuple):
    """Ordinates in groups, those of group g are first[g] to first[g + 1], and two matrices of each, `_tiled`.

    ``harmonics``, of its ordinates, leads from moments to ordinates; ``gather``, transposed and weighted, back.
    """

    first: np.ndarray
    harmonics: np.ndarray  # (groups, tiles, moments, _TILE)
    gather: np.ndarray  # (groups, tiles, ordinates, _TILE)


@part(REORDERED, inlined=True)
def _leave(y, at, row, again):
    """Write a row of BLOCK nodes, or add it to what is there."""
    write(y, at, row + read_quadruple(y, at) if again else row)


@part(REORDERED)
def multiply(tiles, g, rows, columns, x, x_at, x_stride, y, y_at, y_stride, again):
    """Rows of y, BLOCK nodes each from flat element ``y_at`` on, as group g's matrix (rows, columns) times rows of x.

    again: added to what is there.
    """
    n = g * tiles.shape[1] * tiles.shape[2] * _TILE
    for first in range(0, rows, _TILE):
        a = b = c = d = e = spread_quadruple(_ZERO)
        for m in range(columns):
            own = read_quadruple(x, x_at + m * x_stride)
            at = n + m * _TILE
            a += flat(tiles, at) * own
            b += flat(tiles, at + 1) * own
            c += flat(tiles, at + 2) * own
            d += flat(tiles, at + 3) * own
            e += flat(tiles, at + 4) * own
        n += tiles.shape[2] * _TILE
        at = y_at + first * y_stride
        _leave(y, at, a, again)
        if rows - first > 1:
            _leave(y, at + y_stride, b, again)
        if rows - first > 2:
            _leave(y, at + 2 * y_stride, c, again)
        if rows - first > 3:
            _leave(y, at + 3 * y_stride, d, again)
        if rows - first > 4:
            _leave(y, at + 4 * y_stride, e, again)


def _tiled(matrices: list[F64]) -> F32:
    """Matrices (tiles, columns, _TILE) of groups, _TILE rows beside each other; filled with zeros to the largest."""
    tiles = max(-(-len(m) // _TILE) for m in matrices)
    out = np.zeros((len(matrices), tiles * _TILE, max(m.shape[1] for m in matrices)), FLOAT)
    for one, m in zip(out, matrices, strict=True):
        one[: len(m), : m.shape[1]] = m
    return np.ascontiguousarray(np.swapaxes(out.reshape(len(matrices), tiles, _TILE, -1), 2, 3))


def in_groups(directions: F64, weight: F32, degree: int, least: int) -> Groups:
    """Ordinates (n, 3) in groups of ``least`` or more."""
    ends = np.linspace(0, len(directions), max(1, len(directions) // least) + 1).astype(np.int64)
    matrix = harmonic_matrix(directions, degree)
    weighted = weight[:, None] * matrix
    parts = [slice(a, b) for a, b in pairwise(ends)]
    return Groups(ends, _tiled([matrix[part] for part in parts]), _tiled([weighted[part].T for part in parts]))
