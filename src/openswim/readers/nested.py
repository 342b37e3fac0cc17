"""Nested domains as one scene: each place from the finest grid that covers it, blended over the rims."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.optics.hydrometeors import effective_radius_m
from openswim.readers.neighbourhood import WIDER_SIDE, Mesh, Neighbourhood, Selection, extent_text, onto, part_of
from openswim.scene import Grid, Scene
from openswim.scene.levels import on_levels
from openswim.scene.variables import DIRECT_PREFIX, HYDROMETEORS, LEVEL_DIMS, SURFACE_DIMS

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MOST_LEVELS = 80
_SPACE_RADIUS_M = 1_330_000.0  # an eye 100 km up sees as far; from higher up one looks at domains, not around oneself
_MOST_WIDER, _RATIO = 3, 12.0  # wider grids at most, and how much wider than the one inside
_FARTHER = 1.25  # times its reach that makes another grid worth while
_ASIDE = 0.12  # of a domain, that its grid may reach beyond it
_HIGH = 0.8  # of the widest domain's top: a domain that needs none of its clouds above
_CORE_RIM = 0.08  # of a grid, at each side, in which a wider one is seen instead
_RIM_CELLS = 3.0  # of the next coarser grid, over which a finer one fades in
_RIM_SHARE, _TOP_SHARE = 0.15, 0.15  # of its width and height, at most


@dataclass
class _Laid:
    """A scene on the common grid: how to read it, its weight against all coarser ones, heights of its nodes."""

    scene: Scene
    part: Selection
    weight: F32  # (nz, ny, nx)
    heights: NDArray[Any]
    levels: F64

    def on_grid(self, name: str, values: Any = None) -> F32:
        field = self.scene.data[name].values if values is None else values
        taken = np.nan_to_num(self.part.take(np.asarray(field, np.float32)))
        return taken if taken.ndim == 2 else on_levels(taken, self.heights, self.levels, True)


def merged(scenes: Sequence[Scene], around: Neighbourhood | None) -> Scene:
    """One scene of several whose domains overlap, in cells of the finest around the eye (of the finest domain, seen
    from space), which lies in up to three wider ones of the same domains in coarser cells, as far as the eye sees.

    Contents, extinctions and cover are blended linearly across the rims and the top of each finer domain; effective
    radii so that extinction is. What a finer file lacks altogether comes from the coarser.
    """
    if any(scene.grid is None or scene.grid.crs is None for scene in scenes):
        raise UserError("nested domains need a place on Earth: give around=(latitude, longitude)")
    order = sorted(scenes, key=_cell_m)
    around = around or Neighbourhood(*order[0].place)
    over = [n for n, scene in enumerate(order) if _mesh(scene).covers(*_mesh(scene).index(around.lon, around.lat))]
    if over:
        order = order[: over[-1] + 1]
    elif not _from_space(around):
        raise UserError(f"the observer is outside all the domains: {extent_text(_mesh(order[-1]))}")
    beyond = [scene.levels[-1] for scene in order]
    reach = min(0.5 * _diagonal_m(beyond[-1]), max(around.radius_m, around.far_m))
    found = [_innermost([scene.alone() for scene in order], around, reach)]
    for scene in beyond:
        while (wider := _wider(beyond, scene, found, around, reach)) is not None:
            found.append(wider)
    found[0].notes += [f"beyond, {_size(scene)}" for scene in found[1:]]
    for inner, wider in pairwise(found):
        inner.wider = wider
    return found[0]


def _innermost(order: Sequence[Scene], around: Neighbourhood, reach: float) -> Scene:
    """The finest domain near an eye, or that an eye in space sees, and what lies around it."""
    for scene in order:
        cell = _cell_m(scene)
        if _from_space(around):
            place = replace(around, lat=scene.place[0], lon=scene.place[1])
            radius = (1 + 2 * _ASIDE) * _half_m(scene)
        else:
            place = around
            radius = min(around.radius_m, 0.5 * (around.most_side - 1) * cell)
        place = replace(place, radius_m=min(reach, radius))
        around_it = _target(order[-1], place, cell)
        if _meets(scene, around_it):
            break
    assert scene.grid is not None
    there = [one for one in order if _meets(one, around_it)]
    alike = reach <= _FARTHER * place.radius_m or scene.grid.earth_radius_m == around_it.earth_radius_m
    if alike and (len(there) == 1 or (_covers(scene, around_it) and _top_m(scene) > _HIGH * _top_m(order[-1]))):
        part = part_of(scene, place)
        return copy(part) if part is scene else part
    target = _target(order[-1], place, cell, order[order.index(scene) :])
    return _on_one_grid([one for one in order if _meets(one, target)], target, _levels(there))


def _wider(
    order: Sequence[Scene], scene: Scene, found: Sequence[Scene], around: Neighbourhood, reach: float
) -> Scene | None:
    """What of a domain reaches beyond the grids that there are, in its cells; at most `_RATIO` times as far as those
    where wider cells or broken clouds ask for it, unless it is the last grid."""
    last, before, cell = scene is order[-1], _half_m(found[-1]), _cell_m(scene)
    left = _MOST_WIDER - len(found)  # grids, after this one
    if reach < _FARTHER * before or left < (0 if last else 1):
        return None
    far = _RATIO * before
    if "cloud_area_fraction" not in scene.data or not last:
        far = max(far, 0.5 * (WIDER_SIDE - 1) * cell)
    far = reach if last and (left == 0 or _from_space(around)) else min(reach, far)
    place = replace(around, radius_m=far, most_side=WIDER_SIDE)
    if _from_space(around):
        lat, lon = scene.place
        place = Neighbourhood(lat, lon, min(far, _half_m(scene)), most_side=WIDER_SIDE)
        if last:  # the Earth below the eye, or the domain where it is but a part of that
            part = 0.5 * _diagonal_m(scene) < around.radius_m
            place = Neighbourhood(lat, lon, (1 + 2 * _ASIDE) * _half_m(scene)) if part else around
    target = _target(order[-1], place, cell, None if last else order[order.index(scene) :])
    if 0.5 * max(np.ptp(target.x), np.ptp(target.y)) < _FARTHER * before:
        return None
    there = [one for one in order if _meets(one, target)]
    return _on_one_grid(there, target, _levels(there[there.index(scene) :]))


def _on_one_grid(there: Sequence[Scene], target: Grid, levels: F64) -> Scene:
    """Domains, the finest first, on a common grid."""
    laid = []
    for finer, scene in enumerate(there):
        coarser = there[finer + 1] if finer + 1 < len(there) else None
        laid.append(_lay(scene, coarser, target, levels))
    laid.reverse()  # from the coarsest on
    fields = _fields(laid)
    surface = _surface(laid)
    data: dict[str, Any] = {name: (LEVEL_DIMS, values) for name, values in fields.items()}
    data |= {name: (SURFACE_DIMS, values) for name, values in surface.items()}
    optics = {name: value for one in laid for name, value in one.scene.optics.items()}
    optics = {name: value for name, value in optics.items() if name == "aerosol" or DIRECT_PREFIX + name in fields}
    if "aerosol_extinction" not in fields:
        optics.pop("aerosol", None)
    finest, coarsest = there[0], there[-1]
    grid = Grid(target.x, target.y, levels, target.crs, target.earth_radius_m)
    names = " in ".join(scene.source or "a scene" for scene in there)
    notes = [note for scene in there for note in scene.notes]
    out = Scene(grid, xr.Dataset(data), coarsest.atmosphere, optics, finest.time, names, list(dict.fromkeys(notes)))
    out.notes.append(f"nested domains on {_size(out)}: the finest at each place, blended over its rim")
    return out


def _size(scene: Scene) -> str:
    assert scene.grid is not None
    nz, ny, nx = scene.grid.shape
    cell = _cell_m(scene)
    return f"one grid of {f'{cell:.0f} m' if cell < 1e4 else f'{cell / 1e3:.0f} km'}, {nx} x {ny} x {nz}"


def _from_space(around: Neighbourhood) -> bool:
    return around.radius_m > _SPACE_RADIUS_M


def _top_m(scene: Scene) -> float:
    assert scene.grid is not None
    return float(np.mean(scene.grid.height_m[-1]))


def _half_m(scene: Scene) -> float:
    """Half of a scene's longer side."""
    assert scene.grid is not None
    _, ny, nx = scene.grid.shape
    dx, dy = scene.grid.spacing_m()
    return 0.5 * max(nx * dx, ny * dy)


