"""Bands of water vapour, oxygen, carbon dioxide and methane: a wavelength there is the mean over 20 nm around it.

The light of a band is a weighted mean of the light at a few strengths of absorption (correlated k-distribution): each
is a `term` that is solved for as a wavelength is. A wavelength without a band is one term, of no such absorption.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.tables import csv_columns

if TYPE_CHECKING:
    from openswim.scene.atmosphere import Atmosphere

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

WIDTH_NM = 20.0
_STEP_NM = 5.0  # between the centres of the table
_REFERENCE_PA, _REFERENCE_K = 101_325.0, 273.15
_AIR_GAS_CONSTANT = 287.05  # J kg-1 K-1
_GRAVITY = 9.81
_PRESSURE_OF_VAPOUR, _COLD_OF_VAPOUR = 0.8, 1.0  # relative to that at the ground, and to _REFERENCE_K
_PRESSURE_OF_AIR, _COLD_OF_AIR = 0.5, 1.09
_NO_GAS = np.zeros((1, 6))


@dataclass(frozen=True, eq=False)
class Terms:
    """What is solved for in place of wavelengths (nwl,).

    which (nt,): the wavelength that a term belongs to; weight (nt,): its share in it. gas (nt, 6): absorption by water
    vapour and by dry air, m2/kg at 1013.25 hPa and 273.15 K, and the powers of pressure and of inverse temperature that
    the one and the other go with (n, m, n, m).
    """

    wavelengths_nm: F64
    which: I64
    weight: F64
    gas: F64

    @property
    def nm(self) -> F64:
        """The wavelength of each term (nt,)."""
        return self.wavelengths_nm[self.which]

    def at(self, some: I64) -> Terms:
        """Some of the terms, of the same wavelengths."""
        return replace(self, which=self.which[some], weight=self.weight[some], gas=self.gas[some])

    def mean(self, values: NDArray, axis: int = -1) -> NDArray:
        """Of values at the terms those at the wavelengths; where each is one term they are the same array."""
        if self.which.size == self.wavelengths_nm.size:
            return values
        moved = np.moveaxis(values, axis, -1)
        share = np.zeros((self.which.size, self.wavelengths_nm.size))
        share[np.arange(self.which.size), self.which] = self.weight
        return np.moveaxis((moved @ share).astype(values.dtype), -1, axis)

    def absorption_per_m(self, atmosphere: Atmosphere, height_m: F64) -> F64:
        """Absorption (nt, nz) by these gases at heights (nz,) above sea level."""
        if not self.gas[:, :2].any():
            return np.zeros((self.which.size, height_m.size))
        pressure, temperature, _ = atmosphere.at(height_m)
        vapour = atmosphere.vapour_kg_m3_at(height_m)
        air = pressure / (_AIR_GAS_CONSTANT * temperature)
        k_vapour, k_air, *powers = self.gas.T[:, :, None]
        relative, cold = pressure / _REFERENCE_PA, _REFERENCE_K / temperature
        return np.asarray(
            k_vapour * vapour * relative ** powers[0] * cold ** powers[1]
            + k_air * air * relative ** powers[2] * cold ** powers[3]
        )


def terms_of(wavelengths_nm: F64, air: bool = True) -> Terms:
    """The terms of wavelengths, in their order; without ``air`` one each."""
    rows = [_rows_at(float(w)) if air else (np.ones(1), _NO_GAS) for w in wavelengths_nm]
    which = np.repeat(np.arange(len(rows)), [len(weight) for weight, _ in rows])
    return Terms(wavelengths_nm, which, np.concatenate([w for w, _ in rows]), np.concatenate([g for _, g in rows]))


def banded(wavelengths_nm: F64) -> F64:
    """Those of the wavelengths (nwl,) that stand for a band."""
    return np.array([w for w in wavelengths_nm if _rows_at(float(w))[1].any()])


def band_transmittance(wavelengths_nm: F64, airmass: float, water_vapour_cm: float, pressure_pa: float) -> F64:
    """Of the bands that wavelengths (nwl,) stand for, roughly: as if all vapour and all air lay at one height each."""
    terms = terms_of(wavelengths_nm)
    k_vapour, k_air, *powers = terms.gas.T
    relative = pressure_pa / _REFERENCE_PA
    vapour = 10 * water_vapour_cm * (_PRESSURE_OF_VAPOUR * relative) ** powers[0] * _COLD_OF_VAPOUR ** powers[1]
    air = pressure_pa / _GRAVITY * (_PRESSURE_OF_AIR * relative) ** powers[2] * _COLD_OF_AIR ** powers[3]
    return np.asarray(terms.mean(np.exp(-airmass * (k_vapour * vapour + k_air * air))))


def _rows_at(wavelength_nm: float) -> tuple[F64, F64]:
    """Weights (n,) and gas (n, 6) of the table's band about the nearest multiple of 5 nm."""
    centre = _STEP_NM * round(wavelength_nm / _STEP_NM)
    return _table().get(centre, (np.ones(1), _NO_GAS))


@cache
def _table() -> dict[float, tuple[F64, F64]]:
    columns = csv_columns("optics", "gas_bands")
    out = {}
    for centre in np.unique(columns[0]):
        weight, *gas = columns[1:, columns[0] == centre]
        out[float(centre)] = (weight / weight.sum(), np.stack(gas, axis=-1))
    return out
