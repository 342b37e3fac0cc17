"""Depth to the sun along rays from every node, how it bends within cells, and the transposes of both.

At the nodes it is linear in what lies on the way, so it is its own tangent linear. A ray has a place on each level, and
more between where it crosses several cells on its way through a layer; between places all is linear. Two fields share
a way: the scaled extinction, and what delta scaling takes off, by which forward peaks broaden.

Between nodes eye rays read the square of a line between roots of the beam, and three numbers of each cell, one an axis,
by which the depth bends besides (F5): from depths and extinctions at its eight corners, which `cell.bend` tells from
what is linear in them; `fast` has the same in `beam.within_cells`, with limits in place of smooth bounds. A cell is
kept at its lowest node; nodes at the upper ends of rows have none.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.beam.within_cells import ASIDE
from openswim.transport.engine.compiled import CONTRACTED, kernel, part
from openswim.transport.engine.threads import in_threads
from openswim.transport.linear.cell import bend, bend_slopes
from openswim.transport.linear.march import corner
from openswim.transport.linear.world import World

F64 = NDArray[np.float64]

TEAMS = 4  # of rows that add to bars of their own, so that sums do not depend on threads


class Geometry(NamedTuple):
    """What kernels are told of a `World`."""

    shape: np.ndarray  # (3,) levels, rows, columns
    sun: np.ndarray  # (ny, nx, 3) toward it, in the columns' axes
    levels_m: np.ndarray
    cell_m: np.ndarray


@part(CONTRACTED, inlined=True)
def _around(k, part, y, x, ds, shape, first, node, length):
    """Fill nodes, from ``first`` on, and shares of a length around a place ``part`` of the way from level k up; the
    first that is left."""
    j, i = min(int(y), max(shape[1] - 2, 0)), min(int(x), max(shape[2] - 2, 0))
    b, a = min(max(y - j, 0.0), 1.0), min(max(x - i, 0.0), 1.0)
    right, back = (1 if shape[2] > 1 else 0), (shape[2] if shape[1] > 1 else 0)
    here = (k * shape[1] + j) * shape[2] + i
    up = shape[1] * shape[2]
    count = 8 if part > 0.0 else 4
    for n in range(count):
        node[first + n] = here + (n & 1) * right + (n >> 1 & 1) * back + (n >> 2) * up
        w = (a if n & 1 else 1.0 - a) * (b if n >> 1 & 1 else 1.0 - b)
        length[first + n] = ds * (w * ((part if n >> 2 else 1.0 - part) if count == 8 else 1.0))
    return first + count


@kernel(CONTRACTED)
def _way(k, j, i, grid, place):
    """Places of the ray from a node to the sun: (layer, part of it, row, column, length that it stands for); their
    number."""
    sun, shape, levels = grid.sun[j, i], grid.shape, grid.levels_m
    rate_x, rate_y = sun[0] / (sun[2] * grid.cell_m[0]), sun[1] / (sun[2] * grid.cell_m[1])  # cells per height
    most = levels[shape[0] - 1] - levels[k]  # height at which the ray leaves
    for room, rate in ((shape[2] - 1 - i if rate_x > 0 else i, abs(rate_x)),
                       (shape[1] - 1 - j if rate_y > 0 else j, abs(rate_y))):  # fmt: skip
        if rate > 0.0:
            most = min(most, room / rate)
    count, gone, layer = 0, 0.0, k
    place[0, 0], place[0, 1], place[0, 2], place[0, 3], place[0, 4] = k, 0.0, j, i, 0.0
    while layer < shape[0] - 1 and gone < most * (1.0 - 1e-12):
        dz = levels[layer + 1] - levels[layer]
        height = min(dz, most - gone)
        steps = max(1, math.ceil(height * max(abs(rate_x), abs(rate_y)) - 1e-9))
        ds = height / steps / sun[2]
        for m in range(1, steps + 1):
            place[count, 4] += 0.5 * ds
            count += 1
            rise = gone + height * m / steps
            part = height * m / (steps * dz)
            place[count, 0], place[count, 1] = layer, part
            if part > 1.0 - 1e-12:
                place[count, 0], place[count, 1] = layer + 1, 0.0
            place[count, 2], place[count, 3] = j + rate_y * rise, i + rate_x * rise
            place[count, 4] = 0.5 * ds
        gone += height
        layer += 1
    return count + 1


@kernel(CONTRACTED)
def _lengths(k, j, i, grid, place, node, length):
    """Nodes, each once or several times, and the length of the way to the sun that each stands for; their number."""
    count, found = _way(k, j, i, grid, place), np.int64(0)
    for m in range(count):
        found = _around(
            int(place[m, 0]), place[m, 1], place[m, 2], place[m, 3], place[m, 4], grid.shape, found, node, length
        )
    return found


@kernel(CONTRACTED)
def _scratch(shape):
    """Places of a way, and nodes and lengths around them."""
    most = shape[0] * 2 + 2 * (shape[1] + shape[2]) + 8
    return np.empty((most, 5)), np.empty(8 * most, np.int64), np.empty(8 * most)


@kernel(CONTRACTED)
def sun_depth(t, threads, grid, both, out):
    """Depths (nodes, 2) to the sun of two fields per length, both (nodes, 2)."""
    shape = grid.shape
    place, node, length = _scratch(shape)
    for row in range(t, shape[0] * shape[1], threads):
        k, j = row // shape[1], row % shape[1]
        for i in range(shape[2]):
            one, two = 0.0, 0.0
            for n in range(_lengths(k, j, i, grid, place, node, length)):
                one += length[n] * both[node[n], 0]
                two += length[n] * both[node[n], 1]
            out[row * shape[2] + i, 0], out[row * shape[2] + i, 1] = one, two


@kernel(CONTRACTED)
def sun_depth_transposed(t, threads, grid, bar, both_bar):
    """Transpose of `sun_depth`: bar (nodes, 2) added to both_bar (TEAMS, nodes, 2)."""
    shape = grid.shape
    place, node, length = _scratch(shape)
    for team in range(t, both_bar.shape[0], threads):
        own = both_bar[team]
        for row in range(team, shape[0] * shape[1], both_bar.shape[0]):
            k, j = row // shape[1], row % shape[1]
            for i in range(shape[2]):
                one, two = bar[row * shape[2] + i, 0], bar[row * shape[2] + i, 1]
                if one == 0.0 and two == 0.0:
                    continue
                for n in range(_lengths(k, j, i, grid, place, node, length)):
                    own[node[n], 0] += length[n] * one
                    own[node[n], 1] += length[n] * two


@part(CONTRACTED, inlined=True)
def _speed(k, j, i, grid, v):
    """The way to the sun, in cells per metre, into v (3,); its square."""
    v[0], v[1] = grid.sun[j, i, 0] / grid.cell_m[0], grid.sun[j, i, 1] / grid.cell_m[1]
    v[2] = grid.sun[j, i, 2] / (grid.levels_m[k + 1] - grid.levels_m[k])
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]


@part(CONTRACTED, inlined=True)
def _pick(node, shape, depth, ext, t, e):
    """Those of the corners, into t and e (8,); whether there is either."""
    some = 0.0
    for n in range(8):
        at = corner(node, n, shape)
        t[n], e[n] = depth[at], ext[at]
        some += abs(t[n]) + abs(e[n])
    return some > 0.0


@part(CONTRACTED, inlined=True)
def _asked(axis, t, e, v, square):
    """Along an axis of a cell what `cell.bend` takes: (linear, mean, rises)."""
    one, own, mean, rises = 1 << axis, 0.0, 0.0, 0.0
    for n in range(8):
        if n & one:
            continue
        rise = t[n | one] - t[n]
        mean += 0.25 * rise
        rises += rise**4
        own += 0.25 * (e[n | one] - e[n])
        for other in range(3):
            if other != axis:  # the mean of both mixed differences
                own += 0.5 * v[other] * (rise if n & (1 << other) else -rise)
    return own * v[axis] / (2.0 * (v[axis] * v[axis] + ASIDE * square)), mean, rises


@kernel(CONTRACTED)
def _bends(t, threads, grid, depth, ext, out):
    """out (nodes, 3) from depths and extinctions (nodes,)."""
    shape = grid.shape
    taus, betas, v = np.empty(8), np.empty(8), np.empty(3)
    for row in range(t, (shape[0] - 1) * (shape[1] - 1), threads):
        k, j = row // (shape[1] - 1), row % (shape[1] - 1)
        for i in range(shape[2] - 1):
            node = (k * shape[1] + j) * shape[2] + i
            if _pick(node, shape, depth, ext, taus, betas):
                square = _speed(k, j, i, grid, v)
                for axis in range(3):
                    linear, mean, rises = _asked(axis, taus, betas, v, square)
                    out[node, axis] = bend(linear, mean, rises)


@kernel(CONTRACTED)
def _bends_tangent(t, threads, grid, depth, ext, d_depth, d_ext, out):
    shape = grid.shape
    taus, betas, d_taus, d_betas, v = np.empty(8), np.empty(8), np.empty(8), np.empty(8), np.empty(3)
    for row in range(t, (shape[0] - 1) * (shape[1] - 1), threads):
        k, j = row // (shape[1] - 1), row % (shape[1] - 1)
        for i in range(shape[2] - 1):
            node = (k * shape[1] + j) * shape[2] + i
            if _pick(node, shape, d_depth, d_ext, d_taus, d_betas):
                _pick(node, shape, depth, ext, taus, betas)
                square = _speed(k, j, i, grid, v)
                for axis in range(3):
                    linear, mean, rises = _asked(axis, taus, betas, v, square)
                    d_linear, d_mean, _ = _asked(axis, d_taus, d_betas, v, square)
                    d_rises, one = 0.0, 1 << axis
                    for n in range(8):
                        if not n & one:
                            d_rises += 4.0 * (taus[n | one] - taus[n]) ** 3 * (d_taus[n | one] - d_taus[n])
                    by_linear, by_mean, by_rises = bend_slopes(linear, mean, rises)
                    out[node, axis] = by_linear * d_linear + by_mean * d_mean + by_rises * d_rises


@kernel(CONTRACTED)
def _bends_transposed(t, threads, grid, depth, ext, bar, odd, depth_bar, ext_bar):
    """Added to bars (nodes,), by every other layer of cells: those between two of them share nodes with both."""
    shape = grid.shape
    taus, betas, v = np.empty(8), np.empty(8), np.empty(3)
    for k in range(2 * t + odd, shape[0] - 1, 2 * threads):
        for j in range(shape[1] - 1):
            for i in range(shape[2] - 1):
                node = (k * shape[1] + j) * shape[2] + i
                if bar[node, 0] == 0.0 and bar[node, 1] == 0.0 and bar[node, 2] == 0.0:
                    continue
                _pick(node, shape, depth, ext, taus, betas)
                square = _speed(k, j, i, grid, v)
                for axis in range(3):
                    linear, mean, rises = _asked(axis, taus, betas, v, square)
                    by_linear, by_mean, by_rises = bend_slopes(linear, mean, rises)
                    own_bar = bar[node, axis] * by_linear * v[axis]
                    own_bar /= 2.0 * (v[axis] * v[axis] + ASIDE * square)
                    one = 1 << axis
                    for n in range(8):
                        if n & one:
                            continue
                        rise_bar = 4.0 * (taus[n | one] - taus[n]) ** 3 * by_rises + 0.25 * by_mean
                        rise_bar *= bar[node, axis]
                        for other in range(3):
                            if other != axis:
                                rise_bar += 0.5 * v[other] * (own_bar if n & (1 << other) else -own_bar)
                        low, high = corner(node, n, shape), corner(node, n | one, shape)
                        depth_bar[high] += rise_bar
                        depth_bar[low] -= rise_bar
                        ext_bar[high] += 0.25 * own_bar
                        ext_bar[low] -= 0.25 * own_bar


def depths(world: World, both: F64) -> F64:
    """`sun_depth` of a world."""
    out = np.empty_like(both)
    in_threads(sun_depth, geometry(world), both, out)
    return out


def depths_transposed(world: World, bar: F64) -> F64:
    """Its transpose: bars (nodes, 2) of both fields."""
    by_team = np.zeros((TEAMS, *bar.shape))
    in_threads(sun_depth_transposed, geometry(world), bar, by_team, parts=TEAMS)
    return summed(by_team)


def summed(by_team: F64) -> F64:
    """What teams have added up, in their order."""
    out = by_team[0].copy()
    for one in by_team[1:]:
        out += one
    return out


def geometry(world: World) -> Geometry:
    """Of a world, its numbers as kernels take them."""
    return Geometry(np.array(world.shape, np.int64), world.local_sun, world.levels_m, np.array(world.cell_m, float))


def bends(world: World, depth: F64, ext: F64) -> F64:
    """By how much the depth bends along x, y, z of each cell (nodes, 3), of depths to the sun and the extinctions
    (nodes,), 1/m, that they come from."""
    out = np.zeros((world.nodes, 3))
    in_threads(_bends, geometry(world), depth, ext, out)
    return out


def bends_tangent(world: World, depth: F64, ext: F64, d_depth: F64, d_ext: F64) -> F64:
    """Change of `bends`."""
    out = np.zeros((world.nodes, 3))
    in_threads(_bends_tangent, geometry(world), depth, ext, d_depth, d_ext, out)
    return out


def bends_transposed(world: World, depth: F64, ext: F64, bar: F64) -> tuple[F64, F64]:
    """Bars (nodes,) of depth and extinction."""
    depth_bar, ext_bar = np.zeros(world.nodes), np.zeros(world.nodes)
    for odd in (0, 1):
        in_threads(_bends_transposed, geometry(world), depth, ext, bar, odd, depth_bar, ext_bar)
    return depth_bar, ext_bar
