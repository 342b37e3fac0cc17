"""Monte Carlo: exact limits, conservation, symmetry, honest errors, and the same light as other solvers'.

Chances follow from the seed, so nothing here fails by bad luck twice in a row or once in a while.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from tests.transport.scenes import (
    LAT,
    LON,
    WAVELENGTH_NM,
    box,
    cloud_scene,
    down_on,
    grid_scene,
    sky_directions,
    slab,
    toward,
)
from tests.validation.fakes import single_scattering

from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.lighting import daylight
from openswim.scene import Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import scene_frame
from openswim.scene.phase import HenyeyGreenstein
from openswim.scene.procedural import demo_scene
from openswim.solver import Solver
from openswim.transport.montecarlo import reference as montecarlo

SUN = toward(200.0, 40.0)


def solve(scene: Scene, sun: np.ndarray = SUN, wavelengths=(WAVELENGTH_NM,), **options):
    return Solver("reference", **options).solve(scene, sun, wavelengths)


def above(direction: np.ndarray) -> Rays:
    """Rays of which the directions point down, from over the slabs."""
    return Rays(np.array([0.0, 0.0, 1001.0]), direction)


@pytest.mark.parametrize("upward", [True, False])
def test_thin_layers_scatter_once(upward: bool) -> None:
    """tau .002: two scatterings are .1 % of one."""
    scene = slab(0.002, omega=0.9, levels=5)
    direction = sky_directions([20.0, 50.0], [0.0, 90.0, 200.0]) * [1, 1, 1 if upward else -1]
    rays = Rays(np.array([0.0, 0.0, 0.0]), direction) if upward else above(direction)
    view = solve(scene, paths=60_000).view(rays)
    truth = single_scattering(scene, SUN, rays.origins(), rays.directions())
    assert (np.abs(view.radiance[:, 0] - truth) < 4 * view.sigma[:, 0] + 3e-3 * truth).all()


@pytest.mark.parametrize("tau", [0.5, 8.0])
def test_a_white_cloud_keeps_no_light(tau: float) -> None:
    field = solve(slab(tau, levels=9), paths=60)
    fluxes, errors = field.fluxes(), field.flux_errors()
    names = ("up_top", "down_bottom", "direct_bottom")
    sigma = np.sqrt(sum(errors[name][0] ** 2 for name in names))
    assert abs(sum(fluxes[name][0] for name in names) - SUN[2]) < 4 * sigma
    assert sigma < 0.01 * SUN[2]


def test_reflection_is_reciprocal() -> None:
    """L'(view; sun) / mu_sun of a layer is the same with sun and view exchanged (over mu, the view's)."""
    scene, other = slab(3.0, omega=0.95, albedo=0.3, levels=9), toward(80.0, 65.0)
    there = solve(scene, SUN, paths=8000).view(above(-other[None]))
    back = solve(scene, other, paths=8000, seed=1).view(above(-SUN[None]))
    a, b = (v.radiance[0, 0] / mu for v, mu in ((there, SUN[2]), (back, other[2])))
    sigma = np.hypot(there.sigma[0, 0] / SUN[2], back.sigma[0, 0] / other[2])
    assert abs(a - b) < 4 * sigma
    assert sigma < 0.05 * a


def test_clear_sky_as_fast_sees_it() -> None:
    """Haze, molecules, ozone, ground; 2 % is what `fast` allows itself."""
    scene = Scene.clear(LAT, LON, Atmosphere.us_standard(), surface_albedo=0.2)
    frame = scene_frame(scene)
    sun = frame.direction(200.0, 40.0, LAT, LON)
    direction = frame.direction(np.array([20.0, 200.0, 110.0, 20.0]), np.array([80.0, 30.0, 10.0, -40.0]), LAT, LON)
    rays = Rays(frame.position(LAT, LON, 3000.0), direction)
    wavelengths = (615.0, 450.0)
    mine, theirs = (
        solver.solve(scene, sun, wavelengths).view(rays) for solver in (Solver("reference", paths=6000), Solver("fast"))
    )
    assert (np.abs(mine.radiance - theirs.radiance) < 4 * mine.sigma + 0.02 * theirs.radiance).all()
    # the levels of `fast` are up to 5 km apart, which makes its air a little thicker
    np.testing.assert_allclose(mine.transmittance, theirs.transmittance, rtol=1e-2)
    assert (mine.hit == theirs.hit).all()


def test_sparse_cloud_as_fast_sees_it() -> None:
    """A thin box in curved air over reflecting ground, from above: mean within 3 %, fast's own allowance."""
    shape = (9, 13, 13)
    field = box(shape, (slice(3, 6), slice(4, 9), slice(4, 9)), 0.0005)
    scene = grid_scene(field, shape, curved=True, air=True, surface_albedo=0.2)
    rays = down_on(*np.meshgrid(np.linspace(-400, 400, 8), np.linspace(-400, 400, 8)), 2000.0)
    solvers = (Solver("reference", paths=1500), Solver())
    mine, theirs = (solver.solve(scene, SUN, [WAVELENGTH_NM]).view(rays) for solver in solvers)
    sigma = np.sqrt((mine.sigma.astype(float) ** 2).sum()) / mine.sigma.size
    assert abs(mine.radiance.mean() - theirs.radiance.mean()) < 4 * sigma + 0.03 * theirs.radiance.mean()
    np.testing.assert_allclose(mine.species_depth[:, 0], theirs.species_depth[:, 0], atol=0.01)


