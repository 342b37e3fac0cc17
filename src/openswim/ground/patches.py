"""What land is like below its maps: woods and open country, for the eye that comes near (docs/decisions/0020)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground.noise import fractal_noise, resolved_share
from openswim.ground.spectra import at_wavelengths

FloatArray = NDArray[np.float64]

_LONGEST_M = 4000.0  # woods and hollows are no larger, however coarse the map
_POWER = 0.1  # of wavelength, that variances of patches go with: of one size they would be dapples, from space
_MOTTLE_M, _MOTTLE, _MOTTLE_OCTAVES = 60.0, 0.13, 9  # brightness within each: longest wave, standard deviation
# Green country is woods (dark conifers, MODIS) among fields: share of woods by mean albedo
_WOODS_NM = np.array([400.0, 469.0, 555.0, 645.0, 700.0])
_WOODS = np.array([0.014, 0.016, 0.036, 0.021, 0.05])
_LEVEL, _SHARE = (0.03, 0.10), (0.6, 0.3)
_NO_DARKER = 0.75  # woods reflect at most so much of the mean
# Bare country is told by green over red; its rocks and shrubs reflect so much of the mean
_BARE_RATIO, _GREEN_RATIO = 0.85, 1.05
_ROCKS, _ROCKY = 0.87, 0.4


def wood_noise(
    lat: FloatArray, lon: FloatArray, known_m: ArrayLike, footprint_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`fractal_noise` by which woods lie where they do, below maps that know them over ``known_m``."""
    return fractal_noise(lat, lon, np.minimum(known_m, _LONGEST_M), footprint_m, power=_POWER)


def patched(
    albedo: FloatArray, lat: FloatArray, lon: FloatArray, wavelengths_nm: FloatArray, known_m: FloatArray,
    footprint_m: FloatArray,
) -> FloatArray:  # fmt: skip
    """Albedo (n, nwl) of land known over ``known_m`` (n,), as it may be over ``footprint_m`` (n,).

    Woods and fields where it is green, sand and rock where it is not, in patches of some 100 m to 4 km, and meadows'
    mottle of 60 m and less. Invented; the mean over many places is kept at every wavelength, up to the bound of .98.
    """
    red, green = at_wavelengths(wavelengths_nm, albedo, np.array([645.0, 555.0])).T
    bare = np.clip((_GREEN_RATIO - green / np.maximum(red, 1e-6)) / (_GREEN_RATIO - _BARE_RATIO), 0.0, 1.0)
    share = np.interp(albedo.mean(axis=1), _LEVEL, _SHARE)
    share += bare * (_ROCKY - share)
    woods = np.minimum(np.interp(wavelengths_nm, _WOODS_NM, _WOODS), _NO_DARKER * albedo)
    dark = woods + bare[:, None] * (_ROCKS * albedo - woods)
    light = (albedo - share[:, None] * dark) / (1 - share[:, None])
    mottle, _ = fractal_noise(lat, lon, np.minimum(known_m, _MOTTLE_M), footprint_m, _MOTTLE_OCTAVES, 0.0)
    forest = resolved_share(share, *wood_noise(lat, lon, known_m, footprint_m))
    mixed = light + forest[:, None] * (dark - light)
    return np.clip(mixed * (1 + _MOTTLE * np.clip(mottle, -3, 3))[:, None], 0.0, 0.98)
