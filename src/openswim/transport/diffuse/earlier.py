"""Where a solve begins if a like scene has been solved before, as in films: with what each grid added to the coarser
one then, moved as the clouds have moved.

A defect (`multigrid.Trace`) goes with the cloud that made it, and counts at a node as far as its extinction is what it
was there; the coarsest grid begins from its own light of then. What slow modes have to say is told by the coarse grids
of now, so that no error is handed on from time to time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.optical_grid import total_extinction
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.diffuse.sweeper import DARK, Sweeper
from openswim.transport.engine.compiled import kernel
from openswim.transport.engine.drift import drift_of
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_UNLIKE = FLOAT(2.0)  # times a difference of extinction, in shares of it, from which a node begins as if by itself
LEAST_RATIO, MOST_RATIO = FLOAT(0.2), FLOAT(5.0)  # of light now to that of then
_DARK = FLOAT(DARK)


class GridBefore(NamedTuple):
    """What a grid added to the coarser one: see `Trace`. extinction (nz, ny, columns): of all that scatters, 1/m."""

    levels_m: F64
    place: NDArray[np.int32]
    extinction: F32
    start: F32
    defect: F32


class CoarsestBefore(NamedTuple):
    """The moments of the coarsest grid."""

    levels_m: F64
    place: NDArray[np.int32]
    values: F32


@dataclass
class Before:
    """Of one solve: its grids by their shape (ny, nx), the coarsest one by wavelength, and the optical depth (ny, nx)
    of its columns."""

    depth: F32 | None = None
    grids: dict[tuple[int, int], GridBefore] = field(default_factory=dict)
    coarsest: dict[int, CoarsestBefore] = field(default_factory=dict)


@dataclass
class EarlierLight:
    """What the last solve has left for the next one; handed to one after the other, each begins nearer to its end. The
    light is the same within the solver's tolerance, not bit for bit."""

    solved: dict[str, Before] = field(default_factory=dict, repr=False)

    def begin(self, name: str, shape: tuple[int, int]) -> Start:
        """Where a solve of this name begins, on a grid of (ny, nx)."""
        before = self.solved.get(name)
        return Start(Before() if before is None else before, shape)

    def keep(self, name: str, start: Start) -> None:
        """What a solve has left."""
        self.solved[name] = start.left


class Start:
    """Where the grids of one solve begin, and what they leave for the next."""

    def __init__(self, before: Before, shape: tuple[int, int]) -> None:
        self.before, self.left = before, Before()
        self._shape, self._moved = shape, (0.0, 0.0)

    def compare(self, finest: Sweeper) -> None:
        """Find how far clouds have moved, by the finest grid."""
        grid = finest.grid
        self.left.depth = np.trapezoid(total_extinction(grid)[..., : self._shape[1]], grid.levels_m, axis=0)
        then = self.before.depth
        if then is not None and then.shape == self._shape:
            dx, dy = drift_of(then[None], self.left.depth[None], grid.periodic)[0]
            self._moved = dy, dx

    def coarsest(self, grid: Sweeper, wavelength: int) -> F32:
        """Moments for the coarsest grid to begin from: its own of then, at the nearest levels."""
        values = grid.nothing()
        known = self.before.coarsest.get(wavelength)
        if known is not None and known.place.shape[1:] == grid.place.shape[1:]:
            then = known.place[_nearest(grid.grid.levels_m, known.levels_m)]
            both = (grid.place >= 0) & (then >= 0)
            values[grid.place[both]] = known.values[then[both]]
        return values

    def leave_coarsest(self, grid: Sweeper, wavelength: int, values: F32) -> None:
        self.left.coarsest[wavelength] = CoarsestBefore(grid.grid.levels_m, grid.place, values.copy())

    def add_defects(self, level: Sweeper, first: F32) -> None:
        """Add to the ``first`` moments, which a coarser grid has told, what that left out then."""
        shape: tuple[int, int] = level.grid.ground_node.shape
        known = self.before.grids.get(shape)
        if known is None or known.place.shape[1:] != level.place.shape[1:]:
            return
        dy, dx = (round(moved * n / whole) for moved, n, whole in zip(self._moved, shape, self._shape, strict=True))
        levels_m, *then = known
        in_threads(
            carry, level.place, total_extinction(level.grid), shape[1], level.grid.periodic, dy, dx,
            _nearest(level.grid.levels_m, levels_m), *then, first,
        )  # fmt: skip

    def leave(self, level: Sweeper, start: F32, defect: F32) -> None:
        grid = level.grid
        shape: tuple[int, int] = grid.ground_node.shape
        self.left.grids[shape] = GridBefore(grid.levels_m, level.place, total_extinction(grid), start, defect)


def _nearest(levels_m: F64, then_m: F64) -> NDArray[np.int64]:
    """Which level of then is nearest to each: clouds decide how finely levels are divided."""
    return np.abs(np.subtract.outer(levels_m, then_m)).argmin(axis=1)


@kernel()
def carry(
    t, threads, place, extinction, nx, periodic, dy, dx, level_then, place_then, extinction_then, start_then,
    defect_then, first,
):  # fmt: skip
    """Add the defects of then to the ``first`` moments (blocks, n, BLOCK), from the nodes where their cloud was,
    ``dy`` rows and ``dx`` columns before, at the levels ``level_then`` (nz,)."""
    nz, ny, nb = place.shape
    for row in range(t * nz * ny // threads, (t + 1) * nz * ny // threads):
        k, j = row // ny, row % ny
        y = (j - dy) % ny if periodic else j - dy
        if y < 0 or y >= ny:
            continue
        for b in range(nb):
            at = place[k, j, b]
            if at < 0:
                continue
            for i in range(min(BLOCK, nx - b * BLOCK)):
                x = b * BLOCK + i - dx
                x = x % nx if periodic else x
                if x < 0 or x >= nx:
                    continue
                then, lane = place_then[level_then[k], y, x // BLOCK], x % BLOCK
                if then < 0:
                    continue
                now, was = extinction[k, j, b * BLOCK + i], extinction_then[level_then[k], y, x]
                more = max(now, was)
                share = FLOAT(1.0) - _UNLIKE * abs(now - was) / more if more > FLOAT(0.0) else FLOAT(1.0)
                if share <= FLOAT(0.0):
                    continue
                grown = first[at, 0, i] / max(start_then[then, 0, lane], _DARK)
                share *= min(max(grown, LEAST_RATIO), MOST_RATIO)
                for c in range(defect_then.shape[1]):
                    first[at, c, i] += share * defect_then[then, c, lane]
