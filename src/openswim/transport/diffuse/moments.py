"""Moments of the diffuse radiance, kept in blocks of nodes where the medium is thick enough to need a grid of its own.

Elsewhere those of a coarser grid stand in, `Coarser`: light scattered in thin air or thin cloud varies slowly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.engine.compiled import REORDERED, kernel, part
from openswim.transport.engine.pack import LANES, four_times_as_fine, put, read_quadruple, twice_as_fine, write
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]

_ZERO = FLOAT(0.0)


class Moments(NamedTuple):
    """Spherical-harmonic moments (M*M) of the radiance at the nodes of a grid (nz, ny, nx)."""

    place: NDArray[np.int32]  # (nz, ny, blocks in a row): index into `values`, -1 where none are kept
    values: F32  # (blocks, M*M, BLOCK)


class Coarser(NamedTuple):
    """The solved field of a grid coarser by ``factor`` in x and y (2, 4; 0: none), with the beam that lights it."""

    factor: int
    columns: int  # nx; the rows below are filled with zeros to whole blocks
    place: NDArray[np.int32]
    values: F32
    ratio: F32  # (blocks, BLOCK) of the light that is scattered around the nodes to theirs, see `Sweeper.amends`
    beam: F32  # (nz, ny, nx)
    sun_harmonics: F32  # (ny, M*M, nx)
    extinction: F32  # (s, nz, ny, nx) of every species at its reference wavelength, 1/m


def nothing_coarser(degree: int) -> Coarser:
    """What the coarsest grid has below it."""
    count = degree * degree
    return Coarser(
        0, 1, np.full((1, 1, 1), -1, np.int32), np.zeros((1, count, BLOCK), FLOAT),
        np.ones((1, BLOCK), FLOAT), np.zeros((1, 1, BLOCK), FLOAT), np.zeros((1, count, BLOCK), FLOAT),
        np.zeros((0, 1, 1, BLOCK), FLOAT),
    )  # fmt: skip


def places(kept: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Consecutive indices for the blocks (nz, ny, nb) that are kept, -1 for the others."""
    flat = kept.ravel()
    return np.where(flat, np.cumsum(flat) - 1, -1).reshape(kept.shape).astype(np.int32)


@part(REORDERED, merged=True)
def between(i, factor, count):
    """Index and weight of the coarser node before fine node ``i``; its neighbour has the rest of the weight."""
    x = (i - 0.5 * (factor - 1)) / factor
    m = min(max(math.floor(x), 0), count - 1)
    share = min(max(x - m, 0.0), 1.0) if m + 1 < count else 0.0
    return m, FLOAT(share)


@part(REORDERED, inlined=True)
def interpolated(nodes, factor):
    """LANES nodes of a grid from those of one coarser by 2 or 4, of which the second is the first one's own."""
    return twice_as_fine(nodes) if factor == 2 else four_times_as_fine(nodes)


@part(REORDERED)
def _coarser_row(place, values, k, j, factor, scratch):
    """Moments at level k of a densely kept coarser grid, into scratch (M*M, nx of the coarser), at the fine row j."""
    count, nx = scratch.shape
    m, share = between(j, factor, place.shape[1])
    near = min(m + 1, place.shape[1] - 1)
    rest = FLOAT(1.0) - share
    for b in range(place.shape[2]):
        at, beside = place[k, m, b], place[k, near, b]
        lo, hi = b * BLOCK, min(nx, (b + 1) * BLOCK)
        for c in range(count):
            row = scratch[c, lo:hi]
            row[:] = _ZERO
            if at >= 0:
                one = values[at, c]
                for i in range(hi - lo):
                    row[i] += rest * one[i]
            if beside >= 0:
                two = values[beside, c]
                for i in range(hi - lo):
                    row[i] += share * two[i]


