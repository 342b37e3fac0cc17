"""Air over ground beside a domain is lit by that ground, not by the domain's."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import CRS

from openswim import Camera, Scene, render

DEGREES = CRS.from_epsg(4326)
LEVELS = np.linspace(0.0, 20e3, 41)
SUN = (60.0, 40.0)


def row(scene, lat, lon, solver, height_m=8e5):
    """Radiance (n, 3) of a row of pixels across 1.3 degrees of longitude, from above."""
    camera = Camera.perspective(lat, lon, height_m, azimuth_deg=0, altitude_deg=-90, fov_deg=12, size=(3, 16))
    return render(scene, camera, solver, sun=SUN).radiance.values[1]


def land(albedo):
    """A domain of land, 100 km wide, in the sea."""
    x, y = np.arange(70.0, 71.05, 0.1), np.arange(-30.0, -28.95, 0.1)
    ground = {"land_area_fraction": np.ones((11, 11)), "surface_albedo": np.full((11, 11), albedo)}
    return Scene.from_arrays({}, x, y, LEVELS, crs=DEGREES, fields=ground)


@pytest.mark.parametrize("solver", ["fast", "swim"])
def test_sea_is_alike_beside_bright_and_dark_land(solver):
    """A thousand kilometres off South Africa; by the domain's albedo alone red light was .7 times brighter."""
    dark, bright = (row(land(albedo), -29.5, 82.0, solver) for albedo in (0.05, 0.6))
    np.testing.assert_allclose(bright, dark, rtol=0.011)


@pytest.mark.parametrize("solver", ["fast", "swim"])
def test_a_domain_of_land_shows_no_sides_over_the_sea(solver):
    """South of Madagascar; the step there was 4 % in red light by fast."""
    scene = Scene.from_arrays({}, np.arange(20.0, 53.0), np.arange(-35.0, -14.0), LEVELS, crs=DEGREES)
    east = row(scene, -29.0, 51.5, solver)[9:]  # of the nadir
    step = east[1:] / east[:-1]
    assert np.abs(step[1:-1] - 0.5 * (step[:-2] + step[2:])).max() < 0.0022


def test_low_eyes_see_what_they_saw():
    """To them the air below is not all there is."""
    from openswim.transport.view.lit_from_below import LitFromBelow

    found = LitFromBelow(np.ones((4, 11, 8)), np.full(4, 0.3), np.full(4, 0.1), np.ones((4, 11)))
    ways = (np.full((2, 4), 0.05), np.ones(2), np.full(2, 0.6), np.full(2, 0.8))
    low, high = np.array([9e3, 1e4]), np.array([4e4, 1e6])
    assert (np.array(found.more(*ways, low)) == 0).all()
    of_air, of_ground = found.more(*ways, high)
    assert (of_air < -0.2).all()
    np.testing.assert_allclose(of_ground, 4 * 0.05 * (0.97 / 0.995 - 1))
    assert (np.array(found.more(*ways[:3], np.zeros(2), high)) == 0).all()  # level, beside rays to space
