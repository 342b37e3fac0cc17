"""Measured irradiance: files of BSRN, SURFRAD, SOLRAD, MIDC and ARM, and plain tables, as one kind of Dataset."""

from __future__ import annotations

import calendar
import codecs
import json
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import number, shown
from openswim.errors import UserError
from openswim.scene.times import parse_time
from openswim.stations.arm import read_arm
from openswim.stations.checks import sun_of, told_of_means, told_of_swap
from openswim.stations.columns import check_names, columns_of, not_understood
from openswim.stations.text import PLACES, head_of, names_in, rows_of, text_of, told_of_end, told_of_lost
from openswim.system.inputs import check_ordinary, lines_of

if TYPE_CHECKING:
    import pandas as pd

F64 = NDArray[np.float64]

QUANTITIES = {  # unit and range of what instruments can give; what is beyond is missing
    "ghi": ("W m-2", -50.0, 2200.0),
    "dni": ("W m-2", -50.0, 1500.0),
    "dhi": ("W m-2", -50.0, 1500.0),
    "up": ("W m-2", -50.0, 2000.0),
    "temperature": ("K", 180.0, 340.0),
    "relative_humidity": ("1", 0.0, 1.1),
    "pressure": ("Pa", 3e4, 1.1e5),
}
_PVLIB = {"ghi": "ghi", "dni": "dni", "dhi": "dhi", "uw_solar": "up", "temp_air": "temperature",
          "relative_humidity": "relative_humidity", "pressure": "pressure"}  # fmt: skip
_OPTIONS = {"latitude": "--lat", "longitude": "--lon", "height_m": "--ground"}
_LARGEST_JSON = 100_000  # characters
_YEARS = 1900, 2200
_BAD_FLAG = 1  # of SURFRAD and SOLRAD: known to be bad; 2 is a doubt
_COLUMNS_OF_SURFRAD, _COLUMNS_OF_SOLRAD = 48, (22, 31)  # of SOLRAD the latter with infrared light
_HIGH_SUN_DEG, _DIMMEST_W_M2 = 30.0, 5.0  # the darkest clouds leave more; an hour has up to 4.3 MJ/m2
_FEW = 200  # of the brightest minutes, which tell as much as all
_SAME_ZENITH_DEG = 2.0
_LEFT_OUT = "left_out"  # attribute of what a reader gives: what is to be told of columns that do not count


