"""From moments to what ordinates emit, and from the ordinates' light to moments: a few ordinates at a time.

Nodes are gone through in blocks that stay in a core's cache. Ordinates are added in their order, whoever adds them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import CONTRACTED, kernel, part
from openswim.transport.engine.lanes import LANES, read, write
from openswim.transport.engine.scalar import harmonics

F64 = NDArray[np.float64]

_BLOCK = 64  # nodes, whose rows stay in a core's nearest cache
_STRETCH = 512  # nodes that are gathered at a time: far rows are read and written along such stretches
_SMALL = 128  # nodes: a product so small that the library for it takes one thread, and adds in one order
_GROUP = 32 * _SMALL  # of nodes, that a thread takes at a time and that stays in a core's cache


@part(CONTRACTED, inlined=True)
def _four(shares, first, last, near, at, out, p, one, two):
    """Add to four rows of ``out``, from the first on, what comes to 2 LANES nodes from p on; beyond the last row that
    is meant. near (m, block): the nodes' own, from its column ``at`` on; one, two: how many of either LANES are."""
    nodes, block, second = out.shape[1], near.shape[1], p + LANES
    r0, r1, r2, r3 = first, min(first + 1, last), min(first + 2, last), min(first + 3, last)
    o0, o1, o2, o3 = r0 * nodes, r1 * nodes, r2 * nodes, r3 * nodes
    a0, a1 = read(out, o0 + p, one), read(out, o1 + p, one)
    a2, a3 = read(out, o2 + p, one), read(out, o3 + p, one)
    b0, b1 = read(out, o0 + second, two), read(out, o1 + second, two)
    b2, b3 = read(out, o2 + second, two), read(out, o3 + second, two)
    for m in range(near.shape[0]):
        a, b = read(near, m * block + at, None), read(near, m * block + at + LANES, None)
        s0, s1, s2, s3 = shares[r0, m], shares[r1, m], shares[r2, m], shares[r3, m]
        a0, a1, a2, a3 = a0 + s0 * a, a1 + s1 * a, a2 + s2 * a, a3 + s3 * a
        b0, b1, b2, b3 = b0 + s0 * b, b1 + s1 * b, b2 + s2 * b, b3 + s3 * b
    write(out, o0 + p, a0, one)
    write(out, o1 + p, a1, one)
    write(out, o2 + p, a2, one)
    write(out, o3 + p, a3, one)
    write(out, o0 + second, b0, two)
    write(out, o1 + second, b1, two)
    write(out, o2 + second, b2, two)
    write(out, o3 + second, b3, two)


@kernel(CONTRACTED)
def gather(t, threads, shares, rows, out):
    """out (n, nodes) += shares (n, m) @ rows (m, nodes or more)."""
    nodes, last = out.shape[1], shares.shape[0] - 1
    near = np.zeros((rows.shape[0], _STRETCH), rows.dtype)
    for first in range(t * _STRETCH, nodes, threads * _STRETCH):
        count = min(_STRETCH, nodes - first)
        for m in range(rows.shape[0]):
            for i in range(count):
                near[m, i] = rows[m, first + i]
        for n in range(0, last + 1, 4):
            for i in range(0, count, 2 * LANES):
                left = count - i
                if left >= 2 * LANES:
                    _four(shares, n, last, near, i, out, first + i, None, None)
                else:
                    _four(shares, n, last, near, i, out, first + i, min(left, LANES), max(left - LANES, 0))


def emit(t: int, threads: int, of_ordinates: F64, moments: F64, out: F64) -> None:
    """out (b, nodes or more) = of_ordinates (b, K) @ moments (K, nodes)."""
    for first in range(t * _GROUP, moments.shape[1], threads * _GROUP):
        rows = moments[:, first : first + _GROUP]
        into = out[:, first : first + rows.shape[1]]
        whole = into.shape[1] // _SMALL * _SMALL
        blocks, made = (a[:, :whole].reshape(len(a), -1, _SMALL).transpose(1, 0, 2) for a in (rows, into))  # views
        np.matmul(of_ordinates, blocks, out=made)
        into[:, whole:] = of_ordinates @ rows[:, whole:]


@kernel(CONTRACTED)
def scatter(t, threads, ell, sun, lit, scattering, moments, out):
    """out (K, nz, columns): what nodes scatter, (moments + sun lit) scattering[ell]; sun (K, columns), lit (nz,
    columns), scattering (M, nz, columns)."""
    for k in range(t, out.shape[1], threads):
        for n in range(out.shape[0]):
            share = scattering[ell[n]]
            for p in range(out.shape[2]):
                out[n, k, p] = (moments[n, k, p] + sun[n, p] * lit[k, p]) * share[k, p]


@kernel(CONTRACTED)
def scatter_transposed(t, threads, ell, sun, lit, scattering, moments, bar, scattering_bar, lit_bar):
    """Transpose of `scatter` by all that it is given: bar of what it makes becomes that of its moments, the others are
    added to."""
    for k in range(t, bar.shape[1], threads):
        for n in range(bar.shape[0]):
            share, of_share = scattering[ell[n]], scattering_bar[ell[n]]
            for p in range(bar.shape[2]):
                own = np.float64(bar[n, k, p])
                of_share[k, p] += own * (moments[n, k, p] + sun[n, p] * lit[k, p])
                lit_bar[k, p] += own * share[k, p] * sun[n, p]
                bar[n, k, p] = own * share[k, p]


class Taken(NamedTuple):
    """What is scattered around the nodes, over what is seen at them (nodes,): ``ratio``, which is bounded, and its
    slopes by what steps take of the mean radiance, and by the mean radiance at the nodes."""

    ratio: np.ndarray
    by_taken: np.ndarray
    by_seen: np.ndarray


