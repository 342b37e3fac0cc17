"""From moments to what ordinates emit, and from the ordinates' light to moments: a few ordinates at a time.

Nodes are gone through in blocks that stay in a core's cache. Ordinates are added in their order, whoever adds them.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.engine.scalar import harmonics

F64 = NDArray[np.float64]

_FLAGS: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "fastmath": {"contract"}}
_BLOCK = 256  # nodes: a product so small that the library for it takes one thread, and adds in one order
_GROUP = 16 * _BLOCK  # of nodes, that a thread takes at a time and that stays in a core's cache


def _add(shares: F64, rows: F64, out: F64, more: bool) -> None:
    """out (n, nodes) = shares (n, m) @ rows (m, nodes); ``more``: added to it."""
    nodes = out.shape[1]
    whole = nodes // _BLOCK * _BLOCK
    blocks, into = (a[:, :whole].reshape(len(a), -1, _BLOCK).transpose(1, 0, 2) for a in (rows, out))  # views
    if more:
        into += np.matmul(shares, blocks)
        out[:, whole:] += shares @ rows[:, whole:]
    else:
        np.matmul(shares, blocks, out=into)
        out[:, whole:] = shares @ rows[:, whole:]


def emit(t: int, threads: int, of_ordinates: F64, moments: F64, out: F64) -> None:
    """out (b, nodes) = of_ordinates (b, K) @ moments (K, nodes)."""
    for first in range(t * _GROUP, out.shape[1], threads * _GROUP):
        some = slice(first, first + _GROUP)
        _add(of_ordinates, moments[:, some], out[:, some], more=False)


def gather(t: int, threads: int, of_harmonics: F64, light: F64, out: F64) -> None:
    """out (K, nodes) += of_harmonics (K, b) @ light (b, nodes)."""
    for first in range(t * _GROUP, out.shape[1], threads * _GROUP):
        some = slice(first, first + _GROUP)
        _add(of_harmonics, light[:, some], out[:, some], more=True)


class Eye(NamedTuple):
    """Where nodes lie, and where they are seen from."""

    shape: np.ndarray  # (3,) levels, rows, columns
    levels: np.ndarray  # (nz,) m
    axes: np.ndarray  # (ny, nx, 3, 3) of the columns
    foot: np.ndarray  # (ny, nx, 3) at height 0
    place: np.ndarray  # (3,) the eye's, or
    parallel: bool  # the direction of its rays


@njit(**_FLAGS)
def _way(p, eye):
    """Unit vector from an eye to a node, in its column's axes."""
    shape, levels, axes, foot, place, parallel = eye
    k, column = p // (shape[1] * shape[2]), p % (shape[1] * shape[2])
    j, i = column // shape[2], column % shape[2]
    up = axes[j, i, 2]
    if parallel:
        x, y, z = place[0], place[1], place[2]
    else:
        own, h = foot[j, i], levels[k]
        x, y, z = own[0] + h * up[0] - place[0], own[1] + h * up[1] - place[1], own[2] + h * up[2] - place[2]
        r = (x * x + y * y + z * z) ** 0.5 + 1e-6
        x, y, z = x / r, y / r, z / r
    one, two = axes[j, i, 0], axes[j, i, 1]
    a = one[0] * x + one[1] * y + one[2] * z
    b = two[0] * x + two[1] * y + two[2] * z
    return a, b, up[0] * x + up[1] * y + up[2] * z


@njit(**_FLAGS)
def toward(t, threads, eye, low, seen, fields):
    """What each kind of matter scatters toward an eye of the light at nodes, per its extinction, into fields[:, kinds:
    2 kinds]: sum_l low[kind, l] sum_m Y_lm(way) seen[lm]."""
    kinds, degree = low.shape
    found = np.empty(degree * degree)
    for p in range(t, fields.shape[0], threads):
        a, b, c = _way(p, eye)
        harmonics(a, b, c, degree, found)
        for kind in range(kinds):
            fields[p, kinds + kind] = 0.0
        for ell in range(degree):
            total = 0.0
            for n in range(ell * ell, (ell + 1) * (ell + 1)):
                total += found[n] * seen[n, p]
            for kind in range(kinds):
                fields[p, kinds + kind] += low[kind, ell] * total


@njit(**_FLAGS)
def toward_transposed(t, threads, eye, low, bar, seen_bar):
    """Transpose of `toward`: bar (nodes, channels) of the fields, added to seen_bar (K, nodes)."""
    kinds, degree = low.shape
    found = np.empty(degree * degree)
    for p in range(t, bar.shape[0], threads):
        a, b, c = _way(p, eye)
        harmonics(a, b, c, degree, found)
        for ell in range(degree):
            total = 0.0
            for kind in range(kinds):
                total += low[kind, ell] * bar[p, kinds + kind]
            for n in range(ell * ell, (ell + 1) * (ell + 1)):
                seen_bar[n, p] += found[n] * total
