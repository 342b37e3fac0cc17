"""Depth to the sun along rays from every node, and its transpose.

It is linear in what lies on the way, so it is its own tangent linear. A ray has a place on each level, and more between
where it crosses several cells on its way through a layer; between places all is linear. Two fields share a way: the
scaled extinction, and what delta scaling takes off, by which forward peaks broaden.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.engine.threads import in_threads
from openswim.transport.linear.world import World

F64 = NDArray[np.float64]

_FLAGS: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "fastmath": {"contract"}}
TEAMS = 4  # of rows that add to bars of their own, so that sums do not depend on threads


@njit(**_FLAGS, forceinline=True)
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


@njit(**_FLAGS)
def _way(k, j, i, sun, levels, cell, shape, place):
    """Places of the ray from a node to the sun: (layer, part of it, row, column, length that it stands for); their
    number."""
    rate_x, rate_y = sun[0] / (sun[2] * cell[0]), sun[1] / (sun[2] * cell[1])  # cells per height
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


@njit(**_FLAGS)
def _lengths(k, j, i, sun, levels, cell, shape, place, node, length):
    """Nodes, each once or several times, and the length of the way to the sun that each stands for; their number."""
    count, found = _way(k, j, i, sun, levels, cell, shape, place), 0
    for m in range(count):
        found = _around(
            int(place[m, 0]), place[m, 1], place[m, 2], place[m, 3], place[m, 4], shape, found, node, length
        )
    return found


@njit(**_FLAGS)
def _scratch(shape):
    """Places of a way, and nodes and lengths around them."""
    most = shape[0] * 2 + 2 * (shape[1] + shape[2]) + 8
    return np.empty((most, 5)), np.empty(8 * most, np.int64), np.empty(8 * most)


@njit(**_FLAGS)
def sun_depth(t, threads, shape, sun, levels, cell, both, out):
    """Depths (nodes, 2) to the sun of two fields per length, both (nodes, 2); sun (ny, nx, 3) in the columns' axes."""
    place, node, length = _scratch(shape)
    for row in range(t, shape[0] * shape[1], threads):
        k, j = row // shape[1], row % shape[1]
        for i in range(shape[2]):
            one, two = 0.0, 0.0
            for n in range(_lengths(k, j, i, sun[j, i], levels, cell, shape, place, node, length)):
                one += length[n] * both[node[n], 0]
                two += length[n] * both[node[n], 1]
            out[row * shape[2] + i, 0], out[row * shape[2] + i, 1] = one, two


@njit(**_FLAGS)
def sun_depth_transposed(t, threads, shape, sun, levels, cell, bar, both_bar):
    """Transpose of `sun_depth`: bar (nodes, 2) added to both_bar (TEAMS, nodes, 2)."""
    place, node, length = _scratch(shape)
    for team in range(t, both_bar.shape[0], threads):
        own = both_bar[team]
        for row in range(team, shape[0] * shape[1], both_bar.shape[0]):
            k, j = row // shape[1], row % shape[1]
            for i in range(shape[2]):
                one, two = bar[row * shape[2] + i, 0], bar[row * shape[2] + i, 1]
                if one == 0.0 and two == 0.0:
                    continue
                for n in range(_lengths(k, j, i, sun[j, i], levels, cell, shape, place, node, length)):
                    own[node[n], 0] += length[n] * one
                    own[node[n], 1] += length[n] * two


def depths(world: World, both: F64) -> F64:
    """`sun_depth` of a world."""
    out = np.empty_like(both)
    in_threads(sun_depth, *_of(world), both, out)
    return out


def depths_transposed(world: World, bar: F64) -> F64:
    """Its transpose: bars (nodes, 2) of both fields."""
    by_team = np.zeros((TEAMS, *bar.shape))
    in_threads(sun_depth_transposed, *_of(world), bar, by_team, parts=TEAMS)
    return summed(by_team)


def summed(by_team: F64) -> F64:
    """What teams have added up, in their order."""
    out = by_team[0].copy()
    for one in by_team[1:]:
        out += one
    return out


def _of(world: World) -> tuple[Any, ...]:
    return np.array(world.shape, np.int64), world.local_sun, world.levels_m, np.array(world.cell_m, float)
