"""Cloud carried by the wind from one time to another: linear in what is carried, with its exact transpose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.films.between import WIND, Motion
from openswim.scene import Grid, Scene
from openswim.scene.variables import DIRECT_PREFIX, HYDROMETEORS, LEVEL_DIMS

F64 = NDArray[np.float64]

_CARRIED = ("_content", "_number")


@dataclass(frozen=True, eq=False)
class Carrier:
    """Fields (nz, ny, nx) at another time: at each node what was where its air has come from, between the four nodes
    around (semi-Lagrangian, Staniforth and Cote 1991, first order). At the sides the outermost nodes' flow in.

    matrix: sparse, (nodes, nodes). way (nz, 2): mean way along x and y on each level, in cells.
    """

    seconds: float
    matrix: Any
    way: F64

    @classmethod
    def of(cls, motion: Motion, shape: tuple[int, int, int], seconds: float) -> Carrier:
        from scipy.sparse import csr_matrix

        nz, ny, nx = shape
        weights, columns, way = np.empty((nz, ny, nx, 4)), np.empty((nz, ny, nx, 4), np.int32), np.zeros((nz, 2))
        j, i = np.indices((ny, nx))
        for k in range(nz):
            y, x = (np.asarray(a, float) for a in motion.came_from(k, seconds, (ny, nx), "nearest"))
            way[k] = (i - x).mean(), (j - y).mean()
            y, x = np.clip(y, 0, ny - 1), np.clip(x, 0, nx - 1)
            low_y, low_x = (np.minimum(a.astype(int), n - 2) for a, n in ((y, ny), (x, nx)))
            far_y, far_x = y - low_y, x - low_x
            for n, (b, a) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
                weights[k, ..., n] = (far_y if b else 1 - far_y) * (far_x if a else 1 - far_x)
                columns[k, ..., n] = (k * ny + low_y + b) * nx + low_x + a
        rows = np.arange(0, 4 * nz * ny * nx + 1, 4, dtype=np.int32)
        matrix = csr_matrix((weights.ravel(), columns.ravel(), rows), shape=(nz * ny * nx,) * 2)
        return cls(seconds, matrix, way)

    def __call__(self, field: F64) -> F64:
        return np.asarray(self.matrix @ np.ravel(field)).reshape(np.shape(field))

    def transposed(self, bar: F64) -> F64:
        return np.asarray(self.matrix.T @ np.ravel(bar)).reshape(np.shape(bar))

    def scene(self, scene: Scene) -> Scene:
        """A scene at the other time: contents, numbers and extinctions are carried, and radii follow so that extinction
        is. All else stays in its place."""
        data = scene.data.copy()
        for name in map(str, scene.data.data_vars):
            if name.endswith(_CARRIED) or name.startswith(DIRECT_PREFIX) or name == "aerosol_extinction":
                own = scene.data[name]
                if own.dims == LEVEL_DIMS:
                    data[name] = own.copy(data=self(own.values).astype(np.float32))
        for species in HYDROMETEORS:
            name = f"{species}_effective_radius"
            if name in data and f"{species}_content" in data:
                data[name] = self._radius(scene.data[name], scene.data[f"{species}_content"])
        time = None if scene.time is None else scene.time + np.timedelta64(round(1e3 * self.seconds), "ms")
        return replace(scene, data=data, time=time, optics=dict(scene.optics), notes=list(scene.notes))

    def _radius(self, radius: xr.DataArray, content: xr.DataArray) -> xr.DataArray:
        known = radius.values > 0
        mass = np.where(known, content.values, 0.0)
        optical = self(mass / np.where(known, radius.values, 1.0))
        found = np.where(optical > 1e-12, self(mass) / np.maximum(optical, 1e-12), radius.values)
        return radius.copy(data=found.astype(np.float32))


def motion_of(scene: Scene, wind: Any = None) -> Motion:
    """How cloud of a scene moves: by a wind (east, north) in m/s, numbers or a row of them by level, or by the scene's
    own. Raises UserError where there is none."""
    grid = scene.grid
    assert isinstance(grid, Grid)
    if wind is None:
        if any(name not in scene.data for name in WIND):
            raise UserError("the scene has no wind: open it with winds=True, or give wind = (east, north) in m/s")
        east, north = (scene.data[name].transpose(*LEVEL_DIMS).values for name in WIND)
        return Motion.of_wind(grid, east, north, "the model's wind")
    try:
        parts = [np.asarray(each, float) for each in wind]
        if len(parts) != 2 or not all(p.shape in ((), grid.shape[:1]) and np.isfinite(p).all() for p in parts):
            raise ValueError
    except (TypeError, ValueError):
        raise UserError(f"wind: give (east, north) in m/s, two numbers or two rows of {grid.shape[0]} levels") from None
    east, north = (np.reshape(p, (-1, 1, 1)) for p in parts)
    return Motion.of_wind(grid, east, north, "the wind that was given")
