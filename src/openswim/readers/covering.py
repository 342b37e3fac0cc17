"""Which columns and rows of a target grid lie in a file's mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from openswim.scene.grid import Grid

if TYPE_CHECKING:
    from openswim.readers.neighbourhood import Mesh


def meeting(mesh: Mesh, target: Grid) -> tuple[slice, slice]:
    """The columns and rows of a target grid that meet the mesh."""
    i, j = np.meshgrid(np.arange(target.x.size), np.arange(target.y.size))
    within = mesh.covers(*mesh.index(*target.lonlat(i, j)))
    kept = []
    for axis in (0, 1):
        some = np.flatnonzero(within.any(axis=axis))
        first, last = (int(some[0]), int(some[-1])) if some.size else (0, 0)
        first = max(0, min(first, within.shape[1 - axis] - 2))
        kept.append(slice(first, max(last, first + 1) + 1))
    return kept[0], kept[1]


def within(mesh: Mesh, target: Grid, cells: float = 0.0) -> tuple[slice, slice] | None:
    """The columns and rows of a target grid that lie wholly in the mesh, with so much of the cells around them; None
    where there are none."""
    i, j = np.meshgrid(np.arange(target.x.size, dtype=float), np.arange(target.y.size, dtype=float))
    ix, iy = (np.nan_to_num(v, nan=-1e6, posinf=-1e6) for v in mesh.index(*target.lonlat(i, j)))
    wide = cells * target.spacing_m()[0] / min(mesh.grid().spacing_m())
    inside = np.ones(ix.shape, bool)
    for di, dj in ((-wide, -wide), (-wide, wide), (wide, -wide), (wide, wide)):
        inside &= mesh.covers(ix + di, iy + dj)
    low, high = [0, 0], [target.y.size, target.x.size]
    while not (kept := inside[low[0] : high[0], low[1] : high[1]]).all():  # drop the side that sticks out most
        missing = [1 - kept[0].mean(), 1 - kept[-1].mean(), 1 - kept[:, 0].mean(), 1 - kept[:, -1].mean()]
        side = int(np.argmax(missing))
        (low if side % 2 == 0 else high)[side // 2] += 1 - 2 * (side % 2)
        if min(high[0] - low[0], high[1] - low[1]) < 2:
            return None
    return slice(low[1], high[1]), slice(low[0], high[0])
