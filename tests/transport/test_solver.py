"""The solver as a whole: conservation, symmetry, other people's radiances."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from tests.transport.scenes import (
    LAT,
    LON,
    WAVELENGTH_NM,
    box,
    grid_scene,
    sky_directions,
    slab,
    sun_at_zenith_angle,
    toward,
)

from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import DoubleHenyeyGreenstein, HenyeyGreenstein, PhaseFunction
from openswim.solver import Solver
from openswim.transport import Field


@pytest.mark.parametrize("zenith", [0.0, 60.0])
@pytest.mark.parametrize("tau", [0.1, 1.0, 10.0, 100.0])
def test_a_white_cloud_keeps_no_light(tau: float, zenith: float) -> None:
    """Conservative slab over black ground: up + down + direct = mu0, within .5 %."""
    fluxes = Solver().solve(slab(tau), sun_at_zenith_angle(zenith), [WAVELENGTH_NM]).fluxes()
    total = sum(fluxes[name][0] for name in ("up_top", "down_bottom", "direct_bottom"))
    assert total == pytest.approx(np.cos(np.radians(zenith)), rel=0.0025)
    assert fluxes["up_bottom"][0] == 0.0


@pytest.fixture(scope="module")
def slabs(shared: Path) -> xr.Dataset:
    with xr.open_dataset(shared / "reference" / "clouds" / "slabs_hg085.nc") as data:
        return data.load()


def disort(slabs: xr.Dataset, tau: float, zenith: float, omega: float, albedo: float) -> tuple[xr.Dataset, Field]:
    chosen = (slabs.tau == tau) & (slabs.sza == zenith) & (slabs.omega == omega) & (slabs.albedo == albedo)
    case = slabs.isel(case=int(np.flatnonzero(chosen.values)[0]))
    return case, Solver().solve(slab(tau, albedo, omega), sun_at_zenith_angle(zenith), [WAVELENGTH_NM])


@pytest.mark.parametrize(
    ("tau", "zenith", "omega", "albedo"),
    [(0.1, 80, 0.95, 0.0), (1.0, 0, 1.0, 0.0), (1.0, 60, 0.95, 0.2), (10.0, 60, 1.0, 0.8), (10.0, 0, 0.95, 0.0),
     (10.0, 60, 0.95, 0.2)],
)
def test_fluxes_of_slabs_by_disort(slabs, tau: float, zenith: float, omega: float, albedo: float) -> None:
    case, field = disort(slabs, tau, zenith, omega, albedo)
    fluxes = field.fluxes()
    down = fluxes["down_bottom"][0] + fluxes["direct_bottom"][0]
    # DISORT is exact to .02 %, and so is our method but for the steps between its levels
    assert down == pytest.approx(float(case.flux_dir_bot + case.flux_dif_dn_bot), rel=0.0015)
    assert fluxes["up_top"][0] == pytest.approx(float(case.flux_up_top), rel=0.00082)


@pytest.mark.parametrize("upward", [True, False], ids=["from above", "from below"])
@pytest.mark.parametrize(("tau", "sza"), [(0.1, 80), (1.0, 60), (10.0, 0)])
def test_radiance_of_slabs_by_disort(slabs, upward: bool, tau: float, sza: int) -> None:
    """In the sun's plane, to 1 % rms."""
    case, field = disort(slabs, tau, sza, 1.0, 0.0)
    zenith = np.radians(case.view_zenith.values)
    direction = np.stack([np.sin(zenith), 0 * zenith, np.cos(zenith) * (-1 if upward else 1)], axis=-1)
    seen = field.view(Rays(np.array([0.0, 0.0, 1001.0 if upward else 0.0]), direction)).radiance[:, 0]
    truth = case["up_top" if upward else "dn_bot"].values[:, 0]
    assert np.sqrt(np.mean((seen - truth) ** 2)) / truth.mean() < 0.01


def cumulus(n: int = 16, seed: int = 3) -> np.ndarray:
    """A few blobs (nz, n, n) with empty margins, 1/m."""
    rng = np.random.default_rng(seed)
    z, y, x = np.mgrid[0:12, 0:n, 0:n]
    field = np.zeros((12, n, n))
    for _ in range(4):
        cz, cy, cx = rng.uniform(4, 8), *rng.uniform(4, n - 5, 2)
        field += 0.03 * np.exp(-((z - cz) ** 2 + (y - cy) ** 2 + (x - cx) ** 2) / 3.0)
    field[field < 0.002] = 0
    return field.astype(np.float32)


