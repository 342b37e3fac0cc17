"""Sweep: light with a source carried through the grid along discrete ordinates, one after another.

`half_sweep` returns the spherical-harmonic moments of one hemisphere. Directions point to where the light comes from;
"upstream" is that way. Grids are (nz, ny, nx), lengths in metres.

An ordinate crosses the grid in strips of rows, plane after plane, which a core's cache holds. What the grid emits and
what light is left in it is kept for a group of ordinates at a time, in the blocks that keep moments.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.absorbed_light import amend_plane, leave_amended
from openswim.transport.diffuse.boundaries import cross_clear, end_rows, enter, rounds_of, set_sides, wrap_sides
from openswim.transport.diffuse.emission import (
    collect_row,
    emission_row,
    kept_row,
    row_of_emission,
    thin_row,
)
from openswim.transport.diffuse.ground_nodes import share_ground, share_of_ground
from openswim.transport.diffuse.moments import Coarser
from openswim.transport.diffuse.optical_grid import OpticalGrid
from openswim.transport.diffuse.ordinate_transform import BLOCK, Groups
from openswim.transport.diffuse.step import (
    ALONG_X,
    ALONG_Y,
    ALONG_Z,
    Plane,
    Row,
    Step,
    carry_row,
    step_weights,
    upstream,
)
from openswim.transport.engine.compiled import REORDERED, kernel, part
from openswim.transport.engine.pack import flat, put, read_quadruple, write
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]



class Half(NamedTuple):
    """The ordinates of one hemisphere: ``direction`` (n, 3) toward the light's origin, ``weight`` (n,)."""

    direction: np.ndarray
    weight: np.ndarray
    inflow: np.ndarray  # (nz, n) radiance entering the sides and the top
    edges: np.ndarray  # (n, nz, 4, m) in its place at the sides, in periodic grids of the last sweep; or (n, 1, 4, 0)


class Room(NamedTuple):
    """Scratch that sweeps of a grid share."""

    extinction: np.ndarray  # (nz, ny + 2, nodes and ghosts) 1/m; then two planes per thread if cloud is on ground
    emission: np.ndarray  # (ordinates of a group, blocks kept, BLOCK) in all, see `kept_row`; then the radiance
    row: np.ndarray  # (nz * ny + 1,) the first block kept on each row
    thin: np.ndarray  # (rows, ordinates of a group, nodes) of the coarser grid: what it gives the air and thin cloud
    thin_level: np.ndarray  # (nz, 2) where the air's and cloud's rows of a level begin there, -1 where there are none
    light: np.ndarray  # (threads, 2, rows, nodes), with ghosts: radiance on this plane and the one before, in a strip
    emitted: np.ndarray  # the same of emission
    amended: np.ndarray  # the same of what is to be added to the light, as a share of it; none where nothing is
    more: np.ndarray  # (threads, blocks kept, BLOCK) the sum of that over the ordinates, as part of the first moment
    near_cloud: np.ndarray  # (nz,) 1 at levels with steps in cloud, 2 where the next have some
    front: np.ndarray  # (threads, 2, nz, nodes and ghosts) radiance and emission where the next strip begins
    work: np.ndarray  # (threads, 2, nodes and ghosts)
    flux: np.ndarray  # (threads, ny, nx)
    amounts: np.ndarray  # (threads, 1 + s, BLOCK)
    terms: np.ndarray  # (threads, M*M, BLOCK)


class Hemisphere(NamedTuple):
    """What the ordinates of one hemisphere are carried through."""

    downward: bool  # their light comes from above (or level), else from below, starting at the ground's radiance
    grid: OpticalGrid
    half: Half
    place: NDArray[np.int32]  # of the moments before
    coarser: Coarser  # the field that lights what is not kept
    ground_radiance: F32  # (ny, nx)
    highest: int  # greatest of ``grid.ground_node``
    room: Room


class Strip(NamedTuple):
    """Rows that are carried through all planes at once."""

    rows: tuple[int, int]  # the first, and the one after the last
    follows: bool  # there is a strip upstream
    precedes: bool  # and one downstream


