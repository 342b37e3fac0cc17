"""Droplets of nearly one size, which show corona, glory and cloudbow: Mie theory, tabulated by
tools/make_droplet_bases.py."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from openswim.scene.phase import TablePhase
from openswim.tables import named_arrays

FloatArray = NDArray[np.float64]

USUAL_VARIANCE = 0.1
RADII_M = (2.5e-6, 25e-6)


@lru_cache(maxsize=64)
def phase_function(wavelength_nm: float, effective_radius_m: float, variance: float) -> TablePhase:
    """Phase function of a gamma distribution of droplets (Hansen & Travis 1974) of an effective variance of .01-.1,
    averaged over the solar disc; effective radius 2.5-25 um, the nearest end beyond.

    P depends on the size parameter, and a little on the index: rows of size parameters, each taken as often as droplets
    are of that size, and linear in the index of the wavelength, 400-700 nm, the nearest end beyond.
    """
    tables = named_arrays("optics", "mie_droplets")
    row, share = _row(wavelength_nm)
    rows = [n for n in (row, row + 1) if n < len(tables["index"])]
    radius_um = tables["size_parameter"] * wavelength_nm * 1e-3 / (2 * np.pi)
    number = _gamma(radius_um, float(np.clip(effective_radius_m, *RADII_M)) * 1e6, variance)
    value = np.zeros(tables["angle_deg"].size)
    for n, weight in zip(rows, (1 - share, share), strict=False):
        scattered = number * tables["scattering"][n]
        value += weight * (scattered / scattered.sum()) @ np.exp(tables["log_value"][n].astype(float))
    return TablePhase(tables["angle_deg"], value)


def _row(wavelength_nm: float) -> tuple[int, float]:
    """The index of water at a wavelength among those of the table's rows, which fall: the row before, and the share of
    the next."""
    tables = named_arrays("optics", "mie_droplets")
    index = float(np.interp(wavelength_nm, tables["wavelength_nm"], tables["index_at"]))
    position = float(np.interp(-index, -tables["index"], np.arange(tables["index"].size)))
    return int(position), position - int(position)


def _gamma(radius_um: FloatArray, effective_um: float, variance: float) -> FloatArray:
    """Droplets in equal steps of ln r, n(r) r of n ~ r^((1-3v)/v) exp(-r/(r_eff v)), relative to the most."""
    log_number = (1 - 2 * variance) / variance * np.log(radius_um / effective_um) - radius_um / (
        effective_um * variance
    )
    return np.exp(log_number - log_number.max())
