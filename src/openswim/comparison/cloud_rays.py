"""Which cells of a model's grid a camera's pixels look through, and what the pixels say of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.pictures.observer import place_of, terrain_below
from openswim.scene import Scene
from openswim.scene.frame import scene_frame

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
_MOST_PARTS = 16  # of a layer between two levels that a slanted ray crosses


@dataclass(frozen=True, eq=False)
class Crossings:
    """Fractional indices (n, steps, 3: z, y, x) of places along rays, NaN outside; `height_m` (steps,)."""

    index: NDArray[np.float32]
    height_m: F64
    shape: tuple[int, int, int]

    def votes(self, rays: Mask) -> F64:
        """(nz, ny, nx): how much of these rays (n,) each node is seen in: its trilinear weights along them."""
        index = self.index[rays]
        index = index[np.isfinite(index[..., 0])]
        total = np.zeros(int(np.prod(self.shape)))
        for cell, weight in self._corners(index):
            total += np.bincount(cell, weight, minlength=total.size)
        return total.reshape(self.shape)

    def touches(self, cells: Mask) -> Mask:
        """(n,) whether a ray has more than half of its weight on these nodes (nz, ny, nx) somewhere."""
        index = self.index.reshape(-1, 3)
        there = np.isfinite(index[:, 0])
        share, flat = np.zeros(len(index)), cells.ravel()
        for cell, weight in self._corners(index[there]):
            share[there] += weight * flat[cell]
        return np.asarray((share.reshape(self.index.shape[:2]) > 0.5).any(axis=1))

    def column_at(self, height_m: float) -> NDArray[np.int64]:
        """(n,) number of the column (ny * nx) in which each ray crosses a height, -1 outside."""
        at = self.index[:, int(np.argmin(np.abs(self.height_m - height_m)))]
        j, i = (np.round(np.nan_to_num(part, nan=-1)).astype(np.int64) for part in at.T[1:])
        return np.where(np.isfinite(at[:, 0]), j * self.shape[2] + i, -1)

    def _corners(self, index: NDArray[np.float32]) -> Iterator[tuple[NDArray[np.int64], F64]]:
        """Number and weight (m,) of each of the eight nodes around places (m, 3)."""
        _, ny, nx = self.shape
        low = np.minimum(np.floor(index).astype(np.int64), np.array(self.shape) - 1)
        part = index - low
        for corner in product((0, 1), repeat=3):
            k, j, i = (np.minimum(low[:, a] + corner[a], self.shape[a] - 1) for a in range(3))
            weight = np.prod(np.where(corner, part, 1 - part), axis=1)
            yield (k * ny + j) * nx + i, weight.astype(float)


def crossings(scene: Scene, camera: Camera, direction: F64, levels: slice) -> Crossings:
    """Of unit vectors (n, 3) east, north, up at the camera, all above the horizon, through some levels of the grid."""
    grid, frame = scene.grid, scene_frame(scene)
    assert grid is not None
    nz, ny, nx = grid.shape
    profile = grid.height_m if grid.height_m.ndim == 1 else grid.height_m.mean(axis=(1, 2))
    east, north = place_of(camera)
    ground_m = terrain_below([scene], east, north) or 0.0
    origin = frame.position(north, east, camera.height_above_sea_m(ground_m))
    rays = direction @ frame.enu(north, east)
    heights = _heights(profile[levels], float(direction[:, 2].min()), grid.spacing_m()[0])
    start = frame.radius_m + camera.height_above_sea_m(ground_m) if frame.curved else 0.0
    index = np.full((len(rays), heights.size, 3), np.nan, np.float32)
    for step, height in enumerate(heights):
        rise = height - camera.height_above_sea_m(ground_m)
        if rise <= 0:
            continue
        up = direction[:, 2]
        # along the ray until the height is reached, over a curved Earth
        along = rise / up if not frame.curved else 2 * rise * (1 + rise / (2 * start)) / (
            up + np.sqrt(up**2 + 2 * rise / start + (rise / start) ** 2)
        )  # fmt: skip
        lat, lon, _ = frame.latlon(origin + along[:, None] * rays)
        ix, iy = grid.place(lon, lat)
        if grid.periodic:
            ix, iy = ix % (nx - 1e-6), iy % (ny - 1e-6)
        inside = (ix >= 0) & (ix <= nx - 1) & (iy >= 0) & (iy <= ny - 1)
        iz = _level(grid.height_m, height, iy[inside], ix[inside])
        index[inside, step] = np.stack([iz, iy[inside], ix[inside]], axis=-1)
    index[~np.isfinite(index).all(axis=-1)] = np.nan
    return Crossings(index, heights, (nz, ny, nx))


def _heights(profile: F64, lowest_sine: float, spacing_m: float) -> F64:
    """Heights at which rays are looked at: so close that the lowest of them moves by half a cell at most."""
    run = np.sqrt(max(1 - lowest_sine**2, 1e-6)) / max(lowest_sine, 0.05)
    counts = np.clip(np.ceil(np.diff(profile) * run / (spacing_m / 2)), 1, _MOST_PARTS).astype(int)
    parts = [
        np.linspace(low, high, n, endpoint=False) for (low, high), n in zip(pairwise(profile), counts, strict=True)
    ]
    return np.concatenate([*parts, profile[-1:]])


def _level(heights: F64, height: float, iy: F64, ix: F64) -> F64:
    """Fractional level of a height in columns (n,); NaN below the lowest and above the highest."""
    columns = heights[:, None] if heights.ndim == 1 else heights[:, np.round(iy).astype(int), np.round(ix).astype(int)]
    low = np.clip((columns <= height).sum(axis=0) - 1, 0, len(columns) - 2)
    below, above = (np.take_along_axis(columns, (low + n)[None], axis=0)[0] for n in (0, 1))
    at = low + (height - below) / (above - below)
    return np.where((at < 0) | (at > len(columns) - 1), np.nan, at) + 0 * ix
