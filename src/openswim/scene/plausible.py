"""Whether a scene can be: air that weighs what air weighs, clouds and particles of their sizes, places on Earth.

Every scene passes here, whatever reader or program has made it. What no atmosphere has is refused, with the factor by
which it is off; what is odd is told in a note. `checks.py` looks at single values, field by field; here fields are
compared with each other and with heights.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.grid import Grid
from openswim.scene.oddities.damage import damaged_fields
from openswim.scene.oddities.neighbours import uneven_air
from openswim.scene.oddities.values import odd_clouds, odd_phases, odd_values
from openswim.scene.plausible_air import (
    check_pressure,
    check_temperature,
    pressure_of_sea_level,
    sampled,
    times_text,
    warmth,
)
from openswim.scene.variables import HYDROMETEORS

_EARTHS_M = (6.2e6, 6.6e6)  # radii of planets that have the Earth's air
_BURIED_M = 500.0  # lowest levels higher than this above the ground are told
_SUNK_M = 50.0
_WIDE = 4.0  # times as wide as tall
_SLAB = 4  # columns across: a model in two dimensions
# Of water in the mean of a domain: hurricanes have 5; rain and hail in the core of a storm, all that a narrow one
# holds, some tens
_MOST_PATH_KG_M2, _MOST_OF_A_CORE_KG_M2, _WIDE_M = 12.0, 100.0, 2e5
_SOME_KG_M2 = 1e-3  # of water, under which it may lie anywhere
_MOST_KG_M3 = {"liquid": 0.02, "ice": 0.03, "rain": 0.05, "snow": 0.05, "graupel": 0.08}  # 5 x known
_LEAST_HAZE, _HAZES_OF_ALL = 5e-4, 3  # the cleanest air, of the Antarctic, has 10 times as much; of so many species
_MOST_HAZE, _THICK_HAZE = 20.0, 3.0  # optical depth of aerosol, domain's mean; the thickest dust and smoke have 5
_HAZES = ("aerosol_extinction", *(f"extinction_{name}" for name in (
    "black_carbon", "dust", "fine_particles", "nitrate", "organic_matter", "sea_salt", "smoke", "sulphate",
)))  # fmt: skip
_HIGHEST_CLOUD_M = 20_000.0  # where the mean of all water may be, or the lowest level of a file with water
_RADII_M = {  # medians of species' effective radii
    "liquid": (0.5e-6, 100e-6), "ice": (0.5e-6, 1e-3), "rain": (5e-6, 1e-2), "snow": (5e-6, 5e-2),
    "graupel": (10e-6, 5e-2),
}  # fmt: skip
_BARE, _BARE_SHARE = 1e-3, 0.3  # cloud fractions that are none, and how much of the water may be there
_ROUNDED = 1e-6  # radii are kept in single precision
_SIZED_KG_M3 = 1e-7  # contents from which on a size matters


def check_plausible(data: xr.Dataset, grid: Grid | None) -> list[str]:
    """Notes on what is odd in a scene's fields (z, y, x); UserError where they cannot be."""
    if grid is None:
        return []
    notes = _places(grid)
    heights_m = grid.height_m if grid.height_m.ndim == 3 else grid.height_m[:, None, None]
    heights = sampled(grid.height_m) if grid.height_m.ndim == 3 else grid.height_m[:, None, None]
    if _EARTHS_M[0] < grid.earth_radius_m < _EARTHS_M[1]:
        if "air_temperature" in data:
            check_temperature(data["air_temperature"].values, grid.height_m)
            contents = {s: sampled(data[f"{s}_content"].values) for s in HYDROMETEORS if f"{s}_content" in data}
            temperature = sampled(data["air_temperature"].values)
            notes += odd_phases(temperature, contents)
            if "cloud_area_fraction" in data and data["cloud_area_fraction"].ndim == 3:
                notes += odd_clouds(temperature, sampled(data["cloud_area_fraction"].values), contents)
        if "air_pressure" in data:
            pressure = data["air_pressure"].values
            check_pressure(pressure, grid.height_m, heights)
            notes += pressure_of_sea_level(sampled(pressure[:1]), heights[:1])
            if "air_temperature" in data:
                notes += warmth(pressure, data["air_temperature"].values, heights)
                notes += uneven_air(pressure, data["air_temperature"].values, heights_m, max(grid.spacing_m()))
    terrain = data["surface_altitude"].values if "surface_altitude" in data else None
    notes += _water(data, heights, min(grid.size_m())) + odd_values(data, (grid.shape[1], grid.shape[2])) + _cover(data)
    notes += damaged_fields(data, max(grid.spacing_m()), grid.height_m)
    return notes + below_the_sea(terrain) + high_bottom(grid.height_m[0], terrain)


def _places(grid: Grid) -> list[str]:
    """Cells of a shape that models have."""
    dx, dy = grid.step  # in degrees too: a model's cells are narrow only near the poles
    if grid.curved and not np.isfinite(grid.lonlat(*grid.centre_index)).all():
        raise UserError("grid: its centre is no place on Earth: correct the coordinates, or the projection")
    slab = not grid.curved and min(grid.shape[1:]) < _SLAB  # whose width is anything
    if slab or max(dx / dy, dy / dx) <= _WIDE:
        return []
    units = "degrees" if grid.in_degrees else "m"
    return [f"cells of {dx:.3g} x {dy:.3g} {units}: are both coordinates in the same unit?"]


