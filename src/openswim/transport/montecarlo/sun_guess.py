"""The sun's light on a place of a flat world: guessed from depths at nodes, and by chance put right.

The guess is a control variate: what chance adds has the mean of the guess's error, so that any guess is unbiased.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from openswim.transport.engine.scalar import flat
from openswim.transport.engine.threads import in_threads
from openswim.transport.montecarlo.cell_track import cell_at, depth_to_sun
from openswim.transport.montecarlo.cells import Shade, over_corners
from openswim.transport.montecarlo.phase import exponential, uniform
from openswim.transport.montecarlo.place import cell_counts, in_cell, level_below, place, sizes, wrapped
from openswim.transport.montecarlo.world import World

_FLAGS = {"contract", "nsz", "arcp"}
_MOST_DEPTH = 6.0  # of nodes: between deep and light ones depths would say nothing
_MOST_GROUND = 2  # times the columns of the domain, each way
_LEAST_RISE = 0.02  # of the sun's direction, where beams go around periodic domains
SURE_DEPTH = 4.0  # of a beam: beyond it chance decides
LEAST_DOUBT = 0.05  # of a guess
LEAST_SOURCE = 3.0  # doubtful light, of the path's first collision, that is always put right


def shaded(world: World) -> World:
    """A world with its shade, if rays go from cell to cell there."""
    if world.kind.ndim == 1:
        return world
    nz, ny, nx, ns = world.extinction.shape
    cy, cx = cell_counts(world)
    first, count, beyond = _ground_nodes(world)
    shade = Shade(
        np.zeros((nz, ny, nx, ns), np.float32), np.zeros((cy, cx, nz - 1), np.uint8),
        np.zeros((*count, ns), np.float32), np.zeros((count[0] - 1, count[1] - 1), np.uint8), *first, beyond,
    )  # fmt: skip
    if world.periodic and world.sun[2] < _LEAST_RISE:
        for doubt, depth in ((shade.doubt, shade.depth), (shade.ground_doubt, shade.ground_depth)):
            doubt[:], depth[:] = 255, _MOST_DEPTH
    elif world.sun[2] >= 0.0:
        in_threads(_depths, world, shade)
        _fill_doubts(world, shade)
    return world._replace(shade=shade)


def _ground_nodes(world: World) -> tuple[tuple[int, int], tuple[int, int], float]:
    """First node (y, x) on the ground, how many there are, and the doubt beyond: clouds' shadows lie on them."""
    sizes_yx, per_m = world.terrain_m.shape, (world.index_per_y, world.index_per_x)
    if world.periodic:
        return (0, 0), (sizes_yx[0] + 1, sizes_yx[1] + 1), 1.0
    first, count, beyond = [], [], 0.0
    for n, per, along in zip(sizes_yx, per_m, (world.sun[1], world.sun[0]), strict=True):
        reach = -(world.cloud_high_m - world.low_m) * along / max(world.sun[2], 1e-9) * per
        if abs(reach) > _MOST_GROUND * n:
            reach, beyond = math.copysign(_MOST_GROUND * n, reach), 1.0
        first.append(math.floor(min(reach, 0.0)) - 1)
        count.append(n + 2 + math.ceil(abs(reach)))
    return (first[0], first[1]), (count[0], count[1]), beyond


@njit(cache=True, error_model="numpy", nogil=True)
def _depths(t, threads, world, shade):
    """Fill in the depths of nodes of cells with cloud, and on the ground."""
    nz, ny, nx, ns = shade.depth.shape
    cy, cx = cell_counts(world)
    cz = nz - 1
    per_x = 1.0 / world.index_per_x if world.index_per_x != 0.0 else 0.0
    per_y = 1.0 / world.index_per_y if world.index_per_y != 0.0 else 0.0
    depth, nodes = np.zeros(ns), np.zeros(ns)
    for j in range(t, ny, threads):
        for i in range(nx):
            for k in range(nz):
                near = False
                for corner in range(8):
                    q, p, r = j - (corner & 1), i - (corner >> 1 & 1), k - (corner >> 2)
                    if world.periodic:
                        q, p = q % cy, p % cx
                    if 0 <= q < cy and 0 <= p < cx and 0 <= r < cz:
                        near = near or cell_at(p, q, r, 0, world)[1] == 0
                if near:
                    x, y = (i - world.index_x0) * per_x, (j - world.index_y0) * per_y
                    _bounded_depth(x, y, world.levels_m[k], world, nodes, depth)
                    for n in range(ns):
                        shade.depth[k, j, i, n] = depth[n]
    for j in range(t, shade.ground_depth.shape[0], threads):
        y = (j + shade.first_y - world.index_y0) * per_y
        for i in range(shade.ground_depth.shape[1]):
            x = (i + shade.first_x - world.index_x0) * per_x
            _bounded_depth(x, y, world.low_m, world, nodes, depth)
            for n in range(ns):
                shade.ground_depth[j, i, n] = depth[n]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _bounded_depth(x, y, z, world, nodes, depth):
    """`depth_to_sun` of a node, no deeper than is of use."""
    least = depth_to_sun(x, y, z, _MOST_DEPTH, world, nodes, depth)
    if least > _MOST_DEPTH:
        for n in range(depth.shape[0]):
            depth[n] *= _MOST_DEPTH / least


