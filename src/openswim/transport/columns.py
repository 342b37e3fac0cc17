"""The diffuse light of very large domains: every column on its own, under the sun's beam that all of them share.

Cells of kilometres are so much wider than the way light diffuses in cloud that little passes between columns. What
does not is solved without sweeps (`column_solve.py`), and the eye sees of each cell what its thin parts send up
(`column_light.py`). docs/decisions/0013-large-domains.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.transport.column_light import column_light
from openswim.transport.column_solve import harmonics_of_mode, mode_tables
from openswim.transport.eye_source import columns_of
from openswim.transport.medium import Medium
from openswim.transport.optical_grid import Coefficients
from openswim.transport.shells import clear_radiance
from openswim.transport.threads import in_threads
from openswim.transport.volume import Shells

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_COLUMN_SUNS = 33


@dataclass
class Columns:
    """The light of a grid's columns: all that `column_light` asks for but the eye, and where it writes fluxes."""

    medium: Medium
    coefficients: list[Coefficients]
    ground_node: NDArray[np.int64]
    local_sun: F64
    mu_sun: F64
    albedo: F32
    direct: F32
    inflow: F32
    down: F32
    up: F32
    count: int

    def aim(self, fields: F32, eye: F64, parallel: bool) -> None:
        """Fill the source channels for one eye."""
        m, some = self.medium, self.coefficients[: self.count]
        in_threads(
            column_light, m.extinction, np.stack([c.scaled for c in some]), np.stack([c.scattering for c in some]),
            np.stack([c.air_extinction for c in some]), np.stack([c.air_scattering for c in some]), m.levels_m,
            self.ground_node, np.ascontiguousarray(np.moveaxis(self.local_sun, -1, 1), np.float32), self.mu_sun,
            self.albedo, self.direct, self.inflow, mode_tables(), columns_of(m.axes, m.place, eye, parallel), eye,
            parallel, self.count, fields, self.down, self.up,
        )  # fmt: skip


def top_light(shells: Shells, top_m: float, count: int) -> F32:
    """What the clear air above ``top_m`` sends down, for cosines of the sun's zenith angle from -1 to 1 (count, suns,
    2): its half-range integrals with P1 and P3."""
    x, weight = np.polynomial.legendre.leggauss(6)
    mu, weight = (x + 1) / 2, weight / 2
    azimuth = (np.arange(8) + 0.5) * np.pi / 8
    suns = np.linspace(-1, 1, _COLUMN_SUNS)
    z, phi = (a.ravel() for a in np.meshgrid(mu, azimuth, indexing="ij"))
    direction = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=-1)
    origin = np.tile([0.0, 0.0, max(top_m, shells.ground_m + 1.0)], (len(z), 1))
    tests = harmonics_of_mode(mu, 0)[[1, 3]] * weight
    out = np.zeros((count, _COLUMN_SUNS, 2), np.float32)
    for n, cosine in enumerate(suns):
        sun = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
        radiance = clear_radiance(origin, direction, sun, shells, 1.0)[:, :count].reshape(mu.size, azimuth.size, count)
        out[:, n] = (tests @ radiance.mean(axis=1)).T
    return out