@part(REORDERED)
def _plan_step(q, k, before, grid, step):
    """How an ordinate steps through one plane: short characteristics along the axis whose cells it crosses fastest.

    Returns that axis. step (8,): see `Step.weights`. before: the plane before, or k itself.
    """
    levels_m, cell_m, air_extinction = grid.levels_m, grid.cell_m, grid.air_extinction
    dz = abs(levels_m[k] - levels_m[before]) if before != k else 1.0
    air, air_old = air_extinction[k], air_extinction[before]
    tx = cell_m[0] / max(abs(q[0]), 1e-12)
    ty = cell_m[1] / max(abs(q[1]), 1e-12)
    tz = dz / max(abs(q[2]), 1e-12)
    if tz <= tx and tz <= ty:
        axis, ds, a, c = ALONG_Z, tz, tz / tx, tz / ty
    elif ty <= tx:
        axis, ds, a, c = ALONG_Y, ty, ty / tx, ty / tz
    else:
        axis, ds, a, c = ALONG_X, tx, tx / ty, tx / tz
    step[0], step[1], step[2], step[3], step[4] = (1 - a) * (1 - c), a * (1 - c), (1 - a) * c, a * c, ds
    up = FLOAT(air_old if axis == ALONG_Z else air * (1 - c) + air_old * c)
    step[5], step[6], step[7] = step_weights(air, up, step[4])
    return axis


@part(REORDERED, inlined=True)
def _sweep_plane(plane, step, grid, room):
    """Light carried to a `Plane`, in the room's buffers."""
    _, ny, packs = grid.cloudy.shape
    nx = grid.ground_node.shape[1]
    light, extinction = room.light, room.extinction
    stride = extinction.shape[2]
    k, begin, end, now, sx, sy, inflow = plane.k, plane.begin, plane.end, plane.now, plane.sx, plane.sy, plane.inflow
    now_e, last_e = (plane.level_e * (ny + 2) + begin) * stride, (plane.before_e * (ny + 2) + begin) * stride
    from_above = plane.axis == ALONG_Z and plane.top
    across_x = grid.ends[0, int(sx > 0)] and plane.to_x != 0.0 and nx > 1
    across_y = grid.ends[1, int(sy > 0)] and plane.side and plane.to_y != 0.0
    entry = (nx - 1 if sx > 0 else 0) if across_x else -1
    for m in range(end - begin):
        j = end - begin - m if sy > 0 else 1 + m
        row, aside = j * stride + 1, (j + sy) * stride + 1
        if from_above or (m == 0 and across_y):
            for i in range(-1, nx + 1):
                put(light, now + row + i, inflow)
            continue
        upstream(plane, row, aside, now_e, last_e, step)
        carry_row(
            Row(now + row, now_e + row, (k * ny + begin + j - 1) * packs, nx, entry), plane, step, grid.cloudy, room
        )
        if across_x:
            length = grid.cell_m[0] / abs(plane.to_x)
            enter(light, now + row + entry, -sx, extinction, now_e + row + entry, length, inflow)
    if across_y and end - begin > 1 and not from_above:
        row = (end - begin if sy > 0 else 1) * stride + 1
        length = grid.cell_m[1] / abs(plane.to_y)
        for i in range(nx):
            enter(light, now + row + i, -sy * stride, extinction, now_e + row + i, length, inflow)


@part(REORDERED, inlined=True)
def _emit(k, rows, slot, now, grid, place, coarser, room):
    """Emission on a strip of a plane along the ``slot``-th ordinate, from flat element ``now`` of its buffer on."""
    stride = room.emitted.shape[3]
    for j in range(rows[0], rows[1]):
        emission_row(
            k, j, slot, now + (j - rows[0] + 1) * stride, grid, place, room.row, room.emission, coarser,
            room.thin, room.thin_level[k, 0], room.thin_level[k, 1], room.extinction, room.emitted,
        )  # fmt: skip


@part(REORDERED)
def _meet_ground(k, downward, rows, plane, share, ground_node, ground_radiance, flux):
    """Flux that a swept strip brings to the ground, or radiance that rises from it, at and below its nodes.

    share: of the hemisphere's flux, on the scale of E_TOA = 1, that this ordinate's radiance is.
    """
    for j in range(rows[0], rows[1]):
        own = plane[j - rows[0] + 1]
        for i in range(ground_node.shape[1]):
            if not downward:
                if k <= ground_node[j, i]:
                    own[i + 1] = ground_radiance[j, i]
            elif k == ground_node[j, i]:
                flux[j, i] += share * own[i + 1]


