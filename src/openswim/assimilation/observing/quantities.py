"""What is observed of light: radiance, its logarithm, reflectance, ratios of channels; each with its slope."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError

F64 = NDArray[np.float64]
Name = Literal["radiance", "log_radiance", "reflectance_factor", "ratio"]

NAMES = ("radiance", "log_radiance", "reflectance_factor", "ratio")
_LEAST = 1e-9  # L' that a logarithm is taken of


@dataclass(frozen=True, eq=False)
class Quantity:
    """Values (c, n) from L' = 4 pi L/E_TOA (w, n), a local chain rule.

    name: "radiance", W m-2 sr-1 nm-1; "log_radiance", its natural logarithm; "reflectance_factor", pi L/E_TOA, as
    imagers' files hold it; "ratio", of each channel to the channel ``to``, which is left out. toa (w,): E_TOA,
    W m-2 nm-1.
    """

    name: str
    toa: F64
    to: int = 0

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise UserError(f"quantity {shown(self.name)} is unknown: choose one of {', '.join(NAMES)}")
        if self.name == "ratio" and self.toa.size < 2:
            raise UserError("quantity ratio needs two wavelengths or more")

    @property
    def channels(self) -> list[int]:
        """Which wavelengths' values there are."""
        every = range(self.toa.size)
        return [w for w in every if w != self.to] if self.name == "ratio" else list(every)

    @property
    def units(self) -> str:
        return {"radiance": "W m-2 sr-1 nm-1"}.get(self.name, "1")

    @property
    def _factor(self) -> F64:
        each = self.toa / (4 * np.pi) if self.name in ("radiance", "log_radiance") else np.full(self.toa.size, 0.25)
        return each[:, None]

    def value(self, light: F64) -> F64:
        if self.name == "log_radiance":
            return np.log(np.maximum(light, _LEAST) * self._factor)
        if self.name == "ratio":
            scaled = np.maximum(light, _LEAST) * self.toa[:, None]
            return scaled[self.channels] / scaled[self.to]
        return light * self._factor

    def tangent(self, light: F64, change: F64) -> F64:
        if self.name in ("radiance", "reflectance_factor"):
            return change * self._factor
        relative = np.where(light > _LEAST, change / np.maximum(light, _LEAST), 0.0)  # a clamp has no slope
        if self.name == "log_radiance":
            return relative
        return self.value(light) * (relative[self.channels] - relative[self.to])

    def adjoint(self, light: F64, bar: F64) -> F64:
        if self.name in ("radiance", "reflectance_factor"):
            return bar * self._factor
        relative = bar
        if self.name == "ratio":
            relative = np.zeros_like(light)
            each = self.value(light) * bar
            relative[self.channels] = each
            relative[self.to] = -each.sum(axis=0)
        return np.where(light > _LEAST, relative / np.maximum(light, _LEAST), 0.0)

    def error(self, light: F64, sigma: F64) -> F64:
        """Standard errors (c, n) of values, from independent ones (w, n) of L'."""
        if self.name in ("radiance", "reflectance_factor"):
            return sigma * self._factor
        relative = sigma / np.maximum(light, _LEAST)
        if self.name == "log_radiance":
            return relative
        return self.value(light) * np.hypot(relative[self.channels], relative[self.to])

    def relative(self, value: F64) -> F64:
        """L' of observed radiance (w, n), W m-2 sr-1 nm-1."""
        return value / (self.toa / (4 * np.pi))[:, None]
