"""Where eye rays meet the ground: height fields finer than the grid and wider than the domain.

The fields are regular on the plane that touches the Earth under the eye (gnomonic, so that rays are straight in it),
the finest that covers a place is its ground, and each has a pyramid of maxima: a ray that is higher than all around
it takes one long step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import REORDERED, kernel, part
from openswim.transport.engine.scalar import height_m
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import FAR_M, SUN_RADIUS_RAD

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_LEVELS = 9  # halvings of the pyramid, at most
_MOST_STEPS = 20_000
_HIGHEST_M = 1e4  # no ground is higher
_LEAST_PACE = 0.02  # of a ray over the plane, that steps are made for
_OVER = 1e-3  # of a cell, that a step goes over the cell's side
_LIFT_M = 0.3  # that rays to the sun begin above the ground
_DISC = (0.25, 0.75)  # how high and low on the sun's disc those rays go, in its radius


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights (ny, nx) [m] above sea level on nodes of the tangent plane from ``origin_m`` (x, y) on, ``step_m``
    apart."""

    origin_m: tuple[float, float]
    step_m: float
    height_m: F32


class Fields(NamedTuple):
    """Height fields as the kernel reads them."""

    box: F64  # (nf, 5) x, y of the first node, step, nodes along x and y
    first: I64  # (nf,) where its heights begin
    heights: F32
    levels: I64  # (nf,) of its pyramid
    top_first: I64  # (nf, _LEVELS) where a level begins
    top_shape: I64  # (nf, _LEVELS, 2)
    tops: F32


@dataclass(frozen=True, eq=False)
class Relief:
    """The ground around an eye: height fields, the finest first, on a sphere ``ground_m`` above sea level.

    axes (3, 3): rows x, y, z of the tangent plane in the scene's frame.
    """

    radius_m: float
    ground_m: float
    fields: tuple[HeightField, ...]
    axes: F64

    @cached_property
    def _packed(self) -> Fields:
        return packed(self.fields)

    @cached_property
    def _highest_m(self) -> float:
        return max(self.ground_m, *(float(f.height_m.max()) for f in self.fields))

    def meet(self, origin: F64, direction: F64) -> F64:
        """Distance (n,) [m] along rays (n, 3) to the ground, FAR_M where they miss it."""
        shape = (max(len(origin), len(direction)), 3)
        o, d = (np.array(np.broadcast_to(v, shape), float, order="C") for v in (origin, direction))
        distance = np.empty(len(o))
        in_threads(_meet_share, o, d, self.axes, self.radius_m, self.ground_m, self._highest_m, self._packed, distance)
        return distance

    def lit(self, place: F64, sun: F64) -> F64:
        """Share (n,) of the sun's disc that the ground leaves in sight of places (n, 3) on it."""
        up = place + np.array([0.0, 0.0, self.radius_m])
        up /= np.linalg.norm(up, axis=-1, keepdims=True)
        across = up - (up @ sun)[:, None] * sun
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
        start = place + _LIFT_M * up

        def seen(some: NDArray[np.int64], height: float) -> NDArray[np.bool_]:
            return self.meet(start[some], sun + height * SUN_RADIUS_RAD * across[some]) == FAR_M

        low = seen(np.arange(len(place)), -_DISC[1])
        hidden = np.flatnonzero(~low)  # what lies over a ray that meets no ground meets none either
        high = np.ones(len(place), bool)
        high[hidden] = seen(hidden, _DISC[1])
        lit = 0.5 * (low + 1.0 * high)
        partly = np.flatnonzero(low != high)  # else what lies between is as its ends
        lit[partly] = 0.25 * (1.0 + seen(partly, -_DISC[0]) + seen(partly, _DISC[0]))
        return np.asarray(lit)

    def height(self, place: F64) -> F64:
        """Height (n,) above sea level of the ground over or under places (n, 3)."""
        out = np.empty(len(place))
        in_threads(
            _height_share, np.ascontiguousarray(place), self.axes, self.radius_m, self.ground_m, self._packed, out
        )
        return out

    def normals(self, place: F64, up: F64, footprint_m: F64) -> F64:
        """Normals (n, 3) in the scene's frame of the ground at places (n, 3), smoothed over what a pixel covers."""
        x, y = self._on_plane(self._local(place))
        reach = np.full(len(place), self.fields[-1].step_m)
        for f in reversed(self.fields):
            reach[_within(f, x, y)] = f.step_m
        reach = np.maximum(reach, footprint_m)[:, None]
        first = np.cross(self.axes[1], up)
        first /= np.linalg.norm(first, axis=-1, keepdims=True)
        normal = up.copy()
        for axis in (first, np.cross(up, first)):
            rise = self.height(place + reach * axis) - self.height(place - reach * axis)
            normal -= rise[:, None] / (2 * reach) * axis
        return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))

    def _local(self, place: F64) -> F64:
        """Places in the axes of the tangent plane."""
        centre = np.array([0.0, 0.0, self.radius_m])
        return np.asarray(np.atleast_2d(place + centre) @ self.axes.T - centre)

    def _on_plane(self, local: F64) -> tuple[F64, F64]:
        q = self.radius_m / np.maximum(self.radius_m + local[:, 2], 1e-3 * self.radius_m)
        return local[:, 0] * q, local[:, 1] * q