def test_turning_the_world_turns_the_light() -> None:
    """Scene, sun and rays turned by 90 degrees together."""
    cloud = cumulus()
    sun = toward(70.0, 40.0)
    d = sky_directions([0.0, 30.0, 60.0, 80.0], np.arange(5.0, 360.0, 30.0))
    n = cloud.shape[2]
    turned = np.stack([layer[::-1].T for layer in cloud])  # value at (x, y) moves to (-y, x)
    assert np.array_equal(turned[5, 3, n - 1 - 2], cloud[5, 2, 3])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    eye = np.array([60.0, -130.0, 1.0])
    options = dict(surface_albedo=0.3)
    one = Solver().solve(grid_scene(cloud, cloud.shape, (60.0,) * 3, **options), sun, [WAVELENGTH_NM])
    two = Solver().solve(grid_scene(turned, cloud.shape, (60.0,) * 3, **options), turn @ sun, [WAVELENGTH_NM])
    a, b = one.view(Rays(eye, d)), two.view(Rays(turn @ eye, d @ turn.T))
    np.testing.assert_allclose(a.transmittance, b.transmittance, atol=2e-3)
    # the 50 Lebedev ordinates turn into themselves; the rows of a sweep run along x in both, hence not to the digit
    np.testing.assert_allclose(a.radiance, b.radiance, atol=1e-4 * a.radiance.max(), rtol=3e-4)
    np.testing.assert_allclose(one.fluxes()["up_top"], two.fluxes()["up_top"], rtol=1e-4)


SMALL = (5, 4, 4)


@settings(max_examples=8, deadline=None, database=None, derandomize=True)
@given(
    seed=st.integers(0, 1000),
    thickness=st.sampled_from([1e-5, 1e-3, 0.05, 1.0]),
    cover=st.floats(0.05, 1.0),
    curved=st.booleans(),
    air=st.booleans(),
    name=st.sampled_from(["fast", "swim"]),
    azimuth=st.floats(0, 360),
    altitude=st.floats(-2.0, 90.0),
    albedo=st.floats(0.0, 1.0),
    hills=st.booleans(),
)
def test_no_light_is_negative_or_lost(
    seed, thickness, cover, curved, air, name, azimuth, altitude, albedo, hills
) -> None:
    """Whatever the little scene, radiance is finite and not negative, and the ground gets no more than there is."""
    rng = np.random.default_rng(seed)
    cloud = np.where(rng.random(SMALL) < cover, rng.random(SMALL) * thickness, 0.0)
    terrain = rng.random(SMALL[1:]) * 300.0 * hills
    scene = grid_scene(
        cloud, SMALL, (500.0, 500.0, 200.0), curved, air, surface_albedo=albedo, terrain_m=terrain
    )
    sun = toward(azimuth, altitude)
    field = Solver(name).solve(scene, sun, [615.0, 450.0])
    d = np.concatenate([sky_directions([0, 45, 80, 89.9], [0.0, 100.0, 250.0]), [[0, 0, -1.0], [0.7, 0, -0.71]], [sun]])
    for height in (305.0, 5000.0):
        view = field.view(Rays(np.array([10.0, -20.0, height]), d / np.linalg.norm(d, axis=1, keepdims=True)))
        assert np.isfinite(view.radiance).all()
        assert (view.radiance >= 0).all()
        assert (view.transmittance >= 0).all()
        assert (view.transmittance <= 1 + 1e-5).all()
        # the phase function's forward peak, (1 + g)/(1 - g)^2 = 82 for HG .85, bounds single scattering; two more
        # orders and the haze's own peak double it
        assert view.radiance.max() < 200
    for name_, flux in field.fluxes().items():
        assert np.isfinite(flux).all(), name_
        assert (flux >= 0).all(), name_
        # lit from the side, a small domain catches more than its top takes: bounded by the whole beam
        assert (flux < 1.5).all(), name_


EMPTY_SUN = toward(140.0, 25.0)


