"""Astronomers' units of faint light in watts, candelas and lux."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.spectrum import solar_irradiance

F64 = NDArray[np.float64]

ARCSEC2_PER_SR = (180 * 3600 / np.pi) ** 2
V0_W_M2_NM = 3.63e-11  # spectral irradiance of magnitude V = 0 at 550 nm (Bessell 1979)
S10_W_M2_SR_NM = 1.28e-11  # one V = 10 star of the sun's colour per square degree, at 500 nm (Leinert et al. 1998)
PLANCK_J_S, LIGHT_M_S = 6.62607015e-34, 299_792_458.0


def sunlike(wavelengths_nm: ArrayLike, at_nm: float) -> F64:
    """The sun's spectrum, 1 at a wavelength."""
    return np.asarray(solar_irradiance(np.asarray(wavelengths_nm, float)) / solar_irradiance(at_nm))


def magnitude_of_luminance(cd_per_m2: ArrayLike) -> F64:
    """Surface brightness V, magnitudes per square second of arc: 1.7e-4 is 22."""
    return np.asarray(-2.5 * np.log10(np.asarray(cd_per_m2, float) / 1.08e5))


def magnitude_of_radiance(w_m2_sr_nm: ArrayLike) -> F64:
    """V per square second of arc of a spectral radiance at 550 nm, W m-2 sr-1 nm-1."""
    return np.asarray(-2.5 * np.log10(np.asarray(w_m2_sr_nm, float) / ARCSEC2_PER_SR / V0_W_M2_NM))


def radiance_of_rayleighs(rayleighs: float, wavelength_nm: float) -> float:
    """W m-2 sr-1 of a line: 1 R is 1e10 photons per second and m2 from the whole sphere."""
    return rayleighs * 1e10 / (4 * np.pi) * PLANCK_J_S * LIGHT_M_S / (wavelength_nm * 1e-9)
