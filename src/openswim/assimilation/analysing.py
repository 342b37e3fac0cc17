"""`analyse`: the state that fits what was seen, and what was believed before, best."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import check_kind, takes
from openswim.assimilation.background import Background, Space
from openswim.assimilation.checkpoint import Checkpoint
from openswim.assimilation.cost import Cost
from openswim.assimilation.departures import seen_by
from openswim.assimilation.minimising import Spectrum, gauss_newton, lbfgs
from openswim.assimilation.observing.observations import check_observed
from openswim.assimilation.observing.operator import Operator
from openswim.assimilation.report import write_report
from openswim.assimilation.result import Found
from openswim.assimilation.settings import Settings
from openswim.assimilation.signal import signal as signal_of
from openswim.progress import job
from openswim.solver import Solver
from openswim.system.interrupts import claim

F64 = NDArray[np.float64]


class Analysis(Found):
    """A state that fits, what was seen before and after, and how it was found: see `Found`."""

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write a page: costs, pictures before and after, what was changed."""
        write_report(self, path)


@takes
def analyse(
    op: Operator,
    observed: xr.Dataset,
    first: xr.Dataset | None = None,
    background: Background | None = None,
    transform: str = "softplus",
    outer: int | None = None,
    iterations: int = 60,
    method: str = "lbfgs",
    departures: str | Solver = "linear",
    checkpoint: str | os.PathLike[str] | None = None,
    told: Callable[[int, float], None] | None = None,
    signal: int = 0,
) -> Analysis:
    """Minimise v.v/2 + sum ((y - H(x(v)))/error)^2/2.

    observed : what `Operator.observations` makes. first : a state (default: the scene's own, `Operator.first`).
    background : `Background(length_m=...)`, needed. transform : of fields on levels, "softplus", "sqrt" or "log".
    iterations : of all outer loops together. method : "lbfgs", or "gauss-newton": conjugate gradients on a quadratic
        cost in each of the outer loops, with a preconditioner from the first one.
    departures : "linear", H is the linear core itself; "fast", "reference" or a `Solver`: in each of the ``outer``
        loops (default 3) it tells what is seen of the state so far, and the linear core only how that changes.
    checkpoint : a file (.npz) in which the way so far is kept; a Ctrl-C then returns what there is, and the same call
        with the same file goes on. told : called with the number of each iteration and its cost.
    signal : by so many probes, each as dear as two dozen iterations, it is found out how many numbers the observations
        tell of each control, and of its columns and heights: `Analysis.told`.
    """
    settings = Settings(transform, outer, iterations, method, departures, signal)
    cost, kept = prepared(op, observed, first, background, settings, checkpoint)
    solver, loops = settings.solver, settings.loops
    each = max(1, -(-iterations // loops))
    spectrum = Spectrum()
    with job("analysis", iterations) as meter:
        run = _Run(cost, kept, told, meter.advance)
        meter.advance(kept.done)
        try:
            run.begin(solver)
            while kept.loop < loops and kept.done < iterations:
                if solver is not None:
                    run.relinearise(solver)
                most = min((kept.loop + 1) * each, iterations) - kept.done
                if method == "lbfgs":
                    v = lbfgs(cost, kept.v, most, run.after)
                else:
                    v = gauss_newton(cost, kept.v, most, spectrum, run.after)
                    kept.done = min((kept.loop + 1) * each, iterations)
                kept.v, kept.loop = v, kept.loop + 1
                kept.save()
        except KeyboardInterrupt:
            if checkpoint is None or not run.before.size:  # nothing new has been found yet
                raise
            claim()
            kept.save()
            run.interrupted = True
        return run.result(solver, observed, signal)


def prepared(
    op: Operator, observed: xr.Dataset, first: xr.Dataset | None, background: Background | None, settings: Settings,
    checkpoint: str | os.PathLike[str] | None,
) -> tuple[Cost, Checkpoint]:  # fmt: skip
    """What an analysis begins with; all that can be wrong with it is found here, before any light is solved."""
    check_kind("background", background, Background, "give Background(length_m=...): how far errors are alike")
    assert background is not None
    check_observed(op, observed)
    guess = op.controls.lifted(op.first() if first is None else first, 1.0)
    space = Space(op, guess, background, settings.transform)
    way = (settings.method, settings.loops, settings.iterations, settings.solver)
    return Cost.of(op, space, observed), Checkpoint.of(checkpoint, space, observed, way)


class _Run:
    """The way of one analysis."""

    def __init__(
        self, cost: Cost, kept: Checkpoint, told: Callable[[int, float], None] | None, advance: Callable[[float], None]
    ) -> None:
        self.cost, self.kept, self.told, self.advance = cost, kept, told, advance
        self.interrupted = False
        self.before = np.empty(0)

    def begin(self, solver: Solver | None) -> None:
        """What is seen of the first guess."""
        nothing = np.zeros(self.cost.space.size)
        if solver is not None:
            self.before = seen_by(self.cost.rows, self.cost.space.state(nothing), solver)
        else:
            self.before = self.cost.linearized(nothing).value.values
        if not self.kept.costs:
            self.kept.costs.append(self.cost.misfit(self.before))

    def relinearise(self, solver: Solver) -> None:
        """The better model's view of the state so far goes before the linear one's."""
        at_start = not self.kept.v.any() and self.before.size
        better = self.before if at_start else seen_by(self.cost.rows, self.cost.space.state(self.kept.v), solver)
        self.cost.shift = better - self.cost.linearized(self.kept.v).value.values

    def after(self, v: F64, value: float) -> None:
        self.kept.v = np.array(v)
        self.kept.done += 1
        self.kept.costs.append(value)
        self.kept.save_now_and_then()
        self.advance(1)
        if self.told is not None:
            self.told(self.kept.done, value)

    def result(self, solver: Solver | None, observed: xr.Dataset, probes: int) -> Analysis:
        rows, state = self.cost.rows, self.cost.space.state(self.kept.v)
        if solver is None or self.interrupted:
            seen = self.cost.linearized(self.kept.v).value.values + self.cost.shift
        else:
            seen = seen_by(rows, state, solver)
        name = "linear" if solver is None else solver.name
        told = () if self.interrupted or not probes else tuple(signal_of(self.cost, self.kept.v, probes))
        return Analysis(
            rows, state, self.cost.space.first, observed, np.array(self.kept.costs), rows.row(self.before),
            rows.row(seen), name, self.interrupted, told,
        )  # fmt: skip
