"""Where eye rays look: the same picture however finely they step, whichever rays go together, beside what they meet."""

import numpy as np
import pytest
from tests.transport.scenes import LAT, LON, WAVELENGTH_NM, aimed_at, grid_scene, sky_directions, toward

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.march import walk
from openswim.transport.march.empty_space import STEEP_CELLS, steepness
from openswim.transport.march.march import march_rays
from openswim.transport.march.volume import FAR_M, sphere_crossings, tidy

SUN = toward(200.0, 40.0)
EYE = np.array([120.0, -80.0, 2.0])


@pytest.fixture(scope="module")
def cumulus() -> Field:
    """A smooth thick cloud in hazy air on the round Earth."""
    z, y, x = np.mgrid[0:16, 0:20, 0:20]
    cloud = 0.02 * np.exp(-((x - 10) ** 2 + (y - 9) ** 2) / 12 - (z - 9) ** 2 / 6)
    scene = grid_scene(
        np.where(cloud > 2e-4, cloud, 0).astype(np.float32), (16, 20, 20), (100.0,) * 3, curved=True, air=True
    )
    return Solver().solve(scene, SUN, [WAVELENGTH_NM])


def marched(field: Field, direction: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray, int]:
    pack = field.lit[0]
    volume = aimed_at(pack, EYE).volume
    seen = march_rays(EYE, direction, pack.sun, pack.table, pack.shells, volume, scale)
    return seen.radiance[:, 0], seen.full[:, 0], int(seen.samples.sum())


def test_steps_are_fine_enough(cumulus: Field) -> None:
    d = sky_directions([0.0, 20.0, 40.0, 60.0, 75.0, 85.0], np.arange(3.0, 360.0, 10.0))
    cumulus.view(Rays(EYE, d))  # aims the source at this eye
    coarse, fine = marched(cumulus, d, 1.0), marched(cumulus, d, 0.125)
    assert fine[2] > 4 * coarse[2]
    error = coarse[0] / fine[0] - 1
    assert abs(error.mean()) < 0.003
    assert np.sqrt(np.mean(error**2)) < 0.015


def test_rays_do_not_know_of_each_other(cumulus: Field) -> None:
    """Rays walk in turns and are sorted by direction: alone or in any order they must see the same."""
    rng = np.random.default_rng(0)
    d = sky_directions(np.linspace(0.0, 89.0, 30), np.arange(0.0, 360.0, 6.0))
    order = rng.permutation(len(d))
    together, shuffled = marched(cumulus, d, 1.0), marched(cumulus, d[order], 1.0)
    np.testing.assert_array_equal(together[0][order], shuffled[0])
    for n in (0, 700, 1500):
        alone = marched(cumulus, d[n : n + 1], 1.0)
        assert alone[0][0] == together[0][n]
        assert alone[1][0] == together[1][n]


def test_parallel_rays_do_not_know_of_each_other(cumulus: Field) -> None:
    """As a satellite sees: one direction, many origins."""
    pack = cumulus.lit[0]
    x, y = np.meshgrid(np.linspace(-700.0, 700.0, 50), np.linspace(-700.0, 700.0, 50))
    origin = np.stack([x.ravel(), y.ravel(), np.full(x.size, 5000.0)], axis=-1)
    cumulus.view(Rays(origin[:2], np.array([0.0, 0.0, -1.0])))
    down = np.array([0.0, 0.0, -1.0])
    world = (pack.sun, pack.table, pack.shells, aimed_at(pack).volume, 1.0)
    together = march_rays(origin, down, *world)
    assert np.ptp(together.full[:, 0]) > 0.5
    for n in (0, 1234, 2499):
        np.testing.assert_array_equal(march_rays(origin[n : n + 1], down, *world).radiance[0], together.radiance[n])


@pytest.mark.parametrize("below_deg", [0.02, 0.2, 2.0])
def test_grazing_rays_meet_the_airless_ground_where_geometry_says(below_deg: float) -> None:
    field = Solver().solve(Scene.clear(LAT, LON, None), np.array([0.0, 0.0, 1.0]), [WAVELENGTH_NM])
    r, height = 6_371_000.0, 3000.0
    dip = np.degrees(np.arccos(r / (r + height))) + below_deg
    frame = field.frame
    view = field.view(Rays(frame.position(LAT, LON, height), frame.direction(77.0, -dip, LAT, LON)))
    sine = np.sin(np.radians(dip))
    distance = (r + height) * sine - np.sqrt(((r + height) * sine) ** 2 - height * (2 * r + height))
    assert view.hit[0]
    assert view.distance_m[0] == pytest.approx(distance, abs=1.0)


