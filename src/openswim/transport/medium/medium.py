"""Matter as the kernels see it: species on height levels, columns with their axes, and a chart to find them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from openswim.optics.matter import Air, Matter
from openswim.optics.species import Background, OpticalSpecies
from openswim.scene.frame import Frame
from openswim.scene.grid import Grid
from openswim.scene.interpolation import on_levels
from openswim.transport.air.shells import shell_levels
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import DEGREE
from openswim.transport.medium.chart import before_drift, chart_of, finer_columns, fixed_to_earth
from openswim.transport.medium.cloud_cover import cloud_under_cover
from openswim.transport.medium.levels import LAYERS_DEGREE
from openswim.transport.medium.plan import MediumPlan
from openswim.transport.medium.subdivision import finer_cloud, halved, subdivided
from openswim.transport.medium.surface import Surface

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MOST_LOOKUPS = 20_000


@dataclass
class Medium:
    """Optical species on a regular stack of height levels.

    extinction (ns, nz, ny, nx) 1/m at the reference wavelength; levels_m (nz,); cell_m (dx, dy); terrain_m (ny, nx);
    axes (ny, nx, 3, 3): rows grid-x, grid-y, up of each column in the scene frame; place (ny, nx, 3): sea level there.
    grid: that of the matter, whose nodes are some of the medium's.
    """

    frame: Frame
    grid: Grid
    wavelengths_nm: F64
    species: list[OpticalSpecies]
    extinction: F32
    levels_m: F64
    cell_m: tuple[float, float]
    terrain_m: F32
    axes: F32
    place: F64
    periodic: bool
    chart_origin_m: float
    chart_per_m: float
    chart: F64
    ground_m: float
    air: Background | None
    fineness: int = 1  # nodes of the medium per node of ``grid``, each way
    degree: int = DEGREE  # truncation order of the diffuse field
    first: tuple[int, int] = (0, 0)  # column and row of ``grid`` that are its first
    halvings: int = 0  # of the cells that are drawn, which counts in ``fineness``, too
    drift_m: tuple[float, float] = (0.0, 0.0)  # to the east and north, that clouds have brought their detail

    @property
    def shape(self) -> tuple[int, int, int]:
        return (len(self.levels_m), *self.terrain_m.shape)

    @cached_property
    def ground_node(self) -> NDArray[np.int64]:
        """The level nearest to the ground (ny, nx)."""
        between = 0.5 * (self.levels_m[1:] + self.levels_m[:-1])
        return np.asarray((between[:, None, None] < self.terrain_m - 0.01).sum(axis=0), np.int64)

    @cached_property
    def extinction_above_ground(self) -> F32:
        """``extinction`` to be swept: none below the nodes of the ground. These stand for half a layer, but hold all
        cloud from the terrain to halfway up to the next."""
        node = self.ground_node
        lowest = self.extinction[:, : node.max() + 1]
        if not (lowest.any() and self.terrain_m.any()):
            return self.extinction
        out = self.extinction.copy()
        level = np.arange(lowest.shape[1])[:, None, None]
        out[:, : lowest.shape[1]][:, level < node] = 0
        half = 0.5 * np.diff(self.levels_m)[np.minimum(node, len(self.levels_m) - 2)]
        below = self.levels_m[node] - self.terrain_m
        share = np.where(node > 0, 1 + below / half, 1.0)
        j, i = np.indices(node.shape)
        out[:, node, j, i] *= np.clip(share, 0.0, None).astype(FLOAT)
        return out

    @property
    def layered(self) -> bool:
        """Whether `layers.solve_layers` is to light it: one column, no sides, no air."""
        return self.degree == LAYERS_DEGREE

    @cached_property
    def cloud_top_m(self) -> float:
        """Height of the level above all that is on levels, or of the lowest where there is nothing."""
        filled = np.flatnonzero(self.extinction.any(axis=(0, 2, 3)))
        return float(self.levels_m[min(filled[-1] + 1, len(self.levels_m) - 1) if filled.size else 0])

    @cached_property
    def cloud_base_m(self) -> float:
        """Height of the level below all that is on levels; infinite where there is nothing."""
        filled = np.flatnonzero(self.extinction.any(axis=(0, 2, 3)))
        return float(self.levels_m[max(filled[0] - 1, 0)]) if filled.size else np.inf

    @property
    def divided(self) -> bool:
        """Whether columns are halved, since they would be too thick."""
        return self.halvings > 0

    @property
    def drawn_cell_m(self) -> float:
        """Width of the cells between which all is linear."""
        return min(self.cell_m) * 2**self.halvings

    @property
    def drift_along_axes_m(self) -> tuple[float, float]:
        """`drift_m` along x and y of the grid at its middle."""
        if not any(self.drift_m):
            return 0.0, 0.0
        _, ny, nx = self.shape
        axes, place = self.axes[ny // 2, nx // 2].astype(float), self.place[ny // 2, nx // 2]
        lat, lon, _ = self.frame.latlon(place)
        east, north, _ = self.frame.enu(float(lat), float(lon))
        way = self.drift_m[0] * east + self.drift_m[1] * north
        return float(way @ axes[0]), float(way @ axes[1])

    @property
    def scene_cell_m(self) -> float:
        """Width of the cells of ``grid``."""
        return min(self.cell_m) * self.fineness

    def indices(self, place: F64) -> tuple[F64, F64]:
        """Fractional column and row (n,) of places (n, 3) in the frame."""
        if self.frame.curved:
            lat, lon, _ = self.frame.latlon(place)
            ix, iy = self.grid.index(lon, lat)
            return (ix - self.first[0]) * self.fineness, (iy - self.first[1]) * self.fineness
        ix = self.fineness * (place[:, 0] - self.grid.x[0]) / self.grid.step[0]
        iy = self.fineness * (place[:, 1] - self.grid.y[0]) / self.grid.step[1]
        return ix, iy

    @property
    def level_lookup(self) -> tuple[float, float, F64]:
        """Origin, entries per metre, and table of fractional levels."""
        z = self.levels_m
        count = int(np.clip(8 * (z[-1] - z[0]) / np.diff(z).min(), 64, _MOST_LOOKUPS))
        heights = np.linspace(z[0], z[-1], count)
        return float(z[0]), (count - 1) / (z[-1] - z[0]), np.interp(heights, z, np.arange(len(z), dtype=float))


def air_of(air: Air | None, ground_m: float) -> Background | None:
    """Optical profile of the background air on the shells' levels above ``ground_m``, or None."""
    return None if air is None else air.at(shell_levels() + ground_m)


