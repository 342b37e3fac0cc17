"""Products of sparse matrices with rows of nodes: from moments to ordinates and back."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.ordinates import harmonic_matrix
from openswim.transport.pack import LANES, flat, read_quadruple, spread_quadruple, write

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

BLOCK = LANES  # nodes of a row that are kept, or swept as clear, together
_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ZERO = np.float32(0.0)


class SparseRows(NamedTuple):
    """Nonzeros of a matrix: those of row r are start[r] to start[r + 1]."""

    start: np.ndarray
    column: np.ndarray
    value: np.ndarray


class Groups(NamedTuple):
    """Ordinates in groups: those of group g are first[g] to first[g + 1], its sums sum[g] to sum[g + 1].

    Matrices of `Mirrored`, one group's rows after the other's; their columns are counted within the group.
    """

    first: np.ndarray
    sum: np.ndarray
    parts: SparseRows
    whole: SparseRows
    gather: SparseRows
    spread: SparseRows


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
def multiply(sparse, first, last, x, x_at, x_stride, y, y_at, y_stride, again):
    """Rows of y, BLOCK nodes each from flat element ``y_at`` on, as rows first to last of a matrix times rows of x.

    again: added to what is there.
    """
    for r in range(first, last):
        at = y_at + (r - first) * y_stride
        total = read_quadruple(y, at) if again else spread_quadruple(_ZERO)
        for n in range(flat(sparse.start, r), flat(sparse.start, r + 1)):
            total += flat(sparse.value, n) * read_quadruple(x, x_at + flat(sparse.column, n) * x_stride)
        write(y, at, total)


def mirrored(directions: F64, weight: F32, degree: int) -> Mirrored:
    """Harmonics of ordinates (n, 3), factored by their mirror images in x and y."""
    matrix = harmonic_matrix(directions, degree)
    images = np.round(np.abs(directions * [1, 1, 0]) + directions * [0, 0, 1], 9)
    _, family = np.unique(images, axis=0, return_inverse=True)
    parts: list[F64] = []
    columns: list[F64] = []
    for f in np.unique(family):
        members = np.flatnonzero(family.ravel() == f)
        for part in _parities(matrix[members]):
            column = np.zeros(len(directions))
            # rank one: every member's harmonics are those of the first, up to their sign
            largest = np.abs(part[0]).argmax()
            column[members] = part[:, largest] / part[0, largest]
            parts.append(part[0])
            columns.append(column)
    whole = np.stack(columns, axis=-1)
    first = np.stack(parts)
    return Mirrored(*(_sparse(m) for m in (first, whole, whole.T * weight, first.T)))


def in_groups(directions: F64, weight: F32, degree: int, least: int) -> tuple[NDArray[np.int64], Groups]:
    """Ordinates (n, 3) in groups of about ``least`` or more, mirror images together: their order, and the groups."""
    images = np.round(np.abs(directions * [1, 1, 0]) + directions * [0, 0, 1], 9)
    _, family = np.unique(images, axis=0, return_inverse=True)
    order = np.argsort(family.ravel(), kind="stable")
    ends = np.concatenate([[0], np.cumsum(np.bincount(family.ravel()))])
    count = max(1, len(order) // least)
    first = np.unique([ends[np.abs(ends - len(order) * n / count).argmin()] for n in range(count + 1)])
    parts = [mirrored(directions[order[a:b]], weight[order[a:b]], degree) for a, b in pairwise(first)]
    sums = np.cumsum([0, *(len(p.parts.start) - 1 for p in parts)])
    matrices = [_stacked([part[n] for part in parts]) for n in range(4)]
    return order, Groups(first.astype(np.int64), sums.astype(np.int64), *matrices)


def _stacked(matrices: list[SparseRows]) -> SparseRows:
    """The rows of one after those of the other."""
    ends = np.concatenate([[0], *(np.diff(m.start) for m in matrices)]).cumsum()
    return SparseRows(ends, np.concatenate([m.column for m in matrices]), np.concatenate([m.value for m in matrices]))


def _parities(rows: F64) -> list[F64]:
    """Harmonics of mirror images split into those that change sign alike; a lone ordinate stays whole."""
    rows = np.where(np.abs(rows) < 1e-12, 0, rows)
    signs = np.sign(rows) * np.where(rows[0] == 0, 1, np.sign(rows[0]))
    kinds = {tuple(column) for column in signs.T if column.any()}
    return [np.where((np.array(kind) == signs.T).all(axis=1), rows, 0) for kind in sorted(kinds)]


def _sparse(matrix: F64) -> SparseRows:
    row, column = np.nonzero(np.abs(matrix) > 1e-12)
    start = np.searchsorted(row, np.arange(len(matrix) + 1))
    return SparseRows(start.astype(np.int64), column.astype(np.int64), matrix[row, column].astype(np.float32))
