"""The equidistant cylinder: 360 degrees of azimuth about `azimuth_deg`, clockwise from left to right.

Azimuths are those of the pixels' centres, so the right edge meets the left without a seam.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.cameras.pixels import Pixels
from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]


def pixels(shape: tuple[int, int], azimuth_deg: float, altitude_range_deg: tuple[float, float]) -> Pixels:
    """All pixels; their solid angles are exact."""
    ny, nx = shape
    bottom, top = altitude_range_deg
    azimuth = azimuth_deg + ((np.arange(nx) + 0.5) / nx - 0.5) * 360
    edges = np.linspace(top, bottom, ny + 1)
    direction = horizon_vector(azimuth[None, :], ((edges[1:] + edges[:-1]) / 2)[:, None])
    row = -np.diff(np.sin(np.radians(edges))) * 2 * np.pi / nx
    return Pixels(direction, np.repeat(row[:, None], nx, axis=1))


def project(
    direction: F64, shape: tuple[int, int], azimuth_deg: float, altitude_range_deg: tuple[float, float]
) -> tuple[F64, F64]:
    """Row and column of directions (..., 3); NaN above and below."""
    ny, nx = shape
    bottom, top = altitude_range_deg
    altitude = np.degrees(np.arctan2(direction[..., 2], np.hypot(direction[..., 0], direction[..., 1])))
    turn = (np.degrees(np.arctan2(direction[..., 0], direction[..., 1])) - azimuth_deg + 180) % 360
    row, column = (top - altitude) / (top - bottom) * ny - 0.5, turn / 360 * nx - 0.5
    outside = (altitude > top) | (altitude < bottom)
    return np.where(outside, np.nan, row), np.where(outside, np.nan, column)


def direction(
    row: ArrayLike, column: ArrayLike, shape: tuple[int, int], azimuth_deg: float,
    altitude_range_deg: tuple[float, float],
) -> F64:
    """Unit vectors (..., 3) of places in the picture; NaN above and below."""
    ny, nx = shape
    bottom, top = altitude_range_deg
    altitude = top - (np.asarray(row, float) + 0.5) / ny * (top - bottom)
    azimuth = azimuth_deg + ((np.asarray(column, float) + 0.5) / nx - 0.5) * 360
    return horizon_vector(azimuth, np.where((altitude > top) | (altitude < bottom), np.nan, altitude))
