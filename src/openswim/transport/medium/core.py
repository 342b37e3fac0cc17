"""The part of a grid in which rays see it, where a wider one lies around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.scene.rims import CORE_RIM, LEAST_CORE_RIM
from openswim.transport.march.volume import FAR_M
from openswim.transport.medium.medium import Medium

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Core:
    """The part of a grid in which rays see it: planes (4, 3) with normals inward, ``offset_m`` (4,) from the Earth's
    centre."""

    normal: F64
    offset_m: F64
    radius_m: float

    @classmethod
    def of(cls, medium: Medium) -> Core:
        """All of a grid but its rim."""
        radius = medium.frame.radius_m
        ny, nx = medium.place.shape[:2]
        y, x = (min(max(LEAST_CORE_RIM, round(CORE_RIM * n)), (n - 2) // 2) for n in (ny, nx))
        up = (medium.place[y : ny - y, x : nx - x] + np.array([0.0, 0.0, radius])) / radius
        centre = up[up.shape[0] // 2, up.shape[1] // 2]
        normals, offsets = [], []
        for side in (up[:, 0], up[:, -1], up[0], up[-1]):
            normal = np.cross(side[0], side[-1])
            normal *= np.sign(normal @ centre) / np.linalg.norm(normal)
            normals.append(normal)
            offsets.append(radius * float((side @ normal).max()))  # where sides are bent, as far in as they are
        return cls(np.array(normals), np.array(offsets), radius)

    def crossed(self, origin: F64, direction: F64, top_m: float) -> tuple[F64, F64]:
        """Where rays (n, 3) enter the core and leave it, within the air: (n,) each, both FAR_M where they pass it by.
        One that enters before there is air enters at once, one that leaves after it never does."""
        place = origin + np.array([0.0, 0.0, self.radius_m])
        enter, leave = np.zeros(len(direction)), np.full(len(direction), FAR_M)
        for normal, offset in zip(self.normal, self.offset_m, strict=True):
            a, b = place @ normal - offset, direction @ normal
            with np.errstate(divide="ignore", invalid="ignore"):
                at = -a / b
            enter = np.where(b > 0, np.maximum(enter, at), enter)
            leave = np.where(b < 0, np.minimum(leave, at), leave)
            leave[(b == 0) & (a < 0)] = 0.0
        along = (place * direction).sum(-1)
        half = along**2 - (place**2).sum(-1) + (self.radius_m + top_m) ** 2
        root = np.sqrt(np.maximum(half, 0.0))
        enter = np.where(enter <= -along - root, 0.0, enter)
        beside = (leave <= enter) | (half <= 0) | (leave <= -along - root) | (enter >= root - along)
        leave = np.where(leave >= root - along, FAR_M, leave)
        return np.where(beside, FAR_M, enter), np.where(beside, FAR_M, leave)
