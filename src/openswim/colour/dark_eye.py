"""What the eye's rods make of dim light: brightness without colour, and blue that is brighter than red."""

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

# CIE 191:2010: the share of the cones is a + b log10 of the luminance, from .005 to 5 cd/m2
_A, _B = 0.767, 0.3334
_LUMENS = 683.0 / 1699.0  # of a watt at the peak of day's and of night's sight
_ROD_COLOUR = np.array([0.92, 1.0, 1.25], np.float32)  # that dim light seems to have: a bluish grey


def mesopic(xyz_cd_m2: F32) -> F32:
    """X, Y, Z (..., 3) in cd/m2 as they seem to an eye that has got used to the dark.

    Unchanged above 5 cd/m2; of rods alone below .005. What these see is told from X, Y and Z (Larson et al. 1997, IEEE
    TVCG 3, 291, Eq. 10), to 10 % for the spectra of skies.
    """
    x, y, z = (np.maximum(xyz_cd_m2[..., n], 0) for n in range(3))
    cones = np.clip(_A + _B * np.log10(np.maximum(y, 1e-12)), 0, 1)
    rods = y * np.maximum(1.33 * (1 + (y + z) / np.maximum(x, 1e-12)) - 1.68, 0) * _LUMENS
    seen = cones[..., None] * xyz_cd_m2 + ((1 - cones) * rods)[..., None] * _ROD_COLOUR
    return np.asarray(seen, np.float32)
