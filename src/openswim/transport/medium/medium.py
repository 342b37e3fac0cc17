"""A scene as the kernels see it: species on height levels, columns with their axes, and a chart to find them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.ground.relief import refined_terrain
from openswim.optics import Background, OpticalSpecies, background, scene_optics
from openswim.optics.cover import cloud_cover
from openswim.optics.species import REFERENCE_NM
from openswim.scene.frame import Frame, scene_frame
from openswim.scene.grid import Grid
from openswim.scene.levels import on_levels
from openswim.scene.scene import Scene
from openswim.transport.air.shells import shell_levels
from openswim.transport.columns.discrete_ordinates import LAYERS_DEGREE, layer_levels
from openswim.transport.march.volume import DEGREE
from openswim.transport.medium.cloud_cover import cloud_under_cover
from openswim.transport.medium.levels import halvings_for, levels_above, own_levels, refined_levels
from openswim.transport.medium.subdivision import finer_cloud, halved, subdivided

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_CHART_NODES = 161
_CHART_MARGIN = 1.35  # the chart reaches this many half-widths of the domain
_MOST_LOOKUPS = 20_000
_MOST_FINER_NODES = 3_000_000
_MOST_HALVED_NODES = 10_000_000
_MOST_CLOUD_NODES, _MOST_PLAIN_NODES = 4_500_000, 8_000_000  # of clouds broken by their cover; without sweeps
_MOST_WIDE_NODES = 18_000_000  # of such clouds in wide cells, each column lit by itself
WIDE_CELL_M = 1200.0  # cells that share less light than sweeps would smear between them
_CELL_M, _CLOUD_CELL_M = 1500.0, 750.0  # wider cells are divided; where they are broken into clouds
_WITHOUT_SIDES_M = 1e8
_MOST_DEGREES = 200.0  # of longitude


@dataclass
class Medium:
    """Optical species on a regular stack of height levels.

    extinction (ns, nz, ny, nx) 1/m at the reference wavelength; levels_m (nz,); cell_m (dx, dy); terrain_m (ny, nx);
    axes (ny, nx, 3, 3): rows grid-x, grid-y, up of each column in the scene frame; place (ny, nx, 3): sea level there.
    """

    frame: Frame
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
    fineness: int = 1  # nodes of the medium per node of the scene's grid, each way
    degree: int = DEGREE  # truncation order of the diffuse field
    first: tuple[int, int] = (0, 0)  # column and row of the scene's grid that are its first
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
        """Width of the cells that the scene itself has."""
        return min(self.cell_m) * self.fineness

    @property
    def level_lookup(self) -> tuple[float, float, F64]:
        """Origin, entries per metre, and table of fractional levels."""
        z = self.levels_m
        count = int(np.clip(8 * (z[-1] - z[0]) / np.diff(z).min(), 64, _MOST_LOOKUPS))
        heights = np.linspace(z[0], z[-1], count)
        return float(z[0]), (count - 1) / (z[-1] - z[0]), np.interp(heights, z, np.arange(len(z), dtype=float))


def air_of(scene: Scene, wavelengths_nm: F64, ground_m: float) -> Background | None:
    """Optical profile of the scene's own atmosphere on the shells' levels above ``ground_m``, or None."""
    if scene.atmosphere is None:
        return None
    return background(scene.atmosphere, wavelengths_nm, shell_levels() + ground_m)


def build_medium(
    scene: Scene, wavelengths_nm: F64, mu_sun: float, refine: bool = True, divide: bool = True,
    frame: Frame | None = None,
) -> Medium:  # fmt: skip
    """Resample a scene's species to height levels; ``refine`` divides levels that are too thick for sweeps.

    It divides columns too if it may (``divide``), up to `MOST_RESOLVED_NODES`, unless each is to be lit by itself or
    its clouds are broken by their cover. frame: another scene's, around which this one lies.
    """
    grid = scene.grid
    if grid is None:
        raise UserError("this scene has no grid")
    check_span(grid)
    frame = frame or scene_frame(scene)
    species = scene_optics(scene, wavelengths_nm)
    _, ny, nx = grid.shape
    terrain = np.zeros((ny, nx), np.float32)
    if "surface_altitude" in scene.data:
        terrain = np.nan_to_num(scene.data["surface_altitude"].values.astype(np.float32))
    terrain = refined_terrain(scene, terrain)
    dx, dy = grid.spacing_m()
    heights = grid.height_m
    levels = own_levels(heights, terrain, frame.curved)
    total = np.sum([s.extinction_per_m for s in species], axis=0) if species else None
    cover = cloud_cover(scene) if species else None
    fields = [s.extinction_per_m for s in species] + ([] if cover is None else [cover])
    cell_m, halvings = min(dx, dy), 0
    sideless = (
        grid.periodic and not terrain.any() and all((field == field[:, :1, :1]).all() for field in fields)
    )
    if sideless:
        # plane-parallel: one column without sides, so that level light need not be chased around the period
        dx = dy = _WITHOUT_SIDES_M
        ny = nx = 1
    layered = refine and sideless and scene.atmosphere is None and cover is None
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
    axes, place = _columns(grid, frame, fineness)
    if nx == 1:
        terrain, axes, place = terrain[:1, :1], axes[:1, :1], place[:1, :1]
    fields = [on_levels(field[:, :ny, :nx], heights, levels, frame.curved) for field in fields]
    if cover is not None:
        extinction = cloud_under_cover(fields[:-1], species, fields[-1], levels, _fixed(frame, place), cell_m, fineness)
    else:
        extinction = np.zeros((len(species), len(levels), *place.shape[:2]), np.float32)
        for out, own in zip(extinction, fields, strict=True):
            out[:] = own if fineness == 1 else finer_cloud(own, fineness)
    if fineness > 1:
        terrain = refined_terrain(scene, subdivided(terrain, fineness), fineness)
        dx, dy = dx / fineness, dy / fineness
    if frame.curved:  # what lies under the terrain must not be seen by a step that ends there
        thickness = np.gradient(levels)
        buried = levels[:, None, None] < terrain - 1.5 * thickness[:, None, None]
        extinction[:, buried] = 0
    origin, per_m, chart = chart_of(grid, frame)
    chart = chart * fineness
    ground_m = outside_ground_m(terrain) if frame.curved else 0.0
    medium = Medium(
        frame, wavelengths_nm, species, extinction, levels, (dx, dy), terrain, axes, place, grid.periodic, origin,
        per_m, chart, ground_m, air_of(scene, wavelengths_nm, ground_m), fineness, LAYERS_DEGREE if layered else DEGREE,
    )  # fmt: skip
    for _ in range(halvings):
        medium = halved_medium(scene, medium)
    return medium


def halved_medium(scene: Scene, medium: Medium) -> Medium:
    """The same fields on columns half as wide, linear between those of ``medium``, and then on layers no taller.

    Nothing is halved that would make more than `_MOST_HALVED_NODES`, nor in scenes without sides.
    """
    nz, ny, nx = medium.shape
    if ny * nx == 1 or 4 * nz * ny * nx > _MOST_HALVED_NODES:
        return medium
    grid, fineness = scene.grid, 2 * medium.fineness
    assert grid is not None
    extinction, terrain = (halved(halved(field, -1, medium.periodic), -2, medium.periodic)
                           for field in (medium.extinction, medium.terrain_m))  # fmt: skip
    axes, place = _columns(grid, medium.frame, fineness)
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


def drawn_shape(scene: Scene, refine: bool, divide: bool = True) -> tuple[tuple[int, int, int], float, bool]:
    """Nodes (nz, ny, nx) of what `build_medium` makes of a scene on the Earth, or a few more; the width (m) of its
    cells; whether they are halved. ``refine``, ``divide``: as there."""
    grid, species = scene.grid, scene_optics(scene, REFERENCE_NM)
    assert grid is not None
    _, ny, nx = grid.shape
    terrain = np.zeros((1, 1), np.float32)
    if "surface_altitude" in scene.data:
        terrain = np.nan_to_num(scene.data["surface_altitude"].values.astype(np.float32))
    cell_m, cover, halvings = min(grid.spacing_m()), cloud_cover(scene) if species else None, 0
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


def _fixed(frame: Frame, place: F64) -> F64:
    """Places in metres from the Earth's centre, in axes that turn with it."""
    if not frame.curved:
        return place
    lat, lon, _ = frame.latlon(place)
    return Frame(frame.radius_m, 0.0, 0.0).position(lat, lon, 0.0) + np.array([0.0, 0.0, frame.radius_m])


