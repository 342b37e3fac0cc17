"""What properties of particles must be: a value within its range, or several of them as {wavelength_nm: value}."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from openswim.errors import UserError

ANGSTROM_EXPONENTS = (-10.0, 10.0)
WAVELENGTHS_NM = (100.0, 1e5)  # nothing else is likely to be nanometres


def check_number(what: str, value: Any, low: float, high: float) -> None:
    """Raise UserError unless this is a number from `low` to `high`."""
    if not _within(value, low, high):
        raise UserError(f"{what} must be a number within {low:g} to {high:g}, got {value!r}")


def check_albedo(what: str, value: Any) -> None:
    """Raise UserError unless this is a single-scattering albedo, or a mapping of them."""
    for each in _checked(what, value).values() if isinstance(value, Mapping) else (value,):
        check_number(what, each, 0.0, 1.0)


def check_phase(what: str, value: Any) -> None:
    """Raise UserError unless this is a phase function, or a mapping of them."""
    for each in _checked(what, value).values() if isinstance(value, Mapping) else (value,):
        if not hasattr(each, "moments"):
            raise UserError(f"{what} must be a phase function or {{wavelength_nm: phase function}}, got {each!r}")


def _checked(what: str, value: Mapping[Any, Any]) -> Mapping[Any, Any]:
    if not (value and all(_within(wavelength, *WAVELENGTHS_NM) for wavelength in value)):
        raise UserError(f"{what} must have wavelengths in nanometres, got {', '.join(map(str, value)) or 'none'}")
    return value


def _within(value: Any, low: float, high: float) -> bool:
    return np.ndim(value) == 0 and np.asarray(value).dtype.kind in "fiu" and bool(low <= value <= high)
