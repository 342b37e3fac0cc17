"""How much of the sun the moon leaves at a place, for paths of the Monte Carlo solver."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.lights.eclipses import MoonShadow
from openswim.lights.moon import MOON_RADIUS_KM
from openswim.lights.sun import SUN_RADIUS_KM
from openswim.transport.engine.compiled import part

F64 = NDArray[np.float64]


class Covered(NamedTuple):
    """Sun and moon, m, from the frame's origin, and what is left of the sun's light (nodes, nw) by where the moon's
    edge is on the sun's diameter (`MoonShadow.table`); without nodes outside of eclipses."""

    to_sun_m: F64
    to_moon_m: F64
    sun_m: float  # radii
    moon_m: float
    left: F64


def covered_by(shadow: MoonShadow | None, wavelengths_nm: F64) -> Covered:
    """Of the moon's shadow on a scene; None: there is none."""
    if shadow is None:
        return Covered(np.zeros(3), np.zeros(3), 1.0, 1.0, np.zeros((0, len(wavelengths_nm))))
    bodies = np.array(shadow.to_sun_m, float), np.array(shadow.to_moon_m, float)
    return Covered(*bodies, 1000 * SUN_RADIUS_KM, 1000 * MOON_RADIUS_KM, shadow.table(wavelengths_nm))


@part()
def cover(x, y, z, moon, beam):
    """Take from a beam (nw,) at a place what the moon hides of the sun, as `MoonShadow.left` has it."""
    last = moon.left.shape[0] - 1
    if last < 1:
        return
    ax, ay, az = moon.to_sun_m[0] - x, moon.to_sun_m[1] - y, moon.to_sun_m[2] - z
    bx, by, bz = moon.to_moon_m[0] - x, moon.to_moon_m[1] - y, moon.to_moon_m[2] - z
    a, b = 1.0 / math.sqrt(ax * ax + ay * ay + az * az), 1.0 / math.sqrt(bx * bx + by * by + bz * bz)
    px, py, pz = ax * a - bx * b, ay * a - by * b, az * a - bz * b
    chord = math.sqrt(px * px + py * py + pz * pz)
    edge = (chord - moon.moon_m * b + moon.sun_m * a) / (2.0 * moon.sun_m * a)
    at = math.sqrt(min(max(edge, 0.0), 1.0)) * last
    k = min(int(at), last - 1)
    f = at - k
    for w in range(beam.shape[0]):
        beam[w] *= moon.left[k, w] + f * (moon.left[k + 1, w] - moon.left[k, w])