def build_medium(plan: MediumPlan, matter: Matter, surface: Surface) -> Medium:
    """Matter as it is planned to be drawn."""
    grid, frame = matter.grid, matter.frame
    assert grid is not None
    species = list(matter.species)
    plan.check(species)
    fineness, levels, heights = plan.fineness, plan.own_levels_m, grid.height_m
    rows, columns = (1, 1) if plan.sideless else grid.shape[1:]
    cell_m = min(grid.spacing_m())
    terrain = surface.terrain_m[:rows, :columns]
    axes, place = finer_columns(grid, frame, fineness)
    if plan.sideless:
        axes, place = axes[:1, :1], place[:1, :1]
    cover = matter.cover if species else None
    fields = [s.extinction_per_m for s in species] + ([] if cover is None else [cover])
    fields = [on_levels(field[:, :rows, :columns], heights, levels, frame.curved) for field in fields]
    if cover is not None:
        fixed = before_drift(frame, fixed_to_earth(frame, place), matter.drift_m)
        extinction = cloud_under_cover(fields[:-1], species, fields[-1], levels, fixed, cell_m, fineness)
    else:
        extinction = np.zeros((len(species), len(levels), *place.shape[:2]), FLOAT)
        for out, own in zip(extinction, fields, strict=True):
            out[:] = own if fineness == 1 else finer_cloud(own, fineness)
    if fineness > 1:
        terrain = surface.finer_terrain_m(subdivided(terrain, fineness), fineness)
    if frame.curved:  # what lies under the terrain must not be seen by a step that ends there
        thickness = np.gradient(levels)
        buried = levels[:, None, None] < terrain - 1.5 * thickness[:, None, None]
        extinction[:, buried] = 0
    origin, per_m, chart = chart_of(grid, frame)
    ground_m = outside_ground_m(terrain) if frame.curved else 0.0
    widening = 2 ** len(plan.halvings)
    medium = Medium(
        frame, grid, matter.wavelengths_nm, species, extinction, levels,
        (plan.cell_m[0] * widening, plan.cell_m[1] * widening), terrain, axes, place, grid.periodic, origin, per_m,
        chart * fineness, ground_m, air_of(matter.air, ground_m), fineness, LAYERS_DEGREE if plan.layered else DEGREE,
        drift_m=matter.drift_m,
    )  # fmt: skip
    for layers_too in plan.halvings:
        medium = halved_medium(medium, layers_too)
    if plan.soft_top:
        medium = _with_soft_top(medium)
    return medium if plan.above_m is None else _with_air_above(medium, plan.above_m)


def halved_medium(medium: Medium, layers_too: bool) -> Medium:
    """The same fields on columns half as wide, linear between those of ``medium``, and maybe on layers half as tall."""
    fineness = 2 * medium.fineness
    extinction, terrain = (halved(halved(field, -1, medium.periodic), -2, medium.periodic)
                           for field in (medium.extinction, medium.terrain_m))  # fmt: skip
    axes, place = finer_columns(medium.grid, medium.frame, fineness)
    levels = medium.levels_m
    if layers_too:
        extinction, levels = halved(extinction, 1), halved(levels, 0)
    return replace(
        medium, extinction=extinction, levels_m=levels, cell_m=(medium.cell_m[0] / 2, medium.cell_m[1] / 2),
        terrain_m=terrain, axes=axes, place=place, chart=2 * medium.chart, fineness=fineness,
        halvings=medium.halvings + 1,
    )  # fmt: skip


def _with_air_above(medium: Medium, above_m: F64) -> Medium:
    """With further levels on which there is but air."""
    more = np.zeros((len(medium.species), above_m.size, *medium.terrain_m.shape), FLOAT)
    return replace(
        medium, levels_m=np.concatenate([medium.levels_m, above_m]),
        extinction=np.concatenate([medium.extinction, more], axis=1),
    )  # fmt: skip


def _with_soft_top(medium: Medium) -> Medium:
    """With cloud that does not end at the highest level, nor fades through a tall layer of air above: as much of it,
    half a layer on both sides of where it ended."""
    levels = np.append(medium.levels_m, 2 * medium.levels_m[-1] - medium.levels_m[-2])
    extinction = np.pad(medium.extinction, [(0, 0), (0, 1), (0, 0), (0, 0)])
    extinction[:, -2] *= 0.5
    return replace(medium, levels_m=levels, extinction=extinction)


def outside_ground_m(terrain: F32) -> float:
    """Height of the ground beyond the grid: the median along the edge, rounded to the metre."""
    edge = np.concatenate([terrain[0], terrain[-1], terrain[:, 0], terrain[:, -1]])
    return float(np.round(np.median(edge)))
