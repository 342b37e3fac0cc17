"""The documented scene layout (docs/scene-format.md), netCDF or Zarr: the way in for any model."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.cf.fields import atmosphere_of, fields_of, high_bottom, is_layer, lost_fields, misspelt, optics_of
from openswim.readers.cf.grid import grid_of, upright
from openswim.readers.common.base import (
    SceneInfo,
    Time,
    iso,
    naming,
    pick_time,
)
from openswim.readers.common.bounds import check_size
from openswim.readers.common.members import MEMBER_DIMS, check_ensemble, member_index, member_numbers
from openswim.readers.common.opening import opened, opened_part, outlined, reading
from openswim.readers.common.pieces import check_clock, lost_pieces
from openswim.readers.fields.absent import no_ground, no_sizes, no_species
from openswim.scene import Grid, Scene
from openswim.scene.cf import GRID_MAPPING, LAYOUT, PROFILES, VAPOUR_PROFILE
from openswim.scene.times import parse_time, rounded
from openswim.scene.variables import HYDROMETEORS, LEVEL_DIMS, VARIABLES, is_known, species_of

_HELPERS = {
    "x",
    "y",
    "height",
    "lon",
    "lat",
    "latitude",
    "longitude",
    "time",
    "wavelength",
    GRID_MAPPING,
    *PROFILES,
    VAPOUR_PROFILE,
    *MEMBER_DIMS,
}
_NOT_THE_LAYOUT = "damaged, or not as docs/scene-format.md describes"


class CFReader:
    """Reads files written in the documented layout, by this program or any other."""

    name = "scene layout"

    def detects(self, path: Path) -> bool:
        """True for files that say so, and for those with dimensions z, y, x and a variable of the layout."""
        try:
            with outlined(path) as file:
                on_levels = set(LEVEL_DIMS) <= file.dims
                return "openswim_layout" in file.attrs or (on_levels and any(map(is_known, file.variables)))
        except UserError:
            return False

    def read(self, path: Path, time: Time = None, member: int | None = None) -> Scene:
        """The scene at one time of the file (default: its first), of one member; only that is read."""
        with naming(path), _opened(path) as whole:
            data, valid = _at_time(path, whole, time)
            chosen: list[str] = []
            data = _of_member(path, data, member, chosen)
            for name in data.variables:
                check_size(path, str(name), data[name].shape)
            notes = [line for line in str(data.attrs.get("assumptions", "")).split("\n") if line] + chosen
            notes += _lost_times(whole, time)
            with reading(path, _NOT_THE_LAYOUT):
                data = upright(data)
                grid = grid_of(data, notes)
                fields = fields_of(data, grid, notes)
                atmosphere = atmosphere_of(data, notes)
                optics = optics_of(data)
            if "openswim_layout" not in data.attrs:
                notes += no_species(fields) + no_sizes(fields) + no_ground(fields)
            at = {} if valid is None or "time" not in whole.dims else {"time": pick_time(path, _times(whole), time)}
            notes += lost_pieces(path, whole, [name for name in map(str, fields.data_vars)], at)
            if valid is not None and "time" in whole.variables:
                notes += check_clock(path, whole, "time", valid)
            unused = [
                name
                for name in map(str, data.variables)
                if not (is_known(name) or is_layer(name) or name in _HELPERS)
            ]
            if unused:
                notes.append(f"variables not used: {', '.join(unused)}")
            notes += lost_fields(data) + misspelt(data)
            source = str(data.attrs.get("source", path.name))
            return Scene(grid, fields, atmosphere, optics, valid, source, notes)

    def grid(self, path: Path, time: Time = None) -> Grid | None:
        """The grid at one time; None for a clear sky."""
        with naming(path), _opened(path) as whole, reading(path, _NOT_THE_LAYOUT):
            return grid_of(upright(_of_member(path, _at_time(path, whole, time)[0], None, [])), [])

    def times(self, path: Path) -> list[np.datetime64]:
        """Those that are known, in the file's order."""
        with naming(path), opened_part(path, ["time"]) as data, reading(path, _NOT_THE_LAYOUT):
            _check_layout(path, data)
            times = _times(data)
            return list(times[~np.isnat(times)])

    def members(self, path: Path) -> set[int]:
        """Of an ensemble, by their own numbers."""
        with _opened(path) as whole:
            return member_numbers(path, whole)

    def describe(self, path: Path) -> SceneInfo:
        """Grid, times and contents, from the header, the coordinates and the heights of the first time."""
        with naming(path), _opened(path) as whole:
            times = _times(whole)
            chosen: list[str] = []
            data = upright(_of_member(path, _at_time(path, whole, None)[0], None, chosen))
            notes = [line for line in str(data.attrs.get("assumptions", "")).split("\n") if line] + chosen
            with reading(path, _NOT_THE_LAYOUT):
                grid = grid_of(data, notes)
                atmosphere_of(data, notes)
                optics_of(data)
            names = [str(name) for name in data.data_vars if is_known(str(name))]
            expected = [f"{species}_content" for species in HYDROMETEORS] + [
                "air_pressure",
                "air_temperature",
            ]
            expected += [name for name, entry in VARIABLES.items() if "z" not in entry.dims]
            if "openswim_layout" not in data.attrs:
                notes += no_species(data) + no_sizes(data) + no_ground(data) + high_bottom(data, grid)
            notes += lost_fields(data) + misspelt(data)
            return SceneInfo.on(
                grid,
                path=str(path),
                model=str(data.attrs.get("source", "scene layout")),
                times=[iso(moment) for moment in times[~np.isnat(times)]],
                species=species_of(names),
                surface=[name for name in names if "z" not in data[name].dims],
                missing=[name for name in expected if name not in names],
                assumed=notes,
            )


