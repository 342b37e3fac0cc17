"""Phase functions from what `to_dict` says of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.scene.phase.functions import AlbersDHG, HenyeyGreenstein, Mixture, PhaseFunction, Rayleigh
from openswim.scene.phase.tables import AerosolPhase, TablePhase


def phase_from_dict(saved: Mapping[str, Any]) -> PhaseFunction:
    """The phase function that `to_dict` described."""
    try:
        return _from_dict(saved)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise UserError(
            f"phase function {shown(saved)} is not understood: give what to_dict() of one gives, such as "
            '{"type": "henyey_greenstein", "g": 0.85}'
        ) from error


def _from_dict(saved: Mapping[str, Any]) -> PhaseFunction:
    match saved.get("type"):
        case "henyey_greenstein":
            return HenyeyGreenstein(saved["g"])
        case "mixture":
            return Mixture(saved["weights"], [phase_from_dict(p) for p in saved["phases"]])
        case "albers_dhg":
            return AlbersDHG(saved["g"], saved["f_b"])
        case "rayleigh":
            return Rayleigh(saved["depolarisation"])
        case "table":
            return TablePhase(saved["angle_deg"], saved["value"])
        case "aerosol":
            return AerosolPhase(saved["name"], saved["wavelength_nm"])
        case unknown:
            known = "henyey_greenstein, mixture, albers_dhg, rayleigh, table, aerosol"
            raise UserError(f"unknown phase function type {shown(unknown)}: choose one of {known}")


def phases_from_dict(saved: Any) -> PhaseFunction | dict[float, PhaseFunction]:
    """One phase function, or {wavelength_nm: phase function} of {"spectral": {...}}."""
    if not (isinstance(saved, Mapping) and isinstance(spectral := saved.get("spectral"), Mapping)):
        return phase_from_dict(saved)
    return {wavelength: phase_from_dict(each) for wavelength, each in by_wavelength("phase function", spectral).items()}


def by_wavelength(what: str, saved: Mapping[str, Any]) -> dict[float, Any]:
    """{wavelength_nm: value} of a mapping whose keys are text, as JSON's are."""
    try:
        return {float(wavelength): value for wavelength, value in saved.items()}
    except ValueError:
        raise UserError(f"{what} must have wavelengths in nanometres, got {', '.join(saved)}") from None
