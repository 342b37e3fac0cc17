"""Domains of very many columns, seen from space: lit and seen part by part, so that memory does not grow with them.

Each part is the columns under some of the picture's rays, with as many more around as rays and sunlight slant through.
Its columns are solved by themselves (`columns.py`), and levels, species, air and suns are those of the whole domain: what
a ray sees does not depend on where parts end. docs/decisions/0013-large-domains.md.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr
from numba import njit
from numpy.typing import NDArray

from openswim.cameras.rays import Rays
from openswim.errors import UserError
from openswim.ground import hemispherical_albedo, surface_properties
from openswim.ground.relief import refined_terrain
from openswim.optics.cover import cloud_cover
from openswim.optics.species import OpticalSpecies, each_species
from openswim.progress import job
from openswim.scene.frame import scene_frame
from openswim.scene.grid import Grid
from openswim.scene.scene import Scene
from openswim.scene.variables import HYDROMETEORS, SURFACE_DIMS
from openswim.transport import swim
from openswim.transport.columns import Columns, top_light
from openswim.transport.field import PackField, View
from openswim.transport.grid_light import beams_and_shadows, coefficients_of, forward_tables, sunlit_volume
from openswim.transport.medium import Medium, air_of, chart_of, check_span, columns_on, outside_ground_m
from openswim.transport.pack import PACK
from openswim.transport.shells import build_shells, no_volume
from openswim.transport.surface import Lighting, clear_sky_table
from openswim.transport.threads import in_threads
from openswim.transport.volume import DEGREE

if TYPE_CHECKING:
    from openswim.transport.solver import Solver

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

LARGE_COLUMNS = 320_000
_PART_COLUMNS = 90_000
_MARGIN = 12  # columns of the ground's fields beyond a part, where what fades at their edge may fade
_MOST_SLANT = 96  # columns that light may come from the side
_LEAST_HEIGHT_M = 1e5  # of the eye
_SEEN_AT_M = 4000.0  # height at which rays are given to parts
_FINEST_M, _COARSEST_M, _FLATNESS = 100.0, 300.0, 0.1  # least distance of levels, and its share of a cell's width


def is_large(scene: Scene) -> bool:
    """Whether a scene has too many columns to be solved at once."""
    grid = scene.grid
    if grid is None or grid.periodic or not grid.curved:
        return False
    return grid.shape[1] * grid.shape[2] > LARGE_COLUMNS and cloud_cover(scene) is None


@njit(cache=True, error_model="numpy", nogil=True)
def _spread(t, threads, values, heights, levels, out):
    """Fields linear between heights (nz, ny, nx) on levels (n,) so that no column's sum changes: every level gets what
    lies around it, weighted by how near it is."""
    nz, ny, nx = values.shape
    n = levels.shape[0]
    for j in range(t, ny, threads):
        for i in range(nx):
            k = 0
            for s in range(-1, nz - 1):
                low_value, value = values[max(s, 0), j, i], values[s + 1, j, i]
                if low_value == 0.0 and value == 0.0:
                    continue
                a, b = (levels[0] if s < 0 else np.float64(heights[s, j, i])), np.float64(heights[s + 1, j, i])
                if b <= a:
                    continue
                while k > 0 and levels[k] > a:
                    k -= 1
                while k < n - 2 and levels[k + 1] <= a:
                    k += 1
                p = max(a, levels[0])
                slope = (value - low_value) / (b - a)
                while p < b and k < n - 1:
                    q = min(b, levels[k + 1])
                    if q > p:
                        step = levels[k + 1] - levels[k]
                        middle = 0.5 * (p + q)
                        f0, f1, f2 = low_value + slope * (p - a), low_value + slope * (middle - a), low_value + slope * (q - a)
                        u0, u1, u2 = (p - levels[k]) / step, (middle - levels[k]) / step, (q - levels[k]) / step
                        whole = (q - p) * (f0 + 4.0 * f1 + f2) / 6.0
                        upper = (q - p) * (f0 * u0 + 4.0 * f1 * u1 + f2 * u2) / 6.0
                        out[k, j, i] += whole - upper
                        out[k + 1, j, i] += upper
                    p = q
                    if p < b:
                        k += 1
                k = min(k, n - 2)
            for m in range(n):
                below, above = levels[max(m - 1, 0)], levels[min(m + 1, n - 1)]
                out[m, j, i] /= 0.5 * (above - below)


def spread_on_levels(values: F32, heights: NDArray, levels: F64) -> F32:
    """A field (nz, ny, nx) at heights (nz,) or (nz, ny, nx) on levels (n,): its columns hold what they held."""
    if heights.ndim == 1:
        heights = np.broadcast_to(heights.astype(np.float32)[:, None, None], values.shape)
    out = np.zeros((len(levels), *values.shape[1:]), np.float32)
    in_threads(_spread, values, heights, levels, out)
    return out


def large_levels(heights: NDArray, terrain: F32, cell_m: float, top_m: float) -> F64:
    """Levels (n,) as close as the model's on the whole, where that is not needlessly close for cells so wide."""
    columns = heights.reshape(len(heights), -1)
    columns = columns[:, :: max(1, columns.shape[1] // 2000)].astype(float)
    middle, thickness = 0.5 * (columns[1:] + columns[:-1]), np.diff(columns, axis=0)
    low = float(min(terrain.min(), columns[0].min()))
    least = np.clip(_FLATNESS * cell_m, _FINEST_M, _COARSEST_M)
    probe = np.linspace(low, top_m, 400)
    rows = np.array([np.abs(middle - z).argmin(axis=0) for z in probe])
    local = np.maximum(np.median(np.take_along_axis(thickness, rows, 0), axis=1), least)
    count_at = np.concatenate([[0.0], np.cumsum(0.5 * (1 / local[1:] + 1 / local[:-1]) * np.diff(probe))])
    count = max(8, int(np.ceil(count_at[-1])))
    return np.interp(np.linspace(0, count_at[-1], count + 1), count_at, probe)


def _cloud_top_m(scene: Scene, heights: NDArray) -> float:
    """Height of the level above all that is on levels."""
    last = 1
    for name, values in scene.data.data_vars.items():
        if values.ndim == 3 and (str(name).removesuffix("_content") in HYDROMETEORS or "extinction" in str(name)):
            filled = np.array([level.any() for level in values.transpose("z", "y", "x").values])
            last = max(last, int(np.flatnonzero(filled).max(initial=0)))
    top = heights[min(last + 1, len(heights) - 1)]
    return float(np.max(top))


def large_medium(scene: Scene, wavelengths_nm: F64) -> Medium:
    """The medium of a whole large domain, without axes and places of its columns (`part_of_medium` adds them)."""
    grid = scene.grid
    assert grid is not None
    check_span(grid)
    frame = scene_frame(scene)
    _, ny, nx = grid.shape
    terrain = np.zeros((ny, nx), np.float32)
    if "surface_altitude" in scene.data:
        terrain = np.nan_to_num(scene.data["surface_altitude"].values.astype(np.float32))
    terrain = refined_terrain(scene, terrain)
    heights = grid.height_m
    levels = large_levels(heights, terrain, min(grid.spacing_m()), _cloud_top_m(scene, heights))
    species: list[OpticalSpecies] = []
    fields: list[F32] = []
    nothing = np.zeros((0, 0, 0), np.float32)
    for one in each_species(scene, wavelengths_nm):
        fields.append(spread_on_levels(one.extinction_per_m, heights, levels))
        species.append(replace(one, extinction_per_m=nothing))
    thickness = np.gradient(levels)
    extinction = np.empty((len(fields), len(levels), ny, nx), np.float32)
    for n in range(len(fields)):
        extinction[n] = fields[n]
        fields[n] = nothing
    for k, z in enumerate(levels):
        extinction[:, k, z < terrain - 1.5 * thickness[k]] = 0
    ground_m = outside_ground_m(terrain)
    return Medium(
        frame, wavelengths_nm, species, extinction, levels, grid.spacing_m(), terrain,
        np.zeros((0, 0, 3, 3), np.float32), np.zeros((0, 0, 3)), False, *chart_of(grid, frame), ground_m,
        air_of(scene, wavelengths_nm, ground_m),
    )  # fmt: skip


class Window(NamedTuple):
    """Columns of a domain: x from ``west`` to before ``east``, y from ``south`` to before ``north``."""

    west: int
    east: int
    south: int
    north: int

    def grown(self, x: tuple[int, int], y: tuple[int, int], shape: tuple[int, ...]) -> Window:
        """With more columns below and above, as far as there are."""
        ny, nx = shape
        return Window(max(self.west - x[0], 0), min(self.east + x[1], nx), max(self.south - y[0], 0),
                      min(self.north + y[1], ny))  # fmt: skip

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.south, self.north), slice(self.west, self.east)


def part_of_medium(medium: Medium, grid: Grid, window: Window) -> Medium:
    """The columns of a window, in the whole's frame and on its levels."""
    rows, columns = window.slices
    axes, place = columns_on(grid, medium.frame, window.slices)
    return replace(
        medium, extinction=np.ascontiguousarray(medium.extinction[:, :, rows, columns]),
        terrain_m=np.ascontiguousarray(medium.terrain_m[rows, columns]), axes=axes, place=place,
        chart=medium.chart - np.array([window.west, window.south], float),
    )  # fmt: skip


def _ground_of(scene: Scene, window: Window) -> Scene:
    """What a scene has on the ground in a window."""
    grid = scene.grid
    assert grid is not None
    rows, columns = window.slices
    data = {str(n): v[rows, columns] if v.dims == SURFACE_DIMS else v.isel(y=rows, x=columns)
            for n, v in scene.data.data_vars.items() if "z" not in v.dims}  # fmt: skip
    part = Grid(grid.x[columns], grid.y[rows], np.array([0.0, 1.0]), grid.crs, grid.earth_radius_m)
    fields = xr.Dataset(data).drop_vars(["x", "y", "height"], errors="ignore")
    return Scene(part, fields, scene.atmosphere, {}, scene.time, scene.source, [], scene.ground)


@dataclass
class LargeField(PackField):
    """`PackField` of a large domain: light is solved anew for every view, part by part, and forgotten."""

    inflow: F32 = field(default_factory=lambda: np.zeros((0, 0, 2), np.float32))

    def view(self, rays: Rays) -> View:
        """See `Field.view`; for eyes in space."""
        started = time.perf_counter()
        n = len(rays)
        if self.frame.latlon(rays.origins()[0])[2] < _LEAST_HEIGHT_M:
            raise UserError(
                "a domain of so many columns is lit for eyes in space alone: open the part around the observer, "
                "open_scene(path, around=(lat, lon))"
            )
        self.space_shells = self._shells_for(rays)
        out = View(
            np.zeros((n, self.count), np.float32), np.zeros((n, self.count), np.float32), np.zeros(n, bool),
            np.full((n, 3), np.nan), np.zeros(n), np.zeros((n, max(len(self.whole.species), 1)), np.float32), 0,
        )  # fmt: skip
        with job("light and view", n) as meter:
            for window, which in self._parts(rays):
                part = self._part(window)
                seen = part.view(rays[which])
                out.samples += seen.samples
                for name in ("radiance", "transmittance", "hit", "position", "distance_m", "species_depth"):
                    getattr(out, name)[which] = getattr(seen, name)
                for name, seconds in part.timings.items():
                    self.timings[name] = self.timings.get(name, 0.0) + seconds
                meter.advance(len(which))
        self.timings["view"] = self.timings.get("view", 0.0)
        self.timings["whole"] = time.perf_counter() - started
        return out

    @property
    def whole(self) -> Medium:
        assert self.medium is not None
        return self.medium

    def _parts(self, rays: Rays) -> Iterator[tuple[Window, NDArray[np.int64]]]:
        """Windows of the domain, and the rays that each shows."""
        ix, iy = self._indices(rays)
        ny, nx = self.whole.shape[1:]
        cell = max(self.whole.cell_m)
        count = max(1, round(np.sqrt(_PART_COLUMNS)))
        across, up = max(1, round(nx / count)), max(1, round(ny / count))
        x_edges, y_edges = np.linspace(0, nx, across + 1).astype(int), np.linspace(0, ny, up + 1).astype(int)
        column = np.clip(np.searchsorted(x_edges, ix, "right") - 1, 0, across - 1)
        row = np.clip(np.searchsorted(y_edges, iy, "right") - 1, 0, up - 1)
        order = np.argsort(row * across + column, kind="stable")
        ends = np.searchsorted((row * across + column)[order], np.arange(across * up + 1))
        for n in range(across * up):
            which = order[ends[n] : ends[n + 1]]
            if which.size == 0:
                continue
            core = Window(x_edges[n % across], x_edges[n % across + 1], y_edges[n // across], y_edges[n // across + 1])
            yield core.grown(*self._slants(core, rays[which][:: max(1, which.size // 500)], cell), (ny, nx)), which

    def _indices(self, rays: Rays) -> tuple[F64, F64]:
        """Fractional columns where rays pass the height of clouds, or come nearest to it."""
        frame, grid = self.frame, self.scene.grid
        assert grid is not None
        ix, iy = np.empty(len(rays)), np.empty(len(rays))
        centre = np.array([0.0, 0.0, frame.radius_m])
        for a in range(0, len(rays), 200_000):
            some = slice(a, min(len(rays), a + 200_000))
            p, d = rays[some].origins() + centre, rays[some].directions()
            along = (p * d).sum(-1)
            reach = along**2 - (p * p).sum(-1) + (frame.radius_m + _SEEN_AT_M) ** 2
            place = p + (-along - np.sqrt(np.maximum(reach, 0)))[:, None] * d - centre
            lat, lon, _ = frame.latlon(place)
            x, y = grid.index(lon, lat)
            ix[some], iy[some] = (np.nan_to_num(v, nan=-1e6, posinf=1e6, neginf=-1e6) for v in (x, y))
        return ix, iy

    def _slants(self, core: Window, rays: Rays, cell: float) -> tuple[tuple[int, int], tuple[int, int]]:
        """Columns to the west and east, then south and north, that rays and the sun's beam pass beside their own."""
        grid = self.scene.grid
        assert grid is not None
        top = float(self.whole.levels_m[-1] - self.whole.levels_m[0])
        y, x = np.linspace(core.south, core.north - 1, 3).astype(int), np.linspace(core.west, core.east - 1, 3).astype(int)
        axes, place = columns_on(grid, self.frame, np.ix_(y, x))
        sun = np.einsum("jiab,b->jia", axes.astype(float), self.sun).reshape(-1, 3)
        eye = rays.origins()[0]
        back = eye - place.reshape(-1, 3)
        back = np.einsum("nab,nb->na", axes.astype(float).reshape(-1, 3, 3), back / np.linalg.norm(back, axis=-1, keepdims=True))
        found = []
        for axis in range(2):
            toward_sun = top * sun[:, axis] / np.maximum(sun[:, 2], 0.02) / cell
            sight = top * back[:, axis] / np.maximum(back[:, 2], 0.1) / cell  # the ray meets its column half-way up
            low = np.minimum(toward_sun, 0).min() - np.abs(sight).max()
            high = np.maximum(toward_sun, 0).max() + np.abs(sight).max()
            found.append((min(int(-low) + 3, _MOST_SLANT), min(int(high) + 3, _MOST_SLANT)))
        return found[0], found[1]

    def _part(self, window: Window) -> PackField:
        """The light of a window's columns."""
        started = time.perf_counter()
        grid, fast = self.scene.grid, self.solver.name == "fast"
        assert grid is not None
        medium = part_of_medium(self.whole, grid, window)
        wider = window.grown((_MARGIN, _MARGIN), (_MARGIN, _MARGIN), self.whole.shape[1:])
        ground = _ground_of(self.scene, wider)
        medium.first = (window.west - wider.west, window.south - wider.south)
        lighting = Lighting.of_grid(ground, medium)
        lighting.clear_sky = self.lighting.clear_sky
        lighting.place_sun(self.sun)
        local_sun = np.einsum("jiab,b->jia", medium.axes.astype(float), self.sun)
        coefficients = [coefficients_of(medium, self.shells, w, fast) for w in range(PACK)]
        timings = {"air": time.perf_counter() - started}
        started = time.perf_counter()
        volume, depths = sunlit_volume(medium, coefficients, local_sun, fast)
        light = beams_and_shadows(
            medium, lighting, self.shells, volume, depths, coefficients, local_sun, self.sun, self.count
        )
        timings["sun"] = time.perf_counter() - started
        part = PackField(
            self.solver, ground, self.frame, self.sun, self.wavelengths_nm, self.count, self.shells, volume, self.table,
            lighting, medium, timings,
        )  # fmt: skip
        part.light, part.reach_deg, part.space_shells = light, self.reach_deg, self.space_shells
        if fast:
            node = (medium.levels_m[:, None, None] < medium.terrain_m - 0.01).sum(axis=0)
            node = np.minimum(node, len(medium.levels_m) - 2).astype(np.int64)
            direct = np.stack([lighting.direct_horizontal(w) for w in range(self.count)])
            light.columns = Columns(
                medium, coefficients, node, local_sun, lighting.mu_sun, lighting.albedo, direct, self.inflow,
                lighting.diffuse, lighting.up_top, self.count,
            )  # fmt: skip
        else:
            swim.light_grid(light, volume, lighting, self.shells, local_sun, self.sun)
        return part


def solve_large(solver: Solver, scene: Scene, sun: F64, wl: F64, count: int, reach_deg: float) -> LargeField:
    """What all views and parts share: optics on levels, the clear air around."""
    started = time.perf_counter()
    medium = large_medium(scene, wl)
    grid, frame = scene.grid, medium.frame
    assert grid is not None
    _, ny, nx = grid.shape
    y, x = np.arange(0, ny, 8), np.arange(0, nx, 8)
    _, place = columns_on(grid, frame, np.ix_(y, x))
    lat, lon, _ = frame.latlon(place.reshape(-1, 3))
    albedo = hemispherical_albedo(surface_properties(scene, lat, lon, wl), wl)
    blank = np.zeros((PACK, 1, 1), np.float32)
    lighting = Lighting(medium.ground_m, albedo.mean(axis=0), blank, blank, blank, blank)
    reach = reach_deg + float(np.degrees(np.arccos(1 + place[..., 2].min() / frame.radius_m)))
    top = float(medium.levels_m[-1]) if medium.air is None else medium.ground_m + 1e5
    zenith = float(np.degrees(np.arccos(np.clip(sun[2], -1, 1))))
    suns = max(0.0, zenith - reach), min(110.0, zenith + reach)
    shells = build_shells(medium.air, suns, frame.radius_m, medium.ground_m, lighting.mean_albedo, DEGREE, top)
    lighting.clear_sky = clear_sky_table(shells, sun)
    table = forward_tables(medium, solver.name == "fast")
    return LargeField(
        solver, scene, frame, sun, wl, count, shells, no_volume(), table, lighting, medium,
        {"air": time.perf_counter() - started}, reach_deg=reach,
        inflow=top_light(shells, float(medium.levels_m[-1]), count),
    )  # fmt: skip