def _fill_doubts(world: World, shade: Shade) -> None:
    """How far transmissions at the corners of cells lie apart, where that is most of all wavelengths."""
    for relative in world.relative.T.astype(np.float32):
        light = np.exp(-shade.depth @ relative)
        ground = np.exp(-shade.ground_depth @ relative)[None]
        for doubt, values, periodic in ((shade.doubt, light, world.periodic), (shade.ground_doubt, ground, False)):
            most, least = (over_corners(pick, values, periodic) for pick in (np.maximum, np.minimum))
            np.maximum(doubt, np.ceil(255.0 * (most - least)).astype(np.uint8).reshape(doubt.shape), out=doubt)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _guess_in_cloud(x, y, z, world, depth):
    """Depths (ns,) to the sun by those of a cell's corners, and how much they are to be doubted."""
    cy, cx = cell_counts(world)
    cz = world.levels_m.shape[0] - 1
    ix, iy = place(x, y, z, world)
    ix, iy = wrapped(ix, iy, world)
    k = level_below(z, world)
    i, j = min(max(int(ix), 0), cx - 1), min(max(int(iy), 0), cy - 1)
    low = flat(world.levels_m, k)
    g = (z - low) / (flat(world.levels_m, k + 1) - low)
    in_cell(i, j, k, ix - i, iy - j, g, world.shade.depth, world, depth)
    return flat(world.shade.doubt, (j * cx + i) * cz + k) * (1.0 / 255.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _guess_on_ground(x, y, z, world, depth):
    """As `_guess_in_cloud`, on the ground."""
    _, ns = sizes(world, depth)
    my, mx = world.shade.ground_doubt.shape
    ix, iy = place(x, y, z, world)
    ix, iy = wrapped(ix, iy, world)
    ix, iy = ix - world.shade.first_x, iy - world.shade.first_y
    if not (ix >= 0.0 and iy >= 0.0 and ix < mx and iy < my):
        for n in range(ns):
            depth[n] = _MOST_DEPTH if world.shade.beyond > 0.0 else 0.0
        return world.shade.beyond
    i, j = int(ix), int(iy)
    a, b = ix - i, iy - j
    f = world.shade.ground_depth
    here = (j * (mx + 1) + i) * ns
    up = here + (mx + 1) * ns
    for n in range(ns):
        near = flat(f, here + n) + a * (flat(f, here + ns + n) - flat(f, here + n))
        far = flat(f, up + n) + a * (flat(f, up + ns + n) - flat(f, up + n))
        depth[n] = near + b * (far - near)
    return flat(world.shade.ground_doubt, j * mx + i) * (1.0 / 255.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def add_sunlight(x, y, z, on_ground, weight, factor, whole, world, guess, nodes, depth, rng, out):
    """Add the sun's light at a place, times ``weight`` and ``factor`` (nw,), to ``out``. Returns the guess.

    ``whole``: sum of weights at the path's first collision. ``guess`` (nw,), ``nodes``, ``depth`` (ns,): work space.
    """
    nw, ns = sizes(world, guess)
    worth = 0.0
    for w in range(nw):
        worth = max(worth, weight[w] * factor[w])
    if worth <= 0.0 or world.sun[2] < 0.0:
        return 0.0
    doubt = _guess_on_ground(x, y, z, world, depth) if on_ground else _guess_in_cloud(x, y, z, world, depth)
    most = 0.0
    for w in range(nw):
        guess[w] = _transmission(depth, w, ns, nw, world)
        most = max(most, guess[w])
        out[w] += weight[w] * factor[w] * guess[w]
    chance = min(worth * nw * (doubt + LEAST_DOUBT) / (LEAST_SOURCE * whole), 1.0)
    if uniform(rng) >= chance:
        return most
    deepest = SURE_DEPTH + exponential(rng)
    least = depth_to_sun(x, y, z, deepest, world, nodes, depth)
    lit = 0.0
    if least <= deepest:
        lit = math.exp(least - SURE_DEPTH) if least > SURE_DEPTH else 1.0
    for w in range(nw):
        light = lit * _transmission(depth, w, ns, nw, world) if lit > 0.0 else 0.0
        out[w] += weight[w] * factor[w] * (light - guess[w]) / chance
    return most


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _transmission(depth, w, ns, nw, world):
    total = 0.0
    for n in range(ns):
        total += depth[n] * flat(world.relative, n * nw + w)
    return math.exp(-total)