@pytest.fixture(scope="module", params=[False, True], ids=["molecules", "haze"])
def empty_and_none(request) -> tuple[Field, Field]:
    """A domain without a cloud, 4 km high, and the same sky without a domain."""
    atmosphere = Atmosphere.us_standard() if request.param else Atmosphere.us_standard(aerosol=None)
    gridded = grid_scene(
        {}, (41, 9, 9), (500.0, 500.0, 100.0), curved=True, atmosphere=atmosphere, surface_albedo=0.3
    )
    plain = Scene.clear(LAT, LON, atmosphere, surface_albedo=0.3)
    with_grid, without = (Solver().solve(scene, EMPTY_SUN, [615.0, 450.0]) for scene in (gridded, plain))
    return with_grid, without


@pytest.mark.parametrize("near_the_sun", [False, True], ids=["open sky", "aureole"])
def test_an_empty_grid_changes_nothing(empty_and_none, near_the_sun: bool) -> None:
    """Linear interpolation between nodes 100 m high and 500 m wide, and 50 ordinates: 1.1 % everywhere (in haze 1.08,
    with 110 ordinates .83), half of that in the mean."""
    d = sky_directions([0.0, 30.0, 50.0, 60.0, 70.0, 80.0, 88.0], np.arange(5.0, 360.0, 15.0))
    d = d[(d @ EMPTY_SUN > np.cos(np.radians(25.0))) == near_the_sun]
    a, b = (field.view(Rays(np.array([0.0, 0.0, 2.0]), d)) for field in empty_and_none)
    np.testing.assert_allclose(a.transmittance, b.transmittance, rtol=0.01)
    np.testing.assert_allclose(a.radiance, b.radiance, rtol=0.011)
    assert np.abs(np.mean(a.radiance / b.radiance - 1, axis=0)).max() < 0.0055


def test_an_empty_grid_takes_no_light_from_the_ground(empty_and_none) -> None:
    with_grid, without = (field.fluxes() for field in empty_and_none)
    a, b = (f["down_bottom"] + f["direct_bottom"] for f in (with_grid, without))
    np.testing.assert_allclose(a, b, rtol=0.01)


def test_direct_flux_is_what_a_ray_to_the_sun_lets_through(empty_and_none) -> None:
    """The eye ray integrates the whole depth by itself: mu0 e^-tau, in the grid and without one."""
    to_the_sun = Rays(np.array([[0.0, 0.0, 1.0]]), EMPTY_SUN[None])
    for field in empty_and_none:
        expected = EMPTY_SUN[2] * field.view(to_the_sun).transmittance[0]
        np.testing.assert_allclose(field.fluxes()["direct_bottom"], expected, rtol=0.01)


@pytest.fixture(scope="module")
def three_wavelengths() -> tuple[Scene, Field]:
    scene = grid_scene(cumulus(12), (12, 12, 12), (100.0,) * 3, curved=True, air=True, surface_albedo=0.2)
    return scene, Solver().solve(scene, toward(200.0, 35.0), [615.0, 546.0, 450.0])


@pytest.mark.parametrize("others", [[546.0], [700.0, 615.0, 546.0, 500.0, 450.0]], ids=["one", "five"])
def test_wavelengths_do_not_know_of_each_other(three_wavelengths, others: list[float]) -> None:
    scene, three = three_wavelengths
    field = Solver().solve(scene, toward(200.0, 35.0), others)
    rays = Rays(np.array([100.0, 50.0, 2.0]), sky_directions([0.0, 40.0, 75.0], np.arange(0.0, 360.0, 60.0)))
    a, b = field.view(rays), three.view(rays)
    assert a.radiance.shape == (len(rays), len(others))
    for w, wavelength in enumerate(three.wavelengths_nm):
        if wavelength in others:
            n = others.index(wavelength)
            # iterations start from the wavelength before and stop at 1e-2 of the field
            np.testing.assert_allclose(a.radiance[:, n], b.radiance[:, w], rtol=0.015, atol=1e-3)
            # those that travel together share the parts of their steps
            np.testing.assert_allclose(a.transmittance[:, n], b.transmittance[:, w], rtol=2.3e-4, atol=1e-6)
            assert field.fluxes()["up_top"][n] == pytest.approx(three.fluxes()["up_top"][w], rel=0.01)


def test_wavelengths_apart_in_a_thin_field() -> None:
    """As above where sweeps converge fast: 1 % of the field at most between one wavelength and three."""
    scene = grid_scene(0.1 * cumulus(12), (12, 12, 12), (100.0,) * 3, curved=True, air=True, surface_albedo=0.2)
    rays = Rays(np.array([10.0, 50.0, 2.0]), sky_directions([0.0, 40.0, 75.0], np.arange(0.0, 360.0, 60.0)))
    one, three = (Solver().solve(scene, toward(200.0, 35.0), w) for w in ([450.0], [615.0, 546.0, 450.0]))
    np.testing.assert_allclose(one.view(rays).radiance[:, 0], three.view(rays).radiance[:, 2], rtol=0.01)


