"""Increments of an analysis in a copy of a WRF file: water on WRF's own levels, and vapour that goes with its cloud."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.base import Time, naming
from openswim.readers.common.opening import reading
from openswim.readers.fields.air import VAPOUR_RATIO, saturation_over_ice_pa, saturation_pa
from openswim.readers.wrf.file import MASS_LEVELS, WRFFile
from openswim.readers.wrf.grid import wrf_grid
from openswim.readers.wrf.particles import CATEGORIES
from openswim.readers.wrf.reader import air_of, check_complete
from openswim.scene import Grid
from openswim.scene.files import written_whole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

HUMIDITY_LEFT = 0.95  # of saturation, at most, where an analysis took all cloud away
NO_CLOUD = 1e-8  # kg/kg of liquid and ice, up to which a node has no cloud
_ROUNDING = 1e-6  # share of what was there, below which the rest is rounding of single precision
_SAME_PLACE = 0.01  # cells, by which columns may be off


def put_increments(
    path: Path, out: Path, grid: Grid, increments: Mapping[str, F64], time: Time = None
) -> dict[str, int]:
    """Copy a WRF file with increments added at one time; how many nodes of each variable changed.

    increments: by the names of scene variables, contents (kg m-3) and numbers (m-3), (nz, ny, nx) on ``grid``. They are
    linear in height between its levels, and nothing beyond. Temperature, pressure and all else stay.
    """
    with WRFFile(path) as file, naming(path), reading(path):
        check_complete(file)
        if "QVAPOR" not in file:
            raise UserError(f"{path}: has no QVAPOR, which must go with its cloud: keep it when cutting the file")
        file.go_to(time)
        here = wrf_grid(file, [])
        window = _window(grid, here, path)
        own = {name: _on_levels(field, grid, here, window) for name, field in increments.items() if field.any()}
        changed = _changed(file, own) if own else {}
        where = file.time_index
    counts = {name: int(np.count_nonzero(after != before)) for name, (before, after) in changed.items()}
    counts = {name: count for name, count in counts.items() if count}
    with written_whole(out) as partial:
        shutil.copyfile(path, partial)
        if counts:
            _write(partial, {name: changed[name][1] for name in counts}, where)
    return counts


def _write(path: Path, fields: Mapping[str, F32], time_index: int) -> None:
    import netCDF4

    with netCDF4.Dataset(path, "r+") as file:
        file.set_auto_maskandscale(False)
        for name, values in fields.items():
            variable = file.variables[name]
            variable[time_index if variable.dimensions[:1] == ("Time",) else ...] = values


def _window(grid: Grid, here: Grid, path: Path) -> tuple[slice, slice]:
    """Rows and columns of the file's grid that an analysis has; raises UserError where they are others."""
    out = []
    for own, whole in ((grid.y, here.y), (grid.x, here.x)):
        step = whole[1] - whole[0]
        start = int(np.rint((own[0] - whole[0]) / step))
        inside = 0 <= start <= whole.size - own.size
        off = np.abs(own - whole[start : start + own.size]).max() if inside else np.inf
        if grid.crs != here.crs or off > _SAME_PLACE * step:
            raise UserError(f"{path}: its columns are not those of the analysis: give the file that was analysed")
        out.append(slice(start, start + own.size))
    return out[0], out[1]


def _on_levels(field: F64, grid: Grid, here: Grid, window: tuple[slice, slice]) -> F64:
    """A field on a grid's nodes, on the file's: linear in height in each column, 0 beyond."""
    out = np.zeros(here.shape)
    target = np.asarray(here.height_m[(slice(None), *window)], float)
    height = np.broadcast_to(grid.height_m.reshape(len(field), *(grid.height_m.shape[1:] or (1, 1))), field.shape)
    if np.array_equal(height, target):
        out[(slice(None), *window)] = field
        return out
    part = np.empty(target.shape)
    for j, i in np.ndindex(target.shape[1:]):
        part[:, j, i] = np.interp(target[:, j, i], height[:, j, i], field[:, j, i], left=0.0, right=0.0)
    out[(slice(None), *window)] = part
    return out


