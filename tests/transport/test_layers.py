"""Layers without sides: exact solutions, reciprocity, what must not matter."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein, Mixture
from openswim.solver import Solver
from openswim.transport.columns.discrete_ordinates import Layers, solve_layers
from openswim.transport.medium.levels import LAYERS_DEGREE, layer_levels

LAMBDA_NM = [550.0]


def toward(mu: float, azimuth_deg: float) -> NDArray[np.float64]:
    sine, azimuth = np.sqrt(1 - mu**2), np.radians(azimuth_deg)
    return np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), mu])


def layer(depth: float, omega: float, g: float, mu_sun: float, albedo: float = 0.0) -> tuple[Layers, np.ndarray]:
    """A homogeneous kilometre and its levels."""
    chi = g ** np.arange(LAYERS_DEGREE + 1.0)
    f = chi[-1]
    extinction = depth / 1000.0
    levels = layer_levels(np.linspace(0, 1000.0, 5), np.full(5, extinction), mu_sun)
    scaled = np.full(len(levels), extinction * (1 - omega * f))
    scattering = np.tile(extinction * omega * (chi[:-1] - f), (len(levels), 1))
    beam = np.exp(-scaled * (1000.0 - levels) / mu_sun)
    sun = toward(mu_sun, 0.0)
    return solve_layers(levels, scaled, scattering, beam, sun, albedo, mu_sun * beam[0]), levels


def leaving(depth: float, omega: float, g: float, mu_sun: float, mu: float, azimuth_deg: float) -> float:
    """Radiance out of the top, seen from above."""
    layers, levels = layer(depth, omega, g, mu_sun)
    source = layers.source(-toward(mu, azimuth_deg))
    extinction = depth / 1000.0 * (1 - omega * g**LAYERS_DEGREE)
    through = np.exp(-extinction * (1000.0 - levels) / mu)
    return float(np.trapezoid(source * through, levels) / mu)


def h_function(omega: float, mu: float) -> float:
    """Chandrasekhar's H for isotropic scattering, from its integral equation."""
    g, w = np.polynomial.legendre.leggauss(64)
    x, w = (g + 1) / 2, w / 2
    h = np.ones_like(x)
    for _ in range(300):
        h = 1 / (np.sqrt(1 - omega) + 0.5 * omega * ((w * x * h)[None] / (x[:, None] + x[None])).sum(axis=1))
    return float(1 / (np.sqrt(1 - omega) + 0.5 * omega * (w * x * h / (mu + x)).sum()))


@pytest.mark.parametrize(("mu_sun", "mu"), [(0.5, 0.7), (0.9, 0.3)])
def test_a_deep_isotropic_layer_by_chandrasekhar(mu_sun: float, mu: float) -> None:
    expected = 0.9 * mu_sun / (mu_sun + mu) * h_function(0.9, mu_sun) * h_function(0.9, mu)
    assert leaving(40.0, 0.9, 0.0, mu_sun, mu, 30.0) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("azimuth_deg", [0.0, 60.0, 180.0])
def test_sun_and_eye_may_change_places(azimuth_deg: float) -> None:
    """Reciprocity: L'/mu_sun is the same."""
    one = leaving(3.0, 0.98, 0.8, 0.4, 0.8, azimuth_deg) / 0.4
    other = leaving(3.0, 0.98, 0.8, 0.8, 0.4, azimuth_deg) / 0.8
    assert one == pytest.approx(other, rel=5e-3)


