"""From moments to what ordinates emit, and from the ordinates' light to moments: a few ordinates at a time.

Nodes are gone through in blocks that stay in a core's cache. Ordinates are added in their order, whoever adds them.
"""

from typing import Any

import numpy as np
from numba import njit

from openswim.transport.engine.scalar import harmonics

_FLAGS: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "fastmath": {"contract"}}
_BLOCK = 512


@njit(**_FLAGS)
def _add(share, rows, out):
    """out (n,) += share (m,) @ rows (m, n), four rows at a time."""
    whole = share.shape[0] // 4 * 4
    for k in range(0, whole, 4):
        a, b, c, d = share[k], share[k + 1], share[k + 2], share[k + 3]
        one, two, three, four = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
        for p in range(out.shape[0]):
            out[p] += (a * one[p] + b * two[p]) + (c * three[p] + d * four[p])
    for k in range(whole, share.shape[0]):
        a, one = share[k], rows[k]
        for p in range(out.shape[0]):
            out[p] += a * one[p]


@njit(**_FLAGS)
def emit(t, threads, of_ordinates, moments, out):
    """out (b, nodes) = of_ordinates (b, K) @ moments (K, nodes)."""
    nodes = out.shape[1]
    for first in range(t * _BLOCK, nodes, threads * _BLOCK):
        last = min(first + _BLOCK, nodes)
        out[:, first:last] = 0.0
        for n in range(out.shape[0]):
            _add(of_ordinates[n], moments[:, first:last], out[n, first:last])


@njit(**_FLAGS)
def gather(t, threads, of_harmonics, light, out):
    """out (K, nodes) += of_harmonics (K, b) @ light (b, nodes)."""
    nodes = out.shape[1]
    for first in range(t * _BLOCK, nodes, threads * _BLOCK):
        last = min(first + _BLOCK, nodes)
        for k in range(out.shape[0]):
            _add(of_harmonics[k], light[:, first:last], out[k, first:last])


@njit(**_FLAGS)
def _way(p, shape, levels, axes, place, eye, parallel):
    """Unit vector from an eye to a node, in its column's axes."""
    k, column = p // (shape[1] * shape[2]), p % (shape[1] * shape[2])
    j, i = column // shape[2], column % shape[2]
    up = axes[j, i, 2]
    if parallel:
        x, y, z = eye[0], eye[1], eye[2]
    else:
        foot, h = place[j, i], levels[k]
        x, y, z = foot[0] + h * up[0] - eye[0], foot[1] + h * up[1] - eye[1], foot[2] + h * up[2] - eye[2]
        r = (x * x + y * y + z * z) ** 0.5 + 1e-6
        x, y, z = x / r, y / r, z / r
    one, two = axes[j, i, 0], axes[j, i, 1]
    a = one[0] * x + one[1] * y + one[2] * z
    b = two[0] * x + two[1] * y + two[2] * z
    return a, b, up[0] * x + up[1] * y + up[2] * z


@njit(**_FLAGS)
def toward(t, threads, shape, levels, axes, place, eye, parallel, degree, low, seen, fields):
    """What each kind of matter scatters toward an eye of the light at nodes, per its extinction, into fields[:, kinds:
    2 kinds]: sum_l low[kind, l] sum_m Y_lm(way) seen[lm]. eye (3,): its place, or the direction of parallel rays."""
    found, kinds = np.empty(degree * degree), low.shape[0]
    for p in range(t, fields.shape[0], threads):
        a, b, c = _way(p, shape, levels, axes, place, eye, parallel)
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
def toward_transposed(t, threads, shape, levels, axes, place, eye, parallel, degree, low, bar, seen_bar):
    """Transpose of `toward`: bar (nodes, channels) of the fields, added to seen_bar (K, nodes)."""
    found, kinds = np.empty(degree * degree), low.shape[0]
    for p in range(t, bar.shape[0], threads):
        a, b, c = _way(p, shape, levels, axes, place, eye, parallel)
        harmonics(a, b, c, degree, found)
        for ell in range(degree):
            total = 0.0
            for kind in range(kinds):
                total += low[kind, ell] * bar[p, kinds + kind]
            for n in range(ell * ell, (ell + 1) * (ell + 1)):
                seen_bar[n, p] += found[n] * total
