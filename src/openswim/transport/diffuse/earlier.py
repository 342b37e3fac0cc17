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
from numba import njit
from numpy.typing import NDArray

from openswim.transport.diffuse.optical_grid import total_extinction
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.diffuse.sweeper import DARK, Sweeper
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]

_UNLIKE = FLOAT(2.0)  # times a difference of extinction, in shares of it, from which a node begins as if by itself
_FARTHEST = 4  # part of a grid's width over which clouds are looked for
_LEAST_RATIO, _MOST_RATIO = FLOAT(0.2), FLOAT(5.0)  # of light now to that of then
_DARK = FLOAT(DARK)


class GridBefore(NamedTuple):
    """What a grid added to the coarser one: see `Trace`. extinction (nz, ny, columns): of all that scatters, 1/m."""

    place: NDArray[np.int32]
    extinction: F32
    start: F32
    defect: F32


@dataclass
class Before:
    """Of one solve: its grids by their shape (ny, nx), the moments of its coarsest one by wavelength, and the optical
    depth (ny, nx) of its columns."""

    depth: F32 | None = None
    grids: dict[tuple[int, int], GridBefore] = field(default_factory=dict)
    coarsest: dict[int, F32] = field(default_factory=dict)


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
        self._shape, self._moved = shape, (0, 0)

    def place(self, grid: Sweeper) -> None:
        """Tell how far clouds have moved, from the finest grid."""
        nx = self._shape[1]
        self.left.depth = np.trapezoid(total_extinction(grid.grid)[..., :nx], grid.grid.levels_m, axis=0).astype(FLOAT)
        if self.before.depth is not None and self.before.depth.shape == self._shape:
            self._moved = displacement(self.before.depth, self.left.depth)

    def coarsest(self, grid: Sweeper, wavelength: int) -> F32:
        """Moments for the coarsest grid to begin from."""
        known = self.before.coarsest.get(wavelength)
        return grid.nothing() if known is None or known.shape != grid.shape else known.copy()

    def leave_coarsest(self, wavelength: int, values: F32) -> None:
        self.left.coarsest[wavelength] = values.copy()

    def add(self, level: Sweeper, first: F32) -> None:
        """Add to the ``first`` moments, which a coarser grid has told, what that left out then."""
        shape: tuple[int, int] = level.grid.ground_node.shape
        known = self.before.grids.get(shape)
        if known is None or known.place.shape != level.place.shape:
            return
        dy, dx = (round(moved * n / whole) for moved, n, whole in zip(self._moved, shape, self._shape, strict=True))
        in_threads(
            carry, level.place, total_extinction(level.grid), shape[1], level.grid.periodic, dy, dx, *known, first
        )

    def leave(self, level: Sweeper, start: F32, defect: F32) -> None:
        shape: tuple[int, int] = level.grid.ground_node.shape
        self.left.grids[shape] = GridBefore(level.place, total_extinction(level.grid), start, defect)


def displacement(before: F32, after: F32) -> tuple[int, int]:
    """How far (rows, columns) what is in one field has moved in another, by the greatest of their correlations."""
    ny, nx = before.shape
    field = np.log1p(np.stack([before, after]).astype(float))
    field -= field.mean(axis=(1, 2), keepdims=True)
    one, other = np.fft.rfft2(field, (2 * ny, 2 * nx))
    product = np.fft.irfft2(np.conj(one) * other, (2 * ny, 2 * nx))
    far = ny // _FARTHEST, nx // _FARTHEST
    near = np.roll(product, far, (0, 1))[: 2 * far[0] + 1, : 2 * far[1] + 1]
    dy, dx = np.unravel_index(int(np.argmax(near)), near.shape)
    if near[dy, dx] <= near[far] + 1e-6 * field.size:  # where nothing tells
        return 0, 0
    return int(dy) - far[0], int(dx) - far[1]


@njit(cache=True, error_model="numpy", nogil=True)
def carry(
    t, threads, place, extinction, nx, periodic, dy, dx, place_then, extinction_then, start_then, defect_then, first
):
    """Add the defects of then to the ``first`` moments (blocks, n, BLOCK), from the nodes where their cloud was,
    ``dy`` rows and ``dx`` columns before."""
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
                then, lane = place_then[k, y, x // BLOCK], x % BLOCK
                if then < 0:
                    continue
                now, was = extinction[k, j, b * BLOCK + i], extinction_then[k, y, x]
                more = max(now, was)
                share = FLOAT(1.0) - _UNLIKE * abs(now - was) / more if more > FLOAT(0.0) else FLOAT(1.0)
                if share <= FLOAT(0.0):
                    continue
                grown = first[at, 0, i] / max(start_then[then, 0, lane], _DARK)
                share *= min(max(grown, _LEAST_RATIO), _MOST_RATIO)
                for c in range(defect_then.shape[1]):
                    first[at, c, i] += share * defect_then[then, c, lane]
