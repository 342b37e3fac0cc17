"""The night's sky behind all that is solved for, along an eye's rays: zodiacal light, Milky Way and airglow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from openswim.heavens.lamps import Lamps
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.transport.air.shells import SHINING_HALF_M, SHINING_M

F64 = NDArray[np.float64]


def sky_behind(
    lamps: Lamps, wavelengths_nm: F64, direction: F64, up: F64, height_m: float, transmittance: NDArray,
    hit: NDArray[np.bool_],
) -> F64:  # fmt: skip
    """W m-2 sr-1 nm-1 (n, nw) that arrives along rays (n, 3) from an eye at a height above sea level, ``up`` (3,) up.

    What is solved for holds the sky's mean, which clouds scatter forward; here what the sky has more or less in each
    direction is added, dimmed by all there is on the way.
    """
    night = replace(lamps.night, up=up)
    found = night.airglow(height_m, direction, wavelengths_nm)
    if height_m < SHINING_M:
        found = found * transmittance  # all of it lies behind the air
    else:
        found = np.where(hit[:, None], found, found * np.maximum(transmittance, 0.5))  # half of it before the limb
    free = np.flatnonzero(~hit)
    if free.size:
        beyond = night.beyond_air(direction[free], wavelengths_nm)
        within = _share_within(height_m, direction[free] @ up)[:, None] * lamps.in_field
        found[free] += (beyond - within) * transmittance[free]
    if height_m < SHINING_M:
        found[hit] = 0.0
    return np.asarray(found)


def _share_within(height_m: float, cosine: F64) -> F64:
    """What share of the air that shines as the even sky does (`SHINING_M`) lies before an eye's rays."""
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    lowest = np.where(cosine >= 0, height_m, (EARTH_RADIUS_M + height_m) * sine - EARTH_RADIUS_M)
    part = np.clip((lowest - SHINING_M) / SHINING_HALF_M, -1, 1)
    return np.asarray(0.5 - part + 0.5 * part * np.abs(part))
