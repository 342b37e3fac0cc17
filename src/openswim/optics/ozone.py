"""Absorption by ozone: the Huggins and Chappuis bands."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike, NDArray


def ozone_cross_section_m2(wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """Absorption cross section per molecule at 228 K, m2 (same shape as `wavelength_nm`); 280-800 nm, zero
    beyond.

    Paur & Bass (1985) below 340 nm, WMO (1986) in 5-nm bins above 410 nm, scaled to meet Bogumil et al.
    (2003): 1.89e-26, 3.27e-25 and 4.43e-25 m2 at 450, 546 and 615 nm. About 5 % from 430 to 750 nm, where it
    matters; the dependence on temperature (1 % in the Chappuis band) is left out.
    """
    table_nm, log_cross_section = _table()
    wavelength = np.asarray(wavelength_nm, float)
    inside = (wavelength >= table_nm[0]) & (wavelength <= table_nm[-1])
    return np.where(inside, np.exp(np.interp(wavelength, table_nm, log_cross_section)), 0.0)


@cache
def _table() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    path = files("openswim.optics") / "data" / "ozone_cross_section.csv"
    lines = [line for line in path.read_text().splitlines() if line[:1].isdigit()]
    wavelength, value = np.array([line.split(",") for line in lines], float).T
    return wavelength, np.log(value * 1e-26)
