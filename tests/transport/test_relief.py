"""Rays meet the ground: height fields against brute force, spheres and geometry."""

from dataclasses import replace

import numpy as np
import pytest

from openswim import Camera, Solver, open_scene
from openswim.scene.procedural import demo_scene
from openswim.transport.ground_light.relief import HeightField, Relief, first_root
from openswim.transport.march.volume import FAR_M

RADIUS = 6_371_000.0


def relief(ground_m: float, *fields: HeightField) -> Relief:
    return Relief(RADIUS, ground_m, fields, np.eye(3))


def field(height: np.ndarray, step: float) -> HeightField:
    """Heights (ny, nx) around the origin."""
    ny, nx = height.shape
    return HeightField((-0.5 * (nx - 1) * step, -0.5 * (ny - 1) * step), step, height.astype(np.float32))


def flat(height: float, n: int, step: float) -> HeightField:
    return field(np.full((n, n), height), step)


def hills(n: int = 129, step: float = 100.0, seed: int = 0) -> HeightField:
    """Smooth random hills on n x n nodes."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:n, 0:n] / n
    height = np.full((n, n), 500.0)
    for _ in range(30):
        kx, ky, phase = rng.uniform(-9, 9), rng.uniform(-9, 9), rng.uniform(0, 6.28)
        height += 50.0 * np.sin(2 * np.pi * (kx * x + ky * y) + phase)
    return field(height, step)


def above_sea(place: np.ndarray) -> np.ndarray:
    return np.linalg.norm(place + np.array([0.0, 0.0, RADIUS]), axis=-1) - RADIUS


def brute_force(ground: Relief, origin: np.ndarray, direction: np.ndarray, reach: float, step: float) -> np.ndarray:
    """First of many small steps below ground."""
    t = np.arange(0.0, reach, step)
    out = np.full(len(direction), FAR_M)
    for n, d in enumerate(direction):
        place = origin[n] + t[:, None] * d
        below = above_sea(place) < ground.height(place)
        if below.any():
            out[n] = t[below.argmax()]
    return out


def looks(count: int, low_deg: float, high_deg: float, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    azimuth, altitude = rng.uniform(0, 2 * np.pi, count), np.radians(rng.uniform(low_deg, high_deg, count))
    return np.stack([np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth), np.sin(altitude)], -1)


@pytest.mark.parametrize("height", [750.0, 1500.0, 4000.0, 3e4])
def test_rays_end_where_small_steps_find_the_ground(height: float) -> None:
    ground = relief(450.0, hills())
    direction = looks(400, -89 if height > 1e4 else -60, 3)
    eye = np.array([200.0, -300.0, max(height, ground.height(np.array([[200.0, -300.0, 0.0]]))[0] + 2)])
    origin = np.tile(eye, (400, 1))
    found, expected = ground.meet(origin, direction), brute_force(ground, origin, direction, 45e3, 5.0)
    place = origin + np.minimum(expected, 1e5)[:, None] * direction
    inside = (expected < FAR_M) & (np.abs(place[:, :2]).max(axis=1) < 6300.0)
    assert inside.sum() > 5
    np.testing.assert_allclose(found[inside], expected[inside], atol=5.1)
    up = (expected == FAR_M) & (direction[:, 2] > 0)
    assert up.any()
    assert (found[up] >= 30e3).all()


def test_the_ground_lies_under_the_place_found() -> None:
    ground = relief(450.0, hills(seed=5))
    direction = looks(2000, -89, -2, 3)
    origin = np.tile([0.0, 0.0, 2500.0], (2000, 1))
    distance = ground.meet(origin, direction)
    assert (distance < FAR_M).all()
    place = origin + distance[:, None] * direction
    inside = np.abs(place[:, :2]).max(axis=1) < 6300
    np.testing.assert_allclose(above_sea(place[inside]), ground.height(place[inside]), atol=0.01)


@pytest.mark.parametrize("height", [702.0, 9000.0, 9e4])
def test_a_flat_field_is_the_sphere(height: float) -> None:
    """A field of one height is that sphere, edge and all: distance and dip of the horizon, cos = (R + g)/(R + h)."""
    ground = relief(700.0, flat(700.0, 301, 1000.0))
    direction = looks(500, -89.9, 2, 7)
    origin = np.tile([1000.0, 2000.0, height], (500, 1))
    eye = above_sea(origin[:1])[0]
    sine = (direction * (origin + np.array([0.0, 0.0, RADIUS]))).sum(-1) / (RADIUS + eye)
    root = (RADIUS + eye) ** 2 * sine**2 - (eye - 700.0) * (2 * RADIUS + eye + 700.0)
    expected = np.where((root > 0) & (sine < 0), -sine * (RADIUS + eye) - np.sqrt(np.maximum(root, 0)), FAR_M)
    found = ground.meet(origin, direction)
    clear = np.abs(root) > 1e5  # grazing rays are found or not by a centimetre
    np.testing.assert_array_equal((found == FAR_M)[clear], (expected == FAR_M)[clear])
    seen = (expected < FAR_M) & clear
    # the plane's bilinear heights are right to centimetres; grazing rays find them far apart
    assert (np.abs(found - expected)[seen] * -sine[seen] < 1.0).all()


def test_horizon_over_a_cone() -> None:
    """4000 m, 150 km away, seen from 10 m: its top stands (4000 - 10)/150 km - 150 km/2R above the level."""
    y, x = np.mgrid[-200:201, -200:201] * 1000.0
    ground = relief(0.0, field(np.maximum(4000.0 - 0.4 * np.hypot(x - 150e3, y), 0.0), 1000.0))
    angle = np.radians(np.arange(0.02, 2.0, 0.002))
    direction = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=-1)
    hit = ground.meet(np.tile([0.0, 0.0, 10.0], (angle.size, 1)), direction) < FAR_M
    seen = np.degrees(angle[hit].max())
    # exact: the angle at the eye in the triangle with the Earth's centre
    turn = 150e3 / RADIUS
    top = np.array([(RADIUS + 4000.0) * np.sin(turn), (RADIUS + 4000.0) * np.cos(turn)])
    on_plane = np.degrees(np.arctan2(top[1] - RADIUS - 10.0, top[0]))
    assert on_plane == pytest.approx(np.degrees(3990.0 / 150e3 - 150e3 / (2 * RADIUS)), abs=0.0012)
    assert seen == pytest.approx(on_plane, abs=0.00085)
    assert hit[: int(hit.sum())].all()


def test_a_sharp_ridge_is_seen_to_a_metre() -> None:
    """A knife edge along the nodes, 20 km away: no ray slips through, whatever its azimuth."""
    x = np.arange(-1000, 1001) * 30.0
    ridge = np.broadcast_to(np.maximum(1000.0 - 1.2 * np.abs(x - 19_980.0), 0.0), (301, x.size))
    ground = relief(0.0, field(ridge, 30.0))
    azimuth = np.linspace(-0.2, 0.2, 201)
    far = 19_980.0 / np.cos(azimuth)
    drop = 19_980.0**2 / (2 * RADIUS)  # the crest is a straight line over the plane but for the metres along it
    for above, expected in ((2.0, 0), (-2.0, 201)):
        rise = (1000.0 + above - 500.0 - drop - (far**2 - 19_980.0**2) / (2 * RADIUS)) / far
        angle = np.arctan(rise)
        direction = np.stack([np.cos(angle) * np.cos(azimuth), np.cos(angle) * np.sin(azimuth), np.sin(angle)], -1)
        assert (ground.meet(np.tile([0.0, 0.0, 500.0], (201, 1)), direction) < 25e3).sum() == expected


def test_a_finer_field_takes_the_place_of_a_coarse_one() -> None:
    ground = relief(0.0, flat(300.0, 121, 100.0), flat(100.0, 41, 1000.0))
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    distance = ground.meet(np.array([[0.0, 0.0, 2000.0], [10e3, 0.0, 2000.0]]), down)
    np.testing.assert_allclose(distance, [1700.0, 1907.8], atol=0.061)  # 10 km away the sphere has fallen by 7.8 m


def test_a_peak_that_only_the_finer_field_has_is_not_leapt_over() -> None:
    n = 201
    peak = np.zeros((n, n))
    peak[n // 2, n // 2] = 800.0
    ground = relief(0.0, field(peak, 50.0), flat(0.0, 201, 1000.0))
    for distance in (20e3, 40e3, 80e3):
        eye = np.array([[-distance, 0.0, 700.0 - distance**2 / (2 * RADIUS)]])
        level = np.array([[1.0, 0.0, 0.0]])
        assert ground.meet(eye, level)[0] == pytest.approx(distance, abs=60.0)


def test_a_wall_beyond_the_side_of_a_finer_field_is_not_leapt_over() -> None:
    x = np.arange(-60, 61) * 1000.0
    wall = np.broadcast_to(np.where(x == 26e3, 900.0, 0.0), (121, 121))
    ground = relief(0.0, flat(0.0, 501, 100.0), field(wall, 1000.0))
    for start in np.linspace(-20e3, 20e3, 41):
        eye = np.array([[start, 0.0, 600.0]])
        assert ground.meet(eye, np.array([[1.0, 0.0, 0.0]]))[0] == pytest.approx(26e3 - start, abs=500.0)


def test_turned_axes_turn_nothing_else() -> None:
    """A relief is where it is, whatever the frame that holds eye and rays."""
    own = hills()
    turn = np.array([[0.6, 0.0, -0.8], [0.0, 1.0, 0.0], [0.8, 0.0, 0.6]])
    centre = np.array([0.0, 0.0, RADIUS])
    direction, eye = looks(200, -60, 10), np.array([200.0, -300.0, 1500.0])
    here = Relief(RADIUS, 450.0, (own,), np.eye(3)).meet(eye[None], direction)
    there = Relief(RADIUS, 450.0, (own,), turn).meet((eye + centre)[None] @ turn - centre, direction @ turn)
    np.testing.assert_allclose(there, here, rtol=1e-6, atol=0.01)


def test_shadow_of_a_wall_is_as_long_as_its_height_over_the_tangent() -> None:
    """From -x the sun, 20 degrees high: the shadow of 100 m reaches 100/tan 20 = 275 m; half of the disc at its end."""
    n, step = 401, 5.0
    wall = np.zeros((n, n))
    wall[:, n // 2] = 100.0
    ground = relief(0.0, field(wall, step))
    sun = np.array([-np.cos(np.radians(20.0)), 0.0, np.sin(np.radians(20.0))])
    x = np.linspace(10.0, 400.0, 1561)
    lit = ground.lit(np.stack([x, 0 * x + 3.0, 0 * x], axis=-1), sun)
    assert (np.diff(lit) >= 0).all()
    assert np.interp(0.5, lit, x) == pytest.approx(100.0 / np.tan(np.radians(20.0)), abs=0.33)
    penumbra = x[(lit > 0) & (lit < 1)]
    # 3/4 of the disc lie between the outermost of the four rays
    assert np.ptp(penumbra) == pytest.approx(0.75 * 0.0093 * 100.0 / np.sin(np.radians(20.0)) ** 2, rel=0.046)


def test_normals_of_a_slope() -> None:
    x = np.arange(-50, 51) * 100.0
    ground = relief(0.0, field(np.broadcast_to(2000.0 + 0.3 * x, (101, 101)), 100.0))
    place = np.array([[0.0, 0.0, 2000.0]])
    for footprint in (0.0, 1000.0):
        normal = ground.normals(place, np.array([[0.0, 0.0, 1.0]]), np.array([footprint]))
        np.testing.assert_allclose(normal[0], np.array([-0.3, 0.0, 1.0]) / np.sqrt(1.09), atol=0.00011)


def test_roots_of_parabolas() -> None:
    """The first of the roots from 0 to 1, or 2."""
    rng = np.random.default_rng(0)
    for _ in range(500):
        a, b, c = rng.normal(size=3)
        begin, middle, end = c, a / 4 + b / 2 + c, a + b + c
        roots = np.roots([a, b, c])
        inside = np.sort(roots[np.isreal(roots)].real)
        inside = inside[(inside >= 0) & (inside <= 1)]
        expected = 0.0 if c <= 0 else inside[0] if inside.size else 2.0
        assert first_root(begin, middle, end) == pytest.approx(expected, abs=1e-6)


def test_a_panorama_pays_for_no_finer_land_than_its_horizon_shows(tmp_path) -> None:
    """Its pixels at the nadir are a tenth as wide: by them the land around had ten times the nodes."""
    demo_scene(48, 48, 20).to_netcdf(tmp_path / "scene.nc")  # of files the Earth around is known
    scene = open_scene(tmp_path / "scene.nc")
    field = Solver(quality="preview").solve(scene, np.array([0.3, -0.4, 0.8]), [550.0])
    camera = Camera.panorama(47.7, 11.2, size=(360, 720))
    rays = camera.rays(field.frame, 580.0, camera.pixels())
    land = field.landscape
    assert land is not None
    relief, fine = land.seen_from(rays), land.seen_from(replace(rays, width_rad=np.full(len(rays), 1 / 1024)))
    assert relief is not None
    assert fine is not None
    nodes, finest = (sum(one.height_m.size for one in each.fields) for each in (relief, fine))
    assert nodes < 1.6e6 < 1.4e7 < finest
    some = rays.directions()[::61]
    met = np.array([each.meet(rays.origins()[:1], some) for each in (relief, fine)])
    both = (met < FAR_M).all(axis=0)
    np.testing.assert_array_equal(both, (met < FAR_M).any(axis=0))
    assert np.abs(met[0] / met[1] - 1)[both].max() < 4.7e-5