def _changed(file: WRFFile, own: Mapping[str, F64]) -> dict[str, tuple[F32, F32]]:
    """The file's variables without and with increments on its own levels, by name."""
    levels, dry_density, _, _ = air_of(file, [])
    out: dict[str, tuple[F32, F32]] = {}
    before, after = {}, {}
    for species, categories in CATEGORIES.items():
        masses = [mass for mass, _, _ in categories if mass in file]
        more, number = own.get(f"{species}_content"), own.get(f"{species}_number")
        if not masses and (more is not None or number is not None):
            raise UserError(f"{file.path}: has no {categories[0][0]}, which the analysis changed")
        raw = [file.field(mass, MASS_LEVELS, "kg kg-1") for mass in masses]
        total = np.sum([np.maximum(each, 0.0) for each in raw], axis=0, dtype=float) if raw else np.zeros(1)
        before[species] = after[species] = total
        if more is not None:
            found = np.maximum(total + more / dry_density, 0.0)
            found = np.where(more == 0, total, np.where(found < _ROUNDING * total, 0.0, found))
            after[species] = found
            for n, (mass, each) in enumerate(zip(masses, raw, strict=True)):
                share = np.where(total > 0, np.maximum(each, 0.0) / np.where(total > 0, total, 1.0), float(n == 0))
                out[mass] = each, np.where(more == 0, each, found * share).astype(np.float32)
        if number is not None:
            name = _number_of(file, species)
            each = file.field(name, MASS_LEVELS, "kg-1")
            plus = np.maximum(each + number / dry_density, 0.0)
            out[name] = each, np.where(number == 0, each, plus).astype(np.float32)
    vapour = file.field("QVAPOR", MASS_LEVELS, "kg kg-1")
    pressure, temperature = (np.asarray(levels[f"air_{name}"], float) for name in ("pressure", "temperature"))
    out["QVAPOR"] = vapour, vapour_beside_cloud(vapour, pressure, temperature, before, after)
    return out


def _number_of(file: WRFFile, species: str) -> str:
    for _, numbers, _ in CATEGORIES[species]:
        for name in numbers:
            if name in file:
                return name
    raise UserError(f"{file.path}: has no number of {species}, which the analysis changed")


def vapour_beside_cloud(
    vapour: F32, pressure_pa: F64, temperature_k: F64, before: Mapping[str, F64], after: Mapping[str, F64]
) -> F32:
    """QVAPOR (kg/kg) that goes with liquid and ice (kg/kg) as they were before and are after.

    Where there is more liquid, saturated over water at least; where only ice is more, over ice. Where no cloud is left,
    `HUMIDITY_LEFT` of saturation at most, over the phase of which there had been more.
    """
    celsius: NDArray[Any] = temperature_k - 273.15
    over_water = saturation_pa(celsius)
    over_ice = np.where(celsius < 0, saturation_over_ice_pa(celsius), over_water)
    wetter = after["liquid"] > before["liquid"]
    icier = ~wetter & (after["ice"] > before["ice"])
    was, left = before["liquid"] + before["ice"], after["liquid"] + after["ice"]
    gone = (left < was) & (left <= NO_CLOUD) & ~wetter & ~icier
    least = np.where(wetter, over_water, np.where(icier, over_ice, 0.0))
    most = HUMIDITY_LEFT * np.where(before["liquid"] >= before["ice"], over_water, over_ice)
    out = np.where(wetter | icier, np.maximum(vapour, _mixing_ratio(least, pressure_pa)), vapour)
    return np.where(gone, np.minimum(out, _mixing_ratio(most, pressure_pa)), out).astype(np.float32)


def _mixing_ratio(vapour_pa: F64, pressure_pa: F64) -> F64:
    """Vapour over dry air, kg/kg; vapour has a fifth of the pressure at most."""
    held = np.minimum(vapour_pa, 0.2 * pressure_pa)
    return np.asarray(VAPOUR_RATIO * held / (pressure_pa - held))