def packed(fields: tuple[HeightField, ...]) -> Fields:
    """Height fields and their pyramids of maxima for the kernel."""
    tops: list[list[F32]] = []
    for n, f in enumerate(fields):
        h = f.height_m
        cells = np.maximum.reduce([h[:-1, :-1], h[1:, :-1], h[:-1, 1:], h[1:, 1:]])
        if n:
            _raise(cells, f, fields[n - 1], tops[n - 1][0])
        tops.append(_pyramid(cells))
    shape = np.zeros((len(fields), _LEVELS, 2), np.int64)
    for n, own in enumerate(tops):
        shape[n, : len(own)] = [t.shape for t in own]
    sizes = shape.prod(axis=2).ravel()
    heights = [f.height_m.ravel() for f in fields]
    return Fields(
        np.array([[*f.origin_m, f.step_m, f.height_m.shape[1], f.height_m.shape[0]] for f in fields], float),
        np.cumsum([0] + [h.size for h in heights[:-1]]).astype(np.int64), np.concatenate(heights).astype(FLOAT),
        np.array([len(own) for own in tops], np.int64), (np.cumsum(sizes) - sizes).reshape(-1, _LEVELS), shape,
        np.concatenate([t.ravel() for own in tops for t in own]),
    )  # fmt: skip


def _raise(cells: F32, own: HeightField, finer: HeightField, finer_top: F32) -> None:
    """Cells of a field are at least as high as what a finer one has in them."""
    ny, nx = finer_top.shape
    j, i = (
        (finer.origin_m[axis] - own.origin_m[axis] + (np.arange(count) + 0.5) * finer.step_m) // own.step_m
        for axis, count in ((1, ny), (0, nx))
    )
    rows, columns = (np.clip(k, 0, most - 1).astype(int) for k, most in zip((j, i), cells.shape, strict=True))
    _raise_to(cells, rows, columns, finer_top)


@kernel()
def _raise_to(cells, rows, columns, least):
    """Raise cells (ny, nx) to values (m, n) that lie in these of their rows (m,) and columns (n,)."""
    for j in range(rows.size):
        for i in range(columns.size):
            cells[rows[j], columns[i]] = max(cells[rows[j], columns[i]], least[j, i])


def _pyramid(cells: F32) -> list[F32]:
    """Level k, cell (j, i): the greatest of block (j, i) of 2^k cells each way and of the blocks around it."""
    out = []
    for _ in range(_LEVELS):
        around = np.pad(cells, 1, mode="edge")
        wide = np.maximum(np.maximum(around[:-2], around[1:-1]), around[2:])
        out.append(np.maximum(np.maximum(wide[:, :-2], wide[:, 1:-1]), wide[:, 2:]).astype(FLOAT))
        ny, nx = cells.shape
        if min(ny, nx) < 4:
            break
        even = np.pad(cells, ((0, ny % 2), (0, nx % 2)), mode="edge")
        cells = np.maximum.reduce([even[::2, ::2], even[1::2, ::2], even[::2, 1::2], even[1::2, 1::2]])
    return out


def _within(f: HeightField, x: F64, y: F64) -> NDArray[np.bool_]:
    ny, nx = f.height_m.shape
    u, v = (x - f.origin_m[0]) / f.step_m, (y - f.origin_m[1]) / f.step_m
    return (u >= 0) & (u <= nx - 1) & (v >= 0) & (v <= ny - 1)


@part(REORDERED)
def _turned(x, y, z, axes):
    """A vector in the axes of the tangent plane."""
    return (
        axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z, axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z,
        axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z,
    )  # fmt: skip


