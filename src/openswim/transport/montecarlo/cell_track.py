"""Photons on their way where the Earth is flat and there is cloud alone: delta tracking from cell to cell.

Each cell has its own majorant, and each empty one knows how many cells ahead, in its ray's octant, are empty too: both
exact, and cheap to follow as a straight ray meets the faces of cells one after another (Amanatides and Woo 1987).
"""

from __future__ import annotations

import math

from numba import njit

from openswim.transport.engine.scalar import flat
from openswim.transport.montecarlo.cells import BLOCK, EMPTY, MIXED
from openswim.transport.montecarlo.phase import exponential
from openswim.transport.montecarlo.place import FAR, cell_counts, in_cell, level_below, place, sizes
from openswim.transport.montecarlo.track import CLOUD, ESCAPED, GROUND, collided, collided_alone

_FLAGS = {"contract", "nsz", "arcp"}
_GAUSS = 0.21132486540518708
_FARTHEST_M = 1e9  # level rays in periodic scenes end somewhere


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _axis(start, per_m, cells, one, periodic):
    """Cells per metre, metres per cell, and where a ray is within the grid along an axis (from, to)."""
    if one:
        return 0.0, FAR, -FAR, FAR
    within = periodic or 0.0 <= start <= cells
    if abs(per_m) < 1e-20:
        return 0.0, FAR, -FAR if within else FAR, FAR
    per = 1.0 / per_m
    if periodic:
        return per_m, per, -FAR, FAR
    to_low, to_high = -start * per, (cells - start) * per
    return per_m, per, min(to_low, to_high), max(to_low, to_high)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _first(x, cells, periodic):
    """Cell of an index; unwrapped in periodic scenes."""
    i = math.floor(x)
    return i if periodic else min(max(i, 0), cells - 1)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _begin(ox, oy, oz, dx, dy, dz, world):
    """Where a ray enters and leaves the part of the grid with cloud, its way through cells, and its first one."""
    ny, nx = world.terrain_m.shape
    cy, cx = cell_counts(world)
    x, y = place(ox, oy, oz, world)
    if nx == 1:
        x = 0.0
    if ny == 1:
        y = 0.0
    ux, px, x_in, x_out = _axis(x, dx * world.index_per_x, cx, nx == 1, world.periodic)
    uy, py, y_in, y_out = _axis(y, dy * world.index_per_y, cy, ny == 1, world.periodic)
    low, high = world.cloud_low_m, world.cloud_high_m
    pz, s, end = -FAR, 0.0, min(x_out, y_out, _FARTHEST_M)  # level rays: the level below is far ahead
    if dz < 0.0:
        pz = 1.0 / dz
        s = max((high - oz) * pz, 0.0)
        end = min(end, (low - oz) * pz)
    elif dz > 0.0:
        pz = 1.0 / dz
        s = max((low - oz) * pz, 0.0)
        end = min(end, (high - oz) * pz)
    elif oz >= high or oz < low:
        end = -1.0
    s = max(s, x_in, y_in)
    i, j = _first(x + s * ux, cx, world.periodic), _first(y + s * uy, cy, world.periodic)
    k = level_below(oz + s * dz, world)
    octant = (1 if px > 0.0 else 0) + (2 if py > 0.0 else 0) + (4 if dz > 0.0 else 0)
    return s, end, x, ux, px, y, uy, py, pz, i, j, k, _face(i, x, px), _face(j, y, py), octant


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _face(i, x, per):
    """Way from a ray's origin, at index x, to where it leaves cell i."""
    return (i + (1 if per > 0.0 else 0) - x) * per


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _wrapped(i, cells, periodic):
    if periodic and (i < 0 or i >= cells):
        return i % cells
    return i


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _after(i, x, forward, free, crossed):
    """Cell of an index x after a jump over ``free`` cells, which ended at their face if ``crossed``."""
    if forward:
        return i + free if crossed else min(max(math.floor(x), i), i + free - 1)
    return i - free if crossed else max(min(math.floor(x), i), i - free + 1)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def cell_at(i, j, k, octant, world):
    """Majorant of a cell, and how many cells ahead of it, itself included, are empty."""
    _, bx, bz, _ = world.cells.ahead.shape
    cy, cx = cell_counts(world)
    j, i = _wrapped(j, cy, world.periodic), _wrapped(i, cx, world.periodic)
    block = ((j // BLOCK) * bx + i // BLOCK) * bz + k // BLOCK
    ahead = int(flat(world.cells.ahead, block * 8 + octant))
    if ahead < MIXED:
        return 0.0, ahead
    within = ((j % BLOCK) * BLOCK + i % BLOCK) * BLOCK + k % BLOCK
    code = int(flat(world.cells.code, block * BLOCK**3 + within))
    if code < EMPTY:
        return flat(world.cells.majorant, code), 0
    return 0.0, max(ahead - MIXED, code - (EMPTY - 1))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _step(s, end, x, ux, px, y, uy, py, z, dz, pz, i, j, k, tx, ty, octant, world):
    """From a cell to the next, over all that are alike: (way there, cell, its faces, majorant of what was crossed)."""
    cy, cx = cell_counts(world)
    nz = world.levels_m.shape[0] - 1
    right, up, rising = px > 0.0, py > 0.0, dz > 0.0
    ahead, aside, above = 1 if right else -1, 1 if up else -1, 1 if rising else -1
    ex, ey = abs(px), abs(py)
    majorant, free = cell_at(i, j, k, octant, world)
    if free <= 1:
        tz = FAR
        if rising or k > 0:
            tz = (flat(world.levels_m, k + 1 if rising else k) - z) * pz
        t = min(min(tx, ty), min(tz, end))
        i += ahead if t == tx else 0
        j += aside if t == ty else 0
        k += above if t == tz else 0
        tx += ex if t == tx else 0.0
        ty += ey if t == ty else 0.0
    else:
        far_x, far_y = tx + (free - 1) * ex, ty + (free - 1) * ey
        tz = FAR
        if rising:
            tz = (flat(world.levels_m, min(k + free, nz)) - z) * pz
        elif k >= free:
            tz = (flat(world.levels_m, k + 1 - free) - z) * pz
        t = min(min(far_x, far_y), min(tz, end))
        i = _after(i, x + t * ux, right, free, t == far_x)
        j = _after(j, y + t * uy, up, free, t == far_y)
        k = k + above * free if t == tz else level_below(z + t * dz, world)
        tx, ty = _face(i, x, px), _face(j, y, py)
    k = min(max(k, 0), nz - 1)
    if not world.periodic:
        i, j = min(max(i, 0), cx - 1), min(max(j, 0), cy - 1)
    return t, i, j, k, tx, ty, majorant


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _onward(s, end, x, ux, px, y, uy, py, z, dz, pz, i, j, k, tx, ty, octant, depth, world):
    """Follow a ray until ``depth`` of the majorants is met: (distance, cell, next faces, majorant); 0 at its end."""
    while s < end:
        t, next_i, next_j, next_k, next_x, next_y, majorant = _step(
            s, end, x, ux, px, y, uy, py, z, dz, pz, i, j, k, tx, ty, octant, world
        )  # fmt: skip
        met = (t - s) * majorant
        if majorant > 0.0 and met >= depth:
            return s + depth / majorant, i, j, k, tx, ty, majorant
        depth -= met
        s, i, j, k, tx, ty = t, next_i, next_j, next_k, next_x, next_y
    return end, i, j, k, tx, ty, 0.0


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _cloud(s, x, ux, y, uy, h, i, j, k, world, nodes):
    """Extinction of the species within a cell, at its faces where rounding puts a point beyond them."""
    cy, cx = cell_counts(world)
    low = flat(world.levels_m, k)
    a, b = x + s * ux - i, y + s * uy - j
    g = (h - low) / (flat(world.levels_m, k + 1) - low)
    return in_cell(
        _wrapped(i, cx, world.periodic), _wrapped(j, cy, world.periodic), k, min(max(a, 0.0), 1.0),
        min(max(b, 0.0), 1.0), min(max(g, 0.0), 1.0), world.extinction, world, nodes,
    )  # fmt: skip


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def depth_to_sun(ox, oy, oz, most, world, nodes, depth):
    """Exact optical depths (ns,) from a point to the sun, at the reference wavelength, into ``depth``.

    Extinction is a cubic along a cell: two points of Gauss-Legendre. Returns the depth where it is least of all
    wavelengths, and gives up when that is above ``most``. ``nodes`` (ns,): work space.
    """
    _, ns = sizes(world, nodes)
    dx, dy, dz = flat(world.sun, 0), flat(world.sun, 1), flat(world.sun, 2)
    for n in range(ns):
        depth[n] = 0.0
    least = 0.0
    s, end, x, ux, px, y, uy, py, pz, i, j, k, tx, ty, octant = _begin(ox, oy, oz, dx, dy, dz, world)
    while s < end and least <= most:
        t, next_i, next_j, next_k, next_x, next_y, majorant = _step(
            s, end, x, ux, px, y, uy, py, oz, dz, pz, i, j, k, tx, ty, octant, world
        )  # fmt: skip
        if majorant > 0.0:
            for point in range(2):
                p = s + (t - s) * (_GAUSS if point == 0 else 1.0 - _GAUSS)
                _cloud(p, x, ux, y, uy, oz + p * dz, i, j, k, world, nodes)
                for n in range(ns):
                    met = 0.5 * (t - s) * nodes[n]
                    depth[n] += met
                    least += met * flat(world.least, n)
        s, i, j, k, tx, ty = t, next_i, next_j, next_k, next_x, next_y
    return least


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def fly_flat(ox, oy, oz, dx, dy, dz, weight, scattered, taken, nodes, world, rng):
    """As `fly`, from the start of a ray, in a world of rank 2 or 3."""
    nw, ns = sizes(world, weight)
    s, end, x, ux, px, y, uy, py, pz, i, j, k, tx, ty, octant = _begin(ox, oy, oz, dx, dy, dz, world)
    while True:
        s, i, j, k, tx, ty, majorant = _onward(
            s, end, x, ux, px, y, uy, py, oz, dz, pz, i, j, k, tx, ty, octant, exponential(rng), world
        )  # fmt: skip
        if majorant == 0.0:
            if dz >= 0.0:
                return ESCAPED, s, world.top_m, -1e9, -1e9
            s = max((world.low_m - oz) * pz, 0.0)
            ix, iy = place(ox + s * dx, oy + s * dy, oz + s * dz, world)
            return GROUND, s, world.low_m, ix, iy
        h = oz + s * dz
        if _cloud(s, x, ux, y, uy, h, i, j, k, world, nodes) <= 0.0:
            continue
        if world.kind.ndim == 3:
            if weight[0] <= 0.0:
                return ESCAPED, s, h, -1e9, -1e9
            here, extinct = nodes[0] * flat(world.scattering, 0), nodes[0] * flat(world.relative, 0)
            if collided_alone(majorant, weight, here, extinct, rng):
                return CLOUD, s, h, -1e9, -1e9
            continue
        total, chance = 0.0, 0.0
        for w in range(nw):
            here, extinct = 0.0, 0.0
            for n in range(ns):
                here += nodes[n] * flat(world.scattering, n * nw + w)
                extinct += nodes[n] * flat(world.relative, n * nw + w)
            scattered[w] = here
            taken[w] = extinct
            total += weight[w]
            chance += weight[w] * here
        if total <= 0.0:
            return ESCAPED, s, h, -1e9, -1e9
        chance = min(chance / (total * majorant), 1.0)
        if collided(chance, majorant, nw, weight, total, scattered, taken, rng):
            return CLOUD, s, h, -1e9, -1e9
