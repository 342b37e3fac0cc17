"""One or several files of one model as one set of variables at one time."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.readers.common.base import iso, naming, pick_time
from openswim.readers.common.bounds import check_size
from openswim.readers.common.members import MEMBER_DIMS, check_ensemble, member_index
from openswim.readers.common.opening import opened, reading
from openswim.readers.common.pieces import check_clock, lost_pieces
from openswim.scene.labels.units import check_decimals, conversion, has_value
from openswim.scene.times import REAL_CALENDARS, SAME_NAMES, Time, rounded

_SINGLES = (*MEMBER_DIMS, "bnds")
_SECONDS = {
    "s": 1.0, "sec": 1.0, "second": 1.0, "ms": 1e-3, "msec": 1e-3, "millisecond": 1e-3, "m": 60.0, "min": 60.0,
    "minute": 60.0, "h": 3600.0, "hr": 3600.0, "hour": 3600.0, "d": 86400.0, "day": 86400.0,
}  # fmt: skip
Times = NDArray[np.datetime64]


@dataclass
class Part:
    """One file: its dataset (times not decoded) and its times, flattened over its time dimensions."""

    path: Path
    data: xr.Dataset
    time_dims: tuple[str, ...]
    times: Times
    elapsed: bool = False  # times count from a start that the file does not date
    clock: str = ""  # the variable that times are read from
    early: frozenset[Any] = frozenset()  # of these times, before the date that they are counted from
    calendar: str = ""  # a model's own, whose days are taken for those of the same name


class FileSet:
    """The variables of several files of one state, found by name; `go_to` chooses the time."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self.parts = list(parts)
        self.time: np.datetime64 | None = None
        self._chosen: list[dict[Any, int] | None] = [{} for _ in self.parts]
        self._fields: list[xr.DataArray] | None = None

    @property
    def path(self) -> Path:
        return self.parts[0].path

    @property
    def times(self) -> Times:
        """All valid times, ascending."""
        every = [part.times for part in self.parts if part.times.size]
        return np.unique(np.concatenate(every)) if every else np.array([], "datetime64[ms]")

    @property
    def dated(self) -> bool:
        """Whether the times are dates, and not counted from an unknown start."""
        return not any(part.elapsed for part in self.parts)

    def attrs(self, name: str, default: Any = "") -> Any:
        """A global attribute, from the first file that has it."""
        return next((part.data.attrs[name] for part in self.parts if name in part.data.attrs), default)

    def start_at(self, start: np.datetime64) -> None:
        """Count elapsed times from a date."""
        for part in self.parts:
            if part.elapsed:
                part.times = start + (part.times - np.datetime64(0, "ms"))

    def go_to(self, time: Time, member: int | None = None) -> tuple[np.datetime64 | None, list[str]]:
        """Choose a time and a member of an ensemble, with notes on which.

        Files without the time give no variables, files without times give theirs at any time.
        """
        times = self.times
        if times.size:
            self.time = times[pick_time(self.path, times, time)]
        self._fields = None
        self._chosen = [_choice(part, self.time) for part in self.parts]
        early = any(self.time in part.early for part in self.parts)
        notes = [f"{self.time} is before the date that the file counts from: is it what it means?"] if early else []
        notes += [
            f"times are of the calendar {part.calendar}: taken for those of the same name in the Gregorian one"
            for part in self.parts
            if part.calendar
        ]
        check_ensemble(self.path, (part.data for part in self.parts), member)
        here = [(n, part) for n, part in enumerate(self.parts) if self._chosen[n] is not None]
        for n, part in here:
            beside = [other.data for _, other in here if other is not part and _on_levels(part) & _on_levels(other)]
            own = member_index(part.path, part.data, member, notes, beside)
            self._chosen[n] = None if own is None else own | (self._chosen[n] or {})
        self._check_once()
        return self.time, list(dict.fromkeys(notes))

    def _check_once(self) -> None:
        """Raise UserError where all that a file has on levels is in another one too, with other values."""
        here = [(part, chosen) for part, chosen in zip(self.parts, self._chosen, strict=True) if chosen is not None]
        for n, (part, chosen) in enumerate(here):
            for before, first in here[:n]:
                own = _on_levels(part)
                doubled = bool(own) and own <= _on_levels(before)
                if doubled and not _alike(part.path, part.data, before.data, own, chosen, first):
                    at = "" if self.time is None else f" at {iso(self.time)}"
                    raise UserError(
                        f"{before.path} and {part.path} both hold {', '.join(sorted(own)[:3])}{at}: open one of them"
                    )

    def __iter__(self) -> Iterator[xr.DataArray]:
        """Every variable at the chosen time, lazily, without time and ensemble dimensions."""
        if self._fields is None:
            self._fields = list(self._selected())
        return iter(self._fields)

    def _selected(self) -> Iterator[xr.DataArray]:
        for part, chosen in zip(self.parts, self._chosen, strict=True):
            if chosen is None:
                continue
            for name in part.data.variables:
                field = part.data[name]
                field = field.isel({dim: chosen[dim] for dim in field.dims if dim in chosen})
                single = [dim for dim in field.dims if dim in _SINGLES or (field.ndim > 2 and field.sizes[dim] == 1)]
                yield field.isel(dict.fromkeys(single, 0)) if single and field.size else field

    def get(self, name: str, ndim: int | None = None) -> xr.DataArray | None:
        """A variable by its name (and number of dimensions); None where there is none."""
        return next((f for f in self if f.name == name and ndim in (None, f.ndim)), None)

    def lost(self, used: set[str]) -> list[str]:
        """Notes on pieces of used variables, and of the clock, that a Zarr store lacks at the chosen time."""
        notes = []
        for part, chosen in zip(self.parts, self._chosen, strict=True):
            if chosen is None:
                continue
            notes += lost_pieces(part.path, part.data, sorted(used), chosen)
            if part.clock and self.time is not None:
                notes += check_clock(part.path, part.data, part.clock, self.time)
        return notes


