"""Cloud and precipitation particles: size, extinction and phase function from what a model knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.optics import ice, mie
from openswim.optics.displays import crystals, droplets
from openswim.optics.displays.shapes import Shapes
from openswim.scene.phase import HenyeyGreenstein, Mixture, PhaseFunction

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

DEFAULT_ICE_RADIUS_M = 34e-6
PLAIN = Shapes(pristine=0.0)
_MOST_BALANCED = 0.8  # share of pristine ice up to which the rough rest keeps the mean cosine as it was
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


def known_radius_m(
    kind: str,
    content_kg_m3: ArrayLike,
    own_radius_m: ArrayLike | None = None,
    number_per_m3: ArrayLike | None = None,
) -> FloatArray:
    """Effective radius (m, shape of the content): the model's own first, then from its number, then the default; each
    where it is positive and finite."""
    content = _clean(content_kg_m3)
    radius = default_effective_radius_m(kind, content)
    if number_per_m3 is not None:
        radius = _prefer(effective_radius_from_number_m(kind, content, number_per_m3), radius)
    if own_radius_m is not None:
        radius = _prefer(np.broadcast_to(np.asarray(own_radius_m, content.dtype), content.shape), radius)
    return radius


def effective_radius_m(
    kind: str,
    content_kg_m3: ArrayLike,
    own_radius_m: ArrayLike | None = None,
    number_per_m3: ArrayLike | None = None,
) -> FloatArray:
    """`known_radius_m` within the kind's plausible range."""
    constants = _kind(kind)
    radius = known_radius_m(kind, content_kg_m3, own_radius_m, number_per_m3)
    return np.clip(radius, constants.smallest_radius_m, constants.largest_radius_m)


def extinction_per_m(
    kind: str,
    content_kg_m3: ArrayLike,
    own_radius_m: ArrayLike | None = None,
    number_per_m3: ArrayLike | None = None,
) -> FloatArray:
    """Extinction coefficient, 1/m: 1.5 content / (r_e density) (Albers et al. 2020, Eq. 7), r_e as above.

    The large-particle limit; `scene_optics` multiplies it by `extinction_factor`. Negative or missing content counts
    as none. Snow with the model's own radius has the density of a flake of that size (.066 kg/m2 / r_e, 70-917
    kg/m3), the default snow 70 kg/m3.
    """
    content = _clean(content_kg_m3)
    radius = effective_radius_m(kind, content, own_radius_m, number_per_m3)
    density = np.full_like(content, _kind(kind).density_kg_m3)
    if kind == "snow" and own_radius_m is not None:
        own = np.broadcast_to(np.asarray(own_radius_m, content.dtype), content.shape)
        flake = np.clip(_SNOW_RADIUS_TIMES_DENSITY_KG_M2 / radius, _kind(kind).density_kg_m3, 917.0)
        density = np.where(np.isfinite(own) & (own > 0), flake, density)
    return 1.5 * content / (radius * density)


def extinction_factor(kind: str, wavelength_nm: float, radius_m: ArrayLike) -> FloatArray:
    """Extinction over that of Eq. 7 (shape of the radius): half the Mie efficiency of liquid and rain, else 1.

    1.045 for droplets of 10 um, 1.08 at 4 um; the edge of a large particle counts for nothing.
    """
    if _kind(kind) and kind in mie.KINDS:
        return 0.5 * mie.extinction_efficiency(kind, wavelength_nm, radius_m)
    return np.ones_like(np.asarray(radius_m))


def phase_function(
    kind: str, wavelength_nm: float, radius_m: float | None = None, shapes: Shapes = PLAIN
) -> PhaseFunction:
    """Single-scattering phase function of a kind of particle, of effective radius `radius_m` where it matters.

    Liquid and rain: Mie theory (`openswim.optics.mie`; of droplets more alike than usual `displays.droplets`). Ice,
    snow, graupel: Henyey-Greenstein lobes, half of the light in the diffraction peak. Ice (default 34 um) has the g of
    the severely roughened habit mixture of Baum et al. (2014), in the visible .77 at 5 um to .81 at 60 um and more
    where ice absorbs, no halo, and the lidar ratio of cirrus (33 sr, Josset et al. 2012) by a narrow lobe backward; ice
    that is pristine in part has the same g, and halos by that part. Snow is Albers et al. 2020, Eq. B3 (corrected) for
    thin clouds, g = .87; graupel g = .57.
    """
    match kind:
        case "liquid" if shapes.droplet_variance < droplets.USUAL_VARIANCE:
            radius_m = mie.DEFAULT_RADIUS_M[kind] if radius_m is None else radius_m
            return droplets.phase_function(wavelength_nm, radius_m, shapes.droplet_variance)
        case "liquid" | "rain":
            return mie.phase_function(kind, wavelength_nm, radius_m)
        case "ice":
            pristine = shapes.pristine / max(1 - shapes.plates - shapes.columns, 1e-9)  # of what is not level
            return _ice(DEFAULT_ICE_RADIUS_M if radius_m is None else radius_m, wavelength_nm, min(pristine, 1.0))
        case "snow":
            return _lobes((0.50, 0.998), (0.45, 0.86), (0.03, 0.0), (0.02, -0.6))
        case "graupel":
            return _lobes((0.50, 0.998), (0.30, 0.5), (0.20, -0.4))
    raise _unknown(kind)


def single_scattering_albedo(kind: str, wavelengths_nm: ArrayLike, radius_m: float | None = None) -> FloatArray:
    """(nwl,): Mie for liquid and rain; ice, snow and graupel by the ice that they are made of (`openswim.optics.ice`),
    1 in the visible. Snow and graupel are taken as crystals of as much ice per shadow."""
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    constants = _kind(kind)
    if kind in mie.KINDS:
        return mie.single_scattering_albedo(kind, wavelengths, radius_m)
    if radius_m is None:
        radius_m = DEFAULT_ICE_RADIUS_M if kind == "ice" else float(default_effective_radius_m(kind, 0.0))
    return 1 - ice.coalbedo(wavelengths, radius_m * constants.density_kg_m3 / ice.ICE_KG_M3)


def _ice(radius_m: float, wavelength_nm: float, pristine: float) -> PhaseFunction:
    asymmetry = 0.744 + 0.0167 * np.log(np.clip(radius_m, 5e-6, 60e-6) * 1e6)
    asymmetry += ice.more_asymmetry(wavelength_nm, radius_m)
    if pristine == 0:
        return _rough(asymmetry)
    smooth = crystals.phase_function(wavelength_nm)
    if pristine > _MOST_BALANCED:
        return Mixture((1 - pristine, pristine), (_rough(asymmetry), smooth))
    return Mixture(
        (1 - pristine, pristine), (_rough((asymmetry - pristine * smooth.asymmetry) / (1 - pristine)), smooth)
    )


def _rough(asymmetry: float) -> PhaseFunction:
    peak, side, back, glint = (0.50, 0.998), (0.07, 0.0), (0.02, -0.5), (0.0002, -0.95)
    broad = 1 - sum(weight for weight, _ in (peak, side, back, glint))
    rest = asymmetry - sum(weight * g for weight, g in (peak, side, back, glint))
    return _lobes(peak, (broad, float(rest / broad)), side, back, glint)


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
