"""An ordinate through the grid: value, tangent, transpose, and the sweep that gathers the gradient.

A grid is (nz, ny, nx); an ordinate (x, y, z) points to where its light comes from. Upstream of a node lies the point
where the ordinate leaves the cell, between the four nodes of that face (short characteristics, F8). Nodes on faces by
which light enters have the inflow of their level; nodes on and below the ground have, for light from below, the
ground's radiance. `upstream` says all that there is to know of an ordinate, and the four kernels go through the grid
alike: they differ in nothing but what they do at a node. Fields are rows of nodes, (b, nodes) of b ordinates.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from openswim.transport.linear.cell import amendment, step_slopes, step_weights, trusted

_FLAGS: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "fastmath": {"contract"}}


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
    offset, weight, length = np.empty((nz, 4), np.uint64), np.empty((nz, 4)), np.empty(nz)
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

    Offsets are unsigned, those backward modulo 2^64: the kernels' indices are, which numba then need not look at.
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
                offset[k, n] = np.uint64(a * step_x + b * step_y + d * step_z)
                n += 1
        for m in range(n, 4):
            weight[k, m], offset[k, m] = 0.0, 0


@njit(**_FLAGS)
def _weigh_row(near, a, b, c, d, share, ds, trans, of_near, of_far, amended):
    """A row of steps: what `step_weights` gives, and half of one over `trusted`; a, b, c, d: extinction at the upstream
    corners, whose shares are ``share``."""
    for i in range(near.shape[0]):
        up = share[0] * a[i] + share[1] * b[i] + share[2] * c[i] + share[3] * d[i]
        trans[i], of_near[i], of_far[i] = step_weights(near[i], up, ds)
        amended[i] = 0.5 / trusted(near[i], up, ds)


@njit(**_FLAGS)
def _weigh(p, first, count, ext, offset, share, ds, own, at):
    """Into own[:, at:] what the steps have that end at row p, from its column ``first`` on."""
    s, e = p + first, at + first
    a, b, c, d = (s + np.int64(offset[0]), s + np.int64(offset[1]), s + np.int64(offset[2]), s + np.int64(offset[3]))
    _weigh_row(
        ext[s : s + count], ext[a : a + count], ext[b : b + count], ext[c : c + count], ext[d : d + count], share, ds,
        own[0, e : e + count], own[1, e : e + count], own[2, e : e + count], own[3, e : e + count],
    )  # fmt: skip


@njit(**_FLAGS)
def _within(entry, nx):
    """The first of a row's columns, and how many, that are not where light enters."""
    return (1 if entry[2] == 0 else 0), (nx if entry[2] < 0 else nx - 1)


@njit(**_FLAGS)
def weigh(t, threads, grid, directions, ext, steps):
    """steps (b, 4, nodes): of the step to a node what `step_weights` gives, and half of one over `trusted`; where light
    enters, nothing is told."""
    course = _course_of(grid)
    _, entry, offset, weight, length = course
    nz, ny, nx = grid.shape
    for n in range(t, directions.shape[0], threads):
        _set_out(directions[n], grid, course, False)
        first, count = _within(entry, nx)
        for k in range(nz):
            for j in range(ny):
                if k != entry[0] and j != entry[1]:
                    p = (k * ny + j) * nx
                    _weigh(p, first, count, ext, offset[k], weight[k], length[k], steps[n], p)


@njit(**_FLAGS)
def carry(t, threads, grid, directions, ext, steps, sources, light, mean):
    """light (b, nodes): radiance of ordinates; ext: scaled extinction, by which `weigh` has made ``steps``. Where there
    are none (0, 4, nodes) they are found row by row.

    mean: the same as what is scattered around the nodes has it (`cell.amendment`).
    """
    shape, _, _, ground_node = grid
    course = _course_of(grid)
    way, entry, offset, weight, length = course
    emission, inflow, ground = sources
    kept, scratch = steps.shape[0] > 0, np.empty((4, shape[2]))
    for n in range(t, directions.shape[0], threads):
        q, e, out, amended = directions[n], emission[n], light[n], mean[n]
        own = steps[n] if kept else scratch
        _set_out(q, grid, course, False)
        ny, nx, rising = shape[1], shape[2], q[2] < 0.0
        first, count = _within(entry, nx)
        amended[:] = 0.0
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            ds = length[k]
            w0, w1, w2, w3 = weight[k, 0], weight[k, 1], weight[k, 2], weight[k, 3]
            to0, to1, to2, to3 = offset[k, 0], offset[k, 1], offset[k, 2], offset[k, 3]
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row, line = k == entry[0] or j == entry[1], (k * ny + j) * nx
                if not (kept or row):
                    _weigh(line, first, count, ext, offset[k], weight[k], ds, own, 0)
                for i in range(way[2, 0], way[2, 1], way[2, 2]):
                    p = np.uint64(line + i)
                    if rising and k <= ground_node[j, i]:
                        out[p] = ground[j * nx + i]
                        continue
                    if row or i == entry[2]:
                        out[p] = inflow[n, k]
                        continue
                    at = p if kept else np.uint64(i)
                    a, b, c, d = p + to0, p + to1, p + to2, p + to3
                    up = w0 * out[a] + w1 * out[b] + w2 * out[c] + w3 * out[d]
                    e_up = w0 * e[a] + w1 * e[b] + w2 * e[c] + w3 * e[d]
                    told = w0 * ext[a] * out[a] + w1 * ext[b] * out[b] + w2 * ext[c] * out[c] + w3 * ext[d] * out[d]
                    here = own[0, at] * up + own[1, at] * e[p] + own[2, at] * e_up
                    out[p] = here
                    more = own[3, at] * amendment(here, up, e[p], e_up, ext[p], told, 1.0, ds)
                    amended[p] += more
                    amended[a] += w0 * more
                    amended[b] += w1 * more
                    amended[c] += w2 * more
                    amended[d] += w3 * more
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
                    p = np.uint64((k * ny + j) * nx + i)
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


