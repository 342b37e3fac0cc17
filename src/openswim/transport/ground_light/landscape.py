"""The landscape around an eye: the user's elevation models, the model's terrain, the default Earth's mountains.

Height fields of the same number of nodes lie around the eye, each twice as wide and twice as coarse as the one before,
so that a step is about as wide as a pixel wherever one looks; the finest has the resolution of the elevation model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.scene.rays import Rays
from openswim.scene.rims import rim_m
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.relief import HeightField, Relief
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.surface import Surface

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

HIGHEST_EYE_M = 1e5
_REACH_M = 400e3  # farther away haze hides what rises above the horizon
_HIGHEST_M = 5000.0  # of mountains that may stand beyond the horizon
_NODES = (256, 2048)  # from the eye to the side of a field: as many as pixels to a radian, within these
_WEDGE_DEG = 25.0  # rays that rise more steeply meet no mountains
_STEEP_DEG = 45.0  # rays that fall more steeply see land no farther away than they are high, which the finest field has
_ASIDE = 0.1  # of a field's half width, that it reaches beyond what rays see
_BEHIND = 0.25  # and in every direction: ridges out of the picture cast shadows
_BEYOND_M, _BEYOND_CELLS = 20e3, 2.0  # the domain's edge fades into the default Earth over as much, or as many cells
_RIM = 0.2  # of the reach, over which all fades to the level ground beyond
_FLAT_M = 100.0  # lower ground is level
_LEVEL_M = 10.0  # a domain whose heights differ by more would end as a wall
_KNOTS = 8  # nodes between places that maps and projections are asked for
_KNOT_M = 4000.0  # and how far those are apart, at most
_BAND = 250_000  # nodes worked out at a time
_ASKED = 50_000  # rays, spread over a picture, of which what is seen of the land is asked
_WIDEST_EDGE_M = 3000.0  # over which elevation models fade into the coarser


@dataclass(frozen=True, eq=False)
class Landscape:
    """The heights of the ground, and what of them an eye sees."""

    surface: Surface
    medium: Medium
    wider: Landscape | None = None  # of the grid around it

    def ground_m(self, lat: float, lon: float) -> float:
        """Height of the ground at a place, at the resolution of the finest elevation model."""
        pixel = min((pixel_m for pixel_m, _, _ in self.surface.map_outlines), default=0.0)
        height, share, mapped = self._parts(np.array([lat]), np.array([lon]), pixel, Lattice(1, 1, 1))
        return float((height + share * (mapped - height))[0])

    def seen_from(self, rays: Rays) -> Relief | None:
        """The relief around the rays' common eye at the resolution of their pixels; None from space, or without one."""
        if rays.origin_m.ndim == 2 and np.ptp(rays.origin_m, axis=0).max() > 1e-3:
            return None
        eye = rays.origin_m if rays.origin_m.ndim == 1 else rays.origin_m[0]
        frame = self.medium.frame
        lat, lon, height_m = (float(v) for v in frame.latlon(eye))
        if height_m > HIGHEST_EYE_M:
            return None
        some = rays[:: max(1, len(rays) // _ASKED)]
        local = some.directions() @ frame.enu(lat, lon).T
        return self._relief(lat, lon, height_m, _narrowest(local, np.asarray(some.width_rad, float)), _seen_box(local))

    def _relief(self, lat: float, lon: float, height_m: float, width_rad: float, box: F64) -> Relief:
        medium = self.medium
        axes = medium.frame.enu(lat, lon)
        lowest = float(medium.terrain_m.min())
        step = max(self._finest(axes, width_rad), width_rad * (height_m - self.ground_m(lat, lon)))
        reach = self._reach(axes, max(height_m - lowest, 10.0))
        count = 2 * int(np.clip(0.5 / width_rad, _NODES[0] / 2, _NODES[1] / 2))
        fields = []
        while count * step < reach:
            nodes = np.clip(np.sign(box) * np.ceil((np.abs(box) + _ASIDE) * count / 2), -count / 2, count / 2)
            behind = math.ceil(_BEHIND * count / 2)
            low, high = np.minimum(2 * nodes[:2], -2 * behind), np.maximum(2 * nodes[2:], 2 * behind)
            fields.append(self._field(axes, low.astype(int), high.astype(int), step, reach))
            step *= 2
        last = math.ceil(reach / step)
        fields.append(self._field(axes, np.array([-last, -last]), np.array([last, last]), step, reach))
        return Relief(medium.frame.radius_m, self.widest.medium.ground_m, tuple(fields), axes)

    def _finest(self, axes: F64, width_rad: float) -> float:
        """The finest step that an elevation model has where it is, or half a cell of the medium."""
        steps = [0.5 * min(self.medium.cell_m)]
        for pixel_m, lat, lon in self.surface.map_outlines:
            x, y = self._plane(axes, lat, lon)
            away = math.hypot(max(x.min(), -x.max(), 0.0), max(y.min(), -y.max(), 0.0))
            steps.append(max(pixel_m, width_rad * away))
        return min(steps)

    def _reach(self, axes: F64, eye_m: float) -> float:
        """How far mountains can be seen, or are known."""
        radius = self.medium.frame.radius_m
        level = math.sqrt(2 * radius * eye_m)
        horizon = max(min(level + math.sqrt(2 * radius * _HIGHEST_M), _REACH_M), 1.1 * level)
        if self.surface.earth_known:
            return horizon
        place = self.widest.medium.place
        rim = np.concatenate([place[0], place[-1], place[:, 0], place[:, -1]])
        lat, lon, _ = self.medium.frame.latlon(rim)
        outlines = [(lat, lon), *(outline for _, *outline in self.surface.map_outlines)]
        known = max(float(np.abs(self._plane(axes, *o)).max()) for o in outlines)
        return min(horizon, (known + self._beyond_m) / (1 - _RIM))

    @property
    def widest(self) -> Landscape:
        """The landscape of the outermost grid."""
        return self if self.wider is None else self.wider.widest

    @property
    def _beyond_m(self) -> float:
        """How far beyond the domain's edge its terrain is felt."""
        return max(_BEYOND_M, _BEYOND_CELLS * max(self.medium.grid.spacing_m()))

    def _plane(self, axes: F64, lat: F64, lon: F64) -> tuple[F64, F64]:
        """Places on the plane that touches the sea under the eye."""
        frame = self.medium.frame
        local = (frame.position(lat, lon, 0.0) + np.array([0.0, 0.0, frame.radius_m])) @ axes.T
        q = frame.radius_m / np.maximum(local[:, 2], 0.1 * frame.radius_m)
        return local[:, 0] * q, local[:, 1] * q

    def _field(self, axes: F64, low: NDArray, high: NDArray, step: float, reach: float) -> HeightField:
        """The field from nodes ``low`` to ``high`` (x, y), counted from the eye."""
        (nx, ny), origin = (high - low + 1).tolist(), low * step
        height, share, mapped = np.empty((3, ny, nx), FLOAT)
        rows = max(2, _BAND // nx)
        for first in range(0, ny, rows):
            part = slice(first, min(ny, first + rows))
            lattice = Lattice(part.stop - first, nx, int(np.clip(_KNOT_M / step, 1, _KNOTS)))
            x, y = (start + step * knots for start, knots in zip((origin[0], origin[1] + step * first), lattice.knots,
                                                                 strict=True))  # fmt: skip
            lat, lon = self._latlon(axes, x, y)
            found = self._parts(lat, lon, step, lattice)
            height[part], share[part], mapped[part] = (v.reshape(-1, nx) for v in found)
        if share.any():
            share *= _within_edges(share, min(max(self.medium.grid.spacing_m()), _WIDEST_EDGE_M) / step)
            height += share * (mapped - height)
        # the edge of what is known must not stand as a wall
        x, y = (np.abs(start + step * np.arange(n)) / reach for start, n in zip(origin, (nx, ny), strict=True))
        ground_m = FLOAT(self.widest.medium.ground_m)
        known = np.clip((1.0 - np.maximum(x[None, :], y[:, None])) / _RIM, 0.0, 1.0).astype(FLOAT)
        height = ground_m + known * (height - ground_m)
        return HeightField((float(origin[0]), float(origin[1])), step, height)

    def _latlon(self, axes: F64, x: F64, y: F64) -> tuple[F64, F64]:
        """Latitude and longitude (ny nx,) of points of the plane."""
        frame = self.medium.frame
        local = np.stack([*np.meshgrid(x, y), np.full((y.size, x.size), frame.radius_m)], axis=-1).reshape(-1, 3)
        local *= frame.radius_m / np.linalg.norm(local, axis=-1, keepdims=True)
        lat, lon, _ = frame.latlon(local @ axes - np.array([0.0, 0.0, frame.radius_m]))
        return lat, lon

    def _parts(self, lat: F64, lon: F64, step_m: float, lattice: Lattice) -> tuple[F64, F64, F64]:
        """Heights (n,) by the model and the default Earth, share and heights of the user's elevation models; places
        are given at knots of the lattice."""
        sea = self.surface.sea(lat, lon)
        height = self._height(lat, lon, sea, lattice)
        if not self.surface.mapped:
            return height, np.zeros(height.size), height
        mapped, mapped_share = self.surface.mapped_m(lat, lon, np.full(height.size, step_m), lattice.between)
        # models of the whole Earth go on under the sea
        return height, mapped_share, np.where(lattice.between(sea.astype(float)) > 0.5, np.maximum(mapped, 0.0), mapped)

    def _height(self, lat: F64, lon: F64, sea: NDArray[np.bool_], lattice: Lattice) -> F64:
        """Heights (n,) by the model, the wider ones around it and the default Earth."""
        medium, surface = self.medium, self.surface
        if self.wider is not None:
            height = self.wider._height(lat, lon, sea, lattice)
        else:
            height = surface.earth_m(lat, lon) if surface.earth_known else np.where(sea, 0.0, medium.ground_m)
            height = lattice.between(height)
        ix, iy = (lattice.between(np.nan_to_num(i * medium.fineness, nan=-1e9)) for i in medium.grid.index(lon, lat))
        ny, nx = medium.terrain_m.shape
        dx, dy = medium.cell_m
        if self.wider is not None:  # which knows what is beyond
            within = np.minimum(np.minimum(ix, nx - 1 - ix) * dx, np.minimum(iy, ny - 1 - iy) * dy)
            share = np.clip(within / rim_m(max(self.wider.medium.cell_m), min(nx * dx, ny * dy)), 0.0, 1.0)
        else:
            away = np.hypot(np.maximum(np.maximum(-ix, ix - (nx - 1)), 0) * dx,
                            np.maximum(np.maximum(-iy, iy - (ny - 1)), 0) * dy)  # fmt: skip
            share = np.clip(1.0 - away / self._beyond_m, 0.0, 1.0)
        share *= share * (3.0 - 2.0 * share)
        near = np.flatnonzero(share)
        height[near] += share[near] * (bilinear(medium.terrain_m, ix[near], iy[near]) - height[near])
        return height


class Lattice:
    """Nodes (ny, nx) of a field, and the knots among them where maps and projections are asked: linear between."""

    def __init__(self, ny: int, nx: int, every: int) -> None:
        self.shape = ny, nx
        self.knots = tuple(np.linspace(0.0, n - 1.0, max(1, math.ceil((n - 1) / every)) + 1) for n in (nx, ny))

    def between(self, values: F64) -> F64:
        """Values (ny nx,) at the nodes of those at the knots."""
        ny, nx = self.shape
        x, y = self.knots
        if nx * ny == 1:
            return values.copy()
        v = values.reshape(y.size, x.size)
        for axis, (knots, count) in enumerate(((y, ny), (x, nx))):
            at = np.arange(count) * ((knots.size - 1) / max(count - 1, 1))
            first = np.minimum(at.astype(int), knots.size - 2)
            share = (at - first).reshape((-1, 1) if axis == 0 else (1, -1))
            low = v.take(first, axis)
            v = low + share * (v.take(first + 1, axis) - low)
        return np.asarray(v).ravel()


def landscape_of(surface: Surface, medium: Medium, wider: Landscape | None = None) -> Landscape | None:
    """The landscape of a grid on the round Earth; None where all is level. ``wider``: that around."""
    if not medium.frame.curved:
        return None
    found = Landscape(surface, medium, wider)
    if surface.mapped or wider is not None or np.ptp(medium.terrain_m) > _LEVEL_M:
        return found
    if not surface.mountains:
        return None
    reach = float(np.abs(medium.place[..., :2]).max()) + _REACH_M
    side = np.linspace(-reach, reach, 100)
    return found if float(surface.earth_m(*found._latlon(np.eye(3), side, side)).max()) > _FLAT_M else None


def _narrowest(local: F64, width_rad: F64) -> float:
    """The least width of rays (n, 3), rad, of those that are not steep if there are any: a panorama's pixels at the
    nadir have next to none."""
    level = np.abs(local[:, 2]) < math.sin(math.radians(_STEEP_DEG))
    widths = np.broadcast_to(width_rad, len(local))
    widths = widths[level] if level.any() else widths
    return max(float(widths.min()), 1 / _NODES[1]) if widths.max() > 0 else 1 / _NODES[0]


def _seen_box(local: F64) -> F64:
    """Bounding box (least x, y, greatest x, y) of the eye and what rays (n, 3) see a unit away, downward or level."""
    level = local[local[:, 2] < math.sin(math.radians(_WEDGE_DEG)), :2]
    level = level / np.maximum(np.linalg.norm(level, axis=-1, keepdims=True), 1e-9)
    ends = np.concatenate([np.zeros((1, 2)), level])
    return np.round(np.concatenate([ends.min(axis=0), ends.max(axis=0)]), 2)


def _within_edges(share: F32, width: float) -> F32:
    """1 where the known share (ny, nx) is 1 all around, falling to 0 over ``width`` nodes toward its edges."""
    half = max(1, round(0.5 * width))
    mean = share.astype(float)
    for axis in (0, 1):
        ends = [(0, 0), (0, 0)]
        ends[axis] = (half + 1, half)
        total = np.cumsum(np.pad(mean, ends, mode="edge"), axis=axis)
        across = 2 * half + 1
        head, tail = np.moveaxis(total, axis, 0)[across:], np.moveaxis(total, axis, 0)[:-across]
        mean = np.moveaxis(head - tail, 0, axis) / across
    return np.clip(2.0 * mean - 1.0, 0.0, 1.0).astype(FLOAT)
