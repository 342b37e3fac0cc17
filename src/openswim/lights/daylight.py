"""The sun over a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Daylight:
    """The sun over a scene: ``direction`` (3,) in the scene frame, distance (au) and angular radius (degrees)."""

    direction: NDArray[np.float64]
    distance_au: float = 1.0
    angular_radius_deg: float = 0.2666