@part(REORDERED)
def _leave_top(rows, plane, share, flux):
    """Flux through the top; ``share``: see `_meet_ground`."""
    for j in range(rows[0], rows[1]):
        for i in range(flux.shape[1]):
            flux[j, i] += share * plane[j - rows[0] + 1, i + 1]


@part(REORDERED, inlined=True)
def _leave_light(k, n, rows, place, row, light, start, radiance):
    """Radiance of a swept strip, which begins at flat element ``start`` of ``light``, into the blocks that are kept."""
    ny, blocks = place.shape[1], place.shape[2]
    stride = light.shape[3]
    for j in range(rows[0], rows[1]):
        first, apart = row_of_emission(k * ny + j, row, radiance)
        for b in range(blocks):
            kept = flat(place, (k * ny + j) * blocks + b)
            if kept >= 0:
                out = first + n * apart + kept * BLOCK
                at = start + (j - rows[0] + 1) * stride + 1 + b * BLOCK
                write(radiance, out, read_quadruple(light, at))


@part(REORDERED)
def _copy_row(row, out):
    for i in range(row.shape[0]):
        out[i] = row[i]


@part(REORDERED)
def _carry_strip(n, slot, t, strip, hemisphere, step):
    """Ordinate n, the ``slot``-th of its group, through a `Strip` of all planes, in buffers of thread t."""
    rows, follows, precedes = strip
    downward, grid, half, place, coarser, ground_radiance, highest, room = hemisphere
    nz = grid.cloudy.shape[0]
    nx = grid.ground_node.shape[1]
    stride = room.light.shape[3]
    size = room.light.shape[2] * stride
    count = rows[1] - rows[0]
    q = half.direction[n]
    sx, sy = 1 if q[0] > 0 else -1, 1 if q[1] > 0 else -1
    ahead, behind = (count + 1, 1) if sy > 0 else (0, count)
    share = half.weight[n] * FLOAT(abs(q[2]) / (4.0 * math.pi))
    known = half.edges.shape[3] > 0
    amend = room.amended.shape[2] > 0
    level_e = 0
    for turn in range(nz):
        k = nz - 1 - turn if downward else turn
        before = k if turn == 0 else (k + 1 if downward else k - 1)
        cur = turn % 2
        now, last = (t * 2 + cur) * size, (t * 2 + 1 - cur) * size
        inflow = half.inflow[k, n]
        plane, emitted = room.light[t, cur, : count + 2], room.emitted[t, cur, : count + 2]
        _emit(k, rows, slot, now, grid, place, coarser, room)
        before_e, level_e = before if turn == 0 else level_e, k
        if k <= highest and room.near_cloud[k] == 1 and room.extinction.shape[0] > nz:
            part = share_of_ground(k, q, downward, grid.levels_m, grid.cell_m)
            if part != 1.0:
                level_e = nz + 2 * t + cur
                share_ground(k, rows, part, grid, room.extinction[k], room.extinction[level_e], emitted)
        end_rows(emitted, grid.periodic)
        set_sides(plane, rows[0], nx, grid.periodic, inflow, known, half.edges[n, k if known else 0])
        if follows:
            _copy_row(room.front[t, 0, k], plane[ahead])
            _copy_row(room.front[t, 1, k], emitted[ahead])
        axis = _plan_step(q, k, before, grid, step.weights)
        swept = Plane(
            k, before, level_e, before_e, rows[0], rows[1], now, last, axis, q[0], q[1], sx, sy, turn == 0,
            not (follows or grid.periodic), inflow, 2 * t * stride,
        )  # fmt: skip
        clear = room.near_cloud[k] != 1 and room.near_cloud[before] != 1 and min(k, before) >= highest
        if grid.periodic and clear and axis != ALONG_Z and turn > 0 and q[2] != 0.0:
            cross_clear(k, before, q, grid, plane, room.light[t, 1 - cur], emitted, room.emitted[t, 1 - cur])
        else:
            rounds = 1
            if grid.periodic and axis != ALONG_Z and turn > 0:
                rounds = rounds_of(q, grid.levels_m[k] - grid.levels_m[before], grid.cell_m, grid.ground_node.shape)
            for done in range(rounds):
                if done > 0:
                    wrap_sides(plane, nx, half.edges[n, k])
                _sweep_plane(swept, step, grid, room)
        if k <= highest:
            _meet_ground(k, downward, rows, plane, share, grid.ground_node, ground_radiance, room.flux[t])
        if k == nz - 1 and not downward:
            _leave_top(rows, plane, share, room.flux[t])
        if grid.periodic:
            wrap_sides(plane, nx, half.edges[n, k])
        if precedes:
            _copy_row(plane[behind], room.front[t, 0, k])
            _copy_row(emitted[behind], room.front[t, 1, k])
        _leave_light(k, slot, rows, place, room.row, room.light, now, room.emission)
        if amend:
            if room.near_cloud[k] > 0:
                room.amended[t, cur, : count + 2] = FLOAT(0.0)
            if room.near_cloud[k] == 1:
                buried = (k + 1 if downward else k) if k <= highest else -1  # what rises begins at the ground
                after = min(max(k - 1 if downward else k + 1, 0), nz - 1)
                amend_plane(swept, after, buried, step, grid, room)
        if turn > 0:
            leave_amended(before, t, 1 - cur, rows, grid, place, half.weight[n], q, downward, highest, room)
        if turn == nz - 1:
            leave_amended(k, t, cur, rows, grid, place, half.weight[n], q, downward, highest, room)


