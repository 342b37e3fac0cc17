"""Products of sparse matrices with rows of nodes: from moments to ordinates and back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from openswim.transport.pack import LANES, flat, read_quadruple, spread_quadruple, write

BLOCK = 2 * LANES  # nodes of a row that are kept, or swept as clear, together
_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ZERO = np.float32(0.0)


class SparseRows(NamedTuple):
    """Nonzeros of a matrix: those of row r are start[r] to start[r + 1]."""

    start: np.ndarray
    column: np.ndarray
    value: np.ndarray


class Mirrored(NamedTuple):
    """Harmonics of ordinates, ``matrix``, as a product of two sparse matrices, and the way back, weighted.

    Mirrored in x and y, an ordinate's harmonics change but in sign: those of one parity are summed once for up to
    four ordinates (`parts`) and the sums combined with their signs (`whole`); `gather` and `spread` are the
    transposes, with the ordinates' weights.
    """

    parts: SparseRows
    whole: SparseRows
    gather: SparseRows
    spread: SparseRows


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def multiply(sparse, x, x_at, x_stride, y, y_at, y_stride, again):
    """Rows of y, BLOCK nodes each from flat element ``y_at`` on, as a matrix times rows of x; ``again``: added."""
    for r in range(sparse.start.shape[0] - 1):
        at = y_at + r * y_stride
        one, two = spread_quadruple(_ZERO), spread_quadruple(_ZERO)
        if again:
            one, two = read_quadruple(y, at), read_quadruple(y, at + LANES)
        for n in range(flat(sparse.start, r), flat(sparse.start, r + 1)):
            v, c = flat(sparse.value, n), x_at + flat(sparse.column, n) * x_stride
            one += v * read_quadruple(x, c)
            two += v * read_quadruple(x, c + LANES)
        write(y, at, one)
        write(y, at + LANES, two)
