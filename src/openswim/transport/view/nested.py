"""A grid that lies in a wider, coarser one: every ray sees each part of its way in the finest that covers it.

Light is solved on every grid by itself, the wider first, with the same frame, sun and eye. A ray goes through the wider
grid up to the inner one's core, through the core, and on through the wider: L = L1 + T1 (L2 + T2 L3). The core ends
within the inner grid, since what enters at its sides is only as good as the wider grid's light (`sides.py`). Air beside
grids is in each of them, and no part of a way is walked twice. docs/decisions/0014-nested-grids.md.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.march.march import DARK
from openswim.transport.march.volume import FAR_M
from openswim.transport.view.seen import Seen

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SHORTEST_M = 1.0  # way through a grid that is worth a look
_SAME_M = 0.01  # distances that differ by less are the same


class Aimed(Protocol):
    """A lit grid with its sources toward an eye, and those around it."""

    @property
    def lit(self) -> LitGrid: ...

    @property
    def wider(self) -> Aimed | None: ...

    def march(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """What rays see of all grids."""
        ...

    def march_alone(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """What rays see of this grid, and of the air beside it."""
        ...


def march(own: Aimed, wider: Aimed, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
    """What rays (n, 3) see of a grid and of the wider ones around it; ``ends``, ``cone`` as `march_rays` has them."""
    core = own.lit.core
    assert core is not None
    n = len(direction)
    ends = np.full(n, -FAR_M) if ends is None else ends
    last = np.abs(ends)
    enter, leave = core.crossed(origin, direction, own.lit.shells.top_m)
    seen = Seen.nothing(n, max(own.lit.volume.species, 1))
    samples = 0
    for level, start, stop in ((wider, np.zeros(n), enter), (own, enter, leave), (wider, leave, np.full(n, FAR_M))):
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
        part = (own.march_alone if level is own else wider.march)(o, direction[going], limit, widths)
        samples += part.samples
        through = seen.through[going]
        seen.radiance[going] += through * part.radiance
        seen.through[going] = through * part.through
        seen.full[going] *= part.full
        _add_depth(seen.depth, going, part.depth, own.lit, level.lit)
        on = (part.distance >= length - _SAME_M) & (stop[going] < last[going] - _SAME_M)
        ended = (part.distance >= 0) & ~on
        seen.distance[going[ended]] = first[ended] + part.distance[ended]
        seen.level[going] = part.level + (level is wider)
    return seen._replace(samples=samples)


def _add_depth(depth: F32, rays: NDArray[np.int64], part: F32, own: LitGrid, level: LitGrid) -> None:
    """Add the depths (n, ns) of the innermost grid's species."""
    assert own.medium is not None
    assert level.medium is not None
    names = [s.name for s in level.medium.species]
    for n, species in enumerate(own.medium.species):
        if species.name in names:
            depth[rays, n] += part[:, names.index(species.name)]
