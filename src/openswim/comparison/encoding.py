"""The curves by which cameras write light as counts."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.srgb import from_srgb, to_srgb

F64 = NDArray[np.float64]


def decoded(share: ArrayLike, encoding: str | float) -> F64:
    """Linear light of counts, both as shares of full scale: "linear", "srgb" (IEC 61966-2-1), or share ** exponent."""
    value = np.asarray(share, float)
    if encoding == "linear":
        return value
    if encoding == "srgb":
        return from_srgb(value)
    return np.maximum(value, 0.0) ** float(encoding)


def encoded(light: ArrayLike, encoding: str | float) -> F64:
    """The inverse of `decoded`."""
    value = np.asarray(light, float)
    if encoding == "linear":
        return value
    if encoding == "srgb":
        return np.asarray(to_srgb(value))
    return np.maximum(value, 0.0) ** (1 / float(encoding))
