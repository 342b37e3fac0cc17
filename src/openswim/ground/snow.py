"""Snow and ice: how bright, and how much of the ground it covers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

FRESH_DAYS = 3.0  # age of snow where the model does not say
_COVERING_M = 0.05  # depth that covers 76 % of grass and soil
_IN_FOREST = 0.3  # of its albedo, that snow lends to forest


def snow_albedo(wavelengths_nm: ArrayLike, age_days: ArrayLike = FRESH_DAYS) -> FloatArray:
    """Albedo (n, nwl) of deep snow by its age [days] (n,), 400 to 700 nm (the ends hold beyond).

    Spectra of pure snow of 0.1 and 1 mm grains, the old one with soot and dust (after Wiscombe & Warren 1980, Warren &
    Wiscombe 1980); in between it ages as F = t / (t + 11.6 d), the BATS scheme's (Dickinson et al. 1993) at 0 C.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    age = np.maximum(np.atleast_1d(np.asarray(age_days, float)), 0.0)
    share = (age / (age + 11.6))[:, None]
    fresh = np.interp(wavelengths, [400, 500, 600, 700], [0.93, 0.93, 0.92, 0.90])
    old = np.interp(wavelengths, [400, 500, 600, 700], [0.68, 0.70, 0.68, 0.60])
    return fresh + share * (old - fresh)


def sea_ice_albedo(wavelengths_nm: ArrayLike, concentration: ArrayLike) -> FloatArray:
    """Albedo (n, nwl) of the ice itself where it covers `concentration` (n,) of the sea.

    Closed pack ice is thick and under snow in part, scattered floes are thin, wet and bare (spectra after Grenfell &
    Maykut 1977; bare first-year ice .5 to snow-covered .8, Brandt et al. 2005); linear in concentration.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    share = np.clip(np.asarray(concentration, float), 0.0, 1.0)[:, None]
    closed = np.interp(wavelengths, [400, 500, 600, 700], [0.80, 0.81, 0.77, 0.69])
    thin = np.interp(wavelengths, [400, 500, 600, 700], [0.55, 0.56, 0.47, 0.33])
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
