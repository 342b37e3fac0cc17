"""How finely `fast` solves: named settings of the same kernels (docs/solvers.md)."""

from __future__ import annotations

from typing import NamedTuple


class Quality(NamedTuple):
    """ordinates: of Lebedev's rule, or about as many of another; tolerance: see `Solver`.

    tall: layers as tall as two columns are wide. halved: sweep and see half columns (`halved_medium`).
    """

    ordinates: int
    tolerance: float
    tall: bool = False
    halved: bool = False


SETTINGS = {
    "preview": Quality(50, 0.1, tall=True),
    "standard": Quality(50, 0.02),
    "high": Quality(110, 0.01, halved=True),
}
