"""What a sweep carries and leaves: the source along ordinates from moments, and moments from radiance, row by row."""

from __future__ import annotations

import math

from openswim.transport.diffuse.moments import between, interpolated
from openswim.transport.diffuse.ordinate_transform import BLOCK, multiply
from openswim.transport.engine.compiled import REORDERED, part
from openswim.transport.engine.pack import (
    LANES,
    expect,
    flat,
    put,
    read_quadruple,
    spread_quadruple,
    write,
)
from openswim.transport.engine.types import FLOAT

_ZERO, _ONE = FLOAT(0.0), FLOAT(1.0)
_FOUR_PI = FLOAT(4.0 * math.pi)


@part(REORDERED)
def _block_source(
    g, k, amounts, grid, group, values, at, beam, node, harmonics, column, stride, terms, out, first, apart
):  # fmt: skip
    """Emission of a block along the ordinates of group g, S_n = sum_lm Y_nlm sigma_l (I_lm + 4 pi Y_lm(sun) T').

    amounts (1 + s, BLOCK): of the air and of every species. I_lm: block ``at`` of ``values``. T', Y(sun): from flat
    elements ``node`` of ``beam`` and ``column`` of ``harmonics``, whose rows are ``stride`` apart. S_n goes to ``out``
    from flat element ``first`` on, ordinates ``apart``.
    """
    degree = grid.air_scattering.shape[1]
    start = at * degree * degree * BLOCK
    lit = _FOUR_PI * read_quadruple(beam, node)
    for ell in range(degree):
        sigma = flat(grid.air_scattering, k * degree + ell) * read_quadruple(amounts, 0)
        for s in range(grid.scattering.shape[0]):
            sigma += flat(grid.scattering, s * degree + ell) * read_quadruple(amounts, (1 + s) * BLOCK)
        for index in range(ell * ell, (ell + 1) * (ell + 1)):
            moment = read_quadruple(values, start + index * BLOCK)
            solar = read_quadruple(harmonics, column + index * stride)
            write(terms, index * BLOCK, sigma * (moment + lit * solar))
    count = flat(group.first, g + 1) - flat(group.first, g)
    multiply(group.harmonics, g, count, degree * degree, terms, 0, BLOCK, out, first, apart, False)


@part(REORDERED, inlined=True)
def row_of_emission(n, row, emission):
    """Where the emission (or the radiance) of row n's blocks along its group's first ordinate lies, to which a block's
    own index times BLOCK is to be added, and how far apart that of another ordinate."""
    apart = (flat(row, n + 1) - flat(row, n)) * BLOCK
    return flat(row, n) * (emission.shape[0] - 1) * BLOCK, apart


@part(REORDERED, inlined=True)
def _expect_block(values, block):
    """Ask for the moments of a block that is next."""
    size = values.shape[1] * BLOCK
    for i in range(0, size if block < values.shape[0] else 0, LANES):
        expect(values, block * size + i)


@part(REORDERED, inlined=True)
def kept_row(g, k, j, grid, group, place, row, values, amounts, terms, emission):
    """Emission of the blocks that are kept on row j of level k, along the ordinates of group g, into ``emission``.

    row (nz * ny + 1,): the first block that is kept on each. ``emission`` has the rows' blocks one row after the other,
    each row first along one ordinate, then along the next.
    """
    ns, nz, ny, nx = grid.extinction.shape
    count = grid.sun_harmonics.shape[1]
    blocks = place.shape[2]
    first, apart = row_of_emission(k * ny + j, row, emission)
    write(amounts, 0, spread_quadruple(_ONE))
    for b in range(blocks):
        kept = flat(place, (k * ny + j) * blocks + b)
        if kept < 0:
            continue
        _expect_block(values, kept + 1)
        node = (k * ny + j) * nx + b * BLOCK
        for s in range(ns):
            amount = spread_quadruple(_ZERO)
            if flat(grid.present, k * (1 + ns) + 1 + s):
                amount = read_quadruple(grid.extinction, s * nz * ny * nx + node)
            write(amounts, (1 + s) * BLOCK, amount)
        _block_source(
            g, k, amounts, grid, group, values, kept, grid.beam, node, grid.sun_harmonics, j * count * nx + b * BLOCK,
            nx, terms, emission, first + kept * BLOCK, apart,
        )  # fmt: skip


