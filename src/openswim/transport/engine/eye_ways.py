"""From a grid's nodes to an eye: unit vectors in the scene's axes and in every column's own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.engine.pack import LANES, read_quadruple, root, spread_quadruple

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
_ONE = np.float32(1.0)


def columns_of(axes: NDArray, place: NDArray, eye: NDArray, parallel: bool) -> NDArray[np.float32]:
    """Rows (ny, 12, nx) for `view_source`: sea-level points (ny, nx, 3) seen from the eye, then the columns' axes."""
    away = np.zeros_like(place) if parallel else place - eye
    rows = np.concatenate([away, axes.reshape(*axes.shape[:2], 9)], axis=-1)
    return wide(np.ascontiguousarray(np.moveaxis(rows, -1, 1), np.float32))


def wide(array: NDArray[Any]) -> NDArray[np.float32]:
    """The array itself, or with rows too short for a pack made long enough."""
    short = LANES - array.shape[-1]
    padded = array if short <= 0 else np.pad(array, [(0, 0)] * (array.ndim - 1) + [(0, short)])
    return np.require(padded, np.float32, "CW")


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def way_to_eye(c, nx, columns, height, eye, parallel):
    """Unit vectors to the eye from LANES nodes at a height, in the scene's axes, then in the columns' own.

    ``columns``: see `columns_of`; from flat element ``c`` on.
    """
    ax, ay, az = read_quadruple(columns, c + 9 * nx), read_quadruple(columns, c + 10 * nx), read_quadruple(
        columns, c + 11 * nx
    )
    if parallel:
        vx, vy, vz = spread_quadruple(eye[0]), spread_quadruple(eye[1]), spread_quadruple(eye[2])
    else:
        vx = read_quadruple(columns, c) + height * ax
        vy = read_quadruple(columns, c + nx) + height * ay
        vz = read_quadruple(columns, c + 2 * nx) + height * az
        r = _ONE / (root(vx * vx + vy * vy + vz * vz) + np.float32(1e-6))
        vx, vy, vz = vx * r, vy * r, vz * r
    x = read_quadruple(columns, c + 3 * nx) * vx + read_quadruple(columns, c + 4 * nx) * vy
    x += read_quadruple(columns, c + 5 * nx) * vz
    y = read_quadruple(columns, c + 6 * nx) * vx + read_quadruple(columns, c + 7 * nx) * vy
    y += read_quadruple(columns, c + 8 * nx) * vz
    return vx, vy, vz, x, y, ax * vx + ay * vy + az * vz