def read_station(
    path: str | Path, lat: float | None = None, lon: float | None = None, height_m: float | None = None
) -> xr.Dataset:
    """A station's file: BSRN station-to-archive, SURFRAD, SOLRAD, MIDC, ARM radiometers, or a table (CSV) of ours.

    Returns a Dataset on ``time`` (UTC) of those of ``ghi``, ``dni``, ``dhi``, ``up`` (W m-2), ``temperature`` (K),
    ``relative_humidity`` (1), ``pressure`` (Pa) that it has, NaN where missing, with the attributes ``latitude``,
    ``longitude``, ``height_m`` and ``network``, and ``note`` where a file may have been cut, columns do not count or
    values are means. lat, lon, height_m: of the station, where the file does not say (MIDC).
    """
    path = Path(path)
    kind = kind_of(path)
    if kind is None:
        raise UserError(f"{path}: no station file of BSRN, SURFRAD, SOLRAD, MIDC or ARM, nor a table with utc and ghi, "
                        "or dni and dhi")  # fmt: skip
    try:
        data, place = _READERS[kind](path)
    except ImportError as error:
        raise UserError(f"{path}: {kind} files need the package pvlib: pip install 'openswim[stations]'") from error
    except UserError as error:
        named = str(error).startswith((f"{path}: ", f"{path.with_suffix('.json')}: "))
        raise UserError(str(error) if named else f"{path}: {error}") from None
    except (ValueError, LookupError, OSError, TypeError, AttributeError, ArithmeticError) as error:
        raise UserError(f"{path}: damaged {kind} file ({error})") from error
    asked = {"latitude": lat, "longitude": lon, "height_m": height_m}
    given = {name: value for name, value in asked.items() if value is not None}
    for name, value in place.items():
        low, high = PLACES[name]
        if name not in given and not low <= value <= high:
            raise UserError(f"{path}: {name} = {value:g} is none: mend the file, or give {_OPTIONS[name]}")
    place = place | given
    for name, (unit, _, _) in QUANTITIES.items():
        if name in data:
            data[name] = ("time", _measured(name, np.asarray(data[name].values, float)), {"units": unit})
    keep = [name for name in QUANTITIES if name in data and np.isfinite(data[name]).any()]
    if "ghi" not in keep and not {"dni", "dhi"} <= set(keep):
        raise UserError(f"{path}: neither global irradiance in it, nor direct and diffuse, in W/m2 or kW/m2")
    lacking = sorted({"latitude", "longitude"} - place.keys())
    if lacking:
        beside = f", or {path.with_suffix('.json').name} beside it with lat, lon and elev_m"
        raise UserError(f"{path}: this {kind} file does not say its {' and '.join(lacking)}: give --lat and --lon"
                        f"{beside if kind in ('MIDC', 'table') else ''}")  # fmt: skip
    if np.isnat(data["time"].values).any():
        raise UserError(f"{path}: rows without a time: mend the file")
    data = _without_doubles(path, data[keep].sortby("time"))
    data = data.assign_attrs({"height_m": 0.0} | place | {"network": kind, "source": path.name})
    told = [data.attrs.pop("note", "") or ("" if kind == "ARM" else told_of_end(path)), data.attrs.pop(_LEFT_OUT, "")]
    told += [told_of_means(data), told_of_swap(data)]
    if any(told):
        data.attrs["note"] = "; ".join(filter(None, told))
    _check_bright(path, data)
    return data


def _check_bright(path: Path, data: xr.Dataset) -> None:
    """Raise UserError where all light under a high sun is too little even for clouds, as it is in kW/m2."""
    light = data["ghi" if "ghi" in data else "dhi"]
    if not np.nanmax(light.values) < _DIMMEST_W_M2:  # the sun of a year of minutes would take gigabytes
        return
    brightest = data.isel(time=np.argsort(-light.values)[:_FEW])  # NaN comes last
    most = brightest[light.name].values[sun_of(brightest).altitude_deg > _HIGH_SUN_DEG]
    if np.isfinite(most).any() and np.nanmax(most) > 0:
        raise UserError(f"{path}: no more than {np.nanmax(most):.3g} W/m2 under a sun above {_HIGH_SUN_DEG:g} degrees: "
                        "are they kW/m2 or sums? Give W/m2, or the unit behind the names: ghi [kW/m2]")  # fmt: skip


def _without_doubles(path: Path, data: xr.Dataset) -> xr.Dataset:
    """Without rows that stand there twice; raises UserError where two of one time differ."""
    later = np.r_[False, np.diff(data["time"].values) == np.timedelta64(0, "ns")]
    if not later.any():
        return data
    for name in data:
        values = data[name].values
        other = later[1:] & (values[1:] != values[:-1]) & np.isfinite(values[1:]) & np.isfinite(values[:-1])
        if other.any():
            when = np.datetime_as_string(data["time"].values[1:][other][0], "s")
            raise UserError(
                f"{path}: {name} is there twice for {when}Z, with two values: is its clock put back in autumn? Give UTC"
            )
    return data.isel(time=~later)


