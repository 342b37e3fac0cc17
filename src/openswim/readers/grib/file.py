"""A GRIB file as a list of fields that a scene can use: what, where, when; values are decoded one at a time."""

from __future__ import annotations

import mmap
import os
from collections import Counter
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.grib.codes import Meaning, aerosol_meaning, grib1_meaning, grib2_meaning
from openswim.readers.grib.sections import Damaged, Sections, fields_in, message, packing
from openswim.scene.labels.units import has_value

MAX_POINTS = 100_000_000  # of one field: 800 MB, decoded
_MISSING = 9.999e20
_LEVELS = {  # ecCodes' level types: (ours, factor)
    "isobaricInhPa": ("pressure", 100.0),
    "isobaricInPa": ("pressure", 1.0),
    "hybrid": ("hybrid", 1.0),
    "generalVerticalLayer": ("layer", 1.0),
    "generalVertical": ("interface", 1.0),
    "heightAboveGround": ("height above ground", 1.0),
    "heightAboveSea": ("height above sea", 1.0),
    "sigma": ("sigma", 1.0),
    "surface": ("surface", 1.0),
    "hybridSurface": ("surface", 1.0),
    "atmosphereSingleLayer": ("column", 1.0),
    "atmosphere": ("column", 1.0),
}
_NO_UNIT, _LONGEST_DAYS = 255, 73_000.0
_COUNTED_DAYS = {2: 1.0, 3: 30.0, 4: 365.0, 5: 3650.0, 6: 10_950.0, 7: 36_500.0, 12: 0.5}  # units by code table 4.4
_SPECTRAL = ("sh", "rotated_sh", "stretched_sh", "stretched_rotated_sh")


@dataclass(frozen=True, slots=True)
class Field:
    """One field: its quantity, level, valid time and grid, and where its message lies."""

    meaning: Meaning
    kind: str  # of level: see _LEVELS
    level: float
    valid: np.datetime64
    instant: bool
    member: int
    grid: bytes  # the definition of its grid: equal where the grids are the same
    sections: Sections
    centre: int
    process: int
    number: int = field(compare=False, default=0)  # of the message, from 1

    @property
    def name(self) -> str:
        return self.meaning.name


def _eccodes(path: Path) -> Any:
    import pyproj  # noqa: F401 - before ecCodes, whose wheel has a PROJ of its own: the other way round pyproj crashes

    try:
        import eccodes
    except (ImportError, RuntimeError) as error:
        raise UserError(
            f"{path}: a GRIB file: ecCodes, which decodes it, cannot be loaded: pip install --force-reinstall eccodes"
        ) from error
    eccodes.codes_context_set_logging(_nowhere())  # what ecCodes prints to stderr, we raise
    return eccodes


@cache
def _nowhere() -> Any:
    return open(os.devnull, "w")


