"""Flat worlds without air: what cells say, how far pixels see clear, and the sun's light on a place."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numba import njit
from scipy.interpolate import RegularGridInterpolator
from tests.transport.scenes import down_on, sky_directions, toward

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport.montecarlo.cell_track import cell_at, depth_to_sun
from openswim.transport.montecarlo.cells import cell_majorants, cells_of, free_cells
from openswim.transport.montecarlo.first_cloud import clear_m
from openswim.transport.montecarlo.reference import ReferenceField

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


@njit
def _cell(j, i, k, octant, world):
    return cell_at(i, j, k, octant, world)


@njit
def _depth(x, y, z, most, world):
    nodes, depth = np.zeros(1), np.zeros(1)
    least = depth_to_sun(x, y, z, most, world, nodes, depth)
    return least, depth[0]


@pytest.mark.parametrize("periodic", [True, False])
def test_cells_in_blocks_say_what_cells_hold(periodic: bool) -> None:
    """Majorants hold, and are 5 % too large at most; what is said to be empty ahead is."""
    world = broken(periodic).world
    majorant = cell_majorants(world.extinction[..., 0], periodic)
    free = free_cells(majorant, periodic, world.terrain_m.shape)
    world = world._replace(cells=cells_of(majorant, free))
    far = 0
    for j, i, k in np.ndindex(majorant.shape):
        for octant in range(8):
            most, ahead = _cell(j, i, k, octant, world)
            if majorant[j, i, k] > 0:
                assert majorant[j, i, k] <= most <= 1.052 * majorant[j, i, k]
                assert ahead == 0
            else:
                assert most == 0
                assert 1 <= ahead <= free[octant, j, i, k]
                far += ahead > 1
    assert far > 0.2 * (majorant == 0).sum()


@pytest.mark.parametrize("periodic", [True, False])
def test_pixels_are_clear_as_far_as_is_said(periodic: bool) -> None:
    world = broken(periodic).world
    field = world.extinction[..., 0]
    if periodic:
        field = np.pad(field, ((0, 0), (0, 1), (0, 1)), mode="wrap")
    axes = [Z, np.append(Y, Y[-1] + 80.0)[: field.shape[1]], np.append(X, X[-1] + 100.0)[: field.shape[2]]]
    at = RegularGridInterpolator(axes, field, bounds_error=False, fill_value=0.0)
    rng = np.random.default_rng(1)
    some = 0
    for direction in np.concatenate([-sky_directions([0.0, 30.0, 70.0], np.arange(8) * 45.0 + 5.0)] * 2):
        up = rng.random() < 0.3
        direction = direction * [1, 1, -1 if up else 1]
        origin = np.array([*rng.uniform(-500, 500, 2), 0.0 if up else 1500.0])
        across, along = np.array([60.0, 10.0, 0.0]), np.array([-10.0, 40.0, 20.0 * (not up)])
        far, clear = clear_m(*origin, *direction, across, along, world)
        some += not clear and far > 100.0
        s = np.linspace(0, min(far, 3000.0), 400)[:, None, None]
        spread = rng.uniform(-0.5, 0.5, (200, 2)) @ np.array([across, along])
        place = origin + spread + s * direction
        if periodic:
            place[..., 0] = (place[..., 0] - X[0]) % 1400.0 + X[0]
            place[..., 1] = (place[..., 1] - Y[0]) % 960.0 + Y[0]
        assert at(place[..., ::-1]).max() <= 1e-9
    assert some > 10


def test_depth_to_the_sun_is_the_integral() -> None:
    """By the trapezoidal rule in steps of 5 cm; given up where it is more than asked for."""
    world = broken().world
    at = RegularGridInterpolator([Z, Y, X], world.extinction[..., 0], bounds_error=False, fill_value=0.0)
    rng = np.random.default_rng(2)
    deep = 0
    for _ in range(120):
        place = rng.uniform([-600, -400, 0], [600, 400, Z[-1]])
        s = np.arange(0.0, 2100.0, 0.05)[:, None]
        truth = float(np.trapezoid(at((place + s * SUN)[:, ::-1]), dx=0.05))
        least, depth = _depth(*place, 1e9, world)
        assert least == depth == pytest.approx(truth, rel=2e-3, abs=2e-3)
        deep += truth > 1
        if truth > 0.5:
            assert 0.3 < _depth(*place, 0.3, world)[0] <= truth * 1.01
    assert deep > 5


@pytest.mark.parametrize(("periodic", "wavelengths"), [(False, (546.0,)), (True, (450.0, 615.0))])
def test_any_guess_of_the_sun_is_put_right(periodic: bool, wavelengths: tuple[float, ...]) -> None:
    """Radiances with depths at nodes that are nonsense, and with doubts that are too small, are the same."""
    light = broken(periodic, 6000, wavelengths)
    shade = light.world.shade
    assert shade.depth.max() > 1
    rng = np.random.default_rng(3)
    nonsense = shade._replace(
        depth=rng.uniform(0, 2, shade.depth.shape).astype(np.float32), doubt=np.full_like(shade.doubt, 100),
        ground_depth=rng.uniform(0, 1, shade.ground_depth.shape).astype(np.float32),
        ground_doubt=np.full_like(shade.ground_doubt, 100),
    )  # fmt: skip
    other = replace(light, world=light.world._replace(shade=nonsense), solver=replace(light.solver, seed=1))
    down = down_on(*np.array(list(product(np.linspace(-500, 500, 5), np.linspace(-400, 400, 5)))).T, 3000.0)
    ground = Rays(np.array([30.0, -60.0, 0.1]), sky_directions([15.0, 40.0, 65.0], [10.0, 100.0, 200.0, 290.0]))
    for rays in (down, ground):
        mine, theirs = light.view(rays), other.view(rays)
        sigma = np.hypot(mine.sigma, theirs.sigma).astype(float)
        assert (np.abs(mine.radiance - theirs.radiance) < 4.5 * np.maximum(sigma, 1e-6)).all()
        whole = np.sqrt((sigma**2).sum(axis=0)) / len(sigma)
        assert (np.abs(mine.radiance.mean(axis=0) - theirs.radiance.mean(axis=0)) < 3 * whole).all()
    assert mine.sigma.mean() < theirs.sigma.mean()


def test_the_guess_is_exact_at_nodes() -> None:
    world = broken().world
    near = np.argwhere(world.shade.depth[..., 0] > 0.1)
    assert len(near) > 50
    for k, j, i in near[::7]:
        _, depth = _depth(X[i], Y[j], Z[k] + 1e-6, 1e9, world)
        assert world.shade.depth[k, j, i, 0] == pytest.approx(min(depth, 6.0), rel=1e-3)


def test_shadows_lie_beside_open_domains() -> None:
    """Ground beside the domain, in the shadow of its cloud: darker than the light of the sun alone, by its depth."""
    light = broken(paths=20_000)
    reach = -SUN[:2] / SUN[2]
    rng = np.random.default_rng(4)
    for _ in range(200):
        place = np.array([*(rng.uniform(-400, 400, 2) + 900.0 * reach), 0.0])
        _, depth = _depth(*place, 1e9, light.world)
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
