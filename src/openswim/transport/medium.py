"""A scene as the kernels see it: species on height levels, columns with their axes, and a chart to find them."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
from openswim.transport.finer import finer_cloud, halved, subdivided
from openswim.transport.layers import LAYERS_DEGREE, layer_levels
from openswim.transport.shells import shell_levels
from openswim.transport.subgrid import cloud_under_cover
from openswim.transport.volume import DEGREE

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_CHART_NODES = 161
_CHART_MARGIN = 1.35  # the chart reaches this many half-widths of the domain
_MOST_NODES = 6_000_000
_MOST_LEVELS = 160
_MOST_LOOKUPS = 20_000
_MOST_FINER_NODES = 3_000_000
_MOST_HALVED_NODES, MOST_RESOLVED_NODES = 10_000_000, 4_000_000
_MOST_CLOUD_NODES, _MOST_PLAIN_NODES = 4_500_000, 8_000_000  # of clouds broken by their cover; without sweeps
_MOST_WIDE_NODES = 18_000_000  # of such clouds in wide cells, each column lit by itself
WIDE_CELL_M = 1200.0  # cells that share less light than sweeps would smear between them
_CELL_M, _CLOUD_CELL_M = 1500.0, 750.0  # wider cells are divided; where they are broken into clouds
_WITHOUT_SIDES_M = 1e8
_MOST_DEGREES = 200.0  # of longitude
_CLOUDY_DEPTH = 0.05  # vertical optical depth of a layer that counts as cloud
_CELL_DEPTH = 0.7  # optical depth above which a cell is divided
_AIR_TOP_M = 18_000.0  # of levels above a scene's own
_TALLER, _TALLEST, _TALLEST_M = 2.0, 0.3, 2000.0  # than the last, of its height (haze thins out fast), and at all
_SCALED = 0.4  # of the extinction, by delta scaling: 1 - f is .3 to .55


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

    @property
    def shape(self) -> tuple[int, int, int]:
        return (len(self.levels_m), *self.terrain_m.shape)

    @property
    def layered(self) -> bool:
        """Whether `layers.solve_layers` is to light it: one column, no sides, no air."""
        return self.degree == LAYERS_DEGREE

    @property
    def divided(self) -> bool:
        """Whether columns of a flat scene are halved, since they would be too thick."""
        return not self.frame.curved and self.fineness > 1

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
    scene: Scene, wavelengths_nm: F64, mu_sun: float, refine: bool = True, tall: bool = False,
    frame: Frame | None = None,
) -> Medium:  # fmt: skip
    """Resample a scene's species to height levels; ``refine`` divides levels that are too thick for sweeps.

    It divides columns too, up to `MOST_RESOLVED_NODES`, of flat scenes: their fields are meant as they are given. A
    model's nodes tell of means; what lies between them is our guess, and nothing is gained by solving it better.

    tall: layers may be as tall as two columns are wide, and columns are not divided. frame: another scene's, around
    which this one lies.
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
    levels = _levels(heights, terrain, frame.curved)
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
        if not frame.curved and not sideless and not tall and cell_m < WIDE_CELL_M:
            halvings = _halvings(levels, heights, total, cell_m, ny * nx)
        share = 1.0  # on the Earth, where levels do not follow the hour
        if sideless:
            share = 0.35 * max(mu_sun, 0.12)  # of one column, levels cost little
        elif not frame.curved:
            share = float(np.clip(2 * mu_sun, 0.2, 1.0))  # a low sun's beam fades within less height
        levels = _refined(
            levels, heights, total, (2 if tall else 1) * min(dx, dy) / 2**halvings, ny * nx * 4**halvings, share
        )
    if refine and scene.atmosphere is not None:
        levels = _with_air_above(levels)
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


def _halvings(levels: F64, heights: NDArray, total: F32 | None, cell_m: float, columns: int) -> int:
    """How often to halve columns until nine cloudy cells in ten are not too thick across, or nodes too many."""
    cloudy = total[total > 0] if total is not None else np.zeros(0)
    depth = _SCALED * np.percentile(cloudy, 90) * cell_m if cloudy.size else 0.0
    halvings = 0
    while depth > _CELL_DEPTH * 2**halvings:
        parts, finer = 2 ** (halvings + 1), columns * 4 ** (halvings + 1)
        if len(_refined(levels, heights, total, cell_m / parts, finer, 1.0)) * finer > MOST_RESOLVED_NODES:
            break
        halvings += 1
    return halvings


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
    own = levels[levels <= grid.height_m.max()]  # and not those of the air above
    if np.median(np.diff(own)) > 1.2 * min(cell_m) and 8 * nz * ny * nx <= _MOST_HALVED_NODES:
        extinction, levels = halved(extinction, 1), halved(levels, 0)
    return replace(
        medium, extinction=extinction, levels_m=levels, cell_m=cell_m, terrain_m=terrain, axes=axes, place=place,
        chart=2 * medium.chart, fineness=fineness,
    )  # fmt: skip


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