@part(REORDERED)
def _moment_row(place, values, coarser, k, j, scratch, nx, out):
    """Moments (M*M, ...) of the ``nx`` nodes of one row, kept or interpolated, between ghosts that repeat the ends.

    ``scratch`` (M*M, nx of the coarser grid).
    """
    count = out.shape[0]
    wanting = False
    for b in range(place.shape[2] if coarser.factor > 0 else 0):
        wanting |= place[k, j, b] < 0
    if wanting:
        _coarser_row(coarser.place, coarser.values, k, j, coarser.factor, scratch)
    for b in range(place.shape[2]):
        at = place[k, j, b]
        lo, hi = b * BLOCK, min(nx, (b + 1) * BLOCK)
        for c in range(count):
            row = out[c]
            if at >= 0:
                own = values[at, c]
                for i in range(hi - lo):
                    row[1 + lo + i] = own[i]
            elif wanting:
                for i in range(lo, hi):
                    m, share = between(i, coarser.factor, scratch.shape[1])
                    last = min(m + 1, scratch.shape[1] - 1)
                    row[1 + i] = scratch[c, m] + share * (scratch[c, last] - scratch[c, m])
            else:
                for i in range(lo, hi):
                    row[1 + i] = _ZERO
    for c in range(count):
        out[c, 0], out[c, nx + 1] = out[c, 1], out[c, nx]


def gathered(moments: Moments, coarser: Coarser, j: NDArray[np.int64], i: NDArray[np.int64]) -> F32:
    """Moments (nz, n, M*M) of the columns at rows ``j`` and columns ``i`` (n,), kept or interpolated."""
    out, kept = _kept(moments.place, moments.values, j, i)
    if coarser.factor == 0 or kept.all():
        return out
    _, rows, _ = coarser.place.shape
    below, north = np.array([between(int(y), coarser.factor, rows) for y in j]).T.astype(FLOAT)
    left, east = np.array([between(int(x), coarser.factor, coarser.columns) for x in i]).T.astype(FLOAT)
    other = np.zeros_like(out)
    for up in (0, 1):
        for right in (0, 1):
            weight = (north if up else 1 - north) * (east if right else 1 - east)
            row = np.minimum(below.astype(int) + up, rows - 1)
            column = np.minimum(left.astype(int) + right, coarser.columns - 1)
            other += weight[:, None] * _kept(coarser.place, coarser.values, row, column)[0]
    return np.where(kept[..., None], out, other)