@kernel(CONTRACTED)
def around(t, threads, taken, seen, d_seen, d_taken, out):
    """out (K, nodes): change of what is scattered around nodes, from those of what is ``seen`` at them (K, nodes) and
    of what steps take of the mean radiance (nodes,)."""
    ratio, by_taken, by_seen = taken
    own = np.zeros(_STRETCH, out.dtype)
    for first in range(t * _STRETCH, out.shape[1], threads * _STRETCH):
        count = min(_STRETCH, out.shape[1] - first)
        for i in range(count):
            n = first + i
            own[i] = by_taken[n] * d_taken[n] + by_seen[n] * d_seen[0, n]
        for k in range(out.shape[0]):
            for i in range(count):
                n = first + i
                out[k, n] = d_seen[k, n] * ratio[n] + seen[k, n] * own[i]


@kernel(CONTRACTED)
def around_transposed(t, threads, taken, seen, bar, seen_bar, taken_bar):
    """Transpose of `around`: seen_bar (K, nodes) is added to; taken_bar (nodes,)."""
    ratio, by_taken, by_seen = taken
    own = np.zeros(_STRETCH, bar.dtype)
    for first in range(t * _STRETCH, bar.shape[1], threads * _STRETCH):
        count = min(_STRETCH, bar.shape[1] - first)
        own[:] = 0.0
        for k in range(bar.shape[0]):
            for i in range(count):
                n = first + i
                own[i] += seen[k, n] * bar[k, n]
                seen_bar[k, n] += bar[k, n] * ratio[n]
        for i in range(count):
            n = first + i
            seen_bar[0, n] += by_seen[n] * own[i]
            taken_bar[n] = by_taken[n] * own[i]


class Eye(NamedTuple):
    """Where nodes lie, and where they are seen from."""

    shape: np.ndarray  # (3,) levels, rows, columns
    levels: np.ndarray  # (nz,) m
    axes: np.ndarray  # (ny, nx, 3, 3) of the columns
    foot: np.ndarray  # (ny, nx, 3) at height 0
    place: np.ndarray  # (3,) the eye's, or
    parallel: bool  # the direction of its rays


@kernel(CONTRACTED)
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


@kernel(CONTRACTED)
def ways_to(t, threads, eye, out):
    """Harmonics (K, nodes) of the ways from an eye to the nodes."""
    found = np.empty(out.shape[0])
    for p in range(t, out.shape[1], threads):
        a, b, c = _way(p, eye)
        harmonics(a, b, c, round(out.shape[0] ** 0.5), found)
        for n in range(out.shape[0]):
            out[n, p] = found[n]


@part(CONTRACTED, inlined=True)
def _sum_some(p, i, some, ell, ways, seen, total):
    """Into total[ell, i:] the sums over m at nodes from p on."""
    nodes = ways.shape[1]
    found = read(ways, ell * ell * nodes + p, some) * read(seen, ell * ell * nodes + p, some)
    for n in range(ell * ell + 1, (ell + 1) * (ell + 1)):
        found = found + read(ways, n * nodes + p, some) * read(seen, n * nodes + p, some)
    write(total, ell * _BLOCK + i, found, None)


@part(CONTRACTED, inlined=True)
def _share_some(p, i, some, ell, ways, total, seen_bar):
    """Transpose of `_sum_some`."""
    nodes, found = ways.shape[1], read(total, ell * _BLOCK + i, None)
    for n in range(ell * ell, (ell + 1) * (ell + 1)):
        at = n * nodes + p
        write(seen_bar, at, read(seen_bar, at, some) + found * read(ways, at, some), some)


@kernel(CONTRACTED)
def toward(t, threads, ways, low, seen, fields):
    """What each kind of matter scatters toward an eye of the light at nodes, per its extinction, into fields[:, kinds:
    2 kinds]: sum_l low[kind, l] sum_m ways[lm] seen[lm]; ways, seen (K, nodes)."""
    kinds, degree = low.shape
    total = np.zeros((degree, _BLOCK), seen.dtype)
    for first in range(t * _BLOCK, fields.shape[0], threads * _BLOCK):
        count = min(_BLOCK, fields.shape[0] - first)
        for ell in range(degree):
            for i in range(0, count, LANES):
                if count - i >= LANES:
                    _sum_some(first + i, i, None, ell, ways, seen, total)
                else:
                    _sum_some(first + i, i, count - i, ell, ways, seen, total)
        for i in range(count):
            for kind in range(kinds):
                found = 0.0
                for ell in range(degree):
                    found += low[kind, ell] * total[ell, i]
                fields[first + i, kinds + kind] = found


@kernel(CONTRACTED)
def toward_transposed(t, threads, ways, low, bar, seen_bar):
    """Transpose of `toward`: bar (nodes, channels) of the fields, added to seen_bar (K, nodes)."""
    kinds, degree = low.shape
    total = np.zeros((degree, _BLOCK), seen_bar.dtype)
    for first in range(t * _BLOCK, bar.shape[0], threads * _BLOCK):
        count = min(_BLOCK, bar.shape[0] - first)
        for i in range(count):
            for ell in range(degree):
                found = 0.0
                for kind in range(kinds):
                    found += low[kind, ell] * bar[first + i, kinds + kind]
                total[ell, i] = found
        for ell in range(degree):
            for i in range(0, count, LANES):
                if count - i >= LANES:
                    _share_some(first + i, i, None, ell, ways, total, seen_bar)
                else:
                    _share_some(first + i, i, count - i, ell, ways, total, seen_bar)