@part(REORDERED)
def _mixture(k, node, grid, extinction, apart, amounts):
    """What species a unit of delta-scaled extinction of the coarser grid's cloud is; all alike where there is none."""
    ns = grid.scattering.shape[0]
    tiny = FLOAT(1e-12)
    write(amounts, 0, spread_quadruple(_ZERO))
    total = spread_quadruple(tiny * tiny)
    for s in range(ns):
        if flat(grid.present, k * (1 + ns) + 1 + s):
            amount = tiny + read_quadruple(extinction, s * apart + node)
            total += flat(grid.scaled, s) * amount
            write(amounts, (1 + s) * BLOCK, amount)
        else:
            write(amounts, (1 + s) * BLOCK, spread_quadruple(_ZERO))
    per = _ONE / total
    for s in range(ns):
        write(amounts, (1 + s) * BLOCK, per * read_quadruple(amounts, (1 + s) * BLOCK))


@part(REORDERED)
def thin_row(g, k, m, cloud, out_row, grid, group, coarser, amounts, terms, out):
    """Row m of level k of what the coarser field gives the air (cloud: a unit of cloud's extinction) along group g.

    Into row ``out_row`` of ``out`` (rows, ordinates, nodes of the coarser grid and ghosts).
    """
    rows, blocks = coarser.place.shape[1], coarser.place.shape[2]
    nz, nx = coarser.beam.shape[0], coarser.beam.shape[2]
    count = coarser.sun_harmonics.shape[1]
    line = out.shape[2]
    first = out_row * out.shape[1] * line
    size = flat(group.first, g + 1) - flat(group.first, g)
    write(amounts, 0, spread_quadruple(_ONE))
    for s in range(grid.scattering.shape[0]):
        write(amounts, (1 + s) * BLOCK, spread_quadruple(_ZERO))
    for b in range(blocks):
        kept = flat(coarser.place, (k * rows + m) * blocks + b)
        if kept < 0:
            for n in range(size):
                write(out, first + n * line + 1 + b * BLOCK, spread_quadruple(_ZERO))
            continue
        _expect_block(coarser.values, kept + 1)
        node = (k * rows + m) * nx + b * BLOCK
        if cloud:
            _mixture(k, node, grid, coarser.extinction, nz * rows * nx, amounts)
        _block_source(
            g, k, amounts, grid, group, coarser.values, kept, coarser.beam, node, coarser.sun_harmonics,
            m * count * nx + b * BLOCK, nx, terms, out, first + 1 + b * BLOCK, line,
        )  # fmt: skip
    for n in range(size):
        row_ends(out, first + n * line, coarser.columns, False)


@part(REORDERED, inlined=True)
def _upsampled(thin, row, next_row, x, factor, rest, share):
    """LANES nodes from node x of a finer row on, between two rows of a grid coarser by ``factor``."""
    at = row + x // factor  # the node before that of x: rows begin with a ghost
    return interpolated(rest * read_quadruple(thin, at) + share * read_quadruple(thin, at + next_row), factor)


@part(REORDERED, inlined=True)
def _expect_next(at, n, row, emission, thin, air_row, cloud_row):
    """Ask for what the row after this will need: no processor guesses steps of so many ordinates."""
    line = thin.shape[1] * thin.shape[2]
    for i in range(0, thin.shape[2], LANES):
        expect(thin, air_row + 2 * line + i)
        expect(thin, cloud_row + 2 * line + i)
    later = min(at + 3, row.shape[0] - 2)
    apart = (flat(row, later + 1) - flat(row, later)) * BLOCK
    after = flat(row, later) * emission.shape[0] * BLOCK + n * apart
    for i in range(0, apart, LANES):
        expect(emission, after + i)


