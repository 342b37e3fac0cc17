"""An ordinate through the grid: value and tangent; `transposed` has the way back, and the gradient.

Nodes on faces by which light enters have the inflow of their level; nodes on and below the ground have, for light from
below, the ground's radiance; all others what the step from the point upstream (`course`) brings. The kernels go through
the grid alike: they differ in nothing but what they do at a node. Fields are rows of nodes, (b, nodes) of b ordinates.

Eight nodes of a row are gone through at once (`engine.lanes`). Where an ordinate leaves its cells by the face between
two nodes of a row, light goes from node to node there: what is left of that of the node before is added by itself.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from openswim.transport.engine.lanes import LANES, read, write
from openswim.transport.linear.cell import amendment, step_slopes, step_weights, trusted
from openswim.transport.linear.course import (
    FLAGS,
    PART,
    ROW,
    add,
    between,
    course_of,
    highest_of,
    pair_at,
    pairs_of,
    set_out,
    step_of,
    within,
    without_first,
)


class Sources(NamedTuple):
    """Where the light of b ordinates comes from."""

    emission: np.ndarray  # (b, nodes) per length
    inflow: np.ndarray  # (b, nz) radiance from outside
    ground: np.ndarray  # (columns,) radiance of the ground


class Changes(NamedTuple):
    """Of what `carry` is given."""

    ext: np.ndarray  # (nodes,)
    emission: np.ndarray  # (b, nodes)
    ground: np.ndarray  # (columns,)


@njit(**PART)
def _weigh_some(p, at, some, ext, step, own):
    near, up, width = read(ext, p, some), between(ext, p, step, some), own.shape[1]
    trans, of_near, of_far = step_weights(near, up, step[2])
    write(own, at, trans, some)
    write(own, width + at, of_near, some)
    write(own, 2 * width + at, of_far, some)
    write(own, 3 * width + at, 0.5 / trusted(near, up, step[2]), some)


@njit(**ROW)
def weigh_row(p, at, count, ext, step, own):
    """Into own[:, at:] what the steps to ``count`` nodes from p on have: what `step_weights` gives, and half of one
    over `trusted`."""
    for s in range(0, count - LANES + 1, LANES):
        _weigh_some(p + s, at + s, None, ext, step, own)
    s = count % LANES
    if s:
        _weigh_some(p + count - s, at + count - s, s, ext, step, own)


@njit(**FLAGS)
def weigh(t, threads, grid, directions, ext, steps):
    """steps (b, 4, nodes) as `weigh_row` makes them; where light enters, nothing is told."""
    course = course_of(grid)
    entry = course.entry
    nz, ny, nx = grid.shape
    for n in range(t, directions.shape[0], threads):
        set_out(directions[n], grid, course, False)
        first, count = within(entry, nx)
        for k in range(nz):
            step, _ = step_of(course, k)
            for j in range(ny):
                if k != entry[0] and j != entry[1]:
                    p = (k * ny + j) * nx + first
                    weigh_row(p, p, count, ext, step, steps[n])


@njit(**PART)
def _pass_some(p, at, some, e, step, passing, own, out):
    width = own.shape[1]
    here = read(own, at, some) * between(out, p, passing, some) + read(own, width + at, some) * read(e, p, some)
    write(out, p, here + read(own, 2 * width + at, some) * between(e, p, step, some), some)


@njit(**PART)
def _tell_some(p, at, i, some, ext, e, step, own, out, amended, told_row):
    share, to, ds = step
    a, b, c, d = (
        share[0] * read(out, p + to[0], some), share[1] * read(out, p + to[1], some),
        share[2] * read(out, p + to[2], some), share[3] * read(out, p + to[3], some),
    )  # fmt: skip
    told = read(ext, p + to[0], some) * a + read(ext, p + to[1], some) * b
    told += read(ext, p + to[2], some) * c + read(ext, p + to[3], some) * d
    more = amendment(
        read(out, p, some), (a + b) + (c + d), read(e, p, some), between(e, p, step, some), read(ext, p, some), told,
        1.0, ds,
    )  # fmt: skip
    more = more * read(own, 3 * own.shape[1] + at, some)
    add(amended, p, more, some)
    write(told_row, LANES + i, more, some)


@njit(**ROW)
def _tell_upstream(q, i, count, pair, told_row, amended):
    """What a row of steps tells to those of its corners that lie from q on."""
    for s in range(0, count - LANES + 1, LANES):
        add(amended, q + s, pair_at(told_row, LANES + i + s, None, pair), None)
    s = count % LANES
    if s:
        add(amended, q + count - s, pair_at(told_row, LANES + i + count - s, s, pair), s)


@njit(**ROW)
def _tell_corners(p, i, count, step, told_row, amended):
    share, to, _ = step
    for c in range(4):
        _tell_upstream(p + to[c], i, count, (share[c], 0.0, 0), told_row, amended)


@njit(**ROW)
def _carry_row(line, at, first, count, turn, beside, ext, e, step, own, out, amended, told_row):
    """Light at ``count`` nodes of a row from its ``first`` on, and what amends it. turn: +1 or -1, the light's way
    along the row; beside: whether it goes from node to node there."""
    p = line + first
    passing = without_first(step) if beside else step
    rest = count % LANES
    for s in range(0, count - LANES + 1, LANES):
        _pass_some(p + s, at + s, None, e, step, passing, own, out)
    if rest:
        _pass_some(p + count - rest, at + count - rest, rest, e, step, passing, own, out)
    if beside:
        share, i = step[0][0], 0 if turn > 0 else count - 1
        light = np.float64(out[p + i + step[1][0]])
        for _ in range(count):
            light = out[p + i] + share * own[0, at + i] * light
            out[p + i] = light
            i += turn
    for s in range(0, count - LANES + 1, LANES):
        _tell_some(p + s, at + s, first + s, None, ext, e, step, own, out, amended, told_row)
    if rest:
        s = count - rest
        _tell_some(p + s, at + s, first + s, rest, ext, e, step, own, out, amended, told_row)
    one, two = pairs_of(step)
    if one[2] == 0:
        _tell_corners(p, first, count, step, told_row, amended)
    else:
        nx, to = told_row.shape[0] - 2 * LANES, step[1]
        _tell_upstream(line + to[0], 0, nx, one, told_row, amended)
        if two[0] + two[1] > 0.0:
            _tell_upstream(line + to[2], 0, nx, two, told_row, amended)


@njit(**FLAGS)
def carry(t, threads, grid, directions, ext, steps, sources, light, more):
    """light (b, nodes): radiance of ordinates; ext: scaled extinction, by which `weigh` has made ``steps``. Where there
    are none (0, 4, nodes) they are found row by row.

    more: how much more steps around the nodes take (`cell.amendment`).
    """
    shape, _, _, ground_node = grid
    course = course_of(grid)
    way, entry = course.way, course.entry
    emission, inflow, ground = sources
    kept, scratch, highest = steps.shape[0] > 0, np.zeros((4, shape[2]), ext.dtype), highest_of(ground_node)
    told_row = np.zeros(shape[2] + 2 * LANES, ext.dtype)
    for n in range(t, directions.shape[0], threads):
        q, e, out, amended = directions[n], emission[n], light[n], more[n]
        own = steps[n] if kept else scratch
        set_out(q, grid, course, False)
        ny, nx, rising, turn = shape[1], shape[2], q[2] < 0.0, way[2, 2]
        first, count = within(entry, nx)
        out[:] = 0.0  # light along a row is read, with no weight, before it is known
        amended[:] = 0.0
        told_row[:] = 0.0
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            step, beside = step_of(course, k)
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row, line = k == entry[0] or j == entry[1], (k * ny + j) * nx
                at = line if kept else 0
                if not (kept or row):
                    weigh_row(line + first, first, count, ext, step, own)
                if rising and k <= highest[j]:
                    for i in range(way[2, 0], way[2, 1], way[2, 2]):
                        if k <= ground_node[j, i]:
                            out[line + i] = ground[j * nx + i]
                        elif row or i == entry[2]:
                            out[line + i] = inflow[n, k]
                        else:
                            _pass_some(line + i, at + i, 1, e, step, step, own, out)
                            _tell_some(line + i, at + i, i, 1, ext, e, step, own, out, amended, told_row)
                            _tell_corners(line + i, i, 1, step, told_row, amended)
                elif row:
                    out[line : line + nx] = inflow[n, k]
                else:
                    if entry[2] >= 0:
                        out[line + entry[2]] = inflow[n, k]
                    _carry_row(
                        line, at + first, first, count, turn, beside, ext, e, step, own, out, amended, told_row
                    )  # fmt: skip


@njit(**FLAGS)
def carry_tangent(t, threads, grid, directions, ext, sources, changes, light, d_light, d_more):
    """`carry`, and the `Changes` of its light and of more."""
    shape, _, _, ground_node = grid
    course = course_of(grid)
    way, entry, offset, weight, length = course
    emission, inflow, ground = sources
    d_ext, d_emission, d_ground = changes
    for n in range(t, directions.shape[0], threads):
        q, e, de, out, d_out, amended = directions[n], emission[n], d_emission[n], light[n], d_light[n], d_more[n]
        set_out(q, grid, course, False)
        ny, nx, rising = shape[1], shape[2], q[2] < 0.0
        amended[:] = 0.0
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            ds = length[k]
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row = k == entry[0] or j == entry[1]
                for i in range(way[2, 0], way[2, 1], way[2, 2]):
                    p = (k * ny + j) * nx + i
                    if rising and k <= ground_node[j, i]:
                        out[p], d_out[p] = ground[j * nx + i], d_ground[j * nx + i]
                        continue
                    if row or i == entry[2]:
                        out[p], d_out[p] = inflow[n, k], 0.0
                        continue
                    up, ext_up, e_up, told, d_up, d_ext_up, de_up, d_told = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                    for c in range(4):
                        w, m = weight[k, c], p + offset[k, c]
                        up += w * out[m]
                        ext_up += w * ext[m]
                        e_up += w * e[m]
                        told += w * ext[m] * out[m]
                        d_up += w * d_out[m]
                        d_ext_up += w * d_ext[m]
                        de_up += w * de[m]
                        d_told += w * (d_ext[m] * out[m] + ext[m] * d_out[m])
                    trans, near, far = step_weights(ext[p], ext_up, ds)
                    t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(ext[p], ext_up, ds)
                    here = trans * up + near * e[p] + far * e_up
                    d_here = trans * d_up + near * de[p] + far * de_up
                    d_here += (t_n * up + n_n * e[p] + f_n * e_up) * d_ext[p]
                    d_here += (t_f * up + n_f * e[p] + f_f * e_up) * d_ext_up
                    out[p], d_out[p] = here, d_here
                    both = trusted(ext[p], ext_up, ds)
                    a = amendment(here, up, e[p], e_up, ext[p], told, both, ds)
                    d = 2.0 / ds * (d_up - d_here) + de[p] + de_up - d_ext[p] * here - ext[p] * d_here - d_told
                    d = 0.5 * (d - a * (d_ext[p] + d_ext_up)) / both
                    amended[p] += d
                    for c in range(4):
                        amended[p + offset[k, c]] += weight[k, c] * d
