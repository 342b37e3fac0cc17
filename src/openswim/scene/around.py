"""What is known toward a few directions around a place, and between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.scene.frame import horizon_vector
from openswim.scene.interpolation import corners

F64 = NDArray[np.float64]


def directions_around(altitude_deg: F64, azimuths: int, axes: F64) -> F64:
    """Unit vectors (altitude, azimuth, 3) in a frame in which ``axes`` (3, 3) are east, north and up."""
    turn = np.arange(azimuths) * 360.0 / azimuths
    return np.asarray(horizon_vector(turn, altitude_deg[:, None]) @ axes)


@dataclass(frozen=True, eq=False)
class Around:
    """Values (altitude, azimuth, nw) toward `directions_around` of ascending altitudes."""

    values: F64
    altitude_deg: F64
    axes: F64

    def toward(self, direction: F64) -> F64:
        """Of directions (n, 3): (n, nw), linear in altitude and azimuth; beyond the lowest altitude its value holds."""
        rows, columns = self.values.shape[:2]
        east, north, up = (direction @ self.axes.T).T
        row = np.interp(np.degrees(np.arcsin(np.clip(up, -1, 1))), self.altitude_deg, np.arange(rows))
        column = np.arctan2(east, north) / (2 * np.pi) * columns
        j, i, weight = corners(column, row, (rows, columns), all_round=True)
        return np.asarray(sum(w[:, None] * self.values[a, b] for a, b, w in zip(j, i, weight, strict=True)))
