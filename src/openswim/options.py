"""What may be asked of a solver, checked (docs/solvers.md)."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from openswim.arguments import number, shown, whole
from openswim.errors import UserError

NAMES = ("swim", "fast", "linear", "reference")


class Quality(NamedTuple):
    """How finely `fast` solves: settings of the same kernels.

    ordinates: of Lebedev's rule, or about as many of another; tolerance: see `Options`.

    divide: columns that are thick across (`plan_medium`). halved: sweep and see half columns.
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


@dataclass(frozen=True)
class Options:
    """How light is solved for.

    name: "fast" (sweeps, the default), "swim" (Albers et al. 2020), "linear" (fast's light as a linear
    fixed point, which has derivatives; docs/linear.md) or "reference" (Monte Carlo).
    step: eye-ray step in cells.
    detail: whether near eyes see more than is known: with "fast" in clouds of a model's liquid water below its grid
    (docs/decisions/0017; what a scene has as extinction never is refined), with "fast" and "swim" on land below its
    maps (docs/decisions/0020).

    Of "fast" alone: quality, "preview", "standard" or "high" (docs/solvers.md); tolerance, instead of that of the
    quality: sweeps end when one of them changes the field by less than this share, or when all that are to come seem to
    change it by less than 1.6 times as much. The standard's .02 leaves fluxes about 1 % off and, where cells are thick
    (optical depth 3), images up to 5 % (RMSE).

    Of "reference" alone: paths per ray (default 256); target_error: mean standard error over mean radiance, and
    seconds of CPU time per view, at which to stop sooner; seed of all chances; checkpoint: file to stop and go on with.
    """

    name: str = "fast"
    quality: str = "standard"
    tolerance: float | None = None
    step: float = 1.0
    most_sweeps: int = 60
    detail: bool = True
    paper_phases: bool = False
    paths: int | None = None
    seed: int = 0
    target_error: float | None = None
    seconds: float | None = None
    checkpoint: str | os.PathLike[str] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or self.name not in NAMES:
            raise UserError(f"unknown solver {shown(self.name)}: choose one of {', '.join(NAMES)}")
        for check, options in ((number, ("step", "tolerance", "target_error", "seconds")),
                               (whole, ("most_sweeps", "seed", "paths"))):  # fmt: skip
            for option in options:
                if getattr(self, option) is not None or getattr(type(self), option) is not None:
                    check(option, getattr(self, option))
        given = [self.paths, self.target_error, self.seconds, self.checkpoint]
        if self.name != "reference" and (self.seed or any(option is not None for option in given)):
            raise UserError("paths, seed, target_error, seconds and checkpoint belong to solver 'reference'")
        if not isinstance(self.quality, str) or self.quality not in SETTINGS:
            raise UserError(f"unknown quality {shown(self.quality)}: choose one of {', '.join(SETTINGS)}")
        if self.quality != "standard" and self.name != "fast":
            raise UserError(f"quality belongs to solver 'fast'; leave it out with {shown(self.name)}")
        if not 0 < self.step < np.inf:
            raise UserError(f"step = {self.step:g}: give a positive number of cells, such as 1")
        if self.tolerance is not None and not 0 < self.tolerance < np.inf:
            raise UserError(f"tolerance = {self.tolerance:g}: give a positive share of the light, such as 0.02")
        if self.most_sweeps < 1:
            raise UserError(f"most_sweeps = {self.most_sweeps}: give at least 1")
        if self.seconds is not None and not self.seconds > 0:
            raise UserError(f"seconds = {self.seconds:g}: give a positive time")
        if self.paths is not None and self.paths < 2:
            raise UserError(f"paths = {self.paths}: give at least 2 per pixel, or there is no error to tell")
        if self.target_error is not None and not 0 < self.target_error < 1:
            raise UserError(f"target_error = {self.target_error:g}: give a share of the radiance, such as 0.01")
        if not 0 <= self.seed < 2**31:
            raise UserError(f"seed = {self.seed}: give a whole number from 0 to 2147483647")

    @property
    def setting(self) -> Quality:
        """What the quality stands for, with the tolerance that was asked for."""
        setting = SETTINGS[self.quality]
        return setting if self.tolerance is None else setting._replace(tolerance=self.tolerance)
