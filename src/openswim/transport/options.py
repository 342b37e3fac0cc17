"""How finely `fast` solves: named settings of the same kernels (docs/solvers.md)."""

from __future__ import annotations

from typing import NamedTuple


class Quality(NamedTuple):
    """ordinates: of Lebedev's rule, or about as many of another; tolerance: see `Solver`.

    divide: columns that are thick across (`build_medium`). halved: sweep and see half columns (`halved_medium`).
    """

    ordinates: int
    tolerance: float
    divide: bool = True
    halved: bool = False


SETTINGS = {
    "preview": Quality(50, 0.1, divide=False),
    "standard": Quality(50, 0.02),
    "high": Quality(110, 0.01, halved=True),
}
