"""Snow and ice: how bright, and where a model's fraction of a cell lies."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

FRESH_DAYS = 3.0  # age of snow where the model does not say
_COVERING_M = 0.05  # depth that covers 76 % of grass and soil
_LOGISTIC = 1.702  # the logistic function at 1.702 x is the normal distribution at x, within .01
_SOFTNESS = 0.45  # 0: snow or none, nothing between; large: the same everywhere in the cell


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


def out_of_the_snow(visible_albedo: FloatArray) -> FloatArray:
    """What snow lends of its albedo to land of a snow-free visible albedo (n,): .3 of it to forest, all to bare ground.

    Trees stand out of it: snow-covered evergreen forest has .2 to .3 in the visible, grassland .7 to .9 (MODIS,
    Gao et al. 2005); the darkest green of a map (.03) is forest, .1 is not.
    """
    return np.interp(visible_albedo, [0.03, 0.1], [0.3, 1.0])


def resolved_cover(fraction: FloatArray, favour: FloatArray) -> FloatArray:
    """Snow cover (n,) at places within cells whose mean is `fraction` (n,).

    favour (n,): how much likelier snow is there than elsewhere in the neighbourhood, standard normal: height above
    it, and chance. Phi((sqrt(1 + s^2) probit(fraction) + favour) / s): its mean over a standard normal `favour` is
    the fraction, none stays none and full stays full.
    """
    p = np.clip(fraction, 1e-6, 1 - 1e-6)
    place = np.sqrt(1 + _SOFTNESS**2) * np.log(p / (1 - p)) / _LOGISTIC
    cover = 1 / (1 + np.exp(-np.clip(_LOGISTIC * (place + favour) / _SOFTNESS, -60, 60)))
    return np.where(fraction < 0.01, fraction, np.where(fraction > 0.99, fraction, cover))
