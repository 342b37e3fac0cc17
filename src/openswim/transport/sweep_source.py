"""What a sweep carries and leaves: the source along ordinates from moments, and moments from radiance, row by row."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from openswim.transport.moments import between
from openswim.transport.pack import (
    LANES,
    PACK,
    flat,
    interleave,
    put,
    read_double,
    read_quadruple,
    spread_quadruple,
    write,
)
from openswim.transport.products import BLOCK, multiply

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_NEAR, _FAR = np.float32(0.75), np.float32(0.25)
_FOUR_PI = np.float32(4.0 * math.pi)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _terms(terms, i, ell, sigma, values, at, sun_harmonics, sun_at, stride, lit):
    """sigma_l (I_lm + 4 pi Y_lm(sun) T') of one degree l for LANES nodes, into ``terms`` (M*M, BLOCK)."""
    for index in range(ell * ell, (ell + 1) * (ell + 1)):
        moment = read_quadruple(values, at + index * BLOCK)
        write(terms, index * BLOCK + i, sigma * (moment + lit * read_quadruple(sun_harmonics, sun_at + index * stride)))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _kept_source(k, j, b, at, grid, parts, whole, values, terms, sums, source, out):
    """Emission along every ordinate of a block that is kept, S_n = sum_lm Y_nlm sigma_l (I_lm + 4 pi Y_lm(sun) T')."""
    ns, nz, ny, nx = grid.extinction.shape
    degree = grid.air_scattering.shape[1]
    count = degree * degree
    for i in range(0, BLOCK, LANES):
        x = b * BLOCK + i
        node = (k * ny + j) * nx + x
        lit = _FOUR_PI * read_quadruple(grid.beam, node)
        for ell in range(degree):
            sigma = spread_quadruple(flat(grid.air_scattering, k * degree + ell))
            for s in range(ns):
                sigma += flat(grid.scattering, s * degree + ell) * read_quadruple(
                    grid.extinction, s * (nz * ny * nx) + node
                )
            start = at * count * BLOCK + i
            _terms(terms, i, ell, sigma, values, start, grid.sun_harmonics, j * count * nx + x, nx, lit)
    multiply(parts, terms, 0, BLOCK, sums, 0, BLOCK, False)
    multiply(whole, sums, 0, BLOCK, source, out, source.shape[3], False)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _thin_source(k, j, b, grid, coarser, planes, active, source, out):
    """Emission of a block that is not kept, by the coarser field: the air's, and that of thin cloud by its extinction.

    planes (1 + s, rows of the coarser grid, ordinate, nodes and ghosts): source per unit of the air and of every
    species, of those that are ``active`` on this level.
    """
    ns, nz, ny, nx = grid.extinction.shape
    rows, count, stride = planes.shape[1], planes.shape[2], planes.shape[3]
    m, share = between(j, coarser.factor, rows)
    next_row = min(m + 1, rows - 1) - m
    rest = _ONE - share
    for i in range(0, BLOCK, LANES):
        x = b * BLOCK + i
        node = (k * ny + j) * nx + x
        for n in range(count):
            one = (m * count + n) * stride + 1 + x
            two = one + next_row * count * stride
            total = spread_quadruple(_ZERO)
            if flat(active, 0):
                total += rest * read_quadruple(planes, one) + share * read_quadruple(planes, two)
            for s in range(ns):
                if flat(active, 1 + s):
                    kind = (1 + s) * rows * count * stride
                    light = rest * read_quadruple(planes, kind + one) + share * read_quadruple(planes, kind + two)
                    total += read_quadruple(grid.extinction, s * (nz * ny * nx) + node) * light
            write(source, out + n * stride + i, total)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def source_row(k, j, at, grid, parts, whole, place, values, coarser, planes, active, terms, sums, source, extinction):
    """Emission of every ordinate, and extinction, along row j of level k, into rows ``at`` of the sweep's buffers."""
    ns, nz, ny, nx = grid.extinction.shape
    count, stride = source.shape[2], source.shape[3]
    for i in range(0, nx, LANES):
        total = spread_quadruple(flat(grid.air_extinction, k))
        for s in range(ns):
            total += flat(grid.scaled, s) * read_quadruple(grid.extinction, ((s * nz + k) * ny + j) * nx + i)
        write(extinction, at * stride + 1 + i, total)
    columns = grid.ground_node.shape[1]
    _row_ends(extinction, at * stride, columns, grid.periodic)
    for b in range(place.shape[2]):
        out = at * count * stride + 1 + b * BLOCK
        kept = flat(place, (k * ny + j) * place.shape[2] + b)
        if kept >= 0:
            _kept_source(k, j, b, kept, grid, parts, whole, values, terms, sums, source, out)
        elif coarser.factor > 0:
            _thin_source(k, j, b, grid, coarser, planes, active, source, out)
        else:
            for n in range(count):
                for i in range(0, BLOCK, LANES):
                    write(source, out + n * stride + i, spread_quadruple(_ZERO))
    for n in range(count):
        _row_ends(source, (at * count + n) * stride, columns, grid.periodic)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _row_ends(rows, at, nx, periodic):
    """Ghost nodes at the ends of the row that begins at flat element ``at``."""
    put(rows, at, flat(rows, at + (nx if periodic else 1)))
    put(rows, at + nx + 1, flat(rows, at + (1 if periodic else nx)))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def coarse_rows(first, last, k, grid, parts, whole, coarser, active, terms, sums, lines, planes):
    """Rows first to last of what the coarser field gives the air and the species of level k: see `_thin_source`.

    ``lines`` (ordinate, nodes of the coarser grid and ghosts) is scratch.
    """
    degree = grid.air_scattering.shape[1]
    count, stride = planes.shape[2], planes.shape[3]
    rows, line = planes.shape[1], lines.shape[1]
    blocks = coarser.place.shape[2]
    nx = coarser.beam.shape[2]
    moments = degree * degree
    for j in range(first, last):
        for kind in range(planes.shape[0]):
            if not flat(active, kind):
                continue
            for b in range(blocks):
                kept = flat(coarser.place, (k * rows + j) * blocks + b)
                if kept < 0:
                    for n in range(count):
                        for i in range(0, BLOCK, LANES):
                            write(lines, n * line + 1 + b * BLOCK + i, spread_quadruple(_ZERO))
                    continue
                for i in range(0, BLOCK, LANES):
                    x = b * BLOCK + i
                    lit = _FOUR_PI * read_quadruple(coarser.beam, (k * rows + j) * nx + x)
                    for ell in range(degree):
                        sigma = flat(grid.air_scattering, k * degree + ell)
                        if kind > 0:
                            sigma = flat(grid.scattering, (kind - 1) * degree + ell)
                        _terms(
                            terms, i, ell, spread_quadruple(sigma), coarser.values, kept * moments * BLOCK + i,
                            coarser.sun_harmonics, j * moments * nx + x, nx, lit,
                        )  # fmt: skip
                multiply(parts, terms, 0, BLOCK, sums, 0, BLOCK, False)
                multiply(whole, sums, 0, BLOCK, lines, 1 + b * BLOCK, line, False)
            for n in range(count):
                _row_ends(lines, n * line, coarser.columns, False)
                out = ((kind * rows + j) * count + n) * stride + 1
                for m in range(0, (stride - 2) // 2, 2 * PACK):
                    here = _NEAR * read_double(lines, n * line + 1 + m)
                    even = here + _FAR * read_double(lines, n * line + m)
                    odd = here + _FAR * read_double(lines, n * line + 2 + m)
                    write(planes, out + 2 * m, interleave(even, odd))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def collect_row(k, j, at, again, intensity, gather, spread, place, sums, values, nx):
    """Sum of w_n Y_nlm I_n over row ``at`` of ``intensity``, row j of level k, into the blocks that are kept.

    again: add to what is there, as the second half of the ordinates does.
    """
    count, stride = intensity.shape[2], intensity.shape[3]
    moments = values.shape[1]
    for b in range(place.shape[2]):
        kept = flat(place, (k * place.shape[1] + j) * place.shape[2] + b)
        if kept < 0:
            continue
        out = kept * moments * BLOCK
        multiply(gather, intensity, at * count * stride + 1 + b * BLOCK, stride, sums, 0, BLOCK, False)
        multiply(spread, sums, 0, BLOCK, values, out, BLOCK, again)
        for m in range(moments):
            for i in range(nx - b * BLOCK, BLOCK):  # beyond the last node
                put(values, out + m * BLOCK + i, _ZERO)
