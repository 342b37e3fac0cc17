"""Where nodes lie: against spherical formulae, inverses and symmetry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS

from openswim.errors import UserError
from openswim.scene import Grid
from openswim.scene.grid import extent_text

RADIUS_M = 6_370_000.0
LEVELS = np.array([0.0, 1000.0])
PROJECTIONS = {
    "lambert": CRS.from_proj4(f"+proj=lcc +lat_1=30 +lat_2=60 +lat_0=46 +lon_0=8 +R={RADIUS_M}"),
    "polar": CRS.from_proj4(f"+proj=stere +lat_0=90 +lat_ts=60 +lon_0=-45 +R={RADIUS_M}"),
    "mercator": CRS.from_proj4(f"+proj=merc +lat_ts=20 +lon_0=180 +R={RADIUS_M}"),
}
LONLAT = CRS.from_proj4(f"+proj=longlat +R={RADIUS_M}")
ROTATED = CRS.from_cf(
    {
        "grid_mapping_name": "rotated_latitude_longitude",
        "grid_north_pole_latitude": 39.25,
        "grid_north_pole_longitude": -162.0,
        "earth_radius": RADIUS_M,
        "longitude_of_prime_meridian": 0.0,
        "prime_meridian_name": "Greenwich",  # or pyproj looks for it for .4 s
    }
)


def _grid(crs, x0=1e5, y0=-2e5, step=4000.0, nx=30, ny=20) -> Grid:
    return Grid(x0 + step * np.arange(nx), y0 + step * np.arange(ny), LEVELS, crs, RADIUS_M)


@pytest.mark.parametrize("crs", PROJECTIONS.values(), ids=PROJECTIONS.keys())
@given(ix=st.floats(-50, 80), iy=st.floats(-50, 70))
def test_index_undoes_lonlat(crs, ix, iy):
    grid = _grid(crs)
    lon, lat = grid.lonlat(ix, iy)
    np.testing.assert_allclose(grid.index(lon, lat), (ix, iy), atol=1e-6)


@given(lon=st.floats(170.1, 189.9), lat=st.floats(-9.9, 9.9), turns=st.integers(-1, 1))
def test_longitudes_wrap_around_the_domain(lon, lat, turns):
    grid = Grid(np.linspace(170, 190, 41), np.linspace(-10, 10, 41), LEVELS, LONLAT, RADIUS_M)
    ix, iy = grid.index(lon + 360.0 * turns, lat)
    np.testing.assert_allclose((ix, iy), ((lon - 170) * 2, (lat + 10) * 2), atol=1e-8)


def test_mercator_by_its_formula():
    grid = _grid(PROJECTIONS["mercator"], x0=-1e5, y0=2e6)
    scale = RADIUS_M * np.cos(np.radians(20.0))
    lon, lat = grid.lonlat(np.arange(30), np.arange(20)[:, None])
    assert lon.shape == lat.shape == (20, 30)
    expected_lon = 180.0 + np.degrees(grid.x / scale)
    np.testing.assert_allclose(lon[0], (expected_lon + 180) % 360 - 180, atol=1e-9)
    np.testing.assert_allclose(lat[:, 0], np.degrees(np.arcsin(np.tanh(grid.y / scale))), atol=1e-9)


def test_rotated_pole_lies_where_it_should():
    grid = Grid(np.linspace(-10, 10, 21), np.linspace(-10, 10, 21), LEVELS, ROTATED, RADIUS_M)
    assert grid.in_degrees
    lon, lat = grid.lonlat(10, 10 + 90)  # rotated latitude 90
    np.testing.assert_allclose((lon, lat), (-162.0, 39.25), atol=1e-6)
    np.testing.assert_allclose(grid.lonlat(10, 10), (18.0, 90 - 39.25), atol=1e-9)


def test_spacing_of_a_latitude_longitude_grid():
    grid = Grid(np.arange(0, 10, 0.25), np.arange(55, 65.1, 0.25), LEVELS, LONLAT, RADIUS_M)
    degree = RADIUS_M * np.pi / 180
    assert grid.spacing_m() == pytest.approx((0.25 * degree * 0.5, 0.25 * degree), rel=1e-5)


def test_axes_turn_with_the_meridians():
    """East of a northern cone's central meridian the pole lies to the left, so x points south of east."""
    grid = _grid(PROJECTIONS["lambert"], x0=3e5)
    a, b = np.radians((30.0, 60.0))
    n = np.log(np.cos(a) / np.cos(b)) / np.log(np.tan(np.pi / 4 + b / 2) / np.tan(np.pi / 4 + a / 2))
    lon, _ = grid.lonlat(np.arange(30), 5.0)
    np.testing.assert_allclose(grid.axis_angle(np.arange(30), 5.0), -np.radians(n * (lon - 8.0)), atol=1e-6)


