"""Air over ground beside a domain is lit by that ground, not by the domain's."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import CRS

from openswim import Camera, Scene, light, render
from openswim.transport.view.lit_from_below import _MU_SUN, _MU_VIEW, LitFromBelow
from openswim.transport.view.viewer import AimedGrid

DEGREES = CRS.from_epsg(4326)
LEVELS = np.linspace(0.0, 20e3, 21)
SUN = (60.0, 40.0)


def row(scene, lat, lon, solver, height_m=8e5, sun=SUN):
    """Radiance (n, 3) of a row of pixels across 1.3 degrees of longitude, from above."""
    camera = Camera.perspective(lat, lon, height_m, azimuth_deg=0, altitude_deg=-90, fov_deg=12, size=(3, 16))
    return render(scene, camera, solver, sun=sun).radiance.values[1]


def land(albedo):
    """A domain of land, 100 km wide, in the sea."""
    x, y = np.arange(70.0, 71.05, 0.1), np.arange(-30.0, -28.95, 0.1)
    ground = {"land_area_fraction": np.ones((11, 11)), "surface_albedo": np.full((11, 11), albedo)}
    return Scene.from_arrays({}, x, y, LEVELS, crs=DEGREES, fields=ground)


@pytest.mark.parametrize(("altitude_deg", "most"), [(40.0, 0.01), (-4.0, 0.003), (-7.5, 0.003), (-11.5, 0.0014)])
def test_sea_is_alike_beside_bright_and_dark_land(altitude_deg, most):
    """A thousand kilometres off South Africa; by the domain's albedo alone red light was .6 times brighter. In twilight
    what is added falls as the light does: beside bright land the sea was black."""
    sun = (60.0, altitude_deg)
    dark, bright = (row(land(albedo), -29.5, 82.0, "swim", sun=sun) for albedo in (0.05, 0.6))
    np.testing.assert_allclose(bright, dark, rtol=most)


@pytest.mark.parametrize(("solver", "most"), [("fast", 0.0045), ("swim", 0.0001)])
def test_a_domain_of_land_shows_no_sides_over_the_sea(solver, most):
    """South of Madagascar; the step there was 4 % in red light by fast."""
    scene = Scene.from_arrays({}, np.arange(20.0, 53.0), np.arange(-35.0, -14.0), LEVELS, crs=DEGREES)
    east = row(scene, -29.0, 51.5, solver)[9:]  # of the nadir
    step = east[1:] / east[:-1]
    assert np.abs(step[1:-1] - 0.5 * (step[:-2] + step[2:])).max() < most


def test_a_swept_domain_of_snow_shows_no_sides_either(monkeypatch):
    """Its own air is lit through its sides, by air over the mean: what is beside goes over to it."""
    x, y = np.arange(8.0, 8.45, 0.04), np.arange(46.4, 46.7, 0.03)
    ground = {"land_area_fraction": np.ones((y.size, x.size)), "surface_albedo": np.full((y.size, x.size), 0.7)}
    lit = light(Scene.from_arrays({}, x, y, LEVELS, crs=DEGREES, fields=ground), sun=SUN)
    assert lit.field.lit[0].swept
    cameras = [Camera.perspective(46.55, lon, 4e5, azimuth_deg=0, altitude_deg=-90, fov_deg=0.1, size=(1, 2))
               for lon in (8.41, 9.8)]  # fmt: skip
    mended = [lit.viewpoint(camera).view().radiance.values for camera in cameras]
    monkeypatch.setattr(AimedGrid, "_add_light_from_below", lambda *_: None)
    near, far = (own / lit.viewpoint(each).view().radiance.values for own, each in zip(mended, cameras, strict=True))
    np.testing.assert_allclose(near, 1, atol=0.005)
    assert (far < 0.97).all()


def test_low_eyes_see_what_they_saw():
    """To them the air below is not all there is."""
    suns, views = len(_MU_SUN), len(_MU_VIEW)
    found = LitFromBelow(np.zeros((4, suns, views)), np.full(4, 0.3), np.full(4, 0.1), np.zeros((4, suns)))
    ways = (np.full((2, 4), 0.05), np.ones(2), np.full(2, 0.6), np.full(2, 0.8))
    low, high = np.array([9e3, 1e4]), np.array([4e4, 1e6])
    assert (np.array(found.more(*ways, low)) == 0).all()
    of_air, of_ground = found.more(*ways, high)
    assert (of_air < -0.2).all()
    np.testing.assert_allclose(of_ground, 4 * 0.05 * (0.97 / 0.995 - 1))
    assert (np.array(found.more(*ways[:3], np.zeros(2), high)) == 0).all()  # level, beside rays to space