def kind_of(path: Path) -> str | None:
    """What a file is by its first lines; None: no station's file."""
    check_ordinary(path)
    try:
        with path.open("rb") as file:
            head = file.read(4000)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    if head.startswith(b"\x1f\x8b"):
        head = text_of(path, "latin-1")[:4000].encode("latin-1")
        if head.startswith((b"CDF", b"\x89HDF")):
            raise UserError(f"{path}: a packed netCDF file: unpack it first (gunzip)")
    if head.startswith((b"CDF", b"\x89HDF")):
        return "ARM"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise UserError(f"{path}: is text in UTF-16: save it in UTF-8")
    text = head.removeprefix(codecs.BOM_UTF8).decode("latin-1")
    lines = text.splitlines()
    if re.match(r"\*[CU]0001", lines[0] if lines else ""):
        return "BSRN"
    if len(lines) > 2 and re.match(r"\s*-?\d+\.\d+\s+-?\d+\.\d+\s+\d+\s*m?\b", lines[1]):
        return "SURFRAD" if len(lines[2].split()) > 40 else "SOLRAD"
    first = [name.lower() for name in names_in(text)[0]]
    if any("mm/dd/yyyy" in name for name in first) or {"year", "doy"} <= set(first):
        return "MIDC"
    return "table" if "utc" in first and any(name.startswith(("ghi", "dni", "dhi")) for name in first) else None


