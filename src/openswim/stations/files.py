"""Measured irradiance: files of BSRN, SURFRAD, SOLRAD, MIDC and ARM, and plain tables, as one kind of Dataset."""

from __future__ import annotations

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
from openswim.readers.common.opening import opened
from openswim.scene.times import parse_time
from openswim.stations.text import PLACES, rows_of, text_of
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
_ARM = {"down_short_hemisp": "ghi", "short_direct_normal": "dni", "down_short_diffuse_hemisp": "dhi",
        "up_short_hemisp": "up"}  # fmt: skip
_COLUMNS = (  # of tables, by how their names begin or read
    ("ghi", r"ghi|global (horiz|cmp22|psp)"),
    ("dni", r"dni|direct (normal|chp1|nip)"),
    ("dhi", r"dhi|diffuse (horiz|cm22|cmp22|psp|8-48)"),
    ("up", r"uw"),
    ("temperature", r"temp(_air|_c)?$|(air )?temperature|deck dry bulb"),
    ("relative_humidity", r"rh$|rel(ative)?[ _]hum(idity)?"),
    ("pressure", r"(station )?press(ure)?"),
)
_LARGEST_JSON = 100_000  # characters
_MISSING_ARM_BIT = 1
_YEARS = 1900, 2200


def read_station(
    path: str | Path, lat: float | None = None, lon: float | None = None, height_m: float | None = None
) -> xr.Dataset:
    """A station's file: BSRN station-to-archive, SURFRAD, SOLRAD, MIDC, ARM radiometers, or a table (CSV) of ours.

    Returns a Dataset on ``time`` (UTC) of those of ``ghi``, ``dni``, ``dhi``, ``up`` (W m-2), ``temperature`` (K),
    ``relative_humidity`` (1), ``pressure`` (Pa) that it has, NaN where missing, with the attributes ``latitude``,
    ``longitude``, ``height_m`` and ``network``. lat, lon, height_m: of the station, where the file does not say (MIDC).
    """
    path = Path(path)
    kind = kind_of(path)
    if kind is None:
        raise UserError(f"{path}: no station file of BSRN, SURFRAD, SOLRAD, MIDC or ARM, nor a table with utc and ghi")
    try:
        data, place = _READERS[kind](path)
    except ImportError as error:
        raise UserError(f"{path}: {kind} files need the package pvlib: pip install 'openswim[stations]'") from error
    except UserError as error:
        raise UserError(str(error) if str(path.parent) in str(error) else f"{path}: {error}") from None
    except (ValueError, LookupError, OSError, TypeError, AttributeError, ArithmeticError) as error:
        raise UserError(f"{path}: damaged {kind} file ({error})") from error
    for name, value in place.items():
        low, high = PLACES[name]
        if not low <= value <= high:
            raise UserError(f"{path}: {name} = {value:g} is none: mend the file")
    given = {"latitude": lat, "longitude": lon, "height_m": height_m}
    place = place | {name: value for name, value in given.items() if value is not None}
    for name, (unit, _, _) in QUANTITIES.items():
        if name in data:
            data[name] = ("time", _measured(name, np.asarray(data[name].values, float)), {"units": unit})
    keep = [name for name in QUANTITIES if name in data and np.isfinite(data[name]).any()]
    if "ghi" not in keep and not {"dni", "dhi"} <= set(keep):
        raise UserError(f"{path}: neither global irradiance in it, nor direct and diffuse")
    lacking = sorted({"latitude", "longitude"} - place.keys())
    if lacking:
        raise UserError(f"{path}: a {kind} file does not say its {' and '.join(lacking)}: give --lat and --lon, "
                        f"or {path.with_suffix('.json').name} beside it with lat, lon and elev_m")  # fmt: skip
    data = _without_doubles(path, data[keep].sortby("time"))
    return data.assign_attrs({"height_m": 0.0} | place | {"network": kind, "source": path.name})


def _without_doubles(path: Path, data: xr.Dataset) -> xr.Dataset:
    """Without rows that stand there twice; raises UserError where two of one time differ."""
    later = np.r_[False, np.diff(data["time"].values) == np.timedelta64(0)]
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
    lines = head.decode("latin-1").lstrip("\ufeff").splitlines()
    if re.match(r"\*[CU]0001", lines[0] if lines else ""):
        return "BSRN"
    if len(lines) > 2 and re.match(r"\s*-?\d+\.\d+\s+-?\d+\.\d+\s+\d+\s*m?\b", lines[1]):
        return "SURFRAD" if len(lines[2].split()) > 40 else "SOLRAD"
    first = lines[0].lower().split(",") if lines else []
    if any("mm/dd/yyyy" in name for name in first) or {"year", "doy"} <= set(first):
        return "MIDC"
    return "table" if "utc" in first and any(name.startswith("ghi") for name in first) else None


