"""An analysis in a TOML file: the model, what was observed, and how it is looked for (docs/assimilation.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from openswim.arguments import check_keys, check_kind, number, shown, whole
from openswim.assimilation.background import Background
from openswim.assimilation.observing.images import in_units
from openswim.assimilation.settings import Settings
from openswim.cameras import Camera
from openswim.cameras.files import load_camera
from openswim.cameras.toml_text import read_toml
from openswim.errors import UserError
from openswim.readers.common.opening import opened, reading
from openswim.scene.times import parse_time
from openswim.system.inputs import check_ordinary, check_within

VERSION = 1
MOST_INSTRUMENTS = 1000
_LARGEST_IMAGE = 4_000_000  # numbers: a camera of 1000 x 1000 pixels in four channels
_TABLES: dict[str, tuple[str, ...]] = {
    "observe": ("wavelengths_nm", "controls", "quantity", "heights_m", "near_sun_deg", "lowest_deg", "floor_per_km",
                "tolerance", "lean", "wind"),
    "observations": ("noise", "irradiance_noise", "representation", "saturated"),
    "background": ("length_m", "height_m", "spread", "filter"),
    "analyse": ("transform", "outer", "iterations", "method", "departures", "signal"),
    "camera": ("file", "image", "time"),
    "pyranometer": ("lat", "lon", "x_m", "y_m", "w_m2", "time"),
}  # fmt: skip
_TOP = ("openswim_analysis", "model", "member", "time", "sun", "cover", *_TABLES)


@dataclass(frozen=True)
class Configuration:
    """All that such a file says. Keys of ``observe``, ``observations`` and ``analyse`` are arguments of functions of
    these names. cover: whether the model's cloud cover counts, which the linear core refuses.
    Points are (lat, lon) where they are ``points_on_earth``, else (y_m, x_m). Times of cameras and points are their
    own, or the file's; of a ``window`` there are several."""

    path: Path
    models: tuple[Path, ...]
    time: str | None
    sun: tuple[float, float] | None
    background: Background
    cameras: tuple[Camera, ...]
    camera_files: tuple[Path, ...]
    image_files: tuple[Path, ...]
    points: tuple[tuple[float, float], ...]
    w_m2: tuple[float, ...]
    camera_times: tuple[np.datetime64 | None, ...] = ()
    point_times: tuple[np.datetime64 | None, ...] = ()
    points_on_earth: tuple[bool, ...] = ()
    window: bool = False
    cover: bool = True
    member: int | None = None
    observe: dict[str, Any] = field(default_factory=dict)
    observations: dict[str, Any] = field(default_factory=dict)
    analyse: dict[str, Any] = field(default_factory=dict)

    def images(self) -> list[xr.Dataset]:
        """Of each camera what was seen: ``radiance`` (y, x, wavelength), W m-2 sr-1 nm-1."""
        return [_image(name) for name in self.image_files]

    @property
    def inputs(self) -> list[Path]:
        """All files that are read, this one too."""
        return [self.path, *self.models, *self.camera_files, *self.image_files]


def read_config(path: Path) -> Configuration:
    """Read and check; raises UserError. Files that it names lie in its own folder, or below it."""
    check_ordinary(path, "analysis")
    tables = read_toml(path, "an analysis")
    try:
        return _configuration(tables, path)
    except UserError as error:
        text = str(error)
        raise UserError(text if str(path) in text else f"{path}: {text}") from None


