"""A grid that lies in a wider, coarser one: every ray sees each part of its way in the finest that covers it.

Light is solved on every grid by itself, with the same frame, sun and eye. A ray goes through the wider grid up to the
inner one's core, through the core, and on through the wider: L = L1 + T1 (L2 + T2 L3). The core ends within the inner
grid, since what lies near a grid's sides is lit from beyond them by clear sky. Air beside grids is in each of them, and
no part of a way is walked twice. docs/decisions/0014-nested-grids.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.march import DARK
from openswim.transport.pack import PACK
from openswim.transport.volume import FAR_M

if TYPE_CHECKING:
    from openswim.transport.field import PackField
    from openswim.transport.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_RIM, _LEAST_RIM = 0.05, 2  # share of a grid's columns at each side that its core does without, and how many at least
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
        y, x = (min(max(_LEAST_RIM, round(_RIM * n)), (n - 2) // 2) for n in (ny, nx))
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


def march(field: PackField, origin: F64, direction: F64, ends: F64 | None) -> Seen:
    """What rays (n, 3) see of a field and of the wider ones around it; ``ends`` as `march_rays` has them."""
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
        part = (field.march_alone if level is field else wider.march)(o, direction[going], limit)
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
