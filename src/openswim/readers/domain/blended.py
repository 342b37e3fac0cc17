"""Domains that overlap on one common grid: each place from the finest that covers it, blended over the rims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.ground.fields import spectral
from openswim.optics.hydrometeors import effective_radius_m
from openswim.readers.common.base import labelled
from openswim.readers.domain.mesh import mesh_of
from openswim.readers.domain.selection import Selection, onto
from openswim.scene import Grid, Scene
from openswim.scene.checks import WAVELENGTH_DIM
from openswim.scene.interpolation import on_levels, smooth_step
from openswim.scene.rims import BEYOND_CELLS, rim_m
from openswim.scene.variables import DIRECT_PREFIX, HYDROMETEORS, LEVEL_DIMS, SURFACE_DIMS

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MOST_LEVELS = 80
_MOST_OF_GRID = 0.6  # that a domain covers which tells of the ground what the coarsest does not
_NONE_UNKNOWN = ("snow_area_fraction", "snow_depth", "sea_ice_area_fraction")  # none where no file knows of it
_TOP_SHARE = 0.15  # of a finer domain's height, over which it fades


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


def on_one_grid(there: Sequence[Scene], target: Grid, levels: F64) -> Scene:
    """Domains, the finest first, on a common grid."""
    laid = []
    for finer, scene in enumerate(there):
        coarser = there[finer + 1] if finer + 1 < len(there) else None
        laid.append(_lay(scene, coarser, target, levels))
    laid.reverse()  # from the coarsest on
    fields = _fields(laid)
    surface = _surface(laid)
    spectral = next((s.data[WAVELENGTH_DIM] for s in there if WAVELENGTH_DIM in s.data.dims), None)
    data = labelled(fields, surface)
    if spectral is not None:
        data["surface_albedo"] = ((*SURFACE_DIMS, WAVELENGTH_DIM), _spectral_albedo(laid, spectral.values))
        data = data.assign_coords({WAVELENGTH_DIM: spectral.values})
    optics = {name: value for one in laid for name, value in one.scene.optics.items()}
    optics = {name: value for name, value in optics.items() if name == "aerosol" or DIRECT_PREFIX + name in fields}
    if "aerosol_extinction" not in fields:
        optics.pop("aerosol", None)
    finest, coarsest = there[0], there[-1]
    grid = Grid(target.x, target.y, levels, target.crs, target.earth_radius_m)
    names = " in ".join(scene.source or "a scene" for scene in there)
    notes = [note for scene in there for note in scene.notes]
    out = Scene(grid, data, coarsest.atmosphere, optics, finest.time, names, list(dict.fromkeys(notes)))
    out.notes.append(f"nested domains on {size_text(out)}: the finest at each place, blended over its rim")
    return out


def cell_m(scene: Scene) -> float:
    assert scene.grid is not None
    return min(scene.grid.spacing_m())


def width_m(scene: Scene) -> float:
    """The shorter side of a domain."""
    assert scene.grid is not None
    return min(scene.grid.size_m())


def size_text(scene: Scene) -> str:
    assert scene.grid is not None
    nz, ny, nx = scene.grid.shape
    cell = cell_m(scene)
    return f"one grid of {f'{cell:.0f} m' if cell < 1e4 else f'{cell / 1e3:.0f} km'}, {nx} x {ny} x {nz}"


def levels_of(scenes: Sequence[Scene]) -> F64:
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


def _lay(scene: Scene, coarser: Scene | None, target: Grid, levels: F64) -> _Laid:
    grid = scene.grid
    assert grid is not None
    part = onto(mesh_of(scene), target)
    if grid.height_m.ndim == 1:
        heights: NDArray[Any] = grid.height_m
    else:
        heights = part.take(grid.height_m)
        gap = np.isnan(heights)
        heights = np.where(gap, grid.height_m.mean(axis=(1, 2))[:, None, None], heights)
    weight = np.ones((levels.size, target.y.size, target.x.size), np.float32)
    if coarser is not None:
        ix, iy = mesh_of(scene).index_of(target)
        _, ny, nx = grid.shape
        dx, dy = grid.spacing_m()
        edge = np.minimum(np.minimum(ix, nx - 1 - ix) * dx, np.minimum(iy, ny - 1 - iy) * dy)
        rim = rim_m(cell_m(coarser), width_m(scene))
        top, low = heights[-1], heights[0]
        fade = _TOP_SHARE * np.maximum(top - low, 1.0)
        for k, z in enumerate(levels):
            weight[k] = smooth_step(edge / rim) * smooth_step((top - z) / fade)
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


def _spectral_albedo(laid: Sequence[_Laid], wavelengths_nm: F64) -> F32:
    """Albedo (ny, nx, nw) where a domain has it by wavelength; of one that has it not so, the same at each."""
    fields = [one.scene.data.get("surface_albedo") for one in laid]
    spectra = [None if field is None else spectral(field, wavelengths_nm) for field in fields]
    found = []
    for w in range(wavelengths_nm.size):
        each = [None if own is None else one.on_grid("", own[..., w]) for one, own in zip(laid, spectra, strict=True)]
        found.append(_blend(laid, each))
    return np.stack([one for one in found if one is not None], axis=-1)


def _surface(laid: Sequence[_Laid]) -> dict[str, F32]:
    """Fields on the ground that the coarsest domain has, or one that covers most of the grid; terrain in any case."""
    out: dict[str, F32] = {}
    names: list[str] = []
    for one in laid:
        if one is laid[0] or (one.weight[0] > 0).mean() > _MOST_OF_GRID:
            own = [str(n) for n, values in one.scene.data.data_vars.items() if values.dims == SURFACE_DIMS]
            names += [name for name in own if name not in names]
    if any(WAVELENGTH_DIM in one.scene.data.dims for one in laid) and "surface_albedo" in names:
        names.remove("surface_albedo")
    for name in ("surface_altitude", *_NONE_UNKNOWN):
        if name not in names and any(name in one.scene.data for one in laid):
            names.append(name)
    for name in names:
        fields = [one.on_grid(name) if name in one.scene.data else None for one in laid]
        if fields[0] is None and name != "surface_altitude":
            fields[0] = _spread(next(one for one in reversed(laid) if name in one.scene.data), name)
        found = _blend(laid, fields)
        assert found is not None
        out[name] = found
    return out


def _spread(one: _Laid, name: str) -> F32:
    """A field on the ground, beyond its domain that of the nearest place in it; of snow and ice less and less."""
    from scipy.ndimage import distance_transform_edt

    field = one.part.take(np.asarray(one.scene.data[name].values, np.float32))
    away, nearest = distance_transform_edt(np.isnan(field) | (one.weight[0] <= 0), return_indices=True)
    held = np.nan_to_num(field[tuple(nearest)])
    if name in _NONE_UNKNOWN:
        cells = away * float(one.part.x[1] - one.part.x[0]) / cell_m(one.scene)
        held = held * np.exp(-((cells / BEYOND_CELLS) ** 2))
    return np.asarray(held, np.float32)
