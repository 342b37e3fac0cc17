"""Between a scene and the grid of its core: where places are in it, and how fields become fields at its nodes.

Both are decided once; fields go there and bars back linearly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.interpolation import bilinear
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.plan import MediumPlan

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


@dataclass(frozen=True, eq=False)
class Drawn:
    """How fields (..., nz0, ny, nx) on a scene's levels become fields on the core's: each node has shares, ``low`` and
    ``high`` (nz, ny, nx), of level ``level`` and of the next. It is what `medium.build_medium` does to extinction."""

    level: NDArray[np.int64]
    low: F64
    high: F64
    own_levels: int

    @classmethod
    def of(cls, medium: Medium, plan: MediumPlan) -> Drawn:
        """Of columns that are those of the scene's grid."""
        heights = np.asarray(medium.grid.height_m, float)
        columns = medium.terrain_m.shape
        heights = np.broadcast_to(heights[:, None, None] if heights.ndim == 1 else heights, (len(heights), *columns))
        flat, levels, drawn = medium.grid.height_m.ndim == 1, plan.own_levels_m, len(medium.levels_m)
        level = np.zeros((drawn, *columns), np.int64)
        low, high = np.zeros((2, drawn, *columns))
        for n, z in enumerate(levels):
            k = np.clip((heights <= z).sum(axis=0) - 1, 0, len(heights) - 2)
            h0, h1 = np.take_along_axis(heights, k[None], 0)[0], np.take_along_axis(heights, k[None] + 1, 0)[0]
            c = np.clip((z - h0) / (h1 - h0), 0, 1)
            within = z <= heights[-1] + 1e-6 if flat else z <= h1
            if flat and not medium.frame.curved:
                within = within & (z >= heights[0] - 1e-6)
            level[n], low[n], high[n] = k, within * (1 - c), within * c
        if plan.soft_top:
            low[len(levels) - 1] *= 0.5
            high[len(levels) - 1] *= 0.5
            level[len(levels)], low[len(levels)], high[len(levels)] = (
                level[len(levels) - 1], low[len(levels) - 1], high[len(levels) - 1],
            )  # fmt: skip
        buried = np.arange(drawn)[:, None, None] < medium.ground_node
        low[buried] = high[buried] = 0.0
        return cls(level, low, high, len(heights))

    def to_nodes(self, field: F64) -> F64:
        """Fields (..., nz, ny, nx) at the nodes."""
        level = np.broadcast_to(self.level, (*np.shape(field)[:-3], *self.level.shape))
        return self.low * np.take_along_axis(field, level, -3) + self.high * np.take_along_axis(field, level + 1, -3)

    def from_nodes(self, bar: F64) -> F64:
        """Transpose of `to_nodes`: (..., nz0, ny, nx)."""
        lead = np.shape(bar)[:-3]
        out = np.zeros((*lead, self.own_levels, *self.level.shape[1:]))
        j, i = np.indices(self.level.shape[1:])
        for n, k in enumerate(self.level):
            out[..., k, j, i] += self.low[n] * bar[..., n, :, :]
            out[..., k + 1, j, i] += self.high[n] * bar[..., n, :, :]
        return out
