"""What land is like below its maps: woods and open country, for the eye that comes near (docs/decisions/0020)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground.noise import fractal_lumps, fractal_noise, resolved_share
from openswim.scene.interpolation import at_wavelengths

FloatArray = NDArray[np.float64]

# Woods and hollows are no larger, however coarse the map; power of wavelength that variances go with (of one size they
# would be dapples, from space)
_LONGEST_M, _OCTAVES, _POWER = 4000.0, 9, 0.1
# Brightness within them: longest wave, octaves, power, standard deviation
_MOTTLE = 60.0, 9, -0.2, 0.2
_CROWNS = 12.0, 3, 0.0, 0.3  # of trees
_TUFTS = 0.25, 5, -0.5, 0.3  # of grass, and stones
# Green country is woods (dark conifers, MODIS) among fields: share of woods by mean albedo
_WOODS_NM = np.array([400.0, 469.0, 555.0, 645.0, 700.0])
_WOODS = np.array([0.014, 0.016, 0.036, 0.021, 0.05])
_LEVEL, _SHARE = (0.03, 0.10), (0.6, 0.3)
_NO_DARKER = 0.75  # woods reflect at most so much of the mean
# Bare country is told by green over red; its rocks and shrubs reflect so much of the mean
_BARE_RATIO, _GREEN_RATIO = 0.85, 1.05
_ROCKS, _ROCKY, _EVEN = 0.87, 0.4, 0.6  # and so much of the variation is missing
# Where a map is so fine that its colour is that of one material, what is grey (ratio of the brightest to the darkest of
# blue, green and red) is asphalt, concrete or paint, on which so much of all this is missing
_ONE_MATERIAL_M, _GREY_RATIO, _PAVED = (4.0, 16.0), (1.3, 1.6), 0.85


def wood_noise(
    lat: FloatArray, lon: FloatArray, known_m: ArrayLike, footprint_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`fractal_noise` by which woods lie where they do, below maps that know them over ``known_m``."""
    return fractal_noise(lat, lon, np.minimum(known_m, _LONGEST_M), footprint_m, _OCTAVES, _POWER)


def patched(
    albedo: FloatArray, lat: FloatArray, lon: FloatArray, wavelengths_nm: FloatArray, known_m: FloatArray,
    footprint_m: FloatArray,
) -> FloatArray:  # fmt: skip
    """Albedo (n, nwl) of land known over ``known_m`` (n,), as it may be over ``footprint_m`` (n,).

    Woods and fields where it is green, sand and rock where it is not, in patches of some 16 m to 4 km; below 60 m all
    is mottled; crowns of trees; tufts and stones down to a centimetre; little of it on what maps of a few metres show
    as grey: it is paved. Invented; the mean over many places is kept at every wavelength, up to the bound of .98.
    """
    red, green, _ = colours = at_wavelengths(wavelengths_nm, albedo, np.array([645.0, 555.0, 469.0])).T
    bare = np.clip((_GREEN_RATIO - green / np.maximum(red, 1e-6)) / (_GREEN_RATIO - _BARE_RATIO), 0.0, 1.0)
    share = np.interp(albedo.mean(axis=1), _LEVEL, _SHARE)
    share += bare * (_ROCKY - share)
    woods = np.minimum(np.interp(wavelengths_nm, _WOODS_NM, _WOODS), _NO_DARKER * albedo)
    dark = woods + bare[:, None] * (_ROCKS * albedo - woods)
    light = (albedo - share[:, None] * dark) / (1 - share[:, None])
    forest = resolved_share(share, *wood_noise(lat, lon, known_m, footprint_m))

    def varied(form: Callable[..., Any], kind: tuple[float, int, float, float], series: int, even: float) -> FloatArray:
        longest_m, octaves, power, deviation = kind
        noise = form(lat, lon, np.minimum(known_m, longest_m), footprint_m, octaves, power, series)
        return (1.0 + deviation * (1.0 - even * bare) * np.clip(noise, -3.0, 3.0))[:, None]

    dark = dark * varied(fractal_lumps, _CROWNS, 2, 1.0)
    mixed = light + forest[:, None] * (dark - light)
    mixed *= varied(lambda *at: fractal_noise(*at)[0], _MOTTLE, 1, _EVEN) * varied(fractal_lumps, _TUFTS, 2, _EVEN)
    grey = np.interp(colours.max(axis=0) / np.maximum(colours.min(axis=0), 1e-6), _GREY_RATIO, (1.0, 0.0))
    paved = grey * np.interp(np.log(known_m), np.log(_ONE_MATERIAL_M), (1.0, 0.0))
    mixed = albedo + (1.0 - _PAVED * paved[:, None]) * (mixed - albedo)
    return np.clip(mixed, 0.0, 0.98)
