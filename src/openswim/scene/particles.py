"""What properties of particles must be: a value within its range, or several of them as {wavelength_nm: value}."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import shown
from openswim.errors import UserError

ANGSTROM_EXPONENTS = (-10.0, 10.0)
WAVELENGTHS_NM = (100.0, 1e5)  # nothing else is likely to be nanometres
RELATIVE_EXTINCTIONS = (1e-9, 1e9)


def check_number(what: str, value: Any, low: float, high: float) -> None:
    """Raise UserError unless this is a number from `low` to `high`."""
    if not _within(value, low, high):
        raise UserError(f"{what} must be a number within {low:g} to {high:g}, got {shown(value)}")


def check_albedo(what: str, value: Any) -> None:
    """Raise UserError unless this is a single-scattering albedo, or a mapping of them."""
    for each in _checked(what, value).values() if isinstance(value, Mapping) else (value,):
        check_number(what, each, 0.0, 1.0)


def check_spectrum(what: str, value: Any, low: float, high: float) -> None:
    """Raise UserError unless this is a mapping {wavelength_nm: number from `low` to `high`}."""
    if not isinstance(value, Mapping):
        raise UserError(f"{what} must be {{wavelength_nm: value}}, got {shown(value)}")
    for each in _checked(what, value).values():
        check_number(what, each, low, high)


def relative_extinction(
    wavelength_nm: ArrayLike, reference_nm: float, angstrom_exponent: float, known: Mapping[float, float] | None = None
) -> NDArray[np.float64]:
    """Extinction over that at the reference (shape of the wavelengths): by Angstrom's power law, or of a spectrum
    {wavelength_nm: value} in any unit, a power law between its wavelengths and beyond its ends."""
    wavelength = np.asarray(wavelength_nm, float)
    if known is None:
        return (wavelength / reference_nm) ** -angstrom_exponent
    nodes = np.log(np.array(sorted(known), float))
    values = np.log(np.array([known[wl] for wl in sorted(known)], float))
    if nodes.size == 1:
        return np.ones(wavelength.shape)

    def log_at(log_wavelength: NDArray[np.float64]) -> NDArray[np.float64]:
        lower = np.clip(np.searchsorted(nodes, log_wavelength) - 1, 0, nodes.size - 2)
        slope = (values[lower + 1] - values[lower]) / (nodes[lower + 1] - nodes[lower])
        return values[lower] + slope * (log_wavelength - nodes[lower])

    return np.exp(log_at(np.log(wavelength)) - log_at(np.log(np.array(float(reference_nm)))))


def check_phase(what: str, value: Any) -> None:
    """Raise UserError unless this is a phase function, or a mapping of them."""
    for each in _checked(what, value).values() if isinstance(value, Mapping) else (value,):
        if not hasattr(each, "moments"):
            raise UserError(f"{what} must be a phase function or {{wavelength_nm: phase function}}, got {shown(each)}")


def _checked(what: str, value: Mapping[Any, Any]) -> Mapping[Any, Any]:
    if not (value and all(_within(wavelength, *WAVELENGTHS_NM) for wavelength in value)):
        raise UserError(f"{what} must have wavelengths in nanometres, got {', '.join(map(str, value)) or 'none'}")
    return value


def _within(value: Any, low: float, high: float) -> bool:
    return np.ndim(value) == 0 and np.asarray(value).dtype.kind in "fiu" and bool(low <= value <= high)
