"""Optical properties of air, aerosol, cloud and precipitation."""

from openswim.optics.aerosol import aerosol_optics, aerosol_profile, aerosol_type
from openswim.optics.fit import DoubleHGFit, fit_double_hg
from openswim.optics.species import Background, OpticalSpecies, background, scene_optics
from openswim.scene.phase import (
    AlbersDHG,
    DoubleHenyeyGreenstein,
    HenyeyGreenstein,
    Mixture,
    PhaseFunction,
    Rayleigh,
    TablePhase,
)

__all__ = [
    "AlbersDHG",
    "Background",
    "DoubleHGFit",
    "DoubleHenyeyGreenstein",
    "HenyeyGreenstein",
    "Mixture",
    "OpticalSpecies",
    "PhaseFunction",
    "Rayleigh",
    "TablePhase",
    "aerosol_optics",
    "aerosol_profile",
    "aerosol_type",
    "background",
    "fit_double_hg",
    "scene_optics",
]
