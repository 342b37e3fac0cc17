"""Files with an albedo and without a land mask: shores of the map, sea ice by the albedo."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.ground.albedo import surface_properties
from openswim.scene import Scene

SHORE = -8.9  # of Portugal at 39.5 to 41 N


def _file(folder: Path, lat: np.ndarray, lon: np.ndarray, albedo: np.ndarray, layout: bool = False) -> Path:
    """A file with the fields of docs/scene-format.md, which tells that it is one if it is of the ``layout``."""
    z, path = np.array([1e3, 2e3, 3e3]), folder / "file.nc"
    liquid = np.full((3, *albedo.shape), 1e-5, np.float32)
    fields = {"liquid_content": liquid}
    Scene.from_arrays({}, lon, lat, z, crs="EPSG:4326", surface_albedo=albedo, fields=fields).to_netcdf(path)
    if not layout:
        data = xr.load_dataset(path)
        del data.attrs["openswim_layout"], data.attrs["openswim_fields"]
        data.to_netcdf(path)
    return path


def _iberia() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    lat, lon = np.arange(39.5, 41.1, 0.25), np.arange(-13.0, -5.9, 0.25)
    return lat, lon, np.broadcast_to(np.where(lon < SHORE + 0.7, 0.06, 0.2), (lat.size, lon.size)).astype(np.float32)


def test_a_model_with_an_albedo_and_no_land_mask_has_the_seas_of_the_map(tmp_path: Path) -> None:
    """The sea glints; land is as bright as the file has it, also where the file's node is still at sea."""
    lat, lon, albedo = _iberia()
    scene = openswim.open_scene(_file(tmp_path, lat, lon, albedo))
    assert any("land and water from the ground map" in note for note in scene.notes)
    places = np.full(3, 40.1), np.array([-12.0, -8.4, -7.0])  # sea, land by the shore, inland
    sample = surface_properties(scene, *places, [546.0])
    assert not sample.lambertian
    np.testing.assert_allclose(sample.water, [1, 0, 0], atol=0.02)
    alike = Scene(scene.grid, scene.data.assign(surface_albedo=xr.full_like(scene.data.surface_albedo, 0.2)))
    np.testing.assert_allclose(sample.albedo[1:], surface_properties(alike, *places, [546.0]).albedo[1:], rtol=1e-6)


def test_an_albedo_that_a_scene_was_given_stays_that_of_all_ground(tmp_path: Path) -> None:
    lat, lon, albedo = _iberia()
    scene = openswim.open_scene(_file(tmp_path, lat, lon, albedo, layout=True))
    assert surface_properties(scene, [40.1], [-12.0], [546.0]).lambertian


def test_an_albedo_of_water_alone_leaves_land_to_the_map(tmp_path: Path) -> None:
    lat, lon, albedo = _iberia()
    scene = openswim.open_scene(_file(tmp_path, lat, lon, np.full_like(albedo, 0.06)))
    assert "surface_albedo" not in scene.data
    assert 0.4 < float(scene.data.land_area_fraction.mean()) < 0.6


@pytest.mark.parametrize(("albedo", "ice"), [(0.06, 0.0), (0.2, 0.0), (0.33, 0.5), (0.7, 1.0)])
def test_sea_ice_is_told_by_the_albedo_of_water(albedo: float, ice: float, tmp_path: Path) -> None:
    """North of Svalbard, of which no file says whether there is ice."""
    lat, lon = np.arange(82.0, 84.1, 0.5), np.arange(10.0, 30.1, 2.0)
    scene = openswim.open_scene(_file(tmp_path, lat, lon, np.full((lat.size, lon.size), albedo, np.float32)))
    told = [note for note in scene.notes if "sea_ice_area_fraction" in note]
    assert len(told) == 1
    assert ("sea ice by the surface albedo" in told[0]) == (ice > 0)
    sample = surface_properties(scene, [83.0], [20.0], [546.0])
    assert float(sample.sea_ice[0]) == pytest.approx(ice, abs=1e-3)


@pytest.mark.parametrize(("south_deg", "albedo", "snow"), [(60.0, 0.2, 0.0), (60.0, 0.475, 0.5), (22.0, 0.475, 0.0)])
def test_snow_is_told_by_the_albedo_of_land_but_in_deserts(
    south_deg: float, albedo: float, snow: float, tmp_path: Path
) -> None:
    """Siberia, and the Sahara."""
    lat, lon = np.arange(south_deg, south_deg + 3.1, 0.5), np.arange(20.0, 28.1, 1.0) + (80.0 if south_deg > 40 else 0)
    scene = openswim.open_scene(_file(tmp_path, lat, lon, np.full((lat.size, lon.size), albedo, np.float32)))
    assert any("snow by the surface albedo" in note for note in scene.notes) == (snow > 0)
    found = scene.data["snow_area_fraction"].values if snow else np.zeros(1)
    np.testing.assert_allclose(found, snow, atol=1e-6)