def test_axes_turn_once_around_the_pole():
    """Polar stereographic, next to the pole: x points east at the meridian below it, west above it."""
    grid = _grid(PROJECTIONS["polar"], x0=-58e3, y0=-38e3)
    lon, _ = grid.lonlat(np.arange(30), np.arange(20)[:, None])
    away = grid.axis_angle(np.arange(30), np.arange(20)[:, None]) + np.radians(lon + 45.0)
    np.testing.assert_allclose((away + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=1e-4)


@pytest.mark.parametrize(
    ("x", "said"),
    [
        (np.arange(175.0, 186.0), "latitude 10.00 to 20.00, longitude 175.00 to 185.00"),
        (np.arange(-185.0, -174.0), "longitude 175.00 to 185.00"),
        (np.arange(-10.0, 11.0), "longitude -10.00 to 10.00"),
        (np.arange(230.0, 241.0), "longitude -130.00 to -120.00"),
        (np.arange(0.0, 360.0), "longitude 0.00 to 359.00"),
        (np.arange(-180.0, 180.0), "longitude -180.00 to 179.00"),
    ],
)
def test_extent_over_the_date_line(x, said):
    grid = Grid(x, np.arange(10.0, 21.0), LEVELS, LONLAT, RADIUS_M)
    assert extent_text(grid).endswith(said)


@pytest.mark.parametrize(("pole", "said"), [(90, "latitude 89.96 to 90.00"), (-90, "latitude -90.00 to -89.96")])
def test_extent_around_a_pole(pole, said):
    axis = 1000.0 * np.arange(-3, 3)
    crs = CRS.from_proj4(f"+proj=stere +lat_0={pole} +lat_ts={pole} +lon_0=20 +R=6371000")
    grid = Grid(axis, axis, [0.0, 1.0], crs)
    assert extent_text(grid).endswith(f"{said}, longitude -180.00 to 180.00")


def test_flat_grids_have_no_latitude():
    grid = Grid(np.arange(3) * 100.0, np.arange(4) * 50.0, LEVELS, periodic=True)
    assert (grid.curved, grid.shape, grid.spacing_m()) == (False, (2, 4, 3), (100.0, 50.0))
    with pytest.raises(UserError, match="flat grid has no latitude"):
        grid.lonlat(0, 0)


BAD = {
    "uneven": (dict(x=[0, 1, 3.0]), "even steps"),
    "descending": (dict(x=[2, 1, 0.0]), "ascend"),
    "one node": (dict(x=[0.0]), "at least 2"),
    "NaN axis": (dict(y=[0, np.nan]), "not finite"),
    "heights descending": (dict(height_m=[1000.0, 0.0]), "ascend"),
    "heights equal": (dict(height_m=[5.0, 5.0]), "ascend"),
    "levels a millimetre apart": (dict(height_m=[0.0, 500.0, 500.001]), "0.001 m apart"),
    "NaN height": (dict(height_m=[0.0, np.nan]), "missing"),
    "fill height": (dict(height_m=[0.0, 1e20]), "absurd"),
    "height shape": (dict(height_m=np.zeros((2, 5, 5))), "must be"),
    "periodic on a sphere": (dict(crs=LONLAT, periodic=True), "flat grid"),
    "radius in km": (dict(crs=LONLAT, earth_radius_m=6.37), "radius"),
}


@pytest.mark.parametrize(("change", "said"), BAD.values(), ids=BAD.keys())
def test_bad_grids(change, said):
    arguments = dict(x=[0.0, 1.0], y=[0.0, 1.0], height_m=[0.0, 1.0]) | change
    with pytest.raises(UserError, match=said):
        Grid(**arguments)
