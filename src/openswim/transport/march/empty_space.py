"""How far the sky is free: of cloud, by cubes of cells ahead, octant by octant; of ground, by its steepness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.types import FLOAT

U32 = NDArray[np.uint32]
Bools = NDArray[np.bool_]

STEEP_CELLS = 8  # as far as the steepness of terrain is looked for
_CUBES = 4  # their edges are 1, 2, 4 and 8 cells
_OCTANTS = np.arange(8)  # +1 toward greater ix, +2 iy, +4 upward
_EVERYWHERE = np.uint8(255)


def occupied(extinction: NDArray, levels_m: NDArray, terrain_m: NDArray) -> Bools:
    """Nodes (nz, ny, nx) with cloud of any species, or so low that the ground is about there."""
    spacing = np.diff(levels_m, append=2 * levels_m[-1] - levels_m[-2])
    low = levels_m[:, None, None] < terrain_m + 1.5 * spacing[:, None, None]
    return np.asarray(low | extinction.any(axis=0))


def beside(found: Bools, periodic: bool) -> Bools:
    """Nodes (nz, ny, nx) that are found, or next to such, corners included."""
    for axis in range(3):
        near = found.copy()
        here, other = np.moveaxis(near, axis, 0), np.moveaxis(found, axis, 0)
        here[1:] |= other[:-1]
        here[:-1] |= other[1:]
        if periodic and axis > 0:
            here[0] |= other[-1]
            here[-1] |= other[0]
        found = near
    return found


def free_cubes(full: Bools, periodic: bool) -> U32:
    """Which cubes of cells are free (nz, ny, nx) ahead of the cell above and beyond each node: byte n for cubes with
    an edge of 2^n cells, this one at their corner, and a bit per octant. What is beyond open sides is free."""
    cells = full
    for axis in range(3):
        cells = cells | _moved(cells, 1, axis, periodic, np.False_)
    mask = np.where(cells, np.uint8(0), _EVERYWHERE)
    out = mask.astype(np.uint32)
    for n in range(1, _CUBES):
        for axis, bit in ((0, 4), (1, 2), (2, 1)):
            forward = np.uint8((1 << _OCTANTS[(_OCTANTS & bit) > 0]).sum())
            ahead = _moved(mask, 1 << (n - 1), axis, periodic, _EVERYWHERE) & forward
            ahead |= _moved(mask, -(1 << (n - 1)), axis, periodic, _EVERYWHERE) & ~forward
            mask = mask & ahead
        out |= mask.astype(np.uint32) << np.uint32(8 * n)
    return out


def steepness(terrain_m: NDArray, cell_m: Sequence[float], periodic: bool) -> NDArray[np.float32]:
    """Bound of the slope (ny, nx) of the terrain within STEEP_CELLS of the cell beyond each node, each way; periodic
    ground is level."""
    from scipy.ndimage import maximum_filter

    square = np.zeros(terrain_m.shape)
    if not periodic:
        for axis, cell in ((1, cell_m[0]), (0, cell_m[1])):
            # the last node's cell is none; it counts with the one before
            rise = np.diff(terrain_m.astype(float), axis=axis, append=np.take(terrain_m, [-1], axis)) / cell
            square += maximum_filter(np.abs(rise), 2 * STEEP_CELLS + 3, mode="nearest") ** 2
    return np.sqrt(square).astype(FLOAT)


def _moved(array: NDArray, by: int, axis: int, periodic: bool, outside: np.generic) -> NDArray:
    """What lies ``by`` nodes ahead along an axis; levels have an end in periodic domains too."""
    if periodic and axis > 0:
        return np.roll(array, -by, axis)
    out = np.full_like(array, outside)
    here, there = np.moveaxis(out, axis, 0), np.moveaxis(array, axis, 0)
    if abs(by) < len(there):
        if by > 0:
            here[:-by] = there[by:]
        else:
            here[-by:] = there[:by]
    return out
