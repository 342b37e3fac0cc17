"""What slopes are like below a model's terrain: sunlight on ridges and in gullies, for the near eye (decision 20)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from openswim.ground.noise import fractal_slope

FloatArray = NDArray[np.float64]

_FINEST_M = 100.0  # valleys lie no closer; slopes between are even
_ROUGHNESS = 0.6  # power of wavelength that the variance of slopes falls with (Hurst exponent .7)
_STEEPEST = 0.6  # standard deviation of all slopes, of high mountains


def steepness_below(slope_square: FloatArray, cell_m: float) -> FloatArray:
    """Standard deviation of slopes (tangents) below cells, by their mean square on cells; same shape."""
    more = max((cell_m / _FINEST_M) ** _ROUGHNESS - 1.0, 0.0)
    return np.minimum(np.sqrt(slope_square * more), _STEEPEST)


def sunlight_on_slopes(
    lat: FloatArray, lon: FloatArray, sun: FloatArray, mu_sun: FloatArray, steepness: FloatArray, cell_m: float,
    footprint_m: FloatArray,
) -> FloatArray:  # fmt: skip
    """Factor (n,) on the sun's beam at places in degrees; its mean over many is 1, shaded slopes (0) included.

    sun (n, 3): what is horizontal of the direction to the sun, in Earth-centred axes, as long as the sine of the zenith
    angle; mu_sun (n,): cosine to the known slope's normal; steepness (n,) below cells of ``cell_m``.
    """
    from scipy.special import ndtr

    octaves = math.ceil(math.log2(max(cell_m / _FINEST_M, 2.0)))
    sine = np.linalg.norm(sun, axis=1)
    toward = sun / np.maximum(sine, 1e-9)[:, None]
    slope, unseen = fractal_slope(lat, lon, toward, cell_m, footprint_m, octaves, -_ROUGHNESS)
    spread = steepness * math.sqrt(0.5) * sine  # one of two components
    seen = np.maximum(spread * np.sqrt(1.0 - unseen), 1e-6)
    ratio = mu_sun / seen
    mean = mu_sun * ndtr(ratio) + seen * np.exp(-0.5 * ratio**2) / math.sqrt(2.0 * math.pi)
    return np.asarray(np.maximum(mu_sun - spread * slope, 0.0) / mean)
