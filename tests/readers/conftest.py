"""Synthetic WRF files. Their latitudes and longitudes come from the textbook formulae, not from pyproj."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

RADIUS_M = 6_370_000.0
TEMPERATURE_K = 280.0
VAPOUR = 0.008
CLOUD = 1e-3


@dataclass
class WRFSpec:
    """What to write; tests change the parts they are about."""

    map_proj: int = 1
    attributes: dict[str, Any] = field(default_factory=dict)
    nx: int = 7
    ny: int = 6
    nz: int = 5
    times: tuple[str, ...] = ("2005-08-28_12:00:00", "2005-08-28_15:00:00")
    drop: tuple[str, ...] = ()
    change: dict[str, Callable[[np.ndarray], np.ndarray]] = field(default_factory=dict)
    extra: dict[str, tuple[tuple[str, ...], np.ndarray, str]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    format: str = "NETCDF4"
    degrees: float = 0.25  # spacing of latitude-longitude grids


BASE = {
    1: dict(TRUELAT1=30.0, TRUELAT2=60.0, STAND_LON=8.0, MOAD_CEN_LAT=46.0, DX=3000.0, DY=3000.0),
    2: dict(TRUELAT1=60.0, TRUELAT2=60.0, STAND_LON=-45.0, MOAD_CEN_LAT=70.0, DX=9000.0, DY=9000.0),
    3: dict(TRUELAT1=10.0, TRUELAT2=0.0, STAND_LON=170.0, MOAD_CEN_LAT=5.0, DX=10000.0, DY=10000.0),
    6: dict(TRUELAT1=0.0, TRUELAT2=0.0, STAND_LON=0.0, MOAD_CEN_LAT=0.0, DX=27800.0, DY=27800.0),
}


def lonlat(spec: WRFSpec) -> tuple[np.ndarray, np.ndarray]:
    """Degrees of the mass points (Snyder 1987, spherical forms), offset so that the domain is off centre."""
    given = {name: value for name, value in spec.attributes.items() if value is not None}
    a = BASE[1 if spec.map_proj not in BASE else spec.map_proj] | {"POLE_LAT": 90.0, "POLE_LON": 0.0} | given
    i, j = np.meshgrid(np.arange(spec.nx), np.arange(spec.ny))
    x, y = a["DX"] * (i - 12.3), a["DY"] * (j + 4.6)
    lat1, lat2 = np.radians(a["TRUELAT1"]), np.radians(a["TRUELAT2"])
    quarter = np.pi / 4
    if spec.map_proj == 1 or spec.map_proj not in BASE:
        if abs(lat1 - lat2) < 1e-9:
            n = np.sin(lat1)
        else:
            n = np.log(np.cos(lat1) / np.cos(lat2)) / np.log(
                np.tan(quarter + lat2 / 2) / np.tan(quarter + lat1 / 2)
            )
        f = RADIUS_M * np.cos(lat1) * np.tan(quarter + lat1 / 2) ** n / n
        south = f / np.tan(quarter + np.radians(a["MOAD_CEN_LAT"]) / 2) ** n - y
        rho = np.sign(n) * np.hypot(x, south)
        lon = a["STAND_LON"] + np.degrees(np.arctan2(np.sign(n) * x, np.sign(n) * south)) / n
        lat = np.degrees(2 * np.arctan((f / rho) ** (1 / n)) - np.pi / 2)
    elif spec.map_proj == 2:
        hemisphere = np.sign(lat1)
        y = y - 2e6 * hemisphere  # well off the pole
        rho = np.hypot(x, y)
        lon = a["STAND_LON"] + np.degrees(np.arctan2(x, -hemisphere * y))
        lat = hemisphere * (90 - np.degrees(2 * np.arctan(rho / (RADIUS_M * (1 + np.sin(abs(lat1)))))))
    elif spec.map_proj == 3:
        lon = 179.8 + np.degrees((x - x.mean()) / (RADIUS_M * np.cos(lat1)))
        lat = np.degrees(2 * np.arctan(np.exp(y / (RADIUS_M * np.cos(lat1)))) - np.pi / 2)
    else:
        lon, lat = spec.degrees * (i - 3.2), spec.degrees * (j - 2.7)
        if abs(a["POLE_LAT"]) == 90.0:
            lon, lat = lon + 179.9, lat + 40.0
        else:
            # northern domains lie around longitude 180 of the rotated system
            lon, lat = _unrotated(lon + 180.0, lat, a["POLE_LAT"], a["POLE_LON"], a["STAND_LON"])
    return (lon + 180.0) % 360.0 - 180.0, lat


def _unrotated(lon, lat, pole_lat, pole_lon, stand_lon):
    """Computational to geographic coordinates: the spherical triangle of WRF's rotated grids."""
    away = np.radians(lon - pole_lon)
    lat, pole = np.radians(lat), np.radians(pole_lat)
    up = np.cos(pole) * np.cos(lat) * np.cos(away) + np.sin(pole) * np.sin(lat)
    along = np.sin(pole) * np.cos(lat) * np.cos(away) - np.cos(pole) * np.sin(lat)
    return np.degrees(np.arctan2(np.cos(lat) * np.sin(away), along)) - stand_lon, np.degrees(np.arcsin(up))


