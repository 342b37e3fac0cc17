"""An even sky beyond the air: where nothing absorbs, everything is as bright as it, cloud, ground and air."""

import numpy as np
import pytest

from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.atmosphere import AerosolProfile, Atmosphere
from openswim.scene.frame import scene_frame
from openswim.solver import Solver


@pytest.mark.slow
def test_in_an_even_light_nothing_stands_out():
    """Cloud of depth 20 in white air over white ground: L' = 1 from below, from above, and past its edge."""
    x, z = np.arange(10) * 300.0, np.arange(0, 3001, 250.0)
    extinction = np.zeros((13, 10, 10), np.float32)
    extinction[4:8, 3:7, 3:7] = 0.02
    scene = Scene.from_arrays(
        extinction, x, x, z, surface_albedo=1.0, atmosphere=Atmosphere.us_standard(0.0, None)
    )
    field = Solver("fast", quality="preview").solve_starlit(scene, [546.0])
    way = np.array([[0, 0, 1.0], [0.3, 0.2, 0.93], [0.7, 0.1, 0.7], [0.95, 0.1, 0.3], [0.99, 0.1, 0.1]])
    way /= np.linalg.norm(way, axis=1)[:, None]
    for place, direction in (((1350.0, 1350.0, 1.0), way), ((100.0, 100.0, 1.0), way), ((1350.0, 1350.0, 8e3), -way)):
        seen = field.view(Rays(np.array(place), direction)).radiance
        assert seen == pytest.approx(1.0, abs=0.04)  # with the standard quality .015


def test_clear_air_under_an_even_sky():
    scene = Scene.clear(
        40.0, 10.0, Atmosphere.us_standard(0.0, AerosolProfile(0.1, single_scattering_albedo=1.0)), surface_albedo=1.0
    )
    frame = scene_frame(scene)
    field = Solver().solve_starlit(scene, [450.0, 615.0])
    up = frame.direction(np.full(4, 30.0), np.array([90.0, 45.0, 15.0, 5.0]), 40.0, 10.0)
    assert field.view(Rays(frame.position(40.0, 10.0, 10.0), up)).radiance == pytest.approx(1.0, abs=0.0085)
    # seen from space the dark side has no sky before it
    down = -up[:2]
    assert field.view(Rays(frame.position(40.0, 10.0, 6e5), down)).radiance == pytest.approx(1.0, abs=0.04)
    with pytest.raises(UserError, match="reference"):
        Solver("reference").solve_starlit(scene, [550.0])
