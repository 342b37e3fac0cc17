"""Fields of a file onto a scene's columns: some of its rows and columns, or interpolated between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.readers.domain.mesh import Mesh, cell_m
from openswim.scene.grid import Grid
from openswim.scene.interpolation import corners

if TYPE_CHECKING:
    from pyproj import CRS

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Selection:
    """Which part of a file's fields becomes the scene's: its own axes, and how to read fields onto them."""

    x: F64
    y: F64
    crs: CRS | None
    earth_radius_m: float
    rows: slice  # of the file that are needed
    columns: tuple[slice, ...]  # of the file that are needed; two where the part goes over the seam of a global grid
    nodes: tuple[tuple[NDArray[np.int32], F32], ...] = ()  # resampling: (4, ny nx) flat indices and weights, averaged
    note: str = ""
    cut: bool = False  # whether the domain goes on beyond it

    @property
    def shape(self) -> tuple[int, int]:
        return self.y.size, self.x.size

    def read(self, get: Callable[[slice, slice], Any]) -> F32:
        """A field (..., y, x), where `get(rows, columns)` reads such a part of the file, (..., rows, columns)."""
        pieces = [np.asarray(get(self.rows, columns), np.float32) for columns in self.columns]
        part = pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=-1)
        if not self.nodes:
            return np.ascontiguousarray(part)
        flat = part.reshape(*part.shape[:-2], -1)
        return np.asarray(sum(_weighted(flat, *one) for one in self.nodes) / len(self.nodes), np.float32).reshape(
            *part.shape[:-2], *self.shape
        )

    def take(self, whole: NDArray[Any]) -> F32:
        """A field (..., y, x) from the whole one, which has the file's shape (..., ny, nx)."""
        return self.read(lambda rows, columns: whole[..., rows, columns])

    def grid(self, height_m: NDArray[Any]) -> Grid:
        """The scene's grid, with its heights."""
        return Grid(self.x, self.y, height_m, self.crs, self.earth_radius_m)


def _weighted(flat: F32, index: NDArray[np.int32], weight: F32) -> F32:
    """Interpolation that leaves missing values out, and is missing where they have half the weight."""
    values = flat[..., index]
    result = np.einsum("...kn,kn->...n", values, weight)
    if not np.isnan(result).any():
        return np.asarray(result, np.float32)
    there = np.isfinite(values)
    kept = np.einsum("...kn,kn->...n", there.astype(np.float32), weight)
    total = np.einsum("...kn,kn->...n", np.where(there, values, np.float32(0)), weight)
    return np.where(kept > 0.5, total / np.maximum(kept, np.float32(1e-6)), np.float32(np.nan)).astype(np.float32)


def whole(mesh: Mesh) -> Selection:
    ny, nx = mesh.shape
    every = Selection(mesh.x, mesh.y, mesh.crs, mesh.earth_radius_m, slice(0, ny), (slice(0, nx),))
    if mesh.even:
        return every
    y = np.linspace(mesh.y[0], mesh.y[-1], ny)
    at = np.interp(y, mesh.y, np.arange(ny, dtype=float))
    ix, iy = np.meshgrid(np.arange(nx, dtype=float), at)
    nodes = (_bilinear(mesh, every.rows, ix.ravel(), iy.ravel()),)
    return Selection(mesh.x, y, mesh.crs, mesh.earth_radius_m, every.rows, every.columns, nodes, "rows made even")


def onto(mesh: Mesh, target: Grid, note: str = "") -> Selection:
    """A mesh's fields on another grid: linear between its nodes, averaged where cells are wider; NaN beyond it."""
    ny, nx = mesh.shape
    _, tall = cell_m(mesh.grid(), 0.5 * (nx - 1), 0.5 * (ny - 1))
    step = target.spacing_m()[1]
    parts = max(1, min(4, round(step / tall)))  # cells wider than the model's: the mean of parts x parts points
    offsets = (np.arange(parts) + 0.5) / parts - 0.5
    i, j = np.meshgrid(np.arange(target.x.size, dtype=float), np.arange(target.y.size, dtype=float))
    found = [mesh.index(*target.lonlat((i + di).ravel(), (j + dj).ravel())) for dj in offsets for di in offsets]
    reached = np.concatenate([iy[np.isfinite(iy)] for _, iy in found])
    rows = slice(int(np.clip(np.floor(reached.min()), 0, ny - 2)), int(np.clip(np.ceil(reached.max()), 1, ny - 1)) + 1)
    nodes = tuple(_bilinear(mesh, rows, ix, iy) for ix, iy in found)
    return Selection(target.x, target.y, target.crs, target.earth_radius_m, rows, (slice(0, nx),), nodes, note)


def _bilinear(mesh: Mesh, rows: slice, ix: F64, iy: F64) -> tuple[NDArray[np.int32], F32]:
    """Flat indices (4, n) into some rows of a mesh, and weights, of bilinear interpolation; NaN outside the mesh."""
    nx, ny = mesh.shape[1], rows.stop - rows.start
    outside = ~(np.isfinite(ix) & np.isfinite(iy) & mesh.covers(ix, iy))
    ix, iy = np.where(outside, 0.0, ix), np.where(outside, 0.0, iy - rows.start)
    row, column, weight = corners(ix, iy, (ny, nx), mesh.all_round)
    weight[:, outside] = np.nan
    return (row * nx + column).astype(np.int32), weight.astype(np.float32)