def full_heights_m(spec: WRFSpec) -> np.ndarray:
    terrain = 100.0 + 20.0 * np.arange(spec.nx)[None, :] * np.ones((spec.ny, 1))
    return terrain + np.linspace(0.0, 12_000.0, spec.nz + 1)[:, None, None]


def write_wrf(path: Path, spec: WRFSpec) -> Path:
    """Isothermal air at 280 K with 8 g/kg of vapour and 1 g/kg of cloud on the second level."""
    full = full_heights_m(spec)
    mass = 0.5 * (full[1:] + full[:-1])
    pressure = 1e5 * np.exp(-mass / 8000.0)
    lon, lat = lonlat(spec)
    cloud = np.zeros_like(mass)
    cloud[1] = CLOUD
    ground = ("south_north", "west_east")
    levels, stag = ("bottom_top", *ground), ("bottom_top_stag", *ground)
    fields = {
        "PHB": (stag, 9.81 * full, "m2 s-2"),
        "PH": (stag, 0.0 * full, "m2 s-2"),
        "PB": (levels, 0.9 * pressure, "Pa"),
        "P": (levels, 0.1 * pressure, "Pa"),
        "T": (levels, TEMPERATURE_K * (1e5 / pressure) ** (2.0 / 7.0) - 300.0, "K"),
        "QVAPOR": (levels, np.full_like(mass, VAPOUR), "kg kg-1"),
        "QCLOUD": (levels, cloud, "kg kg-1"),
        "HGT": (ground, full[0], "m"),
        "XLAT": (ground, lat, "degree_north"),
        "XLONG": (ground, lon, "degree_east"),
        "U10": (ground, np.full(lat.shape, 3.0), "m s-1"),
        "V10": (ground, np.full(lat.shape, 4.0), "m s-1"),
    } | spec.extra
    with netCDF4.Dataset(path, "w", format=spec.format) as file:
        sizes = dict(west_east=spec.nx, south_north=spec.ny, bottom_top=spec.nz, bottom_top_stag=spec.nz + 1,
                     west_east_stag=spec.nx + 1, south_north_stag=spec.ny + 1)  # fmt: skip
        file.createDimension("Time", None)
        file.createDimension("DateStrLen", 19)
        for name, size in sizes.items():
            file.createDimension(name, size)
        attributes = {
            "TITLE": " OUTPUT FROM WRF V4.5 MODEL",
            "MAP_PROJ": spec.map_proj,
            "CEN_LAT": 0.0,
            "CEN_LON": 0.0,
        }
        attributes |= BASE.get(spec.map_proj, dict(DX=100.0, DY=100.0)) | {"POLE_LAT": 90.0, "POLE_LON": 0.0}
        for name, value in (attributes | spec.attributes).items():
            if value is not None:
                file.setncattr(name, value)
        if "Times" not in spec.drop:
            stamps = file.createVariable("Times", "S1", ("Time", "DateStrLen"))
            for index, stamp in enumerate(spec.times):
                stamps[index] = np.array(list(stamp), dtype="S1")
        for name, (dims, values, units) in fields.items():
            if name in spec.drop:
                continue
            values = np.repeat(np.asarray(values, "f4")[None], len(spec.times), axis=0)
            values = spec.change.get(name, lambda same: same)(values)
            variable = file.createVariable(name, "f4", ("Time", *dims))
            variable.units = spec.units.get(name, units)
            variable[:] = values
    return path


def stacked(
    one: Path, path: Path, order: Callable[[tuple[str, ...]], tuple[str, ...]], numbers: Sequence[int] | None = None
) -> Path:
    """Two members in one file: that of ``one``, and one with twice its cloud, along a dimension called member."""
    with netCDF4.Dataset(one) as source, netCDF4.Dataset(path, "w") as file:
        file.setncatts({name: source.getncattr(name) for name in source.ncattrs()})
        for name, dimension in source.dimensions.items():
            file.createDimension(name, len(dimension))
        file.createDimension("member", 2)
        if numbers is not None:
            file.createVariable("member", "i4", ("member",))[:] = numbers
        for name, held in source.variables.items():
            dims = order(held.dimensions)
            made = file.createVariable(name, held.dtype, dims)
            made.setncatts({each: held.getncattr(each) for each in held.ncattrs()})
            both = [held[...], held[...] * 2 if name == "QCLOUD" else held[...]]
            made[...] = np.stack(both, axis=dims.index("member")) if "member" in dims else held[...]
    return path


@pytest.fixture
def wrf_file(tmp_path: Path) -> Callable[..., Path]:
    """wrf_file(map_proj=3, drop=("PH",), ...) writes a file and returns its path."""

    def write(**spec: Any) -> Path:
        return write_wrf(tmp_path / "wrfout_d01_test", WRFSpec(**spec))

    return write


@pytest.fixture
def wrf_lonlat() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """The true longitudes and latitudes of the file the same arguments write."""
    return lambda **spec: lonlat(WRFSpec(**spec))


@pytest.fixture
def nwp() -> Path:
    """Folder of the real model files."""
    shared = os.environ.get("OPENSWIM_SHARED", str(Path(__file__).resolve().parents[3] / "shared"))
    folder = Path(shared) / "data" / "nwp"
    if not folder.is_dir():
        pytest.skip(f"no real model files in {folder} (set OPENSWIM_SHARED)")
    return folder
