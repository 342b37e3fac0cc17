import numpy as np
import pytest

from openswim.lights import SOLAR_CONSTANT_W_M2, solar_irradiance
from openswim.lights.spectrum import solar_bins


def planck_at_earth(wavelength_nm, temperature_k=5772.0):
    """Irradiance at 1 au of a black sun, W m-2 nm-1."""
    wavelength = wavelength_nm * 1e-9
    h, c, k = 6.62607015e-34, 299792458.0, 1.380649e-23
    radiance = 2 * h * c**2 / wavelength**5 / np.expm1(h * c / (wavelength * k * temperature_k))
    return np.pi * radiance * (6.957e8 / 1.495978707e11) ** 2 * 1e-9


def test_the_bins_hold_the_solar_constant_but_for_its_tails():
    edges, mean = solar_bins()
    table = np.sum(mean * np.diff(edges))
    far = np.arange(4000, 200_000, 10.0)
    infrared = np.sum(planck_at_earth(far)) * 10  # the sun is black to some per cent out there
    ultraviolet = 6.6  # W m-2 below 280 nm: Gueymard (2018)
    assert table + infrared + ultraviolet == pytest.approx(SOLAR_CONSTANT_W_M2, abs=2.0)


@pytest.mark.parametrize(
    ("wavelength", "low", "high"), [(500, 0.97, 1.12), (800, 0.95, 1.05), (1600, 1.1, 1.3)]
)
def test_it_is_near_the_black_body_of_the_suns_temperature(wavelength, low, high):
    # At 1.6 um, where its gas is clearest, we see deeper into the sun: 6400 K.
    assert low < solar_irradiance(wavelength, 50) / planck_at_earth(wavelength) < high


@pytest.mark.parametrize("wavelength", [400.0, 450.0, 500.0, 546.0, 615.0, 700.0, 860.0])
def test_another_measurement_of_the_sun_agrees(shared, wavelength):
    nanometre, milliwatt = np.loadtxt(shared / "data/optics/kurudz_1.0nm.dat", unpack=True)  # Kurucz (1992)
    band = np.abs(nanometre - wavelength) <= 10
    assert solar_irradiance(wavelength, 21.0) == pytest.approx(milliwatt[band].mean() / 1000, rel=0.03)


def test_wide_bands_are_means_of_narrow_ones():
    narrow = solar_irradiance(np.arange(502.5, 600, 5.0), 5.0)
    assert solar_irradiance(550.0, 100.0) == pytest.approx(narrow.mean(), rel=1e-12)


def test_there_is_nothing_outside_the_table_and_shapes_are_kept():
    assert solar_irradiance(np.array([[100.0, 5000.0]])).tolist() == [[0.0, 0.0]]
    assert solar_irradiance(550.0).shape == ()
