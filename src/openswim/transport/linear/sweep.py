"""An ordinate through the grid: value, tangent, transpose, and the sweep that gathers the gradient.

A grid is (nz, ny, nx); an ordinate (x, y, z) points to where its light comes from. Upstream of a node lies the point
where the ordinate leaves the cell, between the four nodes of that face (short characteristics, F8). Nodes on faces by
which light enters have the inflow of their level; nodes on and below the ground have, for light from below, the
ground's radiance. `upstream` says all that there is to know of an ordinate, and the four kernels go through the grid
alike: they differ in nothing but what they do at a node. Fields are rows of nodes, (b, nodes) of b ordinates.

Eight nodes of a row are gone through at once (`lanes`). Where an ordinate leaves its cells by the face between two
nodes of a row, light goes from node to node there: what is left of that of the node before is added by itself.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from openswim.transport.engine.lanes import LANES, read, write
from openswim.transport.linear.cell import amendment, step_slopes, step_weights, trusted

_FLAGS: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "fastmath": {"contract"}}
_PART: dict[str, Any] = {**_FLAGS, "_nrt": False, "forceinline": True}  # of a kernel: nothing counts its arrays
_ROW: dict[str, Any] = {**_FLAGS, "_nrt": False}


class Grid(NamedTuple):
    """What ordinates go through."""

    shape: np.ndarray  # (3,) levels, rows, columns
    levels: np.ndarray  # (nz,) heights, m
    cell: np.ndarray  # (2,) m, along x and y
    ground_node: np.ndarray  # (ny, nx) the level on which the ground lies


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


class Bars(NamedTuple):
    """Of what `carry` makes, light (b, nodes), used up, and mean (b, nodes); and, filled from them, of what it is
    given: emission (b, nodes) and ground (b, columns)."""

    light: np.ndarray
    mean: np.ndarray
    emission: np.ndarray
    ground: np.ndarray


class Lit(NamedTuple):
    """Of `carry` what it was given and made, (b, nodes), and bars of the extinction (b, nodes), to be filled."""

    emission: np.ndarray
    light: np.ndarray
    ext_bar: np.ndarray


class Course(NamedTuple):
    """Scratch: how an ordinate goes through the grid."""

    way: np.ndarray  # (3, 3) first, end and step of the loops over levels, rows and columns
    entry: np.ndarray  # (3,) the level, row and column on which light enters from outside; where none does: -1
    offset: np.ndarray  # (nz, 4) flat, from a node to its upstream corners,
    weight: np.ndarray  # (nz, 4) and their weights
    length: np.ndarray  # (nz,) of the steps


@njit(**_FLAGS)
def _course_of(grid):
    """`Course` of any ordinate, to be filled by `_set_out`."""
    nz = grid.shape[0]
    offset, weight, length = np.empty((nz, 4), np.int64), np.empty((nz, 4)), np.empty(nz)
    return Course(np.empty((3, 3), np.int64), np.empty(3, np.int64), offset, weight, length)


@njit(**_FLAGS)
def _set_out(q, grid, course, against):
    """Fill a `Course`: downstream, or ``against`` the light."""
    upstream(q, grid, course.offset, course.weight, course.length)
    for a in range(3):
        last = grid.shape[a] - 1
        begin = 0 if q[2 - a] <= 0 else last
        course.entry[a] = begin if q[2 - a] != 0.0 else -1
        forward = (begin == 0) != against
        course.way[a, 0] = 0 if forward else last
        course.way[a, 1] = last + 1 if forward else -1
        course.way[a, 2] = 1 if forward else -1


@njit(**_FLAGS)
def upstream(q, grid, offset, weight, length):
    """Of each level the flat offsets and weights (nz, 4) of the upstream corners, and the steps' lengths (nz,).

    A corner in the same row as the node is the first.
    """
    shape, levels, cell, _ = grid
    nx, plane = shape[2], shape[1] * shape[2]
    up = 1 if q[2] > 0 else -1
    for k in range(shape[0]):
        other = min(max(k + up, 0), shape[0] - 1)
        dz = abs(levels[other] - levels[k]) if other != k else 1.0  # where light enters, no step is taken
        rate_x, rate_y, rate_z = abs(q[0]) / cell[0], abs(q[1]) / cell[1], abs(q[2]) / dz
        ds = 1.0 / max(rate_x, rate_y, rate_z)
        x, y, z = min(rate_x * ds, 1.0), min(rate_y * ds, 1.0), min(rate_z * ds, 1.0)
        step_x, step_y, step_z = (1 if q[0] > 0 else -1), (nx if q[1] > 0 else -nx), (plane if q[2] > 0 else -plane)
        length[k] = ds
        n = 0
        for c in range(8):
            a, b, d = c & 1, c >> 1 & 1, c >> 2
            w = (x if a else 1.0 - x) * (y if b else 1.0 - y) * (z if d else 1.0 - z)
            if w > 1e-12 and n < 4:
                weight[k, n] = w
                offset[k, n] = a * step_x + b * step_y + d * step_z
                n += 1
        for m in range(n, 4):
            weight[k, m], offset[k, m] = 0.0, 0


@njit(**_PART)
def _step(course, k):
    """Of a level's steps: shares of and offsets to their upstream corners, and their length; whether the first corner
    lies in the node's own row."""
    _, _, offset, weight, length = course
    share = (weight[k, 0], weight[k, 1], weight[k, 2], weight[k, 3])
    to = (offset[k, 0], offset[k, 1], offset[k, 2], offset[k, 3])
    return (share, to, length[k]), abs(to[0]) == 1


