"""The waves' mean square slope as wave models call it, to the scene and back out of its own file."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np
import pytest
from tests.readers import grib_files as gf
from tests.readers import model_files as mf

import openswim


def _slope(lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    return 0.02 + 1e-4 * lat + 2e-4 * np.cos(np.radians(lon))


@pytest.mark.parametrize(
    ("edition", "code", "level"),
    [(1, (140, 244), (1, 0)), (1, (140, 244), (102, 0)), (2, (10, 0, 20), (1, 0)), (2, (10, 0, 20), (101, 0))],
)
def test_grib_of_a_wave_model(tmp_path: Path, edition: int, code: tuple[int, ...], level: tuple[int, int]) -> None:
    product = gf.ifs(gf.AROME, levels=3, edition=edition)
    product.messages.append(gf.Message(code, level, _slope, missing=lambda lat, lon: lat > 50))
    scene = openswim.open_scene(gf.write(tmp_path / "file", product))
    ny, nx = scene.grid.shape[1:]
    lon, lat = scene.grid.lonlat(np.arange(nx), np.arange(ny)[:, None])
    expected = np.where(lat > 50, 0.0, _slope(lat, lon))
    np.testing.assert_allclose(scene.data.wave_mean_square_slope, expected, atol=1e-6)


def test_netcdf_of_reanalysis_and_the_scenes_own_file(tmp_path: Path) -> None:
    path = tmp_path / "era5.nc"
    truth = mf.era5(path, new=True)
    lon, lat = truth.lonlat
    with netCDF4.Dataset(path, "a") as file:
        own = file.createVariable("msqs", "f4", ("valid_time", "latitude", "longitude"), fill_value=np.float32(np.nan))
        own.units, own.standard_name = "1", "unknown"
        values = _slope(lat, lon)[::-1]
        values[0] = np.nan
        own[:] = np.stack([values, 2 * values])
    scene = openswim.open_scene(path)
    expected = _slope(lat, lon)
    expected[-1] = 0.0
    np.testing.assert_allclose(scene.data.wave_mean_square_slope, expected, atol=1e-6)
    scene.to_netcdf(tmp_path / "scene.nc")
    again = openswim.open_scene(tmp_path / "scene.nc")
    np.testing.assert_array_equal(again.data.wave_mean_square_slope, scene.data.wave_mean_square_slope)
    assert "wave_mean_square_slope" not in "".join(again.notes)