class GRIBFile:
    """An open GRIB file. `fields` is its index, made once from the messages' headers."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._codes = _eccodes(path)
        self.unused: Counter[str] = Counter()
        self._constants: dict[bytes, Any] = {}
        self._opened = path.open("rb")
        try:
            self._data = mmap.mmap(self._opened.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            self._opened.close()
            raise Damaged(f"{path}: empty or unreadable: copy or download it again") from error

    def __enter__(self) -> GRIBFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._data.close()
        self._opened.close()

    @cached_property
    def fields(self) -> list[Field]:
        """All fields whose quantity a scene knows, in the order of the file."""
        found = []
        for number, sections in enumerate(fields_in(self.path, self._data), 1):
            known = self._field(number, sections)
            if known is not None:
                found.append(known)
        return found

    def keys(self, one: Field, names: tuple[str, ...]) -> dict[str, Any]:
        """Header keys of a field by ecCodes' names; None where the message has none of a name."""
        handle = self._handle(one.number, one.sections, values=False)
        try:
            return {name: self._key(handle, name) for name in names}
        finally:
            self._codes.codes_release(handle)

    def array(self, one: Field, name: str) -> NDArray[np.float64]:
        """A header array of a field ("pv", "pl", "distinctLatitudes"); empty where it has none."""
        handle = self._handle(one.number, one.sections, values=False)
        try:
            return np.asarray(self._codes.codes_get_array(handle, name), np.float64)
        except self._codes.CodesInternalError:
            return np.empty(0)
        finally:
            self._codes.codes_release(handle)

    def values(self, one: Field) -> NDArray[np.float32]:
        """(points,) values of a field in SI units, in the file's order; NaN where missing."""
        from openswim.readers.grib.images import fits
        from openswim.readers.grib.kernels import is_complex, unpacked

        packed = packing(self._data, one.sections)
        own = packed is not None and is_complex(packed[0])
        handle = self._handle(one.number, one.sections, values=not own)
        codes = self._codes
        try:
            points = self._points(one, handle)
            if packed is not None and not fits(packed[0], packed[2]):
                raise ValueError("the image of its data is not its grid's")
            found = unpacked(*packed, points) if own and packed is not None else self._decoded(handle, points)
            if found is None:
                raise ValueError("its data do not fit its grid")
            values = np.asarray(found, np.float32)
        except (codes.CodesInternalError, ValueError, MemoryError) as error:
            raise Damaged(
                f"{self.path}: message {one.number} ({one.name}) cannot be decoded ({error}): damaged: "
                "download it again"
            ) from error
        finally:
            codes.codes_release(handle)
        if one.meaning.factor != 1.0:
            values *= np.float32(one.meaning.factor)
        return values

    def _decoded(self, handle: Any, points: int) -> NDArray[np.float32] | None:
        self._codes.codes_set(handle, "missingValue", _MISSING)
        if self._codes.codes_get_size(handle, "values") != points:
            return None
        values = np.asarray(self._codes.codes_get_double_array(handle, "values"))  # not all packings have float32
        values[~has_value(values)] = np.nan
        return values.astype(np.float32)

    def _points(self, one: Field, handle: Any) -> int:
        """Number of points of a field, checked before any is decoded against its data and our memory."""
        points = int(self._codes.codes_get(handle, "numberOfDataPoints"))
        bits = self._key(handle, "bitsPerValue") or 0
        packing = str(self._key(handle, "packingType") or "")
        coded = int(self._key(handle, "numberOfCodedValues") or 0)
        if not 0 < points <= MAX_POINTS:
            raise Damaged(
                f"{self.path}: message {one.number} ({one.name}) declares {points} points; at most {MAX_POINTS:.0e} "
                "can be read: damaged, or crop it first"
            )
        if packing == "grid_simple" and coded * bits > 8 * one.sections.data[1]:
            raise Damaged(
                f"{self.path}: message {one.number} ({one.name}) is too short for its {coded} values: damaged: "
                "download it again"
            )
        return points

    def _handle(self, number: int, sections: Sections, values: bool) -> Any:
        try:
            return self._codes.codes_new_from_message(message(self._data, sections, values))
        except (self._codes.CodesInternalError, ValueError) as error:
            raise Damaged(f"{self.path}: message {number} is damaged ({error}): download it again") from error

    def _key(self, handle: Any, name: str, kind: Any = None) -> Any:
        try:
            return self._codes.codes_get(handle, name, kind)
        except (self._codes.CodesInternalError, ValueError, TypeError):
            return None

    def _field(self, number: int, sections: Sections) -> Field | None:
        handle = self._handle(number, sections, values=False)
        try:
            meaning, label = self._meaning(handle, sections.edition)
            kind = str(self._key(handle, "typeOfLevel"))
            if meaning is not None and meaning.name == "wave_slope" and kind == "meanSea":
                kind = "surface"
            if meaning is None or kind not in _LEVELS:
                self.unused[label] += 1
                return None
            kind, factor = _LEVELS[kind]
            grid_type = self._key(handle, "gridType")
            if grid_type in _SPECTRAL:
                self.unused[f"{meaning.name} in spherical harmonics"] += 1
                return None
            start, length = sections.grid
            grid = self._data[start : start + length]
            if sections.edition == 1 and length > 5 and grid[3]:  # the same grid with and without vertical coordinates
                pv, at = 4 * grid[3], grid[4] - 1
                grid = b"\0\0\0\0\0" + grid[5:at] + grid[at + pv :]
            step = self._key(handle, "stepType")
            return Field(
                meaning=meaning,
                kind=kind,
                level=factor * float(self._key(handle, "level", float) or 0.0),
                valid=self._valid(number, handle, sections.edition),
                instant=step == "instant",
                member=int(self._key(handle, "number") or 0),
                grid=grid,
                sections=sections,
                centre=int(self._key(handle, "centre", int) or 0),
                process=int(self._key(handle, "generatingProcessIdentifier", int) or 0),
                number=number,
            )
        finally:
            self._codes.codes_release(handle)

    def _meaning(self, handle: Any, edition: int) -> tuple[Meaning | None, str]:
        get = self._key
        centre = int(get(handle, "centre", int) or 0)
        if edition == 1:
            table, number = int(get(handle, "table2Version") or 0), int(get(handle, "indicatorOfParameter") or 0)
            return grib1_meaning(centre, table, number), f"{table}.{number}"
        triple = [int(get(handle, k) or 0) for k in ("discipline", "parameterCategory", "parameterNumber")]
        meaning = grib2_meaning(centre, *triple)
        if meaning is not None and meaning.name.startswith("aerosol_"):
            kind = get(handle, "aerosolType", int) or get(handle, "constituentType", int)
            meaning = aerosol_meaning(meaning, kind, self._at_550(handle), str(get(handle, "shortName", str)))
        return meaning, ".".join(map(str, triple))

    def _at_550(self, handle: Any) -> bool:
        """Whether an optical depth is at about 550 nm."""
        ends = []
        single = self._key(handle, "typeOfWavelengthInterval", int) == 11  # equal to the first
        for end in ("First", "First") if single else ("First", "Second"):
            value = self._key(handle, f"scaledValueOf{end}Wavelength")
            scale = self._key(handle, f"scaleFactorOf{end}Wavelength")
            if value is None or scale is None:
                return False
            ends.append(float(value) * 10.0 ** -float(scale))
        return 530e-9 <= ends[0] <= 570e-9 and ends[1] <= 590e-9

    def _valid(self, number: int, handle: Any, edition: int) -> np.datetime64:
        # eccodes counts on day by day, without end where the unit is none or the forecast one for ages
        unit, count = (self._key(handle, name, int) for name in ("indicatorOfUnitOfTimeRange", "forecastTime"))
        if (unit == _NO_UNIT and edition == 2) or (count or 0) * _COUNTED_DAYS.get(unit, 0.0) > _LONGEST_DAYS:
            raise Damaged(f"{self.path}: message {number} is a forecast of {count} times unit {unit}: damaged: "
                          "download it again")  # fmt: skip
        begun = int(self._key(handle, "dataTime", int) or 0)
        if not (0 <= begun < 2400 and begun % 100 < 60):  # eccodes would count on into the next day
            raise Damaged(f"{self.path}: message {number} begins at {begun:04d} (hours and minutes), which is no time: "
                          "damaged: download it again")  # fmt: skip
        date, clock = self._key(handle, "validityDate"), self._key(handle, "validityTime")
        try:
            day = f"{int(date):08d}"
            return np.datetime64(f"{day[:4]}-{day[4:6]}-{day[6:]}", "ms") + np.timedelta64(
                60_000 * (60 * (int(clock) // 100) + int(clock) % 100), "ms"
            )
        except (TypeError, ValueError) as error:
            raise Damaged(f"{self.path}: message {number} has no valid time: damaged: download it again") from error
