"""Absorption by gases and by cloud water over the whole solar spectrum."""

import numpy as np

from openswim.tables import csv_columns

# Absorption of liquid water, 1/cm: Hale and Querry (1973), rounded.
LIQUID_NM = np.array(
    [700, 820, 900, 970, 1080, 1200, 1300, 1400, 1450, 1600, 1700, 1800, 1900, 1950, 2200, 2400, 2600, 4000.0]
)
LIQUID_PER_CM = np.array(
    [0.006, 0.02, 0.07, 0.45, 0.15, 1.1, 1.2, 12, 31, 6.7, 5.5, 8, 70, 120, 17, 45, 150, 150.0]
)
CLOUD_PATH_CM = 0.05  # of liquid water along the mean photon's path through a cloud that hides the sun


def _table() -> np.ndarray:
    """Rows wavelength_nm, water vapour, ozone, mixed gases."""
    return csv_columns("fluxes", "gas_absorption")


def airmass(sun_altitude_deg: float) -> float:
    """Relative airmass: Kasten and Young (1989); the horizon's value below it."""
    altitude = max(sun_altitude_deg, 0.0)
    return float(1 / (np.sin(np.radians(altitude)) + 0.50572 * (altitude + 6.07995) ** -1.6364))


def ozone_optical_depth(wavelength_nm: np.ndarray, ozone_cm: float) -> np.ndarray:
    """Vertical optical depth of `ozone_cm` (atm-cm; .3 is 300 DU)."""
    wavelengths, _, ozone, _ = _table()
    return np.interp(wavelength_nm, wavelengths, ozone) * ozone_cm


def gas_transmittance(
    wavelength_nm: np.ndarray, airmass: float, pressure_ratio: float, water_vapour_cm: float, ozone_cm: float
) -> np.ndarray:
    """Transmittance of the gases, 300-4000 nm: Bird and Riordan (1984), Eqs 2-8, 2-9, 2-11."""
    wavelengths, vapour, ozone, mixed = _table()
    vapour_path = vapour * water_vapour_cm * airmass
    mixed_path = mixed * pressure_ratio * airmass
    depth = 0.2385 * vapour_path / (1 + 20.07 * vapour_path) ** 0.45
    depth += 1.41 * mixed_path / (1 + 118.3 * mixed_path) ** 0.45
    depth += ozone * ozone_cm * airmass
    return np.interp(wavelength_nm, wavelengths, np.exp(-depth))


def liquid_transmittance(wavelength_nm: np.ndarray) -> np.ndarray:
    """Transmittance of the cloud water that the mean photon meets on its way through an overcast."""
    return np.exp(-np.interp(wavelength_nm, LIQUID_NM, LIQUID_PER_CM) * CLOUD_PATH_CM)