def high_bottom(lowest_m: NDArray[Any], terrain_m: NDArray[Any] | None) -> list[str]:
    """A note on ground (ny, nx) far below the lowest level: what is between is missing."""
    where = "sea level" if terrain_m is None else "the ground"
    gap_m = float(np.median(lowest_m if terrain_m is None else lowest_m - terrain_m))
    told = f"the lowest level is {gap_m:.0f} m above {where}: nothing is known of what is between"
    return [told] if gap_m > _BURIED_M else []


def below_the_sea(terrain_m: NDArray[Any] | None) -> list[str]:
    """A note on ground (ny, nx) that lies below sea level everywhere, as around the Dead Sea and hardly elsewhere."""
    if terrain_m is None or terrain_m.max() >= 0 or terrain_m.min() > -_SUNK_M:
        return []
    return [f"the ground lies {-terrain_m.max():.0f} to {-terrain_m.min():.0f} m below sea level: is its sign right?"]


def _water(data: xr.Dataset, heights: NDArray[np.float32], width_m: float) -> list[str]:
    """Clouds that weigh no more than clouds do, where clouds are, of particles of their sizes."""
    notes = []
    paths: dict[str, float] = {}
    raised = 0.0
    for species in HYDROMETEORS:
        name = f"{species}_content"
        if name not in data:
            continue
        content = sampled(data[name].values)
        high = np.broadcast_to(heights, content.shape)
        paths[name] = float(np.trapezoid(content, high, axis=0).mean())
        raised += float(np.trapezoid(content * high, high, axis=0).mean())
        most = float(data[name].max())
        if most > _MOST_KG_M3[species]:
            raise UserError(
                f"scene: {name} is {most:.3g} kg m-3 at most; clouds have up to {_MOST_KG_M3[species] / 5:g}: is it in "
                "g/kg or g m-3 (1000 times too large)?"
            )
        notes += _sizes(data, species, content)
    hazes = [sampled(data[name].values) for name in _HAZES if name in data]
    if hazes:
        haze = np.sum(hazes, axis=0)
        depth = float(np.trapezoid(haze, np.broadcast_to(heights, haze.shape), axis=0).mean())
        if depth > _MOST_HAZE:
            raise UserError(
                f"scene: aerosol has an optical depth of {depth:.3g} at 550 nm in the mean of the domain; the thickest "
                "dust storms have 5: is it in another unit (ug in place of kg, km-1 in place of m-1)?"
            )
        if depth > _THICK_HAZE:
            notes.append(f"aerosol has an optical depth of {depth:.2g} in the mean: a dust storm, or thick smoke?")
        if 0 < depth < _LEAST_HAZE and len(hazes) >= _HAZES_OF_ALL:
            notes.append(f"aerosol has an optical depth of {depth:.2g}, next to nothing: is it in the unit it says?")
    total = sum(paths.values())
    if total > _MOST_PATH_KG_M2:
        name = max(paths, key=lambda each: paths[each])
        told = (
            f"{total:.3g} kg m-2 of cloud and precipitation in the mean of the domain, {paths[name]:.3g} of it {name}; "
            "hurricanes have 5: is it in g/kg or g m-3 (1000 times too large)?"
        )
        cloud = max(paths.get(f"{species}_content", 0.0) for species in ("liquid", "ice"))
        if width_m > _WIDE_M or cloud > _MOST_PATH_KG_M2 or total > _MOST_OF_A_CORE_KG_M2:
            raise UserError(f"scene: {told}")
        notes.append(told)
    if total > 0 and float(np.min(heights[0])) > _HIGHEST_CLOUD_M:
        raise UserError(
            f"scene: the lowest level lies at {np.min(heights[0]) / 1e3:.1f} km, above all clouds: is pressure in hPa "
            "(100 times too small), are heights in metres?"
        )
    if total > _SOME_KG_M2 and raised / total > _HIGHEST_CLOUD_M:
        raise UserError(
            f"scene: clouds lie at {raised / total / 1e3:.0f} km in the mean, above the troposphere: are heights in "
            "metres, and levels in order?"
        )
    return notes


def _cover(data: xr.Dataset) -> list[str]:
    """A note on water where the cloud fraction knows no cloud: it is not seen there."""
    clouds = [sampled(data[name].values) for name in ("liquid_content", "ice_content") if name in data]
    if not clouds or "cloud_area_fraction" not in data or data["cloud_area_fraction"].ndim != 3:
        return []
    total = np.asarray(np.sum(clouds, axis=0, dtype=np.float64))
    bare = float(total[sampled(data["cloud_area_fraction"].values) < _BARE].sum())
    share = bare / max(float(total.sum()), 1e-30)
    told = f"the cloud fraction is zero where {100 * share:.0f} % of the cloud's water is: do they belong together?"
    return [told] if share > _BARE_SHARE else []


def _sizes(data: xr.Dataset, species: str, content: NDArray[np.float32]) -> list[str]:
    """Radii of particles where there are any; where they are zero, a default stands in for them."""
    name = f"{species}_effective_radius"
    there = content > _SIZED_KG_M3
    if name not in data or not there.any():
        return []
    radius = sampled(data[name].values)[there]
    known, (low, high) = radius[radius > 0], _RADII_M[species]
    middle = float(np.median(known)) if known.size else low
    if not low * (1 - _ROUNDED) <= middle <= high * (1 + _ROUNDED):
        smell = times_text(middle / np.sqrt(low * high))
        raise UserError(
            f"scene: {name} is {middle:.3g} m in the median of its cloud; it must be {low:g} to {high:g} m, some "
            f"{smell}: is it in metres?"
        )
    lacking = 1 - known.size / radius.size
    return [f"{name} is zero in {100 * lacking:.0f} % of the cloud: default sizes there"] if lacking > 0.01 else []
