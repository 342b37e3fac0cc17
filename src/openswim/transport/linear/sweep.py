"""An ordinate through the grid: its light, or a change of it; `transposed` has the way back, and the gradient.

Nodes on faces by which light enters have the inflow of their level; nodes on and below the ground have, for light from
below, the ground's radiance; all others what the step from the point upstream (`course`) brings. The kernels go through
the grid alike: they differ in nothing but what they do at a node. Fields are rows of nodes, (b, nodes) of b ordinates.

Eight nodes of a row are gone through at once (`engine.lanes`). Where an ordinate leaves its cells by the face between
two nodes of a row, light goes from node to node there: what is left of that of the node before is added by itself.
"""

from typing import NamedTuple

import numpy as np

from openswim.transport.engine.compiled import CONTRACTED, kernel, part
from openswim.transport.engine.lanes import LANES, read, write
from openswim.transport.linear.cell import amendment, step_slopes, step_weights, trusted
from openswim.transport.linear.course import (
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


class About(NamedTuple):
    """Of what `carry` carries a change: what was emitted and the light (b, nodes), and the change of extinction."""

    emission: np.ndarray
    light: np.ndarray
    d_ext: np.ndarray  # (nodes,)


@part(CONTRACTED, inlined=True)
def _weigh_some(p, at, some, ext, step, own):
    near, up, width = read(ext, p, some), between(ext, p, step, some), own.shape[1]
    trans, of_near, of_far = step_weights(near, up, step[2])
    write(own, at, trans, some)
    write(own, width + at, of_near, some)
    write(own, 2 * width + at, of_far, some)
    write(own, 3 * width + at, 0.5 / trusted(near, up, step[2]), some)


@part(CONTRACTED)
def weigh_row(p, at, count, ext, step, own):
    """Into own[:, at:] what the steps to ``count`` nodes from p on have: what `step_weights` gives, and half of one
    over `trusted`."""
    for s in range(0, count - LANES + 1, LANES):
        _weigh_some(p + s, at + s, None, ext, step, own)
    s = count % LANES
    if s:
        _weigh_some(p + count - s, at + count - s, s, ext, step, own)


@kernel(CONTRACTED)
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


@part(CONTRACTED, inlined=True)
def _told(p, step, some, ext, out):
    """What comes from the upstream corners: light, and its product with the extinction there."""
    share, to, _ = step
    a, b, c, d = (
        share[0] * read(out, p + to[0], some), share[1] * read(out, p + to[1], some),
        share[2] * read(out, p + to[2], some), share[3] * read(out, p + to[3], some),
    )  # fmt: skip
    told = read(ext, p + to[0], some) * a + read(ext, p + to[1], some) * b
    told += read(ext, p + to[2], some) * c + read(ext, p + to[3], some) * d
    return (a + b) + (c + d), told


@part(CONTRACTED, inlined=True)
def _pass_some(p, at, some, ext, e, step, passing, own, out, about):
    width = own.shape[1]
    here = read(own, at, some) * between(out, p, passing, some) + read(own, width + at, some) * read(e, p, some)
    here += read(own, 2 * width + at, some) * between(e, p, step, some)
    if about is not None:
        emission, light, d_ext = about
        up, source, source_up = (
            between(light, p, step, some), read(emission, p, some), between(emission, p, step, some),
        )  # fmt: skip
        t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(read(ext, p, some), between(ext, p, step, some), step[2])
        here += (t_n * up + n_n * source + f_n * source_up) * read(d_ext, p, some)
        here += (t_f * up + n_f * source + f_f * source_up) * between(d_ext, p, step, some)
    write(out, p, here, some)


@part(CONTRACTED, inlined=True)
def _tell_some(p, at, i, some, ext, e, step, own, out, amended, told_row, about):
    ds, near, half = step[2], read(ext, p, some), read(own, 3 * own.shape[1] + at, some)
    up, told = _told(p, step, some, ext, out)
    if about is None:
        more = half * amendment(
            read(out, p, some), up, read(e, p, some), between(e, p, step, some), near, told, 1.0, ds
        )  # fmt: skip
    else:
        emission, light, d_ext = about
        d_near, here = read(d_ext, p, some), read(light, p, some)
        light_up, light_told = _told(p, step, some, ext, light)
        both = trusted(near, between(ext, p, step, some), ds)
        taken = amendment(
            here, light_up, read(emission, p, some), between(emission, p, step, some), near, light_told, both, ds
        )  # fmt: skip
        told += _told(p, step, some, d_ext, light)[1] + d_near * here
        more = amendment(read(out, p, some), up, read(e, p, some), between(e, p, step, some), near, told, 1.0, ds)
        more = half * (more - taken * (d_near + between(d_ext, p, step, some)))
    add(amended, p, more, some)
    write(told_row, LANES + i, more, some)


@part(CONTRACTED)
def _tell_upstream(q, i, count, pair, told_row, amended):
    """What a row of steps tells to those of its corners that lie from q on."""
    for s in range(0, count - LANES + 1, LANES):
        add(amended, q + s, pair_at(told_row, LANES + i + s, None, pair), None)
    s = count % LANES
    if s:
        add(amended, q + count - s, pair_at(told_row, LANES + i + count - s, s, pair), s)


@part(CONTRACTED)
def _tell_corners(p, i, count, step, told_row, amended):
    share, to, _ = step
    for c in range(4):
        _tell_upstream(p + to[c], i, count, (share[c], 0.0, np.int64(0)), told_row, amended)


@part(CONTRACTED)
def _carry_row(line, at, first, count, turn, beside, ext, e, step, own, out, amended, told_row, about):
    """Light at ``count`` nodes of a row from its ``first`` on, and what amends it. turn: +1 or -1, the light's way
    along the row; beside: whether it goes from node to node there."""
    p = line + first
    passing = without_first(step) if beside else step
    rest = count % LANES
    for s in range(0, count - LANES + 1, LANES):
        _pass_some(p + s, at + s, None, ext, e, step, passing, own, out, about)
    if rest:
        _pass_some(p + count - rest, at + count - rest, rest, ext, e, step, passing, own, out, about)
    if beside:
        share, i = step[0][0], 0 if turn > 0 else count - 1
        light = np.float64(out[p + i + step[1][0]])
        for _ in range(count):
            light = out[p + i] + share * own[0, at + i] * light
            out[p + i] = light
            i += turn
    for s in range(0, count - LANES + 1, LANES):
        _tell_some(p + s, at + s, first + s, None, ext, e, step, own, out, amended, told_row, about)
    if rest:
        s = count - rest
        _tell_some(p + s, at + s, first + s, rest, ext, e, step, own, out, amended, told_row, about)
    one, two = pairs_of(step)
    if one[2] == 0:
        _tell_corners(p, first, count, step, told_row, amended)
    else:
        nx, to, begin = told_row.shape[0] - 2 * LANES, step[1], np.int64(0)
        _tell_upstream(line + to[0], begin, nx, one, told_row, amended)
        if two[0] + two[1] > 0.0:
            _tell_upstream(line + to[2], begin, nx, two, told_row, amended)


@kernel(CONTRACTED)
def carry(t, threads, grid, directions, ext, steps, sources, light, more, about):
    """light (b, nodes): radiance of ordinates; ext: scaled extinction, by which `weigh` has made ``steps``. Where there
    are none (0, 4, nodes) they are found row by row.

    more: how much more steps around the nodes take (`cell.amendment`). about: where it is given, both are the changes
    that follow from those of the sources and of the extinction.
    """
    shape, _, _, ground_node = grid
    course = course_of(grid)
    way, entry = course.way, course.entry
    emission, inflow, ground = sources
    kept, scratch, highest = steps.shape[0] > 0, np.zeros((4, shape[2]), ext.dtype), highest_of(ground_node)
    told_row, single = np.zeros(shape[2] + 2 * LANES, ext.dtype), np.int64(1)
    for n in range(t, directions.shape[0], threads):
        q, e, out, amended = directions[n], emission[n], light[n], more[n]
        own = steps[n] if kept else scratch
        of = None if about is None else (about.emission[n], about.light[n], about.d_ext)
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
                            _pass_some(line + i, at + i, single, ext, e, step, step, own, out, of)
                            _tell_some(line + i, at + i, i, single, ext, e, step, own, out, amended, told_row, of)
                            _tell_corners(line + i, i, single, step, told_row, amended)
                elif row:
                    out[line : line + nx] = inflow[n, k]
                else:
                    if entry[2] >= 0:
                        out[line + entry[2]] = inflow[n, k]
                    _carry_row(
                        line, at + first, first, count, turn, beside, ext, e, step, own, out, amended, told_row,
                        of,
                    )  # fmt: skip
