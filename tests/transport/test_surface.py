"""The lit ground: shadows of ridges, slopes, albedo, and light that goes to and fro."""

from dataclasses import replace

import numpy as np
import pytest
from pyproj import CRS
from scipy.ndimage import gaussian_filter
from tests.transport.scenes import (
    LAT,
    LON,
    WAVELENGTH_NM,
    box,
    changed,
    down_on,
    grid_scene,
    mean_by_chance,
    slab,
    sun_at_zenith_angle,
    toward,
)

from openswim.cameras import Rays
from openswim.ground.model import ModelGround
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.view.shading import _PART, _steepness

ALTITUDE = 30.0
RIDGE_M, CELL, DARK = 500.0, 50.0, 0.01


def ground(field: Field, x_m, y_m, height_m: float = 3000.0) -> np.ndarray:
    """L' of the ground seen from straight above."""
    return field.view(down_on(x_m, y_m, height_m)).radiance[:, 0]


@pytest.fixture(scope="module", params=[90.0, 270.0, 0.0], ids=["sun east", "sun west", "sun north"])
def ridge(request) -> tuple[Field, float]:
    """A wall 500 m high and two cells thick across the sun, dark ground that lights no other, no air."""
    azimuth = request.param
    n = 81
    terrain = np.zeros((n, n))
    middle = slice(n // 2 - 1, n // 2 + 2)
    if azimuth == 0.0:
        terrain[middle] = RIDGE_M
    else:
        terrain[:, middle] = RIDGE_M
    scene = grid_scene({}, (13, n, n), (CELL,) * 3, terrain_m=terrain, surface_albedo=DARK)
    return Solver().solve(scene, toward(azimuth, ALTITUDE), [WAVELENGTH_NM]), azimuth


def test_a_ridge_shades_its_far_side(ridge) -> None:
    field, azimuth = ridge
    away = -toward(azimuth, 0.0)
    sunny = 4 * DARK * np.sin(np.radians(ALTITUDE))  # L' of level ground (Eq. 2): 4 A mu0
    length = RIDGE_M / np.tan(np.radians(ALTITUDE))  # 866 m, from the ridge's edge one cell off the middle
    behind = np.array([150.0, 400.0, 700.0])[:, None] * away
    # penumbra and the terrain's nodes blur the end by about a cell
    beyond = (CELL + length + np.array([100.0, 300.0]))[:, None] * away
    before = np.array([150.0, 400.0, 1200.0])[:, None] * -away
    assert ground(field, *behind.T[:2]).max() < 0.02 * sunny
    np.testing.assert_allclose(ground(field, *beyond.T[:2]), sunny, rtol=1e-4)
    np.testing.assert_allclose(ground(field, *before.T[:2]), sunny, rtol=0.0072)


def test_the_shadow_ends_where_the_sun_looks_over_the_ridge(ridge) -> None:
    field, azimuth = ridge
    way = np.arange(300.0, 1500.0, 5.0)
    seen = ground(field, *(way[:, None] * -toward(azimuth, 0.0)).T[:2])
    half = way[np.argmax(seen > 2 * DARK * np.sin(np.radians(ALTITUDE)))]
    expected = CELL + RIDGE_M / np.tan(np.radians(ALTITUDE))
    assert half == pytest.approx(expected, abs=1.5 * CELL)


@pytest.mark.parametrize("albedo", [0.3, 1.0])
def test_a_sunny_wall_lights_the_ground_before_it(albedo: float) -> None:
    """As bright as with Monte Carlo within an eighth, where without the wall's light up to a half was missing; in its
    shadow next to nothing."""
    terrain = np.zeros((81, 81))
    terrain[:, 39:42] = RIDGE_M
    scene = grid_scene({}, (13, 81, 81), (CELL,) * 3, terrain_m=terrain, surface_albedo=albedo)
    x_m = np.array([150.0, 200.0, 300.0, 400.0, -150.0, -400.0, -700.0])
    found, truth = (ground(Solver(name, **more).solve(scene, toward(90.0, ALTITUDE), [WAVELENGTH_NM]), x_m, 0 * x_m)
                    for name, more in (("fast", {}), ("reference", {"paths": 4000})))  # fmt: skip
    np.testing.assert_allclose(found[:4], truth[:4], rtol=0.125)
    np.testing.assert_allclose(found[4:], truth[4:], atol=0.018 * truth[0])


@pytest.mark.parametrize(("azimuth", "altitude"), [(90.0, 40.0), (270.0, 40.0), (0.0, 40.0), (250.0, 60.0)])
def test_slopes_are_lit_by_the_cosine_of_their_normal(azimuth: float, altitude: float) -> None:
    shape = (12, 21, 31)
    terrain = np.broadcast_to(20.0 * np.arange(31), shape[1:])  # rising by 20 % toward the east
    scene = grid_scene({}, shape, (100.0,) * 3, terrain_m=terrain, surface_albedo=0.5)
    sun = toward(azimuth, altitude)
    field = Solver().solve(scene, sun, [WAVELENGTH_NM])
    normal = np.array([-0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
    np.testing.assert_allclose(ground(field, [-500.0, 0.0, 500.0], 30.0), 2.0 * normal @ sun, rtol=0.0071)


@pytest.mark.parametrize("zenith", [0.0, 60.0, 80.0])
def test_white_ground_under_no_air(zenith: float) -> None:
    """L' = 4 a mu0 (Albers et al. 2020, Eqs 2 and 35), in the grid and around it."""
    scene = grid_scene({}, (5, 6, 7), surface_albedo=0.4)
    field = Solver().solve(scene, sun_at_zenith_angle(zenith), [WAVELENGTH_NM])
    expected = 4 * 0.4 * np.cos(np.radians(zenith))
    np.testing.assert_allclose(ground(field, [0.0, 120.0, 5000.0], [0.0, -80.0, 0.0]), expected, rtol=1e-4)


def test_albedo_is_seen_where_it_is() -> None:
    albedo = np.zeros((9, 11), np.float32)
    albedo[2, 7] = 1.0
    field = Solver().solve(grid_scene({}, (5, 9, 11), surface_albedo=albedo), sun_at_zenith_angle(20.0), [546.0])
    x, y = np.meshgrid(100.0 * (np.arange(11) - 5), 100.0 * (np.arange(9) - 4))
    seen = ground(field, x, y).reshape(9, 11)
    assert np.unravel_index(seen.argmax(), seen.shape) == (2, 7)
    assert seen[2, 7] == pytest.approx(4 * np.cos(np.radians(20.0)), rel=1e-4)
    assert seen[5:].max() == 0.0


def test_shadow_of_a_cloud_lies_opposite_the_sun() -> None:
    shape, cell = (16, 31, 31), 100.0
    cloud = box(shape, (slice(9, 12), slice(13, 18), slice(13, 18)), 0.03)
    scene = grid_scene(cloud, shape, (cell,) * 3, surface_albedo=0.2, single_scattering_albedo=0.5)
    for azimuth in (90.0, 180.0, 315.0):
        sun = toward(azimuth, 55.0)
        field = Solver().solve(scene, sun, [WAVELENGTH_NM])
        x, y = np.meshgrid(*2 * [cell * (np.arange(31) - 15)])
        # from under the cloud, so that the cloud itself is not in the way
        dark = 4 * 0.2 * sun[2] - ground(field, x, y, 700.0).reshape(31, 31)
        dark = np.maximum(dark - 0.3 * dark.max(), 0)
        centre = np.array([(x * dark).sum(), (y * dark).sum()]) / dark.sum()
        np.testing.assert_allclose(centre, -1000.0 / sun[2] * sun[:2], atol=0.5 * cell)


def test_ground_under_air_reflects_what_reaches_it() -> None:
    albedo = 0.3
    field = Solver().solve(
        Scene.clear(LAT, LON, surface_albedo=albedo), sun_at_zenith_angle(45.0), [615.0, 546.0, 450.0]
    )
    seen = field.view(Rays(np.array([[0.0, 0.0, 2.0]]), np.array([[0.0, 0.0, -1.0]]))).radiance[0]
    fluxes = field.fluxes()
    expected = 4 * albedo * (fluxes["down_bottom"] + fluxes["direct_bottom"])
    np.testing.assert_allclose(seen, expected, rtol=1e-4)  # two metres of air
    np.testing.assert_allclose(fluxes["up_bottom"], expected / 4, rtol=1e-5)


@pytest.mark.parametrize("tau", [1.0, 10.0])
def test_white_ground_under_a_white_cloud_gives_all_light_back(tau: float) -> None:
    """Nothing absorbs: what enters leaves through the top, after any number of reflections."""
    field = Solver().solve(slab(tau, albedo=1.0), sun_at_zenith_angle(60.0), [WAVELENGTH_NM])
    assert field.fluxes()["up_top"][0] == pytest.approx(0.5, rel=0.00051)


def test_a_brighter_ground_brightens_the_sky() -> None:
    fluxes = [
        Solver().solve(slab(5.0, albedo=a), sun_at_zenith_angle(40.0), [WAVELENGTH_NM]).fluxes() for a in (0, 0.8)
    ]
    dark, bright = (f["down_bottom"][0] + f["direct_bottom"][0] for f in fluxes)
    # multiple reflection: E = E_0/(1 - a R), R the cloud's reflectance from below, found by its own light
    reflectance = (bright - dark) / (0.8 * bright)
    # a conservative cloud with tau (1 - g) = .75: spherical albedo .75 x .75/(1 + .75 x .75) = .36
    assert reflectance == pytest.approx(0.36, abs=0.034)


def test_land_has_patches_below_its_map_for_the_eye_alone() -> None:
    """Seen from near: woods and fields, of the map's albedo in the mean; to rays of no width, and where it is not
    wanted, the map itself."""
    scene = grid_scene({}, (5, 9, 9), (20e3, 20e3, 500.0), curved=True)
    france = replace(scene.grid, crs=CRS.from_proj4("+proj=lcc +lat_1=30 +lat_2=50 +lat_0=47 +lon_0=2 +R=6371000"))
    scene = replace(scene, grid=france, data=scene.data.drop_vars("surface_albedo"))
    field = Solver().solve(scene, sun_at_zenith_angle(30.0), [WAVELENGTH_NM])
    x, y = (c.ravel() for c in np.meshgrid(*2 * [np.linspace(-60e3, 60e3, 60)]))
    rays = down_on(x, y, 1000.0)
    bare = field.view(rays).radiance[:, 0]
    rays = Rays(rays.origin_m, rays.direction, 1e-3)
    seen = field.view(rays).radiance[:, 0]
    assert np.abs(seen / bare - 1).mean() > 0.15
    assert seen.mean() == pytest.approx(bare.mean(), rel=0.0060)
    far = field.view(Rays(rays.origin_m, rays.direction, 10.0)).radiance[:, 0]
    assert np.abs(far / bare - 1).mean() < 0.05  # the map itself is averaged over 10 km
    without = changed(field, options=Solver(detail=False))
    np.testing.assert_allclose(without.view(rays).radiance[:, 0], bare, rtol=1e-5)


def test_mountains_have_slopes_below_the_grid() -> None:
    """Between hills of some cells, a low sun from either side lights other slopes, with as much light in all."""
    n = 33
    x, y = np.meshgrid(np.arange(n), np.arange(n))
    terrain = 1000.0 + 300.0 * (np.sin(x) + np.cos(0.8 * y))
    scene = grid_scene({}, (7, n, n), (3000.0, 3000.0, 500.0), curved=True, terrain_m=terrain)
    france = replace(scene.grid, crs=CRS.from_proj4("+proj=lcc +lat_1=30 +lat_2=50 +lat_0=47 +lon_0=2 +R=6371000"))
    scene = replace(scene, grid=france, data=scene.data.drop_vars("surface_albedo"))
    places = (c.ravel() for c in np.meshgrid(*2 * [np.linspace(-40e3, 40e3, 90)]))
    rays = down_on(*places, 6000.0)
    rays = Rays(rays.origin_m, rays.direction, 0.005)
    changes = []
    for azimuth in (120.0, 300.0):
        field = Solver(quality="preview").solve(scene, toward(azimuth, 30.0), [WAVELENGTH_NM])
        seen = field.view(rays).radiance[:, 0]
        plain = changed(field, options=Solver(detail=False)).view(rays).radiance[:, 0]
        assert seen.mean() == pytest.approx(plain.mean(), rel=0.011)
        changes.append(np.log(np.maximum(seen, 0.02) / np.maximum(plain, 0.02)))
    # woods and fields change alike, and cancel
    assert np.abs(changes[0] - changes[1]).mean() > 0.2


def test_slopes_of_a_domain_do_not_reach_far_beyond_it() -> None:
    """Plains beyond mountains are plains: what stands there is not known."""
    n = 17
    terrain = 1000.0 + 300.0 * np.sin(np.arange(n))[:, None] * np.ones(n)
    scene = grid_scene({}, (5, n, n), (3000.0, 3000.0, 700.0), curved=True, terrain_m=terrain)
    field = Solver(quality="preview").solve(scene, toward(120.0, 30.0), [WAVELENGTH_NM]).lit[0]
    fineness = field.medium.fineness
    steep = _steepness(field.lighting, field.medium, fineness * np.array([8.0, 16.0, 26.0, 116.0]), np.full(4, 8.0))
    assert steep[0] > 0.1
    assert steep[1] > steep[2] > 0.3 * steep[1]
    assert steep[3] < 1e-3


def test_what_a_model_says_of_the_ground_is_worked_out_once(monkeypatch) -> None:
    calls = []
    of = ModelGround.of
    monkeypatch.setattr(ModelGround, "of", lambda *given: calls.append(1) or of(*given))
    field = Solver().solve(grid_scene({}, (3, 5, 5), curved=True, surface_albedo=0.2), toward(90.0, 40.0), [550.0])
    solved = len(calls)
    for _ in range(2):
        ground(field, np.linspace(-500.0, 500.0, 3 * _PART), np.zeros(3 * _PART))
    assert len(calls) == solved == 1


def test_the_shaded_side_of_a_snowy_peak_is_lit_by_the_plain() -> None:
    """A cone of 1500 m, no air: against Monte Carlo, nothing at first; the sunny side a little by the plain, too."""
    x = 100.0 * (np.arange(81) - 40)
    terrain = np.clip(1500 * (1 - np.hypot(x, x[:, None]) / 2000), 0, None)
    scene = grid_scene({}, (17, 81, 81), (100.0,) * 3, terrain_m=terrain, surface_albedo=0.8)
    x_m = np.array([-1500.0, -1200.0, -900.0, -600.0, 300.0, 900.0, 1500.0])
    found, truth = (ground(Solver(name, **more).solve(scene, toward(90.0, 24.0), [WAVELENGTH_NM]), x_m, 0 * x_m)
                    for name, more in (("fast", {}), ("reference", {"paths": 4000})))  # fmt: skip
    np.testing.assert_allclose(found[:4], truth[:4], rtol=0.35)
    np.testing.assert_allclose(found[4:], truth[4:], rtol=0.024)


def test_white_hills_keep_their_light() -> None:
    """Steep ones in a period, under thin cloud: what enters leaves."""
    shape = (20, 32, 32)
    hills = gaussian_filter(np.random.default_rng(1).standard_normal(shape[1:]), 2.5, mode="wrap")
    hills = 600 * (hills - hills.min()) / np.ptp(hills)
    cloud = np.zeros(shape)
    cloud[14:18] = 0.002
    scene = grid_scene(cloud, shape, (100.0, 100.0, 50.0), periodic=True, surface_albedo=1.0, terrain_m=hills)
    sun = toward(250.0, 40.0)
    field = Solver().solve(scene, sun, [WAVELENGTH_NM])
    lighting = field.lit[0].lighting
    assert lighting.diffuse_on_slopes().max() > 1.1 * lighting.diffuse.max()  # they light each other
    assert field.fluxes()["up_top"][0] == pytest.approx(sun[2], rel=0.003)


def test_ground_of_a_period_does_not_know_where_it_begins() -> None:
    """Shadows, slopes and albedo repeat without a seam: rolled by some columns, all is seen as far away."""
    shape, by = (12, 8, 8), 3
    rng = np.random.default_rng(4)
    cloud, hills, albedo = np.zeros(shape), 60 * rng.random(shape[1:]), rng.uniform(0.1, 0.4, shape[1:])
    cloud[6:9, 2:6, 5:8] = 0.02
    x, y = rng.uniform(0, 800, (2, 400))
    seen = []
    for n in (0, by):
        rolled = {"surface_albedo": np.roll(albedo, n, 1), "terrain_m": np.roll(hills, n, 1)}
        scene = grid_scene(np.roll(cloud, n, 2), shape, periodic=True, **rolled)
        field = Solver().solve(scene, toward(230.0, 45.0), [WAVELENGTH_NM])
        seen.append(ground(field, x + 100.0 * n, y, 500.0))
    np.testing.assert_allclose(seen[1], seen[0], rtol=3e-3, atol=2e-4)


@pytest.mark.parametrize("albedo", [0.1, 0.6])
def test_valleys_under_an_overcast_see_little_of_it(albedo: float) -> None:
    """Valleys a kilometre deep with slopes of up to 45 degrees, against Monte Carlo, from below the clouds: as if
    level, they were a fifth too bright (dark ground), a twelfth (bright)."""
    shape = (36, 40, 40)
    x = np.broadcast_to(200.0 * (np.arange(40) - 19.5), (40, 40))
    inland = np.clip((3400 - np.maximum(abs(x), abs(x.T))) / 800, 0, 1)
    valleys = 500 * (1 - np.cos(2 * np.pi * x / 3200)) * inland
    deck = np.zeros(shape)
    deck[28:34] = 10 / 600.0
    scene = grid_scene(deck, shape, (200.0, 200.0, 100.0), curved=True, surface_albedo=albedo, terrain_m=valleys)
    across = np.random.default_rng(1).uniform(-2400.0, 2400.0, (300, 2))
    down = Rays(np.column_stack([across, np.full(300, 1500.0)]), np.tile([0.0, 0.0, -1.0], (300, 1)))
    fast, truth = (Solver(name, **more).solve(scene, toward(0.0, 50.0), [WAVELENGTH_NM]).view(down)
                   for name, more in (("fast", {}), ("reference", {"paths": 600})))  # fmt: skip
    mean, error = mean_by_chance(truth)
    assert error < 0.012 * mean
    assert fast.radiance.mean() == pytest.approx(mean, rel=0.043)  # 3 (dark) and 3.3 % too bright, by 3000 paths