def _configuration(tables: dict[str, Any], path: Path) -> Configuration:
    check_keys(tables, _TOP, "the file")
    version = tables.get("openswim_analysis")
    if version != VERSION or isinstance(version, bool):
        raise UserError(f"openswim_analysis = {VERSION} is missing at its top: is this an analysis?")
    parts = {name: _table(tables, name) for name in ("observe", "observations", "background", "analyse")}
    listed = _entries(tables, "camera")
    files, images = (tuple(_file(entry, key, path) for entry in listed) for key in ("file", "image"))
    points, on_earth, watts = [], [], []
    for entry in _entries(tables, "pyranometer"):
        on_earth.append(not {"lat", "lon"}.isdisjoint(entry))
        if on_earth[-1] and not {"x_m", "y_m"}.isdisjoint(entry):
            raise UserError("[[pyranometer]]: give either lat and lon, or x_m and y_m")
        north, east = ("lat", "lon") if on_earth[-1] else ("y_m", "x_m")
        points.append((_number(entry, north, "pyranometer"), _number(entry, east, "pyranometer")))
        watts.append(_number(entry, "w_m2", "pyranometer"))
    if "length_m" not in parts["background"]:
        raise UserError("[background] length_m is missing: how far the errors of a first guess are alike")
    sun = tables.get("sun")
    if sun is not None:
        if not isinstance(sun, list) or len(sun) != 2:
            raise UserError("sun: give [azimuth, altitude] in degrees")
        sun = (number("sun", sun[0]), number("sun", sun[1]))
    Settings(**parts["analyse"])  # what is wrong there is told now
    for name, value in (("cover", tables.get("cover", True)), ("[observe] lean", parts["observe"].get("lean", False))):
        check_kind(name, value, bool, "write true or false")
    time = tables.get("time")
    own = _times(listed, "camera", time), _times(tables.get("pyranometer", []), "pyranometer", time)
    window = any("time" in each for each in (*listed, *tables.get("pyranometer", [])))
    if "wind" in parts["observe"] and not window:
        raise UserError("[observe] wind carries cloud from the file's time to that of a [[camera]], but none has one")
    return Configuration(
        path, _models(tables, path), None if time is None else str(time), sun, Background(**parts["background"]),
        tuple(load_camera(each, path.absolute().parent) for each in files), files, images, tuple(points), tuple(watts),
        *own, tuple(on_earth), window, tables.get("cover", True),
        None if "member" not in tables else whole("member", tables["member"]),
        parts["observe"], parts["observations"], parts["analyse"],
    )  # fmt: skip


def _times(entries: list[dict[str, Any]], name: str, time: Any) -> tuple[np.datetime64 | None, ...]:
    """Of each entry its own, or the file's; pictures of several are in the order in which they were taken."""
    if any("time" in each for each in entries) and time is None:
        raise UserError(f"[[{name}]] has a time: give the file one, too, of which the clouds are looked for")
    if time is None:
        return (None,) * len(entries)
    found = [when for each in entries if (when := parse_time(str(each.get("time", time)))) is not None]
    if any(one > other for one, other in pairwise(found)):
        raise UserError(f"[[{name}]]: put the earlier ones first; those without a time are of {time}")
    return tuple(found)


def _models(tables: dict[str, Any], path: Path) -> tuple[Path, ...]:
    """The model's file, or its files of one state."""
    given = tables.get("model")
    if not isinstance(given, list) or not given:
        return (_file(tables, "model", path),)
    if len(given) > MOST_INSTRUMENTS:
        raise UserError(f"model: {len(given)} files; {MOST_INSTRUMENTS} are the most")
    return tuple(_file({"model": each}, "model", path) for each in given)


def _table(tables: Mapping[str, Any], name: str) -> dict[str, Any]:
    found = tables.get(name, {})
    if not isinstance(found, dict):
        raise UserError(f"[{name}] is no table")
    check_keys(found, _TABLES[name], f"[{name}]")
    return dict(found)


def _entries(tables: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    found = tables.get(name, [])
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise UserError(f"write [[{name}]] for each {name}")
    if len(found) > MOST_INSTRUMENTS:
        raise UserError(f"[[{name}]]: {len(found)} of them; {MOST_INSTRUMENTS} are the most")
    for each in found:
        check_keys(each, _TABLES[name], f"[[{name}]]")
    return found


def _number(table: Mapping[str, Any], key: str, where: str) -> float:
    if key not in table:
        raise UserError(f"[[{where}]]: {key} is missing")
    return number(f"[[{where}]] {key}", table[key])


def _file(table: Mapping[str, Any], key: str, path: Path) -> Path:
    """A file in the folder of the configuration, or below it: what a stranger's file names can be no other."""
    given = table.get(key)
    if not isinstance(given, str) or not given:
        raise UserError(f"{key} is missing: name a file beside this one")
    folder = path.absolute().parent
    found = folder / given
    check_within(found, folder, f"{key} {shown(given)}", f"{folder}; copy the file into it")
    check_ordinary(found, key)
    return found


def _image(path: Path) -> xr.Dataset:
    with opened(path, decode=False) as file, reading(path, "give a picture as `openswim render -o ....nc` writes it"):
        if "radiance" not in file or set(file["radiance"].dims) != {"y", "x", "wavelength"}:
            raise UserError(f"{path}: has no radiance (y, x, wavelength), as `openswim render -o ....nc` writes it")
        if file["radiance"].size > _LARGEST_IMAGE:
            raise UserError(f"{path}: is larger than pictures of an analysis can be; average its pixels first")
        if any(file[name].dtype.kind not in "fiu" for name in ("radiance", "wavelength")):
            raise UserError(f"{path}: its radiance or wavelength are no numbers")
        return in_units(file[["radiance"]].load(), str(path))
