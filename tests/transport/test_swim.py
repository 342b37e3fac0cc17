"""The paper's equations by hand (numbers worked out from the corrected forms of Albers et al. 2020)."""

import numpy as np
import pytest
from tests.transport.scenes import WAVELENGTH_NM, slab, sun_at_zenith_angle

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.swim.phase import henyey_greenstein, sunlit_phase, thin_phase

ANGLE = np.linspace(0, np.pi, 2_000_001)
MU = np.cos(ANGLE)


def sphere_mean(values: np.ndarray) -> float:
    return float(np.trapezoid(values * np.sin(ANGLE), ANGLE) / 2)


@pytest.mark.parametrize("g", [-0.6, 0.0, 0.6, 0.95, 0.999])
def test_henyey_greenstein_means_one_and_g(g: float) -> None:
    values = henyey_greenstein(MU, g)
    assert sphere_mean(values) == pytest.approx(1.0, abs=1e-4)
    assert sphere_mean(values * MU) == pytest.approx(g, abs=1e-4)


@pytest.mark.parametrize("kind", ["liquid", "rain", "ice", "snow", "graupel"])
@pytest.mark.parametrize("s", [1.0, 2.0, 5.0])
def test_thin_phases_scatter_all_they_take(kind: str, s: float) -> None:
    values = thin_phase(kind, MU, np.full_like(MU, s), 546.0)
    # Eqs 17-18, B1-B3: the weights sum to one for every optical depth
    assert sphere_mean(values) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(
    ("s", "mu", "by_hand"),
    [
        # s = 1: .8 p(.95) + .26 p(.6) + .02 p(-.6) - .08; sideways p(g) = (1 - g^2)/(1 + g^2)^1.5
        (1.0, 0.0, 0.8 * 0.0371549 + 0.26 * 0.4035247 + 0.02 * 0.4035247 - 0.08),
        # s = 2: f1 = .64 (Eq. 17 corrected: .8^s), lobes .95^2 = .9025 and .6^2 = .36
        (2.0, 0.0, 0.64 * 0.0758914 + 0.42 * 0.7249872 + 0.02 * 0.4035247 - 0.08),
        # forward, s = 1: p(g, 1) = (1 + g)/(1 - g)^2: 780, 10; backward lobe p(-.6, 1) = .4/1.6^2 = .15625
        (1.0, 1.0, 0.8 * 780.0 + 0.26 * 10.0 + 0.02 * 0.15625 - 0.08),
    ],
)
def test_thin_liquid_by_hand(s: float, mu: float, by_hand: float) -> None:
    assert float(thin_phase("liquid", np.array(mu), np.array(s), 546.0)) == pytest.approx(by_hand, rel=1e-5)


def test_asymmetry_of_thin_liquid_follows_the_wavelength() -> None:
    # Eq. 16: .945 / .950 / .955 at 615 / 546 / 450 nm
    ahead = [float(thin_phase("liquid", np.array(1.0), np.array(1.0), w)) for w in (615.0, 546.0, 450.0)]
    sharp = [0.8 * (1 + g) / (1 - g) ** 2 for g in (0.945, 0.950, 0.955)]
    np.testing.assert_allclose(np.diff(ahead), np.diff(sharp), rtol=1e-9)


@pytest.mark.parametrize(
    ("phase_angle", "by_hand"),
    [
        (0.0, 1.94),  # full phase: m = 0, (1 - cos 180)/2 = 1; twice that is about the 4 of a white wall
        # m(90) = -.09396 + 2.98647 - 2.051406 + .586422 = 1.427526; 1.94/10^(.4 m)/.5
        (90.0, 1.94 / 3.723847 / 0.5),
        # m(165) = 240.442 - 465.1581 + 228.42701 = 3.71091, (1 - cos 15)/2 = .0170371
        (165.0, 1.94 / 30.5045 / 0.0170371),
    ],
)
def test_sunlit_side_by_hand(phase_angle: float, by_hand: float) -> None:
    mu = np.cos(np.radians(180.0 - phase_angle))
    assert float(sunlit_phase(np.array(mu))) == pytest.approx(by_hand, rel=1e-4)


