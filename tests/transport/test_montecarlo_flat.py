"""Flat worlds without air: how far pixels see clear, the sun's light on a place, shadows and plateaus."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from scipy.interpolate import RegularGridInterpolator
from tests.transport.scenes import down_on, sky_directions, toward

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport.montecarlo.kernels import pixel_width, scout
from openswim.transport.montecarlo.phase import start_stream
from openswim.transport.montecarlo.reference import ReferenceField
from openswim.transport.montecarlo.track import sunlight

X, Y = 100.0 * np.arange(14) - 650.0, 80.0 * np.arange(12) - 440.0
Z = np.concatenate([[0.0, 300.0], 300.0 + np.cumsum(np.random.default_rng(6).uniform(50.0, 150.0, 8))])
SUN = toward(200.0, 35.0)


def broken(periodic: bool = False, paths: int = 4000, wavelengths: tuple[float, ...] = (546.0,)) -> ReferenceField:
    """Ragged cloud between uneven levels over bright ground."""
    rng = np.random.default_rng(5)
    field = np.where(rng.random((10, 12, 14)) < 0.08, 0.03 * rng.random((10, 12, 14)), 0).astype(np.float32)
    field[:2] = 0
    scene = Scene.from_arrays(
        field, X, Y, Z, single_scattering_albedo=0.95, phase=HenyeyGreenstein(0.8), periodic=periodic,
        surface_albedo=0.4,
    )  # fmt: skip
    return Solver("reference", paths=paths).solve(scene, SUN, wavelengths)


def trilinear(light: ReferenceField, periodic: bool = False) -> RegularGridInterpolator:
    """Extinction at places (z, y, x) of the one period, 0 beyond an open domain."""
    field = light.world.extinction[..., 0]
    if periodic:
        field = np.pad(field, ((0, 0), (0, 1), (0, 1)), mode="wrap")
    axes = [Z, np.append(Y, Y[-1] + 80.0)[: field.shape[1]], np.append(X, X[-1] + 100.0)[: field.shape[2]]]
    return RegularGridInterpolator(axes, field, bounds_error=False, fill_value=0.0)


def depth_to_sun(at: RegularGridInterpolator, place: np.ndarray) -> float:
    """By the trapezoidal rule in steps of 5 cm."""
    s = np.arange(0.0, 2100.0, 0.05)[:, None]
    return float(np.trapezoid(at((place + s * SUN)[:, ::-1]), dx=0.05))


@njit
def _sunlight(x, y, z, count, world):
    """Mean and standard error of estimates of the sun's light at a place."""
    rng, beam, nodes = np.zeros(1, np.uint64), np.zeros(1), np.zeros(1)
    start_stream(rng, 1, 2, 3)
    total, squares = 0.0, 0.0
    for _ in range(count):
        if sunlight(x, y, z, z, world, beam, nodes, rng):
            total += beam[0]
            squares += beam[0] ** 2
    mean = total / count
    return mean, np.sqrt(max(squares / count - mean**2, 0.0) / count)


@pytest.mark.parametrize("periodic", [True, False])
def test_pixels_are_clear_as_far_as_is_said(periodic: bool) -> None:
    light = broken(periodic)
    world, at = light.world, trilinear(light, periodic)
    rng = np.random.default_rng(1)
    some = 0
    for direction in np.concatenate([-sky_directions([0.0, 30.0, 70.0], np.arange(8) * 45.0 + 5.0)] * 2):
        up = rng.random() < 0.3
        direction = direction * [1, 1, -1 if up else 1]
        origin = np.array([*rng.uniform(-500, 500, 2), 0.0 if up else 1500.0])
        across, along = np.array([60.0, 10.0, 0.0]), np.array([-10.0, 40.0, 20.0 * (not up)])
        margin, ahead_m = pixel_width(*direction, across, along, world)
        assert margin >= 0
        cloud_m, ground_m = scout(
            *origin, *direction, margin, world, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1),
            *np.zeros((2, len(world.layer_majorant))),
        )  # fmt: skip
        far = max(cloud_m, ground_m) - ahead_m - 1.0  # where paths begin
        if cloud_m < 0 and ground_m < 0:
            far = 3000.0
        some += cloud_m > 100.0
        s = np.linspace(0, max(min(far, 3000.0), 0.0), 400)[:, None, None]
        spread = rng.uniform(-0.5, 0.5, (200, 2)) @ np.array([across, along])
        place = origin + spread + s * direction
        if periodic:
            place[..., 0] = (place[..., 0] - X[0]) % 1400.0 + X[0]
            place[..., 1] = (place[..., 1] - Y[0]) % 960.0 + Y[0]
        assert at(place[..., ::-1]).max() <= 1e-9
    assert some > 10


def test_sunlight_is_that_of_the_integral() -> None:
    """Ratio tracking from block to block, its mean over 4000 walks to 4.5 sigma."""
    light = broken()
    at, rng = trilinear(light), np.random.default_rng(2)
    deep = 0
    for _ in range(60):
        place = rng.uniform([-600, -400, 0], [600, 400, Z[-1]])
        truth = np.exp(-depth_to_sun(at, place))
        mean, sigma = _sunlight(*place, 4000, light.world)
        assert abs(mean - truth) < 4.5 * sigma + 2e-3 * truth
        assert sigma < 0.02
        deep += truth < 0.4
    assert deep > 5


def test_shadows_lie_beside_open_domains() -> None:
    """Ground beside the domain, in the shadow of its cloud: darker than the light of the sun alone, by its depth."""
    light = broken(paths=20_000)
    reach, at = -SUN[:2] / SUN[2], trilinear(light)
    rng = np.random.default_rng(4)
    for _ in range(200):
        place = np.array([*(rng.uniform(-400, 400, 2) + 900.0 * reach), 0.0])
        depth = depth_to_sun(at, place)
        if max(abs(place[0]) - 650, abs(place[1]) - 440) > 300 and 0.3 < depth < 2:
            break
    view = light.view(down_on([place[0]], place[1], 3000.0))
    direct = 4 * 0.4 * SUN[2] * np.exp(-depth)
    assert direct - 4 * view.sigma[0, 0] < view.radiance[0, 0] < direct + 0.25
    assert view.sigma[0, 0] < 0.02


def test_fog_on_a_plateau_is_fog_on_the_plain() -> None:
    """Rays end at the plateau (they went on to the lowest level, through the fog below)."""
    fog = np.zeros((10, 12, 14), np.float32)
    fog[:6] = 0.02
    z, down, up_m = 50.0 * np.arange(10), -sky_directions([5.0, 40.0], [0.0, 120.0]), 100.0
    raised = Scene.from_arrays(fog, X, Y, z, terrain_m=np.full((12, 14), up_m), surface_albedo=0.4)
    plain = Scene.from_arrays(fog[2:], X, Y, z[:8], surface_albedo=0.4)
    there, here = (Solver("reference", paths=4000).solve(scene, SUN, [546.0]) for scene in (raised, plain))
    eye = np.array([50.0, 30.0, 440.0])
    one, two = there.view(Rays(eye + np.array([0.0, 0.0, up_m]), down)), here.view(Rays(eye, down))
    sigma = np.hypot(one.sigma, two.sigma)
    assert (np.abs(one.radiance - two.radiance) < 4 * sigma).all()