@njit(**_PART)
def _without_first(step):
    share, to, ds = step
    return (0.0, share[1], share[2], share[3]), to, ds


@njit(**_PART)
def _between(field, p, step, some):
    """A field at the points upstream of nodes from p on."""
    share, to, _ = step
    a, b = share[0] * read(field, p + to[0], some), share[1] * read(field, p + to[1], some)
    c, d = share[2] * read(field, p + to[2], some), share[3] * read(field, p + to[3], some)
    return (a + b) + (c + d)


@njit(**_PART)
def _add(field, p, more, some):
    write(field, p, read(field, p, some) + more, some)


@njit(**_PART)
def _pair(field, place, some, pair):
    """Of two corners of which the second lies ``apart`` nodes from the first: what comes to where first corners are,
    from a row that begins at LANES and has zeros around it."""
    one, two, apart = pair
    return one * read(field, place, some) + two * read(field, place - apart, some)


@njit(**_PART)
def _pairs(step):
    """Of the upstream corners 0 and 1, and 2 and 3: (both shares, how far apart); where they do not lie side by side in
    a row, 0."""
    share, to, _ = step
    one, two = to[1] - to[0], to[3] - to[2]
    return (share[0], share[1], one if abs(one) == 1 else 0), (share[2], share[3], two if abs(two) == 1 else 0)


@njit(**_FLAGS)
def _within(entry, nx):
    """The first of a row's columns, and how many, that are not where light enters."""
    return (1 if entry[2] == 0 else 0), (nx if entry[2] < 0 else nx - 1)


@njit(**_FLAGS)
def _highest(ground_node):
    """Of each row (ny,) the highest level on which its ground lies."""
    out = np.zeros(ground_node.shape[0], np.int64)
    for j in range(ground_node.shape[0]):
        for i in range(ground_node.shape[1]):
            out[j] = max(out[j], ground_node[j, i])
    return out


@njit(**_PART)
def _weigh_some(p, at, some, ext, step, own):
    near, up, width = read(ext, p, some), _between(ext, p, step, some), own.shape[1]
    trans, of_near, of_far = step_weights(near, up, step[2])
    write(own, at, trans, some)
    write(own, width + at, of_near, some)
    write(own, 2 * width + at, of_far, some)
    write(own, 3 * width + at, 0.5 / trusted(near, up, step[2]), some)


@njit(**_ROW)
def _weigh(p, at, count, ext, step, own):
    """Into own[:, at:] what the steps to ``count`` nodes from p on have: what `step_weights` gives, and half of one
    over `trusted`."""
    for s in range(0, count - LANES + 1, LANES):
        _weigh_some(p + s, at + s, None, ext, step, own)
    s = count % LANES
    if s:
        _weigh_some(p + count - s, at + count - s, s, ext, step, own)


@njit(**_FLAGS)
def weigh(t, threads, grid, directions, ext, steps):
    """steps (b, 4, nodes) as `_weigh` makes them; where light enters, nothing is told."""
    course = _course_of(grid)
    entry = course.entry
    nz, ny, nx = grid.shape
    for n in range(t, directions.shape[0], threads):
        _set_out(directions[n], grid, course, False)
        first, count = _within(entry, nx)
        for k in range(nz):
            step, _ = _step(course, k)
            for j in range(ny):
                if k != entry[0] and j != entry[1]:
                    p = (k * ny + j) * nx + first
                    _weigh(p, p, count, ext, step, steps[n])


