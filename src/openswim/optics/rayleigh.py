"""Scattering by air molecules."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

BOLTZMANN_J_PER_K = 1.380649e-23
STANDARD_NUMBER_PER_M3 = 2.546899e25  # air at 288.15 K, 1013.25 hPa
CO2_PPM = 400.0


def king_factor(wavelength_nm: ArrayLike, co2_ppm: float = CO2_PPM) -> NDArray[np.float64]:
    """Depolarisation (King) factor of dry air (Bodhaine et al. 1999, Eqs 5, 6 and 23)."""
    inverse_square = (np.asarray(wavelength_nm, float) / 1e3) ** -2
    nitrogen = 1.034 + 3.17e-4 * inverse_square
    oxygen = 1.096 + 1.385e-3 * inverse_square + 1.448e-4 * inverse_square**2
    co2_percent = co2_ppm * 1e-4
    mixed = 78.084 * nitrogen + 20.946 * oxygen + 0.934 * 1.00 + co2_percent * 1.15
    return mixed / (78.084 + 20.946 + 0.934 + co2_percent)


def depolarisation_factor(wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """rho of unpolarised light, from King's F = (6 + 3 rho) / (6 - 7 rho); .028 in mid-visible."""
    king = king_factor(wavelength_nm)
    return 6 * (king - 1) / (3 + 7 * king)


def refractivity(wavelength_nm: ArrayLike, co2_ppm: float = CO2_PPM) -> NDArray[np.float64]:
    """n - 1 of dry air at 288.15 K, 1013.25 hPa (Bodhaine et al. 1999, Eqs 18 and 19)."""
    inverse_square = (np.asarray(wavelength_nm, float) / 1e3) ** -2
    of_300_ppm = 8060.51 + 2480990.0 / (132.274 - inverse_square) + 17455.7 / (39.32957 - inverse_square)
    return np.asarray(of_300_ppm * 1e-8 * (1 + 0.54 * (co2_ppm * 1e-6 - 3e-4)))


def rayleigh_cross_section_m2(wavelength_nm: ArrayLike, co2_ppm: float = CO2_PPM) -> NDArray[np.float64]:
    """Scattering cross section per molecule of dry air, m2 (Bodhaine et al. 1999, Eqs 18, 19, 22); 250-1000
    nm.

    About 0.1 % over the range. Optical depths .2209/.0999/.0615 at 450/546/615 nm and 1013.25 hPa.
    """
    wavelength_um = np.asarray(wavelength_nm, float) / 1e3
    index_squared = (1 + refractivity(wavelength_nm, co2_ppm)) ** 2
    lorentz = (index_squared - 1) / (index_squared + 2)
    wavelength_m = wavelength_um * 1e-6
    strength = 24 * np.pi**3 / (wavelength_m**4 * STANDARD_NUMBER_PER_M3**2)
    return strength * lorentz**2 * king_factor(wavelength_nm, co2_ppm)


def rayleigh_scattering_per_m(
    wavelength_nm: ArrayLike, pressure_pa: ArrayLike, temperature_k: ArrayLike
) -> NDArray[np.float64]:
    """Molecular scattering coefficient, 1/m, shape wavelength.shape + pressure.shape."""
    cross_section = rayleigh_cross_section_m2(wavelength_nm)
    number_per_m3 = np.asarray(pressure_pa, float) / (BOLTZMANN_J_PER_K * np.asarray(temperature_k, float))
    return np.multiply.outer(cross_section, number_per_m3)
