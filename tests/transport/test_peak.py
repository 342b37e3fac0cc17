"""The broadened forward peak: its Legendre moments are known in closed form."""

import numpy as np
import pytest
from numpy.polynomial.legendre import legval

from openswim.optics import mie
from openswim.optics.displays import crystals, droplets
from openswim.scene.phase import DoubleHenyeyGreenstein, HenyeyGreenstein, Mixture, PhaseFunction, Rayleigh
from openswim.transport.march.forward_peak import angles, peak_row, peak_table, peak_tables

M = 5
G = 0.85
U = np.arange(3601) / 3600
ANGLE = np.pi * U**2 * (25 / 24) / (U + 1 / 24)


def depth_of(column: int) -> float:
    u = column / 31
    return u / (1 - u)


def broadened(phase: PhaseFunction) -> np.ndarray:
    """The peak over f, which has a mean of 1 over the sphere before it is broadened."""
    return peak_table(phase, M) / phase.moments(M + 1)[M]


def moment(values: np.ndarray, ell: int) -> float:
    """Legendre moment of a function of the table's angles: mean of f P_l over the sphere."""
    fine = np.linspace(0, np.pi, 200_001)
    f = np.interp(fine, ANGLE, values) * legval(np.cos(fine), [0] * ell + [1])
    return float(np.sum(f * np.sin(fine)) * (fine[1] - fine[0]) / 2)


@pytest.mark.parametrize("column", [0, 3, 15, 28])
@pytest.mark.parametrize("ell", [0, 1, 4, 6, 9])
def test_moments_of_the_broadened_peak(column: int, ell: int) -> None:
    p = 1.0 if ell < M else G ** (ell - M)
    phi = depth_of(column)
    # p of a single scattering; of n it is p^n, and each of them is at the point with a chance of 1/n
    expected = (np.exp(-phi * (1 - p)) - np.exp(-phi)) / phi if phi else p
    # linear interpolation of a peak between the table's angles
    assert moment(broadened(HenyeyGreenstein(G))[:, column].astype(float), ell) == pytest.approx(
        expected, abs=4e-3
    )


@pytest.mark.parametrize("column", [1, 8, 16, 25])
def test_peaks_narrower_than_their_moments_draw_no_rings(column: int) -> None:
    """Ice: the series goes on far beyond the moments that are summed. Beyond a degree or two that must not show."""
    g, phi = 0.998, depth_of(column)
    ell = np.arange(9000)
    p = np.where(ell < M, 1.0, g ** np.maximum(ell - M, 0.0))
    wide = slice(132, 1200, 21)  # 2.8 to 55 degrees
    # less what is delta-like at any depth, whose sum is known: p exp(-phi), a Henyey-Greenstein peak
    series = (2 * ell + 1) * ((np.exp(-phi * (1 - p)) - np.exp(-phi)) / phi - p * np.exp(-phi))
    single = broadened(HenyeyGreenstein(g))[wide, 0].astype(float)
    exact = legval(np.cos(ANGLE[wide]), series) + single * np.exp(-phi)
    np.testing.assert_allclose(broadened(HenyeyGreenstein(g))[wide, column], exact, rtol=0.03, atol=2e-3 * exact[0])


def test_column_zero_restores_the_phase_function() -> None:
    phase = HenyeyGreenstein(G)
    f = G**M
    low = legval(np.cos(ANGLE), [(2 * ell + 1) * (G**ell - f) for ell in range(M)])
    exact = (1 - G**2) / (1 + G**2 - 2 * G * np.cos(ANGLE)) ** 1.5
    table = peak_table(phase, M)[:, 0].astype(float)
    np.testing.assert_allclose(low + table, exact, rtol=1e-5, atol=1e-5)


def test_far_in_only_the_truncated_delta_is_left() -> None:
    """Of depth 30 on the light, which is spread over as many scatterings, has no other moments."""
    expected = legval(np.cos(ANGLE), [2 * ell + 1.0 for ell in range(M + 1)])  # p_M = chi_M/f = 1 too
    far = depth_of(30) * broadened(HenyeyGreenstein(G))[:, 30]
    np.testing.assert_allclose(far, expected, atol=0.02 * expected.max())
    assert abs(broadened(HenyeyGreenstein(G))[:, -1]).max() < 1e-4


