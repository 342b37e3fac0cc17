"""How finely `fast` solves: named settings of the same kernels (transport.md section 1)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse import WHOLE, Solution, Sweeper, Trace, coarse_to_fine
from openswim.transport.moments import Moments

F32 = NDArray[np.float32]


class Quality(NamedTuple):
    """ordinates: of Lebedev's rule, or about as many of another; tolerance: see `Solver`.

    coarse: sweep 2x2 columns as one, however fine the picture. halved: sweep and see half columns (`halved_medium`).
    """

    ordinates: int
    tolerance: float
    coarse: bool = False
    halved: bool = False


SETTINGS = {
    "preview": Quality(50, 0.1, coarse=True),
    "standard": Quality(50, 0.02),
    "high": Quality(110, 0.01, halved=True),
}


def solve_coarse(fine: Sweeper, tolerance: float, most: int, like: list[Trace] | None = None) -> Solution:
    """Sweep the 2x2-coarse grid alone: what the full one scatters is lit by its light. Periodic grids have none."""
    if fine.grid.periodic:
        return coarse_to_fine(fine, tolerance, most, like)
    base = fine.coarsened()
    below = coarse_to_fine(base, tolerance, most, like, WHOLE)
    level = fine.over(base.as_coarser(below.moments.values), np.zeros(fine.place.shape, bool))
    shape = fine.grid.ground_node.shape
    fine.down_flux, fine.up_flux = (_finer(flux, shape) for flux in (base.down_flux, base.up_flux))
    return below._replace(moments=Moments(level.place, level.nothing()), coarser=level.coarser)


def _finer(flux: F32, shape: tuple[int, ...]) -> F32:
    """A field on 2x2-coarse columns, bilinearly at the columns (ny, nx)."""
    for axis, count in enumerate(shape):
        at = np.clip((np.arange(count) - 0.5) / 2, 0, flux.shape[axis] - 1)
        low = np.minimum(at.astype(int), max(flux.shape[axis] - 2, 0))
        high = np.minimum(low + 1, flux.shape[axis] - 1)
        share = np.expand_dims(at - low, 1 - axis).astype(np.float32)
        flux = flux.take(low, axis) * (1 - share) + flux.take(high, axis) * share
    return np.ascontiguousarray(flux, np.float32)
