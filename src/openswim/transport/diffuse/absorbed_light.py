"""What the steps of a sweep take of the light, and so what nodes scatter (docs/decisions/0015-light-between-nodes.md).

A step loses what goes in, and what is emitted along it, less what comes out. That over what the light at the nodes at
its ends would lose amends that light, ordinate by ordinate; of their sum the mean radiance is kept.
"""

from __future__ import annotations

import math

from openswim.transport.diffuse.ground_nodes import all_of_ground
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.diffuse.step import ALONG_Z, Row, between_corners, upstream
from openswim.transport.engine.compiled import REORDERED, part
from openswim.transport.engine.pack import LANES, choose_above, flat, put, read_quadruple, write
from openswim.transport.engine.types import FLOAT

_ZERO, _HALF, _ONE = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0)
_FAINT, _TINY = FLOAT(1e-3), FLOAT(1e-30)  # optical depth of a step that is left as it is; least light
_MOST = FLOAT(50.0)  # times as much as the nodes say, a step may take
_FIRST = FLOAT(0.5 / math.sqrt(math.pi))  # the first harmonic


@part(REORDERED, inlined=True)
def _amend_row(row, scratch, step, shares, buried, first, grid, buffers):
    """What the steps of a `Row` that has been carried take of the light, over what the nodes at their ends would have
    them take: less one, as a share of these nodes' light, added to ``buffers.amended``.

    A step loses exactly what goes in, and what the nodes emit along it, less what comes out. shares: what the step is
    of all that is around its node, and of what is around the upstream ones. buried: steps to nodes whose ground, from
    flat element ``first`` on, is that level or above do not count; or -1.
    """
    intensity, source, extinction = buffers.light, buffers.emitted, buffers.extinction
    amended, work, cloudy, ground = buffers.amended, buffers.work, grid.cloudy, grid.ground_node
    own_share, up_share = shares
    out, out_e, packs, nx, entry = row
    room = scratch
    weights, at, at_e = step
    wa, wb, wc, wd = flat(weights, 0), flat(weights, 1), flat(weights, 2), flat(weights, 3)
    half = _HALF * flat(weights, 4)
    a, b, c, d = flat(at, 0), flat(at, 1), flat(at, 2), flat(at, 3)
    e_a, e_b, e_c, e_d = flat(at_e, 0), flat(at_e, 1), flat(at_e, 2), flat(at_e, 3)
    for i in range(0, nx, LANES):
        if not flat(cloudy, packs + i // LANES):
            continue
        light_a, light_b = wa * read_quadruple(intensity, a + i), wb * read_quadruple(intensity, b + i)
        light_c, light_d = wc * read_quadruple(intensity, c + i), wd * read_quadruple(intensity, d + i)
        own = read_quadruple(intensity, out + i)
        up = (light_a + light_b) + (light_c + light_d)
        told = light_a * read_quadruple(extinction, e_a + i) + light_b * read_quadruple(extinction, e_b + i)
        told += light_c * read_quadruple(extinction, e_c + i) + light_d * read_quadruple(extinction, e_d + i)
        told = half * (told + own * read_quadruple(extinction, out_e + i))
        emitted = read_quadruple(source, out + i) + between_corners(source, a + i, b + i, c + i, d + i, wa, wb, wc, wd)
        lost = half * emitted + (up - own)
        least = _FAINT * (up + own) + _TINY
        more = choose_above(told, least, lost / choose_above(told, least, told, least) - _ONE, _ZERO)
        more = choose_above(more, _MOST, _MOST, more)
        more = choose_above(more, -_ONE, more, -_ONE)
        write(work, room, more)
        if i <= entry < i + LANES:
            put(work, room + entry - i, _ZERO)
        for n in range(nx - i, LANES):
            put(work, room + n, _ZERO)
        if buried >= 0:
            for n in range(min(nx - i, LANES)):
                if flat(ground, first + i + n) >= buried:
                    put(work, room + n, _ZERO)
        more = read_quadruple(work, room)
        write(amended, out + i, read_quadruple(amended, out + i) + own_share * more)
        more *= up_share
        write(amended, a + i, read_quadruple(amended, a + i) + wa * more)
        write(amended, b + i, read_quadruple(amended, b + i) + wb * more)
        write(amended, c + i, read_quadruple(amended, c + i) + wc * more)
        write(amended, d + i, read_quadruple(amended, d + i) + wd * more)


@part(REORDERED, inlined=True)
def amend_plane(plane, after, buried, step, grid, buffers):
    """`_amend_row` of the steps of `sweep._sweep_plane`; ``after``: the plane downstream."""
    _, ny, packs = grid.cloudy.shape
    nx = grid.ground_node.shape[1]
    stride = buffers.extinction.shape[2]
    k, before, begin, end, sx, sy = plane.k, plane.before, plane.begin, plane.end, plane.sx, plane.sy
    now_e, last_e = (plane.level_e * (ny + 2) + begin) * stride, (plane.before_e * (ny + 2) + begin) * stride
    entry = (nx - 1 if sx > 0 else 0) if grid.ends[0, int(sx > 0)] and plane.to_x != 0.0 and nx > 1 else -1
    skipped = 1 if grid.ends[1, int(sy > 0)] and plane.side and plane.to_y != 0.0 else 0
    own_share, up_share = FLOAT(0.5), FLOAT(0.5)
    if plane.axis == ALONG_Z:
        if plane.top:
            return
        z = grid.levels_m
        thick = abs(z[k] - z[before])
        further = 2 * before - k
        beyond = abs(z[before] - z[further]) if 0 <= further < z.shape[0] else 0.0
        own_share = FLOAT(thick / (thick + abs(z[after] - z[k])))
        up_share = FLOAT(thick / (thick + beyond))
    for m in range(skipped, end - begin):
        j = end - begin - m if sy > 0 else 1 + m
        row, aside = j * stride + 1, (j + sy) * stride + 1
        upstream(plane, row, aside, now_e, last_e, step)
        here = Row(plane.now + row, now_e + row, (k * ny + begin + j - 1) * packs, nx, entry)
        first = (begin + j - 1) * nx
        _amend_row(here, plane.scratch, step, (own_share, up_share), buried, first, grid, buffers)


@part(REORDERED)
def _fold_sides(plane, nx, periodic):
    """What ghost nodes have got goes to those they stand for."""
    ny = plane.shape[0] - 2
    for i in range(plane.shape[1]):
        plane[ny if periodic else 1, i] += plane[0, i]
        plane[1 if periodic else ny, i] += plane[ny + 1, i]
    for j in range(1, ny + 1):
        plane[j, nx if periodic else 1] += plane[j, 0]
        plane[j, 1 if periodic else nx] += plane[j, nx + 1]


@part(REORDERED)
def _leave_more(k, t, rows, cloudy, place, weight, light, amended, start, more):
    """What a swept strip's light is to be amended by, a share ``amended`` of it, into the sums of thread t."""
    ny, blocks = place.shape[1], place.shape[2]
    stride = light.shape[3]
    first = t * more.shape[1] * BLOCK
    for j in range(rows[0], rows[1]):
        for b in range(blocks):
            kept = flat(place, (k * ny + j) * blocks + b)
            if kept < 0 or not flat(cloudy, (k * ny + j) * blocks + b):
                continue
            at = start + (j - rows[0] + 1) * stride + 1 + b * BLOCK
            out = first + kept * BLOCK
            added = read_quadruple(light, at) * read_quadruple(amended, at)
            write(more, out, read_quadruple(more, out) + weight * added)


@part(REORDERED)
def leave_amended(k, t, which, rows, grid, place, weight, q, downward, highest, room):
    """`_leave_more` of a plane, once the steps to the next one have amended it."""
    if room.amended.shape[2] == 0 or room.near_cloud[k] == 0:
        return
    plane = room.amended[t, which, : rows[1] - rows[0] + 2]
    _fold_sides(plane, grid.ground_node.shape[1], grid.periodic)
    if k <= highest and room.near_cloud[k] == 1:
        all_of_ground(k, rows, q, downward, grid, plane)
    start = (t * 2 + which) * room.light.shape[2] * room.light.shape[3]
    _leave_more(k, t, rows, grid.cloudy, place, _FIRST * weight, room.light, room.amended, start, room.more)
