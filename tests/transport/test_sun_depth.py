"""Optical depth to the sun, node by node, against geometry."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates
from tests.transport.scenes import WAVELENGTH_NM, box, down_on, grid_scene, toward

from openswim.cameras import Rays
from openswim.solver import Solver
from openswim.transport.beam.sun_sweep import inside, sun_sweep, weighted

FLAT_M = 1e12


def depth_to_sun(
    extinction: np.ndarray,
    sun: np.ndarray,
    cell_m: tuple[float, float, float],
    periodic: bool,
    exact: bool,
    radius_m: float = FLAT_M,
) -> np.ndarray:
    """sun_sweep on evenly spaced levels (nz, ny, nx)."""
    nz, ny, nx = extinction.shape
    levels = cell_m[2] * np.arange(nz)
    lookup = np.linspace(0.0, nz - 1.0, 8 * (nz - 1) + 1)
    fields = weighted(extinction[None], np.array([[1.0], [0.5]]), periodic)
    depth = sun_sweep(
        fields, np.full((nz, ny, nx), exact), np.broadcast_to(sun, (ny, nx, 3)).copy(), levels,
        (0.0, 8.0 / cell_m[2], lookup), np.array(cell_m[:2]), radius_m, periodic,
    )  # fmt: skip
    one, half = inside(depth)
    np.testing.assert_allclose(half, 0.5 * one, rtol=1e-6)
    return np.ascontiguousarray(one)


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(("azimuth", "altitude"), [(0, 90), (90, 60), (200, 30), (45, 45), (301, 10), (180, 3)])
def test_depth_under_a_slab_is_exact(azimuth: float, altitude: float, exact: bool) -> None:
    """beta (z_top - z)/mu0, whatever the sun, for nodes that march and nodes that interpolate."""
    nz, beta = 11, 0.002
    depth = depth_to_sun(
        np.full((nz, 5, 6), beta), toward(azimuth, altitude), (50.0, 70.0, 100.0), True, exact
    )
    above = 100.0 * (nz - 1 - np.arange(nz))
    expected = beta * above / np.sin(np.radians(altitude))
    np.testing.assert_allclose(depth, np.broadcast_to(expected[:, None, None], depth.shape), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(("azimuth", "altitude"), [(0, 90), (90, 30), (200, 10), (301, 4), (135, 1), (20, 15)])
def test_scattered_clouds_are_as_deep_alone_as_in_haze(azimuth: float, altitude: float, periodic: bool) -> None:
    """Depths add up, though in haze no part of a level is empty, and between clouds many are passed by."""
    shape, cell = (14, 43, 71), (90.0, 70.0, 100.0)
    clouds = np.where(np.random.default_rng(4).random(shape) < 0.002, 0.01, 0.0)
    haze, sun = np.full(shape, 2e-5), toward(azimuth, altitude)
    alone, both, without = (depth_to_sun(each, sun, cell, periodic, True) for each in (clouds, clouds + haze, haze))
    assert (alone > 0.1).mean() > 0.002
    np.testing.assert_allclose(alone, both - without, rtol=0, atol=6e-6 * both.max())


@pytest.mark.parametrize(("azimuth", "altitude"), [(0, 90), (90, 60), (200, 30), (45, 45), (301, 10), (180, 3)])
def test_cloud_ends_at_the_sides_of_an_open_grid(azimuth: float, altitude: float) -> None:
    """A homogeneous block as wide as its grid: beta times the way through it, to the top or to a side."""
    nz, ny, nx, beta, cell = 11, 9, 12, 0.002, np.array([50.0, 70.0, 100.0])
    sun = toward(azimuth, altitude)
    depth = depth_to_sun(np.full((nz, ny, nx), beta), sun, tuple(cell), False, True)
    k, j, i = np.mgrid[0:nz, 0:ny, 0:nx]
    way = (nz - 1 - k) * cell[2] / sun[2]
    for at, count, size, slope in ((i, nx, cell[0], sun[0]), (j, ny, cell[1], sun[1])):
        if abs(slope) > 1e-9:
            way = np.minimum(way, np.where(slope > 0, count - 1 - at, at) * size / abs(slope))
    np.testing.assert_allclose(depth, beta * way, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(("azimuth", "altitude"), [(0, 90), (200, 30), (301, 10)])
def test_layers_apart_add_up(azimuth: float, altitude: float, exact: bool) -> None:
    """Three slabs with gaps between them, two of them thinner than a gap that parts: beta dz/mu0 of what lies above."""
    nz, beta = 24, 0.002
    field = np.zeros((nz, 5, 6))
    field[[3, 4, 7, 14, 15, 16]] = beta
    depth = depth_to_sun(field, toward(azimuth, altitude), (50.0, 70.0, 100.0), True, exact)
    between = 0.5 * (field[1:, 0, 0] + field[:-1, 0, 0])
    above = 100.0 * np.append(np.cumsum(between[::-1])[::-1], 0.0)
    expected = above / np.sin(np.radians(altitude))
    np.testing.assert_allclose(depth, np.broadcast_to(expected[:, None, None], depth.shape), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(("azimuth", "altitude"), [(0, 60), (90, 45), (180, 40), (270, 50), (130, 45)])
def test_shadow_of_a_box_falls_away_from_the_sun(azimuth: float, altitude: float) -> None:
    """Mass and centroid of the shadow on the ground: straight lines through a trilinear box keep both."""
    nz, ny, nx, cell, beta = 13, 41, 41, 50.0, 0.01
    field = np.zeros((nz, ny, nx))
    field[7:11, 18:23, 17:22] = beta
    sun = toward(azimuth, altitude)
    ground = depth_to_sun(field, sun, (cell, cell, cell), False, True)[0].astype(float)
    y, x = np.mgrid[0:ny, 0:nx] * cell
    rise = 8.5 * cell  # height of the box's centre
    shift = -rise / sun[2] * sun[:2]
    centre = [(x * ground).sum() / ground.sum(), (y * ground).sum() / ground.sum()]
    # the marching steps are a cell long: a tenth of a cell is what sampling the edges costs
    np.testing.assert_allclose(centre, [19 * cell + shift[0], 20 * cell + shift[1]], atol=0.15 * cell)
    mass = beta * 4 * 5 * 5 / sun[2] * cell
    assert ground.sum() == pytest.approx(mass, rel=0.02)
    # two cells beyond the outline there is nothing
    inside = (np.abs(x - centre[0]) < 6.5 * cell) & (np.abs(y - centre[1]) < 6.5 * cell)
    assert ground[~inside].max() == 0.0


def test_interpolating_nodes_agree_with_marching_ones_about_the_shadow() -> None:
    field = np.zeros((13, 31, 31))
    field[7:11, 13:18, 12:17] = 0.01
    sun = toward(90, 50)
    sharp, soft = (depth_to_sun(field, sun, (50.0,) * 3, False, exact)[0].astype(float) for exact in (True, False))
    assert soft.sum() == pytest.approx(sharp.sum(), rel=0.03)
    x = np.arange(31)
    assert (x * soft).sum() / soft.sum() == pytest.approx((x * sharp).sum() / sharp.sum(), abs=0.3)
    assert soft.max() <= sharp.max() * 1.01


def test_open_sides_are_vacuum_and_periodic_ones_repeat() -> None:
    field = np.full((11, 9, 9), 0.001)
    sun = toward(90, 45)
    opened = depth_to_sun(field, sun, (100.0,) * 3, False, True)
    repeated = depth_to_sun(field, sun, (100.0,) * 3, True, True)
    # from the ground, column i: the ray leaves through x = 8 cells; half a step may be missed at the edge
    way = np.minimum(10.0, 8.0 - np.arange(9)) * 100.0 * np.sqrt(2)
    np.testing.assert_allclose(opened[0, 4], 0.001 * way, atol=0.001 * 75.0)
    np.testing.assert_allclose(repeated[0], 0.001 * 1000.0 * np.sqrt(2), rtol=1e-4)


def test_round_earth_shortens_the_way_to_a_low_sun() -> None:
    """Level ray from the ground: it leaves a layer of height h after sqrt(2 R h) (and would never, were it flat)."""
    radius, beta = 100_000.0, 1e-4
    nz, dz = 21, 50.0
    field = np.full((nz, 3, 3), beta)
    depth = depth_to_sun(field, np.array([1.0, 0.0, 0.0]), (500.0, 500.0, dz), True, True, radius)
    height = dz * (nz - 1)
    # level marching is parabolic: s = sqrt(2 R h)
    assert depth[0, 1, 1] == pytest.approx(beta * np.sqrt(2 * radius * height), rel=1e-3)


def test_no_cloud_no_depth() -> None:
    assert not depth_to_sun(np.zeros((5, 4, 4)), toward(10, 20), (100.0,) * 3, False, True).any()


def _straight(field: np.ndarray, sun: np.ndarray, cell: np.ndarray, periodic: bool) -> np.ndarray:
    """Depths by many small steps along straight lines from the lowest nodes, by scipy's interpolation."""
    nz, ny, nx = field.shape
    j, i = np.mgrid[0:ny, 0:nx]
    padded = np.pad(field, [(0, 0), (0, 1), (0, 1)], mode="wrap") if periodic else field
    total = np.zeros((ny, nx))
    step = 1.0 / 40.0  # of a level
    for up in np.arange(0.5 * step, nz - 1, step):
        y, x = (at + up * cell[2] / sun[2] * s / size for at, s, size in ((j, sun[1], cell[1]), (i, sun[0], cell[0])))
        if periodic:
            y, x = y % ny, x % nx
        total += map_coordinates(padded, [np.full(x.shape, up), y, x], order=1, cval=0.0)
    return total * step * cell[2] / sun[2]


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize(("azimuth", "altitude"), [(20, 80), (115, 40), (290, 12)])
def test_depths_through_a_random_field(azimuth: float, altitude: float, periodic: bool) -> None:
    """Rows of more than two packs and a bit, whose rays wrap around or leave through the sides one after another."""
    rng = np.random.default_rng(int(azimuth))
    nz, ny, nx, cell = 15, 21, 37, np.array([60.0, 80.0, 50.0])
    field = 1e-3 * gaussian_filter(rng.random((nz, ny, nx)), 1.5, mode="wrap")
    sun = toward(azimuth, altitude)
    depth = depth_to_sun(field, sun, tuple(cell), periodic, True)[0]
    expected = _straight(field, sun, cell, periodic)
    # a step a cell long, and where rays graze a corner a part of one
    np.testing.assert_allclose(depth, expected, rtol=0.01, atol=1e-3)
    assert np.sqrt(((depth - expected) ** 2).mean() / (expected**2).mean()) < 0.002


