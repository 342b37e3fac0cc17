"""Scattering by water drops: Mie theory, tabulated once by tools/make_mie_tables.py and tools/make_rain_bows.py."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.scene.interpolation import at_wavelengths
from openswim.scene.phase import TablePhase
from openswim.tables import named_arrays

FloatArray = NDArray[np.float64]

DEFAULT_RADIUS_M = {"liquid": 10e-6, "rain": 750e-6}
KINDS = tuple(DEFAULT_RADIUS_M)


@lru_cache(maxsize=256)
def phase_function(kind: str, wavelength_nm: float, effective_radius_m: float | None = None) -> TablePhase:
    """Phase function of a size distribution of spheres; the table's radii, the nearest end beyond.

    "liquid": 400-1700 nm, effective radius 2.5-40 um (default 10), gamma distribution of variance .1. "rain": 400-700
    nm, 125-750 um (750), exponential, averaged over the solar disc, every .05 degrees where the bows are. The logarithm
    is linear in wavelength and in ln radius.
    """
    log_value = _tables()[f"{_checked(kind)}_log_value"]
    wavelength, known_nm = np.array([wavelength_nm]), _tables()[f"{kind}_wavelength_nm"]
    blended = _between(kind, log_value, known_nm, wavelength, _radius(kind, effective_radius_m))[0]
    return TablePhase(_tables()[f"{kind}_angle_deg"], np.exp(blended))


def single_scattering_albedo(
    kind: str, wavelengths_nm: ArrayLike, effective_radius_m: float | None = None
) -> FloatArray:
    """Scattered share of the extinguished light, (nwl,), 400-1700 nm: above .9995 in the visible, .994 of droplets of
    10 um at 1610 nm."""
    table, wavelengths = _tables()[f"{_checked(kind)}_albedo"], np.atleast_1d(np.asarray(wavelengths_nm, float))
    return _between(kind, table, _tables()["wavelength_nm"], wavelengths, _radius(kind, effective_radius_m))


def extinction_efficiency(
    kind: str, wavelength_nm: float, effective_radius_m: ArrayLike | None = None
) -> NDArray[np.floating]:
    """Extinction over geometric cross section (shape of the radius): 2 for large drops, 2.09 at 10 um, 2.2 at 3 um."""
    table = _tables()[f"{_checked(kind)}_efficiency"]
    (row,) = _at_wavelengths(table, _tables()["wavelength_nm"], np.array([float(wavelength_nm)]))
    radius = np.asarray(_radius(kind, None) if effective_radius_m is None else effective_radius_m)
    value = np.interp(radius, _tables()[f"{kind}_radius_um"] * 1e-6, row)
    return value.astype(radius.dtype) if radius.dtype == np.float32 else value


def _radius(kind: str, effective_radius_m: float | None) -> float:
    return DEFAULT_RADIUS_M[kind] if effective_radius_m is None else float(effective_radius_m)


def _between(
    kind: str, table: FloatArray, known_nm: FloatArray, wavelengths_nm: FloatArray, radius_m: float
) -> FloatArray:
    """Table (nwl, nr, ...) of wavelengths known_nm at wavelengths (n,) and one radius: (n, ...)."""
    log_radius = np.log(_tables()[f"{kind}_radius_um"] * 1e-6)
    position = float(np.interp(np.log(radius_m), log_radius, np.arange(log_radius.size)))
    lower = min(int(position), log_radius.size - 2)
    share = position - lower
    return _at_wavelengths((1 - share) * table[:, lower] + share * table[:, lower + 1], known_nm, wavelengths_nm)


def _at_wavelengths(table: FloatArray, known_nm: FloatArray, wavelengths_nm: FloatArray) -> FloatArray:
    """Table (nwl, ...) of wavelengths known_nm interpolated linearly to wavelengths (n,), the nearest end beyond."""
    found = at_wavelengths(known_nm, np.moveaxis(table, 0, -1), wavelengths_nm)
    return np.moveaxis(found, -1, 0)


def _checked(kind: str) -> str:
    if kind not in KINDS:
        raise UserError(f"no Mie table for {kind!r}; known: {', '.join(KINDS)}")
    return kind


@cache
def _tables() -> dict[str, FloatArray]:
    """Those of all angles, with the finer ones of the rainbows put into those of rain."""
    tables, bows = named_arrays("optics", "mie_water"), named_arrays("optics", "rain_bows")
    angle, fine = tables["rain_angle_deg"], bows["angle_deg"]
    below, above = angle < fine[0], angle > fine[-1]
    known = tables["rain_log_value"]
    parts = known[..., below], bows["log_value"].astype(known.dtype), known[..., above]
    return tables | {
        "rain_angle_deg": np.concatenate([angle[below], fine, angle[above]]),
        "rain_log_value": np.concatenate(parts, axis=-1),
    }
