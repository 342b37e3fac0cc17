import numpy as np
import pytest

from openswim.colour.spectrum import extension_matrix, full_spectrum

VISIBLE = np.arange(380.0, 781.0, 10.0)
THREE = np.array([615.0, 546.0, 450.0])


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9])
def test_it_passes_through_the_given_wavelengths(count):
    random = np.random.default_rng(count)
    nodes = random.permutation(np.linspace(400, 700, count))
    values = random.uniform(0.1, 3, (50, count))
    np.testing.assert_allclose(full_spectrum(values, nodes, nodes), values, rtol=2e-5)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7])
def test_a_grey_spectrum_stays_grey(count):
    nodes = np.linspace(420, 680, count)
    np.testing.assert_allclose(full_spectrum(np.full((1, count), 0.37), nodes, VISIBLE), 0.37, rtol=1e-5)


@pytest.mark.parametrize("nodes", [(450.0, 600.0), THREE, (412.0, 443.0, 490.0, 555.0, 670.0)])
@pytest.mark.parametrize("power", [-4.08, -1.3, 1.0])
def test_power_laws_are_exact(nodes, power):
    found = full_spectrum((np.array(nodes) / 550) ** power, np.array(nodes), VISIBLE)
    np.testing.assert_allclose(found, (VISIBLE / 550) ** power, rtol=2e-5)


def test_three_wavelengths_give_a_parabola_between_and_a_tangent_beyond():
    def curve(nm):
        x = np.log(nm / 500)
        return np.exp(-2 * x + 3 * x**2)

    between = (VISIBLE >= 450) & (VISIBLE <= 615)
    found = full_spectrum(curve(THREE), THREE, VISIBLE)
    np.testing.assert_allclose(found[between], curve(VISIBLE[between]), rtol=1e-5)
    red = VISIBLE > 615
    slope = -2 + 6 * np.log(615 / 500)
    np.testing.assert_allclose(found[red], curve(615.0) * (VISIBLE[red] / 615) ** slope, rtol=1e-4)


@pytest.mark.parametrize(
    "spectrum",
    [
        lambda nm: 1 - np.exp(-3 * 0.0999 * (546 / nm) ** 4.08),  # blue sky
        lambda nm: np.exp(-8 * 0.0999 * (546 / nm) ** 4.08),  # the sun low in the sky
        lambda nm: np.exp(-1.5 * (550 / nm) ** 1.3),  # through haze
    ],
)
def test_three_wavelengths_tell_smooth_spectra(spectrum):
    middle = (VISIBLE > 420) & (VISIBLE < 680)  # 99 % of what the eye sees
    found = full_spectrum(spectrum(THREE), THREE, VISIBLE)
    np.testing.assert_allclose(found[middle], spectrum(VISIBLE)[middle], rtol=0.07)


def test_a_spline_beats_the_parabola_where_more_is_known():
    def wavy(nm):
        return 1 + 0.5 * np.sin(nm / 45)

    nodes = np.linspace(400, 700, 13)
    inside = (VISIBLE >= 400) & (VISIBLE <= 700)
    found = full_spectrum(wavy(nodes), nodes, VISIBLE)[inside]
    np.testing.assert_allclose(found, wavy(VISIBLE)[inside], rtol=0.02)


@pytest.mark.parametrize("count", [4, 6])
def test_the_spline_is_straight_beyond_its_ends(count):
    outside = np.array([650.0, 650 * 1.05, 650 * 1.05**2, 450 / 1.05**2, 450 / 1.05, 450.0])
    matrix = extension_matrix(np.linspace(450, 650, count), outside)
    np.testing.assert_allclose(matrix[0] - 2 * matrix[1] + matrix[2], 0, atol=1e-12)
    np.testing.assert_allclose(matrix[3] - 2 * matrix[4] + matrix[5], 0, atol=1e-12)


@pytest.mark.parametrize(
    "strange",
    [(1, 0, 1), (0, 1, 0), (0, 0, 1), (1e5, 1e-12, 1e5), (1e-30, 1e-35, 0), (-1, 2, 0.5), (3e5, 2e5, 1e5)],
)
def test_strange_colours_do_not_blow_up(strange):
    found = full_spectrum(np.array([strange]), THREE, VISIBLE)
    assert np.isfinite(found).all()
    assert (found >= 0).all()
    # e to the (1 + range) at most, the range ending where a zero is taken for 1e-4.
    assert found.max() <= max(strange) * np.e * 1e4 * 1.01


def test_black_is_black_and_nothing_is_nothing():
    found = full_spectrum(np.array([[0.0, 0.0, 0.0], [np.nan] * 3, [-1.0, -2.0, -1.0]]), THREE, VISIBLE)
    assert (found[0] == 0).all()
    assert np.isnan(found[1]).all()
    assert (found[2] <= 0).all()


def test_repeated_wavelengths_are_refused():
    with pytest.raises(ValueError, match="distinct"):
        extension_matrix(np.array([450.0, 450.0]), VISIBLE)
