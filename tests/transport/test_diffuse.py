"""The two-grid solve of the diffuse field, its transfers between grids, and the products that make its sources."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from tests.transport.scenes import grid_scene, mean_by_chance, sky_directions, toward

from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport.diffuse.moments import Moments, nothing_coarser, places, prolong, restrict
from openswim.transport.diffuse.optical_grid import coarsen
from openswim.transport.diffuse.ordinate_transform import BLOCK, in_groups, multiply
from openswim.transport.engine.ordinates import harmonic_matrix, lebedev

SHAPE = (14, 52, 50)  # three grids, with an odd one among them
CELL_M = (100.0, 100.0, 100.0)
SUN = toward(250.0, 40.0)
UP_AND_DOWN = np.concatenate([sky_directions([20.0, 60.0], [0.0, 90.0, 200.0]), [[0, 0, -1.0], [0.6, 0.0, -0.8]]])


def broken_cloud(seed: int = 1) -> np.ndarray:
    """Blobs of up to 30 per km between 400 and 1000 m."""
    rng = np.random.default_rng(seed)
    nz, ny, nx = SHAPE
    z, y, x = np.ogrid[0:nz, 0:ny, 0:nx]
    out = np.zeros(SHAPE)
    for _ in range(14):
        k, j, i, r = rng.uniform(5, 9), rng.uniform(0, ny), rng.uniform(0, nx), rng.uniform(2, 6)
        out += np.clip(1.2 - ((z - k) ** 2 * 2 + (y - j) ** 2 + (x - i) ** 2) / r**2, 0, 1)
    return np.minimum(out, 1) * 0.03 * ((z > 3) & (z < 11))


@pytest.mark.slow
@pytest.mark.parametrize("albedo", [0.0, 0.5])
def test_the_default_tolerance_is_near_the_converged_light(albedo: float) -> None:
    """Tolerance .02 is what a sweep may still mend; what remains is 1 % of fluxes and 4 % of images (RMSE)."""
    scene = grid_scene(broken_cloud(), SHAPE, CELL_M, surface_albedo=albedo)
    quick, exact = (Solver(tolerance=t).solve(scene, SUN, [546.0]) for t in (0.02, 0.002))
    assert len(quick.lit[0].sweeps[0]) >= 3
    for name, flux in exact.fluxes().items():
        np.testing.assert_allclose(quick.fluxes()[name], flux, rtol=0.0076, atol=1e-6, err_msg=name)
    across = np.random.default_rng(5).uniform(-2000.0, 2000.0, (50, 2))
    for direction in UP_AND_DOWN:
        height = 2.0 if direction[2] > 0 else 1350.0
        look = Rays(np.column_stack([across, np.full(50, height)]), direction)
        a, b = (field.view(look).radiance[:, 0] for field in (quick, exact))
        assert np.sqrt(((a - b) ** 2).mean()) < 0.04 * b.mean()


@pytest.mark.slow
@pytest.mark.parametrize("periodic", [False, True])
def test_wavelengths_alike_are_lit_alike(periodic: bool) -> None:
    """Grey cloud over grey ground: no tint from one wavelength being solved whole and the others after it."""
    cloud = broken_cloud(2)[:, :26, :25] if periodic else broken_cloud(2)
    scene = grid_scene(cloud, cloud.shape, CELL_M, surface_albedo=0.2, periodic=periodic)
    field = Solver().solve(scene, SUN, [615.0, 546.0, 450.0])
    for flux in field.fluxes().values():
        np.testing.assert_allclose(flux, flux[0], rtol=5e-4)
    for height in (2.0, 1350.0):
        radiance = field.view(Rays(np.array([330.0, -410.0, height]), UP_AND_DOWN)).radiance
        np.testing.assert_allclose(radiance, radiance[:, :1].repeat(3, 1), rtol=2.3e-3, atol=5e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cloud", "altitude_deg", "off"),
    [
        (0.5 * broken_cloud(3), 40.0, 0.0022), (0.5 * broken_cloud(3), 15.0, 0.0014),
        (3.0 * broken_cloud(4)[:, 26:, :25], 30.0, 0.00044),
    ],
    ids=["broken", "low sun", "thick"],
)  # fmt: skip
def test_a_white_world_without_sides_keeps_its_light(cloud: np.ndarray, altitude_deg: float, off: float) -> None:
    """Broken conservative cloud, periodic, black ground: what enters leaves by the top or is absorbed below; also where
    cells are thick (optical depth 9 before they are divided)."""
    sun = toward(250.0, altitude_deg)
    scene = grid_scene(cloud, cloud.shape, CELL_M, periodic=True)
    fluxes = Solver().solve(scene, sun, [546.0]).fluxes()
    total = sum(float(fluxes[name][0]) for name in ("up_top", "down_bottom", "direct_bottom"))
    assert total == pytest.approx(sun[2], rel=off)


def test_light_on_its_way_round_a_period_is_mixed_with_the_rest() -> None:
    """Thin white cloud under a low sun: 30 sweeps of a grid at most, 60 where Anderson's mix left out what sweeps begin
    with at the sides of a period."""
    scene = grid_scene(0.5 * broken_cloud(3), SHAPE, CELL_M, periodic=True)
    assert max(Solver().solve(scene, toward(250.0, 15.0), [546.0]).packs[0].sweeps[0]) < 39


def test_products_in_tiles_are_those_of_the_matrices() -> None:
    """Group by group, as a sweep takes them: emission along each ordinate, and their light summed over all groups."""
    ordinates = lebedev(50)
    down = ordinates.direction[:, 2] >= 0
    q, weight = ordinates.direction[down], ordinates.weight[down].astype(np.float32)
    there = in_groups(q, weight, 5, 10)
    assert len(there.first) == 3
    matrix = harmonic_matrix(q, 5)
    rng = np.random.default_rng(0)
    moments = rng.standard_normal((25, BLOCK)).astype(np.float32)
    light = rng.standard_normal((len(q), BLOCK)).astype(np.float32)
    emission, gathered = np.zeros_like(light), np.ones_like(moments)
    for g, (a, b) in enumerate(pairwise(there.first)):
        multiply(there.harmonics, g, b - a, 25, moments, 0, BLOCK, emission, a * BLOCK, BLOCK, False)
        multiply(there.gather, g, 25, b - a, light, a * BLOCK, BLOCK, gathered, 0, BLOCK, True)
    np.testing.assert_allclose(emission, matrix @ moments, atol=2e-4)
    np.testing.assert_allclose(gathered, 1 + (matrix * weight[:, None]).T @ light, atol=2e-4)


def blocks_of(field: np.ndarray) -> Moments:
    """A dense field (moments, nz, ny, nx), kept everywhere."""
    count, nz, ny, nx = field.shape
    blocks = -(-nx // BLOCK)
    place = places(np.ones((nz, ny, blocks), bool))
    wide = np.pad(field, [(0, 0)] * 3 + [(0, blocks * BLOCK - nx)])
    values = wide.reshape(count, nz, ny, blocks, BLOCK).transpose(1, 2, 3, 0, 4).reshape(-1, count, BLOCK)
    return Moments(place, np.ascontiguousarray(values, np.float32))


def dense(moments: Moments, nx: int) -> np.ndarray:
    nz, ny, blocks = moments.place.shape
    values = moments.values.reshape(nz, ny, blocks, -1, BLOCK).transpose(3, 0, 1, 2, 4)
    return values.reshape(values.shape[0], nz, ny, blocks * BLOCK)[..., :nx]


@pytest.mark.parametrize("size", [(6, 40), (7, 71), (5, 33)])
def test_restriction_is_the_mean_by_extinction(size: tuple[int, int]) -> None:
    ny, nx = size
    rng = np.random.default_rng(4)
    field, weight = rng.standard_normal((4, 2, ny, nx)), rng.random((2, ny, nx)).astype(np.float32)
    fine = blocks_of(field)
    coarse = blocks_of(np.full((4, 2, (ny + 1) // 2, (nx + 1) // 2), 9.0))
    restrict(0, 1, fine.place, np.zeros_like(fine.values), fine.values, weight, nx, coarse.place, coarse.values)
    expected = coarsen((field * weight).astype(np.float32)) / coarsen(weight)
    np.testing.assert_allclose(dense(coarse, (nx + 1) // 2), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("size", [(6, 40), (7, 71)])
def test_prolongation_keeps_planes_and_constants(size: tuple[int, int]) -> None:
    """Linear inside; constant to the edge, where there is nothing to interpolate with."""
    ny, nx = size
    rows, columns = (ny + 1) // 2, (nx + 1) // 2
    y, x = np.mgrid[0:rows, 0:columns] * 2.0 + 0.5
    coarse = blocks_of(np.stack([np.ones((1, rows, columns)), (3 * y - 2 * x)[None], *np.zeros((2, 1, rows, columns))]))
    fine = blocks_of(np.zeros((4, 1, ny, nx)))
    prolong(0, 1, coarse, columns, nothing_coarser(2), fine.place, nx, fine.values, False)
    seen = dense(fine, nx)
    np.testing.assert_allclose(seen[0], 1.0, rtol=1e-6)
    y, x = np.mgrid[0:ny, 0:nx]
    inner = (slice(1, 2 * rows - 1 - ny % 2), slice(1, 2 * columns - 1 - nx % 2))
    np.testing.assert_allclose(seen[1, 0][inner], (3.0 * y - 2.0 * x)[inner], rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("zenith_deg", [20.0, 60.0])
@pytest.mark.parametrize(("first_m", "ratio", "tau"), [(400.0, 1.0, 4.0), (50.0, 1.3, 10.0), (60.0, 1.12, 30.0)])
def test_even_decks_on_uneven_levels_keep_their_light(
    first_m: float, ratio: float, tau: float, zenith_deg: float
) -> None:
    """What comes in goes out at the top or into the ground, also where levels are divided for their optical depth.

    Where spacing changed within cloud, up to a quarter of the light was made or lost before layers beside those that
    are divided were divided too.
    """
    levels = np.concatenate([[0.0], np.cumsum(np.minimum(first_m * ratio ** np.arange(40), 500.0))])
    levels = levels[levels < 5000.0]
    shape = np.interp(levels, [400.0, 800.0, 1200.0, 1600.0], [0.0, 1.0, 1.0, 0.0])
    extinction = np.tile((shape * tau / np.trapezoid(shape, levels))[:, None, None], (1, 48, 48))
    x = 1500.0 * (np.arange(48) - 23.5)
    scene = Scene.from_arrays(
        extinction.astype(np.float32), x, x, levels, phase=HenyeyGreenstein(0.85), surface_albedo=0.2
    )
    sun = toward(90.0, 90.0 - zenith_deg)
    lighting = Solver().solve(scene, sun, [546.0]).lit[0].lighting
    middle = (0, slice(21, 27), slice(21, 27))
    down = lighting.diffuse[middle] + lighting.direct_horizontal(0)[middle[1:]]
    assert float((lighting.up_top[middle] + 0.8 * down).mean()) == pytest.approx(sun[2], rel=1e-5)


@pytest.mark.parametrize("altitude_deg", [30.0, 3.0, 2.0, 1.0])
def test_a_low_sun_loses_no_light(altitude_deg: float) -> None:
    """What a white deck with waves takes of the beam comes out of it."""
    x, z = 200.0 * np.arange(8), 150.0 * np.arange(10)
    deck = np.zeros((10, 8, 8), np.float32)
    deck[4:7] = 0.013 * (1 + 0.4 * np.sin(np.pi * x / 800.0))
    altitude = np.radians(altitude_deg)
    sun = np.array([0.8 * np.cos(altitude), 0.6 * np.cos(altitude), np.sin(altitude)])
    scene = Scene.from_arrays(deck, x, x, z, periodic=True, phase=HenyeyGreenstein(0.85))
    fluxes = Solver().solve(scene, sun, [550.0]).fluxes()
    leaving = sum(float(fluxes[name][0]) for name in ("up_top", "down_bottom", "direct_bottom"))
    assert leaving / sun[2] == pytest.approx(1, abs=2.1e-4)


@pytest.mark.parametrize(("upper", "spacing_m"), [(29, 100.0), (31, 300.0)])
def test_white_clouds_that_fill_the_domain_do_not_run_away(upper: int, spacing_m: float) -> None:
    """Optical depth 28 from the ground on, in a period: mixed by their share of the light that each began with, sweeps
    grow without bounds."""
    x, z = spacing_m * np.arange(8), 50.0 * np.arange(32)
    deck = np.zeros((32, 8, 8), np.float32)
    deck[:upper] = 0.02 * (1 + 0.01 * np.cos(np.pi * np.arange(8) / 4))
    scene = Scene.from_arrays(deck, x, x, z, periodic=True, phase=HenyeyGreenstein(0.85))
    fluxes = Solver().solve(scene, np.array([0.5, 0.0, 0.87]), [550.0]).fluxes()
    leaving = sum(float(fluxes[name][0]) for name in ("up_top", "down_bottom", "direct_bottom"))
    assert leaving / 0.867 == pytest.approx(1, abs=0.0014)


@pytest.mark.parametrize("altitude_deg", [30.0, 60.0])
@pytest.mark.parametrize("depth", [0.0, 1.0])
def test_a_narrow_period_with_air_is_its_column(altitude_deg: float, depth: float) -> None:
    """Clear and cloudy air in columns that are all but alike, swept in a period of 1.6 km, in which level light goes
    round a hundred times: as one column without sides."""
    rng = np.random.default_rng(0)
    shape = (20, 16, 16)
    cloud = np.zeros(shape)
    cloud[8:12] = max(depth, 1e-4) / 400.0
    uneven = cloud * rng.uniform(0.99, 1.01, shape)
    scenes = (grid_scene(field, shape, air=True, periodic=True, surface_albedo=0.2) for field in (cloud, uneven))
    column, swept = (Solver().solve(scene, toward(30.0, altitude_deg), [546.0]) for scene in scenes)
    assert max(swept.lit[0].sweeps[0]) < 19
    for name, flux in column.fluxes().items():
        np.testing.assert_allclose(swept.fluxes()[name], flux, rtol=0.004, err_msg=name)


def test_a_narrow_period_without_air_is_refused() -> None:
    """Three fifths of half its height."""
    lumps = np.random.default_rng(0).uniform(0, 1e-3, (18, 8, 8))
    scene = grid_scene(lumps, lumps.shape, (100.0, 100.0, 157.0), periodic=True)
    with pytest.raises(UserError, match=r"800 m .* repeat it until it is 1374 m wide, or use solver 'reference'"):
        Solver().solve(scene, toward(250.0, 60.0), [546.0])


@pytest.mark.parametrize("asymmetry", [0.0, 0.85])
@pytest.mark.parametrize(("low_m", "high_m"), [(0.0, 0.0), (100.0, 100.0), (120.0, 180.0), (0.0, 200.0)])
def test_fog_keeps_its_light(low_m: float, high_m: float, asymmetry: float) -> None:
    """White, uneven fog on black ground in a period: what enters leaves."""
    shape = (14, 16, 16)
    rng = np.random.default_rng(1)
    fog = np.exp(1.8 * gaussian_filter(rng.standard_normal(shape), 1.2, mode=("nearest", "wrap", "wrap")))
    fog[8:] = 0
    hills = gaussian_filter(rng.standard_normal(shape[1:]), 2.0, mode="wrap")
    hills = low_m + (high_m - low_m) * (hills - hills.min()) / np.ptp(hills)
    fog *= 10 / (fog.sum(axis=0).mean() * 50.0)
    scene = grid_scene(
        fog, shape, (100.0, 100.0, 50.0), periodic=True, phase=HenyeyGreenstein(asymmetry), terrain_m=hills
    )
    sun = toward(250.0, 50.0)
    fluxes = Solver().solve(scene, sun, [546.0]).fluxes()
    total = sum(float(fluxes[name][0]) for name in ("up_top", "down_bottom", "direct_bottom"))
    assert total == pytest.approx(sun[2], rel=0.00064 if high_m == low_m else 0.0096)


def test_fog_on_a_plateau_is_fog_on_the_plain() -> None:
    """What lies below the ground changes nothing."""
    shape = (16, 20, 20)
    fog = np.zeros(shape)
    fog[:9] = 0.02 * np.exp(0.3 * np.random.default_rng(2).standard_normal(shape[1:]))
    sun, cell_m = toward(250.0, 50.0), (100.0, 100.0, 50.0)
    raised = grid_scene(fog, shape, cell_m, terrain_m=np.full(shape[1:], 100.0), phase=HenyeyGreenstein(0.0))
    plain = grid_scene(fog[2:], (14, 20, 20), cell_m, phase=HenyeyGreenstein(0.0))
    there, here = (Solver().solve(scene, sun, [546.0]).fluxes() for scene in (raised, plain))
    for name, flux in here.items():
        np.testing.assert_allclose(there[name], flux, rtol=0.0005, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("asymmetry", [0.0, 0.85])
def test_clouds_at_the_top_keep_their_light(asymmetry: float) -> None:
    """White boxes that end with the grid, without air and over black ground, in a period: what enters leaves."""
    shape = (8, 16, 16)
    cloud = np.zeros(shape)
    cloud[3:, 4:12, 4:12] = 0.24
    sun = toward(30.0, 82.0)
    scene = grid_scene(cloud, shape, (25.0, 25.0, 25.0), periodic=True, phase=HenyeyGreenstein(asymmetry))
    fluxes = Solver().solve(scene, sun, [546.0]).fluxes()
    total = sum(float(fluxes[name][0]) for name in ("up_top", "down_bottom", "direct_bottom"))
    assert total == pytest.approx(sun[2], rel=0.0014)


@pytest.mark.slow
def test_clouds_at_the_top_end_there_though_air_goes_on() -> None:
    """A deck of optical depth one in the highest levels does not fade through a tall layer of air above. Against
    Monte Carlo."""
    shape = (12, 12, 12)
    deck = np.zeros(shape)
    deck[6:] = 1 / 500.0
    scene = grid_scene(deck, shape, (400.0, 400.0, 100.0), curved=True, air=True, phase=HenyeyGreenstein(0.0))
    down = Rays(np.array([0.0, 0.0, 1500.0]), sky_directions([-90.0, -75.0], np.arange(0.0, 360.0, 90.0)))
    sun = toward(200.0, 50.0)
    fast, truth = (Solver(name, **more).solve(scene, sun, [650.0]).view(down)
                   for name, more in (("fast", {}), ("reference", {"paths": 1500})))  # fmt: skip
    mean, error = mean_by_chance(truth)
    assert error < 0.015 * mean
    assert fast.radiance.mean() == pytest.approx(mean, abs=3 * error)


@pytest.mark.slow
def test_a_small_cloud_on_the_earth_is_one_on_a_plane() -> None:
    """Cells of optical depth up to 14, without air; where they are not divided across, a fifteenth of the light from
    above is missing."""
    shape = (14, 16, 16)
    lumps = gaussian_filter(np.random.default_rng(7).standard_normal(shape), (1.5, 2.0, 2.0))
    lumps = np.clip(lumps - np.quantile(lumps, 0.65), 0, None)
    lumps[:2], lumps[9:] = 0, 0
    lumps *= 7 / (lumps.sum(axis=0).mean() * 100.0)
    across = np.random.default_rng(5).uniform(-1300.0, 1300.0, (200, 2))
    down = Rays(np.column_stack([across, np.full(200, 3000.0)]), np.tile([0.0, 0.0, -1.0], (200, 1)))
    flat, curved = (
        Solver().solve(scene, toward(200.0, 60.0), [546.0]).view(down).radiance.mean()
        for scene in (grid_scene(lumps, shape, (200.0, 200.0, 100.0), curved=curved, phase=HenyeyGreenstein(0.0))
                      for curved in (False, True))
    )  # fmt: skip
    assert curved == pytest.approx(flat, rel=0.02)
