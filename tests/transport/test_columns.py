"""Wide cells, each column by itself: what an eye on the ground or in the air sees, by layers, air and Monte Carlo."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.transport.scenes import LAT, LON, WAVELENGTH_NM, box, grid_scene, slab, sun_at_zenith_angle, toward

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.scene import EARTH_RADIUS_M
from openswim.solver import Solver
from openswim.transport.ground_light.fluxes import sky_flux

CELL_M = (10_000.0, 10_000.0, 400.0)  # drawn on finer ones, of more than 1.2 km
AROUND = np.radians([30.0, 120.0, 210.0, 330.0])


def _looking(*altitudes_deg: float) -> np.ndarray:
    """Directions at altitudes, negative ones downward, to four sides."""
    up = np.radians(np.repeat(altitudes_deg, AROUND.size))
    side = np.tile(AROUND, len(altitudes_deg))
    return np.stack([np.cos(up) * np.cos(side), np.cos(up) * np.sin(side), np.sin(up)], axis=-1)


def _deck(tau: float, **more: object) -> Scene:
    """Even cloud between 3600 and 4800 m, linear to nothing at both sides: farther from an eye than cells are wide."""
    field = np.zeros((16, 24, 24), np.float32)
    field[10:12] = tau / 800.0
    return grid_scene(field, field.shape, CELL_M, curved=True, **more)


def _at_the_deck(way: np.ndarray, height_m: float) -> np.ndarray:
    """The same rays in the axes of where they pass 4200 m: the Earth is round, layers of slabs are not."""
    sine = np.hypot(way[:, 0], way[:, 1])
    ratio = (EARTH_RADIUS_M + height_m) / (EARTH_RADIUS_M + 4200.0)
    upright = np.sign(way[:, 2]) * np.sqrt(1 - (ratio * sine) ** 2)
    return np.stack([ratio * way[:, 0], ratio * way[:, 1], upright], axis=-1)


@pytest.mark.parametrize("tau", [0.5, 4.0, 25.0])
@pytest.mark.parametrize("zenith_deg", [20.0, 65.0])
def test_even_cloud_as_layers_of_many_streams(tau: float, zenith_deg: float) -> None:
    """From the ground, and from an aircraft over it."""
    sun = sun_at_zenith_angle(zenith_deg)
    field = Solver().solve(_deck(tau, surface_albedo=0.2), sun, [WAVELENGTH_NM])
    assert field.quality == "columns"
    layers = Solver().solve(slab(tau, albedo=0.2), sun, [WAVELENGTH_NM])
    for way, height, other in ((_looking(85.0, 50.0, 30.0), 2.0, 2.0), (_looking(-85.0, -60.0, -40.0), 9000.0, 1100.0)):
        seen = field.view(Rays(np.array([500.0, -700.0, height]), way)).radiance[:, 0]
        there = _at_the_deck(way, height)
        expected = np.array([layers.view(Rays(np.array([1000.0, 1000.0, other]), d)).radiance[0, 0] for d in there])
        np.testing.assert_allclose(seen, expected, rtol=0.08, atol=0.005 * expected.max())
        assert seen.mean() == pytest.approx(expected.mean(), rel=0.036)


@pytest.mark.parametrize(
    ("zenith_deg", "low", "high", "above"),
    [(20.0, 0.1, 0.016, 0.0055), (65.0, 0.067, 0.013, 0.0155), (80.0, 0.094, 0.036, 0.023)],
)
def test_thin_even_cloud_keeps_what_runs_level(zenith_deg: float, low: float, high: float, above: float) -> None:
    """Light of a layer of depth .3, beside layers of many streams: low over the horizon, higher, and from above."""
    sun = sun_at_zenith_angle(zenith_deg)
    field = Solver().solve(_deck(0.3, surface_albedo=0.2), sun, [WAVELENGTH_NM])
    layers = Solver().solve(slab(0.3, albedo=0.2), sun, [WAVELENGTH_NM])
    for way, height, other, most in (
        (_looking(20.0, 8.0), 2.0, 2.0, low), (_looking(85.0, 50.0, 30.0), 2.0, 2.0, high),
        (_looking(-85.0, -60.0, -40.0), 9000.0, 1100.0, above),
    ):  # fmt: skip
        seen = field.view(Rays(np.array([500.0, -700.0, height]), way)).radiance[:, 0]
        there = _at_the_deck(way, height)
        expected = np.array([layers.view(Rays(np.array([1000.0, 1000.0, other]), d)).radiance[0, 0] for d in there])
        assert np.sqrt(((seen - expected) ** 2).mean()) < most * expected.mean()


_OVER_A_STEP = """
import numpy as np
from tests.transport.scenes import WAVELENGTH_NM, grid_scene, sun_at_zenith_angle
from openswim.cameras import Rays
from openswim.solver import Solver
extinction = np.zeros((16, 24, 24), np.float32)
extinction[10:12] = 1e-3
ground = np.where(np.arange(24) < 12, 0.0, 2500.0) + np.zeros((24, 1))
scene = grid_scene(extinction, extinction.shape, (10_000.0, 10_000.0, 400.0), curved=True, terrain_m=ground)
field = Solver().solve(scene, sun_at_zenith_angle(40.0), [WAVELENGTH_NM])
x = np.linspace(-30_000.0, 30_000.0, 13)
rays = Rays(np.stack([x, 0 * x, 0 * x + 9000.0], axis=-1), np.array([0.6, 0.0, -0.8]))
print(field.view(rays).radiance.astype(float).tobytes().hex())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only the C library of Linux fills what it allocates")
def test_nothing_is_read_that_was_not_written() -> None:
    """Columns that begin at different heights, over a step of 2.5 km: rubbish in memory changes nothing."""
    seen, root = [], Path(__file__).parents[2]
    for rubbish in ("0", "128"):
        done = subprocess.run(
            [sys.executable, "-c", _OVER_A_STEP], env={**os.environ, "MALLOC_PERTURB_": rubbish}, cwd=root,
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        seen.append(np.frombuffer(bytes.fromhex(done.stdout.strip())))
    assert np.isfinite(seen[0]).all()
    np.testing.assert_array_equal(*seen)


def test_fluxes_close() -> None:
    """Nothing absorbs but the ground; in the middle, since light enters by the sides of the domain."""
    for tau, zenith_deg in ((1.0, 30.0), (60.0, 70.0)):
        field = Solver().solve(_deck(tau, surface_albedo=0.3), sun_at_zenith_angle(zenith_deg), [WAVELENGTH_NM])
        light = field.lit[0].lighting
        middle = (0, slice(80, 105), slice(80, 105))
        down = light.diffuse[middle] + light.direct_horizontal(0)[middle[1:]]
        total = light.up_top[middle] + 0.7 * down
        assert total.mean() == pytest.approx(np.cos(np.radians(zenith_deg)), rel=0.01)


@pytest.mark.parametrize("zenith_deg", [30.0, 77.0])
def test_clear_air_looks_as_outside_the_domain(zenith_deg: float) -> None:
    """From the ground and from above, over black ground."""
    field = np.zeros((30, 24, 24), np.float32)
    field[25] = 1e-9
    scene = grid_scene(field, field.shape, (10_000.0, 10_000.0, 500.0), curved=True, air=True)
    sun = sun_at_zenith_angle(zenith_deg)
    ours, clear = (Solver().solve(s, sun, [615.0, 450.0]) for s in (scene, Scene.clear(LAT, LON, surface_albedo=0.0)))
    for way, height in ((_looking(85.0, 45.0, 20.0), 2.0), (_looking(-85.0, -45.0), 9000.0)):
        rays = Rays(np.array([500.0, -700.0, height]), way)
        np.testing.assert_allclose(ours.view(rays).radiance, clear.view(rays).radiance, rtol=0.04)


@pytest.mark.parametrize(
    ("altitude_deg", "most"), [(10.0, 0.027), (2.0, 0.07), (-2.0, 0.11), (-5.0, 0.11), (-7.5, 1e-4)]
)
def test_clear_ground_in_twilight_has_the_light_of_the_shells(altitude_deg: float, most: float) -> None:
    """Under the sun of each place, over 460 km. Between suns 3.6 degrees apart it had up to three times as much, and
    without what four harmonics do not hold a third less."""
    field = np.zeros((30, 24, 24), np.float32)
    field[25] = 1e-9
    scene = grid_scene(field, field.shape, (20_000.0, 20_000.0, 500.0), curved=True, air=True, surface_albedo=0.2)
    lit = Solver().solve(scene, sun_at_zenith_angle(90 - altitude_deg), [615.0, 450.0]).lit[0]
    known = np.moveaxis(sky_flux(lit.shells, lit.lighting.mu_sun.ravel()), -1, 0).reshape(lit.lighting.diffuse.shape)
    ratio = (lit.lighting.diffuse / known)[:2, 2:-2, 2:-2]
    np.testing.assert_allclose(ratio, 1, atol=most)


def test_clouds_from_the_ground_by_monte_carlo() -> None:
    """Heaps some cells wide over bright ground: no tint, and as dark below as they are."""
    rng = np.random.default_rng(3)
    z, y, x = np.mgrid[0:16, 0:40, 0:40]
    field = np.zeros(z.shape)
    for _ in range(14):
        at, wide = rng.uniform((4, 6, 6), (9, 34, 34)), rng.uniform(2.5, 5.0)
        field += 0.006 * np.exp(-(((z - at[0]) / 2.0) ** 2) - ((y - at[1]) ** 2 + (x - at[2]) ** 2) / wide**2)
    field[field < 3e-4] = 0
    cell = (5000.0, 5000.0, 400.0)
    scene = grid_scene(field.astype(np.float32), z.shape, cell, curved=True, air=True, surface_albedo=0.3)
    sun = sun_at_zenith_angle(50.0)
    way = _looking(85.0, 65.0, 45.0, 30.0)
    eyes = np.column_stack([rng.uniform(-25e3, 25e3, (5, 2)), np.full(5, 2.0)])
    field_ = Solver().solve(scene, sun, [615.0, 450.0])
    truth = Solver("reference", paths=150).solve(scene, sun, [615.0, 450.0])
    seen, expected = (
        np.mean([one.view(Rays(eye, way)).radiance for eye in eyes], axis=(0, 1)) for one in (field_, truth)
    )
    np.testing.assert_allclose(seen, expected, rtol=0.06)
    assert seen[1] / seen[0] == pytest.approx(expected[1] / expected[0], rel=0.04)


@pytest.mark.parametrize("altitude_deg", [60.0, 20.0])
def test_a_deck_that_ends_with_the_domain_is_no_brighter_there(altitude_deg: float) -> None:
    """Its last cells toward the sun take what the beam brings through the top and half a cell; lit through and through
    they would be 15 to 30 times as bright."""
    shape = (16, 20, 20)
    cloud = box(shape, (slice(4, 12), slice(None), slice(None)), 0.02)
    scene = grid_scene(cloud, shape, (5000.0, 5000.0, 300.0), True, air=True)
    field = Solver().solve(scene, toward(60.0, altitude_deg), [546.0])
    up = field.lit[0].lighting.up_top[0]
    middle = up[up.shape[0] // 2, up.shape[1] // 2]
    np.testing.assert_allclose(up[:, -1], middle, rtol=0.12)
    np.testing.assert_allclose(up[-1], middle, rtol=0.12)


@pytest.mark.parametrize("nodes", [21, 17])
def test_a_nest_whose_sides_lie_on_its_parents_is_no_brighter_there(nodes: int) -> None:
    """21 nodes end where the parent's cloud does; of fewer the sides are in the parent's shade."""

    def deck(nodes: int, cell_m: float) -> Scene:
        shape = (16, nodes, nodes)
        cloud = box(shape, (slice(4, 12), slice(None), slice(None)), 0.02)
        return grid_scene(cloud, shape, (cell_m, cell_m, 300.0), True, air=True)

    nest = deck(nodes, 5000.0)
    nest.wider = deck(11, 10_000.0)
    field = Solver().solve(nest, toward(60.0, 20.0), [546.0])
    up = field.lit[0].lighting.up_top[0]
    middle = up[up.shape[0] // 2, up.shape[1] // 2]
    np.testing.assert_allclose(up[:, -1], middle, rtol=0.12)
    np.testing.assert_allclose(up[-1], middle, rtol=0.12)
