"""The sun's spectrum above the atmosphere."""

import functools

import numpy as np

from openswim.tables import csv_columns

SOLAR_CONSTANT_W_M2 = 1361.1  # total at 1 au: Gueymard (2018), doi:10.1016/j.solener.2018.04.001


@functools.cache
def solar_bins() -> tuple[np.ndarray, np.ndarray]:
    """Bin edges (n + 1,) in nm, 280 to 4000, and mean spectral irradiance (n,) in W m-2 nm-1 at 1 au.

    ASTM G173-03 (Gueymard 2004) scaled to 1361.1 W m-2; it holds 98.7 % of that total, a further .5 % lying
    below 280 nm and .8 % beyond 4000 nm.
    """
    low, high, irradiance = csv_columns("lights", "solar_spectrum")
    return np.append(low, high[-1]), irradiance


def solar_irradiance(wavelength_nm: float | np.ndarray, bandwidth_nm: float = 10.0) -> np.ndarray:
    """Solar spectral irradiance at 1 au, W m-2 nm-1, averaged over `bandwidth_nm` about each wavelength.

    Same shape as `wavelength_nm`.  The table's bins are 5 nm wide below 1000 nm, 20 nm to 2000 nm and 100 nm
    to 4000 nm; a narrower band repeats its bin.  Zero outside 280-4000 nm.  Accuracy about 1 % (ASTM G173-03,
    Gueymard 2004).  Divide by the square of the sun's distance in au.
    """
    edges, mean = solar_bins()
    cumulative = np.concatenate([[0.0], np.cumsum(mean * np.diff(edges))])
    centre = np.asarray(wavelength_nm, dtype=float)
    upper = np.interp(centre + bandwidth_nm / 2, edges, cumulative)
    lower = np.interp(centre - bandwidth_nm / 2, edges, cumulative)
    return (upper - lower) / bandwidth_nm
