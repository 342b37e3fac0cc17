"""What diffusion tells of the light yet to come, and what it is for: thick clouds keep all their light."""

from __future__ import annotations

import numpy as np
import pytest
from tests.transport.scenes import grid_scene, toward

from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport.diffuse.diffusion import Diffusion
from openswim.transport.diffuse.optical_grid import OpticalGrid, optical_grid
from openswim.transport.medium.delta_scaled import Coefficients

NY, NX = 18, 21  # rows that end within a pack


def medium(
    extinction: np.ndarray, levels_m: np.ndarray, ground: np.ndarray | None = None, periodic: bool = True,
    albedo: float = 1.0,
) -> OpticalGrid:  # fmt: skip
    """One species (nz, ny, nx) of asymmetry .5 on 50-m columns; no air."""
    nz, ny, nx = extinction.shape
    scattering = np.array([[albedo, 0.5 * albedo, 0.25 * albedo]], np.float32)
    air = Coefficients(np.ones(1, np.float32), scattering, np.zeros(nz, np.float32), np.zeros((nz, 3), np.float32))
    return optical_grid(
        extinction[None].astype(np.float32), np.zeros((ny, 9, nx), np.float32), levels_m, np.array([50.0, 50.0]),
        periodic, np.full((2, 2), True), np.zeros((ny, nx), np.int64) if ground is None else ground, air,
        np.zeros(extinction.shape, np.float32),
    )  # fmt: skip


@pytest.mark.parametrize("ground_albedo", [0.0, 0.6, 1.0])
def test_a_deck_follows_the_parabola(ground_albedo: float) -> None:
    """-e''/(3 t) = s over a depth of 20, half of e leaving at the top, and as much of it below as is not given back."""
    levels = np.linspace(0.0, 1000.0, 321)
    grid = medium(np.full((321, NY, NX), 0.04), levels)
    e = Diffusion(grid, np.full((NY, NX), ground_albedo, np.float32), True).follows(np.ones((321, NY, NX), np.float32))
    depth = 40.0  # of extinction; of transport half
    x = levels / 1000.0 * depth  # e = -3/4 x^2 + a x + b, flux upward -de/dx * 2/3
    back = 0.5 * (1 - ground_albedo) / (1 + ground_albedo)
    # 2/3 a = back b at the ground; at the top -2/3 e' = e/2
    equations = np.array([[2 / 3, -back], [2 / 3 + depth / 2, 0.5]])
    a, b = np.linalg.solve(equations, [0.0, depth + 0.375 * depth**2])
    np.testing.assert_allclose(e.mean(axis=(1, 2)), -0.75 * x**2 + a * x + b, rtol=0.012)
    assert np.ptp(e, axis=(1, 2)).max() < 0.01 * e.max()