def _cell_m(scene: Scene) -> float:
    assert scene.grid is not None
    return min(scene.grid.spacing_m())


def _diagonal_m(scene: Scene) -> float:
    assert scene.grid is not None
    dx, dy = scene.grid.spacing_m()
    return float(np.hypot(scene.grid.x.size * dx, scene.grid.y.size * dy))


def _mesh(scene: Scene) -> Mesh:
    grid = scene.grid
    assert grid is not None
    return Mesh(grid.x, grid.y, grid.crs, grid.earth_radius_m)


def _target(coarsest: Scene, place: Neighbourhood, cell_m: float, only: Sequence[Scene] | None = None) -> Grid:
    """An equal-area map around a place in cells of so many metres or wider ones, within the coarsest domain; where
    domains are given, of the first of them, up to where it fades into the second."""
    from pyproj import CRS

    assert coarsest.grid is not None
    step = max(cell_m, 2 * place.radius_m / (place.most_side - 1))
    count = 2 * max(2, int(np.ceil(place.radius_m / step - 1e-6))) + 1
    axis = step * (np.arange(count, dtype=np.float64) - count // 2)
    earth = coarsest.grid.earth_radius_m
    crs = CRS.from_proj4(f"+proj=laea +lat_0={place.lat} +lon_0={place.lon} +R={earth} +no_defs")
    x, y = (axis, axis) if only is None else _within(only, Grid(axis, axis, np.array([0.0, 1.0]), crs, earth))
    inside = _inside(coarsest, Grid(x, y, np.array([0.0, 1.0]), crs, earth))
    low, high = [0, 0], [y.size, x.size]
    while not (kept := inside[low[0] : high[0], low[1] : high[1]]).all():  # drop the side that sticks out most
        missing = [1 - kept[0].mean(), 1 - kept[-1].mean(), 1 - kept[:, 0].mean(), 1 - kept[:, -1].mean()]
        side = int(np.argmax(missing))
        (low if side % 2 == 0 else high)[side // 2] += 1 - 2 * (side % 2)
        if min(high[0] - low[0], high[1] - low[1]) < 2:
            raise UserError("the observer is at the edge of all the domains: choose a place farther inside")
    return Grid(x[low[1] : high[1]], y[low[0] : high[0]], np.array([0.0, 1.0]), crs, earth)


def _within(scenes: Sequence[Scene], target: Grid) -> tuple[F64, F64]:
    """The columns' x and y of a target that lie in the first scene's domain, about so that the core of the target
    (`transport.nested`) ends where the domain begins to fade into the next; where it has, if the next shows no fading.
    """
    lon, lat = _outline(scenes[0])
    kept = []
    for at, axis in zip(target.index(lon, lat), (target.x, target.y), strict=True):
        at = at[np.isfinite(at)]
        middle, half = 0.5 * (at.max() + at.min()), 0.5 * (at.max() - at.min())
        if len(scenes) > 1:
            rim = _rim_m(scenes[0], scenes[1])
            half = (half - (rim > 0.7 * _cell_m(scenes[1])) * rim / target.step[0]) / (1 - 2 * _CORE_RIM)
        first, last = (int(np.clip(v, 0, axis.size - 1)) for v in (middle - half, middle + half + 1))
        kept.append(axis[first : last + 1] if last >= first + 2 else axis)
    return kept[0], kept[1]


def _outline(scene: Scene) -> tuple[F64, F64]:
    """Longitudes and latitudes along the edge of a domain."""
    assert scene.grid is not None
    _, ny, nx = scene.grid.shape
    i, j = np.linspace(0, nx - 1, 50), np.linspace(0, ny - 1, 50)
    return scene.grid.lonlat(
        np.concatenate([i, i, 0 * j, 0 * j + nx - 1]), np.concatenate([0 * i, 0 * i + ny - 1, j, j])
    )


def _indices(scene: Scene, target: Grid) -> tuple[F64, F64]:
    i, j = np.meshgrid(np.arange(target.x.size, dtype=float), np.arange(target.y.size, dtype=float))
    ix, iy = _mesh(scene).index(*target.lonlat(i, j))
    return np.nan_to_num(ix, nan=-1e6, posinf=-1e6), np.nan_to_num(iy, nan=-1e6, posinf=-1e6)


def _inside(scene: Scene, target: Grid) -> NDArray[np.bool_]:
    return _mesh(scene).covers(*_indices(scene, target))


def _meets(scene: Scene, target: Grid) -> bool:
    return bool(_inside(scene, target).any())


def _covers(scene: Scene, target: Grid) -> bool:
    return bool(_inside(scene, target).all())


def _levels(scenes: Sequence[Scene]) -> F64:
    """Heights with the thinnest layers that any of the domains has there, at most `_MOST_LEVELS`."""
    thin: list[tuple[F64, F64]] = []
    low, top = np.inf, -np.inf
    for scene in scenes:
        assert scene.grid is not None
        heights = scene.grid.height_m
        columns = heights.reshape(heights.shape[0], -1).astype(float)
        columns = columns[:, :: max(1, columns.shape[1] // 500)]
        mean = columns.mean(axis=1)
        thin.append((0.5 * (mean[1:] + mean[:-1]), np.diff(mean)))
        low, top = min(low, float(columns.min())), max(top, float(columns.max()))
    low = min(low, *(float(s.data["surface_altitude"].min()) for s in scenes if "surface_altitude" in s.data), 1e9)
    probe = np.linspace(low, top, 2000)
    local = np.full(probe.size, np.inf)
    for middle, thickness in thin:
        within = (probe >= middle[0] - thickness[0]) & (probe <= middle[-1] + thickness[-1])
        local = np.where(within, np.minimum(local, np.interp(probe, middle, thickness)), local)
    local = np.where(np.isfinite(local), np.maximum(local, 20.0), (top - low) / 20)
    count_at = np.concatenate([[0.0], np.cumsum(0.5 * (1 / local[1:] + 1 / local[:-1]) * np.diff(probe))])
    count = int(np.clip(np.ceil(count_at[-1]), 8, _MOST_LEVELS))
    return np.interp(np.linspace(0, count_at[-1], count + 1), count_at, probe)


def _smoothstep(t: Any) -> F64:
    t = np.clip(t, 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


def _rim_m(scene: Scene, coarser: Scene) -> float:
    """Width of the rim over which a domain fades into a coarser one."""
    assert scene.grid is not None
    _, ny, nx = scene.grid.shape
    dx, dy = scene.grid.spacing_m()
    return min(_RIM_CELLS * _cell_m(coarser), _RIM_SHARE * min(nx * dx, ny * dy))


def _lay(scene: Scene, coarser: Scene | None, target: Grid, levels: F64) -> _Laid:
    grid = scene.grid
    assert grid is not None
    part = onto(_mesh(scene), target)
    if grid.height_m.ndim == 1:
        heights: NDArray[Any] = grid.height_m
    else:
        heights = part.take(grid.height_m)
        gap = np.isnan(heights)
        heights = np.where(gap, grid.height_m.mean(axis=(1, 2))[:, None, None], heights)
    weight = np.ones((levels.size, target.y.size, target.x.size), np.float32)
    if coarser is not None:
        ix, iy = _indices(scene, target)
        _, ny, nx = grid.shape
        dx, dy = grid.spacing_m()
        edge = np.minimum(np.minimum(ix, nx - 1 - ix) * dx, np.minimum(iy, ny - 1 - iy) * dy)
        rim = _rim_m(scene, coarser)
        top, low = heights[-1], heights[0]
        fade = _TOP_SHARE * np.maximum(top - low, 1.0)
        for k, z in enumerate(levels):
            weight[k] = _smoothstep(edge / rim) * _smoothstep((top - z) / fade)
    return _Laid(scene, part, weight, heights, levels)


def _blend(laid: Sequence[_Laid], fields: Sequence[F32 | None]) -> F32 | None:
    """From the coarsest on, each by its weight; a scene without the field leaves what is there."""
    out: F32 | None = None
    for one, field in zip(laid, fields, strict=True):
        if field is None:
            continue
        weight = one.weight if field.ndim == 3 else one.weight[0]
        out = weight * field if out is None else out + weight * (field - out)
    return out


def _fields(laid: Sequence[_Laid]) -> dict[str, F32]:
    names = {str(name) for one in laid for name, values in one.scene.data.data_vars.items() if values.ndim == 3}
    names = {n for n in names if tuple(next(o for o in laid if n in o.scene.data).scene.data[n].dims) == LEVEL_DIMS}
    out: dict[str, F32] = {}

    def each(name: str) -> list[F32 | None]:
        return [one.on_grid(name) if name in one.scene.data else None for one in laid]

    for name in sorted(names):
        if name.endswith("_content") or name == "aerosol_extinction" or name.startswith(DIRECT_PREFIX):
            found = _blend(laid, each(name))
            assert found is not None
            out[name] = found
    for kind in HYDROMETEORS:
        content = f"{kind}_content"
        if any(f"{kind}_{what}" in names for what in ("effective_radius", "number")) and content in names:
            out[f"{kind}_effective_radius"] = _radius(laid, kind, out[content])
    if "cloud_area_fraction" in names:
        # a domain without it has cells that are full or empty
        one_of = [
            one.on_grid("cloud_area_fraction") if "cloud_area_fraction" in one.scene.data else np.ones_like(one.weight)
            for one in laid
        ]
        cover = _blend(laid, one_of)
        assert cover is not None
        out["cloud_area_fraction"] = np.clip(cover, 0, 1)
    return out


def _radius(laid: Sequence[_Laid], kind: str, content: F32) -> F32:
    """Effective radii with which the blended content takes out as much light as the blended clouds: mean of c/r."""
    per_radius: list[F32 | None] = []
    for one in laid:
        data = one.scene.data
        if f"{kind}_content" not in data:
            per_radius.append(None)
            continue
        names = [f"{kind}_{what}" for what in ("effective_radius", "number")]
        own, number = (data[name].values if name in data else None for name in names)
        mass = data[f"{kind}_content"].values
        per_radius.append(one.on_grid("", mass / effective_radius_m(kind, mass, own, number)))
    total = _blend(laid, per_radius)
    assert total is not None
    return np.where(total > 0, content / np.maximum(total, 1e-30), 0).astype(np.float32)


def _surface(laid: Sequence[_Laid]) -> dict[str, F32]:
    """Fields on the ground that the coarsest domain has; terrain also where it has none."""
    out: dict[str, F32] = {}
    names = [str(n) for n, values in laid[0].scene.data.data_vars.items() if values.dims == SURFACE_DIMS]
    if any("surface_altitude" in one.scene.data for one in laid) and "surface_altitude" not in names:
        names.append("surface_altitude")
    for name in names:
        found = _blend(laid, [one.on_grid(name) if name in one.scene.data else None for one in laid])
        assert found is not None
        out[name] = found
    return out
