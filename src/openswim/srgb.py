"""The curve of sRGB (IEC 61966-2-1) between linear light and what a file holds, both as shares of full scale."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]

_POWER, _LIFT = 2.4, 0.055  # of all but the darkest; those are on a straight line
_SLOPE, _DARK_LIGHT, _DARK_CODE = 12.92, 0.0031308, 0.04045


def from_srgb(share: ArrayLike) -> F64:
    """Linear light 0..1 of file values 0..1; any shape. Beyond 0 the line goes on, beyond 1 the power."""
    value = np.asarray(share, float)
    bright = ((np.maximum(value, _DARK_CODE) + _LIFT) / (1 + _LIFT)) ** _POWER
    return np.where(value <= _DARK_CODE, value / _SLOPE, bright)


def to_srgb(light: NDArray[np.floating]) -> NDArray[np.floating]:
    """File values 0..1 of linear light 0..1, in the precision of the light: the inverse of `from_srgb`."""
    bright = (1 + _LIFT) * np.maximum(light, _DARK_LIGHT) ** (1 / _POWER) - _LIFT
    return np.where(light <= _DARK_LIGHT, _SLOPE * light, bright)