@njit(**_PART)
def _pass_some(p, at, some, e, step, passing, own, out):
    width = own.shape[1]
    here = read(own, at, some) * _between(out, p, passing, some) + read(own, width + at, some) * read(e, p, some)
    write(out, p, here + read(own, 2 * width + at, some) * _between(e, p, step, some), some)


@njit(**_PART)
def _tell_some(p, at, i, some, ext, e, step, own, out, amended, told_row):
    share, to, ds = step
    a, b, c, d = (
        share[0] * read(out, p + to[0], some), share[1] * read(out, p + to[1], some),
        share[2] * read(out, p + to[2], some), share[3] * read(out, p + to[3], some),
    )  # fmt: skip
    told = read(ext, p + to[0], some) * a + read(ext, p + to[1], some) * b
    told += read(ext, p + to[2], some) * c + read(ext, p + to[3], some) * d
    more = amendment(
        read(out, p, some), (a + b) + (c + d), read(e, p, some), _between(e, p, step, some), read(ext, p, some), told,
        1.0, ds,
    )  # fmt: skip
    more = more * read(own, 3 * own.shape[1] + at, some)
    _add(amended, p, more, some)
    write(told_row, LANES + i, more, some)


@njit(**_ROW)
def _tell_upstream(q, i, count, pair, told_row, amended):
    """What a row of steps tells to those of its corners that lie from q on."""
    for s in range(0, count - LANES + 1, LANES):
        _add(amended, q + s, _pair(told_row, LANES + i + s, None, pair), None)
    s = count % LANES
    if s:
        _add(amended, q + count - s, _pair(told_row, LANES + i + count - s, s, pair), s)


@njit(**_ROW)
def _tell_corners(p, i, count, step, told_row, amended):
    share, to, _ = step
    for c in range(4):
        _tell_upstream(p + to[c], i, count, (share[c], 0.0, 0), told_row, amended)


@njit(**_ROW)
def _carry_row(line, at, first, count, turn, beside, ext, e, step, own, out, amended, told_row):
    """Light at ``count`` nodes of a row from its ``first`` on, and what amends it. turn: +1 or -1, the light's way
    along the row; beside: whether it goes from node to node there."""
    p = line + first
    passing = _without_first(step) if beside else step
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
    one, two = _pairs(step)
    if one[2] == 0:
        _tell_corners(p, first, count, step, told_row, amended)
    else:
        nx, to = told_row.shape[0] - 2 * LANES, step[1]
        _tell_upstream(line + to[0], 0, nx, one, told_row, amended)
        if two[0] + two[1] > 0.0:
            _tell_upstream(line + to[2], 0, nx, two, told_row, amended)


@njit(**_FLAGS)
def carry(t, threads, grid, directions, ext, steps, sources, light, mean):
    """light (b, nodes): radiance of ordinates; ext: scaled extinction, by which `weigh` has made ``steps``. Where there
    are none (0, 4, nodes) they are found row by row.

    mean: the same as what is scattered around the nodes has it (`cell.amendment`).
    """
    shape, _, _, ground_node = grid
    course = _course_of(grid)
    way, entry = course.way, course.entry
    emission, inflow, ground = sources
    kept, scratch, highest = steps.shape[0] > 0, np.zeros((4, shape[2]), ext.dtype), _highest(ground_node)
    told_row = np.zeros(shape[2] + 2 * LANES, ext.dtype)
    for n in range(t, directions.shape[0], threads):
        q, e, out, amended = directions[n], emission[n], light[n], mean[n]
        own = steps[n] if kept else scratch
        _set_out(q, grid, course, False)
        ny, nx, rising, turn = shape[1], shape[2], q[2] < 0.0, way[2, 2]
        first, count = _within(entry, nx)
        amended[:] = 0.0
        told_row[:] = 0.0
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            step, beside = _step(course, k)
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row, line = k == entry[0] or j == entry[1], (k * ny + j) * nx
                at = line if kept else 0
                if not (kept or row):
                    _weigh(line + first, first, count, ext, step, own)
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
        for node in range(ext.shape[0]):
            amended[node] += out[node]