@part(REORDERED)
def _sphere_distance(ox, oy, oz, dx, dy, dz, radius_m, ground_m):
    """Distance along a ray to the sphere ``ground_m`` above that of the sea; FAR_M from under it."""
    rise = ox * dx + oy * dy + oz * dz + radius_m * dz
    # |p|^2 - (R + g)^2 without cancellation
    excess = ox * ox + oy * oy + oz * oz + 2.0 * radius_m * (oz - ground_m) - ground_m * ground_m
    disc = rise * rise - excess
    return excess / (math.sqrt(disc) - rise) if rise < 0.0 and disc > 0.0 and excess >= 0.0 else FAR_M


@part(REORDERED)
def _covering(px, py, box):
    """The finest field that covers a point of the plane, or -1."""
    for f in range(box.shape[0]):
        u, v = (px - box[f, 0]) / box[f, 2], (py - box[f, 1]) / box[f, 2]
        if u >= 0.0 and v >= 0.0 and u <= box[f, 3] - 1.0 and v <= box[f, 4] - 1.0:
            return f
    return -1


@part(REORDERED)
def _bilinear(h, n, nx, a, b):
    """Height in the cell whose first node is the n-th, at shares of its sides."""
    return (h[n] * (1 - a) + h[n + 1] * a) * (1 - b) + (h[n + nx] * (1 - a) + h[n + nx + 1] * a) * b


@part(REORDERED)
def _clearance(x, y, z, f, i, j, radius_m, fields):
    """Height of a point over cell (j, i) of a field, which goes on beyond its sides."""
    q = radius_m / (radius_m + z)
    a, b = (x * q - fields.box[f, 0]) / fields.box[f, 2] - i, (y * q - fields.box[f, 1]) / fields.box[f, 2] - j
    nx = int(fields.box[f, 3])
    return height_m(x, y, z, radius_m) - _bilinear(fields.heights, fields.first[f] + j * nx + i, nx, a, b)


@part(REORDERED)
def first_root(begin, middle, end):
    """Where from 0 to 1 a parabola through three even values first falls to zero; 2 where it does not."""
    if begin <= 0.0:
        return 0.0
    bend = 2.0 * (begin - 2.0 * middle + end)
    slope = end - begin - bend
    disc = slope * slope - 4.0 * bend * begin
    if disc < 0.0 or (end > 0.0 and not (bend > 0.0 and -slope > 0.0 and -slope < 2.0 * bend)):
        return 2.0
    return 2.0 * begin / (math.sqrt(disc) - slope)


@part(REORDERED)
def _cell_ahead(at, pace, nodes):
    """The cell that a ray at a fractional index goes through, or into where it stands on a node."""
    cell = math.floor(at) if pace >= 0.0 else math.ceil(at) - 1.0
    return int(min(max(cell, 0.0), nodes - 2.0))


@part(REORDERED)
def _way_out(at, pace, first, last):
    """How far along a ray its fractional index leaves what lies between two."""
    if pace > 0.0:
        return (last - at) / pace
    return (first - at) / pace if pace < 0.0 else FAR_M


@part(REORDERED)
def _way_in(px, py, vx, vy, pace, box):
    """A step toward a box that a point of the plane is not in; negative where its ray goes another way."""
    right, above = box[0] + (box[3] - 1.0) * box[2], box[1] + (box[4] - 1.0) * box[2]
    if (px < box[0] and vx <= 0.0) or (px > right and vx >= 0.0):
        return -1.0
    if (py < box[1] and vy <= 0.0) or (py > above and vy >= 0.0):
        return -1.0
    away = max(max(box[0] - px, px - right), max(box[1] - py, py - above))
    return 0.9 * away / max(pace, _LEAST_PACE) + 0.05 * box[2]


