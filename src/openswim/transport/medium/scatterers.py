"""What scatters at a grid's nodes, at several wavelengths, as the kernels read it that aim light at an eye."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.eye_ways import wide
from openswim.transport.medium.delta_scaled import Coefficients
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class Scatterers(NamedTuple):
    """`Coefficients` of nw wavelengths, and what they are coefficients of. Delta-scaled extinction at a node is
    sum_s scaled[w, s] extinction[s] + air_extinction[w, k], Legendre moment l of its scattering likewise, 1/m."""

    extinction: F32  # (ns, nz, ny, nx) of the species at the reference wavelength, 1/m, rows of LANES nodes or more
    levels_m: F64  # (nz,)
    scaled: F32  # (nw, ns)
    scattering: F32  # (nw, ns, M)
    air_extinction: F32  # (nw, nz) 1/m
    air_scattering: F32  # (nw, nz, M) 1/m

    @classmethod
    def of(cls, medium: Medium, coefficients: Sequence[Coefficients]) -> Scatterers:
        names = ("scaled", "scattering", "air_extinction", "air_scattering")
        stacked = (np.stack([getattr(c, name) for c in coefficients]) for name in names)
        return cls(wide(medium.extinction), medium.levels_m, *stacked)
