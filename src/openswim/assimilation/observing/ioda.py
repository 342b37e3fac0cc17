"""Observations in JEDI's layout (IODA, version 3): netCDF groups of Location and Channel."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import takes
from openswim.assimilation.observing.instruments import sun_at
from openswim.assimilation.observing.observations import check_observed
from openswim.assimilation.observing.operator import Operator
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError
from openswim.scene.files import check_target, written_whole
from openswim.scene.frame import azimuth_altitude, scene_frame

F64 = NDArray[np.float64]

# what JEDI's converters call these (VIIRS and AHI: "albedo" of the sun's light reflected, "radiance")
NAMES = {"radiance": ("radiance", "W m-2 sr-1 nm-1"), "reflectance_factor": ("albedo", "1")}
IRRADIANCE = ("globalHorizontalIrradiance", "W m-2")  # of which JEDI's tables have no name that we know
_FILL_FLOAT, _FILL_INT = np.float32(-3.3687953e38), np.int32(-2147483643)
_NOT_USED = 1  # PreQC other than 0 is not assimilated
_EPOCH = "seconds since 1970-01-01T00:00:00Z"


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the observations (n,) of one instrument are made, and how it looks; degrees and metres."""

    latitude: F64
    longitude: F64
    height: F64
    zenith: F64
    azimuth: F64
    sun: tuple[float, float]  # azimuth, altitude
    station: str
    time: np.datetime64


@takes
def write_observations(
    path: str | os.PathLike[str], op: Operator, observed: xr.Dataset, seen: xr.DataArray | None = None
) -> list[Path]:
    """Write what was observed, and what is seen of a state (``hofx``), as files that IODA reads; returns their paths.

    Cameras' radiances or reflectance factors go to ``path``, irradiance to a file beside it named
    ``<stem>_irradiance.nc``. Observations that may not be used have PreQC 1. Of a camera that looks down a location is
    where a ray meets the ground at height 0; of one that looks up, where the camera stands, and sensorZenithAngle and
    sensorAzimuthAngle are those of the ray's direction.
    """
    files = observation_files(path, op)
    check_observed(op, observed)
    for name, cameras in files.items():
        check_target(name)
        with written_whole(name) as partial:
            _write(partial, op, observed, seen, cameras)
    return list(files)


def observation_files(path: str | os.PathLike[str], op: Operator) -> dict[Path, bool]:
    """The files that `write_observations` makes, and whether each is that of cameras; raises UserError where IODA has
    no names for what is observed."""
    target = Path(path)
    if any(one.time is None for one in op.of_times):
        raise UserError(f"{target}: the observations have no time: observe(..., time=...) gives them one")
    names = {each.quantity.name for each in op.instruments}
    if len(names) > 1 or not names <= NAMES.keys():
        raise UserError(f"{target}: IODA has no name for {', '.join(sorted(names))}: observe radiance, or all the same")
    files = {target: True} if op.instruments else {}
    return files | ({target.with_name(f"{target.stem}_irradiance.nc"): False} if len(op.points) else {})


def _write(path: Path, op: Operator, observed: xr.Dataset, seen: xr.DataArray | None, cameras: bool) -> None:
    from netCDF4 import Dataset

    places = [place for one in op.of_times for place in (_of_cameras(one) if cameras else _of_points(one))]
    variable, units = NAMES[op.instruments[0].quantity.name] if cameras else IRRADIANCE
    rows: dict[str, NDArray[Any]] = {"ObsValue": observed["value"].values, "ObsError": observed["error"].values,
                                     "PreQC": np.where(observed["use"].values, 0, _NOT_USED)}  # fmt: skip
    rows |= {} if seen is None else {"hofx": np.asarray(seen)}
    parts = op.parts[: len(op.instruments)] if cameras else op.parts[-1:]
    dims = ("Location", "Channel") if cameras else ("Location",)
    with Dataset(path, "w", format="NETCDF4") as file:
        file.setncattr("_ioda_layout", "ObsGroup")
        file.setncattr("_ioda_layout_version", np.int32(3))
        file.setncattr("converter", "openswim")
        file.setncattr("source", op.scene.source)
        count = sum(part.shape[1] for part in parts)
        file.createDimension("Location", count)
        file.createVariable("Location", "i4", ("Location",))[:] = np.arange(count)
        if cameras:
            channels = op.instruments[0].quantity.channels
            file.createDimension("Channel", len(channels))
            file.createVariable("Channel", "i4", ("Channel",))[:] = np.arange(1, len(channels) + 1)
        _meta(file.createGroup("MetaData"), op, places, cameras)
        for group, row in rows.items():
            table = np.concatenate([row[part.here].reshape(part.shape).T for part in parts])
            kind, fill = ("i4", _FILL_INT) if group == "PreQC" else ("f4", _FILL_FLOAT)
            made = file.createGroup(group).createVariable(variable, kind, dims, fill_value=fill, zlib=True)
            made[:] = table if cameras else table[:, 0]
            if group != "PreQC":
                made.setncattr("units", units)