def columns_on(grid: Grid, frame: Frame, some: Any) -> tuple[F32, F64]:
    """Axes and sea-level points of some of the nodes (ny, nx) of a grid on the Earth."""
    _, ny, nx = grid.shape
    rows, columns = np.broadcast_arrays(np.arange(ny)[:, None], np.arange(nx))
    return _columns_at(grid, frame, columns[some].astype(float), rows[some].astype(float))


def _columns(grid: Grid, frame: Frame, fineness: int) -> tuple[F32, F64]:
    """Axes and sea-level points of the columns."""
    _, ny, nx = grid.shape
    last = 0 if grid.periodic else fineness - 1  # beyond the last node only the next period begins
    ny, nx = fineness * ny - last, fineness * nx - last
    iy, ix = np.mgrid[0:ny, 0:nx] / fineness
    if not frame.curved:
        place = np.stack([grid.x[0] + ix * grid.step[0], grid.y[0] + iy * grid.step[1], 0 * ix], axis=-1)
        return np.broadcast_to(np.eye(3, dtype=np.float32), (ny, nx, 3, 3)).copy(), place
    return _columns_at(grid, frame, ix, iy)


def _columns_at(grid: Grid, frame: Frame, ix: F64, iy: F64) -> tuple[F32, F64]:
    """`_columns` at fractional indices on the Earth."""

    def at(i: F64, j: F64) -> F64:
        lon, lat = grid.lonlat(i, j)
        return frame.position(lat, lon, 0.0)

    place = at(ix, iy)
    up = place + np.array([0, 0, frame.radius_m])
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    along = at(ix + 0.5, iy) - at(ix - 0.5, iy)
    along = np.where(np.isfinite(along), along, np.array([1.0, 0.0, 0.0]))  # the map ends here
    along -= (along * up).sum(-1, keepdims=True) * up
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    return np.stack([along, np.cross(up, along), up], axis=-2).astype(np.float32), place


