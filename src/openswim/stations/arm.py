"""Broadband radiometers of ARM: netCDF of SIRS, SKYRAD and BRS, and of what is made from them (QCRAD, RADFLUX).

Those of MFRSR are left out: their broadband is that of a silicon diode."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.readers.common.opening import opened
from openswim.scene.times import with_signed_zone
from openswim.stations.columns import of_light

F64 = NDArray[np.float64]

_NAMES = {  # the first that is there and has values
    "ghi": ("BestEstimate_down_short_hemisp", "down_short_hemisp", "downwelling_shortwave"),
    "dni": ("short_direct_normal",),
    "dhi": ("down_short_diffuse_hemisp", "diffuse_downwelling_shortwave"),
    "up": ("up_short_hemisp", "upwelling_shortwave"),
}
_PLACE = {"latitude": "lat", "longitude": "lon", "height_m": "alt"}
_STILL = 0.01  # degrees, or metres at sea: stations that move by more are ships
_MASKS, _MEANINGS, _ASSESSMENTS = "flag_masks", "flag_meanings", "flag_assessments"


def read_arm(path: Path) -> tuple[xr.Dataset, dict[str, float]]:
    """Light on time, and the place."""
    with opened(path, decode=False) as file:
        every = [name for names in _NAMES.values() for name in names]
        if not any(name in file for name in every):
            raise UserError(f"{path}: netCDF without any of {', '.join(every)}: no file of an ARM broadband radiometer")
        time = _times(path, file)
        out = xr.Dataset(coords={"time": time})
        for quantity, names in _NAMES.items():
            for name in names:
                values = _values(path, file, name, time.size) if name in file else None
                if values is not None and np.isfinite(values).any():
                    out[quantity] = ("time", values)
                    break
        place = {ours: _one(path, theirs, file[theirs].values) for ours, theirs in _PLACE.items() if theirs in file}
        return out, {name: value for name, value in place.items() if np.isfinite(value)}


def _times(path: Path, file: xr.Dataset) -> NDArray[np.datetime64]:
    """``time``, else ``time_offset``, which may be counted from ``base_time``."""
    for name in ("time", "time_offset"):
        if name not in file.variables:
            continue
        variable = file[name].variable
        unit = str(variable.attrs.get("units", "seconds"))
        if "base_time" in file and ("since" not in unit or "base" in unit):
            if not re.match(r"s(ec(onds?)?)?\b", unit):
                break
            base = np.ravel(file["base_time"].values)[0]
            unit = f"seconds since {np.datetime64('1970-01-01T00:00:00') + np.timedelta64(int(base), 's')}"
        variable = variable.copy(deep=False)
        variable.attrs["units"] = with_signed_zone(unit)
        values = xr.decode_cf(xr.Dataset({"found": variable}), decode_timedelta=False)["found"].values
        if values.dtype.kind == "M":
            return values
    raise UserError(f"{path}: no times: neither time nor time_offset has units such as 'seconds since 2019-01-01', or "
                    "counts seconds from base_time: download the file again")  # fmt: skip


def _values(path: Path, file: xr.Dataset, name: str, count: int) -> F64:
    """W m-2, NaN where bad."""
    data = file[name].squeeze()
    if data.size != count:
        raise UserError(f"{path}: {name} has {data.size} values for {count} times: download the file again")
    factor = of_light(str(data.attrs.get("units", "")))
    if factor is None:
        raise UserError(f"{path}: {name} is in {shown(data.attrs['units'])}, and not in W/m2: give a file of "
                        "calibrated values")  # fmt: skip
    values = data.values.astype(float).reshape(count) * factor
    flags = file.get(f"qc_{name}")
    if flags is None:
        return values
    bad = _bad_bits(file, flags)
    return np.where(np.nan_to_num(flags.values).astype(int).reshape(count) & bad, np.nan, values)


def _bad_bits(file: xr.Dataset, flags: xr.DataArray) -> int:
    """All bits that stand for values that are missing or bad; 0: flags are codes (before 2010), or not described.

    Bits for what is beyond a limit are left out: those of instruments are passed every night, and ours follow the sun.
    """
    bad = 0
    for bit, meaning, assessment in _bits(file, flags):
        beyond = re.search(r"(less|greater)[ _]than", meaning) and "missing" not in meaning
        said_bad = assessment == "bad" and not beyond
        if said_bad or (not assessment and "missing" in meaning):
            bad |= bit
    return bad


def _bits(file: xr.Dataset, flags: xr.DataArray) -> Iterator[tuple[int, str, str]]:
    """Each bit with its meaning and its assessment ("" where none is given), in small letters."""
    about = flags.attrs
    if _MASKS in about:
        masks = [int(mask) for mask in np.atleast_1d(about[_MASKS])]
        meanings, assessments = (_words(about.get(key, "")) for key in (_MEANINGS, _ASSESSMENTS))
        for number, mask in enumerate(masks):
            meaning, assessment = (words[number] if number < len(words) else "" for words in (meanings, assessments))
            yield mask, meaning, assessment
        return
    for where, prefix in ((about, ""), (file.attrs, "qc_")):
        found = [match for name in where if (match := re.fullmatch(rf"{prefix}bit_(\d+)_description", str(name)))]
        for match in found:
            assessment = where.get(f"{prefix}bit_{match[1]}_assessment", "")
            yield 1 << (int(match[1]) - 1), str(where[match[0]]).lower(), str(assessment).lower()
        if found:
            return


def _words(value: Any) -> list[str]:
    """A list of texts, or texts divided by blanks."""
    return [str(word).strip().lower() for word in (value.split() if isinstance(value, str) else np.atleast_1d(value))]


def _one(path: Path, name: str, values: Any) -> float:
    """Of a station that stands still, whether its place is there once or at every time."""
    known = np.asarray(values, float)
    known = known[np.isfinite(known)]
    if known.size and np.ptp(known) > (10.0 if name == "alt" else _STILL):
        raise UserError(f"{path}: {name} goes from {known.min():g} to {known.max():g}: a station that moves, as a ship "
                        "does: give a file of one that stands still")  # fmt: skip
    return float(np.median(known)) if known.size else float("nan")