@pytest.mark.parametrize("periodic", [True, False])
def test_it_solves_its_equations(periodic: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random cloud over hills: what scatters is absorbed or leaves; what is left of a tight solution is rounding."""
    monkeypatch.setattr("openswim.transport.diffuse.diffusion._CLOSE", 1e-5)
    monkeypatch.setattr("openswim.transport.diffuse.diffusion._MOST", 1000)
    rng = np.random.default_rng(3)
    levels = np.cumsum(np.r_[0.0, rng.uniform(20.0, 60.0, 15)])
    cloud = 0.05 * rng.random((16, NY, NX)) * (rng.random((16, NY, NX)) > 0.4)
    ground = rng.integers(0, 4, (NY, NX))
    grid = medium(cloud, levels, ground, periodic, albedo=0.98)
    diffusion = Diffusion(grid, np.full((NY, NX), 0.3, np.float32), True)
    change = rng.random((16, NY, NX)).astype(np.float32)
    e = diffusion.follows(change).astype(float)
    assert (e[np.arange(16)[:, None, None] >= ground] > 0).all()
    own, up, north, east = (
        diffusion.fields(a)[..., 1 : 1 + NX].astype(float)
        for a in (diffusion.own, diffusion.up, diffusion.north, diffusion.east)
    )
    left = own * e - diffusion.source * change
    left[1:] -= up[1:] * e[:-1]
    left[:-1] -= up[1:] * e[1:]
    for axis, link in ((1, north), (2, east)):
        left -= link * np.roll(e, -1, axis) + np.roll(link * e, 1, axis)
    assert np.abs(left).max() < 2e-3 * (diffusion.source * change).max()


def test_large_grids_are_halved() -> None:
    """Smooth light on 64 x 64 columns is found on 32 x 32 within a tenth: enough for what only guides sweeps."""
    levels = np.linspace(0.0, 800.0, 17)
    y, x = np.mgrid[0:64, 0:64] / 64.0
    cloud = np.broadcast_to(0.01 * (1.2 + np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)), (17, 64, 64))
    change = np.broadcast_to((1.5 + np.cos(2 * np.pi * (x - y))).astype(np.float32), (17, 64, 64))
    black = np.zeros((64, 64), np.float32)
    halved = Diffusion(medium(cloud, levels), black, True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("openswim.transport.diffuse.diffusion._MOST_COLUMNS", 10_000)
        whole = Diffusion(medium(cloud, levels), black, True)
    assert halved.halved == [(64, 64)]
    assert not whole.halved
    e = whole.follows(change)
    assert np.abs(halved.follows(change) - e).mean() < 0.1 * e.mean()


def divided_less(monkeypatch: pytest.MonkeyPatch, nodes: int) -> None:
    """As in large domains, cells are not divided where there would be more nodes than so many: they stay thick."""
    monkeypatch.setattr("openswim.transport.medium.levels.MOST_RESOLVED_NODES", nodes)


@pytest.mark.parametrize(("depth", "seed"), [(100.0, 0), (1000.0, 0), (1000.0, 1), (3000.0, 1)])
def test_thick_decks_keep_their_light(depth: float, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """White, nearly even, without sides, over black ground: what enters leaves, after some hundred to thousand
    scatterings (3 % less where the first sweep between finer nodes is also the last); and as much comes through as two
    streams say (Eddington, 2 (1 + 3/2 mu)/(4 + 3 depth (1 - g)) where it is thick; Meador and Weaver 1980), within
    3.5 %. (Of depth 1000, in cells of depth 28, twice as much: .014.)"""
    divided_less(monkeypatch, 250_000)
    rng = np.random.default_rng(seed)
    shape = (9, 8, 8)
    extinction = np.zeros(shape)
    extinction[2:7] = depth / 400.0
    scene = grid_scene(extinction * rng.normal(1.0, 0.02, shape), shape, periodic=True)
    sun = toward(250.0, 40.0)
    fluxes = {name: float(flux[0]) / sun[2] for name, flux in Solver().solve(scene, sun, [546.0]).fluxes().items()}
    assert fluxes["up_top"] + fluxes["down_bottom"] + fluxes["direct_bottom"] == pytest.approx(1.0, abs=0.0012)
    if depth == 100.0:  # linear between nodes: half a layer more above and below
        through = (2 + 3 * sun[2]) / (4 + 3 * 1.25 * depth * 0.15)
        assert fluxes["down_bottom"] == pytest.approx(through, rel=0.045)


def lumpy() -> Scene:
    """A white cloud of optical depth 480 within 1.1 km."""
    rng = np.random.default_rng(0)
    z, y, x = np.ogrid[0:10, 0:11, 0:11]
    inside = 1 - ((z - 4.5) / 4) ** 2 - ((y - 5.0) / 4) ** 2 - ((x - 5.0) / 4) ** 2
    extinction = 0.6 * np.clip(inside + 0.3 * rng.standard_normal(inside.shape), 0, 1)
    return grid_scene(extinction, inside.shape)


def test_a_thick_cloud_is_done_at_the_default_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fluxes within .15 % of those that many more sweeps find (3 to 4 % too small without diffusion)."""
    divided_less(monkeypatch, 250_000)
    quick, exact = (
        Solver(tolerance=t).solve(lumpy(), toward(250.0, 40.0), [546.0]).fluxes() for t in (0.02, 0.002)
    )
    for name, flux in exact.items():
        np.testing.assert_allclose(quick[name], flux, rtol=0.0019, atol=1e-6, err_msg=name)


def test_a_wide_deck_with_open_sides_keeps_its_light() -> None:
    """An even, white deck of depth 100 in cells of a kilometre, over black ground: what enters its middle leaves
    there. Half of it would not, did diffusion know nothing of how light enters thick cells by the sides."""
    shape = (16, 12, 12)
    scene = grid_scene(np.full(shape, 100 / 375), shape, (1500.0, 1500.0, 25.0), True, phase=HenyeyGreenstein(0.6))
    sun = toward(30.0, 74.0)
    field = Solver().solve(scene, sun, [546.0])
    lighting = field.lit[0].lighting
    middle = tuple(slice(n // 3, 2 * n // 3) for n in lighting.diffuse[0].shape)
    leaves = lighting.up_top[0][middle] + lighting.diffuse[0][middle]
    assert leaves.mean() == pytest.approx(sun[2], rel=0.01)


def test_lone_thick_cells_are_solved() -> None:
    """Cells of depth 20, all different, in wide columns of a period keep their light: without diffusion a quarter
    is lost, and with it corrections from the coarser grid diverge that are taken as they are."""
    rng = np.random.default_rng(1)
    shape = (8, 24, 24)
    cells = (rng.random(shape) < 0.7) * rng.random(shape)
    scene = grid_scene(cells, shape, (2000.0, 2000.0, 25.0), periodic=True, phase=HenyeyGreenstein(0.0))
    sun = toward(250.0, 25.0)
    field = Solver().solve(scene, sun, [546.0])
    total = sum(float(field.fluxes()[name][0]) for name in ("up_top", "down_bottom", "direct_bottom"))
    assert max(field.lit[0].sweeps[0]) < 40
    assert total == pytest.approx(sun[2], rel=0.03)


@pytest.mark.parametrize("seed", [2, 6, 11])
def test_where_diffusion_misleads_sweeps_begin_anew_without_it(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes of depth up to 1000 across, all different, on the round Earth, and none divided: no more light than there
    is (1e5 times as much and more, did sweeps go on from where diffusion led them)."""
    divided_less(monkeypatch, 1)
    rng = np.random.default_rng(seed)
    shape = (7, 5, 6)
    cover, altitude = rng.uniform(0.05, 1), rng.uniform(0, 90)
    cloud = np.where(rng.random(shape) < cover, rng.random(shape), 0.0)
    scene = grid_scene(cloud, shape, (1000.0, 1000.0, 200.0), True)
    for name, flux in Solver().solve(scene, toward(0.0, altitude), [615.0]).fluxes().items():
        assert 0 <= flux[0] < 1, name


def thick_scene(seed: int) -> tuple[Scene, np.ndarray]:
    """Cells of random size and depth, up to thousands, over bright or dark ground, and the way to the sun."""
    rng = np.random.default_rng(seed)
    shape = tuple(int(rng.integers(low, 12)) for low in (4, 3, 3))
    kind, cover = rng.integers(4), rng.uniform(0.05, 1)
    across, tall = float(rng.choice([50, 200, 1000, 3000])), float(rng.choice([25, 100, 200, 500]))
    extinction = 10 ** rng.uniform(-3, 0.3)
    if kind == 0:
        cloud = (rng.random(shape) < cover) * rng.random(shape)
    elif kind == 1:
        cloud = (rng.random(shape) < cover) * 1.0
    elif kind == 2:
        cloud = (rng.random(shape) < cover) * 10 ** rng.uniform(-3, 0, shape)
    else:
        cloud = np.ones(shape) * (rng.random(shape[1:]) < cover) * rng.random(shape[1:])
    nz, ny, nx = shape
    periodic = bool(rng.random() < 0.3) and min(nx, ny) * across > 0.6 * nz * tall
    curved = bool(rng.random() < 0.5) and not periodic
    albedo, g = float(rng.choice([0, 0.5, 1.0])), float(rng.choice([0, 0.5, 0.85]))
    altitude = rng.uniform(2, 90)
    scene = grid_scene(
        extinction * cloud, shape, (across, across, tall), curved, periodic=periodic, surface_albedo=albedo,
        phase=HenyeyGreenstein(g),
    )  # fmt: skip
    return scene, toward(rng.uniform(0, 360), altitude)


@pytest.mark.parametrize("seed", [99, 176, 181])
def test_where_steps_amend_light_without_end_they_do_so_no_more(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Undivided cells in which light grew to 13, 300 and 2500 times the sun's without diffusion, too."""
    divided_less(monkeypatch, 1)
    monkeypatch.setattr("openswim.transport.medium.levels._MOST_NODES", 1)
    scene, sun = thick_scene(seed)
    for name, flux in Solver().solve(scene, sun, [546.0]).fluxes().items():
        assert 0 <= flux[0] < 0.7, name
