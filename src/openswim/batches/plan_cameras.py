"""The cameras of a plan: by their view and place, or in files of their own."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from openswim.arguments import check_keys, check_kind, shown
from openswim.batches.names import Names
from openswim.batches.values import check_name
from openswim.cameras import Camera
from openswim.cameras.files import load_camera
from openswim.cameras.views import VIEWS
from openswim.colour.picture import DATA, LIGHTS, PICTURES, check_bits
from openswim.errors import UserError

MOST_CAMERAS = 1000
SUFFIXES = PICTURES + LIGHTS + DATA
_PLACE = ("lat", "lon", "x_m", "y_m", "height_m")


@dataclass(frozen=True)
class PlannedCamera:
    """A camera, what its files are called after, and their suffixes."""

    name: str
    camera: Camera
    suffixes: tuple[str, ...]

    @cached_property
    def fingerprint(self) -> str:
        """Of all that its pictures depend on."""
        camera = self.camera
        found = hashlib.sha256(repr((self.name, camera, self.suffixes)).encode())
        if camera.given is not None or camera.lens_optics is not None:
            found.update(np.ascontiguousarray(camera.pixels().direction).tobytes())
        return found.hexdigest()


def planned_cameras(
    listed: Any, suffixes: Sequence[str], names: Names, bits: int = 8, as_data: bool = False
) -> tuple[PlannedCamera, ...]:
    """Of the tables [[camera]]. as_data: each keeps its data, whatever else it writes."""
    if not isinstance(listed, list) or not listed:
        raise UserError("has no camera: write a table [[camera]] for each")
    if len(listed) > MOST_CAMERAS:
        raise UserError(f"{len(listed)} tables [[camera]]; at most {MOST_CAMERAS}")
    found = []
    for count, table in enumerate(listed, 1):
        check_kind(f"[[camera]] {count}", table, dict, "write a table")
        name = check_name(f"[[camera]] {count} name", table.get("name"))
        what = f"[[camera]] {name}"
        own = _suffixes(table.get("outputs", list(suffixes)), what, bits)
        own += (".nc",) if as_data and ".nc" not in own else ()
        options = {key: value for key, value in table.items() if key not in ("name", "outputs")}
        try:
            found.append(PlannedCamera(name, _camera(options, what, names), own))
        except UserError as error:
            raise UserError(str(error) if what in str(error) else f"{what}: {error}") from None
    names_of = [each.name.lower() for each in found]  # on some disks files differ by more than capitals
    doubled = {each.name for each in found if names_of.count(each.name.lower()) > 1}
    if doubled:
        alike = "" if len(doubled) == 1 else f" and {max(doubled)}, which some disks take for the same name"
        raise UserError(f"two [[camera]] are called {min(doubled)}{alike}: files are called after them; rename one")
    return tuple(found)


def _suffixes(given: Any, what: str, bits: int) -> tuple[str, ...]:
    listed = given if isinstance(given, list) else [given]
    for each in listed:
        if each not in SUFFIXES:
            raise UserError(f"{what} outputs: {shown(each)} is unknown; use some of {', '.join(SUFFIXES)}")
        check_bits(Path(f"picture{each}"), bits)
    if ".exr" in listed:
        from openswim.colour.hdr import exr_library

        exr_library()
    if not listed:
        raise UserError(f"{what} outputs: give some of {', '.join(SUFFIXES)}")
    return tuple(dict.fromkeys(listed))


def _camera(options: dict[str, Any], what: str, names: Names) -> Camera:
    if "file" in options:
        check_kind(f"{what} file", options["file"], str, "give a file's name in quotes")
        check_keys(options, ("file", "size", *_PLACE), what)
        place, within = {key: options.get(key) for key in _PLACE}, None if names.anywhere else names.folder
        real = load_camera(names.beside(options["file"], f"{what} file"), within, **place)
        return real if "size" not in options else real.resized(options["size"])
    view = options.pop("view", "allsky")
    if not isinstance(view, str) or view not in VIEWS:
        raise UserError(f"{what} view is {shown(view)}: choose one of {', '.join(VIEWS)}, or give file")
    check_keys(options, VIEWS[view], f"{what} of view {view}")
    if view == "satellite" and not {"lat", "lon"} <= set(options):
        raise UserError(f"{what}: give lat and lon in degrees")
    if isinstance(options.get("altitude_range_deg"), list):
        options["altitude_range_deg"] = tuple(options["altitude_range_deg"])
    camera: Camera = getattr(Camera, view)(**options)
    return camera
