"""Cloud and precipitation particles: size, extinction and phase function from what a model knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.optics import mie
from openswim.optics.phase import HenyeyGreenstein, Mixture, PhaseFunction

FloatArray = NDArray[Any]


@dataclass(frozen=True)
class Hydrometeor:
    """Constants of one kind of particle.

    `volume_ratio` is (mean-volume radius / effective radius)^3: .72 for a gamma distribution of variance .1
    (cloud droplets), 2/9 for an exponential one (everything that grows by collection). `backscatter_fraction`
    is the b of Albers et al. 2020, Eqs 4 and 24.
    """

    density_kg_m3: float
    volume_ratio: float
    smallest_radius_m: float
    largest_radius_m: float
    backscatter_fraction: float


HYDROMETEORS = {
    "liquid": Hydrometeor(1000.0, 0.72, 2e-6, 60e-6, 0.063),
    "ice": Hydrometeor(917.0, 2 / 9, 3e-6, 400e-6, 0.14),
    "rain": Hydrometeor(1000.0, 2 / 9, 20e-6, 4e-3, 0.063),
    "snow": Hydrometeor(70.0, 2 / 9, 20e-6, 20e-3, 0.14),
    "graupel": Hydrometeor(500.0, 2 / 9, 50e-6, 20e-3, 0.30),
}

# Snow flakes weigh about 0.069 D^2 (kg, m; Wilson & Ballard 1999), so radius times density is nearly
# constant.
_SNOW_RADIUS_TIMES_DENSITY_KG_M2 = 0.066

_LEAST_NUMBER_PER_M3 = 1e-6  # less is numerical noise


def default_effective_radius_m(kind: str, content_kg_m3: ArrayLike) -> FloatArray:
    """Effective radius (m, shape of `content_kg_m3`) when the model gives neither radius nor number.

    Albers et al. 2020, Eq. 7 (corrected): liquid 3 + 8 sqrt(g/m3) um, ice 34 um (content / 1.66e-6
    kg/m3)^.14, rain 750 um, snow 4 mm, graupel 10 mm.
    """
    content = _clean(content_kg_m3)
    match kind:
        case "liquid":
            return (3.0 + 8.0 * np.sqrt(content * 1e3)) * 1e-6
        case "ice":
            return np.maximum(34e-6 * (content / 1.66e-6) ** 0.14, _kind("ice").smallest_radius_m)
        case "rain":
            return np.full_like(content, 750e-6)
        case "snow":
            return np.full_like(content, 4e-3)
        case "graupel":
            return np.full_like(content, 10e-3)
    raise _unknown(kind)


def effective_radius_from_number_m(
    kind: str, content_kg_m3: ArrayLike, number_per_m3: ArrayLike
) -> FloatArray:
    """Effective radius (m) of `number_per_m3` particles sharing the content; NaN where there are none.

    r_e = (3 content / (4 pi density number))^(1/3) / volume_ratio^(1/3) (Martin et al. 1994).
    """
    constants = _kind(kind)
    content, number = _clean(content_kg_m3), _clean(number_per_m3)
    known = (content > 0) & (number > _LEAST_NUMBER_PER_M3)
    volume = np.where(known, content, np.nan) / (constants.density_kg_m3 * np.where(known, number, 1.0))
    return np.cbrt(3 * volume / (4 * np.pi * constants.volume_ratio))


def extinction_per_m(
    kind: str,
    content_kg_m3: ArrayLike,
    effective_radius_m: ArrayLike | None = None,
    number_per_m3: ArrayLike | None = None,
) -> FloatArray:
    """Extinction coefficient, 1/m: 1.5 content / (r_e density) (Albers et al. 2020, Eq. 7).

    The model's own radius counts first, then its number, then the default; each where it is positive and
    finite, and kept within the kind's plausible range. Negative or missing content counts as none.
    Large-particle limit: Mie theory is 2-9 % higher for droplets of 10-4 um. Snow with the model's own radius
    has the density of a flake of that size (.066 kg/m2 / r_e, 70-917 kg/m3), the default snow 70 kg/m3.
    """
    constants = _kind(kind)
    content = _clean(content_kg_m3)
    radius = default_effective_radius_m(kind, content)
    density = np.full_like(content, constants.density_kg_m3)
    if number_per_m3 is not None:
        radius = _prefer(effective_radius_from_number_m(kind, content, number_per_m3), radius)
    if effective_radius_m is not None:
        own = np.broadcast_to(np.asarray(effective_radius_m, content.dtype), content.shape)
        radius = _prefer(own, radius)
    radius = np.clip(radius, constants.smallest_radius_m, constants.largest_radius_m)
    if kind == "snow" and effective_radius_m is not None:
        flake = np.clip(_SNOW_RADIUS_TIMES_DENSITY_KG_M2 / radius, constants.density_kg_m3, 917.0)
        density = np.where(np.isfinite(own) & (own > 0), flake, density)
    return 1.5 * content / (radius * density)


def phase_function(kind: str, wavelength_nm: float) -> PhaseFunction:
    """Single-scattering phase function of a kind of particle.

    Liquid and rain: Mie theory (`openswim.optics.mie`). Ice, snow, graupel: Henyey-Greenstein lobes, half of
    the light in the diffraction peak; ice has g = .80, as the roughened habit mixture of Baum et al. (2014)
    at 34 um; snow is Albers et al. 2020, Eq. B3 (corrected) for thin clouds, g = .87; graupel g = .57.
    """
    match kind:
        case "liquid" | "rain":
            return mie.phase_function(kind, wavelength_nm)
        case "ice":
            return _lobes((0.50, 0.998), (0.41, 0.75), (0.07, 0.0), (0.02, -0.5))
        case "snow":
            return _lobes((0.50, 0.998), (0.45, 0.86), (0.03, 0.0), (0.02, -0.6))
        case "graupel":
            return _lobes((0.50, 0.998), (0.30, 0.5), (0.20, -0.4))
    raise _unknown(kind)


def single_scattering_albedo(kind: str, wavelengths_nm: ArrayLike) -> FloatArray:
    """(nwl,): Mie for liquid and rain; 1 for ice, snow and graupel (their absorption is below 1e-4 in the
    visible)."""
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    _kind(kind)
    if kind in mie.KINDS:
        return mie.single_scattering_albedo(kind, wavelengths)
    return np.ones_like(wavelengths)


def _lobes(*lobes: tuple[float, float]) -> PhaseFunction:
    return Mixture([weight for weight, _ in lobes], [HenyeyGreenstein(g) for _, g in lobes])


def _prefer(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.where(np.isfinite(first) & (first > 0), first, second)


def _clean(content: ArrayLike) -> FloatArray:
    array = np.asarray(content)
    if array.dtype != np.float32:  # which large fields keep
        array = array.astype(np.float64)
    return np.maximum(np.nan_to_num(array, nan=0.0, posinf=0.0, neginf=0.0), 0.0)


def _kind(kind: str) -> Hydrometeor:
    if kind not in HYDROMETEORS:
        raise _unknown(kind)
    return HYDROMETEORS[kind]


def _unknown(kind: str) -> UserError:
    return UserError(f"unknown kind of hydrometeor {kind!r}; known: {', '.join(HYDROMETEORS)}")
