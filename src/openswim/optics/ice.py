"""How ice absorbs beyond 700 nm, and how much further forward it then scatters; in the visible it does neither."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.tables import csv_columns

FloatArray = NDArray[np.float64]

RADII_M = np.array([5, 10, 20, 30, 45, 60]) * 1e-6  # of the table
_OPAQUE = 0.47  # 1 - albedo of crystals through which nothing comes: half is diffracted, .03 mirrored
ICE_KG_M3 = 917.0


def coalbedo(wavelengths_nm: ArrayLike, radius_m: float) -> FloatArray:
    """1 - single-scattering albedo (nwl,) of crystals of an effective radius (3/4 of volume over mean shadow).

    The severely roughened habit mixture of Baum et al. (2014) from 5 to 60 um; of larger particles .47 (1 - exp(-x r)),
    which meets it at 60 um. Zero below 700 nm, where less than 1e-4 is absorbed; the value at 1700 nm holds beyond.
    """
    largest = float(min(radius_m, RADII_M[-1]))
    found = _at(_columns()[1], wavelengths_nm, largest) * min(radius_m / RADII_M[0], 1.0)
    if radius_m > largest:
        found = _OPAQUE * -np.expm1(np.log1p(-np.minimum(found / _OPAQUE, 0.999)) * radius_m / largest)
    return np.where(np.atleast_1d(wavelengths_nm) < _columns()[0][0], 0.0, found)


def more_asymmetry(wavelength_nm: float, radius_m: float) -> float:
    """Asymmetry factor of the same crystals less that at 700 nm: .04 at 1610 nm and 60 um."""
    here, there = _at(_columns()[2], [wavelength_nm, _columns()[0][0]], radius_m)
    return float(here - there)


def _at(table: FloatArray, wavelengths_nm: ArrayLike, radius_m: float) -> FloatArray:
    """Table (nr, nwl), linear in wavelength and in the radius, the nearest end beyond."""
    known_nm = _columns()[0]
    position = float(np.interp(radius_m, RADII_M, np.arange(RADII_M.size)))
    lower = min(int(position), RADII_M.size - 2)
    row = table[lower] + (position - lower) * (table[lower + 1] - table[lower])
    return np.interp(np.atleast_1d(np.asarray(wavelengths_nm, float)), known_nm, row)


def _columns() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Wavelengths (nwl,), 1 - albedo and asymmetry (nr, nwl)."""
    columns = csv_columns("optics", "ice_near_infrared")
    return columns[0], columns[1 : 1 + RADII_M.size], columns[1 + RADII_M.size :]
