"""Cloud fields of large-eddy models as text, rows `i j k lwc reff`: the layouts of SHDOM and of AT3D."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import written_number
from openswim.errors import UserError
from openswim.readers.common.base import (
    SceneInfo,
    Time,
    naming,
)
from openswim.readers.common.bounds import PLAUSIBLE_ELEMENTS, check_size
from openswim.readers.common.clock import undated
from openswim.readers.common.kept import first_bytes
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.readers.fields.absent import no_species
from openswim.scene import Grid, Scene
from openswim.scene.aerosol import DEFAULT_AEROSOL
from openswim.scene.grid import EARTH_RADIUS_M

_ALBEDO = 0.06  # of the sea below, where these clouds live
_HEAD_BYTES = 65_536
_NO_ROWS = "rows must hold five numbers, i j k lwc reff: truncated or damaged: copy or download it again"
_NODES_PER_BYTE = 30  # of which one in a thousand has a row: cloudy ones alone may be listed


@dataclass(frozen=True)
class _Head:
    """What stands above the rows: sizes, spacing and levels in metres, how many lines, and the separator."""

    shape: tuple[int, int, int]  # nx, ny, nz
    step_m: tuple[float, float]
    levels_m: NDArray[np.float64]
    lines: int
    separator: str | None


class LESTextReader:
    """Reads liquid water (g m-3) and effective radius (um) of a flat domain; give a place to lay it there."""

    name = "LES text"

    def detects(self, path: Path) -> bool:
        """True for text that begins with the sizes, the spacing and the levels of such a grid."""
        try:
            return path.is_file() and _head(path) is not None
        except OSError:
            return False
        except UserError:  # which `read` raises again
            return True

    def read(self, path: Path, time: Time = None, around: Neighbourhood | None = None) -> Scene:
        head = _head(path)
        if head is None:
            raise UserError(f"{path}: not a cloud field in text (rows i j k lwc reff)")
        with naming(path):
            notes: list[str] = []
            content, radius = _fields(path, head, notes)
            nx, ny, _ = head.shape
            x, y = (np.linspace(-0.5, 0.5, n) * step * (n - 1) for step, n in zip(head.step_m, (nx, ny), strict=True))
            crs = None
            if around is not None:
                from pyproj import CRS

                at = f"+lat_0={around.lat} +lon_0={around.lon}"
                crs = CRS.from_proj4(f"+proj=aeqd {at} +R={EARTH_RADIUS_M} +no_defs")
                notes.append(f"no place in the file: its centre is laid at {around.lat:g}, {around.lon:g}")
            else:
                notes.append("no place in the file: flat Earth, open sides")
            dims = ("z", "y", "x")
            fields = {"liquid_content": (dims, content), "liquid_effective_radius": (dims, radius)}
            notes += no_species(fields)
            if crs is None:
                fields["surface_albedo"] = (("y", "x"), np.full((ny, nx), _ALBEDO, np.float32))  # type: ignore[assignment]
                notes.append(f"no ground in the file: sea level, albedo {_ALBEDO}")
            valid = undated(time, None if around is None else around.lon, notes)
            notes.append(f"gas and aerosol background: US standard atmosphere with {DEFAULT_AEROSOL}")
            from openswim.scene.atmosphere import Atmosphere

            grid = Grid(x, y, head.levels_m, crs)
            return Scene(grid, xr.Dataset(fields), Atmosphere.us_standard(), time=valid, source=path.name, notes=notes)

    def describe(self, path: Path) -> SceneInfo:
        scene = self.read(path)
        grid = scene.grid
        assert grid is not None
        return SceneInfo.on(
            grid,
            path=str(path),
            model="large-eddy cloud field in text",
            times=[],
            species=["liquid (lwc, reff)"],
            surface=[],
            missing=["place", "time", "ice", "rain", "snow", "graupel"],
            assumed=scene.notes,
        )


def _head(path: Path) -> _Head | None:
    raw = first_bytes(path)[:_HEAD_BYTES]
    if not raw or b"\0" in raw or raw[:1] in b"{\x89":
        return None
    lines = raw.decode("ascii", "replace").splitlines()
    numbers: list[list[float]] = []
    separator: str | None = None
    for index, line in enumerate(lines[:12]):
        text = line.split("#")[0].strip()
        if not text:
            continue
        separator = "," if "," in text else separator
        try:
            numbers.append([written_number(word) for word in text.replace(",", " ").split()])
        except ValueError:
            if not numbers or text.lower().replace(" ", "").split(",")[:3] != ["i", "j", "k"]:
                return None
            continue
        if len(numbers) > 1 and len(numbers[-1]) == 5 and len(numbers[0]) in (1, 3):
            return _checked(path, numbers[:-1], index, separator)
    sizes, spacing = (*(row for row in numbers if len(row) > 1), [], [])[:2]
    whole = len(sizes) == 3 and all(value.is_integer() and value >= 1 for value in sizes)
    if whole and spacing and len(spacing) in (2, 2 + int(sizes[2])) and len(raw) < _HEAD_BYTES:
        raise UserError(f"{path}: sizes and spacing, but no rows i j k lwc reff: truncated: copy or download it again")
    return None


def _checked(path: Path, head: Sequence[Sequence[float]], lines: int, separator: str | None) -> _Head | None:
    """Kind number (SHDOM: 2) left out; sizes; spacing and levels [km] in one line or two; temperatures left out."""
    rows = list(head[1:] if len(head[0]) == 1 else head)
    if len(rows[0]) != 3 or any(not (value.is_integer() and 1 <= value < 1e6) for value in rows[0]):
        return None
    shape = (int(rows[0][0]), int(rows[0][1]), int(rows[0][2]))
    rest = [value for row in rows[1:] for value in row][: 2 + shape[2]]
    if len(rest) < 2 + shape[2]:
        return None
    values = 1e3 * np.array(rest, np.float64)
    if not (np.isfinite(values).all() and (values[:2] > 0).all()):
        raise UserError(f"{path}: spacing {rest[0]}, {rest[1]} km, and levels: must be finite, spacing positive")
    nodes = shape[0] * shape[1] * shape[2]
    if nodes > max(PLAUSIBLE_ELEMENTS, _NODES_PER_BYTE * path.stat().st_size):
        raise UserError(
            f"{path}: its head tells of {shape[0]} x {shape[1]} x {shape[2]} nodes, too many for so small a file: "
            "damaged or truncated"
        )
    check_size(path, "the field", shape)
    return _Head(shape, (float(values[0]), float(values[1])), values[2:], lines, separator)


def _is_beginning(index: NDArray[np.int64], sizes: NDArray[np.int64]) -> bool:
    """Whether rows (n, 3) list every cell from the first one on, in either order of the axes, and then stop."""
    orders = (index, sizes), (index[:, ::-1], sizes[::-1])
    return any(
        np.array_equal(np.ravel_multi_index(tuple(each.T), tuple(shape)), np.arange(len(index)))
        for each, shape in orders
    )


def _stops_early(index: NDArray[np.int64], sizes: NDArray[np.int64]) -> bool:
    """Whether rows (n, 3) in order leave more slabs empty at their end than anywhere else."""
    for axis in (0, 2):
        slabs = index[:, axis]
        if (np.diff(slabs) >= 0).all():
            between = np.diff(np.concatenate([[-1], np.unique(slabs)])) - 1
            return bool(sizes[axis] - 1 - slabs[-1] > max(3, 2 * between.max()))
    return False


def _ends_in_a_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) in b"\r\n"


def _fields(path: Path, head: _Head, notes: list[str]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Content [kg m-3] and effective radius [m], (nz, ny, nx)."""
    nx, ny, nz = head.shape
    try:
        rows = np.loadtxt(path, delimiter=head.separator, skiprows=head.lines, ndmin=2, encoding="ascii")
    except (ValueError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {_NO_ROWS}") from error
    if rows.shape[1] != 5 or not np.isfinite(rows).all():
        raise UserError(f"{path}: {_NO_ROWS}")
    index = rows[:, :3].astype(np.int64)
    sizes = np.array([nx, ny, nz])
    first = 0 if (index == 0).any() else 1 if (index.max(axis=0) == sizes).any() else 0
    index -= first
    if (index < 0).any() or (index >= sizes).any():
        raise UserError(f"{path}: rows name cells outside the {nx} x {ny} x {nz} grid: damaged file")
    flat = np.ravel_multi_index((index[:, 2], index[:, 1], index[:, 0]), (nz, ny, nx))
    if np.unique(flat).size < flat.size:
        raise UserError(f"{path}: {flat.size - np.unique(flat).size} cells are listed twice: damaged file")
    dense = int(index[:, 2].max()) + 1 == nz and rows.shape[0] > 0.9 * nx * ny * nz
    whole = rows.shape[0] == nx * ny * nz
    if not whole and (dense or _is_beginning(index, sizes)):
        raise UserError(f"{path}: {rows.shape[0]} of {nx * ny * nz} rows: truncated: copy or download it again")
    if not whole:
        if not _ends_in_a_line(path):
            raise UserError(f"{path}: the last row does not end: truncated: copy it again, or end its last line")
        doubt = "; all is empty beyond: is the file whole?" if _stops_early(index, sizes) else ""
        last = " ".join(map(str, index[-1] + first))
        listed = f"{rows.shape[0]} of {nx * ny * nz} cells are listed, the last of them {last}"
        notes.append(f"{listed}: no cloud in the others{doubt}")
    content, radius = np.zeros(nz * ny * nx, np.float32), np.zeros(nz * ny * nx, np.float32)
    content[flat], radius[flat] = 1e-3 * rows[:, 3], 1e-6 * rows[:, 4]
    return content.reshape(nz, ny, nx), radius.reshape(nz, ny, nx)