@pytest.mark.parametrize("radius_m", [6.371e6, 1e12])
@pytest.mark.parametrize("mu", [-1.0, -0.3, -0.01, 0.2, 1.0])
def test_sphere_crossings_lie_on_the_sphere(radius_m: float, mu: float) -> None:
    height = 8000.0
    square, rise = height * (2 * radius_m + height), (radius_m + height) * mu
    for target in (500.0, 7000.0, 20_000.0):
        for s in sphere_crossings(square, rise, target, radius_m):
            if abs(s) < 1e9:
                there = square + s * (2 * rise + s)
                assert there / (2 * radius_m + target) == pytest.approx(target, abs=0.5)


def test_a_ray_that_meets_the_ground_before_the_grid_is_not_looked_up_in_it() -> None:
    """Its step ends in the grid, and is taken back to the ground outside."""
    scene = grid_scene(np.full((8, 20, 20), 1e-4), (8, 20, 20), (1000.0, 1000.0, 300.0), curved=True, air=True)
    pack = Solver("swim").solve(scene, np.array([0.0, 0.0, 1.0]), [WAVELENGTH_NM]).lit[0]
    # the box around a domain that lies askew is wider than it
    shells, volume = tidy(pack.shells), tidy(aimed_at(pack).volume._replace(sides_m=1.2 * pack.volume.sides_m))
    _, ny, nx = pack.medium.shape  # type: ignore[union-attr]
    for away in (1.0, 30.0, 300.0, 900.0):
        origin = np.array([-9500.0 - 2 * away, 0.0, 0.05 * away])
        origin[2] -= (origin[0] ** 2) / (2 * shells.radius_m)
        down = np.radians(-2.9)
        state, places = np.zeros(walk.WALK), np.zeros(walk.BATCH * walk.PLACE)
        walk.start_walk(state, origin, np.array([np.cos(down), 0.0, np.sin(down)]), -FAR_M, shells, volume)
        while state[walk.STATE] == walk.GOING:
            state[walk.COUNT] = 0
            walk.walk_on(state, places, shells, volume, 10.0, 2.0)
            level, ix, iy = places[walk.PLACE_LEVEL], places[walk.PLACE_X], places[walk.PLACE_Y]
            assert level < 0 or (0 <= ix <= nx - 1 and 0 <= iy <= ny - 1)
        assert state[walk.STATE] == walk.HIT


@pytest.mark.parametrize("seed", range(3))
def test_the_terrain_is_nowhere_steeper_than_its_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    terrain = rng.random((30, 40)) * rng.random((30, 40)) ** 6 * 500
    cell = (100.0, 60.0)
    bound = steepness(terrain, cell, False)
    j, i = rng.integers(0, 30, 4000), rng.integers(0, 40, 4000)
    # two places close together, anywhere that is no farther from the cell than it looks
    x, y = ((c + rng.uniform(-STEEP_CELLS, STEEP_CELLS + 1, c.size)).clip(0, n - 1.01) for c, n in ((i, 40), (j, 30)))
    turn = rng.uniform(0, 2 * np.pi, i.size)
    dx, dy = 1e-4 * np.cos(turn), 1e-4 * np.sin(turn)
    rise = (bilinear(terrain, x + dx, y + dy) - bilinear(terrain, x, y)) / np.hypot(dx * cell[0], dy * cell[1])
    assert (np.abs(rise) <= bound[j, i] * (1 + 1e-5) + 1e-6).all()
    assert not steepness(terrain, cell, True).any()


def test_rays_meet_the_terrain_where_they_first_come_under_it() -> None:
    """However far they jump through free sky: against looking every two metres."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[0:48, 0:48]
    terrain = 250 * np.exp(-((x - 30) ** 2 + (y - 20) ** 2) / 20) + 60 * rng.random((48, 48))
    scene = grid_scene(np.zeros((12, 48, 48)), (12, 48, 48), (100.0,) * 3, terrain_m=terrain)
    pack = Solver("swim").solve(scene, SUN, [WAVELENGTH_NM]).lit[0]
    eye = np.array([-700.0, 300.0, 180.0])
    d = sky_directions(np.linspace(70.0, 110.0, 31), np.arange(1.0, 360.0, 6.0))
    seen = march_rays(eye, d, pack.sun, pack.table, pack.shells, aimed_at(pack, eye).volume, 1.0)
    s = np.arange(2.0, 3400.0, 2.0)
    place = eye + s[:, None, None] * d
    ix, iy = place[..., 0] / 100 + 23.5, place[..., 1] / 100 + 23.5
    inside = (np.minimum(ix, iy) >= 0) & (np.maximum(ix, iy) <= 47)
    under = inside & (place[..., 2] < bilinear(terrain, ix.ravel(), iy.ravel()).reshape(ix.shape))
    met = under.any(axis=0)
    first = s[np.argmax(under, axis=0)]
    found = (seen.distance_m >= 0) & met
    assert met.sum() > 500
    assert (~met).sum() > 500
    # what rays skip of a ridge is thinner than a quarter of a cell
    assert (met & ~found).sum() < 0.005 * met.sum()
    assert np.quantile(np.abs(seen.distance_m - first)[found], 0.99) < 3.0
    assert seen.samples[~met].mean() < 25  # of 3 km, which free sky and steep ground allow
