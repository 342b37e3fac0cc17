"""Whether a scene can be: air that weighs what air weighs, clouds and particles of their sizes, places on Earth.

Every scene passes here, whatever reader or program has made it. What no atmosphere has is refused, with the factor by
which it is off; what is odd is told in a note. `checks.py` looks at single values, field by field; here fields are
compared with each other and with heights.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.atmosphere import us_standard_pressure_temperature
from openswim.scene.grid import Grid
from openswim.scene.variables import HYDROMETEORS

_EARTHS_M = (6.2e6, 6.6e6)  # radii of planets that have the Earth's air
_GAS_CONSTANT, _GRAVITY = 287.05, 9.80665
_KNOWN_TO_M = 80_000.0  # up to here pressure is compared with the standard atmosphere
_SPREAD, _SPREAD_PER_M = 0.7, 1 / 40_000.0  # of ln(p/standard): a plateau called sea level; winter high above the poles
_WARMTH, _WARMTHS = (0.97, 1.04), (0.94, 1.07)  # of temperature to that of thickness: columns, layers; moist air 1.02
_ROUNDING = 2e-5  # of the largest pressure: that of files packed in 16 bits
_THIN_M, _HIGH_PA = 50.0, 2000.0  # thinner or higher layers tell no temperature
_LAYER_K, _COLUMN_K = (60.0, 1000.0), (150.0, 450.0)  # of layers and of columns, from thickness and pressures
_MOST_PATH_KG_M2 = 12.0  # of water in the mean of a domain; hurricanes have 5
_MOST_KG_M3 = {"liquid": 0.02, "ice": 0.03, "rain": 0.05, "snow": 0.05, "graupel": 0.08}  # 5 x known
_MOST_HAZE = 20.0  # optical depth of aerosol in the mean of a domain; the thickest dust storms and smoke have 5
_HAZES = ("aerosol_extinction", *(f"extinction_{name}" for name in
          ("black_carbon", "dust", "organic_matter", "sea_salt", "smoke", "sulphate")))  # fmt: skip
_HIGHEST_CLOUD_M = 20_000.0  # where the mean of all water may be, or the lowest level of a file with water
_BURIED_M = 500.0  # lowest levels higher than this above the ground are told
_DEEP_M = 2000.0  # thinner domains may have a pressure of their own: that of their dynamics
_WIDE = 4.0  # times as wide as tall
_SAMPLES = 64  # columns each way that stand for all where a mean is asked for
_RADII_M = {  # medians of species' effective radii
    "liquid": (0.5e-6, 100e-6), "ice": (0.5e-6, 1e-3), "rain": (5e-6, 1e-2), "snow": (5e-6, 5e-2),
    "graupel": (10e-6, 5e-2),
}  # fmt: skip
_SIZED_KG_M3 = 1e-7  # contents from which on a size matters
_FAINT_KG_M3 = 1e-7  # the most content of a species that is next to nothing


def check_plausible(data: xr.Dataset, grid: Grid | None) -> list[str]:
    """Notes on what is odd in a scene's fields (z, y, x); UserError where they cannot be."""
    if grid is None:
        return []
    notes = _places(grid)
    heights = _thinned(grid.height_m) if grid.height_m.ndim == 3 else grid.height_m[:, None, None]
    if _EARTHS_M[0] < grid.earth_radius_m < _EARTHS_M[1]:
        if "air_temperature" in data:
            _temperature(data["air_temperature"].values, grid.height_m)
        if "air_pressure" in data:
            pressure = data["air_pressure"].values
            _pressure(pressure, grid.height_m, heights)
            if "air_temperature" in data:
                notes += _warmth(pressure, data["air_temperature"].values, heights)
    terrain = data["surface_altitude"].values if "surface_altitude" in data else None
    return notes + _water(data, heights) + high_bottom(grid.height_m[0], terrain)


def times_text(factor: float) -> str:
    """ "1000 times too large", "100 times too small" of a factor that is near a power of ten; else ""."""
    power = round(float(np.log10(max(abs(factor), 1e-30))))
    return "" if power == 0 else f"{10.0 ** abs(power):g} times too {'large' if power > 0 else 'small'}"


