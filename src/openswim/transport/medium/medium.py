"""Matter as the kernels see it: species on height levels, columns with their axes, and a chart to find them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.optics.matter import Air, Matter
from openswim.optics.species import Background, OpticalSpecies
from openswim.scene.frame import Frame
from openswim.scene.grid import Grid
from openswim.scene.levels import on_levels
from openswim.transport.air.shells import shell_levels
from openswim.transport.march.volume import DEGREE
from openswim.transport.medium.chart import chart_of, check_span, finer_columns, fixed_to_earth
from openswim.transport.medium.cloud_cover import cloud_under_cover
from openswim.transport.medium.levels import (
    LAYERS_DEGREE,
    halvings_for,
    layer_levels,
    levels_above,
    own_levels,
    refined_levels,
)
from openswim.transport.medium.subdivision import finer_cloud, halved, subdivided
from openswim.transport.medium.surface import Surface

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MOST_LOOKUPS = 20_000
_MOST_FINER_NODES = 3_000_000
_MOST_HALVED_NODES = 10_000_000
_MOST_CLOUD_NODES, _MOST_PLAIN_NODES = 4_500_000, 8_000_000  # of clouds broken by their cover; without sweeps
_MOST_WIDE_NODES = 18_000_000  # of such clouds in wide cells, each column lit by itself
WIDE_CELL_M = 1200.0  # cells that share less light than sweeps would smear between them
_CELL_M, _CLOUD_CELL_M = 1500.0, 750.0  # wider cells are divided; where they are broken into clouds
_WITHOUT_SIDES_M = 1e8


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
        out[:, node, j, i] *= np.clip(share, 0.0, None).astype(np.float32)
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

    @property
    def divided(self) -> bool:
        """Whether columns are halved, since they would be too thick."""
        return self.halvings > 0

    @property
    def drawn_cell_m(self) -> float:
        """Width of the cells between which all is linear."""
        return min(self.cell_m) * 2**self.halvings

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


def build_medium(
    matter: Matter, surface: Surface, mu_sun: float, refine: bool = True, divide: bool = True
) -> Medium:  # fmt: skip
    """Resample matter to height levels; ``refine`` divides levels that are too thick for sweeps.

    It divides columns too if it may (``divide``), up to `MOST_RESOLVED_NODES`, unless each is to be lit by itself or
    its clouds are broken by their cover.
    """
    grid, frame = matter.grid, matter.frame
    if grid is None:
        raise UserError("this scene has no grid")
    check_span(grid)
    species = list(matter.species)
    _, ny, nx = grid.shape
    terrain = surface.terrain_m
    dx, dy = grid.spacing_m()
    heights = grid.height_m
    levels = own_levels(heights, terrain, frame.curved)
    total = np.sum([s.extinction_per_m for s in species], axis=0) if species else None
    cover = matter.cover if species else None
    fields = [s.extinction_per_m for s in species] + ([] if cover is None else [cover])
    cell_m, halvings = min(dx, dy), 0
    sideless = (
        grid.periodic and not terrain.any() and all((field == field[:, :1, :1]).all() for field in fields)
    )
    if sideless:
        # plane-parallel: one column without sides, so that level light need not be chased around the period
        dx = dy = _WITHOUT_SIDES_M
        ny = nx = 1
    layered = refine and sideless and matter.air is None and cover is None
    if layered and total is not None:
        own_heights = heights.reshape(len(heights), -1)[:, 0]
        levels = layer_levels(levels, np.interp(levels, own_heights, total[:, 0, 0], 0.0, 0.0), mu_sun)
    elif refine:
        if divide and not sideless and cover is None and cell_m < WIDE_CELL_M:
            halvings = halvings_for(levels, heights, total, cell_m, ny * nx)
        share = 1.0  # on the Earth, where levels do not follow the hour
        if sideless:
            share = 0.35 * max(mu_sun, 0.12)  # of one column, levels cost little
        elif not frame.curved:
            share = float(np.clip(2 * mu_sun, 0.2, 1.0))  # a low sun's beam fades within less height
        levels = refined_levels(levels, heights, total, min(dx, dy) / 2**halvings, ny * nx * 4**halvings, share)
    fineness = 1
    if frame.curved and (refine or cover is not None):
        fineness = fineness_of((len(levels), ny, nx), cell_m, cover is not None, refine)
    axes, place = finer_columns(grid, frame, fineness)
    if nx == 1:
        terrain, axes, place = terrain[:1, :1], axes[:1, :1], place[:1, :1]
    fields = [on_levels(field[:, :ny, :nx], heights, levels, frame.curved) for field in fields]
    if cover is not None:
        fixed = fixed_to_earth(frame, place)
        extinction = cloud_under_cover(fields[:-1], species, fields[-1], levels, fixed, cell_m, fineness)
    else:
        extinction = np.zeros((len(species), len(levels), *place.shape[:2]), np.float32)
        for out, own in zip(extinction, fields, strict=True):
            out[:] = own if fineness == 1 else finer_cloud(own, fineness)
    if fineness > 1:
        terrain = surface.finer_terrain_m(subdivided(terrain, fineness), fineness)
        dx, dy = dx / fineness, dy / fineness
    if frame.curved:  # what lies under the terrain must not be seen by a step that ends there
        thickness = np.gradient(levels)
        buried = levels[:, None, None] < terrain - 1.5 * thickness[:, None, None]
        extinction[:, buried] = 0
    origin, per_m, chart = chart_of(grid, frame)
    chart = chart * fineness
    ground_m = outside_ground_m(terrain) if frame.curved else 0.0
    medium = Medium(
        frame, grid, matter.wavelengths_nm, species, extinction, levels, (dx, dy), terrain, axes, place, grid.periodic,
        origin, per_m, chart, ground_m, air_of(matter.air, ground_m), fineness, LAYERS_DEGREE if layered else DEGREE,
    )  # fmt: skip
    for _ in range(halvings):
        medium = halved_medium(medium)
    return medium


def halved_medium(medium: Medium) -> Medium:
    """The same fields on columns half as wide, linear between those of ``medium``, and then on layers no taller.

    Nothing is halved that would make more than `_MOST_HALVED_NODES`, nor in scenes without sides.
    """
    nz, ny, nx = medium.shape
    if ny * nx == 1 or 4 * nz * ny * nx > _MOST_HALVED_NODES:
        return medium
    fineness = 2 * medium.fineness
    extinction, terrain = (halved(halved(field, -1, medium.periodic), -2, medium.periodic)
                           for field in (medium.extinction, medium.terrain_m))  # fmt: skip
    axes, place = finer_columns(medium.grid, medium.frame, fineness)
    cell_m = (medium.cell_m[0] / 2, medium.cell_m[1] / 2)
    levels = medium.levels_m
    if _too_tall(levels, min(cell_m), ny * nx):
        extinction, levels = halved(extinction, 1), halved(levels, 0)
    return replace(
        medium, extinction=extinction, levels_m=levels, cell_m=cell_m, terrain_m=terrain, axes=axes, place=place,
        chart=2 * medium.chart, fineness=fineness, halvings=medium.halvings + 1,
    )  # fmt: skip


def _too_tall(levels: F64, cell_m: float, columns: int) -> bool:
    """Whether layers are to be halved where so many columns have been, into cells so wide."""
    return bool(np.median(np.diff(levels)) > 1.2 * cell_m) and 8 * len(levels) * columns <= _MOST_HALVED_NODES


def with_air_above(medium: Medium) -> Medium:
    """A medium that goes on, if there is air, to where little of it is left: what clouds light there is its to know."""
    above = levels_above(medium.levels_m)
    if medium.air is None or not above.size:
        return medium
    more = np.zeros((len(medium.species), above.size, *medium.terrain_m.shape), np.float32)
    return replace(
        medium, levels_m=np.concatenate([medium.levels_m, above]),
        extinction=np.concatenate([medium.extinction, more], axis=1),
    )  # fmt: skip


def with_soft_top(medium: Medium) -> Medium:
    """A medium whose cloud does not end at the highest level, where sweeps lose light, nor fades through a tall layer
    of air above: as much of it, half a layer on both sides of where it ended."""
    if medium.layered or not medium.extinction[:, -1].any():
        return medium
    levels = np.append(medium.levels_m, 2 * medium.levels_m[-1] - medium.levels_m[-2])
    extinction = np.pad(medium.extinction, [(0, 0), (0, 1), (0, 0), (0, 0)])
    extinction[:, -2] *= 0.5
    return replace(medium, levels_m=levels, extinction=extinction)


def fineness_of(shape: tuple[int, int, int], cell_m: float, broken: bool, refine: bool) -> int:
    """Into how many a cell of a grid (nz, ny, nx) is divided each way; ``broken``: into clouds, by their cover."""
    nz, ny, nx = shape
    wanted, most = _CELL_M, _MOST_FINER_NODES
    if broken:
        wanted, most = _CLOUD_CELL_M, _MOST_CLOUD_NODES if refine else _MOST_PLAIN_NODES
    fineness = 1
    while cell_m / fineness > wanted:
        wide = broken and refine and cell_m / (2 * fineness) >= WIDE_CELL_M
        if (2 * fineness * ny) * (2 * fineness * nx) >= (_MOST_WIDE_NODES if wide else most) // nz:
            break
        fineness *= 2
    return fineness


def drawn_shape(
    matter: Matter, terrain: F32, refine: bool, divide: bool = True
) -> tuple[tuple[int, int, int], float, bool]:
    """Nodes (nz, ny, nx) of what `build_medium` makes of matter on the Earth, or a few more; the width (m) of its
    cells; whether they are halved. ``refine``, ``divide``: as there."""
    grid, species = matter.grid, list(matter.species)
    assert grid is not None
    _, ny, nx = grid.shape
    cell_m, cover, halvings = min(grid.spacing_m()), matter.cover if species else None, 0
    levels = own_levels(grid.height_m, terrain, grid.curved)
    if refine:
        total = np.sum([s.extinction_per_m for s in species], axis=0) if species else None
        if divide and cover is None and cell_m < WIDE_CELL_M:
            halvings = halvings_for(levels, grid.height_m, total, cell_m, ny * nx)
        levels = refined_levels(levels, grid.height_m, total, cell_m / 2**halvings, ny * nx * 4**halvings, 1.0)
        for n in range(halvings):
            cell_m /= 2
            if _too_tall(levels, cell_m, ny * nx * 4**n):
                levels = halved(levels, 0)
    fineness = 2**halvings
    if refine or cover is not None:
        wide = fineness_of((len(levels), ny, nx), cell_m, cover is not None, refine)
        fineness, cell_m = fineness * wide, cell_m / wide
    return (len(levels), fineness * ny, fineness * nx), cell_m, halvings > 0


def outside_ground_m(terrain: F32) -> float:
    """Height of the ground beyond the grid: the median along the edge, rounded to the metre."""
    edge = np.concatenate([terrain[0], terrain[-1], terrain[:, 0], terrain[:, -1]])
    return float(np.round(np.median(edge)))