def _kept(
    place: NDArray[np.int32], values: F32, j: NDArray[np.int64], i: NDArray[np.int64]
) -> tuple[F32, NDArray[np.bool_]]:  # fmt: skip
    """Moments (nz, n, M*M) of columns, zero where none are kept, and whether they are (nz, n)."""
    at = place[:, j, i // BLOCK]
    kept = at >= 0
    out = np.zeros((*at.shape, values.shape[1]), FLOAT)
    out[kept] = values[at[kept], :, np.broadcast_to(i % BLOCK, at.shape)[kept]]
    return out, kept


@kernel(REORDERED)
def prolong(t, threads, coarse, coarse_nx, coarsest, place, nx, values, again):
    """Moments of a grid coarser by two, bilinearly interpolated, into the blocks that are kept; ``again``: added.

    As many as there are of the coarser grid, the first ones.
    """
    nz, ny, nb = place.shape
    count, moments = coarse.values.shape[1], values.shape[1]
    rows, width = coarse.place.shape[1], coarse_nx + 2 + LANES
    scratch = np.empty((count, coarsest.columns), FLOAT)
    one, two = np.zeros((count, width), FLOAT), np.zeros((count, width), FLOAT)
    in_one, in_two = -1, -1  # the coarse rows that they hold
    for row in range(t * nz * ny // threads, (t + 1) * nz * ny // threads):
        k, j = row // ny, row % ny
        kept = False
        for b in range(nb):
            kept |= place[k, j, b] >= 0
        if not kept:
            continue
        m, w = between(j, 2, rows)
        first, second = k * rows + m, k * rows + min(m + 1, rows - 1)
        if in_two == first:
            one, two = two, one
            in_one, in_two = in_two, in_one
        if in_one != first:
            _moment_row(coarse.place, coarse.values, coarsest, k, m, scratch, coarse_nx, one)
            in_one = first
        if in_two != second:
            _moment_row(coarse.place, coarse.values, coarsest, k, min(m + 1, rows - 1), scratch, coarse_nx, two)
            in_two = second
        for b in range(nb):
            if place[k, j, b] < 0:
                continue
            for c in range(count):
                at, x = (place[k, j, b] * moments + c) * BLOCK, c * width + b * BLOCK // 2
                near = read_quadruple(one, x)
                mean = interpolated(near + w * (read_quadruple(two, x) - near), 2)
                write(values, at, mean + read_quadruple(values, at) if again else mean)
                for i in range(nx - b * BLOCK, BLOCK):
                    put(values, at + i, _ZERO)


@kernel(REORDERED)
def restrict(t, threads, place, before, values, weight, nx, coarse_place, out):
    """Means over 2x2 columns of the change of moments kept in blocks, on a densely kept grid coarser by two.

    ``weight`` (nz, ny, nx or more): the extinction, since moments matter by what they scatter. What is not kept counts
    as zero. As many moments as ``out`` has, the first ones.
    """
    nz, ny, nb = place.shape
    rows = coarse_place.shape[1]
    half = BLOCK // 2
    part = np.empty((4, half), FLOAT)
    for row in range(t * nz * rows // threads, (t + 1) * nz * rows // threads):
        k, m = row // rows, row % rows
        for b in range(coarse_place.shape[2]):
            at = coarse_place[k, m, b]
            for side in range(2):
                block = 2 * b + side
                if at < 0 or block >= nb:
                    continue
                one, two = place[k, 2 * m, block], place[k, min(2 * m + 1, ny - 1), block]
                last = min(nx - block * BLOCK, BLOCK) - 1  # a last node without a neighbour counts twice
                part[:, :] = FLOAT(0.0)
                for i in range(min(half, last // 2 + 1)):
                    x = block * BLOCK + 2 * i
                    beside = block * BLOCK + min(2 * i + 1, last)
                    y = min(2 * m + 1, ny - 1)
                    w00, w01 = weight[k, 2 * m, x], weight[k, 2 * m, beside]
                    w10, w11 = weight[k, y, x], weight[k, y, beside]
                    total = w00 + w01 + w10 + w11
                    if total > FLOAT(0.0):
                        part[0, i], part[1, i] = w00 / total, w01 / total
                        part[2, i], part[3, i] = w10 / total, w11 / total
                for c in range(out.shape[1]):
                    for i in range(half):
                        beside = min(2 * i + 1, last)
                        mean = FLOAT(0.0)
                        if one >= 0:
                            mean += part[0, i] * (values[one, c, 2 * i] - before[one, c, 2 * i])
                            mean += part[1, i] * (values[one, c, beside] - before[one, c, beside])
                        if two >= 0:
                            mean += part[2, i] * (values[two, c, 2 * i] - before[two, c, 2 * i])
                            mean += part[3, i] * (values[two, c, beside] - before[two, c, beside])
                        out[at, c, side * half + i] = mean


@kernel(REORDERED)
def add_scaled(t, threads, out, weight, values):
    """out += weight values, rows of numbers."""
    for i in range(t * out.shape[0] // threads, (t + 1) * out.shape[0] // threads):
        out[i] += weight * values[i]


@kernel(REORDERED)
def scale(t, threads, values, ratio):
    """values (blocks, moments, BLOCK) times ratio (blocks, BLOCK)."""
    for n in range(t, values.shape[0], threads):
        for c in range(values.shape[1]):
            for i in range(BLOCK):
                values[n, c, i] *= ratio[n, i]


@kernel(REORDERED)
def squares(t, threads, before, after, level, change, size):
    """Thread t's share of the squares of the first moments (l < 2): their ``change`` (threads,), and on every level
    their ``size`` (threads, nz). ``level``: of every block."""
    change[t] = 0.0
    size[t] = 0.0
    for n in range(t, after.shape[0], threads):
        changed, own = FLOAT(0.0), FLOAT(0.0)
        for c in range(4):
            for i in range(BLOCK):
                changed += (after[n, c, i] - before[n, c, i]) ** 2
                own += after[n, c, i] ** 2
        change[t] += changed
        size[t, level[n]] += own


@kernel(REORDERED)
def weighted_change(t, threads, before, after, level, weight, out):
    """Change of the first moments (blocks, 4, BLOCK), weighted by level."""
    for n in range(t, after.shape[0], threads):
        for c in range(4):
            for i in range(BLOCK):
                out[n, c, i] = (after[n, c, i] - before[n, c, i]) * weight[level[n]]


@kernel(REORDERED)
def inner_product(t, threads, a, b, out):
    """Thread t's share of the sum of a b, rows of numbers, into out[t]."""
    total = 0.0
    for i in range(t * a.shape[0] // threads, (t + 1) * a.shape[0] // threads):
        total += np.float64(a[i]) * np.float64(b[i])
    out[t] = total