@part(REORDERED)
def _carry(n, slot, t, hemisphere, step):
    """Ordinate n through the whole grid, strip after strip: a strip's planes fit in a core's cache."""
    ny = hemisphere.grid.cloudy.shape[1]
    height = hemisphere.room.light.shape[2] - 2
    strips = -(-ny // height)
    for s in range(strips):
        where = strips - 1 - s if hemisphere.half.direction[n, 1] > 0 else s
        rows = (where * ny // strips, (where + 1) * ny // strips)
        _carry_strip(n, slot, t, Strip(rows, s > 0, s + 1 < strips), hemisphere, step)


@kernel(REORDERED)
def share_rows(t, threads, g, group, values, new_values, hemisphere):
    """Thread t's share of what stands between two groups: what group g - 1 has left, and what g will find.

    The downward half is the first: there is nothing yet to add to.
    """
    begins, grid, place, coarser, room = (
        hemisphere.downward, hemisphere.grid, hemisphere.place, hemisphere.coarser, hemisphere.room,
    )  # fmt: skip
    nz, ny, _ = grid.cloudy.shape
    groups = group.first.shape[0] - 1
    if g == 0:
        room.flux[t] = FLOAT(0.0)
        if begins:
            room.more[t] = FLOAT(0.0)
    for k in range(nz):
        for j in range(t, ny, threads):
            if g > 0:
                collect_row(
                    g - 1, k, j, threads, g > 1 or not begins, room.emission, group, place, room.row, new_values,
                    grid.ground_node.shape[1],
                )  # fmt: skip
            if g < groups:
                kept_row(
                    g, k, j, grid, group, place, room.row, values, room.amounts[t], room.terms[t],
                    room.emission,
                )
        if g < groups:
            for kind in range(2):
                level = room.thin_level[k, kind]
                for m in range(t, coarser.place.shape[1] if level >= 0 else 0, threads):
                    thin_row(
                        g, k, m, kind == 1, level + m, grid, group, coarser, room.amounts[t], room.terms[t],
                        room.thin,
                    )  # fmt: skip


@kernel(REORDERED)
def share_ordinates(t, threads, g, first, hemisphere):
    """Thread t's share of the ordinates of group g, first[g] to first[g + 1], carried through the grid."""
    step = Step(np.empty(8, FLOAT), np.empty(4, np.int64), np.empty(4, np.int64))
    for n in range(first[g] + t, first[g + 1], threads):
        _carry(n, n - first[g], t, hemisphere, step)


def half_sweep(hemisphere: Hemisphere, group: Groups, values: F32, new_values: F32) -> F32:
    """Carry the light of one hemisphere through the grid and sum its moments into ``new_values``.

    The downward half comes first and overwrites, the other adds. values: the moments before; new_values: after.
    Returns the flux (ny, nx) through the ground (downward) or the top.
    """
    groups = len(group.first) - 1
    for g in range(groups + 1):
        in_threads(share_rows, g, group, values, new_values, hemisphere)
        if g < groups:
            in_threads(share_ordinates, g, group.first, hemisphere)
    return np.asarray(hemisphere.room.flux.sum(axis=0))