@pytest.mark.parametrize("mu_sun", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("depth", [0.01, 1.0, 30.0, 300.0])
def test_no_light_is_lost(depth: float, mu_sun: float) -> None:
    layers, _ = layer(depth, 1.0, 0.85, mu_sun)
    direct = mu_sun * np.exp(-depth * (1 - 0.85**LAYERS_DEGREE) / mu_sun)
    assert layers.up + layers.down + direct == pytest.approx(mu_sun, rel=5e-3)


def test_white_ground_gives_back_what_comes_down() -> None:
    layers, _ = layer(5.0, 1.0, 0.85, 0.5, albedo=1.0)
    assert layers.up == pytest.approx(0.5, rel=5e-3)


def test_levels_keep_the_given_ones_and_the_depth() -> None:
    levels = np.array([0.0, 100.0, 400.0, 500.0, 900.0, 1000.0])
    extinction = np.array([0.0, 0.0, 0.05, 0.02, 0.0, 0.0])
    finer = layer_levels(levels, extinction, 0.3)
    assert set(levels) <= set(finer)
    assert (np.diff(finer) > 0).all()
    depth = np.diff(finer) * np.interp(0.5 * (finer[1:] + finer[:-1]), levels, extinction)
    assert depth.max() < 1.0  # .5, or up to twice as much where the extinction rises from nothing
    assert np.trapezoid(np.interp(finer, levels, extinction), finer) == pytest.approx(
        np.trapezoid(extinction, levels), rel=1e-9
    )


def test_thick_layers_have_bounded_levels() -> None:
    assert len(layer_levels(np.linspace(0, 1000.0, 33), np.full(33, 3.0), 0.05)) <= 640


def flat(extinction: dict[str, np.ndarray], z: np.ndarray, **more) -> Scene:
    across = np.arange(3) * 1000.0
    fields = {name: np.tile(e[:, None, None], (1, 3, 3)).astype(np.float32) for name, e in extinction.items()}
    return Scene.from_arrays(fields, across, across, z, periodic=True, surface_albedo=0.2, **more)


def test_one_cloud_or_two_species_that_make_it_up() -> None:
    z = np.linspace(0, 1000.0, 21)
    whole = np.where(z > 400, 0.004, 0.0)
    sun, wl = toward(0.6, 20.0), LAMBDA_NM
    phase = HenyeyGreenstein(0.85)
    rays = Rays(np.array([0.0, 0.0, 0.0]), np.stack([toward(mu, 75.0) for mu in (0.2, 0.6, 0.95)]))
    one = Solver().solve(flat({"cloud": whole}, z, phase=phase), sun, wl).view(rays).radiance
    half = {"cloud": 0.5 * whole, "ice": 0.5 * whole}
    two = Solver().solve(flat(half, z, phase=phase), sun, wl).view(rays).radiance
    np.testing.assert_allclose(two, one, rtol=1e-3)


def test_every_ray_sees_its_own_direction() -> None:
    """Many rays at once, some alike, and each alone."""
    z = np.linspace(0, 1000.0, 11)
    field = Solver().solve(flat({"cloud": np.full(11, 2e-3)}, z), toward(0.6, 0.0), LAMBDA_NM)
    directions = np.stack([toward(mu, phi) for mu, phi in ((0.3, 0.0), (0.9, 90.0), (0.3, 0.0), (0.5, 180.0))])
    together = field.view(Rays(np.zeros(3), directions)).radiance
    alone = [field.view(Rays(np.zeros(3), d[None])).radiance[0] for d in directions]
    np.testing.assert_allclose(together, alone, rtol=1e-6)
    np.testing.assert_array_equal(together[0], together[2])


@pytest.mark.parametrize("depth", [0.03, 0.3, 3.0])
@pytest.mark.parametrize("asymmetry", [0.0, 0.85])
def test_a_cloud_between_clear_levels_is_one_on_the_ground(depth: float, asymmetry: float) -> None:
    """White, over black ground: what it takes of the sun leaves it, in the shares of an even layer as deep (up to 13 %
    did not, where it ends in vacuum)."""
    sun = toward(0.8, 20.0)
    phase = HenyeyGreenstein(asymmetry)
    levels = np.linspace(0.0, 2000.0, 41)
    cloud = np.zeros((41, 3, 3))
    cloud[16:24] = depth / 400.0  # half a level more above and below
    even = np.full((41, 3, 3), depth / 2000.0)
    across = 100.0 * np.arange(3)
    found = [
        Solver().solve(Scene.from_arrays(field, across, across, levels, periodic=True, phase=phase), sun, LAMBDA_NM)
        for field in (cloud, even)
    ]
    alone, layer = (field.fluxes() for field in found)
    taken = sun[2] - alone["direct_bottom"][0]
    assert alone["up_top"][0] + alone["down_bottom"][0] == pytest.approx(taken, rel=2e-3)
    for name, flux in layer.items():
        np.testing.assert_allclose(alone[name], flux, rtol=3e-3, err_msg=name)


def test_narrow_peaks_broaden_on_both_ways() -> None:
    """Thin cloud of large droplets, five degrees above a low sun and below it, where the ways to sun and eye differ in
    length: as if all narrow scatterings were on the sun's, 1.3 % too little and 1.8 % too much."""
    droplets = Mixture((0.5, 0.5), (HenyeyGreenstein(0.995), HenyeyGreenstein(0.73)))
    across = 31.25 * np.arange(4)
    scene = Scene.from_arrays(
        np.full((33, 4, 4), 3e-4, np.float32), across, across, 31.25 * np.arange(33), phase=droplets, periodic=True
    )
    up = Rays(np.zeros(3), np.stack([toward(np.cos(np.radians(zenith)), 0.0) for zenith in (70, 80)]))
    fast, truth = (
        Solver(name, **more).solve(scene, toward(np.cos(np.radians(75)), 0.0), LAMBDA_NM).view(up)
        for name, more in (("fast", {}), ("reference", {"paths": 200_000}))
    )
    assert (truth.sigma < 0.005 * truth.radiance).all()
    np.testing.assert_allclose(fast.radiance, truth.radiance, rtol=0.009)
