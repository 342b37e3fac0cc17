"""H about a state: its value, J v, J^T r, rows of J, and the tests that show that they belong together."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import check_kind, numbers, shown, whole
from openswim.assimilation.observing.checking import Check, check
from openswim.assimilation.observing.core import Images
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Linearization:
    """Made by `Operator.linearize`. Datasets of changes are like states; rows are like ``value``.

    state: about which it is, nowhere below the least that may be. One that has been changed in place since is an error.
    """

    operator: Rows
    state: xr.Dataset
    images: Images
    slopes: dict[str, F64]
    _given: xr.Dataset = field(repr=False)
    _was: tuple[bytes, ...] = field(repr=False)
    _light: Any = field(repr=False)  # what the core keeps of it

    @classmethod
    def about(cls, operator: Rows, state: xr.Dataset, near: Linearization | None = None) -> Linearization:
        """See `Operator.linearize`."""
        lifted = operator.controls.lifted(state)
        start = None if near is None else near._light
        images, light = operator.light(operator.controls.fill(lifted), start)
        slopes = operator.controls.slopes(lifted)
        return cls(operator, lifted, images, slopes, state, _mark(state, operator), light)

    @property
    def _scale(self) -> F64 | None:
        return self.operator.scale(self.state)

    @cached_property
    def value(self) -> xr.DataArray:
        """H(x), a row of observations."""
        return self.operator.row(self.operator.values(self.images, self._scale))

    def jvp(self, change: xr.Dataset, loosely: float = 1.0) -> xr.DataArray:
        """J v: what a change of the state changes, to first order. Controls that are left out do not change. loosely:
        times the tolerance of the light, to which that of the change is solved."""
        self._check_fresh()
        op = self.operator
        fill = op.controls.tangent(self.slopes, self._whole(change))
        images = op.light_tangent(self._light, fill, loosely)
        return op.row(op.tangent_values(self.images, images, self._scale, fill.scale))

    def vjp(self, bar: ArrayLike, loosely: float = 1.0) -> xr.Dataset:
        """J^T r: the gradient by the state of r . H(x)."""
        self._check_fresh()
        op = self.operator
        row = op.row(numbers("vjp: bar", bar)).values
        if not np.isfinite(row).all():
            raise UserError("vjp: bar has values that are no numbers: put 0 where an observation is not used")
        images, scale = op.adjoint_values(self.images, row, self._scale)
        fill = op.light_adjoint(self._light, images, loosely)
        return op.controls.adjoint(self.slopes, replace(fill, scale=scale))

    def jacobian(self, pixels: Iterable[int]) -> xr.Dataset:
        """Rows of J of some observations (numbers in the row of all), by an adjoint each: for a look, not for use."""
        check_kind("jacobian: pixels", pixels, Iterable, "name some observations by their numbers")
        size = self.operator.size
        asked = [whole("jacobian: an observation", n) for n in pixels]
        if not asked:
            raise UserError("jacobian: name some observations by their numbers")
        for n in asked:
            if not -size <= n < size:
                raise UserError(f"jacobian: there is no observation {n}: they are numbered from 0 to {size - 1}")
        return xr.concat([self.vjp(np.eye(1, size, n % size)[0]) for n in asked], "observation")

    def check(self, seed: int = 0) -> Check:
        """Four tests of OOPS: zero gives zero, linearity, the adjoint's dot product, and the tangent linear against
        differences of ever smaller steps."""
        return check(self, seed)

    def as_linear_operator(self) -> Any:
        """J as a SciPy `LinearOperator`, float64, which SciPy's solvers (lsqr, cg) and PyLops take as it is; columns
        are the controls in their order, each raveled (`Operator.packed`)."""
        from scipy.sparse.linalg import LinearOperator

        op = self.operator
        return LinearOperator(
            (op.size, op.packed(self.state).size), dtype=np.float64,
            matvec=lambda v: self.jvp(op.unpacked(np.ravel(v))).values,
            rmatvec=lambda r: op.packed(self.vjp(np.ravel(r))),
        )  # fmt: skip

    def _whole(self, change: xr.Dataset) -> xr.Dataset:
        check_kind("change", change, xr.Dataset, "give an xarray.Dataset like a state")
        names = [v.name for v in self.operator.controls.variables]
        for name in change:
            if name not in names:
                raise UserError(f"change: {shown(name)} is no control: those of this operator are {', '.join(names)}")
        return self.operator.controls.checked(change, "change", left_out=0.0)

    def _check_fresh(self) -> None:
        if _mark(self._given, self.operator) != self._was:
            raise UserError("the state was changed in place since linearize: linearize again, or change a copy")


def _mark(state: xr.Dataset, operator: Rows) -> tuple[bytes, ...]:
    names = [v.name for v in operator.controls.variables]
    return tuple(hashlib.blake2b(state[n].values.tobytes(), digest_size=16).digest() for n in names)
