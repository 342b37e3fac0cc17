import numpy as np
import pytest

from openswim.colour.cie import xyz_weights
from openswim.colour.rgb import rgb_matrix
from openswim.colour.spectrum import Extension, extension_matrix

VISIBLE = np.arange(380.0, 781.0, 10.0)
THREE = np.array([615.0, 546.0, 450.0])


def full_spectrum(radiance, wavelengths_nm, target_nm):
    """L' (..., nwl) to (..., n_target)."""
    flat = Extension(wavelengths_nm, target_nm)(radiance.reshape(-1, radiance.shape[-1]))
    return flat.reshape((*radiance.shape[:-1], flat.shape[-1]))


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


# Reflectance at 400, 420, .. 780 nm by PROSAIL 2.0.5, seen 10 degrees off nadir, sun 40 off zenith; chlorophyll of 20
# to 50 ug/cm2, leaf area index of 1 (sparse) to 5 (wood)
CANOPIES = {
    "meadow": (0.022, 0.0226, 0.023, 0.0231, 0.0232, 0.0252, 0.045, 0.0624, 0.0608, 0.0455, 0.0399, 0.0337, 0.0307,
               0.026, 0.0269, 0.0708, 0.2021, 0.3182, 0.359, 0.3694),
    "crop": (0.0167, 0.0175, 0.0182, 0.018, 0.0176, 0.0169, 0.0262, 0.0381, 0.0366, 0.0256, 0.0219, 0.0182, 0.0167,
             0.0154, 0.0177, 0.0418, 0.1655, 0.3237, 0.3969, 0.4164),
    "wood": (0.0162, 0.0171, 0.0178, 0.0178, 0.0176, 0.0184, 0.0331, 0.047, 0.0456, 0.0331, 0.0284, 0.023, 0.0204,
             0.0166, 0.0178, 0.0547, 0.1788, 0.3119, 0.3755, 0.4017),
    "sparse": (0.0664, 0.065, 0.0635, 0.0641, 0.0652, 0.07, 0.0924, 0.1101, 0.1114, 0.0999, 0.097, 0.0931, 0.0921,
               0.0885, 0.0906, 0.1384, 0.236, 0.2995, 0.3212, 0.3287),
    "young": (0.0182, 0.0192, 0.02, 0.0216, 0.0225, 0.0295, 0.0636, 0.0876, 0.0852, 0.0637, 0.0551, 0.0447, 0.0391,
              0.0284, 0.0263, 0.0962, 0.2369, 0.3301, 0.3576, 0.3643),
}  # fmt: skip


@pytest.mark.parametrize("haze", [0.0, 0.01, 0.02])
@pytest.mark.parametrize("canopy", CANOPIES)
def test_three_wavelengths_tell_the_colour_of_leaves(canopy, haze):
    """Through haze too; a parabola makes them emerald, up to 20 % of the green wrong."""
    spectrum = np.interp(VISIBLE, np.arange(400, 781, 20), CANOPIES[canopy]) + haze * (VISIBLE / 550) ** -3.0
    weights = xyz_weights(step_nm=10)[1] @ rgb_matrix().T
    truth = spectrum @ weights
    found = full_spectrum(np.interp(THREE, VISIBLE, spectrum)[None], THREE, VISIBLE)[0] @ weights
    np.testing.assert_allclose(found, truth, atol=0.04 * truth.max())


@pytest.mark.parametrize("airmass", [0, 4, 7, 10, 20])
def test_reddened_skies_are_not_taken_for_leaves(airmass):
    def sky(nm):
        return (546 / nm) ** 4.08 * np.exp(-airmass * 0.0999 * (546 / nm) ** 4.08)

    weights = xyz_weights(step_nm=10)[1] @ rgb_matrix().T
    truth, found = sky(VISIBLE) @ weights, full_spectrum(sky(THREE), THREE, VISIBLE) @ weights
    np.testing.assert_allclose(found, truth, atol=0.04 * truth.max())


def test_what_is_greener_than_leaves_or_seen_elsewhere_is_a_parabola():
    line = full_spectrum(np.array([[1e-3, 1.0, 1e-3]]), THREE, VISIBLE)  # the line of the airglow, not a wood
    assert np.isfinite(line).all()
    assert line.max() < 10
    red = np.array([700.0, 650.0, 610.0])  # no green among them
    values = np.array([[0.2, 0.5, 0.3]])
    between = np.array([630.0])
    parabola = np.exp(np.log(values) @ extension_matrix(red, between).T)
    np.testing.assert_allclose(full_spectrum(values, red, between), parabola, rtol=1e-5)
