"""Quadrature rules against closed-form integrals over the sphere; harmonics against their definition."""

import math

import numpy as np
import pytest
from numpy.polynomial.legendre import legval

from openswim.transport.engine.ordinates import (
    double_gauss,
    harmonic_matrix,
    hemisphere_product,
    lebedev,
    ordinates_for,
)

EXACT = 1e-12


def odd_factorial(n: int) -> int:
    return math.prod(range(n, 0, -2))


def monomial(a: int, b: int, c: int) -> float:
    """Integral of x^a y^b z^c over the unit sphere."""
    if a % 2 or b % 2 or c % 2:
        return 0.0
    top = odd_factorial(a - 1) * odd_factorial(b - 1) * odd_factorial(c - 1)
    return 4 * math.pi * top / odd_factorial(a + b + c + 1)


@pytest.mark.parametrize(("count", "degree"), [(14, 5), (26, 7), (50, 11), (110, 17)])
def test_lebedev_rules_are_exact_to_their_degree(count: int, degree: int) -> None:
    q, w = lebedev(count)
    assert len(w) == count
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=EXACT)
    for a in range(degree + 1):
        for b in range(degree + 1 - a):
            for c in range(degree + 1 - a - b):
                ours = (w * q[:, 0] ** a * q[:, 1] ** b * q[:, 2] ** c).sum()
                assert ours == pytest.approx(monomial(a, b, c), abs=EXACT), (a, b, c)


@pytest.mark.parametrize(("mu_count", "azimuth_count"), [(4, 9), (6, 10), (1, 3)])
def test_double_gauss_fluxes_are_exact(mu_count: int, azimuth_count: int) -> None:
    q, w = double_gauss(mu_count, azimuth_count)
    mu = q[:, 2]
    assert np.abs(mu).min() > 0.01  # none level
    for half in (mu > 0, mu < 0):
        assert w[half].sum() == pytest.approx(2 * math.pi, abs=EXACT)
        for power in range(1, 2 * mu_count):  # a half-range Gauss rule of n nodes: degree 2n - 1
            exact = 2 * math.pi / (power + 1)
            assert (w * np.abs(mu) ** power)[half].sum() == pytest.approx(exact, abs=EXACT)
    assert np.abs(w @ q).max() < EXACT


@pytest.mark.parametrize(
    ("rule", "degree"),
    # products of two harmonics have degree 2 (degree - 1): 4 Gauss nodes reach 7, so l < 4 there
    [(lebedev(14), 3), (lebedev(26), 4), (lebedev(50), 5), (lebedev(110), 8), (double_gauss(3, 5), 3),
     (double_gauss(6, 10), 5), (double_gauss(4, 9), 4), (double_gauss(5, 11), 5)],
    ids=["lebedev14", "lebedev26", "lebedev50", "lebedev110", "gauss3x5", "gauss6x10", "gauss4x9", "gauss5x11"],
)
def test_harmonics_are_orthonormal_under_the_rules(rule, degree: int) -> None:
    y = harmonic_matrix(rule.direction, degree)
    np.testing.assert_allclose((y * rule.weight[:, None]).T @ y, np.eye(degree**2), atol=EXACT)


def test_harmonics_to_degree_two_are_the_textbook_ones() -> None:
    v = np.random.default_rng(1).normal(size=(20, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    x, y, z = v.T
    one = np.sqrt(3 / (4 * np.pi))
    two = np.sqrt(15 / (4 * np.pi))
    textbook = [
        0 * x + np.sqrt(1 / (4 * np.pi)),
        *(one * y, one * z, one * x),
        *(two * x * y, two * y * z, np.sqrt(5 / (16 * np.pi)) * (3 * z**2 - 1), two * x * z),
        two / 2 * (x**2 - y**2),
    ]
    ours = harmonic_matrix(v, 3)
    for column, expected in zip(ours.T, textbook, strict=True):
        # the sign of odd m is a convention (Condon-Shortley), one for all directions
        sign = np.sign(column[0] * expected[0])
        np.testing.assert_allclose(column, sign * expected, atol=EXACT)


def test_addition_theorem() -> None:
    v = np.random.default_rng(2).normal(size=(12, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    y = harmonic_matrix(v, 6)
    for ell in range(6):
        part = slice(ell * ell, (ell + 1) ** 2)
        legendre = legval(np.clip(v @ v.T, -1, 1), [0] * ell + [(2 * ell + 1) / (4 * np.pi)])
        np.testing.assert_allclose(y[:, part] @ y[:, part].T, legendre, atol=1e-11)


def test_product_rule_of_the_shells_counts_both_sides_of_the_sun() -> None:
    mu, azimuth, weight = hemisphere_product(8, 10)
    assert weight.sum() == pytest.approx(4 * math.pi, abs=EXACT)
    assert (azimuth > 0).all()
    assert (azimuth < math.pi).all()
    assert (weight * mu)[mu > 0].sum() == pytest.approx(math.pi, abs=EXACT)
    x = np.sqrt(1 - mu**2) * np.cos(azimuth)
    assert (weight * x).sum() == pytest.approx(0.0, abs=EXACT)
    assert (weight * x**2).sum() == pytest.approx(4 * math.pi / 3, abs=EXACT)


@pytest.mark.parametrize("count", [50, 110])
@pytest.mark.parametrize("cell_m", [50.0, 1000.0, 1e8])
def test_whatever_the_cells_the_ordinates_cover_the_sphere(cell_m: float, count: int) -> None:
    q, w = ordinates_for((cell_m, cell_m), np.arange(0.0, 1001.0, 50.0), count)
    assert w.sum() == pytest.approx(4 * math.pi, abs=1e-9)
    assert np.abs(w @ q).max() < EXACT
    if cell_m > 50:  # flat cells: exact half-range flux
        assert (w * q[:, 2])[q[:, 2] > 0].sum() == pytest.approx(math.pi, abs=EXACT)