def chart_of(grid: Grid, frame: Frame) -> tuple[float, float, F64]:
    """Table of fractional grid indices on Lambert's azimuthal equal-area map around the origin of the frame."""
    _, ny, nx = grid.shape
    if not frame.curved:
        # linear, so two nodes are exact; extent beyond the domain for distances to it
        x0, y0 = grid.x[0], grid.y[0]
        dx, dy = grid.step
        half = 50.0 * max(nx * dx, ny * dy, abs(x0), abs(y0))
        u = np.array([-half, half])
        chart = np.stack(np.meshgrid((u - x0) / dx, (u - y0) / dy), axis=-1)
        return -half, 1 / (2 * half), chart
    corners = np.array([[0, 0], [nx - 1, 0], [0, ny - 1], [nx - 1, ny - 1], [0, ny / 2], [nx - 1, ny / 2], [nx / 2, 0],
                        [nx / 2, ny - 1]], float)  # fmt: skip
    radius = frame.radius_m
    lon, lat = grid.lonlat(corners[:, 0], corners[:, 1])
    p = frame.position(lat, lon, 0.0)
    flat = p[:, :2] * np.sqrt(2 * radius / np.maximum(2 * radius + p[:, 2:3], 1e-3 * radius))
    half = min(_CHART_MARGIN * np.nanmax(np.abs(flat)), 2 * radius)
    u = np.linspace(-half, half, _CHART_NODES)
    uu, vv = np.meshgrid(u, u)
    square = (uu**2 + vv**2) / (2 * radius**2)  # 1 - cosine of the angle from the origin
    known = square < 1.99
    square = np.where(known, square, 0)
    shrink = np.sqrt(1 - 0.5 * square)
    lat, lon, _ = frame.latlon(np.stack([uu * shrink, vv * shrink, -radius * square], axis=-1))
    chart = np.where(known[..., None], np.stack(grid.index(lon, lat), axis=-1), -1e9)
    return -half, (_CHART_NODES - 1) / (2 * half), np.nan_to_num(chart, nan=-1e9, posinf=1e9, neginf=-1e9)


def check_span(grid: Grid) -> None:
    """Longitudes that go half round the Earth have a seam, or a pole, that no chart can hide."""
    if grid.in_degrees and grid.x[-1] - grid.x[0] > _MOST_DEGREES:
        raise UserError(
            f"the grid spans {grid.x[-1] - grid.x[0]:.0f} degrees of longitude: open the file with around=(lat, lon) "
            "and radius_km, which resamples what a view needs, up to a hemisphere"
        )
