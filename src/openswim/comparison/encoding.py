"""The curves by which cameras write light as counts."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]


def decoded(share: ArrayLike, encoding: str | float) -> F64:
    """Linear light of counts, both as shares of full scale: "linear", "srgb" (IEC 61966-2-1), or share ** exponent."""
    value = np.asarray(share, float)
    if encoding == "linear":
        return value
    if encoding == "srgb":
        return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0.04045) + 0.055) / 1.055) ** 2.4)
    return np.maximum(value, 0.0) ** float(encoding)


def encoded(light: ArrayLike, encoding: str | float) -> F64:
    """The inverse of `decoded`."""
    value = np.asarray(light, float)
    if encoding == "linear":
        return value
    if encoding == "srgb":
        return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 0.0031308) ** (1 / 2.4) - 0.055)
    return np.maximum(value, 0.0) ** (1 / float(encoding))
