"""Columns of the ECMWF radiation scheme (ecRad input) along one meridian, as a curtain of sky."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from openswim.errors import UserError
from openswim.readers.common.bounds import check_size, check_sizes
from openswim.readers.fields.air import standard_height_m
from openswim.readers.gridded.reader import GriddedReader
from openswim.scene.times import since_1970_s

_COPIES = 7  # columns of the curtain either side of the meridian
_VISIBLE_BAND = 2  # .44-.69 um of the IFS's six albedo bands
_FIELDS = {
    "q_liquid": ("liquid_content", "kg kg-1"),
    "q_ice": ("ice_content", "kg kg-1"),
    "re_liquid": ("liquid_effective_radius", "m"),
    "re_ice": ("ice_effective_radius", "m"),
    "cloud_fraction": ("cloud_fraction", "1"),
    "q": ("hus", "kg kg-1"),
}
# The IFS's twelve aerosols in order, by CAMS names; the twelfth is stratospheric sulphate.
_AEROSOLS = [f"aermr{number:02d}" for number in range(1, 12)]


class IFSColumnsReader(GriddedReader):
    """Reads ecRad input whose columns lie in a row; every place east and west of it looks the same."""

    name = "IFS columns"

    def recognises(self, data: xr.Dataset) -> bool:
        return {"pressure_hl", "temperature_hl", "q_liquid"} <= set(data.variables) and "column" in data.dims

    def adapt(self, path: Path, data: xr.Dataset) -> xr.Dataset:
        """Columns as rows of a grid that is a few columns wide; pressure and temperature from half levels."""
        if not {"lat", "lon"} <= set(data.variables):
            raise UserError(f"{path}: columns without lat and lon cannot be placed: add them")
        check_sizes(path, data)
        lat, lon = (np.asarray(data[name].values, np.float64) for name in ("lat", "lon"))
        if lat.size < 2 or np.ptp(lon) > 0.1 or not (np.abs(np.sign(np.diff(lat)).sum()) == lat.size - 1):
            raise UserError(
                f"{path}: {lat.size} columns that do not lie in a row along a meridian: no picture can be made of "
                "columns scattered over the Earth; write them on a grid"
            )
        step = float(np.abs(np.diff(lat)).mean())
        lons = float(lon.mean()) + step * np.arange(-_COPIES, _COPIES + 1)
        dims = ("level", "latitude", "longitude")

        def spread(columns: Any) -> Any:
            values = np.asarray(columns, np.float32)
            return np.repeat(values.T[..., None], lons.size, axis=-1) if values.ndim == 2 else np.repeat(
                values[:, None], lons.size, axis=-1)  # fmt: skip

        above = max((size for dim, size in data["q_liquid"].sizes.items() if dim != "column"), default=0)
        for name in ("pressure_hl", "temperature_hl"):
            if data[name].size != (above + 1) * lat.size:
                raise UserError(f"{path}: {name} is not between and around the {above} levels of q_liquid: damaged")
        check_size(path, "pressure_hl", (*data["pressure_hl"].shape, lons.size))
        half = np.asarray(data["pressure_hl"].transpose("column", ...).values, np.float64)
        if not (half[:, :1] >= 0).all() or not (np.diff(half, axis=1) > 0).all():
            raise UserError(f"{path}: pressure_hl does not rise from 0 or more at the top to the ground: damaged")
        warm = np.asarray(data["temperature_hl"].transpose("column", ...).values, np.float64)
        out: dict[str, Any] = {
            "pressure": (dims, spread(0.5 * (half[:, 1:] + half[:, :-1])), {"units": "Pa"}),
            "temperature": (dims, spread(0.5 * (warm[:, 1:] + warm[:, :-1])), {"units": "K"}),
        }
        for name, (target, units) in _FIELDS.items():
            if name in data.variables:
                values = data[name].transpose("column", "level").values
                out[target] = (dims, spread(values), {"units": units, "called": name})
        if "aerosol_mmr" in data.variables:
            every = data["aerosol_mmr"].transpose("column", "aerosol_type", "level")
            for index, name in enumerate(_AEROSOLS[: every.sizes["aerosol_type"]]):
                out[name] = (dims, spread(every[:, index].values), {"units": "kg kg-1"})
        surface = half[:, -1]
        ground = ("latitude", "longitude")
        out["ps"] = (ground, spread(surface), {"units": "Pa"})
        height = np.where(surface < 95_000.0, np.maximum(standard_height_m(surface), 0.0), 0.0)
        out["surface_altitude"] = (ground, spread(height), {"units": "m"})
        if "sw_albedo" in data.variables and data["sw_albedo"].sizes.get("sw_albedo_band", 0) > _VISIBLE_BAND:
            out["albedo"] = (ground, spread(data["sw_albedo"].values[:, _VISIBLE_BAND]), {"units": "1"})
        coords: dict[str, Any] = {
            "latitude": ("latitude", lat, {"units": "degrees_north"}),
            "longitude": ("longitude", lons, {"units": "degrees_east"}),
        }
        when = _time(str(data.attrs.get("comment", "")), str(data.attrs.get("history", "")))
        if when is not None:
            coords["time"] = ((), since_1970_s(when), {"units": "seconds since 1970-01-01"})
        notes = [
            f"columns along a meridian: the sky is the same {step * _COPIES:.0f} degrees east and west of it",
            "no orography in the file: the height at which the standard atmosphere has the surface pressure, where "
            "that is below 950 hPa",
        ]
        attrs = {"title": "IFS columns (ecRad input)", "openswim_notes": "\n".join(notes)}
        return xr.Dataset(out, coords=coords, attrs=attrs)


def _time(comment: str, history: str) -> np.datetime64 | None:
    """The date and hour that ecRad's sample files tell in prose."""
    date = re.search(r"(\d{1,2} [A-Z][a-z]+ \d{4})", comment)
    if date is None:
        return None
    try:
        day = np.datetime64(datetime.strptime(date[1], "%d %B %Y"), "ms")
    except ValueError:
        return None
    hour = re.search(r"for (\d{1,2}(?:\.\d+)?) UTC", history)
    return day + np.timedelta64(round(3.6e6 * float(hour[1] if hour else 12.0)), "ms")