@contextmanager
def _opened(path: Path) -> Iterator[xr.Dataset]:
    """The file as a lazy dataset; missing values become NaN, times datetime64."""
    with opened(path) as data:
        _check_layout(path, data)
        for name, variable in data.variables.items():
            if variable.dtype.kind in "OSUT" and _holds_numbers(str(name)):
                raise UserError(f"{path}: {name} holds text: write it as numbers, as docs/scene-format.md describes")
        # an attribute "coordinates" may name fields; they are fields all the same
        yield data.reset_coords([name for name in data.coords if name not in data.dims and is_known(str(name))])


def _check_layout(path: Path, data: xr.Dataset) -> None:
    layout = data.attrs.get("openswim_layout", LAYOUT)
    try:
        known = int(layout) <= LAYOUT
    except (TypeError, ValueError):
        raise UserError(f"{path}: openswim_layout is {str(layout)[:20]!r}, not a number: damaged file") from None
    if not known:
        raise UserError(f"{path}: scene layout {layout} is newer than this program's ({LAYOUT}): upgrade it")


def _holds_numbers(name: str) -> bool:
    return is_known(name) or name in {"x", "y", "height", "wavelength", VAPOUR_PROFILE, *PROFILES}


def _times(data: xr.Dataset) -> NDArray[np.datetime64]:
    if "time" not in data.variables:
        return np.array([], dtype="datetime64[ms]")
    values = np.atleast_1d(data["time"].values)
    if values.dtype.kind != "M":
        raise UserError(
            'time is not a date: give it units such as "seconds since 1970-01-01", standard calendar'
        )
    return rounded(values)


def _lost_times(data: xr.Dataset, wanted: Time) -> list[str]:
    """A note where the time that is taken, since none is named, is not the file's first."""
    times = _times(data)
    if wanted is not None or not times.size or not np.isnat(times[0]) or np.isnat(times).all():
        return []
    return [f"{np.isnat(times).sum()} of {times.size} times are missing: the first that is known is taken"]


def _of_member(path: Path, data: xr.Dataset, member: int | None, notes: list[str]) -> xr.Dataset:
    check_ensemble(path, [data], member)
    return data.isel(member_index(path, data, member, notes) or {})


def _at_time(path: Path, data: xr.Dataset, time: Time) -> tuple[xr.Dataset, np.datetime64 | None]:
    times = _times(data)
    chosen = pick_time(path, times, time) if times.size else 0
    if "time" in data.dims:
        data = data.isel(time=chosen)
    return data, times[chosen] if times.size else parse_time(time)
