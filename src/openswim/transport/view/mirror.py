"""What water mirrors: the sky of the scene itself, clouds and far shores, smeared by the waves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.ground import water
from openswim.transport.engine.pack import PACK
from openswim.transport.march.volume import FAR_M

if TYPE_CHECKING:
    from openswim.transport.field import PackField

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

HIGHEST_EYE_M = 30_000.0  # from above, water mirrors 2 % of the sky: the clear one will do
_ROWS, _COLUMNS = 50, 90  # of the mirrored picture, at most
_LEAST_STEP_RAD = np.radians(0.4)  # waves smear over several degrees
_BESIDE_RAD = np.radians(1.0)  # so that this far from its end a mirrored picture is what it is there
_FACETS = 16
_LIKE_WIND = 0.5  # m/s, by which winds of a picture's parts may differ
_LIFT_M = 0.5  # above the ground, that mirrored rays begin
_LOWEST = 0.01  # sine of the altitude: what would be mirrored from below the horizon is seen by way of a second wave


@dataclass(frozen=True)
class Mirrored:
    """The sky that waves at a wind speed mirror to an eye, by azimuth and altitude (rad) there: radiance ``seen``
    (altitudes, azimuths, PACK), where it is ``known``. Azimuths count from ``start``."""

    eye: F64
    wind_speed: float
    up: F64
    axes: F64
    start: float
    azimuth: F64
    altitude: F64
    seen: F64
    known: NDArray[np.bool_]

    @classmethod
    def of(cls, field: PackField, eye: F64, place: F64, direction: F64, wind_speed: float) -> Mirrored:
        """That part of it which is seen along ``direction`` (n, 3) at ``place`` (n, 3)."""
        radius = field.frame.radius_m
        up = _upward(eye[None], radius)[0]
        axes = _horizontal(up)
        azimuth, altitude = _angles(direction, axes, up)
        start = _widest_gap(azimuth)
        grid_az, grid_alt = _axis((azimuth - start) % (2 * np.pi), _COLUMNS), _axis(altitude, _ROWS)
        level = float(np.median(np.linalg.norm(place + np.array([0.0, 0.0, radius]), axis=-1))) + 0.5
        az, alt = (v.ravel() for v in np.meshgrid(grid_az, grid_alt))
        az += start
        toward = np.cos(alt)[:, None] * (np.sin(az)[:, None] * axes[0] + np.cos(az)[:, None] * axes[1])
        toward += np.sin(alt)[:, None] * up
        node = _on_sphere(eye, toward, level, radius)
        if field.relief is not None:  # where no water lies level, it is as high as the ground
            distance = field.relief.meet(eye[None], toward)
            met = distance < FAR_M
            node[met] = eye + distance[met, None] * toward[met] + _LIFT_M * up
        shape = (grid_alt.size, grid_az.size)
        seen, known = _marched(field, eye, node, toward, wind_speed)
        seen = seen.reshape(*shape, PACK)
        return cls(eye, wind_speed, up, axes, start, grid_az, grid_alt, seen, known.reshape(shape))

    def angles(self, direction: F64) -> tuple[F64, F64]:
        """Azimuth and altitude (n,) as they are counted here."""
        azimuth, altitude = _angles(direction, self.axes, self.up)
        before = _BESIDE_RAD  # the first node, and not a turn after it
        return (azimuth - self.start + before) % (2 * np.pi) - before, altitude

    def covers(self, eye: F64, direction: F64, wind_speed: float) -> bool:
        """Whether it is this eye's, by about this wind, and holds all along ``direction`` (n, 3) or beside."""
        if not np.array_equal(eye, self.eye) or abs(wind_speed - self.wind_speed) > _LIKE_WIND:
            return False
        return all(
            angle.min() > nodes[0] - _BESIDE_RAD and angle.max() < nodes[-1] + _BESIDE_RAD
            for angle, nodes in zip(self.angles(direction), (self.azimuth, self.altitude), strict=True)
        )

    def along(self, direction: F64) -> F32:
        """Radiance (n, PACK), NaN where there is no node that is known."""
        azimuth, altitude = self.angles(direction)
        x = np.interp(azimuth, self.azimuth, np.arange(self.azimuth.size))
        y = np.interp(altitude, self.altitude, np.arange(self.altitude.size))
        return _among(self.seen, self.known, x, y)


def mirrored_sky(field: PackField, eye: F64, place: F64, direction: F64, wind_speed: F64) -> F32:
    """Mean radiance L' (n, PACK) of the sky that waves at ``place`` (n, 3) mirror to an eye (3,); NaN where unknown.

    The mirrored picture is smooth, so it is marched on its own coarse grid of azimuth and altitude at the eye, sixteen
    facets to a node: tilted by Cox & Munk's (1954) slopes, weighted with Fresnel reflectance and the area they show.
    The field keeps it for as long as a picture is made.
    """
    wind = float(np.mean(wind_speed))
    if field.mirrored is None or not field.mirrored.covers(eye, direction, wind):
        field.mirrored = Mirrored.of(field, eye, place, direction, wind)
    return field.mirrored.along(direction)


