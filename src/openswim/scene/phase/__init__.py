"""Phase functions: data that describe matter."""

from openswim.scene.phase.functions import (
    AlbersDHG,
    DoubleHenyeyGreenstein,
    HenyeyGreenstein,
    Mixture,
    PhaseFunction,
    Rayleigh,
    phases_at,
)
from openswim.scene.phase.saved import by_wavelength, phase_from_dict, phases_from_dict
from openswim.scene.phase.tables import AerosolPhase, TablePhase

__all__ = [
    "AerosolPhase",
    "AlbersDHG",
    "DoubleHenyeyGreenstein",
    "HenyeyGreenstein",
    "Mixture",
    "PhaseFunction",
    "Rayleigh",
    "TablePhase",
    "by_wavelength",
    "phase_from_dict",
    "phases_at",
    "phases_from_dict",
]
