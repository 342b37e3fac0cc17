"""Where in a medium's grid places are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.interpolation import bilinear
from openswim.transport.medium.medium import Medium

F64 = NDArray[np.float64]

_OUTSIDE = -1e3


def locate_in(medium: Medium) -> Callable[[F64], tuple[F64, F64, F64]]:
    """Height, and fractional row and column (n,) of places (n, 3) in the frame: by the medium's chart on the Earth, see
    `march.volume.grid_index`."""
    radius = medium.frame.radius_m

    def on_earth(places: F64) -> tuple[F64, F64, F64]:
        x, y, depth = places[:, 0], places[:, 1], places[:, 2] + radius
        r = np.sqrt(x * x + y * y + depth * depth)
        q = radius * np.sqrt(2.0 / (r * np.maximum(r + depth, 1.0)))
        u, v = ((a * q - medium.chart_origin_m) * medium.chart_per_m for a in (x, y))
        n = len(medium.chart) - 1
        known = (u >= 0) & (v >= 0) & (u <= n) & (v <= n) & (depth > 0)
        column, row = np.where(known, bilinear(np.moveaxis(medium.chart, -1, 0), u, v).T, _OUTSIDE)
        height = (x * x + y * y + places[:, 2] * (2 * radius + places[:, 2])) / (r + radius)
        return height, row, column

    def in_plane(places: F64) -> tuple[F64, F64, F64]:
        column, row = medium.indices(places)
        return places[:, 2], row, column

    return on_earth if medium.frame.curved else in_plane


def ground_under(medium: Medium) -> Callable[[F64, F64], F64]:
    """Height of the ground at fractional rows and columns."""
    terrain = medium.terrain_m.astype(float)

    def ground(row: F64, column: F64) -> F64:
        return np.asarray(bilinear(terrain, column, row))

    return ground