@njit(**_FLAGS)
def carry_tangent(t, threads, grid, directions, ext, sources, changes, light, d_light, d_mean):
    """`carry`, and the `Changes` of its light and mean."""
    shape, _, _, ground_node = grid
    course = _course_of(grid)
    way, entry, offset, weight, length = course
    emission, inflow, ground = sources
    d_ext, d_emission, d_ground = changes
    for n in range(t, directions.shape[0], threads):
        q, e, de, out, d_out, amended = directions[n], emission[n], d_emission[n], light[n], d_light[n], d_mean[n]
        _set_out(q, grid, course, False)
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
        for node in range(ext.shape[0]):
            amended[node] += d_out[node]


@njit(**_PART)
def _ask_some(p, at, i, some, ext, step, own, mb, rows):
    """What the amendments of steps are asked for, over what they are divided by."""
    more = read(mb, p, some) + _between(mb, p, step, some)
    write(rows[0], LANES + i, more * read(own, 3 * own.shape[1] + at, some), some)


@njit(**_PART)
def _first_some(p, at, i, some, ext, step, own, rows):
    """What amendments ask of the light at first corners, directly and by that at the nodes."""
    share, to, ds = step
    rate = 2.0 / ds
    by_node = read(own, at, some) * (rate + read(ext, p, some))
    more = share[0] * read(rows[0], LANES + i, some)
    write(rows[3], LANES + i, more * (rate - by_node - read(ext, p + to[0], some)), some)


@njit(**_PART)
def _back_some(p, at, i, some, ext, step, own, bars, rows, of):
    """From the bars of light at nodes those of their sources and, where ``of`` is given, of their extinction; into
    ``rows`` what comes to corners by their light, sources and extinction."""
    share, to, ds = step
    lb, _, eb = bars
    asked, to_light, to_source, to_ext = rows
    width, rate, place = own.shape[1], 2.0 / ds, LANES + i
    more, near = read(asked, place, some), read(ext, p, some)
    bar = read(lb, p, some) - (rate + near) * more
    _add(eb, p, read(own, width + at, some) * bar + more, some)
    write(to_source, place, read(own, 2 * width + at, some) * bar + more, some)
    write(to_light, place, read(own, at, some) * bar + rate * more, some)
    if of is None:
        return
    e, out, xb = of
    a, b, c, d = (
        read(out, p + to[0], some), read(out, p + to[1], some), read(out, p + to[2], some), read(out, p + to[3], some),
    )  # fmt: skip
    x0, x1, x2, x3 = (
        share[0] * read(ext, p + to[0], some), share[1] * read(ext, p + to[1], some),
        share[2] * read(ext, p + to[2], some), share[3] * read(ext, p + to[3], some),
    )  # fmt: skip
    up, far = (share[0] * a + share[1] * b) + (share[2] * c + share[3] * d), (x0 + x1) + (x2 + x3)
    here, source, e_up = read(out, p, some), read(e, p, some), _between(e, p, step, some)
    told = (x0 * a + x1 * b) + (x2 * c + x3 * d)
    taken = amendment(here, up, source, e_up, near, told, trusted(near, far, ds), ds)
    t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(near, far, ds)
    _add(xb, p, (t_n * up + n_n * source + f_n * e_up) * bar - (here + taken) * more, some)
    write(to_ext, place, (t_f * up + n_f * source + f_f * e_up) * bar - taken * more, some)


@njit(**_PART)
def _give_some(q, i, some, ext, pair, with_light, bars, rows, of):
    """What comes to corners from q on of a row of steps."""
    lb, _, eb = bars
    asked, to_light, to_source, to_ext = rows
    place = LANES + i
    more = _pair(asked, place, some, pair)
    _add(eb, q, _pair(to_source, place, some, pair), some)
    if with_light:
        _add(lb, q, _pair(to_light, place, some, pair) - read(ext, q, some) * more, some)
    if of is not None:
        _, out, xb = of
        _add(xb, q, _pair(to_ext, place, some, pair) - read(out, q, some) * more, some)


@njit(**_ROW)
def _give(q, i, count, ext, pair, with_light, bars, rows, of):
    for s in range(0, count - LANES + 1, LANES):
        _give_some(q + s, i + s, None, ext, pair, with_light, bars, rows, of)
    s = count % LANES
    if s:
        _give_some(q + count - s, i + count - s, s, ext, pair, with_light, bars, rows, of)