def test_a_view_does_not_change_the_next(three_wavelengths) -> None:
    _, field = three_wavelengths
    d = sky_directions([20.0, 70.0], np.arange(0.0, 360.0, 60.0))
    here = Rays(np.array([0.0, 0.0, 2.0]), d)
    first = field.view(here).radiance
    field.view(Rays(np.array([500.0, 0.0, 4000.0]), -d))
    np.testing.assert_array_equal(field.view(here).radiance, first)


def test_aerosol_species_and_clouds_may_share_a_scene() -> None:
    fields = {name: cumulus(10, seed) for name, seed in (("mist", 1), ("smoke", 2))}
    scene = grid_scene(
        fields, (12, 10, 10), (60.0,) * 3, single_scattering_albedo={"mist": 1.0, "smoke": 0.6}, surface_albedo=0.1
    )
    view = Solver().solve(scene, toward(10.0, 40.0), [WAVELENGTH_NM]).view(
        Rays(np.array([0.0, 0.0, 1.0]), sky_directions([0.0, 30.0, 50.0], np.arange(0.0, 360.0, 45.0)))
    )
    assert view.species_depth.shape[1] == 2
    # the two depths make the transmittance, to what a thick ray's cut-off leaves
    np.testing.assert_allclose(
        view.transmittance[:, 0], np.exp(-view.species_depth.astype(float).sum(axis=1)), atol=2e-3
    )


PHASES = [
    HenyeyGreenstein(-0.6), DoubleHenyeyGreenstein(0.7, -0.7, 0.45), DoubleHenyeyGreenstein(0.7, -0.7, 0.55),
    HenyeyGreenstein(0.0), HenyeyGreenstein(0.85),
]  # fmt: skip


def at_angles_from(sun: np.ndarray, *angles_deg: float) -> np.ndarray:
    """Directions (n, 3) by their angle from the sun in the north, to its south and on."""
    angle = np.radians(angles_deg)[:, None]
    return np.cos(angle) * sun + np.sin(angle) * np.array([0.0, -sun[2], sun[1]])


@pytest.mark.parametrize("phase", PHASES, ids=str)
def test_what_is_scattered_once_is_exact(phase: PhaseFunction) -> None:
    """In a thin box that absorbs what is scattered twice: integral of k omega P exp(-tau)."""
    omega, sun, centre = 0.02, toward(0, 60), np.array([0.0, 0.0, 400.0])
    cloud = box((9, 9, 9), (slice(3, 6),) * 3, 3e-4)
    field = Solver().solve(
        grid_scene(cloud, cloud.shape, single_scattering_albedo=omega, phase=phase), sun, [WAVELENGTH_NM]
    )
    nodes = 100.0 * np.arange(9)
    cloud_at = RegularGridInterpolator((nodes, nodes - 400, nodes - 400), cloud, bounds_error=False, fill_value=0.0)
    for ray in at_angles_from(sun, 180, 120, 80, 60, 20, 5):
        seen = field.view(Rays(centre - 390 * ray, ray[None])).radiance[0, 0]
        along = centre + np.arange(-400.0, 400.0, 4.0)[:, None] * ray
        to_sun = along[:, None] + np.arange(0.0, 600.0, 4.0)[:, None] * sun
        depth = 4 * (np.cumsum(cloud_at(along[:, ::-1])) + cloud_at(to_sun[..., ::-1]).sum(axis=1))
        exact = 4 * omega * phase.value(ray @ sun) * (cloud_at(along[:, ::-1]) * np.exp(-depth)).sum()
        assert seen == pytest.approx(exact, rel=0.03)