def drawn_shape(scene: Scene, refine: bool) -> tuple[tuple[int, int, int], float]:
    """Nodes (nz, ny, nx) of what `build_medium` makes of a scene on the Earth, or a few more, and the width (m) of its
    cells; ``refine``: for sweeps."""
    grid, species = scene.grid, scene_optics(scene, REFERENCE_NM)
    assert grid is not None
    _, ny, nx = grid.shape
    terrain = np.zeros((1, 1), np.float32)
    if "surface_altitude" in scene.data:
        terrain = np.nan_to_num(scene.data["surface_altitude"].values.astype(np.float32))
    cell_m, cover = min(grid.spacing_m()), cloud_cover(scene) if species else None
    levels = _levels(grid.height_m, terrain, grid.curved)
    if refine:
        total = np.sum([s.extinction_per_m for s in species], axis=0) if species else None
        levels = _refined(levels, grid.height_m, total, cell_m, ny * nx, 1.0)
    if refine and scene.atmosphere is not None:
        levels = _with_air_above(levels)
    fineness = 1
    if refine or cover is not None:
        fineness = fineness_of((len(levels), ny, nx), cell_m, cover is not None, refine)
    return (len(levels), fineness * ny, fineness * nx), cell_m / fineness


def outside_ground_m(terrain: F32) -> float:
    """Height of the ground beyond the grid: the median along the edge, rounded to the metre."""
    edge = np.concatenate([terrain[0], terrain[-1], terrain[:, 0], terrain[:, -1]])
    return float(np.round(np.median(edge)))


def _levels(heights: NDArray, terrain: F32, extend: bool) -> F64:
    """Levels for a scene: its own where they are flat, else spaced like its layers at each height."""
    low = float(min(terrain.min(), heights.min()))
    if heights.ndim == 1:
        z = heights.astype(float)
        if extend and z[0] > low + 1.0:
            count = max(1, int(np.ceil((z[0] - low) / (1.5 * (z[1] - z[0])))))
            z = np.concatenate([np.linspace(low, z[0], count, endpoint=False), z])
        elif not extend and z[0] > 0.5:
            z = np.concatenate([[0.0, z[0] - min(1.0, 0.1 * z[0])], z])
        return z
    columns = heights.reshape(heights.shape[0], -1).astype(float)
    columns = columns[:, :: max(1, columns.shape[1] // 2000)]
    top = float(columns[-1].max())
    thickness = np.diff(columns, axis=0)
    middle = 0.5 * (columns[1:] + columns[:-1])
    # the finer tenth of the layers near each height decides, but no layer under 30 m
    probe = np.linspace(low, top, 200)
    local = np.empty(200)
    for n, z in enumerate(probe):
        row = np.abs(middle - z).argmin(axis=0)
        local[n] = np.percentile(thickness[row, np.arange(columns.shape[1])], 10)
    local = np.maximum(local, 30.0)
    count_at = np.concatenate([[0.0], np.cumsum(0.5 * (1 / local[1:] + 1 / local[:-1]) * np.diff(probe))])
    count = int(np.clip(np.ceil(count_at[-1]), 8, _MOST_LEVELS))
    return np.interp(np.linspace(0, count_at[-1], count + 1), count_at, probe)


def _refined(levels: F64, heights: NDArray, total: F32 | None, cell_m: float, columns: int, fineness: float) -> F64:
    """Divide layers that are taller than a cell is wide, or optically too thick (transport.md section 2).

    ``fineness``: share of the usual depth that a layer may have where cloud covers most columns: broken cloud is lit
    from its sides.
    """
    if total is None:
        return levels
    dz = np.diff(levels)
    parts = np.clip(np.ceil(dz / cell_m - 0.01), 1, 3)
    flat = total.reshape(total.shape[0], -1)
    own = heights if heights.ndim == 1 else heights.reshape(heights.shape[0], -1).mean(axis=1)
    cloudy = np.array([np.percentile(row[row > 0], 90) if (row > 0).any() else 0.0 for row in flat])
    covered = np.clip(4 * (flat > 0).any(axis=0).mean() - 2, 0.0, 1.0)
    beyond = 0.0 if heights.ndim == 1 else None  # below a model's lowest nodes on the mean lie those of its valleys
    middle = 0.5 * (levels[1:] + levels[:-1])
    scaled = _SCALED / (1 + (fineness - 1) * covered)
    depth = scaled * np.interp(middle, own, cloudy, left=beyond, right=beyond) * dz
    parts = np.maximum(parts, np.clip(np.ceil(depth / _CELL_DEPTH), 1, 16))
    # where spacing changes within cloud, sweeps make light or lose it: the layers beside are divided as finely
    in_cloud = depth > _CLOUDY_DEPTH
    beside = np.pad(np.where(in_cloud, dz / parts, np.inf), 1, constant_values=np.inf)
    beside = np.minimum(beside[:-2], beside[2:])
    parts = np.where(in_cloud, np.maximum(parts, np.ceil(dz / beside - 0.3)), parts)
    while parts.sum() > min(_MOST_LEVELS * 4, max(_MOST_NODES / columns, len(levels))) and parts.max() > 1:
        parts = np.maximum(1, np.ceil(parts * 0.75) - (parts > 1))
    pieces = [np.linspace(a, b, int(n), endpoint=False) for a, b, n in zip(levels[:-1], levels[1:], parts, strict=True)]
    return np.concatenate([*pieces, levels[-1:]])


def _with_air_above(levels: F64) -> F64:
    """Levels up to where little air is left, ever taller: what clouds light there is the grid's to know."""
    out, dz = list(levels), float(levels[-1] - levels[-2])
    while out[-1] < _AIR_TOP_M:
        dz = max(dz, min(_TALLER * dz, _TALLEST * out[-1], _TALLEST_M))
        out.append(out[-1] + dz)
    return np.array(out)


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
