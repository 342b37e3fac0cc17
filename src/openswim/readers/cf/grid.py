"""The grid of a file in the documented layout: axes, projection and heights, all turned to ascend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import number
from openswim.errors import UserError
from openswim.readers.common.projections import crs_of
from openswim.scene import Grid
from openswim.scene.cf import GRID_MAPPING
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.labels.units import canonical, conversion

if TYPE_CHECKING:
    from pyproj import CRS


def upright(data: xr.Dataset) -> xr.Dataset:
    """The dataset with x, y and height ascending: levels from the top, rows from the north and longitudes over the date
    line are common."""
    if "x" in data.variables and data["x"].ndim == 1 and canonical(str(data["x"].attrs.get("units", ""))) == "degrees":
        data = data.assign_coords(x=data["x"].copy(data=np.unwrap(data["x"].values, period=360.0)))
    for name in ("x", "y"):
        if name in data.variables and data[name].ndim == 1 and data[name].size > 1:
            values = np.asarray(data[name].values)
            if values[0] > values[-1]:
                data = data.isel({name: slice(None, None, -1)})
    if "height" in data.variables and "z" in data["height"].dims and data.sizes["z"] > 1:
        ends = data["height"].isel(z=[0, -1]).mean([dim for dim in data["height"].dims if dim != "z"]).values
        if ends[0] > ends[1]:
            data = data.isel(z=slice(None, None, -1))
    return data


def grid_of(data: xr.Dataset, notes: list[str]) -> Grid | None:
    """The grid of an upright dataset at one time; None for a file without levels (a clear sky)."""
    if "z" not in data.dims and "x" not in data.dims:
        return None
    for name in ("x", "y", "height"):
        if name not in data.variables:
            raise UserError(f"the coordinate {name} is missing: docs/scene-format.md shows what a file needs")
    crs = _crs(data)
    radius = _earth_radius_m(data, crs, notes)
    if crs is None and _is_longitude(data["x"]):
        from pyproj import CRS

        crs = CRS.from_proj4(f"+proj=longlat +R={radius} +no_defs")
        notes.append(
            f"no grid mapping in the file: latitudes and longitudes on a sphere of {radius / 1e3:.0f} km"
        )
    angles = crs is not None and crs.is_geographic
    x, y = (_converted(data[name], "degrees" if angles else "m", (name,)) for name in ("x", "y"))
    dims = ("z",) if data["height"].ndim == 1 else ("z", "y", "x")
    sides = data.attrs.get("periodic_sides", 0)
    if str(sides) not in ("0", "1"):
        raise UserError(f"attribute periodic_sides is {str(sides)[:20]!r}: give 0, or 1 for sides that repeat")
    periodic = str(sides) == "1"
    return Grid(x, y, _converted(data["height"], "m", dims), crs, radius, periodic)


def _crs(data: xr.Dataset) -> CRS | None:
    named = {
        str(field.attrs.get("grid_mapping") or field.encoding.get("grid_mapping") or "")
        for field in data.data_vars.values()
    }
    name = next(iter(named - {""}), GRID_MAPPING)
    return crs_from_cf(name, data[name].attrs) if name in data.variables else None


def crs_from_cf(name: str, attributes: Mapping[Any, Any]) -> CRS:
    """The projection that the attributes of a CF grid mapping variable describe."""
    from pyproj.exceptions import CRSError

    try:
        return crs_of(attributes)
    except (CRSError, KeyError, ValueError, TypeError) as error:
        raise UserError(
            f"the grid mapping {name} is not understood ({' '.join(str(error).split())[:120]}): "
            "write it with pyproj's CRS.to_cf()"
        ) from error


def _earth_radius_m(data: xr.Dataset, crs: CRS | None, notes: list[str]) -> float:
    if "earth_radius_m" in data.attrs:
        return number("attribute earth_radius_m", data.attrs["earth_radius_m"])
    return sphere_of(crs, notes)


def sphere_of(crs: CRS | None, notes: list[str]) -> float:
    """Radius [m] of the sphere that a projection stands on; 6371 km for none and for ellipsoids."""
    if crs is None or crs.ellipsoid is None:
        return EARTH_RADIUS_M
    if crs.ellipsoid.inverse_flattening == 0.0:
        return float(crs.ellipsoid.semi_major_metre)
    notes.append("the projection is on an ellipsoid: its latitudes are used on a sphere of 6371 km")
    return EARTH_RADIUS_M


def _is_longitude(axis: xr.DataArray) -> bool:
    units = str(axis.attrs.get("units", "")).lower()
    return axis.attrs.get("standard_name") == "longitude" or units in ("degrees_east", "degree_east")


def _converted(axis: xr.DataArray, units: str, dims: tuple[str, ...]) -> NDArray[Any]:
    if set(axis.dims) != set(dims):
        found_dims = ", ".join(map(str, axis.dims))
        raise UserError(
            f"the coordinate {axis.name} has dimensions ({found_dims}); it must have ({', '.join(dims)})"
        )
    found = str(axis.attrs.get("units", units))
    factor = conversion(found, units)
    if factor is None:
        places = "; longitude and latitude are degrees_east, degrees_north" if axis.name in ("x", "y") else ""
        raise UserError(f"the coordinate {axis.name} is in {canonical(found)!r}; it must be in {units!r}{places}")
    values = np.asarray(axis.transpose(*dims).values)
    return values if factor == (1.0, 0.0) else factor[0] * values + factor[1]