def _marched(
    field: PackField, eye: F64, place: F64, direction: F64, wind_speed: float
) -> tuple[F64, NDArray[np.bool_]]:
    """Mirrored radiance (n, PACK) at places, and whether the way up is free there."""
    n, radius = len(place), field.frame.radius_m
    up = _upward(place, radius)
    level = direction - (direction * up).sum(-1, keepdims=True) * up
    level /= np.maximum(np.linalg.norm(level, axis=-1, keepdims=True), 1e-9)
    along, across = _slopes() * np.sqrt(0.5 * water.mean_square_slope(wind_speed))
    # facets (n, 16, 3): positive slopes along lean toward the viewer
    normal = up[:, None] - along[:, None] * level[:, None] + across[:, None] * np.cross(up, level)[:, None]
    steepness = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal /= steepness
    cos_in = -(direction[:, None] * normal).sum(-1)
    weight = np.maximum(cos_in, 0.0) * steepness[..., 0] * water.fresnel_reflectance(cos_in)
    out = direction[:, None] + 2 * cos_in[..., None] * normal
    rise = (out * up[:, None]).sum(-1, keepdims=True)
    out += np.maximum(_LOWEST - rise, 0.0) * up[:, None]
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    # all that a level mirror shows is seen from the eye's image under the water
    middle = place[n // 2]
    image = eye - 2 * ((eye - middle) @ up[n // 2]) * up[n // 2]
    radiance, distance = field.look(np.repeat(place, _FACETS, axis=0), out.reshape(-1, 3), image)
    free = (distance.reshape(n, -1) < 0) | (distance.reshape(n, -1) > 30.0)
    weight = weight * free
    total = weight.sum(axis=1)
    mean = (weight[..., None] * radiance.reshape(n, _FACETS, PACK)).sum(axis=1) / np.maximum(total, 1e-12)[:, None]
    return mean, free.any(axis=1) & (total > 0)


@cache
def _slopes() -> F64:
    """Slopes (2, facets) along and across the line of sight in standard deviations, evenly spread over a Gaussian."""
    i = np.arange(_FACETS) + 0.5
    radius = np.sqrt(-2 * np.log(1 - i / _FACETS))
    turn = 2 * np.pi * i * 0.6180339887498949
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)])


def _among(values: F64, known: NDArray[np.bool_], x: F64, y: F64) -> F32:
    """Values (rows, columns, k) at fractional indices, among the known; NaN where there is none."""
    rows, columns = known.shape
    i, j = np.minimum(x.astype(int), max(columns - 2, 0)), np.minimum(y.astype(int), max(rows - 2, 0))
    a, b = x - i, y - j
    total, out = np.zeros(x.size), np.zeros((x.size, values.shape[-1]))
    for dj, di, share in ((0, 0, (1 - a) * (1 - b)), (0, 1, a * (1 - b)), (1, 0, (1 - a) * b), (1, 1, a * b)):
        r, c = np.minimum(j + dj, rows - 1), np.minimum(i + di, columns - 1)
        w = (share + 1e-6) * known[r, c]
        total += w
        out += w[:, None] * values[r, c]
    return np.where(total[:, None] > 0, out / np.maximum(total, 1e-12)[:, None], np.nan).astype(np.float32)


def _axis(angle: F64, most: int) -> F64:
    """Even nodes that span the angles."""
    low, high = float(angle.min()), float(angle.max())
    # a lake seen at a glance spans little altitude and much distance
    return np.linspace(low, high + 1e-9, int(np.clip(np.ceil((high - low) / _LEAST_STEP_RAD) + 1, most // 3, most)))


def _widest_gap(azimuth: F64) -> float:
    """Where to start to count azimuths (rad), so that the widest gap among them lies at the ends."""
    ordered = np.sort(azimuth[:: max(1, azimuth.size // 5000)] % (2 * np.pi))
    gaps = np.diff(np.append(ordered, ordered[0] + 2 * np.pi))
    return float(ordered[(int(gaps.argmax()) + 1) % ordered.size]) - 0.01


def _angles(direction: F64, axes: F64, up: F64) -> tuple[F64, F64]:
    return np.arctan2(direction @ axes[0], direction @ axes[1]), np.arcsin(np.clip(direction @ up, -1, 1))


def _horizontal(up: F64) -> F64:
    """Two horizontal unit vectors."""
    first = np.cross([0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0], up)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def _upward(place: F64, radius_m: float) -> F64:
    up = place + np.array([0.0, 0.0, radius_m])
    return np.asarray(up / np.linalg.norm(up, axis=-1, keepdims=True))


def _on_sphere(eye: F64, direction: F64, level_m: float, radius_m: float) -> F64:
    """Where rays from an eye first meet the sphere of a radius about the Earth's centre, or come nearest to it."""
    centre = eye + np.array([0.0, 0.0, radius_m])
    along = direction @ centre
    excess = float(centre @ centre) - level_m**2
    root = np.sqrt(np.maximum(along**2 - excess, 0.0))
    return np.asarray(eye + np.maximum(-along - root, 0.0)[:, None] * direction)
