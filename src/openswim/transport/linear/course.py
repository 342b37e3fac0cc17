"""How an ordinate goes through a grid: where the light of each node comes from, and in which order nodes are reached.

A grid is (nz, ny, nx); an ordinate (x, y, z) points to where its light comes from. Upstream of a node lies the point
where the ordinate leaves the cell, between the four nodes of that face (short characteristics, F8). `upstream` says all
that there is to know of an ordinate. What rows of nodes have of the points upstream is read eight nodes at once
(`engine.lanes`).
"""

from typing import NamedTuple

import numpy as np

from openswim.transport.engine.compiled import CONTRACTED, kernel, part
from openswim.transport.engine.lanes import read, write

# What calls hand to these as np.int64(0) or np.bool_(True): a literal is a type of its own, for which Numba would
# compile them, and all that they call, once more.


class Grid(NamedTuple):
    """What ordinates go through."""

    shape: np.ndarray  # (3,) levels, rows, columns
    levels: np.ndarray  # (nz,) heights, m
    cell: np.ndarray  # (2,) m, along x and y
    ground_node: np.ndarray  # (ny, nx) the level on which the ground lies


class Course(NamedTuple):
    """Scratch: how an ordinate goes through the grid."""

    way: np.ndarray  # (3, 3) first, end and step of the loops over levels, rows and columns
    entry: np.ndarray  # (3,) the level, row and column on which light enters from outside; where none does: -1
    offset: np.ndarray  # (nz, 4) flat, from a node to its upstream corners,
    weight: np.ndarray  # (nz, 4) and their weights
    length: np.ndarray  # (nz,) of the steps


@kernel(CONTRACTED)
def course_of(grid):
    """`Course` of any ordinate, to be filled by `set_out`."""
    nz = grid.shape[0]
    offset, weight, length = np.empty((nz, 4), np.int64), np.empty((nz, 4)), np.empty(nz)
    return Course(np.empty((3, 3), np.int64), np.empty(3, np.int64), offset, weight, length)


@kernel(CONTRACTED)
def set_out(q, grid, course, against):
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


@kernel(CONTRACTED)
def upstream(q, grid, offset, weight, length):
    """Of each level the flat offsets and weights (nz, 4) of the upstream corners, and the steps' lengths (nz,).

    A corner in the same row as the node is the first. Where there are fewer than four, it stands for those that lack,
    with no weight: light is known there, while at the node itself it is not yet.
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
            weight[k, m], offset[k, m] = 0.0, offset[k, 0]


@part(CONTRACTED, inlined=True)
def step_of(course, k):
    """Of a level's steps: shares of and offsets to their upstream corners, and their length; whether the first corner
    lies in the node's own row."""
    _, _, offset, weight, length = course
    share = (weight[k, 0], weight[k, 1], weight[k, 2], weight[k, 3])
    to = (offset[k, 0], offset[k, 1], offset[k, 2], offset[k, 3])
    return (share, to, length[k]), abs(to[0]) == 1


@part(CONTRACTED, inlined=True)
def without_first(step):
    share, to, ds = step
    return (0.0, share[1], share[2], share[3]), to, ds


@part(CONTRACTED, inlined=True)
def between(field, p, step, some):
    """A field at the points upstream of nodes from p on."""
    share, to, _ = step
    a, b = share[0] * read(field, p + to[0], some), share[1] * read(field, p + to[1], some)
    c, d = share[2] * read(field, p + to[2], some), share[3] * read(field, p + to[3], some)
    return (a + b) + (c + d)


@part(CONTRACTED, inlined=True)
def add(field, p, more, some):
    write(field, p, read(field, p, some) + more, some)


@part(CONTRACTED, inlined=True)
def pair_at(field, place, some, pair):
    """Of two corners of which the second lies ``apart`` nodes from the first: what comes to where first corners are,
    from a row that begins at LANES and has zeros around it."""
    one, two, apart = pair
    return one * read(field, place, some) + two * read(field, place - apart, some)


@part(CONTRACTED, inlined=True)
def pairs_of(step):
    """Of the upstream corners 0 and 1, and 2 and 3: (both shares, how far apart); where they do not lie side by side in
    a row, 0."""
    share, to, _ = step
    one, two = to[1] - to[0], to[3] - to[2]
    return (share[0], share[1], one if abs(one) == 1 else 0), (share[2], share[3], two if abs(two) == 1 else 0)


@kernel(CONTRACTED)
def within(entry, nx):
    """The first of a row's columns, and how many, that are not where light enters."""
    return (1 if entry[2] == 0 else 0), (nx if entry[2] < 0 else nx - 1)


@kernel(CONTRACTED)
def highest_of(ground_node):
    """Of each row (ny,) the highest level on which its ground lies."""
    out = np.zeros(ground_node.shape[0], np.int64)
    for j in range(ground_node.shape[0]):
        for i in range(ground_node.shape[1]):
            out[j] = max(out[j], ground_node[j, i])
    return out