@contextmanager
def opened_set(
    paths: Sequence[Path], adapt: Callable[[Path, xr.Dataset], xr.Dataset] | None = None
) -> Iterator[FileSet]:
    """Open all files of a set; `adapt` translates each into CF terms."""
    with ExitStack() as stack:
        parts = []
        for path in paths:
            data = stack.enter_context(opened(path, decode=False))
            with naming(path), reading(path):
                parts.append(_part(path, data if adapt is None else adapt(path, data)))
        yield FileSet(parts)


def values(path: Path, field: xr.DataArray, units: str) -> NDArray[np.float32]:
    """The values as float32 in the wanted units; missing ones (see `has_value`) are NaN."""
    check_size(path, str(field.name), field.shape)
    factor = conversion(str(field.attrs.get("units", units) or units), units)
    if factor is None:
        given = shown(field.attrs.get("units"))
        raise UserError(f"{path}: {field.name} is in {given}; it must be in {shown(units)}: convert it")
    with reading(path, "truncated or damaged: copy or download it again"):
        raw = np.asarray(field.values)
        if raw.dtype.kind not in "fiub":
            raise UserError(f"{path}: {field.name} holds no numbers")
        check_decimals(f"{path}: {field.name}", raw.dtype.kind, units)
        found = raw.astype(np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        found[~has_value(found)] = np.nan
        if factor != (1.0, 0.0):
            found = (factor[0] * found.astype(np.float64) + factor[1]).astype(np.float32)
    return found


def _part(path: Path, data: xr.Dataset) -> Part:
    clock = _clock(data)
    if clock is None:
        return Part(path, data, (), np.array([], "datetime64[ms]"))
    stamps = np.asarray(clock.values).ravel()
    dims = tuple(str(dim) for dim in clock.dims)
    units = str(clock.attrs.get("units", ""))
    origin = str(data.attrs.get("origin_time", ""))  # PALM dates its start there
    if "since" not in units and not origin[:4].isdigit():
        seconds = stamps.astype(np.float64) * _seconds_of(path, units)
        return Part(path, data, dims, np.datetime64(0, "ms") + _milliseconds(seconds), True, str(clock.name))
    if "since" not in units:
        units = f"{units or 'seconds'} since {origin[:19]}"
    calendar = str(clock.attrs.get("calendar", "standard")).lower()
    times = dates_of(path, stamps, units, calendar)
    return Part(
        path, data, dims, times, clock=str(clock.name), early=frozenset(times[stamps.astype(np.float64) < 0]),
        calendar=calendar if calendar in SAME_NAMES else "",
    )  # fmt: skip


def _choice(part: Part, time: np.datetime64 | None) -> dict[Any, int] | None:
    """Indices of the time in a file; None where it does not have it."""
    chosen: dict[Any, int] = {}
    if part.times.size and time is not None:
        hits = np.flatnonzero(np.abs(part.times - time) <= np.timedelta64(1, "s"))
        if not hits.size:
            return None
        shape = [part.data.sizes[dim] for dim in part.time_dims]
        chosen = {dim: int(i) for dim, i in zip(part.time_dims, np.unravel_index(int(hits[0]), shape), strict=True)}
    if "expver" in part.data.dims:
        chosen["expver"] = _stream(part.data, chosen)
    return chosen


def _on_levels(part: Part) -> set[str]:
    """What a file has on levels."""
    every = {str(name): field for name, field in part.data.data_vars.items()}
    apart = {*part.time_dims, *MEMBER_DIMS, "expver"}
    return {name for name, field in every.items() if len(set(field.dims) - apart) > 2}


def _alike(
    path: Path, one: xr.Dataset, other: xr.Dataset, names: set[str], at: dict[Any, int], there: dict[Any, int]
) -> bool:
    """Whether variables are the same in two files."""
    for name in sorted(names):
        mine, theirs = (data[name].isel({d: i for d, i in chosen.items() if d in data[name].dims})
                        for data, chosen in ((one, at), (other, there)))  # fmt: skip
        check_size(path, name, mine.shape)
        if mine.size != theirs.size or not np.allclose(mine.values.ravel(), theirs.values.ravel(), 0, 0, True):
            return False
    return True


def _stream(data: xr.Dataset, chosen: dict[Any, int]) -> int:
    """ERA5 of the last months comes as two streams side by side, each missing where the other is not."""
    for index in range(data.sizes["expver"]):
        for field in data.data_vars.values():
            if "expver" in field.dims and field.ndim > 2:
                corner = {dim: chosen.get(dim, index if dim == "expver" else 0) for dim in field.dims}
                if np.isfinite(float(field.isel(corner))):
                    return index
    return 0


def _clock(data: xr.Dataset) -> xr.DataArray | None:
    """The time coordinate: 0- to 2-D (start and lead), by name, standard_name or units; valid time comes first."""
    candidates = []
    for name in data.variables:
        field = data[name]
        if field.dtype.kind not in "fiuM":
            continue
        units = str(field.attrs.get("units", ""))
        rank = {"valid_time": 0, "valtime": 0, "time": 1, "Time": 1, "t": 2}.get(str(name))
        if rank is None and (field.attrs.get("standard_name") == "time" or str(field.attrs.get("axis")) == "T"):
            rank = 3
        if rank is None or (rank >= 2 and "since" not in units):
            continue
        if field.ndim <= 2 and 0 < field.size <= 1_000_000:
            candidates.append((rank, field))
    return min(candidates, key=lambda each: each[0])[1] if candidates else None


def dates_of(path: Path, stamps: NDArray[Any], units: str, calendar: str) -> Times:
    """What numbers in units like "hours since 2000-01-01" stand for."""
    import cftime

    plain = units.replace("(", "").replace(")", "")  # LAPS: "seconds since (1970-1-1 00:00:00.0)"
    if not np.isfinite(stamps.astype(np.float64)).all():
        raise UserError(f"{path}: times are missing (NaN or fill): damaged file")
    try:
        if calendar not in REAL_CALENDARS + SAME_NAMES:  # such as julian, 13 days off
            raise ValueError(calendar)
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of years before any calendar
            dates = cftime.num2date(stamps.astype(np.float64), plain, calendar, True, True)
        found = [datetime.fromisoformat(each.isoformat()) for each in np.atleast_1d(dates)]
        return rounded(np.array(found, "datetime64[us]"))
    except (ValueError, OverflowError, TypeError, Warning) as error:
        raise UserError(
            f"{path}: times in {shown(units)} ({calendar} calendar) are no dates: use the standard calendar"
        ) from error


def _seconds_of(path: Path, units: str) -> float:
    word = (units.lower().split() or ["s"])[0]
    found = _SECONDS.get(word, _SECONDS.get(word.removesuffix("s")))
    if found is None:
        raise UserError(f"{path}: elapsed times in {shown(units)}: give seconds, minutes, hours or days")
    return found


def _milliseconds(seconds: NDArray[np.float64]) -> NDArray[np.timedelta64]:
    sane = np.nan_to_num(np.clip(seconds, -1e9, 1e9))
    return np.round(sane * 1e3).astype("timedelta64[ms]")