@njit(**_ROW)
def _give_corners(p, i, count, beside, ext, step, bars, rows, of):
    share, to, _ = step
    for c in range(4):
        if share[c] > 0.0:
            _give(p + to[c], i, count, ext, (share[c], 0.0, 0), not beside or c > 0, bars, rows, of)


@njit(**_ROW)
def _back_row(line, at, first, count, turn, beside, ext, step, own, bars, rows, of):
    """Transpose of `_carry_row`; turn: against the light."""
    p, rest = line + first, count % LANES
    for s in range(0, count - LANES + 1, LANES):
        _ask_some(p + s, at + s, first + s, None, ext, step, own, bars[1], rows)
        if beside:
            _first_some(p + s, at + s, first + s, None, ext, step, own, rows)
    if rest:
        s = count - rest
        _ask_some(p + s, at + s, first + s, rest, ext, step, own, bars[1], rows)
        if beside:
            _first_some(p + s, at + s, first + s, rest, ext, step, own, rows)
    if beside:
        lb, share, to, s = bars[0], step[0][0], step[1][0], 0 if turn > 0 else count - 1
        bar, to_first = np.float64(lb[p + s]), rows[3]
        for _ in range(count):
            bar = lb[p + s + to] + (share * own[0, at + s] * bar + to_first[LANES + first + s])
            lb[p + s + to] = bar
            s += turn
    for s in range(0, count - LANES + 1, LANES):
        _back_some(p + s, at + s, first + s, None, ext, step, own, bars, rows, of)
    if rest:
        s = count - rest
        _back_some(p + s, at + s, first + s, rest, ext, step, own, bars, rows, of)
    one, two = _pairs(step)
    if one[2] == 0:
        _give_corners(p, first, count, beside, ext, step, bars, rows, of)
    else:
        nx, to = rows[0].shape[0] - 2 * LANES, step[1]
        _give(line + to[0], 0, nx, ext, one, True, bars, rows, of)
        if two[0] + two[1] > 0.0:
            _give(line + to[2], 0, nx, ext, two, True, bars, rows, of)


@njit(**_FLAGS)
def carry_transposed(t, threads, grid, directions, ext, steps, bars, lit):
    """Transpose of `carry` by emission and ground, and, where ``lit`` is given, by extinction; ``steps`` as there."""
    shape, _, _, ground_node = grid
    course = _course_of(grid)
    way, entry = course.way, course.entry
    light_bar, mean_bar, emission_bar, ground_bar = bars
    scratch_rows = np.zeros((4, shape[2] + 2 * LANES), ext.dtype)
    rows = (scratch_rows[0], scratch_rows[1], scratch_rows[2], scratch_rows[3])
    kept, scratch, highest = steps.shape[0] > 0, np.zeros((4, shape[2]), ext.dtype), _highest(ground_node)
    for n in range(t, directions.shape[0], threads):
        q, lb, mb, eb = directions[n], light_bar[n], mean_bar[n], emission_bar[n]
        own, own_bars = steps[n] if kept else scratch, (lb, mb, eb)
        of = None if lit is None else (lit.emission[n], lit.light[n], lit.ext_bar[n])
        _set_out(q, grid, course, True)
        ny, nx, rising, turn = shape[1], shape[2], q[2] < 0.0, way[2, 2]
        first, count = _within(entry, nx)
        ground_bar[n] = 0.0
        scratch_rows[:] = 0.0
        if lit is not None:
            lit.ext_bar[n] = 0.0
        for node in range(ext.shape[0]):
            eb[node] = 0.0
            lb[node] += mb[node]
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            step, beside = _step(course, k)
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row, line = k == entry[0] or j == entry[1], (k * ny + j) * nx
                at = line if kept else 0
                if not (kept or row):
                    _weigh(line + first, first, count, ext, step, own)
                if rising and k <= highest[j]:
                    for i in range(way[2, 0], way[2, 1], way[2, 2]):
                        if k <= ground_node[j, i]:
                            ground_bar[n, j * nx + i] += lb[line + i]
                        elif not (row or i == entry[2]):
                            _ask_some(line + i, at + i, i, 1, ext, step, own, mb, rows)
                            _back_some(line + i, at + i, i, 1, ext, step, own, own_bars, rows, of)
                            _give_corners(line + i, i, 1, False, ext, step, own_bars, rows, of)
                elif not row:
                    _back_row(line, at + first, first, count, turn, beside, ext, step, own, own_bars, rows, of)