def sampled(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Some columns of a field (..., y, x), spread evenly, for means."""
    return _thinned(field)


def _thinned(field: NDArray[np.float32]) -> NDArray[np.float32]:
    rows, columns = (max(1, size // _SAMPLES) for size in field.shape[-2:])
    return field[..., ::rows, ::columns]


def _places(grid: Grid) -> list[str]:
    """Cells of a shape that models have."""
    if not grid.curved:
        return []
    dx, dy = grid.step  # in degrees too: a model's cells are narrow only near the poles
    if not np.isfinite(grid.lonlat(*grid.centre_index)).all():
        raise UserError("grid: its centre is no place on Earth: correct the coordinates, or the projection")
    if max(dx / dy, dy / dx) <= _WIDE:
        return []
    units = "degrees" if grid.in_degrees else "m"
    return [f"cells of {dx:.3g} x {dy:.3g} {units}: are both coordinates in the same unit?"]


def _temperature(temperature: NDArray[np.float32], height_m: NDArray[np.float32]) -> None:
    """Colder than any mesopause, or warmer than the ground of a desert (higher up: less), is no air."""
    for level, height in zip(temperature, height_m, strict=True):
        low, high = float(np.min(height)), float(level.max())
        warmest = max(345.0 - 3e-3 * max(low, 0.0), 310.0)
        if low < _KNOWN_TO_M and not (high <= warmest and level.min() >= 110.0):
            raise UserError(
                f"scene: air_temperature runs from {level.min():.4g} to {high:.4g} K at {low:.0f} m; air has 110 to "
                f"{warmest:.0f} K there: is it in K, or a fill value?"
            )


def _pressure(pressure: NDArray[np.float32], height_m: NDArray[np.float32], heights: NDArray[np.float32]) -> None:
    """Near that of the standard atmosphere, falling with height, by as much as air of a sane temperature makes it."""
    for level, height in zip(pressure, height_m, strict=True):
        low, high = float(np.min(height)), float(np.max(height))
        if high > _KNOWN_TO_M:
            break
        most, least = us_standard_pressure_temperature(np.array([low, high]))[0]
        spread = np.exp(_SPREAD + _SPREAD_PER_M * max(high, 0.0))
        for found, expected in ((float(level.max()), most), (float(level.min()), least)):
            if not expected / spread < found < expected * spread:
                smell = times_text(found / expected)
                raise UserError(
                    f"scene: air_pressure is {found:.4g} Pa at {low:.0f} m, where air has about {expected:.4g} Pa"
                    f"{f', {smell}' if smell else ''}: is it in Pa, is it the whole pressure, and heights in metres?"
                )
    if not _falls(pressure):
        raise UserError("scene: air_pressure rises with height: levels out of order or upside down, or a damaged field")
    sample = np.maximum(_thinned(pressure), 1e-3)
    fall = np.log(sample[:-1] / sample[1:]).mean(axis=(1, 2), dtype=np.float64)
    thick = np.diff(heights, axis=0).mean(axis=(1, 2), dtype=np.float64)
    known = sample[1:].mean(axis=(1, 2)) > _HIGH_PA
    with np.errstate(divide="ignore"):
        layer = _GRAVITY * thick / (_GAS_CONSTANT * fall)
        column = float(_GRAVITY * thick.sum() / (_GAS_CONSTANT * fall.sum()))
    odd = known & (thick > _THIN_M) & ~((layer > _LAYER_K[0]) & (layer < _LAYER_K[1]))
    if thick.sum() > 2 * _THIN_M and not _COLUMN_K[0] < column < _COLUMN_K[1]:
        raise UserError(
            f"scene: pressures and heights of the levels fit together only if air had {column:.3g} K: are heights in "
            "metres, pressure in Pa?"
        )
    if odd.any():
        k = int(np.argmax(odd))
        raise UserError(
            f"scene: pressures and heights of levels {k + 1} and {k + 2} fit together only if air had {layer[k]:.3g} "
            "K: a repeated, lost or misplaced level, or a damaged field"
        )


def _warmth(pressure: NDArray[Any], temperature: NDArray[Any], heights: NDArray[Any]) -> list[str]:
    """A note where air would have to be warmer or colder to fill its layers; weather models agree within 2 %."""
    sample, warm = np.maximum(_thinned(pressure), 1e-3), _thinned(temperature)
    thick = np.diff(heights, axis=0).mean(axis=(1, 2), dtype=np.float64)
    known = (sample[1:].mean(axis=(1, 2)) > _HIGH_PA) & (thick > _THIN_M)
    if thick[known].sum() < _DEEP_M:
        return []
    fall = np.log(sample[:-1] / sample[1:]).mean(axis=(1, 2), dtype=np.float64)
    needed = _GRAVITY * thick[known] / _GAS_CONSTANT
    given = (fall * 0.5 * (warm[1:] + warm[:-1]).mean(axis=(1, 2), dtype=np.float64))[known]
    whole, layers = float(needed.sum() / given.sum()), needed / given
    if _WARMTH[0] < whole < _WARMTH[1] and _WARMTHS[0] < layers.min() and layers.max() < _WARMTHS[1]:
        return []
    odd = whole if not _WARMTH[0] < whole < _WARMTH[1] else layers[np.argmax(np.abs(layers - 1))]
    return [f"pressure, temperature and heights disagree: layers are as thick as those of air {odd:.3g} times as warm"]


def _falls(pressure: NDArray[np.float32]) -> bool:
    rounding = np.float32(_ROUNDING * pressure[0].max())
    return all(bool((above <= below + rounding).all()) for below, above in pairwise(pressure))


def _water(data: xr.Dataset, heights: NDArray[np.float32]) -> list[str]:
    """Clouds that weigh no more than clouds do, where clouds are, of particles of their sizes."""
    notes = []
    paths: dict[str, float] = {}
    raised = 0.0
    for species in HYDROMETEORS:
        name = f"{species}_content"
        if name not in data:
            continue
        content = _thinned(data[name].values)
        high = np.broadcast_to(heights, content.shape)
        paths[name] = float(np.trapezoid(content, high, axis=0).mean())
        raised += float(np.trapezoid(content * high, high, axis=0).mean())
        most = float(data[name].max())
        if most > _MOST_KG_M3[species]:
            raise UserError(
                f"scene: {name} is {most:.3g} kg m-3 at most; clouds have up to {_MOST_KG_M3[species] / 5:g}: is it in "
                "g/kg or g m-3 (1000 times too large)?"
            )
        if 0 < most < _FAINT_KG_M3 and species in ("liquid", "rain"):
            notes.append(f"{name} is {most:.2g} kg m-3 at most, next to nothing: is it in the unit that the file says?")
        notes += _sizes(data, species, content)
    hazes = [_thinned(data[name].values) for name in _HAZES if name in data]
    if hazes:
        haze = np.sum(hazes, axis=0)
        depth = float(np.trapezoid(haze, np.broadcast_to(heights, haze.shape), axis=0).mean())
        if depth > _MOST_HAZE:
            raise UserError(
                f"scene: aerosol has an optical depth of {depth:.3g} at 550 nm in the mean of the domain; the thickest "
                "dust storms have 5: is it in another unit (ug in place of kg, km-1 in place of m-1)?"
            )
    total = sum(paths.values())
    if total > _MOST_PATH_KG_M2:
        name = max(paths, key=lambda each: paths[each])
        raise UserError(
            f"scene: {total:.3g} kg m-2 of cloud and precipitation in the mean of the domain, {paths[name]:.3g} of it "
            f"{name}; hurricanes have 5: is it in g/kg or g m-3 (1000 times too large)?"
        )
    if paths and float(np.min(heights[0])) > _HIGHEST_CLOUD_M:
        raise UserError(
            f"scene: the lowest level lies at {np.min(heights[0]) / 1e3:.1f} km, above all clouds: is pressure in hPa "
            "(100 times too small), are heights in metres?"
        )
    if total > 0 and raised / total > _HIGHEST_CLOUD_M:
        raise UserError(
            f"scene: clouds lie at {raised / total / 1e3:.0f} km in the mean, above the troposphere: are heights in "
            "metres, and levels in order?"
        )
    return notes


def _sizes(data: xr.Dataset, species: str, content: NDArray[np.float32]) -> list[str]:
    """Radii of particles where there are any; where they are zero, a default stands in for them."""
    name = f"{species}_effective_radius"
    there = content > _SIZED_KG_M3
    if name not in data or not there.any():
        return []
    radius = _thinned(data[name].values)[there]
    known, (low, high) = radius[radius > 0], _RADII_M[species]
    middle = float(np.median(known)) if known.size else low
    if not low <= middle <= high:
        smell = times_text(middle / np.sqrt(low * high))
        raise UserError(
            f"scene: {name} is {middle:.3g} m in the median of its cloud; it must be {low:g} to {high:g} m, some "
            f"{smell}: is it in metres?"
        )
    lacking = 1 - known.size / radius.size
    return [f"{name} is zero in {100 * lacking:.0f} % of the cloud: default sizes there"] if lacking > 0.01 else []


def high_bottom(lowest_m: NDArray[Any], terrain_m: NDArray[Any] | None) -> list[str]:
    """A note on ground (ny, nx) far below the lowest level: what is between is missing."""
    where = "sea level" if terrain_m is None else "the ground"
    gap_m = float(np.median(lowest_m if terrain_m is None else lowest_m - terrain_m))
    told = f"the lowest level is {gap_m:.0f} m above {where}: nothing is known of what is between"
    return [told] if gap_m > _BURIED_M else []
