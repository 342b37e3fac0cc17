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
from openswim.readers.fields.increments import added, check_plain, on_levels, put, vapour_beside_cloud, window
from openswim.readers.wrf.file import MASS_LEVELS, WRFFile
from openswim.readers.wrf.grid import wrf_grid
from openswim.readers.wrf.particles import CATEGORIES
from openswim.readers.wrf.reader import air_of, check_complete
from openswim.scene import Grid
from openswim.scene.files import written_whole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_WATER = ("QVAPOR", *(name for each in CATEGORIES.values() for mass, numbers, _ in each for name in (mass, *numbers)))


def put_increments(
    path: Path, out: Path, grid: Grid, increments: Mapping[str, F64], time: Time = None, member: int | None = None
) -> dict[str, int]:
    """Copy a WRF file with increments added at one time and member; how many nodes of each variable changed.

    increments: by the names of scene variables, contents (kg m-3) and numbers (m-3), (nz, ny, nx) on ``grid``. They are
    linear in height between its levels, and nothing beyond. Temperature, pressure and all else stay.
    """
    check_file(path)
    with WRFFile(path) as file, naming(path), reading(path):
        check_complete(file)
        file.choose(member, [])
        file.go_to(time)
        here = wrf_grid(file, [])
        part = window(grid, here, path)
        own = {name: on_levels(field, grid, here, part) for name, field in increments.items() if field.any()}
        changed = _changed(file, own) if own else {}
        where = {name: file.place(name) for name in changed}
    counts = {name: int(np.count_nonzero(after != before)) for name, (before, after) in changed.items()}
    counts = {name: count for name, count in counts.items() if count}
    with written_whole(out) as partial:
        shutil.copyfile(path, partial)
        if counts:
            _write(partial, {name: changed[name] for name in counts}, where)
    return counts


def check_file(path: Path) -> None:
    """Raise UserError where nothing could be put into the water of a WRF file."""
    if "QVAPOR" not in check_plain(path, _WATER):
        raise UserError(f"{path}: has no QVAPOR, which must go with its cloud: keep it when cutting the file")


def _write(path: Path, fields: Mapping[str, tuple[F32, F32]], where: Mapping[str, Any]) -> None:
    import netCDF4

    with netCDF4.Dataset(path, "r+") as file:
        file.set_auto_maskandscale(False)
        for name, (before, after) in fields.items():
            put(file.variables[name], where[name], before, after)


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
            found = after[species] = added(total, more / dry_density)
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
