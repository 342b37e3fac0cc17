"""Wind on levels, read where it is asked for: against WRF's own rotation, and bearings of the grids' axes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from tests.readers import grib_files as gf
from tests.readers.model_files import MAKERS, NX, NY, NZ
from tests.readers.model_files import wind as wind_of
from tests.readers.test_wrf_real import ALPS, TIBET, _field

from openswim.films import Weather
from openswim.films.between import Motion
from openswim.readers import open_scene

WIND = ("wind_east", "wind_north")


@pytest.mark.parametrize("name", [TIBET, ALPS])
def test_wrf_against_its_own_rotation(nwp, name):
    path = nwp / name
    u, v, cos, sin = (_field(path, each).astype(float) for each in ("U", "V", "COSALPHA", "SINALPHA"))
    u, v = 0.5 * (u[:, :, 1:] + u[:, :, :-1]), 0.5 * (v[:, 1:] + v[:, :-1])
    data = open_scene(path, winds=True).data
    np.testing.assert_allclose(data.wind_east, u * cos - v * sin, atol=4e-3)  # of up to 60 m/s
    np.testing.assert_allclose(data.wind_north, v * cos + u * sin, atol=4e-3)
    assert not set(WIND) & set(open_scene(path).data)


def test_wrf_without_wind_says_so(wrf_file):
    scene = open_scene(wrf_file(), winds=True)
    assert not set(WIND) & set(scene.data)
    assert "no U, V in the file: no wind on levels" in scene.notes


def _turned(lon: np.ndarray, lat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """3 m/s along x and 4 m/s along y, by the bearing of the grid's axes from coordinates (degrees)."""
    lon, lat = np.radians(lon), np.radians(lat)
    step = np.gradient(np.unwrap(lon, axis=1), axis=1) * np.cos(lat), np.gradient(lat, axis=1)
    turn = np.arctan2(step[1], step[0])
    return 3 * np.cos(turn) - 4 * np.sin(turn), 4 * np.cos(turn) + 3 * np.sin(turn)


def _with_wind(product: gf.Product, codes: Any, levels: list[tuple[int, ...]]) -> gf.Product:
    winds = [
        gf.Message(code, at, lambda lat, lon, s=speed, n=n: s * (n + 1.0))
        for n, at in enumerate(levels)
        for code, speed in zip(codes, (3.0, 4.0), strict=True)
    ]
    return replace(product, messages=[*product.messages, *winds])


@pytest.mark.parametrize("flags", [8, 0])
def test_grib_is_turned_where_the_message_says_so(tmp_path, flags):
    product = gf.hrrr(gf.HRRR | {"resolutionAndComponentFlags": flags})
    levels = [(105, k) for k in range(1, 13)]
    path = gf.write(tmp_path / "hrrr", _with_wind(product, ((0, 2, 2), (0, 2, 3)), levels))
    scene = open_scene(path, winds=True)
    ny, nx = scene.grid.shape[1:]
    places = scene.grid.lonlat(*np.meshgrid(np.arange(nx), np.arange(ny)))
    east, north = _turned(*places) if flags else (np.full((ny, nx), 3.0), np.full((ny, nx), 4.0))
    inner = (slice(None), slice(1, -1), slice(1, -1))
    k = np.arange(1.0, 13.0)[:, None, None]
    np.testing.assert_allclose(scene.data.wind_east.values[inner], (k * east)[inner], atol=0.05)
    np.testing.assert_allclose(scene.data.wind_north.values[inner], (k * north)[inner], atol=0.05)
    assert not set(WIND) & set(open_scene(path).data)


