"""Eye rays: how much they lose, where they end, and how far they see."""

import numpy as np
import pytest
from tests.transport.scenes import (
    LAT,
    LON,
    WAVELENGTH_NM,
    box,
    down_on,
    grid_scene,
    sky_directions,
    slab,
    sun_at_zenith_angle,
    toward,
)

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport import Field

CELL = 50.0
BETA = 0.004
SHAPE = (21, 24, 26)
INSIDE = (slice(6, 13), slice(8, 16), slice(7, 17))
SUN = toward(120.0, 50.0)


@pytest.fixture(scope="module")
def boxed() -> Field:
    """A homogeneous box in a vacuum, absorbing all it meets: tau across is about 1.6."""
    scene = grid_scene(box(SHAPE, INSIDE, BETA), SHAPE, (CELL,) * 3, single_scattering_albedo=0.0)
    return Solver().solve(scene, SUN, [WAVELENGTH_NM])


def box_edges() -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box with the half cell that linear interpolation adds on every side (m)."""
    _, ny, nx = SHAPE
    offset = np.array([-CELL * (nx - 1) / 2, -CELL * (ny - 1) / 2, 0.0])
    low = np.array([INSIDE[2].start, INSIDE[1].start, INSIDE[0].start]) - 0.5
    high = np.array([INSIDE[2].stop, INSIDE[1].stop, INSIDE[0].stop]) - 0.5
    return offset + CELL * low, offset + CELL * high


def path_in_box(origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Length (m) of straight rays inside the box: the slab method."""
    low, high = box_edges()
    with np.errstate(divide="ignore"):
        a, b = (low - origin) / direction, (high - origin) / direction
    enter, leave = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
    return np.maximum(0.0, leave - np.maximum(enter, 0.0))


# Rays that cross faces away from edges, where the half cell on each side is exact.
@pytest.mark.parametrize(
    "direction",
    [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.2, 0.1, 1), (1, 0.1, 0.05), (-0.1, 1, -0.05), (0.6, 0.0, 0.8)],
)
def test_beer_lambert_through_a_box(boxed: Field, direction: tuple[float, float, float]) -> None:
    d = np.array(direction) / np.linalg.norm(direction)
    middle = np.mean(box_edges(), axis=0)
    start = middle - 450.0 * d
    view = boxed.view(Rays(start[None], d[None]))
    tau = BETA * path_in_box(start, d)
    assert tau > 0.8
    # steps of a cell see the ramps of the edges by the trapezoidal rule: .02 in depth
    assert -np.log(view.transmittance[0, 0]) == pytest.approx(tau, abs=0.03)
    assert view.species_depth[0, 0] == pytest.approx(tau, abs=0.03)


def test_rays_that_miss_the_box_lose_nothing(boxed: Field) -> None:
    low, high = box_edges()
    x = [low[0] - CELL, high[0] + CELL, 2000.0, 30_000.0]
    view = boxed.view(down_on(x, [0.0, 0.0, 0.0, 10.0], 1500.0))
    # each step multiplies by an e^-0 that is good to 1e-6
    np.testing.assert_allclose(view.transmittance, 1.0, atol=1e-4)
    assert view.hit.all()


@pytest.mark.parametrize("zenith", [0.0, 40.0, 70.0])
@pytest.mark.parametrize("tau", [0.3, 2.0])
@pytest.mark.parametrize("upward", [True, False], ids=["up", "down"])
def test_beer_lambert_through_a_slab(zenith: float, tau: float, upward: bool) -> None:
    """A layer that fills the grid to its topmost level, with a sharp edge there."""
    field = Solver().solve(slab(tau, levels=21), sun_at_zenith_angle(30.0), [WAVELENGTH_NM])
    along = sun_at_zenith_angle(zenith) * (1 if upward else -1)
    view = field.view(Rays(np.array([0.0, 0.0, 0.0 if upward else 1500.0]), along))
    # a ray's sampling may not lose a fifth of a cell (of 20) at the edge
    assert -np.log(view.transmittance[0, 0]) == pytest.approx(tau / np.cos(np.radians(zenith)), rel=0.01)


@pytest.mark.parametrize("altitude", [-90.0, -45.0, -10.0, -2.0])
@pytest.mark.parametrize("azimuth", [0.0, 130.0])
def test_level_ground_is_where_it_should_be(boxed: Field, azimuth: float, altitude: float) -> None:
    height = 300.0
    view = boxed.view(Rays(np.array([900.0, -900.0, height]), toward(azimuth, altitude)))
    assert view.hit[0]
    distance = height / np.sin(np.radians(-altitude))
    assert view.distance_m[0] == pytest.approx(distance, abs=0.2)
    end = np.array([900.0, -900.0, height]) + distance * toward(azimuth, altitude)
    np.testing.assert_allclose(view.position[0], end, atol=0.2)


def test_rays_that_leave_to_space_end_nowhere(boxed: Field) -> None:
    view = boxed.view(Rays(np.array([900.0, -900.0, 300.0]), sky_directions([0.0, 60.0, 89.0], [0.0, 100.0])))
    assert not view.hit.any()
    assert np.isnan(view.position).all()
    assert (view.distance_m < 0).all()


