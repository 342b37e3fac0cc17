"""What a reader is, and the checks every reader of netCDF files shares."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError, one_line
from openswim.readers.common.bounds import check_container, check_header
from openswim.readers.common.classic import classic_length
from openswim.readers.common.kept import first_bytes
from openswim.scene.grid import extent_deg
from openswim.scene.times import Time, parse_time
from openswim.scene.variables import LEVEL_DIMS, SURFACE_DIMS
from openswim.system.inputs import check_name

if TYPE_CHECKING:
    import netCDF4
    import xarray as xr

    from openswim.scene import Grid, Scene


@runtime_checkable
class Reader(Protocol):
    """Reads one kind of file. Register one under the entry point group "openswim.readers"."""

    name: str

    def detects(self, path: Path) -> bool:
        """Whether the content (not the name) of the file is this reader's; cheap, never raises."""

    def read(self, path: Path, time: Time = None) -> Scene:
        """The scene at one time (default: the file's first)."""

    def describe(self, path: Path) -> SceneInfo:
        """What `openswim info` prints, from the file's header and few small fields."""


@dataclass
class SceneInfo:
    """What a file holds, for `openswim info`. `str(info)` is the text it prints."""

    path: str
    model: str
    grid: str
    projection: str
    spacing: str
    levels: str
    times: list[str]
    species: list[str]
    surface: list[str]
    missing: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    others: list[SceneInfo] = field(default_factory=list)  # of further files, on grids of their own
    extent: str = ""

    @classmethod
    def on(cls, grid: Grid | None, /, **others: Any) -> SceneInfo:
        """With what a grid tells of itself, unless that is among the others."""
        own = {"grid": shape_text(grid), "projection": projection_text(grid), "spacing": spacing_text(grid),
               "levels": levels_text(grid), "extent": covered_text(grid)}  # fmt: skip
        return cls(**(own | others))

    def __str__(self) -> str:
        more = f" ... {self.times[-1]} ({len(self.times)} times)" if len(self.times) > 6 else ""
        rows = [
            ("file", self.path),
            ("model", self.model),
            ("grid", self.grid),
            ("projection", self.projection),
            ("extent", self.extent),
            ("spacing", self.spacing),
            ("levels", self.levels),
            ("times", ", ".join(self.times[:6]) + more or "none"),
            ("species", ", ".join(self.species) or "none"),
            ("surface", ", ".join(self.surface) or "none"),
            ("missing", ", ".join(self.missing) or "nothing"),
        ]
        rows += [("" if line else "assumed", note) for line, note in enumerate(self.assumed)]
        own = "\n".join(f"{label:<11}{one_line(text)}" for label, text in rows if text)
        return "\n\n".join([own, *map(str, self.others)])


def open_netcdf(path: Path) -> netCDF4.Dataset:
    """Open a netCDF file within bounds; a UserError says what it is instead, or that it is damaged."""
    import netCDF4

    try:
        check_name(path)
        needed = classic_length(path)
        if needed is not None and path.stat().st_size < needed:
            size = path.stat().st_size
            raise UserError(f"{path}: truncated: {size} of {needed} bytes: copy or download it again")
        check_container(path)
        file = netCDF4.Dataset(os.fspath(path), "r")
    except (OSError, RuntimeError, ValueError) as error:
        raise UserError(unreadable(path)) from error
    try:
        check_header(path, file)
    except UserError:
        file.close()
        raise
    return file


def unreadable(path: Path) -> str:
    """One line on why a file cannot be read as netCDF or Zarr, from its first bytes."""
    if not path.exists():
        return f"{path}: no such file"
    if path.is_dir():
        return f"{path}: a folder, but not a Zarr store: give a file in it, a pattern in quotes, or a Zarr folder"
    try:
        magic = first_bytes(path)
    except OSError as error:
        return f"{path}: cannot be read ({error.strerror})"
    if magic.startswith((b"CDF", b"\x89HDF")):
        return f"{path}: truncated or damaged netCDF file: copy or download it again"
    if magic.startswith(b"GRIB"):
        return f"{path}: damaged GRIB file: copy or download it again"
    return f"{path}: no file of weather: netCDF, HDF5, GRIB, Zarr, kerchunk references and text of LES are read"


