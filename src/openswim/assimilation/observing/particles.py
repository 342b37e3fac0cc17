"""Extinction of a species by what a model knows of it, and its slopes: local and diagonal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.optics import hydrometeors

F64 = NDArray[np.float64]

REFERENCE_NM = 550.0
_STEP = 1e-4  # of a logarithm, to either side: the slope is right to 2e-9 of it


@dataclass(frozen=True, eq=False)
class Particles:
    """A kind of hydrometeor with all but its controls held fixed.

    kind: of `openswim.optics.hydrometeors`. fields: content (kg m-3), and effective radius (m) or number (m-3) where
    the scene has them. cover: share of a cell that is cloud, within which sizes are those of cloud.
    """

    kind: str
    fields: Mapping[str, F64]
    cover: F64 | float = 1.0

    def extinction_per_m(self, **changed: F64) -> F64:
        """beta = 3 q / (2 rho r_e), times what Mie theory adds (1.045 for droplets of 10 um), at 550 nm."""
        now = {**self.fields, **changed}
        number = now.get("number")
        size = now.get("effective_radius"), None if number is None else number / self.cover
        content = now["content"] / self.cover
        radius = hydrometeors.effective_radius_m(self.kind, content, *size)
        beta = hydrometeors.extinction_per_m(self.kind, content, *size) * self.cover
        return np.asarray(beta * hydrometeors.extinction_factor(self.kind, REFERENCE_NM, radius), float)

    def slope(self, which: str, **changed: F64) -> F64:
        """d beta / d (one of the fields), by differences of the same function, clamps of the radius and all.

        0 where the field is 0 or less.
        """
        now = {**self.fields, **changed}
        value = np.asarray(now[which], float)
        up, low = (self.extinction_per_m(**{**changed, which: value * np.exp(s)}) for s in (_STEP, -_STEP))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(value > 0, (up - low) / (2 * _STEP * value), 0.0)

    def content_of(self, extinction_per_m: float) -> F64:
        """The content (kg m-3) with so little extinction, nodes' own sizes given: by Newton's steps in logarithms."""
        q = np.full(np.shape(self.fields["content"]), extinction_per_m * 2e3 / 3 * 5e-6)
        for _ in range(12):
            beta = self.extinction_per_m(content=q)
            if np.abs(beta - extinction_per_m).max() <= 1e-12 * extinction_per_m:
                break
            slope = self.slope("content", content=q)
            q = q * np.exp(np.clip(np.log(extinction_per_m / beta) * beta / np.maximum(slope * q, 1e-300), -3, 3))
        return q
