"""What an eye in the moon's shadow, or near it, sees of the air beyond the grid, which has more of the sun or less."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.scene.around import Around, directions_around
from openswim.transport.air.dimmed import Eclipse
from openswim.transport.engine.pack import PACK
from openswim.transport.lit.lit_grid import Once
from openswim.transport.march.volume import Shells, Volume

F64 = NDArray[np.float64]

_AZIMUTHS = 48
_FROM_HORIZON_DEG = np.array(
    [0.02, 0.1, 0.25, 0.5, 0.9, 1.5, 2.3, 3.3, 4.5, 6.0, 8.0, 10.5, 14.0, 18.0, 24.0, 32.0, 42.0, 55.0, 72.0]
)
_PLACES_M = np.concatenate([[0.0], np.geomspace(50.0, 3e6, 160)])  # along rays, to see where they leave a grid


def light_around(
    eclipse: Eclipse, lit: Shells, volume: Volume, origin: F64, direction: F64, eye: F64 | None, once: Once
) -> F64:
    """L' (n, PACK) of air to be added to what rays (n, 3) see that end in space or on ground beside the grid, but for
    what dims it in the grid's clouds; that of the ground is in `AimedGrid.more_of_the_sun`.

    lit: shells that know no shadow, under every sun that the rays meet. eye: where all rays begin, from which those
    between are told by those beside.
    """
    if eye is None:
        return eclipse.dimmed.from_around(origin, direction, lit, _leaves(origin, direction, volume, lit), False)
    name = f"around {np.asarray(eye, float).tobytes().hex()} {lit.moments.shape[1]}"
    found: Around = once(name, lambda: _table(eclipse, lit, volume, eye))
    return found.toward(direction)


def _table(eclipse: Eclipse, lit: Shells, volume: Volume, eye: F64) -> Around:
    """L' around an eye, toward directions that are closer together at the horizon, on both sides of it."""
    up = eye + np.array([0.0, 0.0, lit.radius_m])
    radius = float(np.linalg.norm(up))
    up = up / radius
    horizon = -np.degrees(np.arccos(min((lit.radius_m + lit.ground_m) / radius, 1.0)))
    altitude = np.concatenate([horizon - _FROM_HORIZON_DEG[::-1], horizon + _FROM_HORIZON_DEG, [90.0]])
    altitude = altitude[(altitude > -90) & (altitude <= 90)]
    east = np.cross([0.0, 1.0, 0.0], up)
    east /= np.linalg.norm(east)
    axes = np.stack([east, np.cross(up, east), up])
    way = directions_around(altitude, _AZIMUTHS, axes).reshape(-1, 3)
    place = np.broadcast_to(eye, way.shape)
    table = eclipse.dimmed.from_around(place, way, lit, _leaves(place, way, volume, lit), False)
    return Around(table.reshape(len(altitude), _AZIMUTHS, PACK), altitude, axes)


def within_sides(volume: Volume, radius_m: float, place: F64) -> NDArray[np.bool_]:
    """Which of places (..., 3) lie between a grid's sides, at any height."""
    west, east, south, north = volume.sides_m
    x, y = np.moveaxis(place[..., :2] * (radius_m / np.maximum(place[..., 2:] + radius_m, 0.01 * radius_m)), -1, 0)
    return np.asarray((x >= west) & (x <= east) & (y >= south) & (y <= north))


def _leaves(origin: F64, direction: F64, volume: Volume, lit: Shells) -> F64:
    """Distances (n,) at which rays leave the grid for good; 0 where they never are in it."""
    out = np.zeros(len(direction))
    if volume.top_m < lit.ground_m or volume.periodic:
        return out
    for a in range(0, len(direction), 20_000):
        some = slice(a, a + 20_000)
        place = origin[some, None] + _PLACES_M[:, None] * direction[some, None]
        height = np.linalg.norm(place + np.array([0.0, 0.0, lit.radius_m]), axis=-1) - lit.radius_m
        inside = (height < volume.top_m) & (height > lit.ground_m - 1e3) & within_sides(volume, lit.radius_m, place)
        last = len(_PLACES_M) - 1 - np.argmax(inside[:, ::-1], axis=1)
        out[some] = np.where(inside.any(axis=1), _PLACES_M[np.minimum(last + 1, len(_PLACES_M) - 1)], 0.0)
    return out