def test_the_peak_loses_height_with_depth() -> None:
    forward = broadened(HenyeyGreenstein(G))[0]
    assert (np.diff(forward) < 0).all()


def test_smooth_phase_functions_have_no_peak() -> None:
    np.testing.assert_allclose(peak_table(Rayleigh(), M), 0.0, atol=1e-6)


@pytest.mark.parametrize("forward_fraction", [0.0, 0.45, 0.5, 0.501, 0.6])
def test_what_is_not_a_forward_peak_is_left_whole(forward_fraction: float) -> None:
    """Backward lobes: chi_M is below 0, or far below the next moments."""
    phase = DoubleHenyeyGreenstein(0.7, -0.7, forward_fraction)
    table, chi = peak_table(phase, M).astype(float), phase.moments(M + 1)
    f = max(chi[M], 0.0)
    low = legval(np.cos(ANGLE), [(2 * ell + 1) * (chi[ell] - f) for ell in range(M)])
    np.testing.assert_allclose(low + table[:, 0], phase.value(np.cos(ANGLE)), rtol=1e-5, atol=1e-5)
    assert np.abs(table).max() < 1.01 * np.abs(table[:, 0]).max()  # at any depth
    if forward_fraction <= 0.5:
        np.testing.assert_array_equal(table, table[:, :1] * np.ones(32))


@pytest.mark.parametrize(("phase", "first", "last", "bound"), [
    (mie.phase_function("rain", 546.0), 120.0, 145.0, 0.016),
    (droplets.phase_function(546.0, 10e-6, 0.01), 0.5, 10.0, 0.018),
    (droplets.phase_function(546.0, 10e-6, 0.01), 170.0, 180.0, 0.007),
    (crystals.phase_function(546.0), 20.0, 50.0, 0.045),
])  # fmt: skip
def test_bows_coronas_glories_and_halos_are_seen(phase, first, last, bound) -> None:
    """What an eye reads between the table's rows is the phase function, of single scattering."""
    angle = np.radians(np.random.default_rng(1).uniform(first, last, 500))
    chi = phase.moments(M + 1)
    low = legval(np.cos(angle), [(2 * ell + 1) * (chi[ell] - chi[M]) for ell in range(M)])
    rows = np.array([peak_row(a, 3601) for a in angle])
    np.testing.assert_allclose(np.interp(rows, np.arange(3601), angles()), angle, atol=1e-6)
    seen = low + np.interp(rows, np.arange(3601), peak_table(phase, M)[:, 0].astype(float))
    np.testing.assert_allclose(seen, phase.value(np.cos(angle)), rtol=bound)


def test_tables_are_stacked_by_scatterer_and_wavelength() -> None:
    a, b = HenyeyGreenstein(0.7), Mixture((0.5, 0.5), (HenyeyGreenstein(0.9), HenyeyGreenstein(0.1)))
    tables = peak_tables([[a, b], [b, a]], M)
    assert tables.shape == (2, 3601, 32, 2)
    np.testing.assert_array_equal(tables[0, ..., 1], tables[1, ..., 0])
    np.testing.assert_array_equal(tables[0, ..., 0], peak_table(a, M))


def test_what_a_ray_knows_nothing_of_is_in_the_table() -> None:
    """Truncated at degree 10, read by rays that know five moments: at every angle and depth the sum is the same."""
    phase, known = HenyeyGreenstein(0.74), np.cos(angles())
    chi = phase.moments(11)
    low = (2 * np.arange(10) + 1) * (chi[:10] - chi[10])
    whole = peak_table(phase, 10).astype(float) + legval(known, low)[:, None]
    part = peak_table(phase, 10, 5).astype(float) + legval(known, low[:5])[:, None]
    np.testing.assert_allclose(part, whole, atol=2e-5)
    assert np.abs(peak_table(phase, 10, 5) - peak_table(phase, 10)).max() > 1
