"""What sunbeams pass in a wider grid before they enter an inner one at its sides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.beam.lit_volume import Channels, SunDepth
from openswim.transport.beam.sun_sweep import inside
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.types import FLOAT
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class DepthsAround(NamedTuple):
    """Of a wider grid its medium and its depths to the sun."""

    medium: Medium
    depths: SunDepth


def shade_from(wider: DepthsAround, medium: Medium, channels: Channels, depths: SunDepth, local_sun: F64) -> None:
    """Add to a grid's depths to the sun what sunbeams pass in a wider grid before they enter at its sides."""
    columns, lookup = _Sides.of(medium, wider.medium, local_sun), wider.medium
    inner, outer = inside(depths.depth), inside(wider.depths.depth)
    # what the wider grid has at the wavelengths that our mixtures stand for
    factors = wider.depths.factors[:, depths.stands_for].T
    tables = [
        np.tensordot(factors, np.stack([np.moveaxis(bilinear(o, ix, iy), 0, -1) for o in outer]), 1)
        for ix, iy in columns.places
    ]
    filled = np.flatnonzero(np.any([t.any(axis=(0, 2)) for t in tables], axis=0))
    if not filled.size:
        return
    levels = lookup.levels_m
    top = levels[min(int(filled[-1]) + 1, len(levels) - 1)]
    mu = local_sun[..., 2]
    rise, bend = mu * columns.way_m, (1 - mu**2) / (2 * medium.frame.radius_m) * columns.way_m**2
    for k, z in enumerate(medium.levels_m):
        height = z + rise + bend
        for side, table in enumerate(tables):
            here = np.nonzero((columns.side == side) & (height < top))
            if here[0].size:
                at = np.interp(height[here], levels, np.arange(len(levels)))
                for values, extra in zip(inner, bilinear(table, columns.along[here], at).T, strict=True):
                    values[k][here] += extra.astype(FLOAT)
        channels.forward_depth[:, k] = depths.forward(k)


class _Sides(NamedTuple):
    """Where the sunbeams of a grid's columns come in: ``side`` (ny, nx), 0 to 3, how far ``along`` it in nodes, and the
    ``way_m`` from there; fractional indices in the wider grid of the ``places`` along each side."""

    side: NDArray[np.int64]
    along: F64
    way_m: F64
    places: list[tuple[F64, F64]]

    @classmethod
    def of(cls, medium: Medium, wider: Medium, local_sun: F64) -> _Sides:
        _, ny, nx = medium.shape
        j, i = np.mgrid[0:ny, 0:nx].astype(float)
        vx, vy = (local_sun[..., n] / medium.cell_m[n] for n in (0, 1))  # cells per metre
        to_x = np.where(vx > 0, nx - 1 - i, i) / np.maximum(np.abs(vx), 1e-12)
        to_y = np.where(vy > 0, ny - 1 - j, j) / np.maximum(np.abs(vy), 1e-12)
        way = np.minimum(to_x, to_y)
        side = np.where(to_x < to_y, np.where(vx > 0, 1, 0), np.where(vy > 0, 3, 2))
        along = np.where(to_x < to_y, j + vy * way, i + vx * way)
        p = medium.place
        return cls(side, along, way, [wider.indices(edge) for edge in (p[:, 0], p[:, -1], p[0], p[-1])])
