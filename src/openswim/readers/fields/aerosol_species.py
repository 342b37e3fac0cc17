"""Aerosol species as models carry them, and how much light a gram of each takes out of a beam.

Mass-extinction, single-scattering albedo and asymmetry at 550 nm follow the optical models that Bozzo et al. (2020,
GMD 13, 1007) chose for the IFS (OPAC, Dubovik et al. 2002), rounded; growth with humidity is k (1 - RH)^-gamma,
within 25 % of theirs from 40 to 90 %. docs/models.md has the table and what it cannot do.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.scene import Optics
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.phase import HenyeyGreenstein

F32 = NDArray[np.float32]
_DAMPEST = 0.95  # growth beyond is cloud


@dataclass(frozen=True)
class AerosolSpecies:
    """Optics of one species at 550 nm.

    extinction_m2_g: in dry air, of the mass that the model counts; growth: exponent gamma of (1 - RH)^-gamma; albedo:
    single scattering; asymmetry; angstrom: exponent.
    """

    label: str
    extinction_m2_g: float
    growth: float
    albedo: float
    asymmetry: float
    angstrom: float


def _s(
    label: str, extinction: float, growth: float, albedo: float, asymmetry: float, angstrom: float
) -> AerosolSpecies:
    return AerosolSpecies(label, extinction, growth, albedo, asymmetry, angstrom)


_DUST_FINE = _s("dust", 2.5, 0.0, 0.985, 0.66, 0.0)
_DUST_MIDDLE = _s("dust", 0.94, 0.0, 0.96, 0.63, -0.3)
_DUST_COARSE = _s("dust", 0.41, 0.0, 0.93, 0.76, 0.0)
_SALT_FINE = _s("sea salt", 1.36, 0.70, 1.0, 0.78, 1.4)  # these three per mass at 80 % humidity, as CAMS counts it
_SALT_MIDDLE = _s("sea salt", 0.22, 0.48, 1.0, 0.81, -0.1)
_SALT_COARSE = _s("sea salt", 0.060, 0.50, 1.0, 0.85, 0.0)
_ORGANIC = _s("organic matter", 3.0, 0.43, 0.94, 0.67, 1.5)
_ORGANIC_DRY = _s("organic matter", 3.3, 0.0, 0.91, 0.63, 1.55)
_SOOT = _s("black carbon", 9.4, 0.0, 0.21, 0.33, 1.3)
_SULPHATE = _s("sulphate", 4.1, 0.59, 1.0, 0.69, 1.7)
_NITRATE = _s("nitrate", 3.5, 0.49, 1.0, 0.66, 1.6)
_NITRATE_COARSE = _s("nitrate", 0.25, 0.44, 1.0, 0.84, 0.0)
_AMMONIUM = _s("ammonium", 3.0, 0.59, 1.0, 0.69, 1.7)
SMOKE = _s("smoke", 4.5, 0.2, 0.92, 0.63, 1.8)  # Reid et al. 2005 (ACP 5, 827): fresh to aged biomass smoke
FINE_PARTICLES = _s("fine particles", 4.0, 0.35, 0.94, 0.65, 1.5)  # PM2.5 of mixed origin


SPECIES: dict[str, AerosolSpecies] = {
    # CAMS (ECMWF short names)
    "aermr01": _SALT_FINE,
    "aermr02": _SALT_MIDDLE,
    "aermr03": _SALT_COARSE,
    "aermr04": _DUST_FINE,
    "aermr05": _DUST_MIDDLE,
    "aermr06": _DUST_COARSE,
    "aermr07": _ORGANIC,
    "aermr08": _ORGANIC_DRY,
    "aermr09": _SOOT,
    "aermr10": _SOOT,
    "aermr11": _SULPHATE,
    "aermr16": _NITRATE,
    "aermr17": _NITRATE_COARSE,
    "aermr18": _AMMONIUM,
    "aermr19": _ORGANIC,
    "aermr20": _ORGANIC,
    # MERRA-2 and GEOS (GOCART): dust of .1-1, 1-1.8, 1.8-3, 3-6, 6-10 um, dry salt of .03-.1, .1-.5, .5-1.5, 1.5-5,
    # 5-10 um; where OPAC has no such bin, 3 Q/(4 density radius) with Q = 2.3
    "DU001": _s("dust", 1.9, 0.0, 0.97, 0.68, 0.2),
    "DU002": _s("dust", 0.62, 0.0, 0.94, 0.70, -0.2),
    "DU003": _s("dust", 0.34, 0.0, 0.91, 0.77, 0.0),
    "DU004": _s("dust", 0.17, 0.0, 0.86, 0.81, 0.0),
    "DU005": _s("dust", 0.09, 0.0, 0.81, 0.84, 0.0),
    "SS001": _s("sea salt", 0.9, 1.0, 1.0, 0.6, 2.0),
    "SS002": _s("sea salt", 2.5, 0.62, 1.0, 0.75, 0.9),
    "SS003": _s("sea salt", 0.78, 0.55, 1.0, 0.77, 0.0),
    "SS004": _s("sea salt", 0.24, 0.55, 1.0, 0.82, 0.0),
    "SS005": _s("sea salt", 0.10, 0.55, 1.0, 0.85, 0.0),
    "SO4": _SULPHATE,
    "BCPHOBIC": _SOOT,
    "BCPHILIC": _SOOT,
    "OCPHOBIC": _ORGANIC_DRY,
    "OCPHILIC": _ORGANIC,
    "NI001": _NITRATE,
    "NI002": _NITRATE_COARSE,
    "NI003": _NITRATE_COARSE,
    "NH4A": _AMMONIUM,
}


def species_of_name(name: str) -> AerosolSpecies | None:
    """The species of a CAMS or MERRA-2 variable name; new CAMS files write "aermr04" in the same way."""
    return SPECIES.get(name) or SPECIES.get(name.lower()) or SPECIES.get(re.sub(r"_mmr$", "", name))


def extinction_per_m(species: AerosolSpecies, mass_kg_m3: F32, relative_humidity: F32 | None) -> F32:
    """Extinction at 550 nm [m-1] of a mass per volume of air as the model counts it."""
    dry_g = mass_kg_m3 * np.float32(1e3 * species.extinction_m2_g)
    if species.growth == 0.0 or relative_humidity is None:
        return np.asarray(dry_g, np.float32)
    humidity = np.clip(relative_humidity, 0.0, _DAMPEST)
    return (dry_g * (1.0 - humidity) ** np.float32(-species.growth)).astype(np.float32)


@dataclass
class AerosolSum:
    """Species added up: extinction at 550 nm, and what its mean particle is like."""

    extinction_per_m: F32
    albedo: float
    asymmetry: float
    angstrom: float
    labels: list[str]

    @property
    def optics(self) -> Optics:
        """What its mean particle is like."""
        return Optics(self.albedo, HenyeyGreenstein(self.asymmetry), "aerosol")

    @property
    def instead_of_background(self) -> AerosolProfile:
        """A background aerosol of no depth, whose exponent the field takes."""
        return AerosolProfile(optical_depth=0.0, angstrom_exponent=self.angstrom)


def added_up(parts: list[tuple[AerosolSpecies, F32]]) -> AerosolSum:
    """Sum of species' extinctions; albedo weighted by extinction, asymmetry by scattering, over the domain."""
    total: F32 = np.sum(np.stack([extinction for _, extinction in parts]), axis=0, dtype=np.float32)
    weights = np.array([float(extinction.sum(dtype=np.float64)) for _, extinction in parts])
    if not weights.sum() > 0:
        weights = np.ones(len(parts))
    albedos = np.array([species.albedo for species, _ in parts])
    scattering = weights * albedos
    return AerosolSum(
        total,
        float(np.average(albedos, weights=weights)),
        float(np.average([species.asymmetry for species, _ in parts], weights=scattering)),
        float(np.average([species.angstrom for species, _ in parts], weights=weights)),
        sorted({species.label for species, _ in parts}),
    )
