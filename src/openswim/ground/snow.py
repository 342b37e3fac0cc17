"""Snow and ice: how bright, and how much of the ground it covers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.optics import ice

FloatArray = NDArray[np.float64]

_LAST_VISIBLE_NM = 700.0
_GRAIN_ASYMMETRY = 0.82  # at 700 nm
_ICE_NM = [400, 500, 600, 700, 800, 900, 1000, 1100, 1200, 1300, 1450, 1700]
FRESH_DAYS = 3.0  # age of snow where the model does not say
_COVERING_M = 0.05  # depth that covers 76 % of grass and soil
_IN_FOREST = 0.3  # of its albedo, that snow lends to forest


def snow_albedo(wavelengths_nm: ArrayLike, age_days: ArrayLike = FRESH_DAYS) -> FloatArray:
    """Albedo (n, nwl) of deep snow by its age [days] (n,), 400 to 1700 nm (the ends hold beyond).

    Spectra of pure snow of 0.1 and 1 mm grains, the old one with soot and dust (after Wiscombe & Warren 1980, Warren &
    Wiscombe 1980); in between it ages as F = t / (t + 11.6 d), the BATS scheme's (Dickinson et al. 1993) at 0 C. Beyond
    700 nm by what ice absorbs, `deep_snow`, times what the soot leaves at 700 nm.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    age = np.maximum(np.atleast_1d(np.asarray(age_days, float)), 0.0)
    share = (age / (age + 11.6))[:, None]
    fresh = np.interp(wavelengths, [400, 500, 600, 700], [0.93, 0.93, 0.92, 0.90])
    old = np.interp(wavelengths, [400, 500, 600, 700], [0.68, 0.70, 0.68, 0.60])
    if wavelengths.max(initial=0.0) > _LAST_VISIBLE_NM:
        fresh, old = (
            np.where(wavelengths <= _LAST_VISIBLE_NM, seen, seen * deep_snow(wavelengths, radius_m))
            for seen, radius_m in ((fresh, 0.1e-3), (old, 1e-3))
        )
    return fresh + share * (old - fresh)


def deep_snow(wavelengths_nm: FloatArray, radius_m: float) -> FloatArray:
    """Albedo (nwl,) of endless snow of grains of a radius under a white sky, over that at 700 nm: (1 - s)(1 - .139 s) /
    (1 + 1.17 s), s^2 = (1 - w)/(1 - w g) (van de Hulst 1980), the grains' w and g those of large rough crystals."""
    known_nm = np.append(wavelengths_nm, _LAST_VISIBLE_NM)
    scattered = 1 - ice.coalbedo(known_nm, radius_m)
    g = _GRAIN_ASYMMETRY + np.array([ice.more_asymmetry(nm, radius_m) for nm in known_nm])
    s = np.sqrt((1 - scattered) / (1 - scattered * g))
    albedo = (1 - s) * (1 - 0.139 * s) / (1 + 1.17 * s)
    return np.asarray(albedo[:-1] / albedo[-1])


def sea_ice_albedo(wavelengths_nm: ArrayLike, concentration: ArrayLike) -> FloatArray:
    """Albedo (n, nwl) of the ice itself where it covers `concentration` (n,) of the sea.

    Closed pack ice is thick and under snow in part, scattered floes are thin, wet and bare (spectra after Grenfell &
    Maykut 1977 to 1000 nm, beyond as snow on it absorbs; bare first-year ice .5 to snow-covered .8, Brandt et al.
    2005); linear in concentration.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    share = np.clip(np.asarray(concentration, float), 0.0, 1.0)[:, None]
    closed = np.interp(wavelengths, _ICE_NM, [0.80, 0.81, 0.77, 0.69, 0.62, 0.53, 0.40, 0.30, 0.20, 0.15, 0.07, 0.07])
    thin = np.interp(wavelengths, _ICE_NM, [0.55, 0.56, 0.47, 0.33, 0.22, 0.13, 0.08, 0.06, 0.05, 0.04, 0.04, 0.04])
    return thin + share * (closed - thin)


def fraction_from_depth(depth_m: ArrayLike) -> FloatArray:
    """Share of the ground that snow of a depth [m] covers: tanh(depth / 5 cm) (form of Niu & Yang 2007)."""
    return np.tanh(np.maximum(np.asarray(depth_m, float), 0.0) / _COVERING_M)


def forest_share(visible_albedo: FloatArray) -> FloatArray:
    """Share of forest on land of a snow-free visible albedo (n,): 1 at a map's darkest green (.03), 0 at .1."""
    return np.interp(visible_albedo, [0.03, 0.1], [1.0, 0.0])


def out_of_the_snow(forest: FloatArray) -> FloatArray:
    """What snow lends of its albedo to land with a share of forest (n,): .3 of it to forest, all to bare ground.

    Trees stand out of it: snow-covered evergreen forest has .2 to .3 in the visible, grassland .7 to .9 (MODIS,
    Gao et al. 2005).
    """
    return 1.0 - (1.0 - _IN_FOREST) * forest