@njit(**_FLAGS)
def carry_transposed(t, threads, grid, directions, ext, steps, bars):
    """Transpose of `carry` by emission and ground; ``steps`` as there."""
    shape, _, _, ground_node = grid
    course = _course_of(grid)
    way, entry, offset, weight, length = course
    light_bar, mean_bar, emission_bar, ground_bar = bars
    kept, scratch = steps.shape[0] > 0, np.empty((4, shape[2]))
    for n in range(t, directions.shape[0], threads):
        q, lb, mb, eb = directions[n], light_bar[n], mean_bar[n], emission_bar[n]
        own = steps[n] if kept else scratch
        _set_out(q, grid, course, True)
        ny, nx, rising = shape[1], shape[2], q[2] < 0.0
        first, count = _within(entry, nx)
        ground_bar[n] = 0.0
        for node in range(ext.shape[0]):
            eb[node] = 0.0
            lb[node] += mb[node]
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            ds = length[k]
            w0, w1, w2, w3 = weight[k, 0], weight[k, 1], weight[k, 2], weight[k, 3]
            to0, to1, to2, to3 = offset[k, 0], offset[k, 1], offset[k, 2], offset[k, 3]
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row, line = k == entry[0] or j == entry[1], (k * ny + j) * nx
                if not (kept or row):
                    _weigh(line, first, count, ext, offset[k], weight[k], ds, own, 0)
                for i in range(way[2, 0], way[2, 1], way[2, 2]):
                    p = np.uint64(line + i)
                    if rising and k <= ground_node[j, i]:
                        ground_bar[n, j * nx + i] += lb[p]
                        continue
                    if row or i == entry[2]:
                        continue
                    at = p if kept else np.uint64(i)
                    a, b, c, d = p + to0, p + to1, p + to2, p + to3
                    more = mb[p] + w0 * mb[a] + w1 * mb[b] + w2 * mb[c] + w3 * mb[d]
                    more *= own[3, at]
                    trans, near, far = own[0, at], own[1, at], own[2, at]
                    rate = 2.0 / ds
                    bar = lb[p] - (rate + ext[p]) * more
                    eb[p] += near * bar + more
                    to_light, to_source = trans * bar + rate * more, far * bar + more
                    lb[a] += w0 * (to_light - ext[a] * more)
                    lb[b] += w1 * (to_light - ext[b] * more)
                    lb[c] += w2 * (to_light - ext[c] * more)
                    lb[d] += w3 * (to_light - ext[d] * more)
                    eb[a] += w0 * to_source
                    eb[b] += w1 * to_source
                    eb[c] += w2 * to_source
                    eb[d] += w3 * to_source


@njit(**_FLAGS)
def carry_gradient(t, threads, grid, directions, ext, emission, light, bars, ext_bar):
    """`carry_transposed`, and with it ext_bar (b, nodes) by the extinction; light: the radiance itself."""
    shape, _, _, ground_node = grid
    course = _course_of(grid)
    way, entry, offset, weight, length = course
    light_bar, mean_bar, emission_bar, ground_bar = bars
    for n in range(t, directions.shape[0], threads):
        q, e, own, lb, mb, eb, xb = (
            directions[n], emission[n], light[n], light_bar[n], mean_bar[n], emission_bar[n], ext_bar[n],
        )  # fmt: skip
        _set_out(q, grid, course, True)
        ny, nx, rising = shape[1], shape[2], q[2] < 0.0
        ground_bar[n] = 0.0
        for node in range(ext.shape[0]):
            eb[node], xb[node] = 0.0, 0.0
            lb[node] += mb[node]
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            ds = length[k]
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row = k == entry[0] or j == entry[1]
                for i in range(way[2, 0], way[2, 1], way[2, 2]):
                    p = np.uint64((k * ny + j) * nx + i)
                    if rising and k <= ground_node[j, i]:
                        ground_bar[n, j * nx + i] += lb[p]
                        continue
                    if row or i == entry[2]:
                        continue
                    up, ext_up, e_up, told, more = 0.0, 0.0, 0.0, 0.0, mb[p]
                    for c in range(4):
                        w, m = weight[k, c], p + offset[k, c]
                        up += w * own[m]
                        ext_up += w * ext[m]
                        e_up += w * e[m]
                        told += w * ext[m] * own[m]
                        more += w * mb[m]
                    both = trusted(ext[p], ext_up, ds)
                    more *= 0.5 / both
                    a = amendment(own[p], up, e[p], e_up, ext[p], told, both, ds)
                    trans, near, far = step_weights(ext[p], ext_up, ds)
                    t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(ext[p], ext_up, ds)
                    rate = 2.0 / ds
                    bar = lb[p] - (rate + ext[p]) * more
                    eb[p] += near * bar + more
                    xb[p] += (t_n * up + n_n * e[p] + f_n * e_up) * bar - (own[p] + a) * more
                    to_light, to_source = trans * bar + rate * more, far * bar + more
                    to_ext = (t_f * up + n_f * e[p] + f_f * e_up) * bar - a * more
                    for c in range(4):
                        w, m = weight[k, c], p + offset[k, c]
                        lb[m] += w * (to_light - ext[m] * more)
                        eb[m] += w * to_source
                        xb[m] += w * (to_ext - own[m] * more)
