"""One time of a WRF file: fields by name, checked for dimensions, units, size and missing values."""

from __future__ import annotations

import re
from datetime import datetime
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.readers.common.base import Time, open_netcdf, pick_time
from openswim.readers.common.bounds import check_size
from openswim.readers.common.fileset import dates_of
from openswim.readers.common.kept import leave, take
from openswim.readers.common.members import MEMBER_DIMS, check_ensemble, member_index
from openswim.scene.labels.units import check_decimals, has_value

MASS_LEVELS = ("bottom_top", "south_north", "west_east")
FULL_LEVELS = ("bottom_top_stag", "south_north", "west_east")
STAGGERED_X = ("bottom_top", "south_north", "west_east_stag")
STAGGERED_Y = ("bottom_top", "south_north_stag", "west_east")
SURFACE = ("south_north", "west_east")
# WRF spells its units in several ways ("kg kg-1", "kg/kg", "  kg(-1)", "# kg-1")
_UNIT_SPELLING = {
    "kg/kg": "kgkg-1",
    "kgkg**-1": "kgkg-1",
    "m2/s2": "m2s-2",
    "m**2s**-2": "m2s-2",
    "ugkg-1": "ug/kg",
    "ug/kg-dryair": "ug/kg",
    "ug/kgdryair": "ug/kg",
    "ugkg-1-dryair": "ug/kg",
    "ug/m3": "ugm^-3",
    "ug/m^3": "ugm^-3",
    "ugm-3": "ugm^-3",
    "1/km": "km-1",
    "km^-1": "km-1",
    "/km": "km-1",
    "m/s": "ms-1",
    "ms**-1": "ms-1",
    "kg**-1": "kg-1",
    "kg^-1": "kg-1",
    "/kg": "kg-1",
    "1/kg": "kg-1",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
}
_UNITLESS = {"", "-", "1", "none", "dimensionless"}