@part(REORDERED, inlined=True)
def emission_row(k, j, n, start, grid, place, row, emission, coarser, thin, air, cloud, extinction, out):
    """Emission along ordinate n of its group on row j of level k, into the row of ``out`` from ``start`` on.

    Of blocks that are not kept by the coarser field: the air's, and that of thin cloud by its extinction; their rows
    (see `thin_row`) of this level begin at ``air`` and ``cloud``, there are none if these are negative.
    """
    ny, blocks = place.shape[1], place.shape[2]
    rows, apart = coarser.beam.shape[1], thin.shape[1] * thin.shape[2]
    factor = max(coarser.factor, 1)
    m, share = between(j, factor, rows)
    next_row = (min(m + 1, rows - 1) - m) * apart
    rest = _ONE - share
    air_row = (air + m) * apart + n * thin.shape[2]
    cloud_row = (cloud + m) * apart + n * thin.shape[2]
    here = (k * extinction.shape[1] + j + 1) * extinction.shape[2] + 1
    clear = flat(grid.air_extinction, k)
    first, apart = row_of_emission(k * ny + j, row, emission)
    first += n * apart
    _expect_next(k * ny + j, n, row, emission, thin, max(air_row, 0), max(cloud_row, 0))
    for b in range(blocks):
        kept = flat(place, (k * ny + j) * blocks + b)
        x = b * BLOCK
        total = spread_quadruple(_ZERO)
        if kept >= 0:
            total = read_quadruple(emission, first + kept * BLOCK)
        else:
            if air >= 0:
                total += _upsampled(thin, air_row, next_row, x, factor, rest, share)
            if cloud >= 0 and flat(grid.cloudy, (k * ny + j) * blocks + b):
                amount = read_quadruple(extinction, here + x) - clear
                total += amount * _upsampled(thin, cloud_row, next_row, x, factor, rest, share)
        write(out, start + 1 + x, total)
    row_ends(out, start, grid.ground_node.shape[1], grid.periodic)


@part(REORDERED, inlined=True)
def row_ends(rows, at, nx, periodic):
    """Ghost nodes at the ends of the row that begins at flat element ``at``."""
    put(rows, at, flat(rows, at + (nx if periodic else 1)))
    put(rows, at + nx + 1, flat(rows, at + (1 if periodic else nx)))


@part(REORDERED, inlined=True)
def collect_row(g, k, j, ahead, again, radiance, group, place, row, values, nx):
    """Sum of w_n Y_nlm I_n over the blocks that are kept on row j of level k, along group g, into ``values``.

    row, radiance: as in `kept_row`. again: add to what is there, as all groups but the first do. ahead: to this
    thread's next row.
    """
    ny, blocks = place.shape[1], place.shape[2]
    moments = values.shape[1]
    count = flat(group.first, g + 1) - flat(group.first, g)
    first, apart = row_of_emission(k * ny + j, row, radiance)
    later = min(k * ny + j + ahead, row.shape[0] - 2)
    size = radiance.shape[0] * BLOCK
    for i in range(flat(row, later) * size, flat(row, later + 1) * size, LANES):
        expect(radiance, i)
    for b in range(blocks):
        kept = flat(place, (k * ny + j) * blocks + b)
        if kept < 0:
            continue
        out = kept * moments * BLOCK
        if again:
            _expect_block(values, kept + 1)
        multiply(group.gather, g, moments, count, radiance, first + kept * BLOCK, apart, values, out, BLOCK, again)
        for m in range(moments):
            for i in range(nx - b * BLOCK, BLOCK):  # beyond the last node
                put(values, out + m * BLOCK + i, _ZERO)
