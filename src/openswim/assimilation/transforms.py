"""From what a minimisation changes without bounds to what a cloud may be: a value, its slope, and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import check_choice, shown
from openswim.errors import UserError

F64 = NDArray[np.float64]

OF_LEVELS = ("softplus", "sqrt", "log")  # that make nothing below the floor
NAMES = (*OF_LEVELS, "linear")


def check_transform(name: str) -> None:
    """Raise UserError unless fields on levels can be transformed by it."""
    check_choice("transform", name, OF_LEVELS)


@dataclass(frozen=True, eq=False)
class Transform:
    """value = floor + unit t(x): t is ln(1 + e^x) of "softplus", x^2 of "sqrt", e^x of "log", x of "linear".

    least: of what stands above the floor in a first guess, in units. A root has no slope at nothing, and a logarithm
    makes no cloud out of it in a few steps; a softplus is a line in cloud, and makes some where there is none.
    """

    name: str
    floor: F64 | float
    unit: F64 | float
    least: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise UserError(f"transform {shown(self.name)} is unknown: choose one of {', '.join(NAMES)}")

    def value(self, x: F64) -> F64:
        made = {"softplus": lambda: np.logaddexp(0.0, x), "sqrt": lambda: x**2, "log": lambda: np.exp(x),
                "linear": lambda: x}[self.name]()  # fmt: skip
        return self.floor + self.unit * made

    def slope(self, x: F64) -> F64:
        made = {"softplus": lambda: 0.5 * (1 + np.tanh(0.5 * x)), "sqrt": lambda: 2 * x, "log": lambda: np.exp(x),
                "linear": lambda: np.ones_like(x)}[self.name]()  # fmt: skip
        return self.unit * made

    def back(self, value: F64) -> F64:
        above = (value - self.floor) / self.unit
        if self.name == "linear":
            return above
        above = np.maximum(above, max(self.least, 1e-12))
        if self.name == "softplus":
            return above + np.log(-np.expm1(-above))
        return np.sqrt(above) if self.name == "sqrt" else np.log(above)