@pytest.mark.parametrize(
    ("azimuth", "altitude", "most"), [(115, 40, 0.13), (20, 70, 0.022), (115, 20, 0.24), (20, 6, 0.19)]
)
def test_depths_between_wide_cells(azimuth: float, altitude: float, most: float) -> None:
    """Rays that move by less than a cell through clouds are read after eight levels, which smears a tenth of what two
    noisy cells differ by; those that move by more three times on the clouds' height by cubics, a sixth."""
    rng = np.random.default_rng(azimuth)
    nz, ny, nx, cell = 81, 17, 29, np.array([19e3, 15e3, 150.0])
    field = 1e-4 * (gaussian_filter(rng.random((nz, ny, nx)), [3.0, 0.7, 0.7], mode="wrap") - 0.4).clip(0)
    sun = toward(azimuth, altitude)
    depth, expected = depth_to_sun(field, sun, tuple(cell), True, True)[0], _straight(field, sun, cell, True)
    assert depth.mean() == pytest.approx(expected.mean(), rel=1e-4)
    apart = np.sqrt(((depth - expected) ** 2).mean() / expected.var())
    assert apart < most


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize(("radius", "most", "mean"), [(2e6, 0.01, 0.001), (1e5, 0.04, 0.003)])
@pytest.mark.parametrize("altitude_deg", [90.0, 60.0, 15.0, 6.0, 1.0])
def test_where_the_earth_bends_neighbours_see_their_own_suns(
    altitude_deg: float, radius: float, most: float, mean: float, periodic: bool
) -> None:
    """Rays of a pack go side by side, or in pieces: against every node's sun for all; also where the sun passes the
    zenith, and those at a side leave it or do not. What is left is of second order in the Earth's curvature, here three
    and sixty times the real one."""
    rng = np.random.default_rng(5)
    nz, ny, nx = 21, 3, 48
    field = 1e-4 * gaussian_filter(rng.random((nz, ny, nx)) - 0.4, [1.0, 0.0, 1.0], mode="wrap").clip(0)
    cell = (500.0, 500.0, 200.0)
    for middle in (0, 24, 47):
        altitude = np.radians(altitude_deg) + (np.arange(nx) - middle - 0.3) * 500.0 / radius
        suns = np.stack([0.9 * np.cos(altitude), 0.436 * np.cos(altitude), np.sin(altitude)], axis=-1)
        depth = depth_to_sun(field, np.broadcast_to(suns, (ny, nx, 3)), cell, periodic, True, radius)[0]
        own = np.stack([depth_to_sun(field, s, cell, periodic, True, radius)[0, :, i] for i, s in enumerate(suns)], -1)
        np.testing.assert_allclose(depth, own, atol=most * own.mean())
        assert abs(depth - own).mean() < mean * own.mean()


