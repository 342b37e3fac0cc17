"""Optical properties of matter that a scene gives by its extinction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import numbers, shown
from openswim.errors import UserError
from openswim.scene.particles import (
    ANGSTROM_EXPONENTS,
    RELATIVE_EXTINCTIONS,
    check_albedo,
    check_number,
    check_phase,
    check_spectrum,
)
from openswim.scene.phase import PhaseFunction
from openswim.scene.variables import HYDROMETEORS

KINDS = (*HYDROMETEORS, "aerosol", "other")


@dataclass(frozen=True)
class Optics:
    """Optical properties of a species given directly by its extinction.

    single_scattering_albedo : scalar, one value for each wavelength that will be asked for, or {wavelength_nm: value}.
    phase : its phase function (mean 1 over the sphere), or {wavelength_nm: phase function}.
    kind : "liquid", "ice", "rain", "snow", "graupel", "aerosol" or "other".
    angstrom_exponent : the field is extinction at 550 nm, and follows this power; None: the same at all wavelengths
        (of "aerosol": as the background aerosol's).
    relative_extinction : {wavelength_nm: value} in place of the power law, where that is too coarse.

    `openswim.optics.aerosol_optics` makes one from the name of an aerosol type.
    """

    single_scattering_albedo: float | NDArray[np.float64] | Mapping[float, float]
    phase: PhaseFunction | Mapping[float, PhaseFunction]
    kind: str = "other"
    angstrom_exponent: float | None = None
    relative_extinction: Mapping[float, float] | None = None

    def __post_init__(self) -> None:
        given = self.single_scattering_albedo
        if isinstance(given, Mapping):
            check_albedo("optics: single_scattering_albedo", given)
        else:
            albedo = numbers("optics: single_scattering_albedo", given).astype(np.float64)
            if albedo.ndim > 1 or albedo.size == 0 or not ((albedo >= 0.0) & (albedo <= 1.0)).all():
                raise UserError("optics: single_scattering_albedo must be a number or a list within 0 to 1")
            object.__setattr__(self, "single_scattering_albedo", float(albedo) if albedo.ndim == 0 else albedo)
        check_phase("optics: phase", self.phase)
        if not isinstance(self.kind, str) or self.kind not in KINDS:
            raise UserError(f"optics: kind {shown(self.kind)} is unknown: choose one of {', '.join(KINDS)}")
        if self.angstrom_exponent is not None:
            check_number("optics: angstrom_exponent", self.angstrom_exponent, *ANGSTROM_EXPONENTS)
        if self.relative_extinction is not None:
            check_spectrum("optics: relative_extinction", self.relative_extinction, *RELATIVE_EXTINCTIONS)
