"""What a linearisation holds fixed: the grid, the sun, the ordinates, and the light that enters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.ordinates import Ordinates, harmonic_matrix

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class World:
    """Geometry of nodes (nz, ny, nx) and of all light's ways, at nt terms (a wavelength, or a part of a band).

    levels_m (nz,); cell_m (dx, dy); axes (ny, nx, 3, 3): rows grid-x, grid-y, up of each column in the frame of
    directions; place (ny, nx, 3): its foot at height 0; sun (3,): toward it, in the frame. ground_node (ny, nx): the
    level on which the ground lies. inflow (nt, n, nz): radiance that enters along each of ``ordinates``. gas (nt, nz):
    absorption, 1/m. more_depth, more_forward (nt, nz, ny, nx): what the depths to the sun have besides those through
    the grid's matter. more_per_beam (nt, columns): what the ordinates miss of the clear sky's flux, over the beam: it
    comes with the sun. slope_sun (columns,): cosine of the sun's angle to the ground's normal; None where it is level.
    """

    levels_m: F64
    cell_m: tuple[float, float]
    axes: F64
    place: F64
    sun: F64
    ground_node: I64
    ordinates: Ordinates
    degree: int
    inflow: F64
    gas: F64
    more_depth: F64 | None = None
    more_forward: F64 | None = None
    more_per_beam: F64 | None = None
    slope_sun: F64 | None = None

    @property
    def shape(self) -> tuple[int, int, int]:
        return (len(self.levels_m), self.axes.shape[0], self.axes.shape[1])

    @property
    def nodes(self) -> int:
        return math.prod(self.shape)

    @property
    def columns(self) -> int:
        return self.shape[1] * self.shape[2]

    @cached_property
    def direction(self) -> F64:
        """Of the ordinates (n, 3) toward the light's origin: those from above and level ones come first."""
        return np.ascontiguousarray(self.ordinates.direction[self.order])

    @cached_property
    def order(self) -> I64:
        return np.argsort(self.ordinates.direction[:, 2] < -1e-9, kind="stable")

    @cached_property
    def weight(self) -> F64:
        return self.ordinates.weight[self.order]

    @cached_property
    def down(self) -> int:
        """How many ordinates are not from below."""
        return int((self.ordinates.direction[:, 2] >= -1e-9).sum())

    @cached_property
    def harmonics(self) -> F64:
        """(n, K) of the ordinates."""
        return np.ascontiguousarray(harmonic_matrix(self.direction, self.degree))

    @cached_property
    def gathered(self) -> F64:
        """Weights times harmonics (n, K): they make moments of radiance."""
        return self.weight[:, None] * self.harmonics

    @cached_property
    def ell(self) -> I64:
        """Degree (K,) of every harmonic."""
        return np.repeat(np.arange(self.degree), 2 * np.arange(self.degree) + 1)

    @cached_property
    def per_flux(self) -> F64:
        """Share (down,) of an ordinate's L' in the flux through the ground over E_TOA."""
        return self.weight[: self.down] * self.direction[: self.down, 2] / (4 * math.pi)

    @cached_property
    def unit(self) -> float:
        """Flux of L' = 1 from the ground as the ordinates have it."""
        below = slice(self.down, None)
        return float((self.weight[below] * -self.direction[below, 2]).sum() / (4 * math.pi))

    @cached_property
    def local_sun(self) -> F64:
        """(ny, nx, 3) toward the sun in the columns' axes."""
        return np.ascontiguousarray(np.einsum("jiab,b->jia", self.axes, self.sun / np.linalg.norm(self.sun)))

    @cached_property
    def sun_harmonics(self) -> F64:
        """4 pi Y (K, ny, nx) of the way to the sun: moments of a beam of unit flux, as L'."""
        found = harmonic_matrix(self.local_sun.reshape(-1, 3), self.degree).T
        return np.ascontiguousarray(4 * math.pi * found.reshape(-1, *self.shape[1:]))

    @cached_property
    def mu_sun(self) -> F64:
        """(columns,) cosine of the zenith angle."""
        return np.maximum(self.local_sun[..., 2].ravel(), 0.0)

    def per_beam(self, term: int) -> F64:
        """Flux (columns,) through the horizontal ground for a beam of 1."""
        return self.mu_sun if self.more_per_beam is None else self.mu_sun + self.more_per_beam[term]

    def per_beam_on_slopes(self, term: int) -> F64:
        """The same through the ground as it slopes."""
        return self.per_beam(term) + (0.0 if self.slope_sun is None else self.slope_sun - self.mu_sun)

    @cached_property
    def ground_nodes(self) -> I64:
        """Flat index (columns,) of the node on the ground."""
        return np.asarray(self.ground_node.ravel() * self.columns + np.arange(self.columns), np.int64)

    @cached_property
    def speed(self) -> tuple[F64, F64, F64]:
        """The way to the sun over the cells' sizes, along levels, rows and columns, 1/m: of cells."""
        cells = self.local_sun[:-1, :-1]
        return (
            cells[None, ..., 2] / np.diff(self.levels_m)[:, None, None],
            cells[None, ..., 1] / self.cell_m[1], cells[None, ..., 0] / self.cell_m[0],
        )  # fmt: skip

    @cached_property
    def least_cell_m(self) -> F64:
        """Least size (nz - 1, 1, 1) of the cells of a layer."""
        return np.minimum(np.diff(self.levels_m), min(self.cell_m))[:, None, None]
