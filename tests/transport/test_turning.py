"""Periods, and cloud around an eye, seen by one that looks around: every ray reads sources in its own direction."""

import numpy as np
import pytest

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver

SUN = np.array([0.6, 0.5, 0.62])


def scene(across, atmosphere=None):
    x, z = 100.0 * np.arange(across), 100.0 * np.arange(16)
    waves = np.cos(2 * np.pi * x / (100.0 * across))
    cloud = np.zeros((16, across, across), np.float32)
    cloud[5:9] = 0.02 * np.maximum(0.4 + waves * waves[:, None], 0.1)
    return Scene.from_arrays(
        cloud, x, x, z, periodic=True, surface_albedo=0.1, phase=HenyeyGreenstein(0.85), atmosphere=atmosphere
    )  # fmt: skip


@pytest.mark.parametrize(("across", "atmosphere"), [(12, None), (4, Atmosphere.us_standard())])
def test_a_ray_sees_the_same_in_company_and_alone(across, atmosphere):
    """Alone it is parallel light to itself, and sources are aimed along it; in company they were aimed at the eye from
    within the base period, and the same ray was up to three times as bright."""
    here = scene(across, atmosphere)
    zenith, azimuth = np.radians([20, 60, 80, 85, 110, 150]), np.radians([10, 130, 250, 340, 200, 70])
    sine = np.sin(zenith)
    rays = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(zenith)], axis=-1)
    eye = np.array([130.0, 1050.0, 20.0])
    alone, around = (Solver(quality="preview").solve(here, SUN, [615.0, 450.0]) for _ in range(2))
    together = around.view(Rays(eye, rays)).radiance
    single = np.concatenate([alone.view(Rays(eye[None], ray)).radiance for ray in rays])
    assert (single > 0.05).all()
    np.testing.assert_allclose(together, single, rtol=2e-3, atol=1e-4)


def test_a_period_further_is_the_same():
    field = Solver(quality="preview").solve(scene(12), SUN, [550.0])
    rays = np.array([[0.5, 0.3, 0.81], [-0.9, 0.1, 0.42], [0.1, -0.97, 0.22]])
    here, there = (field.view(Rays(np.array([x, 300.0, 5.0]), rays)).radiance for x in (50.0, 50.0 + 3 * 1200.0))
    np.testing.assert_allclose(here, there, rtol=1e-3)


@pytest.mark.parametrize("cell_m", [100.0, 3000.0])
@pytest.mark.parametrize("height_m", [5.0, 250.0, 750.0])
def test_an_eye_in_cloud_sees_what_each_ray_sees_alone(cell_m, height_m):
    """In fog, in its middle and just above: sources aimed at the eye are wrong by 12 to 89 %, in swept cells as in
    wide ones, which are lit column by column. There a node's source is told by how its cells are seen along a ray, of
    cloud under an eye mostly, which its harmonics hold within 1.3 %."""
    x, z = cell_m * (np.arange(24) - 11.5), 50.0 * np.arange(18)
    cloud = np.zeros((18, 24, 24), np.float32)
    cloud[:14] = 0.015 * np.exp(0.3 * np.random.default_rng(1).standard_normal((14, 24, 24)))
    fog = Scene.from_arrays(cloud, x, x, z, surface_albedo=0.1, phase=HenyeyGreenstein(0.85))
    zenith, azimuth = np.radians([20, 50, 70, 110, 150]), np.radians([10, 130, 250, 200, 70])
    sine = np.sin(zenith)
    rays = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(zenith)], axis=-1)
    rays = rays[rays[:, 2] > 0] if height_m < 100 else rays
    eye = np.array([0.13 * cell_m, 0.3 * cell_m, height_m])
    alone, around = (Solver(quality="preview").solve(fog, SUN, [546.0]) for _ in range(2))
    together = around.view(Rays(eye, rays)).radiance
    single = np.concatenate([alone.view(Rays(eye[None], ray)).radiance for ray in rays])
    np.testing.assert_allclose(together, single, rtol=2e-3 if cell_m < 1000 else 0.017, atol=1e-4)
