"""The CIE 1931 standard observer."""

from functools import cache

import numpy as np

from openswim.tables import csv_columns

LUMENS_PER_WATT = 683.002


def standard_observer() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (81,), 380-780 nm, and the 2-degree colour matching functions (81, 3); CIE 018:2019."""
    wavelengths, *matching = csv_columns("colour", "cie1931_2deg")
    return wavelengths, np.stack(matching, axis=-1)


@cache
def solar_illuminance_lx() -> float:
    """Of the sun at 1 au, outside of the air."""
    from openswim.lights.spectrum import solar_irradiance

    wavelengths, matching = standard_observer()
    return float(LUMENS_PER_WATT * (solar_irradiance(wavelengths, 5.0) * matching[:, 1]).sum() * 5.0)


def xyz_weights(step_nm: float = 5.0) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (n,) and weights (n, 3) that turn a solar-relative spectrum L' into X, Y, Z.

    The weights hold the colour matching functions and the sun's spectrum and are scaled so that L' = 1 at all
    wavelengths has Y = 1.  With steps above 5 nm the sums stay at 5 nm, L' running straight between its
    nodes.
    """
    from openswim.lights.spectrum import solar_irradiance

    fine, matching = standard_observer()
    weights = matching * solar_irradiance(fine, bandwidth_nm=5.0)[:, None]
    nodes = np.linspace(fine[0], fine[-1], round((fine[-1] - fine[0]) / step_nm) + 1)
    share = np.maximum(1 - np.abs(nodes[:, None] - fine) / (nodes[1] - nodes[0]), 0)
    return nodes, share @ weights / weights[:, 1].sum()
