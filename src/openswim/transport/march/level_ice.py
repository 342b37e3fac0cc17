"""What plates of ice that float level scatter once toward the eye, beyond what they would in all orientations.

Diffuse light, and light that narrow peaks broaden, know the plates in all orientations only.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import PACK, read, write
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.state import SPECIES

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ONE = FLOAT(1.0)


class LevelIce(NamedTuple):
    """Which species they are, their axes (3, 3), of which the last points up and the first toward the sun as far as it
    is level, and P beyond that of all orientations, times scattering per reference extinction: a map (altitude,
    azimuth, PACK) as `ice.level` has it, without rows where there are none."""

    species: int
    axes: F64
    table: F32


NO_LEVEL_ICE = LevelIce(0, np.eye(3), np.zeros((0, 1, PACK), FLOAT))


def axes_at(place: F64, sun: F64, radius_m: float) -> F64:
    """`LevelIce.axes` at a place (3,) of the frame."""
    up = place + np.array([0.0, 0.0, radius_m])
    up /= np.linalg.norm(up)
    ahead = sun - (sun @ up) * up
    size = np.linalg.norm(ahead)
    ahead = ahead / size if size > 1e-9 else np.cross(up, [0.0, 1.0, 0.0])
    return np.stack([ahead, np.cross(up, ahead), up])


@part()
def map_place(dx, dy, dz, axes, shape):
    """Row and column of a map's bins before a direction, and the shares of the next."""
    ahead = dx * axes[0, 0] + dy * axes[0, 1] + dz * axes[0, 2]
    aside = dx * axes[1, 0] + dy * axes[1, 1] + dz * axes[1, 2]
    up = dx * axes[2, 0] + dy * axes[2, 1] + dz * axes[2, 2]
    p = (math.asin(min(max(up, -1.0), 1.0)) / math.pi + 0.5) * shape[0] - 0.5
    q = math.atan2(abs(aside), ahead) / math.pi * shape[1] - 0.5
    p, q = min(max(p, 0.0), shape[0] - 1.0), min(max(q, 0.0), shape[1] - 1.0)
    i, j = min(int(p), shape[0] - 2), min(int(q), shape[1] - 2)
    return i, j, p - i, q - j


@part(FINITE)
def add_level_ice(dx, dy, dz, ice, constants):
    """Add to `Ray.constants` what level plates scatter beyond the mean of all orientations into a ray's direction."""
    i, j, down, left = map_place(dx, dy, dz, ice.axes, ice.table.shape)
    f, g = FLOAT(down), FLOAT(left)
    here = (i * ice.table.shape[1] + j) * PACK
    above = here + ice.table.shape[1] * PACK
    low = (_ONE - g) * read(ice.table, here) + g * read(ice.table, here + PACK)
    high = (_ONE - g) * read(ice.table, above) + g * read(ice.table, above + PACK)
    own = SPECIES + ice.species * PACK
    write(constants, own, read(constants, own) + (_ONE - f) * low + f * high)
