"""Scattering by water drops: Mie theory, tabulated once by tools/make_mie_tables.py."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.optics.phase import TablePhase

KINDS = ("liquid", "rain")


@cache
def phase_function(kind: str, wavelength_nm: float) -> TablePhase:
    """Phase function of a size distribution of spheres; 400-700 nm, the nearest end beyond.

    "liquid": r_eff 10 um, effective variance .1. "rain": r_eff 750 um, exponential, averaged over the solar
    disc. Logarithm interpolated linearly in wavelength between 400, 450, 500, 546, 580, 615, 660 and 700 nm.
    """
    tables = _tables()
    position = _position(np.asarray(wavelength_nm, float))
    lower = min(int(position), tables["wavelength_nm"].size - 2)
    share = position - lower
    log_value = tables[f"{_checked(kind)}_log_value"].astype(float)
    blended = (1 - share) * log_value[lower] + share * log_value[lower + 1]
    return TablePhase(tables[f"{kind}_angle_deg"], np.exp(blended))


def single_scattering_albedo(kind: str, wavelengths_nm: ArrayLike) -> NDArray[np.float64]:
    """Scattered share of the extinguished light, (nwl,); above .9997 in the visible."""
    albedo = _tables()[f"{_checked(kind)}_albedo"]
    return np.interp(
        _position(np.atleast_1d(np.asarray(wavelengths_nm, float))), np.arange(albedo.size), albedo
    )


def _position(wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
    known = _tables()["wavelength_nm"]
    return np.interp(wavelength_nm, known, np.arange(known.size))


def _checked(kind: str) -> str:
    if kind not in KINDS:
        raise UserError(f"no Mie table for {kind!r}; known: {', '.join(KINDS)}")
    return kind


@cache
def _tables() -> dict[str, NDArray[np.float64]]:
    with (files("openswim.optics") / "data" / "mie_water.npz").open("rb") as stream:
        return dict(np.load(stream))