def test_sunlit_side_is_capped_near_the_sun() -> None:
    assert np.isfinite(sunlit_phase(MU)).all()
    assert sunlit_phase(MU).max() <= 12.0


def overcast(tau: float, zenith: float, levels: int = 257) -> Field:
    scene = slab(tau, levels=levels, kind="liquid", phase=HenyeyGreenstein(0.85))
    return Solver("swim").solve(scene, sun_at_zenith_angle(zenith), [WAVELENGTH_NM])


@pytest.mark.parametrize("zenith", [0.0, 60.0])
@pytest.mark.parametrize("tau", [2.0, 20.0])
def test_light_under_an_overcast_is_equation_four(tau: float, zenith: float) -> None:
    """T = 1/(1 + b tau_s) with the slant depth, b = .063 for liquid (Eqs 4-6 corrected)."""
    fluxes = overcast(tau, zenith).fluxes()
    mu0 = np.cos(np.radians(zenith))
    expected = mu0 / (1 + 0.063 * tau / mu0)
    assert fluxes["down_bottom"][0] + fluxes["direct_bottom"][0] == pytest.approx(expected, rel=2e-3)


def test_overcast_sky_is_three_times_brighter_overhead() -> None:
    """Eq. 20, (1 + 2 cos z)/3, where the cloud is thick."""
    field = overcast(60.0, 30.0, levels=513)
    z = np.array([0.0, 40.0, 60.0, 75.0])
    directions = np.stack([0 * z, np.sin(np.radians(z)), np.cos(np.radians(z))], axis=-1)
    seen = field.view(Rays(np.zeros(3), directions)).radiance[:, 0]
    # slanting rays look less high into the cloud, where it is darker by up to b x 2 depths of 1 + b tau: 3 %
    np.testing.assert_allclose(seen / seen[0], (1 + 2 * np.cos(np.radians(z))) / 3, rtol=0.05)


def test_overcast_sky_integrates_to_the_light_below_it() -> None:
    """The factor cos z0 that Eqs 6, 12, 20, 21 lose together: docs, errata "overcast GHI"."""
    for zenith in (20.0, 60.0):
        field = overcast(40.0, zenith, levels=513)
        g, w = np.polynomial.legendre.leggauss(12)
        mu, weight = (g + 1) / 2, w / 2
        directions = np.stack([np.sqrt(1 - mu**2), 0 * mu, mu], axis=-1)
        sideways = np.stack([0 * mu, np.sqrt(1 - mu**2), mu], axis=-1)
        sky = [field.view(Rays(np.zeros(3), d)).radiance[:, 0] for d in (directions, sideways)]
        flux = float((np.mean(sky, axis=0) * mu * weight).sum() / 2)
        # the sky is the light one or two optical depths above the ground: up to 2 b/mu0 of 1 + b tau/mu0 more
        assert flux == pytest.approx(field.fluxes()["down_bottom"][0], rel=0.07)


@pytest.mark.parametrize("levels", [33, 65])
def test_brightness_does_not_depend_on_how_finely_the_cloud_is_cut(levels: int) -> None:
    """Eq. 12 ends the integral at l = 2, also inside a cell thicker than that."""
    z = np.radians([0.0, 60.0, 75.0])
    rays = Rays(np.zeros(3), np.stack([0 * z, np.sin(z), np.cos(z)], axis=-1))
    coarse, fine = (overcast(40.0, 30.0, n).view(rays).radiance[:, 0] for n in (levels, 257))
    np.testing.assert_allclose(coarse, fine, rtol=0.05)


def test_clear_sky_of_swim_is_that_of_fast() -> None:
    scene = Scene.clear(40.0, 10.0)
    sun, rays = sun_at_zenith_angle(50.0), Rays(np.array([0, 0, 2.0]), sun_at_zenith_angle(10.0))
    swim, fast = (Solver(name).solve(scene, sun).view(rays).radiance for name in ("swim", "fast"))
    np.testing.assert_array_equal(swim, fast)
