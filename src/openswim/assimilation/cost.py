"""The cost of a state, J = v.v/2 + sum ((y - H(x(v)))/sigma)^2/2, its gradient, and its Gauss-Newton Hessian."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.assimilation.background import Space
from openswim.assimilation.observing.linearization import Linearization
from openswim.assimilation.observing.rows import Rows

F64 = NDArray[np.float64]

LOOSELY = 3.0  # times the light's tolerance: gradients solved so are within .2 degrees to a column depth of 44


def dot(a: F64, b: F64) -> float:
    """Sum of products, in one order whatever the threads."""
    return float(np.einsum("i,i->", a, b))


@dataclass(eq=False)
class Cost:
    """J of one analysis; keeps its last linearisation, from which the next one is begun.

    weight: 1/sigma, 0 of what is not used. shift: added to H(x), what a better model sees more than the linear one.
    """

    rows: Rows
    space: Space
    value: F64
    weight: F64
    shift: F64 | float = 0.0
    _last: Linearization | None = field(default=None, repr=False)
    _at: F64 = field(default_factory=lambda: np.empty(0), repr=False)  # the v of it

    @classmethod
    def of(cls, rows: Rows, space: Space, observed: xr.Dataset) -> Cost:
        use = observed["use"].values.astype(bool)
        weight = np.where(use, 1.0 / observed["error"].values, 0.0)
        return cls(rows, space, observed["value"].values.astype(float), weight)

    def linearized(self, v: F64) -> Linearization:
        """About a v; made once where it is asked for again, since light is solved for it."""
        if self._last is None or not np.array_equal(v, self._at):
            self._last = Linearization.about(self.rows, self.space.state(v), self._last)
            self._at = np.array(v)
        return self._last

    def misfit(self, seen: F64) -> float:
        """Half the sum of squared departures over their errors."""
        return 0.5 * float(np.sum((self.weight * (seen - self.value)) ** 2))

    def __call__(self, v: F64) -> tuple[float, F64]:
        """J and its gradient."""
        lin = self.linearized(v)
        departure = self.weight * (lin.value.values + self.shift - self.value)
        bars = lin.vjp(self.weight * departure, LOOSELY)
        return 0.5 * dot(v, v) + 0.5 * dot(departure, departure), v + self.space.adjoint(v, bars)

    def hessian(self, v: F64, change: F64) -> F64:
        """(1 + S^T J^T R^-1 J S) about v times a change."""
        lin = self.linearized(v)
        row = lin.jvp(self.space.tangent(v, change), LOOSELY).values
        return change + self.space.adjoint(v, lin.vjp(self.weight**2 * row, LOOSELY))
