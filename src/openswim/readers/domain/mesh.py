"""The columns of a file's horizontal grid: where they lie, and which of another grid's lie among them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.scene.grid import EARTH_RADIUS_M, EDGE, Grid, check_places, great_circle_m

if TYPE_CHECKING:
    from pyproj import CRS

    from openswim.scene import Scene

F64 = NDArray[np.float64]

_EVEN = 0.02  # of a cell, as Grid asks


@dataclass(frozen=True)
class Mesh:
    """The columns of a file: node coordinates in `crs`, ascending; y may be uneven (Gaussian latitudes)."""

    x: F64
    y: F64
    crs: CRS | None
    earth_radius_m: float = EARTH_RADIUS_M

    def __post_init__(self) -> None:
        check_places(self.x, self.y, self.crs)

    @property
    def shape(self) -> tuple[int, int]:
        return self.y.size, self.x.size

    @property
    def in_degrees(self) -> bool:
        return self.crs is not None and bool(self.crs.is_geographic)

    @property
    def all_round(self) -> bool:
        """Whether the columns go once round the Earth."""
        step = (self.x[-1] - self.x[0]) / (self.x.size - 1)
        return self.in_degrees and abs(self.x.size * step - 360.0) < 0.5 * step

    def grid(self) -> Grid:
        """Its grid of two levels, to ask for positions; as if rows were even."""
        return Grid(self.x, np.linspace(self.y[0], self.y[-1], self.y.size), np.array([0.0, 1.0]), self.crs,
                    self.earth_radius_m)  # fmt: skip

    def index(self, lon: Any, lat: Any) -> tuple[F64, F64]:
        """Fractional indices of places; beyond the ends of a domain below 0 or above n - 1."""
        ix, iy = self.grid().index(lon, lat)
        if self.all_round:
            ix = ix % self.x.size
        if not self.even:
            step = (self.y[-1] - self.y[0]) / (self.y.size - 1)
            beyond = np.minimum(iy, 0.0) + np.maximum(iy - (self.y.size - 1), 0.0)
            iy = beyond + np.interp(self.y[0] + iy * step, self.y, np.arange(self.y.size, dtype=float))
        return ix, iy

    def index_of(self, target: Grid) -> tuple[F64, F64]:
        """Fractional indices (ny, nx) of another grid's columns; far below 0 where they are no places."""
        ix, iy = self.index(*target.lonlat(*np.meshgrid(np.arange(target.x.size), np.arange(target.y.size))))
        return np.nan_to_num(ix, nan=-1e6, posinf=-1e6), np.nan_to_num(iy, nan=-1e6, posinf=-1e6)

    def covers(self, ix: Any, iy: Any) -> NDArray[np.bool_]:
        """Whether fractional indices lie in the domain; on a global one also between its last row and the pole."""
        ny, nx = self.shape
        if self.all_round:
            return np.asarray((iy > -1.01) & (iy < ny + 0.01))
        return np.asarray((ix > -EDGE) & (ix < nx - 1 + EDGE) & (iy > -EDGE) & (iy < ny - 1 + EDGE))

    @property
    def even(self) -> bool:
        straight = np.linspace(self.y[0], self.y[-1], self.y.size)
        return bool(np.abs(self.y - straight).max() <= _EVEN * (straight[1] - straight[0]))


def mesh_of(scene: Scene) -> Mesh:
    """The columns of a scene that has a grid."""
    grid = scene.grid
    assert grid is not None
    return Mesh(grid.x, grid.y, grid.crs, grid.earth_radius_m)


def cell_m(grid: Grid, i: float, j: float) -> tuple[float, float]:
    """Width and height [m] of the cell around a node."""
    across = grid.lonlat([i - 0.5, i + 0.5], [j, j])
    along = grid.lonlat([i, i], [j - 0.5, j + 0.5])
    return great_circle_m(*across, grid.earth_radius_m), great_circle_m(*along, grid.earth_radius_m)


def equal_area_map(lat: float, lon: float, step_m: float, count: int, earth_radius_m: float) -> Grid:
    """Lambert's azimuthal map centred on a place, with `count` columns and rows; its two levels mean nothing."""
    from pyproj import CRS

    crs = CRS.from_proj4(f"+proj=laea +lat_0={lat} +lon_0={lon} +R={earth_radius_m} +no_defs")
    axis = step_m * (np.arange(count, dtype=np.float64) - count // 2)
    return Grid(axis, axis, np.array([0.0, 1.0]), crs, earth_radius_m)


def cut_out(target: Grid, kept: tuple[slice, slice]) -> Grid:
    """Some columns and rows of a grid."""
    return replace(target, x=target.x[kept[0]], y=target.y[kept[1]])


def meeting(mesh: Mesh, target: Grid) -> tuple[slice, slice]:
    """The columns and rows of a target grid that meet the mesh."""
    within = mesh.covers(*mesh.index_of(target))
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
    ix, iy = mesh.index_of(target)
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
