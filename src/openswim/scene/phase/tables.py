"""Phase functions given by tables: anyone's, and those of the aerosol types that come with the package."""

from __future__ import annotations

from collections.abc import Iterator
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
        """By Gauss-Legendre on panels a third of a period of P_n wide; 1e-6 of the interpolated table."""
        if n not in self._moments:
            chi = self._integrals(n)
            self._moments[n] = chi / chi[0]
        return self._moments[n].copy()

    def _integrals(self, n: int) -> FloatArray:
        theta, weight = self._quadrature(n)
        mu = np.cos(theta)
        weighted = (
            0.5
            * weight
            * np.sin(theta)
            * np.exp(np.interp(np.degrees(theta), self.angle_deg, self._log_value))
        )
        # no dot product: the library for it would wake its threads for each of hundreds
        return np.array([(p_l * weighted).sum() for p_l in legendre(mu, n)])

    def _quadrature(self, n: int) -> tuple[FloatArray, FloatArray]:
        node, node_weight = np.polynomial.legendre.leggauss(6)
        edges = np.radians(self.angle_deg)
        pieces = np.maximum(np.ceil(np.diff(edges) * n / 2.0), 1).astype(int)
        pieces = np.maximum(pieces, np.ceil(np.abs(np.diff(self._log_value))).astype(int))
        start = np.repeat(edges[:-1], pieces)
        width = np.repeat(np.diff(edges) / pieces, pieces)
        start = start + width * (np.arange(start.size) - np.repeat(np.cumsum(pieces) - pieces, pieces))
        theta = start[:, None] + width[:, None] * (0.5 + 0.5 * node)
        return theta.ravel(), (0.5 * width[:, None] * node_weight).ravel()

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


def legendre(mu: FloatArray, n: int) -> Iterator[FloatArray]:
    """P_0 .. P_(n-1) at mu, one after the other."""
    previous, current = np.zeros_like(mu), np.ones_like(mu)
    for degree in range(n):
        yield current
        previous, current = current, ((2 * degree + 1) * mu * current - degree * previous) / (degree + 1)