def _bsrn(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    from pvlib.iotools import read_bsrn

    with _unpacked(path) as plain:
        _check_pairs(Path(plain).read_text("ascii").splitlines())
        frame, about = read_bsrn(plain, logical_records=("0100",))
    # longitudes are counted from 180 W and latitudes from the south pole in the archive's files
    return _of_frame(frame), _place(about.get("latitude"), about.get("longitude"), about.get("altitude"))


def _check_pairs(lines: list[str]) -> None:
    """Raise UserError unless each minute of record 0100 has its two lines: pvlib takes them by turns, so that behind
    one that is lost global light would be diffuse light."""
    _check_years(year := int(lines[1][7:11]), year)
    days = calendar.monthrange(year, int(lines[1][3:6]))[1]
    within = second = False
    for count, line in enumerate(lines, 1):
        if line.startswith("*"):
            within, second = line[2:6] == "0100", False
        elif within and line.strip():
            day, minute = line[:3].strip(), line[3:8].strip()
            if second:
                fits = not day and not minute
            else:
                fits = day.isdecimal() and 1 <= int(day) <= days and minute.isdecimal() and int(minute) < 1440
            if not fits:
                which = "second" if second else "first"
                raise UserError(f"line {count} is not the {which} line of a minute of the month: "
                                "a line is lost or moved: copy or download the file again")  # fmt: skip
            second = not second


def _surfrad(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    from pvlib.iotools.surfrad import VARIABLE_MAP, read_surfrad

    with _unpacked(path) as plain:
        _check_columns(plain, _COLUMNS_OF_SURFRAD)
        frame, about = read_surfrad(plain, map_variables=False)
    frame = frame.rename(columns=VARIABLE_MAP)  # its own renaming warns with pandas 3.1
    return _of_frame(frame), _by_zenith(frame, _place(about["latitude"], about["longitude"], about["elevation"]))


def _check_columns(plain: str, *counts: int) -> None:
    """Raise UserError unless all lines have as many columns as they can have: pvlib takes what stands at their places,
    so that direct light would be global light where a column is lost."""
    for count, line in enumerate(Path(plain).read_text("ascii").splitlines()[2:], 3):
        columns = len(line.split())
        if columns and columns not in counts:
            raise UserError(f"line {count} has {columns} columns, and not {' or '.join(map(str, counts))}: "
                            "copy or download the file again")  # fmt: skip


def _solrad(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    from pvlib.iotools import read_solrad

    with _unpacked(path) as plain:
        _check_columns(plain, *_COLUMNS_OF_SOLRAD)
        found = read_solrad(plain)
    frame = found[0] if isinstance(found, tuple) else found
    lat, lon, height = text_of(path, "latin-1").splitlines()[1].split()[:3]
    return _of_frame(frame), _by_zenith(frame, _place(lat, lon, height))


def _by_zenith(frame: pd.DataFrame, place: dict[str, float]) -> dict[str, float]:
    """The place, east counted positive, as the file's own zenith angles of the sun have it: many files count west."""
    theirs = frame["solar_zenith"].to_numpy(float)
    theirs = np.where((theirs >= 0) & (theirs <= 180), theirs, np.nan)
    if not np.isfinite(theirs).any():
        raise UserError("no zenith angles of the sun, which tell whether longitudes are counted east: mend the file")
    for sign in (1, -1):
        turned = place | {"longitude": sign * place["longitude"]}
        sun = sun_of(xr.Dataset(coords={"time": _of_frame(frame).time}, attrs=turned))
        if np.nanmedian(np.abs(90.0 - sun.altitude_deg - theirs)) < _SAME_ZENITH_DEG:
            return turned
    raise UserError("the sun is elsewhere at its times and place than its zenith angles say: mend the file")


@contextmanager
def _unpacked(path: Path) -> Iterator[str]:
    """Name of an unpacked copy under the file's own name, for pvlib, which reads by names: it fetches what is called
    http..., and takes all for a file of Madison that has msn anywhere in its path."""
    with tempfile.TemporaryDirectory(prefix="openswim") as folder:
        plain = Path(folder) / path.name.removesuffix(".gz")
        plain.write_text(text_of(path, "latin-1"), "ascii", "replace")
        yield str(plain)


def _midc(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    """Times are local standard time, whose name is that of their column."""
    separator, header, rows = _names_and_rows(path)
    whole = [row for row in rows if len(row) == len(header)]
    told = told_of_lost(len(rows) - len(whole), len(rows))
    columns = dict(zip(header, zip(*whole, strict=True), strict=True))
    plain = {name.upper(): texts for name, texts in columns.items()}
    zone = next((name for name in plain if name in _HOURS), None)
    if zone is None:
        raise UserError(f"no column of times that its zone names ({', '.join(_HOURS)}): name it so")
    if "YEAR" in plain:
        day = np.array([f"{_whole('Year', y):04d}-01-01" for y in plain["YEAR"]], "datetime64[D]")
        of_year = [_whole("DOY", text) for text in plain["DOY"]]
        if not 1 <= min(of_year) <= max(of_year) <= 366:
            raise UserError(f"days {min(of_year)} to {max(of_year)} of a year (DOY): mend the file")
        day = day + np.array(of_year, "timedelta64[D]") - np.timedelta64(1, "D")
        hours = [divmod(_whole(zone, text), 100) for text in plain[zone]]
    else:
        dates = [text.split("/") for text in plain[next(name for name in plain if "MM/DD/YYYY" in name)]]
        day = np.array([f"{y}-{int(m):02d}-{int(d):02d}" for m, d, y in dates], "datetime64[D]")
        hours = [(_whole(zone, text[:-3], text), _whole(zone, text[-2:], text)) for text in plain[zone]]
    minutes = [60 * hour + minute for hour, minute in hours]
    if min(minutes) < 0 or max(minutes) > 1440 or max(minute for _, minute in hours) > 59:
        raise UserError(f"hours and minutes in its column {zone} that no day has: mend the file")
    time = day.astype("datetime64[m]") + np.array(minutes, "timedelta64[m]") - np.timedelta64(_HOURS[zone], "h")
    return _of_columns(columns, time, separator).assign_attrs({"note": told}), _beside(path)


def _whole(column: str, text: str, cell: str = "") -> int:
    """A number in a cell, or in a part of it."""
    try:
        return int(text)
    except ValueError:
        what = "no time such as 12:00" if cell else "no whole number"
        raise UserError(f"{shown(cell or text)} in its column {column} is {what}: mend the file") from None


_HOURS = {"UTC": 0, "GMT": 0, "EST": -5, "CST": -6, "MST": -7, "PST": -8, "HST": -10}


def _table(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    separator, header, rows = _names_and_rows(path)
    if odd := [row for row in rows if len(row) != len(header)]:
        raise UserError(
            f"{path}: {len(odd[0])} columns in the row of {shown(odd[0][0])}, and {len(header)} names: mend the file"
        )
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    utc = columns[next(name for name in header if name.lower() == "utc")]
    if blank := [row for row, text in enumerate(utc, 1) if not text.strip()]:
        raise UserError(f"{path}: row {blank[0]} has no time in utc: mend the file")
    return _of_columns(columns, np.array([parse_time(text) for text in utc]), separator), _beside(path)


def _names_and_rows(path: Path) -> tuple[str, list[str], list[list[str]]]:
    """What divides the columns of a table, their names, and all rows."""
    separator = names_in(head_of(path))[1]
    header, *rows = rows_of(path, separator=separator)
    if not rows:
        raise UserError(f"{path}: has no rows below the names of its columns")
    header = [name.strip() for name in header]
    check_names(header)
    return separator, header, rows


def _of_columns(columns: Mapping[str, Any], time: NDArray[np.datetime64], separator: str) -> xr.Dataset:
    """Columns by their names; the mean of those of one kind (two instruments)."""
    years = time.astype("datetime64[Y]").astype(int) + 1970
    _check_years(years.min(), years.max())
    out = xr.Dataset(coords={"time": time.astype("datetime64[ns]")})
    for name in QUANTITIES:
        values = columns_of(columns, name, decimal_commas=separator != ",")
        if values is not None:
            out[name] = ("time", _measured(name, values).mean(axis=0))
    return out.assign_attrs({_LEFT_OUT: not_understood(columns)})


def _check_years(first: int, last: int) -> None:
    if not _YEARS[0] <= first <= last <= _YEARS[1]:
        raise UserError(f"times of the years {first} to {last}: no station measured then: mend the file")


def _of_frame(frame: pd.DataFrame) -> xr.Dataset:
    index = frame.index.tz_convert("UTC").tz_localize(None) if frame.index.tz is not None else frame.index
    out = xr.Dataset(coords={"time": index.values.astype("datetime64[ns]")})
    for theirs, ours in _PVLIB.items():
        if theirs in frame:
            values = _in_si(ours, frame[theirs].to_numpy(float))
            if f"{theirs}_flag" in frame:
                values = np.where(frame[f"{theirs}_flag"].to_numpy(float) == _BAD_FLAG, np.nan, values)
            out[ours] = ("time", values)
    return out


def _in_si(quantity: str, values: F64) -> F64:
    """Files have degrees Celsius, per cent and hPa."""
    if quantity == "temperature":
        return values + 273.15
    return values / 100 if quantity == "relative_humidity" else values * (100 if quantity == "pressure" else 1)


def _measured(quantity: str, values: F64) -> F64:
    """NaN where instruments can give no such value: files have -999 and others for none."""
    _, low, high = QUANTITIES[quantity]
    return np.where((values >= low) & (values <= high), values, np.nan)


def _place(lat: Any, lon: Any, height_m: Any) -> dict[str, float]:
    values = {"latitude": lat, "longitude": lon, "height_m": height_m}
    return {name: float(value) for name, value in values.items() if value is not None}


def _beside(path: Path) -> dict[str, float]:
    """The place that a JSON file beside a table names."""
    beside = path.with_suffix(".json")
    if not beside.exists():
        return {}
    try:
        about = json.loads("".join(lines_of(beside, "the place of a station", _LARGEST_JSON)))
        return _place(*(None if about.get(name) is None else number(name, about[name])
                        for name in ("lat", "lon", "elev_m")))  # fmt: skip
    except (UserError, ValueError, AttributeError, RecursionError) as error:
        why = str(error).removeprefix(f"{beside}: ")
        raise UserError(f"{beside}: no place in JSON ({why}): write lat, lon and elev_m as numbers") from None


_READERS: dict[str, Callable[[Path], tuple[xr.Dataset, dict[str, float]]]] = {
    "BSRN": _bsrn, "SURFRAD": _surfrad, "SOLRAD": _solrad, "MIDC": _midc, "ARM": read_arm, "table": _table,
}  # fmt: skip