@pytest.mark.parametrize("first_deg", [9.3, 10.1, 11.0])
def test_haze_along_the_terminator_dims_the_sun_wherever_it_lies(first_deg: float) -> None:
    """As geometry has it in every column with the sun near the horizon, also in those that share a pack with columns
    in the Earth's shadow."""
    (nz, _, nx), cell, radius, k = (30, 3, 32), (69e3, 69e3, 500.0), 6.371e6, 18
    altitude = first_deg - np.degrees(cell[0] / radius) * np.arange(nx)
    sun = np.array([toward(270.0, a) for a in altitude])
    depth = depth_to_sun(np.full((nz, 3, nx), 2e-6), sun, cell, False, True, radius)[k, 1]
    near = np.abs(altitude) < 1.5
    assert near[16:].any()
    down = (radius + k * cell[2]) * np.sin(np.radians(altitude))
    way = np.sqrt(down**2 + 2 * radius * (nz - 1 - k) * cell[2]) - down
    np.testing.assert_allclose(depth[near], 2e-6 * way[near], rtol=0.01)


@pytest.mark.parametrize("exact", [True, False])
def test_no_depth_is_negative_beside_steep_clouds(exact: bool) -> None:
    """Between nodes that see slightly different suns, steep fields are not continued below nothing."""
    rng = np.random.default_rng(7)
    nz, ny, nx, cell, radius = 24, 9, 48, (1000.0, 1000.0, 24.0), 6.371e6
    field = np.where(rng.random((nz, ny, nx)) < 0.05, 0.02, 0.0)
    altitude = np.radians(0.2) + (np.arange(nx) - 24) * cell[0] / radius
    suns = np.stack([0.8 * np.cos(altitude), 0.6 * np.cos(altitude), np.sin(altitude)], axis=-1)
    depth = depth_to_sun(field, np.broadcast_to(suns, (ny, nx, 3)), cell, False, exact, radius)
    assert depth.max() > 10
    assert depth.min() >= 0


