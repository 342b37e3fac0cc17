"""Increments of an analysis in copies of LAPS products: water on LAPS's own levels, and humidity that goes with it."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.base import Time, naming
from openswim.readers.common.opening import reading
from openswim.readers.fields.air import density_kg_m3
from openswim.readers.fields.increments import added, check_plain, on_levels, put, vapour_beside_cloud, window
from openswim.readers.models.laps import ON_LEVELS, LAPSReader
from openswim.scene import Grid, Scene
from openswim.scene.files import written_whole
from openswim.scene.times import since_1970_s

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

HUMIDITY = "sh"  # kg of vapour per kg of air
_CONTENTS = {scene_name: name for name, scene_name in ON_LEVELS.items() if scene_name.endswith("_content")}
_FILL = 1e36  # LAPS has 1e37 where there is nothing
_SAME_S = 1.0


def put_increments(
    paths: Sequence[Path], out: Path, grid: Grid, increments: Mapping[str, F64], time: Time = None
) -> dict[str, int]:
    """Copy the LAPS products of one time with increments added; how many nodes of each variable changed.

    increments: by the names of scene variables, contents (kg m-3), (nz, ny, nx) on ``grid``, linear in height between
    its levels and nothing beyond. out: a file where there is one product, else a folder. Where a file has no value,
    as below the ground, none is made; temperature, relative humidity, cloud fraction and all else stay.
    """
    check_files(paths)
    scene = LAPSReader().read_parts(paths, time)
    assert scene.grid is not None
    where = str(paths[0])
    part = window(grid, scene.grid, paths[0])
    own = {name: on_levels(field, grid, scene.grid, part) for name, field in increments.items() if field.any()}
    raw = {path: _fields(path, scene.time) for path in paths}
    held = {name: path for path, fields in raw.items() for name in fields}
    for name in own:
        if name not in _CONTENTS or _CONTENTS[name] not in held:
            raise UserError(f"{where}: has no {_CONTENTS.get(name, name)}, which the analysis changed")
    changed = _changed(scene, {name: raw[path][name] for name, path in held.items()}, own) if own else {}
    counts: dict[str, int] = {}
    targets = [out] if len(paths) == 1 else [out / path.name for path in paths]
    with ExitStack() as stack:  # all or none
        for path, target in zip(paths, targets, strict=True):
            partial = stack.enter_context(written_whole(target))
            shutil.copyfile(path, partial)
            mine = {name: values for name, values in changed.items() if held[name] == path}
            different = {name: int(np.count_nonzero(v != raw[path][name])) for name, v in mine.items()}
            counts |= {name: count for name, count in different.items() if count}
            _write(partial, {name: (raw[path][name], mine[name]) for name in counts if name in mine}, scene.time)
    return counts


def check_files(paths: Sequence[Path]) -> None:
    """Raise UserError where nothing could be put into the water of these LAPS products."""
    held = [check_plain(path, (*_CONTENTS.values(), HUMIDITY)) for path in paths]
    if not any(HUMIDITY in each for each in held):
        raise UserError(f"{paths[0]}: has no {HUMIDITY}, which must go with its cloud: give the lq3 product with it")


def _changed(scene: Scene, raw: Mapping[str, F32], own: Mapping[str, F64]) -> dict[str, F32]:
    """The files' variables with increments on their own levels, by name."""
    pressure, temperature = (np.asarray(scene.data[f"air_{n}"].values, float) for n in ("pressure", "temperature"))
    humidity, known = raw[HUMIDITY].astype(float), raw[HUMIDITY] < _FILL
    share = np.where(known, humidity, 0.0)
    dry = (1 - share) * density_kg_m3(pressure, temperature, share)
    out: dict[str, F32] = {}
    before, after = ({s: np.zeros(dry.shape) for s in ("liquid", "ice")} for _ in range(2))
    for scene_name, name in _CONTENTS.items():
        if name in raw:
            there = raw[name] < _FILL
            was = np.where(there, np.maximum(raw[name], 0.0), 0.0).astype(float)
            now = np.where(there, added(was, own[scene_name]), 0.0) if scene_name in own else was
            if scene_name in own:
                out[name] = np.where(there & (own[scene_name] != 0), now, raw[name]).astype(np.float32)
            species = scene_name.removesuffix("_content")
            before[species], after[species] = was / dry, now / dry
    ratio = share / (1 - share)
    found = vapour_beside_cloud(ratio.astype(np.float32), pressure, temperature, before, after).astype(float)
    moved = known & (found != ratio.astype(np.float32))
    out[HUMIDITY] = np.where(moved, found / (1 + found), raw[HUMIDITY]).astype(np.float32)
    return out


def _fields(path: Path, time: np.datetime64 | None) -> dict[str, F32]:
    """What the file has on levels of that which may change, (nz, ny, nx) upward as in a scene."""
    import netCDF4

    with netCDF4.Dataset(path) as file, naming(path), reading(path):
        file.set_auto_maskandscale(False)
        names = [name for name in (*_CONTENTS.values(), HUMIDITY) if name in file.variables]
        if not names or file.dimensions["z"].size < 2:
            return {}
        order, at = _upward(file), _record(file, time, path)
        return {name: _known(file[name], np.asarray(file[name][at], np.float32)[order]) for name in names}


def _known(variable: Any, values: F32) -> F32:
    """With LAPS's own sign for nothing where the file has another."""
    for name in {"_FillValue", "missing_value"} & set(variable.ncattrs()):
        values = np.where(values == np.float32(variable.getncattr(name)), np.float32(1e37), values)
    return values


def _write(path: Path, fields: Mapping[str, tuple[F32, F32]], time: np.datetime64 | None) -> None:
    import netCDF4

    if not fields:
        return
    with netCDF4.Dataset(path, "r+") as file:
        file.set_auto_maskandscale(False)
        order, at = _upward(file), _record(file, time, path)
        for name, (before, after) in fields.items():
            put(file[name], at, before, after, order)


def _upward(file: Any) -> NDArray[np.intp]:
    """The file's levels in the order of a scene's."""
    return np.unique(-np.asarray(file["level"][:], float), return_index=True)[1]


def _record(file: Any, time: np.datetime64 | None, path: Path) -> int:
    """Which of the file's records is of a time."""
    if file.dimensions["record"].size == 1 or time is None:
        return 0
    seconds = np.asarray(file["valtime"][:], float)
    off = np.abs(seconds - since_1970_s(time))
    if off.min() > _SAME_S:
        raise UserError(f"{path}: has nothing of {time}, the time of the analysis")
    return int(off.argmin())