@part(REORDERED)
def _meet_one(ox, oy, oz, dx, dy, dz, t, radius_m, base_m, highest_m, fields, farthest):
    """Distance along a ray from ``t`` on to the fields, or ``farthest``; where it leaves them below ``base_m`` is
    ground too."""
    level, last = 0, -1
    outermost = fields.box.shape[0] - 1
    for _ in range(_MOST_STEPS):
        if t >= farthest:
            return farthest
        x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
        depth = radius_m + z
        if depth <= 0.1 * radius_m:
            return farthest
        h = height_m(x, y, z, radius_m)
        mu = (x * dx + y * dy + depth * dz) / (radius_m + h)
        if h > highest_m and mu >= 0.0:
            return farthest
        q = radius_m / depth
        px, py = x * q, y * q
        vx, vy = q * (dx - x * dz / depth), q * (dy - y * dz / depth)
        pace = max(math.sqrt(vx * vx + vy * vy), _LEAST_PACE)
        f = _covering(px, py, fields.box)
        if f < 0:
            if last >= 0:
                return min(t, farthest) if h < base_m else farthest
            step = _way_in(px, py, vx, vy, pace, fields.box[outermost])
            if step < 0.0:
                return farthest
            t += step
            continue
        if f != last:
            level, last = 0, f
        cell = fields.box[f, 2]
        over = _OVER * cell / pace
        u, v = (px - fields.box[f, 0]) / cell, (py - fields.box[f, 1]) / cell
        i, j = _cell_ahead(u, vx, fields.box[f, 3]), _cell_ahead(v, vy, fields.box[f, 4])
        columns = fields.top_shape[f, level, 1]
        row, column = min(j >> level, fields.top_shape[f, level, 0] - 1), min(i >> level, columns - 1)
        ahead = 0.9 * (1 << level) * cell / pace
        if h + min(mu, 0.0) * ahead > fields.tops[fields.top_first[f, level] + row * columns + column]:
            # what lies beyond its sides the field does not know
            side = min(_way_out(u, vx / cell, 0.0, fields.box[f, 3] - 1.0),
                       _way_out(v, vy / cell, 0.0, fields.box[f, 4] - 1.0))  # fmt: skip
            t += min(ahead, max(side, 0.0) + over)
            level = min(level + 1, fields.levels[f] - 1)
            continue
        if level > 0:
            level -= 1
            continue
        length = max(min(_way_out(u, vx / cell, i, i + 1.0), _way_out(v, vy / cell, j, j + 1.0)), 0.0)
        length = min(length + over, cell / pace)
        middle, far = t + 0.5 * length, t + length
        root = first_root(
            _clearance(x, y, z, f, i, j, radius_m, fields),
            _clearance(ox + middle * dx, oy + middle * dy, oz + middle * dz, f, i, j, radius_m, fields),
            _clearance(ox + far * dx, oy + far * dy, oz + far * dz, f, i, j, radius_m, fields),
        )
        if root <= 1.0:
            return min(t + root * length, farthest)
        t = far
    return farthest


@kernel(REORDERED)
def _meet_share(k, threads, origin, direction, axes, radius_m, base_m, highest_m, fields, distance):
    """Thread k's of the distances (n,) of rays (n, 3) to the ground, FAR_M where they miss it."""
    outermost = fields.box[fields.box.shape[0] - 1 :]
    for n in range(k, direction.shape[0], threads):
        ox, oy, oz = _turned(origin[n, 0], origin[n, 1], origin[n, 2] + radius_m, axes)
        oz -= radius_m
        dx, dy, dz = _turned(direction[n, 0], direction[n, 1], direction[n, 2], axes)
        far = _sphere_distance(ox, oy, oz, dx, dy, dz, radius_m, base_m)
        if far < FAR_M:  # the sphere is the ground only where no field is
            q = radius_m / max(radius_m + oz + far * dz, 1e-3 * radius_m)
            if _covering((ox + far * dx) * q, (oy + far * dy) * q, outermost) == 0:
                far = FAR_M
        start = 0.0
        if height_m(ox, oy, oz, radius_m) > _HIGHEST_M:
            start = _sphere_distance(ox, oy, oz, dx, dy, dz, radius_m, _HIGHEST_M)
        distance[n] = _meet_one(ox, oy, oz, dx, dy, dz, start, radius_m, base_m, highest_m, fields, far)


@kernel(REORDERED)
def _height_share(k, threads, place, axes, radius_m, base_m, fields, height):
    """Thread k's of the heights (n,) of the ground over or under places (n, 3)."""
    for n in range(k, place.shape[0], threads):
        x, y, depth = _turned(place[n, 0], place[n, 1], place[n, 2] + radius_m, axes)
        q = radius_m / max(depth, 1e-3 * radius_m)
        x, y = x * q, y * q
        f = _covering(x, y, fields.box)
        height[n] = base_m
        if f >= 0:
            u, v = (x - fields.box[f, 0]) / fields.box[f, 2], (y - fields.box[f, 1]) / fields.box[f, 2]
            nx = int(fields.box[f, 3])
            i, j = min(int(u), nx - 2), min(int(v), int(fields.box[f, 4]) - 2)
            height[n] = _bilinear(fields.heights, fields.first[f] + j * nx + i, nx, u - i, v - j)