def pick_time(path: Path, times: NDArray[Any], wanted: Time) -> int:
    """Index of the wanted time (to 1 s) among (n,) datetime64; the earliest where none is named. NaT is no time."""
    stamp = parse_time(wanted)
    known = np.flatnonzero(~np.isnat(times))
    if stamp is None:
        return int(known[np.argmin(times[known])]) if known.size else 0
    apart = np.abs(times[known].astype("datetime64[ms]") - stamp)
    if (apart <= np.timedelta64(1, "s")).any():
        return int(known[np.argmin(apart)])
    listed = times_text(times[known])
    raise UserError(f"{path}: no time {iso(stamp)} in it; it has {listed}: choose one of these times")


def labelled(on_levels: Mapping[str, Any], on_ground: Mapping[str, Any]) -> xr.Dataset:
    """A scene's fields on levels (z, y, x), and on the ground (y, x)."""
    import xarray as xr

    fields = {name: (LEVEL_DIMS, values) for name, values in on_levels.items()}
    return xr.Dataset(fields | {name: (SURFACE_DIMS, values) for name, values in on_ground.items()})


def iso(time: np.datetime64) -> str:
    """ISO text to the second (to the millisecond where needed)."""
    text = str(time.astype("datetime64[ms]"))
    return text.removesuffix(".000")


def times_text(times: NDArray[Any]) -> str:
    """The times of a file in one line."""
    listed = [iso(time) for time in times]
    if len(listed) > 12:
        return f"{', '.join(listed[:4])}, ... {listed[-1]} ({len(listed)} times)"
    return ", ".join(listed) or "no valid time"


def shape_text(grid: Grid | None) -> str:
    """How many nodes there are along each axis."""
    return "none (clear sky)" if grid is None else "{2} x {1} x {0} (x, y, z)".format(*grid.shape)


def projection_text(grid: Grid | None) -> str:
    """The map projection in words, with the centre of the domain."""
    if grid is None or grid.crs is None:
        return "none" if grid is None else "none (flat)"
    operation = grid.crs.coordinate_operation
    return (operation.method_name if operation is not None else "latitude-longitude") + place_text(grid)


def place_text(grid: Grid | None) -> str:
    """ ", centre 23.753 N 89.540 W", or nothing for a flat grid."""
    if grid is None or not grid.curved:
        return ""
    lon, lat = (float(angle) for angle in grid.lonlat(*grid.centre_index))
    return f", centre {abs(lat):.3f} {'NS'[lat < 0]} {abs(lon):.3f} {'EW'[lon < 0]}"


def covered_text(grid: Grid | None) -> str:
    """ "21.80 to 25.67 N, 91.90 to 87.18 W"; in kilometres of a flat grid."""
    if grid is None:
        return ""
    if not grid.curved:
        ends = (f"{name} {axis[0] / 1e3:g} to {axis[-1] / 1e3:g} km" for name, axis in (("x", grid.x), ("y", grid.y)))
        return ", ".join(ends)
    south, north, west, east = extent_deg(grid)
    return f"{_angles(south, north, 'NS')}, {_angles(west, (east + 180) % 360 - 180 if east > 180 else east, 'EW')}"


def _angles(first: float, last: float, letters: str) -> str:
    sides = [letters[angle < 0] for angle in (first, last)]
    if sides[0] == sides[1]:
        return f"{abs(first):.2f} to {abs(last):.2f} {sides[0]}"
    return f"{abs(first):.2f} {sides[0]} to {abs(last):.2f} {sides[1]}"


def spacing_text(grid: Grid | None) -> str:
    """True ground distance of a cell at the centre."""
    if grid is None:
        return "none"
    dx, dy = grid.spacing_m()
    return f"{dx:.4g} x {dy:.4g} m" if dx < 1e3 else f"{dx / 1e3:.4g} x {dy / 1e3:.4g} km"


def cells_off(grid: Grid, lon: NDArray[Any], lat: NDArray[Any]) -> float:
    """How many cells a file's own places (ny, nx) lie off a grid's at the most."""
    ix, iy = grid.index(lon, lat)
    return float(np.hypot(ix - np.arange(grid.x.size), iy - np.arange(grid.y.size)[:, None]).max())


def levels_text(grid: Grid | None) -> str:
    """Number and range of the levels."""
    if grid is None:
        return "none"
    return f"{grid.shape[0]}, {grid.height_m[0].min():.0f} to {grid.height_m[-1].max():.0f} m above sea level"


@contextmanager
def naming(path: Path | str) -> Iterator[None]:
    """Put the name of a file, or of what is in it, before the messages of checks that do not know it."""
    try:
        yield
    except UserError as error:
        if str(path) in str(error):
            raise
        raise UserError(f"{path}: {error}") from error
