"""What rays bring back: the light along them, and in the end what an eye sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.pack import PACK

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass
class View:
    """What rays see: solar-relative ``radiance`` (n, nw); ``transmittance`` e^-tau along the ray (n, nw); where they
    ``hit`` the ground (n,) and at which ``position`` (n, 3); optical depth (n, ns) of the finest grid's species."""

    radiance: F32
    transmittance: F32
    hit: NDArray[np.bool_]
    position: F64
    distance_m: F64
    species_depth: F32
    samples: int


class Seen(NamedTuple):
    """What rays (n) have seen, but for the ground's own light; (n, PACK) where nothing else is said."""

    radiance: F32
    through: F32  # what is left of the ground's light
    full: F32  # and of the sun's
    distance: F64  # (n,) to the ground, or -1
    depth: F32  # (n, ns) of each species
    samples: int
    level: NDArray[np.int8]  # (n,) grid in which they end: 0 for the field's own, 1 for the wider ...

    @classmethod
    def nothing(cls, n: int, species: int) -> Seen:
        """Rays that have not set out."""
        return cls(
            np.zeros((n, PACK), np.float32), np.ones((n, PACK), np.float32), np.ones((n, PACK), np.float32),
            np.full(n, -1.0), np.zeros((n, species), np.float32), 0, np.zeros(n, np.int8),
        )  # fmt: skip