@pytest.mark.parametrize(("azimuth", "altitude"), [(90.0, 0.0), (90.0, -20.0), (75.0, 5.0), (270.0, -30.0)])
def test_rays_end_on_a_slope(azimuth: float, altitude: float) -> None:
    """Ground rising by 20 % toward the east: the ray's distance to a plane."""
    shape, cell = (12, 21, 41), 100.0
    x = cell * (np.arange(shape[2]) - 20)
    terrain = np.broadcast_to(0.2 * (x + 2000.0), shape[1:])
    scene = grid_scene({}, shape, (cell, cell, 100.0), terrain_m=terrain)
    field = Solver().solve(scene, SUN, [WAVELENGTH_NM])
    origin, d = np.array([0.0, 0.0, 600.0]), toward(azimuth, altitude)
    distance = (0.2 * 2000.0 - 600.0) / (d[2] - 0.2 * d[0])
    view = field.view(Rays(origin[None], d[None]))
    assert view.hit[0]
    # the search for the crossing stops at 5 cm
    assert view.distance_m[0] == pytest.approx(distance, abs=0.3)


@pytest.mark.parametrize("height_m", [50.0, 3000.0, 11_000.0])
def test_horizon_dips_as_the_earth_curves(height_m: float) -> None:
    field = Solver().solve(Scene.clear(LAT, LON, None), np.array([0.0, 0.0, 1.0]), [WAVELENGTH_NM])
    dip = np.degrees(np.arccos(6_371_000.0 / (6_371_000.0 + height_m)))
    frame = field.frame
    for offset, hits in ((0.01, False), (-0.01, True)):
        azimuth = np.arange(0.0, 360.0, 2.0)
        direction = frame.direction(azimuth, np.full(azimuth.shape, -dip + offset), LAT, LON)
        assert (field.view(Rays(frame.position(LAT, LON, height_m), direction)).hit == hits).all()


@pytest.mark.parametrize("air", [False, True])
def test_views_from_space_land_below_the_satellite(air: bool) -> None:
    scene = Scene.clear(LAT, LON, "default" if air else None, terrain_m=500.0)
    field = Solver().solve(scene, np.array([0.3, 0.0, 0.95]), [WAVELENGTH_NM])
    frame = field.frame
    there = frame.position(LAT + 1.0, LON - 2.0, 700_000.0)
    straight_down = -frame.enu(LAT + 1.0, LON - 2.0)[2]
    view = field.view(Rays(there[None], straight_down[None]))
    lat, lon, height = frame.latlon(view.position[0])
    assert float(lat) == pytest.approx(LAT + 1.0, abs=1e-5)
    assert float(lon) == pytest.approx(LON - 2.0, abs=1e-5)
    assert float(height) == pytest.approx(500.0, abs=1.0)


def test_rays_past_the_limb_see_black_space() -> None:
    field = Solver().solve(Scene.clear(LAT, LON), np.array([0.3, 0.0, 0.95]), [WAVELENGTH_NM])
    frame = field.frame
    eye = frame.position(LAT, LON, 700_000.0)
    r = 6_371_000.0
    for tangent_m, black in ((110_000.0, True), (20_000.0, False)):
        dip = np.degrees(np.arccos((r + tangent_m) / (r + 700_000.0)))
        view = field.view(Rays(eye, frame.direction(40.0, -dip, LAT, LON)))
        assert not view.hit[0]
        assert (view.radiance[0, 0] == 0.0) == black
        assert (view.transmittance[0, 0] == 1.0) == black


def test_rays_from_far_away_see_the_air_from_its_top_on() -> None:
    """Where a ray meets the top of the air is known to a micrometre or so; on which side of it must not matter."""
    scene = Scene.clear(10.0, 20.0, terrain_m=2.0)  # whose shells end above the atmosphere of the tables
    field = Solver().solve(scene, np.array([0.0, 0.0, 1.0]), [WAVELENGTH_NM])
    angle = np.linspace(0, 0.8, 400)
    radius = 6.371e6
    place = radius * np.stack([np.sin(angle), 0 * angle, np.cos(angle) - 1], axis=-1)
    eye = np.array([0.0, 0.0, 1.5e9])
    along = (place - eye) / np.linalg.norm(place - eye, axis=1, keepdims=True)
    radiance = field.view(Rays(eye, along)).radiance[:, 0]
    assert np.abs(np.diff(radiance) / radiance[1:]).max() < 0.02


def test_a_thin_top_below_tall_clear_air_is_not_stepped_over():
    """A deck's uppermost cells of 100 m below one of 1400 m: from wherever above, the same; steps that ended a quarter
    of the clear cell within the cloud made rings of 9 % around the eye."""
    x, z = 300.0 * np.arange(8), np.array([0.0, 1000, 1100, 1200, 1300, 1400, 1500, 1600, 3000])
    deck = np.zeros((9, 8, 8), np.float32)
    deck[2:7] = 0.02 * (1 + 0.01 * np.cos(np.pi * x / 1200.0))
    scene = Scene.from_arrays(deck, x, x, z, periodic=True, phase=HenyeyGreenstein(0.85))
    field = Solver().solve(scene, np.array([0.5, 0.0, 0.87]), [550.0])
    heights = np.array([1650.0, 1700, 1900, 2000, 2150, 2300, 2500, 2700, 2900, 3500])
    eyes = np.stack([np.full(10, 400.0), np.full(10, 500.0), heights], axis=-1)
    seen = field.view(Rays(eyes, np.array([0.0, 0.0, -1.0]))).radiance[:, 0]
    np.testing.assert_allclose(seen, seen.mean(), rtol=0.005)
