"""Land, snow and water beyond 700 nm: typical spectra that others measured."""

import numpy as np
import pytest
import xarray as xr
from pyproj import CRS

from openswim import Scene
from openswim.ground import snow, spectra
from openswim.ground.albedo import surface_properties
from openswim.ground.near_infrared import beyond_visible, land_beyond_visible
from openswim.ground.sample import SurfaceSample
from openswim.scene.grid import Grid

BANDS_NM = np.array([700.0, 860.0, 1240.0, 1640.0])
FOREST, FIELD, DESERT = [0.02, 0.045, 0.03], [0.04, 0.09, 0.06], [0.17, 0.30, 0.41]  # at 469, 555, 645 nm


@pytest.mark.parametrize(
    ("visible", "expected"),
    [
        (FOREST, [0.03, 0.31, 0.29, 0.18]),  # MODIS 2, 5 and 6 over mixed forest
        (FIELD, [0.07, 0.39, 0.37, 0.24]),  # grass
        (DESERT, [0.45, 0.48, 0.54, 0.57]),  # the Sahara
    ],
)
def test_land_like_modis(visible, expected):
    found = land_beyond_visible(np.array([visible]), BANDS_NM)[0]
    assert found == pytest.approx(np.array(expected), rel=0.12)
    assert found[0] == pytest.approx(spectra.from_bands(np.array([visible[::-1]]), [700.0])[0, 0], rel=1e-6)


def test_deep_snow_where_it_absorbs_little():
    """exp(-3.6 sqrt(a d)) (Kokhanovsky & Zege 2004), a = 4 pi k / wavelength of ice with k = 2.3e-6 and 1.2e-5 (Warren
    & Brandt 2008); where it absorbs strongly next to nothing (Wiscombe & Warren 1980)."""
    wavelengths = np.array([1030.0, 1240.0])
    absorption = 4 * np.pi * np.array([2.3e-6, 1.2e-5]) / (wavelengths * 1e-9)
    for radius_m in (0.1e-3, 1e-3):
        expected = np.exp(-3.6 * np.sqrt(absorption * 2 * radius_m))
        assert snow.deep_snow(wavelengths, radius_m) == pytest.approx(expected, abs=0.05)
    assert snow.deep_snow(np.array([1500.0]), 0.1e-3)[0] < 0.07
    assert snow.deep_snow(np.array([1640.0]), 1e-3)[0] < 0.05
    assert snow.snow_albedo([700.0, 700.01])[0, 1] == pytest.approx(snow.snow_albedo([700.0])[0, 0], rel=1e-3)


def sample(visible, white=0.0, sea_ice=0.0):
    one, albedo = np.ones(1), np.full((1, 3), visible) if np.isscalar(visible) else np.array([visible])
    return SurfaceSample(albedo, 0 * one, white * one, sea_ice * one, 5 * one, 0.2 * one)


def test_snow_and_what_stands_out_of_it():
    wavelengths = np.array([860.0, 1640.0])
    bare, under, patchy, woods = (
        beyond_visible(one, wavelengths)[0]
        for one in (sample(FOREST), sample(0.92, 1.0), sample(0.5, 0.5), sample(0.3, 1.0))
    )
    assert under == pytest.approx(snow.snow_albedo(wavelengths)[0], rel=0.05)
    assert under[0] > 0.7 > 0.2 > under[1]  # dark where clouds of droplets are bright
    assert bare[0] < woods[0] < patchy[0] < under[0]


def test_water_is_black():
    assert spectra.water_leaving([860.0, 1240.0, 1640.0], 1.0).max() < 3e-3


def test_default_earth():
    """Leaves are bright beyond the red edge; the visible is what it is without the near infrared."""
    grid = Grid(np.linspace(7.8, 8.2, 5), np.linspace(47.3, 47.6, 4), np.array([0.0, 1e3]), CRS.from_epsg(4326))
    scene = Scene(grid, xr.Dataset())
    both = surface_properties(scene, 47.45, 8.0, [550.0, 860.0, 650.0, 1640.0]).albedo[0]
    alone = surface_properties(scene, 47.45, 8.0, [550.0, 650.0]).albedo[0]
    assert both[[0, 2]] == pytest.approx(alone)
    assert both[1] > 3 * both[2]
    assert both[2] < both[3] < both[1]
