"""A grid that lies in a wider, coarser one: every ray sees each part of its way in the finest that covers it.

Light is solved on every grid by itself, the wider first, with the same frame, sun and eye. A ray goes through the wider
grid up to the inner one's core, through the core, and on through the wider: L = L1 + T1 (L2 + T2 L3). The core ends
within the inner grid, since what enters at its sides is only as good as the wider grid's light (`sides.py`). Air beside
grids is in each of them, and no part of a way is walked twice. docs/decisions/0014-nested-grids.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.scene.rims import CORE_RIM, LEAST_CORE_RIM
from openswim.transport.beam.sun_sweep import inside
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.pack import PACK
from openswim.transport.march.march import DARK
from openswim.transport.march.volume import FAR_M, Volume

if TYPE_CHECKING:
    from openswim.transport.beam.lit_volume import SunDepth
    from openswim.transport.field import PackField
    from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SHORTEST_M = 1.0  # way through a grid that is worth a look
_SAME_M = 0.01  # distances that differ by less are the same


class Seen(NamedTuple):
    """What rays (n) have seen, but for the ground's own light; (n, PACK) where nothing else is said."""

    radiance: F32
    through: F32  # what is left of the ground's light
    full: F32  # and of the sun's
    distance: F64  # (n,) to the ground, or -1
    depth: F32  # (n, ns) of each species
    samples: int
    level: NDArray[np.int8]  # (n,) grid in which they end: 0 for the field's own, 1 for the wider ...

    @classmethod
    def nothing(cls, n: int, species: int) -> Seen:
        """Rays that have not set out."""
        return cls(
            np.zeros((n, PACK), np.float32), np.ones((n, PACK), np.float32), np.ones((n, PACK), np.float32),
            np.full(n, -1.0), np.zeros((n, species), np.float32), 0, np.zeros(n, np.int8),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Core:
    """The part of a grid in which rays see it: planes (4, 3) with normals inward, ``offset_m`` (4,) from the Earth's
    centre."""

    normal: F64
    offset_m: F64
    radius_m: float

    @classmethod
    def of(cls, medium: Medium) -> Core:
        """All of a grid but its rim."""
        radius = medium.frame.radius_m
        ny, nx = medium.place.shape[:2]
        y, x = (min(max(LEAST_CORE_RIM, round(CORE_RIM * n)), (n - 2) // 2) for n in (ny, nx))
        up = (medium.place[y : ny - y, x : nx - x] + np.array([0.0, 0.0, radius])) / radius
        centre = up[up.shape[0] // 2, up.shape[1] // 2]
        normals, offsets = [], []
        for side in (up[:, 0], up[:, -1], up[0], up[-1]):
            normal = np.cross(side[0], side[-1])
            normal *= np.sign(normal @ centre) / np.linalg.norm(normal)
            normals.append(normal)
            offsets.append(radius * float((side @ normal).max()))  # where sides are bent, as far in as they are
        return cls(np.array(normals), np.array(offsets), radius)

    def crossed(self, origin: F64, direction: F64, top_m: float) -> tuple[F64, F64]:
        """Where rays (n, 3) enter the core and leave it, within the air: (n,) each, both FAR_M where they pass it by.
        One that enters before there is air enters at once, one that leaves after it never does."""
        place = origin + np.array([0.0, 0.0, self.radius_m])
        enter, leave = np.zeros(len(direction)), np.full(len(direction), FAR_M)
        for normal, offset in zip(self.normal, self.offset_m, strict=True):
            a, b = place @ normal - offset, direction @ normal
            with np.errstate(divide="ignore", invalid="ignore"):
                at = -a / b
            enter = np.where(b > 0, np.maximum(enter, at), enter)
            leave = np.where(b < 0, np.minimum(leave, at), leave)
            leave[(b == 0) & (a < 0)] = 0.0
        along = (place * direction).sum(-1)
        half = along**2 - (place**2).sum(-1) + (self.radius_m + top_m) ** 2
        root = np.sqrt(np.maximum(half, 0.0))
        enter = np.where(enter <= -along - root, 0.0, enter)
        beside = (leave <= enter) | (half <= 0) | (leave <= -along - root) | (enter >= root - along)
        leave = np.where(leave >= root - along, FAR_M, leave)
        return np.where(beside, FAR_M, enter), np.where(beside, FAR_M, leave)


def march(field: PackField, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
    """What rays (n, 3) see of a field and of the wider ones around it; ``ends``, ``cone`` as `march_rays` has them."""
    wider, core = field.wider, field.core
    assert wider is not None
    assert core is not None
    n = len(direction)
    ends = np.full(n, -FAR_M) if ends is None else ends
    last = np.abs(ends)
    enter, leave = core.crossed(origin, direction, field.shells.top_m)
    seen = Seen.nothing(n, max(field.volume.species, 1))
    samples = 0
    for level, start, stop in ((wider, np.zeros(n), enter), (field, enter, leave), (wider, leave, np.full(n, FAR_M))):
        stop = np.minimum(stop, last)
        going = np.flatnonzero(
            (stop > start + _SHORTEST_M) & (seen.distance < 0) & (seen.through.max(axis=1) > DARK)
        )
        if not going.size:
            continue
        first = start[going]
        length = stop[going] - first
        o = origin[going] + first[:, None] * direction[going]
        limit = np.where(ends[going] < 0, -length, length)
        widths = None if cone is None else np.stack([cone[going, 0] + cone[going, 1] * first, cone[going, 1]], axis=-1)
        part = (field.march_alone if level is field else wider.march)(o, direction[going], limit, widths)
        samples += part.samples
        through = seen.through[going]
        seen.radiance[going] += through * part.radiance
        seen.through[going] = through * part.through
        seen.full[going] *= part.full
        _add_depth(seen.depth, going, part.depth, field, level)
        on = (part.distance >= length - _SAME_M) & (stop[going] < last[going] - _SAME_M)
        ended = (part.distance >= 0) & ~on
        seen.distance[going[ended]] = first[ended] + part.distance[ended]
        seen.level[going] = part.level + (level is wider)
    return seen._replace(samples=samples)


def _add_depth(depth: F32, rays: NDArray[np.int64], part: F32, field: PackField, level: PackField) -> None:
    """Add the depths (n, ns) of the field's species."""
    assert field.medium is not None
    assert level.medium is not None
    names = [s.name for s in level.medium.species]
    for n, species in enumerate(field.medium.species):
        if species.name in names:
            depth[rays, n] += part[:, names.index(species.name)]


def shade_from(wider: PackField, medium: Medium, volume: Volume, depths: SunDepth, local_sun: F64) -> None:
    """Add to a grid's depths to the sun what sunbeams pass in a wider grid before they enter at its sides."""
    columns, lookup = _Sides.of(medium, wider, local_sun), wider.medium
    assert wider.depths is not None
    assert lookup is not None
    inner, outer = [], []
    channels, wider_channels = (np.moveaxis(inside(d.depth), 0, -1) for d in (depths, wider.depths))
    for own, theirs, first, second in (
        (depths.lanes, wider.depths.lanes, channels, wider_channels),
        (volume.forward_channel, wider.volume.forward_channel, volume.fields, wider.volume.fields),
    ):
        for channel in np.unique(own):
            w = int(np.flatnonzero(own == channel)[0])
            inner.append(first[..., channel])
            outer.append(second[..., theirs[w]])
    tables = [np.stack([np.moveaxis(bilinear(o, ix, iy), 0, -1) for o in outer]) for ix, iy in columns.places]
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
                    values[k][here] += extra.astype(np.float32)


class _Sides(NamedTuple):
    """Where the sunbeams of a grid's columns come in: ``side`` (ny, nx), 0 to 3, how far ``along`` it in nodes, and the
    ``way_m`` from there; fractional indices in the wider grid of the ``places`` along each side."""

    side: NDArray[np.int64]
    along: F64
    way_m: F64
    places: list[tuple[F64, F64]]

    @classmethod
    def of(cls, medium: Medium, wider: PackField, local_sun: F64) -> _Sides:
        _, ny, nx = medium.shape
        j, i = np.mgrid[0:ny, 0:nx].astype(float)
        vx, vy = (local_sun[..., n] / medium.cell_m[n] for n in (0, 1))  # cells per metre
        to_x = np.where(vx > 0, nx - 1 - i, i) / np.maximum(np.abs(vx), 1e-12)
        to_y = np.where(vy > 0, ny - 1 - j, j) / np.maximum(np.abs(vy), 1e-12)
        way = np.minimum(to_x, to_y)
        side = np.where(to_x < to_y, np.where(vx > 0, 1, 0), np.where(vy > 0, 3, 2))
        along = np.where(to_x < to_y, j + vy * way, i + vx * way)
        grid, theirs = wider.scene.grid, wider.medium
        assert grid is not None
        assert theirs is not None
        p = medium.place
        places = []
        for edge in (p[:, 0], p[:, -1], p[0], p[-1]):
            lat, lon, _ = medium.frame.latlon(edge)
            ix, iy = grid.index(lon, lat)
            places.append((ix * theirs.fineness, iy * theirs.fineness))
        return cls(side, along, way, places)
