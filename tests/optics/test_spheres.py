"""Mie theory of size distributions against its limits, and irregular particles against measured dust."""

import sys
from importlib.util import find_spec

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.optics import irregular
from openswim.optics.spheres import Mode, Sizes, gamma_sizes, lognormal_sizes, scattering_by_spheres
from openswim.scene.phase import Rayleigh

pytestmark = pytest.mark.skipif(find_spec("miepython") is None, reason="no miepython")


def single(radius_um):
    return Sizes(np.array([radius_um]), np.array([1.0]))


def test_rayleigh_limit():
    """Small spheres: 3/4 (1 + mu^2) and an efficiency ~ wavelength^-4 (Bohren & Huffman 1983, Sect. 5.1)."""
    blue, red = (scattering_by_spheres(single(1e-3), 1.5, wl) for wl in (400.0, 800.0))
    mu = np.cos(np.radians(blue.angle_deg))
    np.testing.assert_allclose(blue.value, Rayleigh(0.0).value(mu), rtol=2e-3)
    assert blue.efficiency / red.efficiency == pytest.approx(16, rel=2e-3)
    x = 2 * np.pi * 1e-3 / 0.4
    assert blue.efficiency == pytest.approx(8 / 3 * x**4 * ((1.5**2 - 1) / (1.5**2 + 2)) ** 2, rel=2e-3)


def test_large_particles_extinguish_twice_their_shadow():
    """2 plus an edge of 2.0 x^-2/3 (van de Hulst 1957; Nussenzveig & Wiscombe 1980)."""
    for radius in (20.0, 100.0):
        sizes = gamma_sizes(radius, 0.1, radius / 12, 3 * radius, 300)
        x = 2 * np.pi * radius / 0.55
        found = scattering_by_spheres(sizes, 1.33, 550.0, [0.0, 90.0, 180.0])
        assert found.efficiency - 2 == pytest.approx(1.99 * x ** (-2 / 3), rel=0.12)


@pytest.mark.parametrize("irregular_shape", [False, True])
def test_energy(irregular_shape):
    """Without absorption everything is scattered, and the phase function's mean is 1 before any scaling."""
    found = scattering_by_spheres(lognormal_sizes([Mode(0.2, 1.8)], 100), 1.5, 550.0, irregular=irregular_shape)
    angle = np.radians(np.linspace(0, 180, 20001))
    value = np.exp(np.interp(angle, np.radians(found.angle_deg), np.log(found.value)))
    assert found.single_scattering_albedo == pytest.approx(1, abs=1e-12)
    assert 0.5 * np.trapezoid(value * np.sin(angle), angle) == pytest.approx(1, abs=3e-3)


def test_asymmetry_is_the_one_of_the_series():
    """The moment of the values against the sum over a_n and b_n, which never looks at an angle."""
    sizes = lognormal_sizes([Mode(0.15, 1.6)], 60)
    found = scattering_by_spheres(sizes, 1.45 - 0.01j, 550.0)
    import miepython

    rows = [miepython.efficiencies_mx(1.45 - 0.01j, 2 * np.pi * r / 0.55) for r in sizes.radius_um]
    area = sizes.number * sizes.radius_um**2
    q_sca, g = np.array([(row[1], row[3]) for row in rows]).T
    assert found.phase.asymmetry == pytest.approx((area * q_sca * g).sum() / (area * q_sca).sum(), abs=1e-3)
    assert found.single_scattering_albedo == pytest.approx((area * q_sca).sum() / (area @ [r[0] for r in rows]))


@pytest.mark.parametrize("by", ["number", "volume"])
def test_effective_radius_of_a_lognormal(by):
    """r exp(2.5 s^2) of the number's median radius, r exp(-s^2 / 2) of the volume's."""
    s = np.log(1.8)
    expected = 0.3 * np.exp(2.5 * s**2 if by == "number" else -0.5 * s**2)
    assert lognormal_sizes([Mode(0.3, 1.8, 2.0, by)]).effective_radius_um == pytest.approx(expected, rel=0.01)


def test_sizes_that_would_take_hours_are_refused():
    with pytest.raises(UserError, match="radii up to"):
        lognormal_sizes([Mode(1000.0, 3.0)])


def test_only_the_ratio_of_amounts_counts():
    one = lognormal_sizes([Mode(0.1, 1.5, 1.0), Mode(1.0, 2.0, 0.01)], 50)
    ten = lognormal_sizes([Mode(0.1, 1.5, 10.0), Mode(1.0, 2.0, 0.1)], 50)
    np.testing.assert_allclose(ten.number, 10 * one.number)


def test_the_sign_of_absorption_is_the_users_choice():
    values = [scattering_by_spheres(single(0.3), 1.5 + k, 550.0).value for k in (0.01j, -0.01j)]
    np.testing.assert_array_equal(*values)


def test_irregular_dust_has_neither_bow_nor_glory():
    """Volten et al. (2001): flat from 120 degrees on; Mueller et al. (2007): lidar ratio 55 (40-70) sr."""
    sizes = lognormal_sizes([Mode(0.12, np.exp(0.49), 0.03, "volume"), Mode(1.9, np.exp(0.63), 0.45, "volume")], 200)
    sphere, dust = (scattering_by_spheres(sizes, 1.48 + 0.0016j, 550.0, irregular=i) for i in (False, True))
    value = dust.phase.value(np.cos(np.radians([30, 120, 150, 173, 180])))
    assert 0.07 < value[1] / value[0] < 0.14
    assert value[1:].max() < 1.35 * value[1:].min()
    assert 40 < 4 * np.pi / (value[-1] * dust.single_scattering_albedo) < 70
    assert dust.phase.asymmetry == pytest.approx(sphere.phase.asymmetry, abs=0.01)
    assert dust.single_scattering_albedo == sphere.single_scattering_albedo


def test_irregular_part_has_the_asymmetry_it_is_given():
    theta = np.linspace(0, np.pi, 4001)
    for g in (0.0, 0.4, 0.8):
        value = irregular.exponential(theta, g)
        mean, cosine = (0.5 * np.trapezoid(value * np.sin(theta) * f, theta) for f in (1.0, np.cos(theta)))
        assert mean == pytest.approx(1, abs=1e-4)
        assert cosine == pytest.approx(g, abs=1e-3)


def test_fresnel_at_normal_and_grazing_incidence():
    np.testing.assert_allclose(irregular.fresnel_reflectance(np.array([0.0, np.pi]), 1.5), [1.0, 0.04], atol=1e-12)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Mode(0.0, 1.5),
        lambda: Mode(0.1, 1.0),
        lambda: Mode(0.1, 1.5, -1.0),
        lambda: Mode(0.1, 1.5, 1.0, "mass"),
        lambda: lognormal_sizes([]),
        lambda: scattering_by_spheres(single(1.0), 0.0 + 1j, 550.0),
    ],
)
def test_refuses_nonsense(make):
    with pytest.raises(UserError):
        make()


def test_one_line_where_miepython_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "miepython", None)
    with pytest.raises(UserError, match=r"pip install 'openswim\[mie\]'"):
        scattering_by_spheres(single(1.0), 1.5, 550.0)
