"""The delta-scaled medium at one wavelength."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]


@dataclass
class Coefficients:
    """The delta-scaled medium at one wavelength: scaled (s,), scattering (s, M), and the air on levels (nz,), 1/m."""

    scaled: F32
    scattering: F32
    air_extinction: F32
    air_scattering: F32  # (nz, M)
