"""The field's smooth source toward one eye, node by node: what the march reads between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.moments import Coarser, Moments, between, interpolated
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.engine.compiled import FINITE, kernel, part
from openswim.transport.engine.eye_ways import way_from_eye
from openswim.transport.engine.pack import (
    LANES,
    PACK,
    flat,
    put,
    read_quadruple,
    spread_quadruple,
    write,
)
from openswim.transport.engine.scalar import ALONG, BACK, UP
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.empty_space import beside
from openswim.transport.march.volume import DEGREE

_ZERO, _ONE = FLOAT(0.0), FLOAT(1.0)
_ROOT_2 = FLOAT(2.0**0.5)
_TINY = FLOAT(1e-30)
_FIRST = FLOAT(0.28209479177387814)
_MOMENTS = DEGREE * DEGREE


class FieldAt(NamedTuple):
    """The diffuse field at PACK wavelengths: `Moments`, and `Coarser` for the rest."""

    kept: tuple[NDArray[np.int32], ...]
    values: tuple[NDArray[np.float32], ...]
    coarse_kept: tuple[NDArray[np.int32], ...]
    coarse_values: tuple[NDArray[np.float32], ...]
    factor: NDArray[np.int64]
    columns: NDArray[np.int64]

    @classmethod
    def of(cls, moments: list[Moments], coarser: list[Coarser]) -> FieldAt:
        return cls(
            tuple(m.place for m in moments), tuple(m.values for m in moments), tuple(c.place for c in coarser),
            tuple(c.values for c in coarser), np.array([c.factor for c in coarser]),
            np.array([c.columns for c in coarser]),
        )  # fmt: skip


@part(FINITE)
def _geometry(j, i, height_m, eye, harmonics):
    """Of LANES nodes the harmonics (M^2, LANES) of the way from the eye."""
    x, y, z = way_from_eye(j, i, height_m, eye)
    # as `scalar.harmonics`
    cosine, sine, corner = spread_quadruple(_ONE), spread_quadruple(_ZERO), spread_quadruple(_FIRST)
    for m in range(DEGREE):
        p0, p1 = spread_quadruple(_ZERO), corner
        for ell in range(m, DEGREE):
            if ell > m:
                up = FLOAT(UP[ell, m]) * (z * p1 - FLOAT(BACK[ell, m]) * p0)
                p0, p1 = p1, up
            n = (ell * ell + ell) * LANES
            if m == 0:
                write(harmonics, n, p1)
            else:
                write(harmonics, n + m * LANES, _ROOT_2 * p1 * cosine)
                write(harmonics, n - m * LANES, _ROOT_2 * p1 * sine)
        corner *= FLOAT(ALONG[m])
        cosine, sine = cosine * x - sine * y, sine * x + cosine * y


@part(FINITE)
def _coarse_row(place, values, k, j, factor, columns, row):
    """Moments of the coarser grid at the fine row j into ``row`` (M^2, 1 + columns + 1 or more), edges repeated."""
    m, share = between(j, factor, place.shape[1])
    beside = min(m + 1, place.shape[1] - 1)
    width = row.shape[1]
    for b in range(place.shape[2]):
        at, next_at = place[k, m, b], place[k, beside, b]
        if at < 0 and next_at < 0:
            for c in range(_MOMENTS):
                row[c, 1 + b * BLOCK : 1 + (b + 1) * BLOCK] = _ZERO
            continue
        near = _ONE - share if at >= 0 else _ZERO
        far = share if next_at >= 0 else _ZERO
        one = (at if at >= 0 else next_at) * _MOMENTS * BLOCK
        two = (next_at if next_at >= 0 else at) * _MOMENTS * BLOCK
        for c in range(_MOMENTS):
            n = c * BLOCK
            mean = near * read_quadruple(values, one + n) + far * read_quadruple(values, two + n)
            write(row, c * width + 1 + b * BLOCK, mean)
    for c in range(_MOMENTS):
        row[c, 0], row[c, columns + 1] = row[c, 1], row[c, columns]


@part(FINITE)
def _moments(place, values, k, j, i, factor, columns, row, out):
    """Moments (M^2, LANES) at nodes i on, of the kept blocks or of the coarser grid's ``row``."""
    if i % LANES == 0 and place[k, j, i // BLOCK] >= 0:
        start = place[k, j, i // BLOCK] * _MOMENTS * BLOCK + i % BLOCK
        for c in range(_MOMENTS):
            write(out, c * LANES, read_quadruple(values, start + c * BLOCK))
    elif i % LANES == 0 and factor > 0:
        for c in range(_MOMENTS):
            write(out, c * LANES, interpolated(read_quadruple(row, c * row.shape[1] + i // factor), factor))
    else:
        for lane in range(LANES):
            at = place[k, j, min((i + lane) // BLOCK, place.shape[2] - 1)]
            m, share = between(i + lane, max(factor, 1), columns)
            for c in range(_MOMENTS):
                if at >= 0:
                    out[c, lane] = values[at, c, (i + lane) % BLOCK]
                elif factor > 0:
                    out[c, lane] = row[c, m + 1] + share * (row[c, m + 2] - row[c, m + 1])
                else:
                    out[c, lane] = _ZERO


@part(FINITE)
def _amounts(node, count, nodes, extinction, stands_for, out):
    """Extinction of the species (ns, LANES) at the nodes that stand for ``count`` nodes from ``node`` on."""
    for s in range(extinction.shape[0]):
        write(out, s * LANES, read_quadruple(extinction, s * nodes + node))
    for lane in range(count):
        other = flat(stands_for, node + lane)
        if other != node + lane:
            for s in range(extinction.shape[0]):
                out[s, lane] = flat(extinction, s * nodes + other)


@part(FINITE)
def _source_function(amounts, scaled, scattering, air_extinction, air_scattering, harmonics, moments):
    """Source per extinction of LANES nodes at one wavelength."""
    total, taken = spread_quadruple(_ZERO), spread_quadruple(air_extinction + _TINY)
    for s in range(amounts.shape[0]):
        taken += scaled[s] * read_quadruple(amounts, s * LANES)
    for ell in range(DEGREE):
        sigma = spread_quadruple(_ZERO)
        for s in range(amounts.shape[0]):
            sigma += scattering[s, ell] * read_quadruple(amounts, s * LANES)
        diffuse = spread_quadruple(_ZERO)
        for n in range(ell * ell, (ell + 1) * (ell + 1)):
            diffuse += read_quadruple(harmonics, n * LANES) * read_quadruple(moments, n * LANES)
        total += (sigma + air_scattering[ell]) * diffuse
    return total / taken


@kernel(FINITE)
def _row(j, scatterers, stands_for, field, eye, count, part, fields):
    """The nodes of row j in a ``part`` of the grid, LANES at a time."""
    extinction, scaled, scattering = scatterers.extinction, scatterers.scaled, scatterers.scattering
    air_extinction, air_scattering, levels_m = scatterers.air_extinction, scatterers.air_scattering, scatterers.levels_m
    # once for all: asked for in loops, a tuple's arrays have their references counted, by threads in turn
    kept, values, coarse_kept, coarse_values = field.kept, field.values, field.coarse_kept, field.coarse_values
    factor, columns = field.factor, field.columns
    nz, ny, nx = fields.shape[0], fields.shape[1], extinction.shape[3]
    harmonics, moments = np.empty((_MOMENTS, LANES), FLOAT), np.empty((_MOMENTS, LANES), FLOAT)
    source, amounts = np.empty((PACK, LANES), FLOAT), np.empty((extinction.shape[0], LANES), FLOAT)
    widest = 0
    for w in range(count):
        widest = max(widest, coarse_kept[w].shape[2] * BLOCK)
    row = np.empty((count, _MOMENTS, widest + LANES + 2), FLOAT)
    for k in range(part[0, 0], part[0, 1]):
        for w in range(count):
            if factor[w] > 0 and kept[w][k, j].min() < 0:
                _coarse_row(
                    coarse_kept[w], coarse_values[w], k, j, factor[w], columns[w], row[w]
                )
        for block in range(part[2, 0] // LANES, (part[2, 1] + LANES - 1) // LANES):
            i = min(block * LANES, nx - LANES)
            _geometry(j, i, FLOAT(levels_m[k]), eye, harmonics)
            own = min(LANES, fields.shape[2] - i)
            _amounts((k * ny + j) * nx + i, own, nz * ny * nx, extinction, stands_for, amounts)
            for w in range(count):
                _moments(
                    kept[w], values[w], k, j, i, factor[w], columns[w], row[w], moments
                )
                total = _source_function(
                    amounts, scaled[w], scattering[w], air_extinction[w, k], air_scattering[w, k], harmonics, moments
                )
                write(source, w * LANES, total)
            for n in range(own):
                place = ((k * ny + j) * fields.shape[2] + i + n) * fields.shape[3] + PACK
                for w in range(PACK):
                    put(fields, place + w, flat(source, min(w, count - 1) * LANES + n))


@kernel(FINITE)
def view_source(t, threads, scatterers, stands_for, field, eye, count, part, fields):
    """Source of diffuse light toward one eye, per extinction, at every node of thread t's rows, into
    fields[..., PACK:2 PACK]: of the first ``count`` wavelengths, the last repeated,

        S/beta' = sum_lm sigma_l Y_lm(v) M_lm/beta',    v the way from the eye, in the column's axes,

    M_lm the moments of the diffuse radiance (`FieldAt`), sigma_l of scattering and beta' of `Scatterers`, of the node
    that stands for this one (``stands_for``, see `thickest_around`).

    Per extinction, for between nodes light and extinction change together, and the mean of their product is not that of
    its ends (docs/decisions/0015-light-between-nodes.md); so the march, too, adds what is scattered but once.
    ``part``: levels, rows and columns (3, 2) from and to which it is wanted, and maybe a few more.
    """
    for j in range(part[1, 0] + t, part[1, 1], threads):
        _row(j, scatterers, stands_for, field, eye, count, part, fields)


@kernel(FINITE)
def _thickest_rows(t, threads, total, near, periodic, out):
    """`thickest_around`; near (nz, ny): whether there is cloud on a row or those around it."""
    nz, ny, nx = total.shape
    rows = np.empty(9, np.int64)
    for row in range(t, nz * ny, threads):
        k, j = row // ny, row % ny
        for i in range(nx):
            out[k, j, i] = row * nx + i
        count = 0  # rows around
        for dk in range(max(k - 1, 0), min(k + 2, nz) if near[k, j] else 0):
            for b in range(j - 1, j + 2):
                if 0 <= b < ny or periodic:
                    rows[count] = (dk * ny + b % ny) * nx
                    count += 1
        for i in range(nx if near[k, j] else 0):
            if flat(total, row * nx + i) > _ZERO:
                continue
            most = _ZERO
            for a in range(i - 1, i + 2):
                if not (0 <= a < nx or periodic):
                    continue
                x = a if 0 <= a < nx else a % nx
                for n in range(count):
                    there = flat(rows, n) + x
                    if flat(total, there) > most:
                        most = flat(total, there)
                        out[k, j, i] = there


def thickest_around(extinction: NDArray[np.float32], periodic: bool) -> NDArray[np.int32]:
    """Flat indices (nz, ny, nx) of the nodes whose cloud, extinction (ns, nz, ny, nx), scatters what light there is at
    a node: the node itself, or, at one without cloud, the thickest around."""
    total = extinction.sum(axis=0)
    near = beside((total > 0).any(axis=2, keepdims=True), periodic)[..., 0]
    out = np.empty(total.shape, np.int32)
    in_threads(_thickest_rows, total, near, periodic, out)
    return out