@pytest.mark.parametrize("dz", [0.0, -0.0])
def test_level_rays_see_what_rays_beside_them_see(dz: float) -> None:
    light = solve(cloud_scene(), paths=4000)
    level, tilted = (light.view(Rays(np.array([-900.0, 20.0, 440.0]), np.array([[1.0, 0.0, z]]))) for z in (dz, 1e-6))
    assert tilted.radiance[0, 0] > 10 * tilted.sigma[0, 0]
    assert abs(level.radiance - tilted.radiance)[0, 0] < 4 * np.hypot(level.sigma, tilted.sigma)[0, 0]


def test_the_sun_is_aimed_at_without_bias(monkeypatch: pytest.MonkeyPatch) -> None:
    field = solve(cloud_scene(surface_albedo=0.3), paths=3000)
    rays = down_on([-150.0, 0.0, 150.0], [0.0, 100.0, -100.0], 2000.0)
    aimed = field.view(rays)
    monkeypatch.setattr(montecarlo, "_AIMING", 0.0)
    plain = field.view(rays)
    assert (np.abs(aimed.radiance - plain.radiance) < 4 * np.hypot(aimed.sigma, plain.sigma)).all()
    assert aimed.sigma.mean() < plain.sigma.mean()


def test_wavelengths_that_share_paths_do_not_mix() -> None:
    scene = _two_colours()
    rays = above(-sky_directions([30.0], [0.0, 90.0]))
    both = solve(scene, wavelengths=(450.0, 615.0), paths=6000).view(rays)
    for w, wavelength in enumerate((450.0, 615.0)):
        alone = solve(scene, wavelengths=(wavelength,), paths=6000, seed=9).view(rays)
        difference = np.abs(both.radiance[:, w] - alone.radiance[:, 0])
        assert (difference < 4 * np.hypot(both.sigma[:, w], alone.sigma[:, 0])).all()


def test_wavelengths_unlike_each_other_share_paths_at_dusk() -> None:
    """Ground under a lit sky, the sun 3 degrees down: air is 35 times as thick at 360 as at 870 nm."""
    scene, wavelengths = Scene.clear(LAT, LON, Atmosphere.us_standard(aerosol=None), surface_albedo=0.9), (360.0, 870.0)
    frame = scene_frame(scene)
    sun, down = (frame.direction(200.0, altitude, LAT, LON) for altitude in (-3.0, -60.0))
    rays = Rays(frame.position(LAT, LON, 11_000.0), np.tile(down, (8, 1)))

    def mean(together: tuple[float, ...]) -> np.ndarray:
        return solve(scene, sun, together, paths=12_000).view(rays).radiance.mean(axis=0)

    alone = np.concatenate([mean((wavelength,)) for wavelength in wavelengths])
    np.testing.assert_allclose(mean(wavelengths), alone, rtol=0.25)  # errors are 6 %


