"""Photons on their way where the Earth is flat and there is cloud alone: delta tracking from cell to cell.

Each cell has its own majorant, and each empty one knows how many cells ahead, in its ray's octant, are empty too: both
exact, and cheap to follow as a straight ray meets the faces of cells one after another (Amanatides and Woo 1987).
"""

from __future__ import annotations

import math

from numba import njit

from openswim.transport.montecarlo_phase import exponential
from openswim.transport.montecarlo_place import FAR, in_cell, level_below, place, sizes
from openswim.transport.montecarlo_track import CLOUD, ESCAPED, GROUND, collided, dimmed
from openswim.transport.scalar import flat

_FLAGS = {"contract", "nsz", "arcp"}
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
    """Where a ray enters and leaves the grid (or meets the ground), its way through cells, and its first one."""
    ny, nx = world.terrain_m.shape
    cy, cx, nz = world.cells.shape
    x, y = place(ox, oy, oz, world)
    if nx == 1:
        x = 0.0
    if ny == 1:
        y = 0.0
    ux, px, x_in, x_out = _axis(x, dx * world.index_per_x, cx, nx == 1, world.periodic)
    uy, py, y_in, y_out = _axis(y, dy * world.index_per_y, cy, ny == 1, world.periodic)
    top = flat(world.levels_m, nz)
    pz, s, end = -FAR, 0.0, min(x_out, y_out, _FARTHEST_M)  # level rays: the level below is far ahead
    if dz < 0.0:
        pz = 1.0 / dz
        s = max((top - oz) * pz, 0.0)
        end = min(end, (world.low_m - oz) * pz)
    elif dz > 0.0:
        pz = 1.0 / dz
        end = min(end, (top - oz) * pz)
    elif oz >= top:
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
def _onward(s, end, x, ux, px, y, uy, py, z, dz, pz, i, j, k, tx, ty, octant, depth, world):
    """Follow a ray until ``depth`` of the majorants is met: (distance, cell, next faces, majorant); 0 at its end."""
    cy, cx, nz = world.cells.shape
    beyond = octant * nz * cy * cx
    right, up, rising = px > 0.0, py > 0.0, dz > 0.0
    ahead, aside, above = 1 if right else -1, 1 if up else -1, 1 if rising else -1
    ex, ey = abs(px), abs(py)
    while s < end:
        n = (_wrapped(j, cy, world.periodic) * cx + _wrapped(i, cx, world.periodic)) * nz + k
        free = int(flat(world.free, beyond + n))
        if free <= 1:
            tz = FAR
            if rising or k > 0:
                tz = (flat(world.levels_m, k + 1 if rising else k) - z) * pz
            t = min(min(tx, ty), min(tz, end))
            if free == 0:
                majorant = flat(world.cells, n) * 1.0
                met = (t - s) * majorant
                if met >= depth:
                    return s + depth / majorant, i, j, k, tx, ty, majorant
                depth -= met
            s = t
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
            s = min(min(far_x, far_y), min(tz, end))
            if s >= end:
                break
            i = _after(i, x + s * ux, right, free, s == far_x)
            j = _after(j, y + s * uy, up, free, s == far_y)
            k = k + above * free if s == tz else level_below(z + s * dz, world)
            tx, ty = _face(i, x, px), _face(j, y, py)
        k = min(max(k, 0), nz - 1)
        if not world.periodic:
            i, j = min(max(i, 0), cx - 1), min(max(j, 0), cy - 1)
    return end, i, j, k, tx, ty, 0.0


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _cloud(s, x, ux, y, uy, h, i, j, k, world, nodes):
    """Extinction of the species within a cell, at its faces where rounding puts a point beyond them."""
    cy, cx, _ = world.cells.shape
    low = flat(world.levels_m, k)
    a, b = x + s * ux - i, y + s * uy - j
    g = (h - low) / (flat(world.levels_m, k + 1) - low)
    return in_cell(
        _wrapped(i, cx, world.periodic), _wrapped(j, cy, world.periodic), k, min(max(a, 0.0), 1.0),
        min(max(b, 0.0), 1.0), min(max(g, 0.0), 1.0), world, nodes,
    )  # fmt: skip


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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def sunlight_flat(ox, oy, oz, world, beam, nodes, rng):
    """As `sunlight`, in a world of rank 2 or 3."""
    nw, _ = sizes(world, beam)
    dx, dy, dz = flat(world.sun, 0), flat(world.sun, 1), flat(world.sun, 2)
    for w in range(nw):
        beam[w] = 1.0
    s, end, x, ux, px, y, uy, py, pz, i, j, k, tx, ty, octant = _begin(ox, oy, oz, dx, dy, dz, world)
    left = 1.0
    while True:
        s, i, j, k, tx, ty, majorant = _onward(
            s, end, x, ux, px, y, uy, py, oz, dz, pz, i, j, k, tx, ty, octant, exponential(rng), world
        )  # fmt: skip
        if majorant == 0.0:
            return dz >= 0.0
        if _cloud(s, x, ux, y, uy, oz + s * dz, i, j, k, world, nodes) <= 0.0:
            continue
        left = dimmed(beam, left, majorant, nodes, world, rng)
        if left == 0.0:
            return False
