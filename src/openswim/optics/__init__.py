"""Optical properties of air, aerosol, cloud and precipitation."""

from openswim.optics.phase import (
    AlbersDHG,
    DoubleHenyeyGreenstein,
    HenyeyGreenstein,
    Mixture,
    PhaseFunction,
    Rayleigh,
    TablePhase,
)
from openswim.optics.species import Background, OpticalSpecies, background, scene_optics

__all__ = [
    "AlbersDHG",
    "Background",
    "DoubleHenyeyGreenstein",
    "HenyeyGreenstein",
    "Mixture",
    "OpticalSpecies",
    "PhaseFunction",
    "Rayleigh",
    "TablePhase",
    "background",
    "scene_optics",
]
