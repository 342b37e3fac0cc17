"""The fixed grid: beside pyproj on the ellipsoid, and by itself."""

from __future__ import annotations

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.satellites import FixedGrid

ABI = FixedGrid(2.8e-5 * np.arange(-5400, 5401, 300), 2.8e-5 * np.arange(5400, -5401, -300), -75.0)
SEVIRI = FixedGrid(8.38e-5 * np.arange(-1800, 1801, 120), 8.38e-5 * np.arange(1800, -1801, -120), 0.0,
                   35_785_831.0, 6_378_169.0, 6_356_583.8, "y")  # fmt: skip


@pytest.mark.parametrize("grid", [ABI, SEVIRI])
def test_places_are_those_of_pyproj_within_a_hundredth_of_a_pixel(grid: FixedGrid) -> None:
    from pyproj import CRS, Transformer

    crs = CRS.from_cf(grid.to_cf())
    to_place = Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)
    x, y = np.meshgrid(grid.x, grid.y)
    lon, lat = to_place.transform(x * grid.height_m, y * grid.height_m)
    ours = grid.latlon()
    on_earth = np.isfinite(lat) & (np.abs(lat) < 1e3)
    assert on_earth.sum() > 700
    np.testing.assert_array_equal(np.isfinite(ours[0]), on_earth)
    row, column = grid.index(lat[on_earth], lon[on_earth])
    expected = np.argwhere(on_earth).T
    near = grid.view(lat[on_earth], lon[on_earth])[0] < 85  # the limb is a matter of square roots of nothing
    pixel = abs(grid.x[1] - grid.x[0]) / 2.8e-5  # in pixels of 1 km
    assert np.abs(row - expected[0])[near].max() * pixel < 0.01
    assert np.abs(column - expected[1])[near].max() * pixel < 0.01
    np.testing.assert_allclose(ours[0][on_earth][near], lat[on_earth][near], atol=1e-5)


def test_the_satellite_stands_where_it_looks_from() -> None:
    lat, lon = ABI.latlon()
    zenith, _ = ABI.view(lat, lon)
    middle = np.unravel_index(np.nanargmin(zenith), zenith.shape)
    assert zenith[middle] == pytest.approx(0, abs=1e-9)
    assert (lat[middle], lon[middle]) == pytest.approx((0, -75))
    north = ABI.view(40.0, -75.0)
    assert north[1] == pytest.approx(180)
    # by hand: geocentric vectors of 40 N on the ellipsoid
    a, b, far = 6378137.0, 6356752.31414, 35_786_023 + 6378137.0
    radius = a / np.sqrt(1 - (1 - b**2 / a**2) * np.sin(np.radians(40)) ** 2)
    place = np.array([radius * np.cos(np.radians(40)), radius * b**2 / a**2 * np.sin(np.radians(40))])
    to = np.array([far, 0.0]) - place
    up = np.array([np.cos(np.radians(40)), np.sin(np.radians(40))])
    assert float(north[0]) == pytest.approx(np.degrees(np.arccos(to @ up / np.linalg.norm(to))), abs=1e-6)
    assert np.isnan(ABI.index(0.0, 105.0)[0])  # the far side


def test_what_is_no_grid_is_refused() -> None:
    with pytest.raises(UserError, match="scan angles"):
        FixedGrid(np.array([1e6, 2e6]), np.array([0.0, 1.0]), 0.0)
    with pytest.raises(UserError, match="sweep"):
        FixedGrid(np.zeros(2), np.zeros(2), 0.0, sweep="z")  # type: ignore[arg-type]
