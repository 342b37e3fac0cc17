"""Cloud masks by colour: one rule for the observed and for the simulated picture.

A cloud is whiter than the clear sky behind it. How blue that is depends on sun, haze and where one looks, so the rule
"clear sky" asks the simulated clear sky of the same place and time. Rules with fixed ratios stand beside it.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
DEPARTURE = 0.25  # of ln(red / blue), from which on it is a cloud
CLEAR_SKY = "clear sky"
NO_AIR = "without air the clear sky is black, and no cloud can be told from it"
_DARK = 1e-9  # W m-2 sr-1 nm-1: no light


def is_black(clear: NDArray[np.floating]) -> bool:
    """Whether a clear sky (n, channels) is nowhere lit."""
    return not (clear > _DARK).any()


def log_red_blue(light: NDArray[np.floating]) -> F64:
    """ln(red / blue) of linear light (..., 3)."""
    light = np.asarray(light, float)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.log(light[..., 0]) - np.log(light[..., 2]))


def departure(light: NDArray[np.floating], clear: NDArray[np.floating], red_blue: float = 0.0) -> F64:
    """By how much linear light (..., 3) is redder than the clear sky's, but for the camera's white balance."""
    return np.asarray(log_red_blue(light) - log_red_blue(clear) - red_blue)


def _tsi(stored: F64) -> Mask:
    """Opaque where red / blue > .6 (Long et al. 2006)."""
    return np.asarray(stored[..., 0] > 0.6 * stored[..., 2])


def _kreuter(stored: F64) -> Mask:
    """Cloud where blue / red < 1.3 (Kreuter et al. 2009)."""
    return np.asarray(stored[..., 2] < 1.3 * stored[..., 0])


def _heinle(stored: F64) -> Mask:
    """Cloud where blue - red < 30 counts of 8 bits (Heinle et al. 2010)."""
    return np.asarray(stored[..., 2] - stored[..., 0] < 30 / 255)


def _hyta(stored: F64) -> Mask:
    """Of l = (blue - red) / (blue + red), cloud below .25 where l hardly varies (sd < .03), else below the threshold of
    least cross entropy (Li et al. 2011)."""
    contrast = (stored[..., 2] - stored[..., 0]) / np.maximum(stored[..., 2] + stored[..., 0], 1e-9)
    return np.asarray(contrast < (0.25 if contrast.std() < 0.03 else _least_cross_entropy(contrast)))


FIXED: dict[str, Callable[[F64], Mask]] = {
    "red/blue > .6": _tsi,
    "red/blue > .77": _kreuter,
    "blue - red < 30": _heinle,
    "HYTA": _hyta,
}


def _least_cross_entropy(values: F64) -> float:
    """Threshold that keeps most of a histogram's information (Li and Lee 1993)."""
    counts, edges = np.histogram(values, 128)
    middle = (edges[1:] + edges[:-1]) / 2
    level = middle - edges[0] + 1e-3  # cross entropy wants what is above zero
    mass, moment = np.cumsum(counts)[:-1], np.cumsum(counts * level)[:-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        below, above = moment / mass, (moment[-1] + counts[-1] * level[-1] - moment) / (counts.sum() - mass)
        entropy = -moment * np.log(below) - ((counts * level).sum() - moment) * np.log(above)
    return float(edges[1:-1][np.nanargmin(entropy)])
