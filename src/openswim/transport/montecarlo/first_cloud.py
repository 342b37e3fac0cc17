"""How far the rays of a pixel go before any of them can meet cloud, in a flat world."""

from __future__ import annotations

import math

from numba import njit

from openswim.transport.engine.scalar import flat
from openswim.transport.montecarlo.cell_track import cell_at
from openswim.transport.montecarlo.place import FAR, cell_counts, level_below, place

_FLAGS = {"contract", "nsz", "arcp"}
_MOST_STEPS = 10_000
_LEAST_STEP_M = 1.0


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def clear_m(ox, oy, oz, dx, dy, dz, across, along, world):
    """Distance that is clear for rays from all over a parallelogram with these sides (3,) about a point, and whether
    they are clear beyond: up, or down to the ground.

    The box about the parallelogram is moved on as long as the empty cells ahead of its last corner hold it.
    """
    nz = world.levels_m.shape[0] - 1
    cy, cx = cell_counts(world)
    ny, nx = world.terrain_m.shape
    half_x = 0.5 * (abs(across[0]) + abs(along[0])) * abs(world.index_per_x)
    half_y = 0.5 * (abs(across[1]) + abs(along[1])) * abs(world.index_per_y)
    half_z = 0.5 * (abs(across[2]) + abs(along[2]))
    x, y = place(ox, oy, oz, world)
    ux, uy = dx * world.index_per_x, dy * world.index_per_y
    octant = (1 if ux > 0.0 else 0) + (2 if uy > 0.0 else 0) + (4 if dz > 0.0 else 0)
    s = 0.0
    if dz > 0.0:
        s = max((world.cloud_low_m - oz - half_z) / dz, 0.0)
    elif dz < 0.0:
        s = max((world.cloud_high_m - oz + half_z) / dz, 0.0)
    last = FAR if dz >= 0.0 else max((world.low_m - oz + half_z) / dz, s)
    for _ in range(_MOST_STEPS):
        h = oz + s * dz - (half_z if dz > 0.0 else -half_z)
        if h >= world.cloud_high_m if dz > 0.0 else h <= world.cloud_low_m:
            return last, True
        i, gone_x = _last_cell(x + s * ux, half_x, ux, cx, nx == 1, world.periodic)
        j, gone_y = _last_cell(y + s * uy, half_y, uy, cy, ny == 1, world.periodic)
        if gone_x or gone_y:
            return last, True
        k = level_below(h, world)
        _, free = cell_at(i, j, k, octant, world)
        if free == 0:
            return s, False
        t = min(_until(x, half_x, ux, i, free, s, nx == 1), _until(y, half_y, uy, j, free, s, ny == 1))
        if dz > 0.0:
            if k + free < nz:
                t = min(t, (flat(world.levels_m, k + free) - half_z - oz) / dz)
        elif k + 1 >= free:
            edge = flat(world.levels_m, k + 1 - free)
            if dz < 0.0:
                t = min(t, (edge + half_z - oz) / dz)
            elif oz - half_z < edge:
                return s, False
        if t >= FAR:
            return last, True
        if t < s + _LEAST_STEP_M:
            return s, False
        s = t
    return s, False


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _last_cell(x, half, ux, cells, one, periodic):
    """Cell of a box's last corner along an axis, its first one before an open domain; whether it is beyond."""
    if one:
        return 0, False
    i = math.floor(x - half) if ux > 0.0 else math.floor(x + half)
    if periodic:
        return i, False
    if ux > 0.0:
        return max(i, 0), i >= cells
    return min(i, cells - 1), i < 0


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _until(x, half, ux, i, free, s, one):
    """Distance at which a box leaves ``free`` cells ahead of cell i; s if it is too large for them."""
    if one:
        return FAR
    if ux > 0.0:
        return (i + free - half - x) / ux
    if ux < 0.0:
        return (i + 1 - free + half - x) / ux
    return FAR if x - half >= i + 1 - free else s
