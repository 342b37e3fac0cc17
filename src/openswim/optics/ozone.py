"""Absorption by ozone: the Huggins and Chappuis bands."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.tables import csv_columns


def ozone_cross_section_m2(wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """Absorption cross section per molecule at 228 K, m2 (same shape as `wavelength_nm`); 280-800 nm, zero
    beyond.

    Paur & Bass (1985) below 340 nm, WMO (1986) in 5-nm bins above 410 nm, scaled to meet Bogumil et al.
    (2003): 1.89e-26, 3.27e-25 and 4.43e-25 m2 at 450, 546 and 615 nm. About 5 % from 430 to 750 nm, where it
    matters; the dependence on temperature (1 % in the Chappuis band) is left out.
    """
    table_nm, cross_section = csv_columns("optics", "ozone_cross_section")
    wavelength = np.asarray(wavelength_nm, float)
    inside = (wavelength >= table_nm[0]) & (wavelength <= table_nm[-1])
    return np.where(inside, np.exp(np.interp(wavelength, table_nm, np.log(cross_section * 1e-26))), 0.0)