class WRFFile:
    """A WRF file opened at one time and at one member of an ensemble; use as a context manager."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = take("netcdf", path, partial(open_netcdf, path))
        self._file.set_always_mask(False)
        self.time_index = 0
        self._member = dict.fromkeys((name for name in MEMBER_DIMS if name in self._file.dimensions), 0)

    def __enter__(self) -> WRFFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        leave("netcdf", self.path, self._file)

    def __contains__(self, name: str) -> bool:
        return name in self._file.variables

    def size(self, dimension: str) -> int:
        """Length of a dimension; 0 where the file has none of this name."""
        return len(self._file.dimensions[dimension]) if dimension in self._file.dimensions else 0

    def attr(self, name: str, default: Any = None) -> Any:
        """A global attribute."""
        return getattr(self._file, name, default)

    def number(self, name: str, default: float = np.nan) -> float:
        """A global attribute that must be a finite number, unless there is a default for where it is missing."""
        try:
            value = float(self.attr(name, default))
        except (TypeError, ValueError):
            value = np.nan
        if not np.isfinite(value):
            raise UserError(
                f"{self.path}: global attribute {name} is missing or not a number: it is needed to "
                "place the grid on Earth"
            )
        return value

    def times(self) -> NDArray[np.datetime64]:
        """Valid times of the file, UTC (from Times, else XTIME, else START_DATE where there is only one)."""
        stamps = []
        since = str(getattr(self._file.variables["XTIME"], "units", "")) if "XTIME" in self else ""
        if "Times" in self:
            dims = [dim for dim in self._file.variables["Times"].dimensions if dim not in self._member]
            if "Time" in dims[1:]:
                raise self._stacked("Times", tuple(dims[dims.index("Time") :]))
            rows = np.atleast_2d(np.asarray(self._raw("Times")))
            stamps = [b"".join(bytes(letter) for letter in row).decode("ascii", "replace") for row in rows]
        elif " since " in since:
            return dates_of(self.path, np.atleast_1d(np.asarray(self._raw("XTIME"))), since, "standard")
        elif self.size("Time") <= 1 and self.attr("START_DATE"):
            stamps = [str(self.attr("START_DATE"))]
        try:
            return np.array(
                [datetime.strptime(stamp.strip("\0 "), "%Y-%m-%d_%H:%M:%S") for stamp in stamps],
                dtype="datetime64[ms]",
            )
        except ValueError as error:
            raise UserError(
                f"{self.path}: Times holds {shown(stamps[0])}, not dates like 2005-08-28_18:00:00: "
                "damaged, or not a WRF file"
            ) from error

    def go_to(self, time: Time) -> np.datetime64 | None:
        """Make `field` read this time (default: the first); returns it, None where the file does not say: the first."""
        if "Time" in self._file.dimensions and self.size("Time") == 0:
            raise UserError(f"{self.path}: no time has been written to it yet")
        times = self.times()
        if not times.size:
            return None
        self.time_index = pick_time(self.path, times, time)
        return times[self.time_index]

    def ensemble(self) -> xr.Dataset:
        """What counts the members of runs that were stacked in it."""
        sizes = {name: self.size(name) for name in self._member}
        counts = (self._file.variables[name] for name in MEMBER_DIMS if name in self)
        numbers = {each.name: (each.dimensions, np.asarray(each[...])) for each in counts if each.ndim < 2}
        return xr.Dataset({"stacked": (tuple(sizes), np.broadcast_to(0, tuple(sizes.values()))), **numbers})

    def choose(self, member: int | None, notes: list[str]) -> None:
        """Make `field` read this member (default: the first, with a note where there are several)."""
        counted = self.ensemble()
        check_ensemble(self.path, [counted], member)
        self._member = member_index(self.path, counted, member, notes) or {}

    def place(self, name: str, one_time: bool = True) -> tuple[Any, ...]:
        """Where the chosen member, and the chosen time or all, stand in a variable."""
        taken: dict[str, Any] = {**self._member, **({"Time": self.time_index} if one_time else {})}
        return tuple(taken.get(dim, slice(None)) for dim in self._file.variables[name].dimensions)

    def field(self, name: str, dims: tuple[str, ...], units: str = "") -> NDArray[np.float32]:
        """One field at the chosen time as float32; UserError on wrong dimensions, units or missing values."""
        variable = self._file.variables[name]
        timeless = tuple(dim for dim in variable.dimensions if dim != "Time" and dim not in self._member)
        if timeless != dims:
            raise self._stacked(name, ("Time", *dims))
        found = str(getattr(variable, "units", ""))
        if units and not _same_units(found, units):
            raise UserError(
                f"{self.path}: {name} is in {shown(found)}; expected {units!r}: convert it, or write WRF's "
                "own output"
            )
        check_size(self.path, name, tuple(self.size(dim) for dim in dims))
        raw = np.asarray(self._raw(name, one_time=True))
        check_decimals(f"{self.path}: {name}", raw.dtype.kind, units)
        values = raw.astype(np.float32)
        missing = values.size - int(np.count_nonzero(has_value(values)))
        if missing:
            raise UserError(
                f"{self.path}: {name} has {missing} missing values (NaN or fill) of {values.size}: "
                "take another file, or crop it to where it has data"
            )
        return values

    def _stacked(self, name: str, expected: tuple[str, ...]) -> UserError:
        dims = self._file.variables[name].dimensions
        more = next((dim for dim in dims if dim not in expected and dim not in self._member), None)
        remedy = "write it as WRF does" if more is None or len(dims) <= len(expected) else (
            f"take one along {more}, or call it member where it counts those of an ensemble")  # fmt: skip
        return UserError(f"{self.path}: {name} has dimensions ({', '.join(dims)}); expected ({', '.join(expected)}): "
                         f"{remedy}")  # fmt: skip

    def _raw(self, name: str, one_time: bool = False) -> Any:
        try:
            return self._file.variables[name][self.place(name, one_time)]
        except (OSError, RuntimeError, IndexError) as error:
            raise UserError(
                f"{self.path}: {name} cannot be read ({error}): truncated or damaged file: copy or "
                "download it again"
            ) from error


def _same_units(found: str, expected: str) -> bool:
    def plain(units: str) -> str:
        text = re.sub(r"[\s#()]", "", units.lower())
        return _UNIT_SPELLING.get(text, text)

    # a file that gives no unit is taken at WRF's word
    return plain(found) in _UNITLESS or plain(found) == plain(expected)
