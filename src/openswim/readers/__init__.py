"""Readers turn a model's file into a Scene. Each looks at the content of a file, never at its name."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from openswim.errors import UserError
from openswim.readers.base import Reader, SceneInfo, Time, unreadable

if TYPE_CHECKING:
    from openswim.ground import Ground
    from openswim.scene import Scene

__all__ = ["Reader", "SceneInfo", "describe", "open_scene", "readers"]

ENTRY_POINT_GROUP = "openswim.readers"


def open_scene(path: str | os.PathLike[str], time: Time = None, ground: Ground | None = None) -> Scene:
    """Open a model's file, or a scene saved in the layout of docs/scene-format.md (netCDF or Zarr).

    time : UTC; one of the file's times to within 1 s (default: its first).
    ground : your own maps of albedo and height, `openswim.Ground(albedo="tile.tif", height="dem.tif")`.
    """
    if ground is not None:
        ground.open()
    scene = _reader_of(Path(path)).read(Path(path), time)
    if ground is not None:
        scene.ground = ground
    return scene


def describe(path: str | os.PathLike[str]) -> SceneInfo:
    """What a file holds and what will be assumed; `print(describe(path))` is `openswim info path`."""
    return _reader_of(Path(path)).describe(Path(path))


@cache
def readers() -> tuple[Reader, ...]:
    """All readers: those of other packages (entry points "openswim.readers"), then the built-in ones."""
    from importlib.metadata import entry_points

    from openswim.readers.cf import CFReader
    from openswim.readers.wrf import WRFReader

    others: list[Reader] = []
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        made = entry.load()
        others.append(made() if isinstance(made, type) else made)
    return (*others, WRFReader(), CFReader())


def _reader_of(path: Path) -> Reader:
    if not path.exists():
        raise UserError(unreadable(path))
    for reader in readers():
        if reader.detects(path):
            return reader
    raise UserError(_why_unknown(path))


def _why_unknown(path: Path) -> str:
    from openswim.readers.base import open_netcdf

    if path.is_dir():
        return unreadable(path)
    names = ", ".join(reader.name for reader in readers())
    with open_netcdf(path) as file:  # raises where the file is damaged or something else
        found = ", ".join(list(file.variables)[:5]) or "no variables"
    return (
        f"{path}: no reader ({names}) knows this netCDF file, which holds {found} ...: give a WRF file, or "
        "write the layout of docs/scene-format.md"
    )
