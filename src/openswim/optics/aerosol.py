"""Aerosol types: phase function, single-scattering albedo and Angstrom exponent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.optics import Optics
from openswim.scene.phase import AerosolPhase, AlbersDHG, HenyeyGreenstein, Mixture, PhaseFunction, phases_at
from openswim.scene.phase.tables import TABULATED, aerosol_tables

FloatArray = NDArray[np.float64]

BACKSCATTER_FRACTION = 0.125  # b of Albers et al. 2020, Eq. 4

NAMES = ("continental", *TABULATED, "colorado_dust", "saudi_dust_pollution")


@dataclass(frozen=True)
class AerosolType:
    """Optical character of an aerosol; mappings are {wavelength_nm: value}, interpolated linearly."""

    phase: PhaseFunction | Mapping[float, PhaseFunction]
    single_scattering_albedo: float | Mapping[float, float]
    angstrom_exponent: float


def double_hg(sharp_g: float, broad_g: float, sharp_fraction: float, f_b: float) -> PhaseFunction:
    """Pair of double Henyey-Greenstein functions (Albers et al. 2020, Eq. 28, corrected).

    `sharp_fraction` (f_c) weights the sharp lobe; g = f_c g_sharp + (1 - f_c) g_broad (Eq. 29).
    """
    return Mixture((sharp_fraction, 1 - sharp_fraction), (AlbersDHG(sharp_g, f_b), AlbersDHG(broad_g, f_b)))


@cache
def aerosol_type(name: str = "continental") -> AerosolType:
    """A named type, one of `NAMES`; "continental" is the default.

    dust, smoke, sea_salt, sulphate, pollution: Mie theory, large dust irregular (docs/optics.md). colorado_dust,
    saudi_dust_pollution: Albers et al. 2020, Table 3 (corrected: its g_1 and g_2 columns are swapped relative to
    Eq. 28); the paper gives no Angstrom exponents, .6 (coarse and fine mixed) is ours.
    """
    match name:
        case "continental":
            return AerosolType(HenyeyGreenstein(0.65), 0.95, 1.3)
        case "colorado_dust":
            phase = {
                615.0: double_hg(0.895, 0.59, 0.12, 0.550),
                546.0: double_hg(0.900, 0.60, 0.12, 0.550),
                450.0: double_hg(0.905, 0.61, 0.12, 0.550),
            }
            return AerosolType(phase, {615.0: 0.935, 546.0: 0.92, 450.0: 0.86}, 0.6)
        case "saudi_dust_pollution":
            phase = {
                615.0: double_hg(0.915, 0.23, 0.58, 0.562),
                546.0: double_hg(0.925, 0.27, 0.54, 0.558),
                450.0: double_hg(0.933, 0.29, 0.53, 0.558),
            }
            return AerosolType(phase, 0.96, 0.6)
        case _ if name in TABULATED:
            return _tabulated(name)
    raise UserError(f"unknown aerosol type {name!r}; known: {', '.join(NAMES)}")


def _tabulated(name: str) -> AerosolType:
    tables = aerosol_tables()
    wavelengths = tables["wavelength_nm"].tolist()
    slope = np.polyfit(np.log(wavelengths), np.log(tables[f"{name}_efficiency"]), 1)[0]
    return AerosolType(
        {wl: AerosolPhase(name, wl) for wl in wavelengths},
        dict(zip(wavelengths, tables[f"{name}_albedo"].tolist(), strict=True)),
        round(-float(slope), 3),
    )


def aerosol_profile(
    name: str = "continental",
    optical_depth: float = 0.05,
    scale_height_m: float = 1500.0,
    base_height_m: float | None = None,
    profile: Mapping[float, float] | None = None,
) -> AerosolProfile:
    """The layer of a named type, with its optical depth at 550 nm above the base (default: the ground of the place), or
    of a `profile` = {height above sea level in m: relative extinction}."""
    kind = aerosol_type(name)
    return AerosolProfile(
        optical_depth=optical_depth,
        angstrom_exponent=kind.angstrom_exponent,
        scale_height_m=scale_height_m,
        base_height_m=base_height_m,
        profile=profile,
        name=name,
        single_scattering_albedo=kind.single_scattering_albedo,
        phase=kind.phase,
    )


# Type, optical depth at 550 nm, and relative extinction by height above sea level in km. Background: years without
# eruptions (Thomason et al. 2018); pinatubo: early 1992 (Sato et al. 1993; McCormick & Veiga 1992); smoke: a plume of
# the Australian fires, January 2020 (Ohneiser et al. 2020).
STRATOSPHERES: dict[str, tuple[str, float, dict[float, float]]] = {
    "background": ("stratospheric", 0.005, {12: 0, 15: 0.7, 18: 1, 21: 0.8, 25: 0.3, 32: 0}),
    "pinatubo": ("volcanic", 0.15, {14: 0, 17: 0.3, 20: 0.9, 22.5: 1, 25: 0.7, 30: 0}),
    "smoke": ("smoke", 0.1, {12: 0, 15: 0.5, 19: 1, 22: 0.8, 25: 0}),
}


def stratospheric_layer(name: str, optical_depth: float | None = None) -> AerosolProfile:
    """A layer of aerosol in the stratosphere, one of `STRATOSPHERES`, with its own optical depth at 550 nm or another;
    the layer is called "stratosphere"."""
    if name not in STRATOSPHERES:
        raise UserError(f"stratosphere {shown(name)}: choose one of {', '.join(STRATOSPHERES)}")
    kind, usual, shape = STRATOSPHERES[name]
    table = {1e3 * km: value for km, value in shape.items()}
    layer = aerosol_profile(kind, usual if optical_depth is None else optical_depth, profile=table)
    return replace(layer, name="stratosphere")


def described_profile(saved: Mapping[str, Any]) -> AerosolProfile:
    """The profile that `AerosolProfile.to_dict` described; "aerosol_type" names a type that gives what is lacking."""
    given = dict(saved)
    if (name := given.pop("aerosol_type", None)) is None:
        return AerosolProfile.from_dict(given)
    kind = aerosol_type(str(name))
    given.setdefault("name", str(name))
    lacking = {key for key in ("angstrom_exponent", "single_scattering_albedo", "phase") if key not in given}
    return replace(AerosolProfile.from_dict(given), **{key: getattr(kind, key) for key in lacking})


def aerosol_optics(name: str) -> Optics:
    """What `Scene(optics=...)` takes for `aerosol_extinction` or an `extinction_<name>` at 550 nm of a named type."""
    kind = aerosol_type(name)
    return Optics(kind.single_scattering_albedo, kind.phase, "aerosol", kind.angstrom_exponent)


def type_of_profile(profile: AerosolProfile | None) -> AerosolType:
    """The optical character of a 1-D profile; continental where it, or its phase function, is not given."""
    default = aerosol_type()
    if profile is None:
        return default
    phase = default.phase if profile.phase is None else profile.phase
    return AerosolType(phase, profile.single_scattering_albedo, profile.angstrom_exponent)


def spectral_albedo(kind: AerosolType, wavelengths_nm: ArrayLike) -> FloatArray:
    """Single-scattering albedo at each wavelength, (nwl,)."""
    return interpolate_spectral(kind.single_scattering_albedo, wavelengths_nm)


def spectral_phase(kind: AerosolType, wavelengths_nm: ArrayLike) -> list[PhaseFunction]:
    """Phase function at each wavelength."""
    return phases_at(kind.phase, wavelengths_nm)


def interpolate_spectral(value: float | Mapping[float, float], wavelengths_nm: ArrayLike) -> FloatArray:
    """A constant, or a {wavelength_nm: value} mapping interpolated linearly (constant beyond its ends), as (nwl,)."""
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    if not isinstance(value, Mapping):
        return np.full(wavelengths.shape, float(value))
    known = sorted(value)
    return np.interp(wavelengths, known, [value[wl] for wl in known])