def test_grib1_of_ecmwf_lists_levels_from_the_top(tmp_path):
    levels = [(109, k) for k in range(1, 13)]
    product = _with_wind(gf.ifs(gf.AROME, levels=12, edition=1), ((128, 131), (128, 132)), levels)
    data = open_scene(gf.write(tmp_path / "ifs", product), winds=True).data
    np.testing.assert_allclose(data.wind_east.mean(("y", "x")), 3 * np.arange(12, 0, -1), atol=1e-3)
    np.testing.assert_allclose(data.wind_north.mean(("y", "x")), 4 * np.arange(12, 0, -1), atol=1e-3)


def test_grib_levels_without_wind_take_that_of_the_next(tmp_path):
    levels = [(105, k) for k in range(3, 11)]
    product = _with_wind(gf.hrrr(gf.HRRR | {"resolutionAndComponentFlags": 0}), ((0, 2, 2), (0, 2, 3)), levels)
    scene = open_scene(gf.write(tmp_path / "hrrr", product), winds=True)
    found = scene.data.wind_east.mean(("y", "x"))
    np.testing.assert_allclose(found, 3 * np.array([1, 1, 1, 2, 3, 4, 5, 6, 7, 8, 8, 8.0]), atol=1e-3)
    few = _with_wind(gf.hrrr(), ((0, 2, 2), (0, 2, 3)), levels[:3])
    scene = open_scene(gf.write(tmp_path / "few", few), winds=True)
    assert not set(WIND) & set(scene.data)
    assert any("no wind on most levels" in note for note in scene.notes)


def test_cf_along_a_rotated_grid_is_turned(tmp_path):
    truth = MAKERS["UM"](tmp_path)
    (path,) = truth.paths
    with xr.open_dataset(path, decode_times=False) as file:
        data = file.load()
    dims, k = data["m01s16i004"].dims, np.arange(1.0, NZ + 1)[:, None, None]
    for name, values, along in zip(("a", "b"), wind_of(NY, NX), ("x_wind", "y_wind"), strict=True):
        data[name] = (dims, (k * values).astype("f4"), {"units": "m s-1", "standard_name": along})
    data.to_netcdf(tmp_path / "winds.nc")
    scene = open_scene(tmp_path / "winds.nc", winds=True)
    for name, expected in zip(WIND, truth.wind, strict=True):
        np.testing.assert_allclose(scene.data[name], k * expected, atol=0.02 * NZ)


def test_cf_toward_east_stays_and_is_turned_upright(tmp_path):
    truth = MAKERS["ERA5 (new CDS)"](tmp_path)
    path = tmp_path / "winds.nc"
    with xr.open_dataset(truth.paths[0]) as file:
        data = file.load()
    data["u"], data["v"] = (
        (0 * data["t"] + speed).assign_attrs(units="m s**-1", standard_name=name)
        for speed, name in ((0.1 * data["t"][data["t"].dims[-3]], "eastward_wind"), (-7.0, "northward_wind"))
    )
    data.to_netcdf(path)
    scene = open_scene([path, *truth.paths[1:]], winds=True)
    np.testing.assert_allclose(scene.data.wind_north, -7.0)
    pressure = scene.data.air_pressure.mean(("y", "x"))
    np.testing.assert_allclose(scene.data.wind_east.mean(("y", "x")), 0.1 * pressure / 100, rtol=1e-3)


def test_films_of_several_times_read_the_wind(wrf_file):
    spec: dict[str, Any] = {"nx": 7, "ny": 6, "nz": 5}
    u, v = np.full((5, 6, 8), 3.0), np.full((5, 7, 7), 4.0)
    staggered = ("bottom_top", "south_north", "west_east_stag"), ("bottom_top", "south_north_stag", "west_east")
    path = wrf_file(**spec, extra={"U": (staggered[0], u, "m s-1"), "V": (staggered[1], v, "m s-1")})
    weather = Weather.of_files(path)
    before, after = (weather._scene(time) for time in weather.times)
    assert Motion.between(before, after).source == "the model's wind"
    speed = np.hypot(before.data.wind_east, before.data.wind_north)
    np.testing.assert_allclose(speed, 5.0, rtol=1e-5)
