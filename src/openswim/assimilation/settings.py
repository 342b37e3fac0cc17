"""How an analysis is looked for: what `analyse` is told beside observations and background, checked at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from openswim.arguments import check_choice, whole
from openswim.assimilation.departures import checked_solver
from openswim.assimilation.transforms import check_transform
from openswim.errors import UserError
from openswim.solver import Solver

METHODS = ("lbfgs", "gauss-newton")


@dataclass(frozen=True)
class Settings:
    """Arguments of `analyse` of these names; raises UserError where one is none."""

    transform: str = "softplus"
    outer: int | None = None
    iterations: int = 60
    method: str = "lbfgs"
    departures: str | Solver = "linear"
    signal: int = 0

    def __post_init__(self) -> None:
        check_transform(self.transform)
        check_choice("analyse: method", self.method, METHODS)
        if self.loops < 1 or whole("analyse: iterations", self.iterations) < 1:
            raise UserError("analyse: outer and iterations must be 1 or more")
        if whole("analyse: signal", self.signal) < 0:
            raise UserError("analyse: signal must be 0 or a number of probes, such as 2")

    @cached_property
    def solver(self) -> Solver | None:
        """Of the departures; None for the linear core itself."""
        return checked_solver(self.departures)

    @property
    def loops(self) -> int:
        """Outer ones."""
        solver = self.solver
        if self.outer is not None:
            return whole("analyse: outer", self.outer)
        return 1 if solver is None and self.method == "lbfgs" else 3
