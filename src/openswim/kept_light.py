"""Solved light on disk: a Zarr folder with the scene, what was asked of the solver, and the light in named arrays."""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import openswim
from openswim.arguments import check_kind, paths
from openswim.errors import UserError
from openswim.ground.surface import surface_of
from openswim.lights.daylight import Daylight
from openswim.optics.matter import matter_of
from openswim.progress import job
from openswim.scene import Ground, Scene
from openswim.scene.files import written_whole
from openswim.solver import Solver
from openswim.system.machine import free_memory
from openswim.system.workshops import sweep
from openswim.transport import Field, ReferenceField
from openswim.transport.lit.kept import described, restored
from openswim.transport.lit.lit_grid import LitGrid

KIND, VERSION = "openswim light", 9
_CHUNK = 1 << 23  # bytes of an array that are written together
_LONGEST_TEXT = 1 << 22  # characters of the description, more than any light has
_MOST_MEMORY = 0.8  # share of the memory that is free


class KeptLamp(NamedTuple):
    """A light of its own: what its solar-relative radiance counts (nw,), and that of the ground where it shines with
    1 nW cm-2 sr-1 (nw,), if it does."""

    name: str
    field: Field
    strength: np.ndarray
    towns: np.ndarray | None = None


def save_light(
    scene: Scene, field: Field | ReferenceField, daylight: Daylight, time: np.datetime64 | None,
    path: str | os.PathLike[str], lamps: Sequence[KeptLamp] = (),
) -> None:  # fmt: skip
    """Keep solved light as a Zarr folder, whole or not at all: see `LitScene.save`. ``lamps``: all, where it is not
    the whole sun's alone; ``field`` is the first's."""
    if not isinstance(field, Field):
        raise UserError(f"{path}: solver reference keeps no light, but follows paths for each view: use a checkpoint")
    if field.solver.name == "linear":
        raise UserError(f"{path}: solver linear keeps no light: save that of solver fast")
    if not all(isinstance(pack, LitGrid) for pack in field.packs):
        raise UserError(f"{path}: a domain of so many columns is lit anew for each view: save the light of a part")
    every = lamps or (KeptLamp("sun", field, np.ones(len(field.wavelengths_nm))),)
    found = [described(each.field.lit, each.name) for each in every]
    arrays = {name: array for each in found for name, array in each.arrays.items()}
    about = {
        "kind": KIND, "version": VERSION, "openswim": openswim.__version__, "fingerprint": fingerprint(scene),
        "options": asdict(field.solver), "wavelengths_nm": field.wavelengths_nm.tolist(),
        "daylight": asdict(daylight) | {"direction": daylight.direction.tolist()},
        "time": None if time is None else str(time),
        "cut": [level.cut for level in scene.levels], "ground": [_ground(level) for level in scene.levels],
        "drift_m": [level.drift_m for level in scene.levels], "whole_sun": not lamps,
        "lights": [
            {
                "name": one.name, "strength": one.strength.tolist(), "packs": own.levels,
                "towns": None if one.towns is None else one.towns.tolist(),
            }
            for one, own in zip(every, found, strict=True)
        ],
        "checksums": {name: _checksum(array) for name, array in arrays.items()},
    }  # fmt: skip
    about["checksum"] = checksum_of(about)
    import zarr

    with written_whole(path) as partial, job("light to disk", sum(a.nbytes for a in arrays.values())) as meter:
        root = zarr.open_group(str(partial), mode="w", zarr_format=2)
        root.attrs.put(about)
        for n, level in enumerate(scene.levels):
            level.to_dataset().to_zarr(str(partial), group=f"scene{n}", mode="w", zarr_format=2, consolidated=False)
        for name, array in arrays.items():
            first = max(1, _CHUNK // max(1, array[:1].nbytes)) if array.ndim else 1
            chunks = (min(first, max(1, array.shape[0])), *(max(1, n) for n in array.shape[1:])) if array.ndim else ()
            stored = root.create_array(
                f"arrays/{name}", shape=array.shape, dtype=array.dtype, chunks=chunks, compressors=None, filters=None
            )
            stored[...] = array
            meter.advance(array.nbytes)


def read_light(
    path: str | os.PathLike[str], scene: Scene | None
) -> tuple[Scene, list[KeptLamp], bool, Daylight, np.datetime64 | None]:
    """The scene, its lights, whether they are the whole sun's alone, the sun, the time: see `openswim.open_light`."""
    import zarr

    check_kind("light", path, (str, os.PathLike), "give the name of a folder that lit.save(...) has written")
    if not Path(path).is_dir():
        sweep(Path(path).parent)  # a folder whose writer died as it gave it its name
    if not Path(path).is_dir():
        raise UserError(f"{path}: no folder of kept light: give one that lit.save(...) has written")
    try:
        root = zarr.open_group(str(path), mode="r")
        about = dict(root.attrs)
    except Exception as error:  # whatever a damaged store has zarr raise
        raise UserError(f"{path}: no kept light can be read here ({_first_line(error)}): save it anew") from None
    if about.get("kind") != KIND:
        raise UserError(f"{path}: this is no kept light: give a folder that lit.save(...) has written")
    if about.get("version") != VERSION:
        raise UserError(
            f"{path}: kept light of layout {about.get('version')!r}, this OpenSWIm reads {VERSION}: solve and save anew"
        )
    try:
        return _read(path, root, about, scene)
    except UserError:
        raise
    except Exception as error:  # of whatever a changed file has arrays and classes raise
        raise UserError(f"{path}: kept light is damaged ({_first_line(error)}): solve and save anew") from None


def _read(
    path: str | os.PathLike[str], root: Any, about: dict[str, Any], scene: Scene | None
) -> tuple[Scene, list[KeptLamp], bool, Daylight, np.datetime64 | None]:
    if len(json.dumps(about)) > _LONGEST_TEXT:
        raise ValueError("its description is too long")
    if about.pop("checksum", None) != checksum_of(about):  # numbers in it reach kernels that trust them
        raise ValueError("its description is not what was saved")
    nbytes = sum(array.nbytes for _, array in root["arrays"].members(max_depth=None) if hasattr(array, "nbytes"))
    free = free_memory()
    if nbytes > _MOST_MEMORY * free:
        raise UserError(
            f"{path}: kept light of {nbytes / 1e9:.1f} GB does not fit into {free / 1e9:.1f} GB of free memory"
        )
    if scene is None:
        if any(ground and ground["maps"] for ground in about["ground"]):
            raise UserError(
                f"{path}: light over the user's own maps, which are not kept with it: give open_light(path, scene)"
            )
        scene = _scene(path, about)
    if fingerprint(scene) != about["fingerprint"]:
        raise UserError(f"{path}: kept light of another scene than this one: solve it anew, or give the scene it is of")
    solver = Solver(**about["options"])
    wavelengths = np.array(about["wavelengths_nm"], float)
    matter = matter_of(scene, wavelengths)
    surface = surface_of(scene, matter.wavelengths_nm)
    known: dict[str, np.ndarray] = {}
    with job("light from disk", nbytes) as meter:

        def array(name: str) -> np.ndarray:
            if name not in known:
                stored = root[f"arrays/{name}"]
                values = np.require(stored[...], requirements=["C", "W"])
                if _checksum(values) != about["checksums"][name]:  # of a lost piece zarr makes zeros
                    raise ValueError(f"{name} is not what was saved")
                known[name] = values
                meter.advance(values.nbytes)
            return known[name]

        lights = []
        for each in about["lights"]:
            of, ground = (matter.starlit(), surface) if each["name"] == "sky" else (matter, surface)
            if each["towns"] is not None:
                ground = replace(surface, lamps=np.array(each["towns"], float)[matter.terms.which])
            packs = restored(each["packs"], array, solver, of, ground)
            strength = np.array(each["strength"], float)
            if strength.shape != wavelengths.shape:
                raise ValueError("expected the strength of a light at all wavelengths")
            lights.append(KeptLamp(str(each["name"]), Field(packs, terms=matter.terms), strength))
    if not lights:
        raise ValueError("expected a light")
    day = dict(about["daylight"])
    daylight = Daylight(**day | {"direction": np.array(day["direction"], float)})
    time = None if about["time"] is None else np.datetime64(about["time"], "ms")
    return scene, lights, bool(about["whole_sun"]), daylight, time


def _scene(path: str | os.PathLike[str], about: dict[str, Any]) -> Scene:
    """The scene that was kept with the light, and the wider ones around it."""
    from openswim.readers import open_scene

    levels = [open_scene(Path(path) / f"scene{n}") for n in range(len(about["cut"]))]
    for n, level in enumerate(levels):
        ground = about["ground"][n]
        level.cut = bool(about["cut"][n])
        east, north = about["drift_m"][n] if "drift_m" in about else (0.0, 0.0)
        level.drift_m = float(east), float(north)
        level.ground = None if ground is None else Ground((), (), ground["chlorophyll_mg_m3"], ground["mountains"])
        level.wider = levels[n + 1] if n + 1 < len(levels) else None
    return levels[0]


def _ground(scene: Scene) -> dict[str, Any] | None:
    """What the user says of the ground, and how many maps there are, whose files are not named."""
    ground = scene.ground
    if ground is None:
        return None
    return {
        "chlorophyll_mg_m3": ground.chlorophyll_mg_m3, "mountains": ground.mountains,
        "maps": sum(len(paths(name, getattr(ground, name))) for name in ("albedo", "height", "lights")),
    }  # fmt: skip


def fingerprint(scene: Scene) -> str:
    """Of all of a scene that light depends on, the wider ones around it included."""
    found = hashlib.sha256()
    for level in scene.levels:
        data = level.to_dataset()
        for name in sorted(map(str, data.variables)):
            values = np.ascontiguousarray(data[name].values)
            found.update(f"{name} {data[name].dims} {values.dtype.str} ".encode() + values.tobytes())
        about = {k: v for k, v in data.attrs.items() if k not in ("history", "source", "assumptions", "title")}
        found.update(repr(sorted((str(k), str(v)) for k, v in about.items())).encode() + bytes([level.cut]))
        found.update(repr(_ground(level)).encode())
        if any(level.drift_m):
            found.update(repr(tuple(map(float, level.drift_m))).encode())
    return found.hexdigest()


def _checksum(array: np.ndarray) -> int:
    """CRC-32 of an array's bytes."""
    return zlib.crc32(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data if array.size else b"")


def checksum_of(about: dict[str, Any]) -> int:
    """CRC-32 of a description, as it is written."""
    return zlib.crc32(json.dumps(about, sort_keys=True).encode())


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
