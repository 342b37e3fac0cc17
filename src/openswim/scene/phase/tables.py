"""Phase functions given by tables: anyone's, and those of the aerosol types that come with the package."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.scene.phase.functions import PhaseFunction
from openswim.tables import named_arrays

FloatArray = NDArray[np.float64]

# Made from size distribution and refractive index by tools/make_aerosol_tables.py, which names the sources.
TABULATED = ("dust", "smoke", "sea_salt", "sulphate", "pollution", "stratospheric", "volcanic")
_ANGLES = 512  # at once: 16 MB of long series


class TablePhase(PhaseFunction):
    """Values at scattering angles from 0 to 180 degrees, log-linear in angle in between, scaled to a mean of
    1."""

    def __init__(self, angle_deg: ArrayLike, value: ArrayLike):
        angle, table = np.array(angle_deg, np.float64), np.array(value, np.float64)
        if angle.ndim != 1 or angle.shape != table.shape or angle.size < 2:
            raise UserError("phase table: needs two 1-D lists of the same length, angle_deg and value")
        if angle[0] > angle[-1]:
            angle, table = angle[::-1], table[::-1]
        if not ((np.diff(angle) > 0).all() and abs(angle[0]) < 1e-6 and abs(angle[-1] - 180) < 1e-6):
            raise UserError("phase table: the angles must run from 0 to 180 degrees without repeats")
        if not (np.isfinite(table).all() and (table > 0).all()):
            raise UserError("phase table: the values must be finite and positive")
        self.angle_deg = angle
        self._moments: dict[int, FloatArray] = {}  # by how many: quadratures differ
        self._log_value = np.log(table)
        mean = float(self._integrals(1)[0])
        if abs(mean - 1) > 1e-12:  # a saved table is left as it is, to the last bit
            table = table / mean
            self._log_value = np.log(table)
        self._value = table

    def value(self, cos_scattering_angle: ArrayLike) -> FloatArray:
        mu = np.clip(np.asarray(cos_scattering_angle, float), -1.0, 1.0)
        return np.exp(np.interp(np.degrees(np.arccos(mu)), self.angle_deg, self._log_value))

    def moments(self, n: int) -> FloatArray:
        """Exact for the interpolated table: see `_integrals`."""
        if n not in self._moments:
            chi = self._integrals(n)
            self._moments[n] = chi / chi[0]
        return self._moments[n].copy()

    def _integrals(self, n: int) -> FloatArray:
        """Half the integrals over the cosine of value times P_l, l < n.

        Between two angles the value is e^(a + b theta), whose product with sin(q theta) has the integral
        e^(a + b theta) (b sin(q theta) - q cos(q theta))/(b^2 + q^2). P_l is a sum of cosines of multiples of theta.
        """
        order = np.arange(1, n + 1)[:, None]
        sums = np.zeros(n)
        for first in range(0, self.angle_deg.size - 1, _ANGLES):
            part = slice(first, first + _ANGLES + 1)
            angle_deg, log_value = self.angle_deg[part], self._log_value[part]
            sines, cosines = (wave * np.exp(log_value) for wave in _waves(n, angle_deg.tobytes()))
            slope = np.diff(log_value) / np.diff(np.radians(angle_deg))
            whole = np.diff(sines, axis=1) * slope - np.diff(cosines, axis=1) * order
            sums += (whole / (slope**2 + order**2)).sum(axis=1)
        of_sines = np.concatenate([[0.0], sums])  # of sin(q theta), q from 0 on
        times_sine = np.concatenate([of_sines[1:2], (of_sines[2:] - of_sines[:-2]) / 2])  # of sin(theta) cos(q theta)
        # no dot product: the library for it would wake its threads for each of hundreds
        return np.asarray((_legendre_cosines(n) * times_sine).sum(axis=1))

    def to_dict(self) -> dict[str, Any]:
        return {
            "type": "table",
            "angle_deg": self.angle_deg.tolist(),
            "value": self._value.tolist(),
        }


class AerosolPhase(TablePhase):
    """Phase function of a tabulated aerosol type, or of a model's species (docs/models.md), at one of the table's
    wavelengths; saved by its name."""

    def __init__(self, name: str, wavelength_nm: float):
        tables = aerosol_tables() if name in TABULATED else model_tables()
        known = tables["wavelength_nm"]
        if f"{name}_log_value" not in tables or wavelength_nm not in known:
            raise UserError(f"no aerosol table {shown(name)} at {wavelength_nm:g} nm")
        self.name, self.wavelength_nm = name, float(wavelength_nm)
        row = tables[f"{name}_log_value"][int(np.argmax(known == wavelength_nm))]
        super().__init__(tables["angle_deg"], np.exp(row.astype(float)))

    def to_dict(self) -> dict[str, Any]:
        return {"type": "aerosol", "name": self.name, "wavelength_nm": self.wavelength_nm}


def aerosol_tables() -> dict[str, FloatArray]:
    """By "wavelength_nm": "<type>_log_value" at "angle_deg", "<type>_albedo" and "<type>_efficiency"."""
    return named_arrays("scene", "mie_aerosol")


def model_tables() -> dict[str, FloatArray]:
    """Of species of models, made by tools/make_model_aerosol.py. By humidity (or one row) and "wavelength_nm":
    "<species>_extinction_m2_g", "<species>_albedo", "<species>_asymmetry". At "angle_deg": "<species>_log_value", or
    "<species>_<number>_log_value" at those of the humidities whose numbers are "with_phase"."""
    return named_arrays("scene", "model_aerosol")


@lru_cache(maxsize=8)
def _waves(n: int, angle_deg: bytes) -> tuple[FloatArray, FloatArray]:
    """Sines and cosines (n, angles) of 1 to n times the angles."""
    phase = np.arange(1, n + 1)[:, None] * np.radians(np.frombuffer(angle_deg))
    return np.sin(phase), np.cos(phase)


@lru_cache(maxsize=8)
def _legendre_cosines(n: int) -> FloatArray:
    """Half of what P_l(cos theta) has of cos(m theta), (l, m): it is the sum over k from 0 to l of
    g_k g_(l-k) cos((l - 2k) theta), g_k = C(2k, k)/4^k."""
    k = np.arange(1, n)
    g = np.cumprod(np.concatenate([[1.0], (2 * k - 1) / (2 * k)]))
    ell, m = np.arange(n)[:, None], np.arange(n)
    there = (m <= ell) & ((ell - m) % 2 == 0)
    product = g[np.where(there, ell - m, 0) // 2] * g[np.where(there, ell + m, 0) // 2]
    return np.where(there, product * np.where(m > 0, 1.0, 0.5), 0.0)
