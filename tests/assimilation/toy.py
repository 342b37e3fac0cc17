"""A plain core in place of the transport: straight rays through nodes, light once scattered, exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from openswim import Camera, Scene
from openswim.assimilation.observing.core import Images
from openswim.optics.species import scene_optics
from openswim.scene.frame import scene_frame

F64 = NDArray[np.float64]


class Same:
    """The nodes are the scene's."""

    def to_nodes(self, field: F64) -> F64:
        return field

    def from_nodes(self, bar: F64) -> F64:
        return bar


@dataclass
class ToyCore:
    """L' = b (1 - exp(-tau)) + albedo exp(-tau) along each ray; global irradiance exp(-tau of the column) + albedo/9.

    ways: of each view the lengths (rays, nodes), m, and the columns (rays,) below; points: columns."""

    names: tuple[str, ...]
    shape: tuple[int, int, int]
    drawn: Same
    extinction: F64
    albedo: F64
    ways: list[tuple[F64, NDArray[np.int64]]]
    points: NDArray[np.int64]
    cell_m: float
    bright: F64 = field(default_factory=lambda: np.array([0.5]))
    tolerance: float = 0.0

    def forward(self, extinction: F64, albedo: F64, start: object = None) -> tuple[Images, tuple[F64, F64]]:
        total, ground = extinction.sum(axis=1).reshape(len(extinction), -1), albedo.reshape(len(albedo), -1)
        views = []
        for way, column in self.ways:
            through = np.exp(-total @ way.T)
            views.append(self.bright[:, None] * (1 - through) + ground[:, column] * through)
        return Images(views, np.exp(-self._column(total)) + ground[:, self.points] / 9), (total, ground)

    def tangent(
        self, state: tuple[F64, F64], d_extinction: F64, d_albedo: F64 | None, tolerance: float | None = None
    ) -> Images:
        total, ground = state
        d_total = d_extinction.sum(axis=1).reshape(total.shape)
        d_ground = np.zeros_like(ground) if d_albedo is None else d_albedo.reshape(ground.shape)
        views = []
        for way, column in self.ways:
            through = np.exp(-total @ way.T)
            d_through = -through * (d_total @ way.T)
            views.append((ground[:, column] - self.bright[:, None]) * d_through + d_ground[:, column] * through)
        d_ghi = -np.exp(-self._column(total)) * self._column(d_total) + d_ground[:, self.points] / 9
        return Images(views, d_ghi)

    def adjoint(
        self, state: tuple[F64, F64], residual: Images, tolerance: float | None = None
    ) -> tuple[F64, F64]:
        total, ground = state
        total_bar, ground_bar = np.zeros_like(total), np.zeros_like(ground)
        for (way, column), bar in zip(self.ways, residual.radiance, strict=True):
            through = np.exp(-total @ way.T)
            total_bar -= (bar * through * (ground[:, column] - self.bright[:, None])) @ way
            for w, each in enumerate(bar * through):
                np.add.at(ground_bar[w], column, each)
        column_bar = -np.exp(-self._column(total)) * residual.ghi
        by_column = total_bar.reshape(len(total), self.shape[0], -1)
        for w in range(len(total)):
            each = np.repeat(column_bar[w][:, None] * self.cell_m, self.shape[0], axis=1)
            np.add.at(by_column[w].T, self.points, each)
            np.add.at(ground_bar[w], self.points, residual.ghi[w] / 9)
        bars = total_bar.reshape(len(total), 1, *self.shape) * np.ones((1, len(self.names), 1, 1, 1))
        return bars, ground_bar.reshape(len(total), *self.shape[1:])

    def _column(self, total: F64) -> F64:
        return total.reshape(len(total), self.shape[0], -1).sum(axis=1)[:, self.points] * self.cell_m


def toy_core(scene: Scene, cameras: list[Camera], points: list[tuple[float, float]] = (), wavelengths: int = 1,
             albedo: float = 0.1) -> ToyCore:  # fmt: skip
    """Rays of cameras in a flat scene with level nodes, by nearest nodes at places a third of a cell apart."""
    grid, frame, species = scene.grid, scene_frame(scene), scene_optics(scene, [550.0])
    assert grid is not None
    x, y, z = grid.x, grid.y, np.asarray(grid.height_m, float)
    cell = float(x[1] - x[0])
    ways = []
    for camera in cameras:
        rays = camera.rays(frame)
        origin, direction = np.broadcast_to(rays.origin_m, rays.directions().shape), rays.directions()
        way, column = np.zeros((len(direction), int(np.prod(grid.shape)))), np.zeros(len(direction), np.int64)
        for n, (start, ahead) in enumerate(zip(origin, direction, strict=True)):
            step = cell / 3
            entry = max(0.0, (start[2] - z[-1]) / max(-ahead[2], 1e-9)) if start[2] > z[-1] else 0.0
            place = start + ahead * (entry + step * np.arange(0.5, 400))[:, None]
            i, j, k = (np.rint((place[:, a] - axis[0]) / (axis[1] - axis[0])).astype(int)
                       for a, axis in enumerate((x, y, z)))  # fmt: skip
            inside = (i >= 0) & (i < x.size) & (j >= 0) & (j < y.size) & (k >= 0) & (k < z.size)
            np.add.at(way[n], np.ravel_multi_index((k[inside], j[inside], i[inside]), grid.shape), step)
            last = np.flatnonzero(inside)
            column[n] = j[last[-1]] * x.size + i[last[-1]] if last.size else 0
        ways.append((way, column))
    where = [int(np.rint((b - y[0]) / cell)) * x.size + int(np.rint((a - x[0]) / cell)) for b, a in points]
    bright = np.linspace(0.5, 0.7, wavelengths)
    return ToyCore(
        tuple(one.name for one in species), grid.shape, Same(),
        np.stack([np.stack([one.extinction_per_m for one in species])] * wavelengths).astype(float),
        np.full((wavelengths, *grid.shape[1:]), albedo), ways,
        np.array(where, np.int64), float(z[1] - z[0]), bright,
    )  # fmt: skip


def cloud(shape: tuple[int, int, int] = (8, 10, 12), thick_per_m: float = 0.02, seed: int = 0) -> F64:
    """A lumpy cloud (nz, ny, nx), 1/m, clear at the sides."""
    rng = np.random.default_rng(seed)
    z, y, x = (np.arange(n) - 0.5 * n for n in shape)
    bump = np.exp(-((z[:, None, None] / 2) ** 2 + (y[:, None] / 2.2) ** 2 + (x / 2.8) ** 2))
    out = thick_per_m * bump * (0.5 + rng.random(shape))
    return np.where(out < 0.05 * thick_per_m, 0.0, out)


def flat_scene(extinction: F64 | None = None, cell_m: float = 50.0, **more: object) -> Scene:
    """A cloud on a flat grid from the ground up."""
    field = cloud() if extinction is None else extinction
    nz, ny, nx = field.shape if field is not None else (8, 10, 12)
    axes = (cell_m * np.arange(nx), cell_m * np.arange(ny), cell_m * np.arange(nz))
    return Scene.from_arrays({"cloud": field}, *axes, surface_albedo=0.1, place=(40.0, 10.0), **more)
