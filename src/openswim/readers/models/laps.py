"""LAPS analyses and forecasts (netCDF): lwc, lt1, lga, lq3, lh3, lsx, lm2, fua, fsf and the static file.

Each product is a file; give those of one time together: `openswim render x.lwc x.lt1 x.lsx ...`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.readers.gridded.reader import GriddedReader

LAPS_EARTH_RADIUS_M = 6_371_200.0
# LAPS name: name of names.py, standard_name
ON_LEVELS = {
    "lwc": "liquid_content",
    "ice": "ice_content",
    "rai": "rain_content",
    "sno": "snow_content",
    "pic": "graupel_content",
    "ht": "gh",
    "t3": "temperature",
    "sh": "hus",
    "rh3": "hur",
    "lcp": "cloud_fraction",
}
ON_THE_GROUND = {
    "ter": "surface_altitude",
    "avg": "surface_altitude",
    "ldf": "lsm",
    "sc": "snowc",
    "ps": "ps",
    "psf": "ps",
    "u": "u10",
    "usf": "u10",
    "v": "v10",
    "vsf": "v10",
    "lat": "latitude",
    "lon": "longitude",
}
_SAID = {"u10": "x_wind", "v10": "y_wind", "latitude": "latitude", "longitude": "longitude"}  # wind: along the grid


class LAPSReader(GriddedReader):
    """Reads LAPS products by the names, units and navigation of their schemas."""

    name = "LAPS"

    def recognises(self, data: xr.Dataset) -> bool:
        """LAPS products and static files: their dimensions and navigation variables."""
        return {"x", "y", "z"} <= set(data.dims) and {"La1", "Lo1", "Dx", "grid_type"} <= set(data.variables)

    def adapt(self, path: Path, data: xr.Dataset) -> xr.Dataset:
        """The product as CF: coordinates from its navigation, names and units as names.py knows them."""
        axes, mapping = _navigation(path, data)
        flat = data.sizes["z"] == 1
        names = ON_THE_GROUND if flat else ON_LEVELS
        out: dict[str, Any] = {"crs": ((), 0, mapping)}
        for name, target in names.items():
            if name not in data.variables or target in out:
                continue
            field = data[name]
            for dim in ("z",) if flat else ():
                field = field.isel({dim: 0}) if dim in field.dims else field
            attrs = {"units": str(field.attrs.get("units", "1")), "grid_mapping": "crs", "called": name}
            if target in _SAID:
                attrs["standard_name"] = _SAID[target]
            if target == "snowc":  # the schema gives units of a template
                attrs["units"] = "1"
            if target == "hus":
                attrs["units"] = "kg kg-1"
            out[target] = field.rename(target).assign_attrs(attrs).drop_vars(field.coords, errors="ignore")
            out[target].attrs = attrs
        coords: dict[str, Any] = {
            name: (name, values, {"standard_name": f"projection_{name}_coordinate", "units": "m"})
            for name, values in zip(("x", "y"), axes, strict=True)
        }
        if mapping["grid_mapping_name"] == "latitude_longitude":
            for name, said in (("x", "longitude"), ("y", "latitude")):
                coords[name] = (name, coords[name][1], {"standard_name": said, "units": "degrees"})
        if not flat and "level" in data.variables:
            level = np.asarray(data["level"].values, np.float64)
            coords["z"] = ("z", level, {"units": "hPa", "standard_name": "air_pressure"})
        if "valtime" in data.variables:
            coords["valtime"] = data["valtime"].variable
        return xr.Dataset(out, coords=coords, attrs=dict(data.attrs))


def _navigation(path: Path, data: xr.Dataset) -> tuple[tuple[Any, Any], dict[str, Any]]:
    """Node coordinates and CF grid mapping from LAPS's navigation variables (GRIB-1 names)."""
    from pyproj import CRS, Transformer

    def number(name: str) -> float:
        value = float(np.asarray(data[name].values).ravel()[0]) if name in data.variables else np.nan
        if not np.isfinite(value):
            raise UserError(f"{path}: the navigation variable {name} is missing: the grid cannot be placed")
        return value

    kind = _text(data["grid_type"])
    nx, ny = data.sizes["x"], data.sizes["y"]
    la1, lo1, dx, dy = (number(name) for name in ("La1", "Lo1", "Dx", "Dy"))
    sphere = f"+R={LAPS_EARTH_RADIUS_M} +no_defs"
    if "lambert" in kind:
        first, second = number("Latin1"), number("Latin2")
        crs = CRS.from_proj4(f"+proj=lcc +lat_1={first} +lat_2={second} +lat_0={first} +lon_0={number('LoV')} {sphere}")
    elif "polar" in kind:
        true = number("Latin1") if "Latin1" in data.variables else 60.0
        pole = np.copysign(90.0, true)
        crs = CRS.from_proj4(f"+proj=stere +lat_0={pole} +lat_ts={true} +lon_0={number('LoV')} {sphere}")
    elif "mercator" in kind:
        crs = CRS.from_proj4(f"+proj=merc +lat_ts={number('Latin1')} +lon_0={lo1} {sphere}")
    elif "lat" in kind:
        crs = CRS.from_proj4(f"+proj=longlat {sphere}")
        return (lo1 + dx * np.arange(nx), la1 + dy * np.arange(ny)), dict(crs.to_cf())
    else:
        raise UserError(f"{path}: grid_type {shown(kind)} is not known: make it lambert, polar, mercator or latlon")
    if not (dx > 0 and dy > 0):
        raise UserError(f"{path}: Dx, Dy are {dx}, {dy}; they must be positive metres")
    x0, y0 = Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True).transform((lo1 + 180.0) % 360.0 - 180.0, la1)
    return (x0 + dx * np.arange(nx), y0 + dy * np.arange(ny)), dict(crs.to_cf())


def _text(field: xr.DataArray) -> str:
    raw = np.asarray(field.values)
    joined = b"".join(np.atleast_1d(raw).astype("S").ravel().tolist())
    return joined.decode("ascii", "replace").strip("\0 ").lower()
