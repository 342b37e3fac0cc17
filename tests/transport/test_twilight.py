"""Twilight between the suns for which the clear sky is solved: it falls evenly in the logarithm."""

import numpy as np
import pytest
from tests.transport.scenes import grid_scene, sun_at_zenith_angle

from openswim.optics.chosen import with_stratosphere
from openswim.scene import Scene
from openswim.scene.frame import scene_frame
from openswim.scene.rays import Rays
from openswim.solver import Solver
from openswim.transport.ground_light.fluxes import sky_flux
from openswim.validation.clearsky import ClearSky


@pytest.mark.slow
def test_no_sun_stands_out():
    """The zenith at half a degree between solved suns, and where these are two degrees apart: bends, but no steps."""
    zenith = np.array([96.0, 96.5, 97.0, 102.0, 103.0, 104.0])
    light = np.array([
        ClearSky(Solver(), sun, 0.1, 0.1, np.array([546.0])).from_inside(0.0, [0.0], [0.0])[0, 0, 0] for sun in zenith
    ])  # fmt: skip
    assert (np.diff(light) < 0).all()
    for a, b, c in (light[:3], light[3:]):
        assert b / np.sqrt(a * c) == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize(("altitude_deg", "most"), [(1.5, 0.0085), (-2.0, 0.0115), (-5.0, 0.0114), (-8.0, 0.0175)])
def test_swept_ground_has_the_light_of_the_sky_over_it(altitude_deg: float, most: float) -> None:
    """Over 47 km. It comes in nearly level from where it is brighter, of which the sky over the middle tells nothing:
    with the sun 8 degrees down the middle had a fifth less."""
    field = np.zeros((24, 48, 48), np.float32)
    field[8, 20, 20] = 1e-9
    scene = grid_scene(field, field.shape, (1000.0, 1000.0, 700.0), curved=True, air=True, surface_albedo=0.2)
    lit = Solver().solve(scene, sun_at_zenith_angle(90 - altitude_deg), [615.0, 450.0]).lit[0]
    known = np.moveaxis(sky_flux(lit.shells, lit.lighting.mu_sun.ravel()), -1, 0).reshape(lit.lighting.diffuse.shape)
    ratio = (lit.lighting.diffuse / known)[:2]
    assert lit.swept
    np.testing.assert_allclose(ratio, 1, atol=most)


@pytest.mark.slow
def test_light_leaves_a_layer_that_the_sun_grazes():
    """After Pinatubo, with the sun 2 degrees down: along the layer most light that is scattered is turned out of it. In
    the afterglow Monte Carlo has a standard error of 1 %; `fast` was 22 % brighter while light that is turned by ten
    degrees counted as if it were not."""
    scene = with_stratosphere(Scene.clear(40.0, 0.0), "pinatubo")
    frame = scene_frame(scene)
    sun, eye = frame.direction(250.0, -2.0, 40.0, 0.0), frame.position(40.0, 0.0, 2.0)
    rays = Rays(eye, np.array([frame.direction(250.0, altitude, 40.0, 0.0) for altitude in (20.0, 26.0, 32.0, 40.0)]))
    fast, truth = (
        solver.solve(scene, sun, np.array([615.0, 546.0])).view(rays).radiance.astype(float).sum(axis=0)
        for solver in (Solver("fast"), Solver("reference", paths=200_000))
    )
    np.testing.assert_allclose(fast / truth, 1.0, atol=0.08)
