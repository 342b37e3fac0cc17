"""Saving a scene in its documented CF layout (docs/scene-format.md), as netCDF or Zarr."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from openswim.scene.atmosphere import Atmosphere
from openswim.scene.files import written_whole
from openswim.scene.grid import Grid
from openswim.scene.optics import Optics
from openswim.scene.times import since_1970_s
from openswim.scene.variables import DIRECT_PREFIX

LAYOUT = 1
GRID_MAPPING = "crs"
AEROSOL = "aerosol_background"  # and aerosol_background_2 ... for more layers
# file variable of each gas profile, with the Atmosphere field it holds
PROFILES = {
    "profile_height": ("height_m", {"units": "m", "standard_name": "altitude", "positive": "up"}),
    "profile_pressure": ("pressure_pa", {"units": "Pa", "standard_name": "air_pressure"}),
    "profile_temperature": ("temperature_k", {"units": "K", "standard_name": "air_temperature"}),
    "profile_ozone": ("ozone_per_m3", {"units": "m-3", "long_name": "ozone molecules per volume of air"}),
}
FIELDS = "openswim_fields"  # attribute: names of what was written, by which is seen what was lost since
VAPOUR_PROFILE = "profile_water_vapour"  # kg m-3, where there is one
_AXES = {
    "projected": (("projection_x_coordinate", "m"), ("projection_y_coordinate", "m")),
    "geographic": (("longitude", "degrees_east"), ("latitude", "degrees_north")),
    "rotated": (("grid_longitude", "degrees"), ("grid_latitude", "degrees")),
}


def save_netcdf(data: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write netCDF-4, compressed; whole or not at all."""
    with written_whole(path) as partial:
        packed = {"zlib": True, "complevel": 1, "shuffle": True}
        encoding: dict[str, Any] = {
            str(name): _fill(data, name) | (packed if each.ndim else {}) for name, each in data.variables.items()
        }
        data.to_netcdf(partial, engine="netcdf4", encoding=encoding)


def save_zarr(data: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a Zarr folder (format 2, consolidated); whole or not at all."""
    with written_whole(path) as partial:
        encoding: dict[str, Any] = {str(name): _fill(data, name) for name in data.variables}
        # with pieces of nothing but zeros: a store without them could have lost them, and its time if that is 1970
        data.to_zarr(
            partial, mode="w", encoding=encoding, zarr_format=2, consolidated=True, write_empty_chunks=True
        )  # fmt: skip


def in_layout(
    fields: xr.Dataset,
    grid: Grid | None,
    optics: Mapping[str, Optics],
    atmosphere: Atmosphere | None,
    time: np.datetime64 | None,
    history: Mapping[str, str],
) -> xr.Dataset:
    """A scene as it stands in a file: fields, coordinates, grid mapping, profiles, time, and its source and notes."""
    data = fields.copy()
    if grid is not None:
        data = _with_grid(data, grid)
    for name, own in optics.items():
        target = "aerosol_extinction" if name == "aerosol" else f"{DIRECT_PREFIX}{name}"
        data[target].attrs |= {
            "kind": own.kind,
            "single_scattering_albedo": _albedo_attribute(own.single_scattering_albedo),
            "phase_function": json.dumps(_phase_dict(own.phase)),
        }
        if own.angstrom_exponent is not None:
            data[target].attrs["angstrom_exponent"] = float(own.angstrom_exponent)
        if own.relative_extinction is not None:
            data[target].attrs["relative_extinction"] = _albedo_attribute(own.relative_extinction)
    data.attrs = {"Conventions": "CF-1.11", "title": "OpenSWIm scene", "openswim_layout": LAYOUT, **history}
    data.attrs[FIELDS] = " ".join(sorted(map(str, fields.data_vars)))
    if grid is not None:
        data.attrs |= {"earth_radius_m": float(grid.earth_radius_m), "periodic_sides": int(grid.periodic)}
    if time is not None:
        said = {"standard_name": "time", "units": "seconds since 1970-01-01 00:00:00", "calendar": "standard"}
        data = data.assign_coords(time=((), since_1970_s(time), said))
    return _with_atmosphere(data, atmosphere)


def _fill(data: xr.Dataset, name: Any) -> dict[str, Any]:
    # fields are never missing, but a lost piece of a Zarr folder must not read as zeros
    kind = data.variables[name].dtype
    if kind.kind != "f":
        return {}
    return {"_FillValue": None if name in data.coords else kind.type(np.nan)}


def _with_grid(data: xr.Dataset, grid: Grid) -> xr.Dataset:
    if grid.crs is None:
        for name in ("x", "y"):
            data[name].attrs = {"units": "m", "long_name": f"{name} (Cartesian)"}
        return data
    kind = "projected" if not grid.in_degrees else "rotated" if grid.crs.is_derived else "geographic"
    for name, (standard_name, units) in zip(("x", "y"), _AXES[kind], strict=True):
        data[name].attrs = {"standard_name": standard_name, "units": units}
    for field in data.data_vars.values():
        if "x" in field.dims:
            field.attrs["grid_mapping"] = GRID_MAPPING
    lon, lat = grid.lonlat(np.arange(grid.x.size), np.arange(grid.y.size)[:, None])
    data = data.assign_coords(
        lon=(("y", "x"), lon, {"standard_name": "longitude", "units": "degrees_east"}),
        lat=(("y", "x"), lat, {"standard_name": "latitude", "units": "degrees_north"}),
    )
    data[GRID_MAPPING] = ((), np.int32(0), _plain(grid.crs.to_cf()))
    return data


def _albedo_attribute(albedo: Any) -> Any:
    if isinstance(albedo, Mapping):
        return json.dumps({str(wavelength): float(value) for wavelength, value in albedo.items()})
    return albedo if isinstance(albedo, float) else [float(a) for a in albedo]


def _phase_dict(phase: Any) -> dict[str, Any]:
    if isinstance(phase, Mapping):
        return {"spectral": {str(wavelength): each.to_dict() for wavelength, each in phase.items()}}
    described: dict[str, Any] = phase.to_dict()
    return described


def _plain(attributes: dict[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in attributes.items()}


def _with_atmosphere(data: xr.Dataset, atmosphere: Atmosphere | None) -> xr.Dataset:
    if atmosphere is None:
        data.attrs["atmosphere"] = "none"
        return data
    for name, (source, attributes) in PROFILES.items():
        data[name] = (("profile",), np.asarray(getattr(atmosphere, source), np.float64), dict(attributes))
    if atmosphere.vapour_kg_m3 is not None:
        said = {"units": "kg m-3", "long_name": "density of water vapour"}
        data[VAPOUR_PROFILE] = (("profile",), atmosphere.vapour_kg_m3, said)
    for number, layer in enumerate(atmosphere.layers):
        described = {key: _attribute(value) for key, value in layer.to_dict().items()}
        name = AEROSOL if number == 0 else f"{AEROSOL}_{number + 1}"
        data[name] = ((), np.int32(0), {"long_name": "uniform background aerosol"} | described)
    return data


def _attribute(value: Any) -> Any:
    if isinstance(value, dict):
        return json.dumps(value)
    return int(value) if isinstance(value, bool) else value
