"""From a grid's nodes to an eye: unit vectors in the scene's axes and in every column's own."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import LANES, read_quadruple, root, spread_quadruple
from openswim.transport.engine.types import FLOAT

_ONE = FLOAT(1.0)


class Eye(NamedTuple):
    """An eye as the columns (ny, nx) of a grid see it."""

    columns: NDArray[np.float32]  # (ny, 12, nx) their sea-level points from the eye, m, then their three axes
    place: NDArray[np.float64]  # (3,) of the eye, m, or, where rays are parallel, the direction they go
    parallel: bool

    @classmethod
    def of(cls, axes: NDArray, place: NDArray, eye: NDArray, parallel: bool) -> Eye:
        """Of columns with axes (ny, nx, 3, 3) at sea-level points (ny, nx, 3)."""
        ny, nx = place.shape[:2]
        columns = np.empty((ny, 12, nx), FLOAT)
        columns[:, :3] = 0.0 if parallel else np.moveaxis(place - eye, -1, 1)
        columns[:, 3:] = np.moveaxis(axes.reshape(ny, nx, 9), -1, 1)
        return cls(wide(columns), eye, parallel)


def wide(array: NDArray[Any]) -> NDArray[np.float32]:
    """The array itself, or with rows too short for a pack made long enough."""
    short = LANES - array.shape[-1]
    padded = array if short <= 0 else np.pad(array, [(0, 0)] * (array.ndim - 1) + [(0, short)])
    return np.require(padded, FLOAT, "CW")


@part(FINITE, inlined=True)
def way_from_eye(j, i, height_m, eye):
    """Unit vectors from the eye to LANES nodes at a height, in row j from column i on, in the columns' own axes:
    (p + h up - e)/|p + h up - e| of the sea-level points p."""
    columns = eye.columns
    nx = columns.shape[2]
    c = j * 12 * nx + i
    ax, ay, az = read_quadruple(columns, c + 9 * nx), read_quadruple(columns, c + 10 * nx), read_quadruple(
        columns, c + 11 * nx
    )
    if eye.parallel:
        way = eye.place
        vx, vy, vz = spread_quadruple(way[0]), spread_quadruple(way[1]), spread_quadruple(way[2])
    else:
        vx = read_quadruple(columns, c) + height_m * ax
        vy = read_quadruple(columns, c + nx) + height_m * ay
        vz = read_quadruple(columns, c + 2 * nx) + height_m * az
        r = _ONE / (root(vx * vx + vy * vy + vz * vz) + FLOAT(1e-6))
        vx, vy, vz = vx * r, vy * r, vz * r
    x = read_quadruple(columns, c + 3 * nx) * vx + read_quadruple(columns, c + 4 * nx) * vy
    x += read_quadruple(columns, c + 5 * nx) * vz
    y = read_quadruple(columns, c + 6 * nx) * vx + read_quadruple(columns, c + 7 * nx) * vy
    y += read_quadruple(columns, c + 8 * nx) * vz
    return x, y, ax * vx + ay * vy + az * vz