@pytest.mark.parametrize("phase", PHASES, ids=str)
def test_what_aerosol_scatters_once_is_exact(phase: PhaseFunction) -> None:
    """Against aerosol that scatters evenly, where there is next to nothing else."""
    sun = toward(0, 60)

    def sky(albedo: float, phase: PhaseFunction) -> np.ndarray:
        aerosol = AerosolProfile(0.05, 0.0, single_scattering_albedo=albedo, phase=phase)
        air = Atmosphere.us_standard(ozone_du=0.0, aerosol=aerosol)
        thin = replace(air, pressure_pa=0.02 * air.pressure_pa)
        field = Solver().solve(Scene.clear(LAT, LON, thin, surface_albedo=0.0), sun, [1060.0])  # no band of gases
        return field.view(Rays(np.array([0.0, 0.0, 10.0]), rays)).radiance[:, 0]

    rays, even = at_angles_from(sun, 110, 80, 60, 20, 5), HenyeyGreenstein(0.0)
    without = sky(0.0, even)
    ratio = (sky(0.02, phase) - without) / (sky(0.02, even) - without)
    np.testing.assert_allclose(ratio, phase.value(rays @ sun), rtol=0.03)


def test_unknown_solvers_are_refused() -> None:
    with pytest.raises(UserError, match="fast"):
        Solver("fats")


@pytest.mark.parametrize(
    "options",
    [
        {"step": 0.0}, {"step": -1.0}, {"step": np.nan}, {"step": np.inf}, {"tolerance": np.nan}, {"tolerance": 0.0},
        {"most_sweeps": 0}, {"name": "reference", "seconds": np.nan}, {"name": "reference", "seconds": 0.0},
    ],
)  # fmt: skip
def test_options_that_lead_nowhere_are_refused(options: dict) -> None:
    with pytest.raises(UserError, match=f"^{list(options)[-1]} = .*give") as caught:
        Solver(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("wavelengths", [[], [0.55], [np.nan], [5000.0]])
def test_wavelengths_out_of_range_are_refused(wavelengths: list[float]) -> None:
    with pytest.raises(UserError, match="nm"):
        Solver().solve(Scene.clear(LAT, LON), sun_at_zenith_angle(30.0), wavelengths)


def absorbing(albedo: object) -> Scene:
    cloud = np.zeros((6, 8, 8))
    cloud[2:4, 2:6, 2:6] = 0.01
    return grid_scene(cloud, cloud.shape, (200.0, 200.0, 300.0), single_scattering_albedo=albedo)


@pytest.mark.parametrize("name", ["swim", "fast", "reference"])
@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_a_list_of_albedos_is_one_for_each_wavelength_asked_for(name: str, count: int) -> None:
    """However many are solved for side by side."""
    wavelengths, albedos = [650.0, 450.0, 550.0, 500.0, 600.0][:count], [0.9, 0.8, 1.0, 0.6, 0.7][:count]
    solver, sun = Solver(name, paths=8 if name == "reference" else None), toward(180, 45)
    rays = Rays(np.array([0.0, 0.0, 5e3]), np.array([[0.05, 0.0, -1.0], [0.0, 0.1, -1.0]]))
    by_list, by_wavelength = (
        solver.solve(absorbing(given), sun, wavelengths).view(rays).radiance
        for given in (albedos, dict(zip(wavelengths, albedos, strict=True)))
    )
    np.testing.assert_array_equal(by_list, by_wavelength)
    assert (np.argsort(by_list, axis=1) == np.argsort(albedos)).all()
    with pytest.raises(UserError, match=f"{count + 1} single-scattering albedos for {count} wavelengths"):
        solver.solve(absorbing([*albedos, 0.5]), sun, wavelengths)


def test_lists_of_albedos_of_wider_scenes_too() -> None:
    cloud = np.zeros((4, 8, 8))
    cloud[1:3, 2:6, 2:6] = 0.01
    inner, wider = (
        grid_scene(cloud, cloud.shape, (cell, cell, 200.0), True, single_scattering_albedo=[0.9, 0.5])
        for cell in (200.0, 600.0)
    )
    inner.wider = wider
    field = Solver().solve(inner, np.array([0.0, 0.0, 1.0]), [650.0, 450.0])
    (pack,) = field.packs
    for level in pack.levels:
        assert level.medium.species[0].single_scattering_albedo.tolist() == [0.9, 0.5, 0.5, 0.5]
    wider.optics = absorbing(np.full(4, 0.5)).optics
    with pytest.raises(UserError, match="4 single-scattering albedos for 2 wavelengths"):
        Solver().solve(inner, np.array([0.0, 0.0, 1.0]), [650.0, 450.0])


def test_rays_must_share_something(three_wavelengths) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(UserError, match="split them"):
        three_wavelengths[1].view(Rays(rng.random((4, 3)) * 100, rng.normal(size=(4, 3))))