def _bsrn(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    from pvlib.iotools import read_bsrn

    with _unpacked(path) as plain:
        frame, about = read_bsrn(plain, logical_records=("0100",))
    # longitudes are counted from 180 W and latitudes from the south pole in the archive's files
    return _of_frame(frame), _place(about.get("latitude"), about.get("longitude"), about.get("altitude"))


def _surfrad(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    from pvlib.iotools import read_surfrad

    with _unpacked(path) as plain:
        frame, about = read_surfrad(plain)
    return _of_frame(frame), _place(about["latitude"], about["longitude"], about["elevation"])


def _solrad(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    from pvlib.iotools import read_solrad

    with _unpacked(path) as plain:
        found = read_solrad(plain)
    frame = found[0] if isinstance(found, tuple) else found
    lat, lon, height = text_of(path, "latin-1").splitlines()[1].split()[:3]
    return _of_frame(frame), _place(lat, lon, height)


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
    header, *rows = rows_of(path)
    rows = [row for row in rows if len(row) == len(header)]
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    zone = next((name for name in header if name in _HOURS), None)
    if zone is None:
        raise ValueError(f"no column of {', '.join(_HOURS)}")
    clock = columns[zone]
    if "Year" in columns:
        day = np.array([f"{y}-01-01" for y in columns["Year"]], "datetime64[D]")
        day = day + np.array([int(d) - 1 for d in columns["DOY"]], "timedelta64[D]")
        minutes = [60 * (int(t) // 100) + int(t) % 100 for t in clock]
    else:
        dates = [text.split("/") for text in columns[next(n for n in header if "MM/DD/YYYY" in n)]]
        day = np.array([f"{y}-{int(m):02d}-{int(d):02d}" for m, d, y in dates], "datetime64[D]")
        minutes = [60 * int(text[:-3]) + int(text[-2:]) for text in clock]
    time = day.astype("datetime64[m]") + np.array(minutes, "timedelta64[m]") - np.timedelta64(_HOURS[zone], "h")
    return _of_columns(columns, time), _beside(path)


_HOURS = {"UTC": 0, "GMT": 0, "EST": -5, "CST": -6, "MST": -7, "PST": -8, "HST": -10}


def _arm(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    """Quality flags: bit 1 is a missing value where flags are bits; plain codes (before 2010) name no bits."""
    with opened(path) as file:
        missing = [name for name in ("lat", "lon", "alt") if name not in file]
        if missing or not any(name in file for name in _ARM):
            raise UserError(f"{path}: netCDF without {', '.join(missing or _ARM)}: no file of an ARM radiometer")
        out = xr.Dataset(coords={"time": file.time.values})
        for theirs, ours in _ARM.items():
            if theirs not in file:
                continue
            values = file[theirs].values.astype(float)
            flags = file.get(f"qc_{theirs}")
            if flags is not None and _by_bits(file, flags):
                values = np.where(flags.values.astype(int) & _MISSING_ARM_BIT, np.nan, values)
            out[ours] = ("time", values)
        return out, _place(*(file[name].values for name in ("lat", "lon", "alt")))


def _by_bits(file: xr.Dataset, flags: xr.DataArray) -> bool:
    bits = ("flag_masks", "bit_1_description")
    return any(name in flags.attrs for name in bits) or any(name in file.attrs for name in ("qc_bit_1_description",))


def _table(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    header, *rows = rows_of(path)
    if not rows:
        raise UserError(f"{path}: has no rows below the names of its columns")
    if odd := [row for row in rows if len(row) != len(header)]:
        raise UserError(
            f"{path}: {len(odd[0])} columns in the row of {shown(odd[0][0])}, and {len(header)} names: mend the file"
        )
    columns = dict(zip(map(str.strip, header), zip(*rows, strict=True), strict=True))
    time = np.array([parse_time(text) for text in columns["utc"]], "datetime64[ms]")
    return _of_columns(columns, time), _beside(path)


def _of_columns(columns: Mapping[str, Any], time: NDArray[np.datetime64]) -> xr.Dataset:
    """Columns by their names; the mean of those of one kind (two instruments)."""
    years = time.astype("datetime64[Y]").astype(int) + 1970
    if years.size and not (years.min() >= _YEARS[0] and years.max() <= _YEARS[1]):
        raise UserError(f"times of the years {years.min()} to {years.max()}: no station measured then: mend the file")
    out = xr.Dataset(coords={"time": time.astype("datetime64[ns]")})
    for ours, pattern in _COLUMNS:
        names = [n for n in columns if re.match(pattern, n.strip().lower().split(" [")[0])]
        if ours == "temperature" and len(names) > 1:
            names = [n for n in names if "2m" in n][:1] or names[:1]
        if names:
            values = np.array([[float(v) if v.strip() else np.nan for v in columns[n]] for n in names])
            out[ours] = ("time", _measured(ours, _in_si(ours, values)).mean(axis=0))
    return out


def _of_frame(frame: pd.DataFrame) -> xr.Dataset:
    index = frame.index.tz_convert("UTC").tz_localize(None) if frame.index.tz is not None else frame.index
    out = xr.Dataset(coords={"time": index.values.astype("datetime64[ns]")})
    for theirs, ours in _PVLIB.items():
        if theirs in frame:
            out[ours] = ("time", _in_si(ours, frame[theirs].to_numpy(float)))
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
    "BSRN": _bsrn, "SURFRAD": _surfrad, "SOLRAD": _solrad, "MIDC": _midc, "ARM": _arm, "table": _table,
}  # fmt: skip