def _meta(group: Any, op: Operator, places: list[_Places], cameras: bool) -> None:
    def put(name: str, values: Any, units: str, dims: tuple[str, ...] = ("Location",), kind: str = "f4") -> None:
        fill = {"f4": _FILL_FLOAT, "i4": _FILL_INT}.get(kind)
        made = group.createVariable(name, kind, dims, fill_value=fill)
        made[:] = values
        if units:
            made.setncattr("units", units)

    def of_each(name: str) -> F64:
        return np.concatenate([np.broadcast_to(getattr(p, name), p.latitude.shape) for p in places])

    put("latitude", of_each("latitude"), "degrees_north")
    put("longitude", of_each("longitude"), "degrees_east")
    put("height", of_each("height"), "m")
    seconds = [np.full(p.latitude.size, p.time.astype("datetime64[s]").astype(np.int64)) for p in places]
    put("dateTime", np.concatenate(seconds), _EPOCH, kind="i8")
    sun = np.concatenate([np.tile(p.sun, (p.latitude.size, 1)) for p in places])
    put("solarZenithAngle", 90 - sun[:, 1], "degree")
    put("solarAzimuthAngle", sun[:, 0], "degree")
    station = group.createVariable("stationIdentification", str, ("Location",))
    station[:] = np.concatenate([np.full(p.latitude.size, p.station, object) for p in places])
    if cameras:
        put("sensorZenithAngle", of_each("zenith"), "degree")
        put("sensorAzimuthAngle", of_each("azimuth"), "degree")
        channels = op.instruments[0].quantity.channels
        put("sensorCentralWavelength", op.wavelengths_nm[channels] / 1e3, "micron", ("Channel",))
        put("sensorChannelNumber", np.arange(1, len(channels) + 1), "", ("Channel",), "i4")


def _of_cameras(op: Rows) -> list[_Places]:
    return [_of_camera(op, n) for n in range(len(op.instruments))]


def _of_camera(op: Rows, n: int) -> _Places:
    assert op.time is not None
    each, frame = op.instruments[n], scene_frame(op.scene)
    camera, pixels = each.camera, each.camera.pixels()
    north, east = (camera.lat, camera.lon) if camera.x_m is None else (camera.y_m, camera.x_m)
    count = each.rays
    if camera.above == "ground":
        azimuth, altitude = pixels.azimuth_deg[each.inside], pixels.altitude_deg[each.inside]
        lat, lon = _latlon(op, np.full(count, north), np.full(count, east))
        height = np.full(count, camera.height_m)
        return _Places(lat, lon, height, 90 - altitude, azimuth, each.sun, f"camera {n}", op.time)
    rays = camera.rays(frame)
    origin, direction = np.array(rays.origins(), float), np.array(rays.directions(), float)
    radius = frame.radius_m
    centre = origin + np.array([0.0, 0.0, radius])
    along, beyond = (centre * direction).sum(axis=1), origin[:, 2] * (origin[:, 2] + 2 * radius)
    beyond = beyond + (origin[:, :2] ** 2).sum(axis=1)
    root = np.sqrt(np.maximum(along**2 - beyond, 0.0))
    distance = np.where(along < 0, beyond / np.maximum(-along + root, 1e-9), 0.0)  # the nearer end, without cancelling
    place = origin + direction * distance[:, None]
    ground_north, ground_east, over = frame.latlon(place)
    zenith, azimuth = np.empty(count), np.empty(count)
    for k in range(count):
        toward = frame.enu(float(ground_north[k]), float(ground_east[k])) @ -direction[k]
        azimuth[k], up = azimuth_altitude(toward)
        zenith[k] = 90 - up
    lat, lon = _latlon(op, ground_north, ground_east)
    return _Places(lat, lon, np.maximum(over, 0.0), zenith, azimuth, each.sun, f"camera {n}", op.time)


def _of_points(op: Rows) -> list[_Places]:
    if not len(op.points):
        return []
    assert op.time is not None
    frame = scene_frame(op.scene)
    lat, lon = _latlon(op, op.points[:, 0], op.points[:, 1])
    sun = sun_at(frame, op.daylight.direction, float(op.points[0, 0]), float(op.points[0, 1]))
    nothing = np.zeros(len(lat))
    return [_Places(lat, lon, nothing, nothing, nothing, sun, "pyranometer", op.time)]


def _latlon(op: Rows, north: F64, east: F64) -> tuple[F64, F64]:
    """Degrees; of a flat scene by the place that it has, its origin lying there."""
    if scene_frame(op.scene).curved:
        return np.asarray(north, float), np.asarray(east, float)
    lat, lon = op.scene.place
    per_degree = np.radians(1.0) * op.scene.earth_radius_m
    return lat + north / per_degree, lon + east / (per_degree * np.cos(np.radians(lat)))