def _two_colours() -> Scene:
    across = np.arange(3) * 1000.0
    return Scene.from_arrays(
        np.full((5, 3, 3), 0.002, np.float32), across, across, np.linspace(0.0, 1000.0, 5),
        phase={450.0: HenyeyGreenstein(0.6), 615.0: HenyeyGreenstein(0.85)}, single_scattering_albedo=0.95,
        periodic=True, surface_albedo=np.tile(np.float32([0.1, 0.6]), (3, 3, 1)), wavelength_nm=[450.0, 615.0],
        atmosphere=Atmosphere.us_standard(),
    )  # fmt: skip


def test_seed_decides_and_threads_do_not() -> None:
    field, rays = solve(cloud_scene(), paths=64), down_on(np.linspace(-200, 200, 30), 0.0, 2000.0)
    first = field.view(rays).radiance
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        np.testing.assert_array_equal(field.view(rays).radiance, first)
    finally:
        numba.set_num_threads(threads)
    assert (solve(cloud_scene(), paths=64, seed=1).view(rays).radiance != first).any()


@pytest.mark.parametrize("keeps", [False, True])
def test_ctrl_c_loses_nothing(keeps: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    field = solve(cloud_scene(), paths=1024, checkpoint=tmp_path / "sums.npz" if keeps else None)
    rays, real, calls = down_on(np.linspace(-200, 200, 10), 0.0, 2000.0), montecarlo.path_kernel, []

    def impatient(t: int, *arguments) -> None:
        real(t, *arguments)  # an interrupt is noticed when the compiled function comes back
        calls.append(t)
        if t == 0 and calls.count(0) == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(montecarlo, "path_kernel", impatient)
    if not keeps:
        view = field.view(rays)
        assert view.interrupted
        assert 2 <= view.paths < 1024
        whole = solve(cloud_scene(), paths=view.paths).view(rays)
        np.testing.assert_allclose(view.radiance, whole.radiance, rtol=1e-6)
        return
    with pytest.raises(KeyboardInterrupt):
        field.view(rays)
    monkeypatch.setattr(montecarlo, "path_kernel", real)
    whole = solve(cloud_scene(), paths=1024).view(rays)
    np.testing.assert_allclose(field.view(rays).radiance, whole.radiance, rtol=1e-6)


def test_passes_of_many_rays_are_cut_for_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    field, real, parts = solve(slab(1.0, levels=5), paths=2), montecarlo.in_threads, []
    monkeypatch.setattr(montecarlo, "in_threads", lambda *a, **k: parts.append(k["parts"]) or real(*a, **k))
    rays = above(-sky_directions(np.full(100, 20.0), np.linspace(0, 350, 100)))
    many = field.view(rays)
    assert set(parts) == {rays.directions().shape[0] // montecarlo._PART_RAYS}
    assert parts[0] > 2
    monkeypatch.setattr(montecarlo, "_PART_RAYS", 1 << 30)
    np.testing.assert_array_equal(field.view(rays).radiance, many.radiance)


def test_target_error_ends_it() -> None:
    rays = above(-sky_directions([30.0], np.linspace(0, 350, 8)))
    view = solve(slab(2.0, levels=5), target_error=0.05).view(rays)
    assert 0.02 < view.mean_error <= 0.05
    assert not view.interrupted


def test_errors_are_honest() -> None:
    """chi^2 of 60 seeds about their mean, by their own errors; its spread is sqrt(2/59/4), the tails a little more."""
    scene, rays = slab(1.0, albedo=0.5, levels=5), above(-sky_directions([20.0, 60.0], [0.0, 140.0]))
    field = solve(scene, paths=400)
    views = [replace(field, solver=replace(field.solver, seed=n)).view(rays) for n in range(60)]
    radiance = np.stack([v.radiance[:, 0] for v in views]).astype(float)
    sigma = np.stack([v.sigma[:, 0] for v in views]).astype(float)
    chi = ((radiance - radiance.mean(axis=0)) ** 2).sum(axis=0) / 59 / (sigma**2).mean(axis=0)
    assert 0.7 < chi.mean() < 1.3


@pytest.mark.parametrize("name", ["mc_sky_ground", "mc_twilight_zenith"])
def test_low_sun_and_twilight_by_another_monte_carlo(name: str, shared: Path) -> None:
    """The reference's own accuracy is 1 to 2 % to 92 degrees, 5 % at 94 (its README)."""
    views = name == "mc_sky_ground"
    table = np.genfromtxt(shared / "reference" / "clearsky" / f"{name}.csv", delimiter=",", names=True)
    for sza, aod in ((75.0, 0.0), (90.0, 0.1)) if views else ((88.0, 0.1), (91.0, 0.0)):
        rows = table[(table["sza"] == sza) & (np.isclose(table["aod550"], aod)) & (table["wl"] == 546)]
        if views:
            rows = rows[np.isin(rows["raa"], (0, 180)) & np.isin(rows["vza"], (0, 60, 85))]
        assert rows.size
        for height in np.unique(rows["obs_alt_m"]):
            part = rows[rows["obs_alt_m"] == height]
            sky = Atmosphere.us_standard(300.0, AerosolProfile(optical_depth=aod) if aod else None)
            scene = Scene.clear(LAT, LON, sky, surface_albedo=float(part["albedo"][0]))
            frame = scene_frame(scene)
            zenith, azimuth = (part["vza"], part["raa"]) if views else np.zeros((2, part.size))
            direction = frame.direction(150.0 + azimuth, 90.0 - zenith, LAT, LON)
            rays = Rays(frame.position(LAT, LON, max(float(height), 1.0)), direction)
            view = solve(scene, frame.direction(150.0, 90.0 - sza, LAT, LON), (546.0,), paths=6000).view(rays)
            sigma = np.hypot(view.sigma[:, 0], part["Lp_stderr"])
            allowed = 4 * sigma + 0.02 * part["Lp"]
            assert (np.abs(view.radiance[:, 0] - part["Lp"]) < allowed).all(), (sza, aod, height)


def test_ground_is_where_the_terrain_is() -> None:
    """A ridge in a curved scene: rays down meet it, the slope turned to the sun is the brighter one."""
    x = 100.0 * (np.arange(21) - 10)
    ridge = np.maximum(400.0 - np.abs(x), 0.0)[None, :].repeat(21, axis=0)
    scene = grid_scene({}, (9, 21, 21), curved=True, terrain_m=ridge, surface_albedo=0.5)
    sun = toward(90.0, 30.0)  # in the east
    view = solve(scene, sun, paths=400).view(down_on([-200.0, 200.0, 900.0], 0.0, 3000.0))
    # the cells of the projection are 1.5 % wide
    np.testing.assert_allclose(view.position[:, 2], [200.0, 200.0, 0.0], atol=5.0)
    of_the_plain = 0.5 * (1 - np.sqrt(0.5)) / 2 * 4 * 0.5 * sun[2]  # which the slope sees below the horizon
    lit = 4 * 0.5 * max(sun @ np.array([1, 0, 1]) / np.sqrt(2), 0) + of_the_plain
    assert view.radiance[1, 0] == pytest.approx(lit, abs=4 * view.sigma[1, 0] + 0.02 * lit)
    assert view.radiance[0, 0] < 0.3 * lit  # in the ridge's shadow: lit by the ground alone


def test_pixels_are_means_over_their_sides() -> None:
    """A pixel half over the cloud sees the mean of its halves."""
    field = solve(cloud_scene(surface_albedo=0.2), paths=4000)
    centre, half = np.array([[200.0, 0.0, 2000.0]]), np.array([100.0, 0.0, 0.0])
    down = np.array([[0.0, 0.0, -1.0]])
    whole = field.view(Rays(centre, down), 2 * half, None)
    parts = [field.view(Rays(centre + shift, down), half, None) for shift in (-half / 2, half / 2)]
    mean = np.mean([p.radiance[0, 0] for p in parts])
    sigma = np.sqrt(whole.sigma[0, 0] ** 2 + sum(p.sigma[0, 0] ** 2 for p in parts) / 4)
    # the halves of a pixel 2 half wide reach a quarter further out on each side
    assert abs(whole.radiance[0, 0] - mean) < 4 * sigma


@pytest.mark.parametrize("options", [{"paths": 1}, {"target_error": 2.0}, {"seed": -1}])
def test_senseless_options_are_refused(options: dict) -> None:
    with pytest.raises(UserError):
        Solver("reference", **options)


def test_options_of_monte_carlo_are_its_own() -> None:
    with pytest.raises(UserError, match="reference"):
        Solver("fast", paths=10)


def test_rays_in_a_side_of_the_domain_cost_what_others_do() -> None:
    """A ray within a face of blocks must not creep along it: that took a thousand times as long."""
    field = np.full((16, 24, 24), 2e-4, np.float32)
    scene = grid_scene(field, field.shape, (60.0,) * 3)
    side = 60.0 * 23 / 2
    light = Solver("reference", paths=200).solve(scene, toward(200.0, 35.0), [WAVELENGTH_NM])
    seconds, seen = [], []
    for x in (0.7, 0.7, side):  # the first compiles
        start = time.process_time()
        seen.append(light.view(down_on(np.full(16, x), np.linspace(-500, 500, 16), 2000.0)).radiance.mean())
        seconds.append(time.process_time() - start)
    assert seconds[2] < 20 * max(seconds[1], 0.005)
    assert 0.3 < seen[2] / seen[1] <= 1.05  # half of its surroundings, all of its own air


def test_the_sky_in_the_sea_has_little_noise() -> None:
    """Seen from a ship, away from the sun: 400 paths know a pixel to a twentieth (3000 that left it evenly were off by
    more than the mean, by rare bright ones)."""
    n = 8
    scene = grid_scene(
        {}, (6, n, n), (2000.0, 2000.0, 1000.0), curved=True, air=True, surface_albedo=0.05,
        fields={"land_area_fraction": np.zeros((n, n)), "wind_east_10m": np.full((n, n), 5.0)},
    )  # fmt: skip
    rays = Rays(np.array([0.0, 0.0, 20.0]), sky_directions([-20.0, -10.0], np.arange(0.0, 360.0, 45.0)))
    seen = Solver("reference", paths=400).solve(scene, toward(20.0, 35.0), [WAVELENGTH_NM]).view(rays)
    away = np.abs((np.tile(np.arange(0.0, 360.0, 45.0), 2) - 20.0 + 180.0) % 360.0 - 180.0) > 60.0
    assert np.median((seen.sigma / seen.radiance)[away]) < 0.06
    assert (seen.sigma / seen.radiance)[away].max() < 0.2


def test_land_and_water_reflect_as_for_the_other_solvers() -> None:
    """Clear and without air, light is what the sun sends back off the ground: `swim`'s to 3 %, the hills' shape."""
    scene = demo_scene(48, 48, 16, spacing_m=500.0)
    bare = {name: 0 * scene.data[name] for name in ("liquid_content", "ice_content")}
    scene = replace(scene, data=scene.data.assign(bare), atmosphere=None)
    sun = daylight(scene).direction
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-9e3, 9e3, 9), np.linspace(-9e3, 9e3, 9)))
    rays = down_on(x, y, 3000.0)
    ours = solve(scene, sun, (615.0, 450.0), paths=200).view(rays)
    theirs = Solver("swim").solve(scene, sun, [615.0, 450.0]).view(rays)
    assert ours.radiance.mean() > 0.1
    np.testing.assert_allclose(ours.radiance.mean(axis=0), theirs.radiance.mean(axis=0), rtol=0.03)
    np.testing.assert_allclose(ours.radiance, theirs.radiance, rtol=0.1, atol=0.01)
