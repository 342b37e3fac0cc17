"""Products of sparse matrices with rows of nodes: from moments to ordinates and back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ZERO = np.float32(0.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def add(out, c, row):
    """out += c row."""
    for i in range(out.shape[0]):
        out[i] += c * row[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _add_four(out, c0, c1, c2, c3, r0, r1, r2, r3):
    """out += sum of four rows: fewer passes over the row."""
    for i in range(out.shape[0]):
        out[i] += c0 * r0[i] + c1 * r1[i] + c2 * r2[i] + c3 * r3[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _add_five(out, c0, c1, c2, c3, c4, r0, r1, r2, r3, r4):
    """out += sum of five rows."""
    for i in range(out.shape[0]):
        out[i] += c0 * r0[i] + c1 * r1[i] + c2 * r2[i] + c3 * r3[i] + c4 * r4[i]


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
def add_products(first, second, rows, at, sums, out, out_at, count):
    """Add (second matrix) (first matrix) (rows), ``count`` nodes from node ``at``, to ``out`` from node ``out_at``."""
    for r in range(sums.shape[0]):
        sums[r, :count] = _ZERO
    sparse, x, x0, y, y0 = first, rows, at, sums, 0
    for _ in range(2):
        c, v = sparse.column, sparse.value
        x1 = x0 + count
        for r in range(sparse.start.shape[0] - 1):
            row = y[r, y0 : y0 + count]
            n, last = sparse.start[r], sparse.start[r + 1]
            while n + 5 <= last:
                _add_five(
                    row,
                    v[n],
                    v[n + 1],
                    v[n + 2],
                    v[n + 3],
                    v[n + 4],
                    x[c[n], x0:x1],
                    x[c[n + 1], x0:x1],
                    x[c[n + 2], x0:x1],
                    x[c[n + 3], x0:x1],
                    x[c[n + 4], x0:x1],
                )
                n += 5
            if n + 4 <= last:
                _add_four(
                    row,
                    v[n],
                    v[n + 1],
                    v[n + 2],
                    v[n + 3],
                    x[c[n], x0:x1],
                    x[c[n + 1], x0:x1],
                    x[c[n + 2], x0:x1],
                    x[c[n + 3], x0:x1],
                )
                n += 4
            while n < last:
                add(row, v[n], x[c[n], x0:x1])
                n += 1
        sparse, x, x0, y, y0 = second, sums, 0, out, out_at
