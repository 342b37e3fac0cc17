"""The four tests of OOPS (JEDI) of a linearisation: they say by numbers whether J and J^T are those of H."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

STEPS = (1.0, 0.1, 0.01)
_SIZE = 0.05  # of a field's value: the largest change


@dataclass(frozen=True)
class Check:
    """zero: the largest number that J 0 and J^T 0 hold. linear: |J(2u + 3v) - 2Ju - 3Jv| over the sum of the sizes of
    the three. dot: |<Ju, r> - <u, J^T r>| over the sum of absolute products. remainder: |H(x + hu) - H(x) - h Ju| over
    |h Ju| at steps of 1, .1 and .01: it falls as h, until the light's own tolerance shows."""

    zero: float
    linear: float
    dot: float
    remainder: tuple[float, ...]

    def passed(self, tolerance: float = 1e-8, remainder: float = 1e-3) -> bool:
        """tolerance: of linearity and the dot product, a few times that of the light. remainder: of the last step."""
        return self.zero == 0.0 and max(self.linear, self.dot) <= tolerance and self.remainder[-1] <= remainder

    def __str__(self) -> str:
        steps = ", ".join(f"{value:.1e}" for value in self.remainder)
        return f"zero {self.zero:g}, linearity {self.linear:.1e}, dot product {self.dot:.1e}, remainder {steps}"


def check(lin: Any, seed: int) -> Check:
    """See `Linearization.check`. Changes go up from the state, so that no clamp is met on the way."""
    rng = np.random.default_rng(seed)
    u, v = (_change(lin.state, rng) for _ in range(2))
    nothing = 0.0 * u
    back = lin.vjp(0 * lin.value)
    zero = max(float(np.abs(each).max()) for each in (lin.jvp(nothing), *back.values()))
    ju, jv, both = lin.jvp(u).values, lin.jvp(v).values, lin.jvp(2 * u + 3 * v).values
    sizes = np.linalg.norm(both) + 2 * np.linalg.norm(ju) + 3 * np.linalg.norm(jv)
    linear = float(np.linalg.norm(both - 2 * ju - 3 * jv)) / max(float(sizes), 1e-300)
    spread = np.abs(ju).mean()
    residual = rng.standard_normal(ju.size) / np.maximum(np.abs(ju), 0.1 * spread)  # so that no instrument rules
    back = lin.vjp(residual)
    right = sum(float((u[name] * back[name]).sum()) for name in u)
    size = float(np.abs(ju) @ np.abs(residual))
    dot = abs(float(ju @ residual) - right) / max(size, 1e-300)
    remainder = []
    for step in STEPS:
        change = lin.operator(lin.state + step * u).values - lin.value.values
        remainder.append(float(np.linalg.norm(change - step * ju) / np.linalg.norm(step * ju)))
    return Check(zero, linear, dot, tuple(remainder))


def _change(state: xr.Dataset, rng: np.random.Generator) -> xr.Dataset:
    """A random change of all fields, of up to a twentieth of their values."""
    out = {}
    for name, field in state.items():
        out[name] = field.copy(data=_SIZE * np.abs(field.values) * rng.random(field.shape))
    return state.assign(out)
