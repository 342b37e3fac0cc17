"""How finely `fast` solves: named settings of the same kernels (transport.md section 1)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from openswim.transport.diffuse import WHOLE, Solution, Sweeper, Trace, coarse_to_fine
from openswim.transport.moments import Moments
from openswim.transport.optical_grid import twice_as_fine_plane


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
    level = fine.over(base.as_coarser(below), np.zeros(fine.place.shape, bool))
    fluxes = twice_as_fine_plane(below.fluxes, fine.grid.ground_node.shape)
    nothing = Moments(level.place, level.nothing())
    return below._replace(moments=nothing, coarser=level.coarser, fluxes=fluxes, ratio=None)