@pytest.mark.parametrize("altitude_deg", [0.0, -0.001, -0.05, -0.25])
def test_what_is_left_of_a_sun_under_a_flat_horizon_comes_level(altitude_deg: float) -> None:
    """To the sides of an open block, which is as dark as by a sun on the horizon."""
    nz, ny, nx, beta, cell = 6, 4, 12, 0.002, (200.0, 300.0, 100.0)
    depth = depth_to_sun(np.full((nz, ny, nx), beta), toward(90.0, altitude_deg), cell, False, True)
    expected = beta * cell[0] * (nx - 1 - np.arange(nx))
    np.testing.assert_allclose(depth[:-1], np.broadcast_to(expected, (nz - 1, ny, nx)), rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("altitude_deg", [1e-4, 0.0, -0.05, -0.25])
def test_a_level_sun_in_a_period_is_far(altitude_deg: float) -> None:
    """Through 1e6 cells, of which some are asked."""
    rng = np.random.default_rng(3)
    nz, ny, nx, cell = 12, 16, 24, (25.0, 25.0, 20.0)
    field = rng.random((nz, ny, nx)) * 0.01
    depth = depth_to_sun(field, toward(200.0, altitude_deg), cell, True, True)
    mu, rise = max(np.sin(np.radians(altitude_deg)), 0.0), cell[2] * (nz - 1)
    way = 2 * rise / (mu + np.sqrt(mu**2 + 2 * rise / FLAT_M))
    np.testing.assert_allclose(depth[0], 0.005 * way, rtol=0.1)
    assert depth[-2].min() > 80.0


def test_high_cloud_is_lit_by_a_sun_under_the_horizon() -> None:
    """On the curved Earth, from 8 km two degrees down: over the fog, through the deck in which the ray has its lowest
    point."""
    radius, beta, mu, cell = 6.371e6, 1e-5, -np.sin(np.radians(2.0)), (5000.0, 5000.0, 500.0)
    height = cell[2] * np.arange(19)
    lowest = 8000.0 - radius * mu**2 / (2 * (1 - mu**2))
    assert 4000.0 < lowest < 4500.0
    deck = np.where((height > 3000) & (height < 7000), beta, 0.0)
    fog = np.where(height < 2500, 0.01, 0.0)
    sun = np.array([np.sqrt(1 - mu**2), 0.0, mu])
    for field, expected in ((fog, 0.0), (deck, None)):
        depth = depth_to_sun(np.broadcast_to(field[:, None, None], (19, 3, 130)), sun, cell, False, True, radius)
        if expected is None:
            s = np.arange(0.0, 1e6, 50.0)
            expected = 50.0 * np.interp(8000.0 + mu * s + (1 - mu**2) * s**2 / (2 * radius), height, field).sum()
        np.testing.assert_allclose(depth[16, :, :20], expected, rtol=0.01)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("name", ["swim", "fast"])
def test_a_setting_sun_fades_from_flat_scenes(name: str, periodic: bool) -> None:
    shape = (8, 8, 8)
    cloud = box(shape, (slice(2, 5), slice(2, 6), slice(2, 6)), 0.01)
    scene = grid_scene(cloud, shape, (200.0,) * 3, periodic=periodic)
    rays = Rays(np.array([0.0, 0.0, 1.0]), np.array([[0.0, 0.0, 1.0], [0.5, 0.5, 0.7]]))
    before = np.inf
    for altitude_deg in (0.5, 0.25, 0.05, 0.01, 0.0, -0.01, -0.05, -0.25, -0.5, -5.0, -90.0):
        field = Solver(name).solve(scene, toward(53.0, altitude_deg), [WAVELENGTH_NM])
        views = [field.view(r).radiance.ravel() for r in (rays, down_on([0.0, 300.0], 0.0, 3000.0))]
        seen = np.concatenate([*views, *field.fluxes().values(), [field.lit[0].channels.beam.mean()]])
        assert np.isfinite(seen).all()
        assert (seen >= 0).all()
        assert (seen <= before + 1e-5).all(), altitude_deg
        before = seen
        if altitude_deg < -0.3:
            assert (seen < 2e-6).all()
