"""What enters a grid at its sides where there are clouds beyond them.

A clear sky beside a deck of cloud is felt kilometres into it. Where a wider grid lies around it and has been swept, its
light enters. Else what is beyond the sides is taken to be like what is at them: columns along them are lit as if they
went on for ever. In both cases it is what their light has beyond that of clear air that is added to the clear sky's,
which is known better. docs/decisions/0018-sides.md.
"""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.transport.diffuse.moments import Coarser, Moments, gathered
from openswim.transport.diffuse.optical_grid import OpticalGrid, near_blocks, whole_blocks
from openswim.transport.diffuse.sweeper import Sweeper, of_nodes
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.ordinates import Ordinates, harmonic_matrix
from openswim.transport.engine.scratch import Pool
from openswim.transport.engine.types import FLOAT
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_MOST_COLUMNS = 96  # of a side; where there are more, every second or so tells enough
_APART_M = 1e6  # so wide are their cells
_MOST_SWEEPS, _MEMORY = 60, 6
_CLEAR_COLUMNS = 13  # each way, of `clear_down_flux`


class Columns:
    """Rows ``j`` and columns ``i`` (n,) of some nodes along the west, east, south and north sides of a grid."""

    def __init__(self, ny: int, nx: int):
        some = (np.unique(np.linspace(0, count - 1, _MOST_COLUMNS).astype(int)) for count in (ny, ny, nx, nx))
        self.sides = list(zip((ny, ny, nx, nx), some, strict=True))
        (_, w), (_, e), (_, s), (_, n) = self.sides
        self.j = np.concatenate([w, e, 0 * s, 0 * n + ny - 1])
        self.i = np.concatenate([0 * w, 0 * e + nx - 1, s, n])

    def light(self, clear: F32, more: F64) -> F32:
        """Radiance (ordinates, nz, 4, nodes) at all nodes of the sides, shorter ones filled with their last: ``clear``
        (ordinates, nz), and what there is ``more`` (ordinates, nz, n) of it in the columns."""
        out = np.empty((*clear.shape, 4, max(count for count, _ in self.sides)), FLOAT)
        first = 0
        for side, (count, at) in enumerate(self.sides):
            own = more[..., first : first + len(at)]
            every = np.minimum(np.arange(out.shape[-1]), count - 1)
            out[:, :, side] = np.maximum(clear[..., None] + _linear(at, own, every), 0)
            first += len(at)
        return out


def _linear(at: ArrayLike, values: NDArray, where: ArrayLike, axis: int = -1) -> NDArray:
    """Values at the places ``at`` along an axis, at others between."""
    from scipy.interpolate import interp1d  # a tenth of a second, for nested grids alone

    return np.asarray(interp1d(at, values, axis=axis)(where))


def _has_cloud_at_sides(grid: OpticalGrid) -> bool:
    nx = grid.ground_node.shape[1]
    e = grid.extinction
    return bool(e[..., 0].any() or e[..., nx - 1].any() or e[:, :, 0].any() or e[:, :, -1].any())


class Clear(NamedTuple):
    """What clear air would be: ``inflow`` (ordinates, nz) of its sky, ``beam`` (nz,), and on the ground its mean albedo
    and the beam's flux."""

    inflow: F32
    beam: F32
    ground_albedo: float
    direct_flux: float


class GroundLight(NamedTuple):
    """Albedo of columns and the beam's flux on their ground, (ny, nx) or (n,)."""

    albedo: F32
    direct_flux: F32


class SweptAround(NamedTuple):
    """A wider grid that has been swept: its light's moments at every wavelength."""

    medium: Medium
    moments: list[Moments]
    coarser: list[Coarser]


def light_through_sides(
    wider: SweptAround | None, medium: Medium, grid: OpticalGrid, clear: Clear, ground: GroundLight,
    ordinates: Ordinates, tolerance: float, w: int, decide: Decisions,
) -> F32 | None:  # fmt: skip
    """Radiance (ordinates, nz, 4, nodes) that enters at the nodes of the west, east, south and north sides of the
    ``w``-th wavelength's grid; None where it is the clear sky's. ``ground`` is the grid's."""
    if min(grid.ground_node.shape) < 2:
        return None
    if wider is not None:
        return _light_of_wider(wider, medium, grid, clear, ordinates, tolerance, w, decide)
    if decide("cloud at the sides", lambda: _has_cloud_at_sides(grid)):
        return _light_of_own_columns(grid, clear, ground, ordinates, tolerance, decide)
    return None


def _light_of_own_columns(
    grid: OpticalGrid, clear: Clear, ground: GroundLight, ordinates: Ordinates, tolerance: float, decide: Decisions
) -> F32:
    """`light_through_sides` where clouds go on beyond them as they are there."""
    columns = Columns(*grid.ground_node.shape)
    j, i = columns.j, columns.i
    under = GroundLight(ground.albedo[j, i], ground.direct_flux[j, i])
    moments = _moments_of_columns(grid, clear, under, j, i, _APART_M, ordinates, tolerance, decide)
    harmonic = harmonic_matrix(ordinates.direction, grid.air_scattering.shape[1])
    more = np.einsum("nm,kmc->nkc", harmonic, moments[..., :-1] - moments[..., -1:], optimize=True)
    return columns.light(clear.inflow, more)


def _moments_of_columns(
    grid: OpticalGrid, clear: Clear, ground: GroundLight, j: I64, i: I64, width_m: float, ordinates: Ordinates,
    tolerance: float, decide: Decisions,
) -> F64:  # fmt: skip
    """Moments (nz, M*M, n + 1) in columns (n,) of a grid, each so wide, and last in one of clear air."""

    def row(values: NDArray, last: ArrayLike) -> NDArray:
        """Values (..., n) of the columns and of the clear one: (..., 1, n + 1)."""
        last = np.broadcast_to(np.asarray(last, values.dtype)[..., None], (*values.shape[:-1], 1))
        return np.concatenate([values, last], axis=-1)[..., None, :]

    _, ny, _ = grid.beam.shape
    nx = grid.ground_node.shape[1]
    extinction = row(grid.extinction[:, :, j, i], 0.0)
    harmonics = np.moveaxis(grid.sun_harmonics, 1, 0)
    strip = grid._replace(
        extinction=whole_blocks(extinction), beam=whole_blocks(row(grid.beam[:, j, i], clear.beam)),
        sun_harmonics=whole_blocks(np.moveaxis(row(harmonics[:, j, i], harmonics[:, ny // 2, nx // 2]), 1, 0)),
        cell_m=np.full(2, width_m), ends=np.zeros_like(grid.ends),
        ground_node=row(grid.ground_node[j, i], grid.ground_node.min()),
        cloudy=near_blocks(np.asarray((extinction > 0).any(axis=0)), False),
    ).decided(decide)  # fmt: skip
    sweeper = Sweeper.of(
        strip, clear.inflow, row(ground.albedo, clear.ground_albedo), row(ground.direct_flux, clear.direct_flux),
        ordinates, Pool(), decide=decide,
    )  # fmt: skip
    values, _, _ = sweeper.solve(sweeper.nothing(), 0.05 * tolerance, _MOST_SWEEPS, _MEMORY)
    of_nodes(values, sweeper.ratio)
    every = np.arange(len(j) + 1)
    moments = gathered(Moments(sweeper.place, values), sweeper.coarser, 0 * every, every)
    return np.asarray(np.moveaxis(moments, -1, 1), float)


def _light_of_wider(
    wider: SweptAround, medium: Medium, grid: OpticalGrid, clear: Clear, ordinates: Ordinates, tolerance: float, w: int,
    decide: Decisions,
) -> F32:
    """`light_through_sides` where a ``wider`` grid, which has been swept, lies around a medium."""
    around = wider.medium
    columns = Columns(*medium.shape[1:])
    place = medium.place[columns.j, columns.i]
    x, y = around.indices(place)
    _, rows, across = around.shape
    within = (x >= 0) & (y >= 0) & (x <= across - 1) & (y <= rows - 1)
    x, y = np.clip(x, 0, across - 1), np.clip(y, 0, rows - 1)
    i, j = np.minimum(x.astype(int), across - 2), np.minimum(y.astype(int), rows - 2)
    corners = []
    for up, right in product((0, 1), (0, 1)):
        weight = np.abs(1 - up - (y - j)) * np.abs(1 - right - (x - i))
        corners.append(weight[:, None] * gathered(wider.moments[w], wider.coarser[w], j + up, i + right))
    moments = _linear(around.levels_m, np.sum(corners, axis=0), np.clip(medium.levels_m, *around.levels_m[[0, -1]]), 0)
    # the ordinates in the axes of the other grid's columns
    own, theirs = medium.axes[columns.j, columns.i], around.axes[np.rint(y).astype(int), np.rint(x).astype(int)]
    turned = np.einsum("cab,cdb,nd->cna", theirs, own, ordinates.direction)
    degree = math.isqrt(moments.shape[-1])
    there = harmonic_matrix(turned.reshape(-1, 3), degree).reshape(*turned.shape[:2], -1)
    found = np.einsum("cnm,kcm->nkc", there, moments, optimize=True)
    # clear air that the light has come through from the sides of the wider grid
    none, nothing = np.zeros(0, int), np.zeros(0, FLOAT)
    half_m = 0.5 * min(n * cell for n, cell in zip((across, rows), around.cell_m, strict=True))
    of_air = _moments_of_columns(
        grid, clear, GroundLight(nothing, nothing), none, none, half_m, ordinates, tolerance, decide
    )
    known = harmonic_matrix(ordinates.direction, degree) @ of_air[..., 0].T
    return columns.light(clear.inflow, np.where(within, found - known[..., None], 0.0))


def some_columns(shape: tuple[int, int]) -> tuple[I64, I64]:
    """Rows (rows, 1) and columns (columns,) of some nodes spread over all (ny, nx), for `clear_down_flux`."""
    j, i = (np.rint(np.linspace(0, count - 1, min(count, _CLEAR_COLUMNS))).astype(int) for count in shape)
    return j[:, None], i


def clear_down_flux(
    grid: OpticalGrid, clear: Clear, beam: F32, direct_flux: F32, ordinates: Ordinates, tolerance: float,
    decide: Decisions,
) -> F32:  # fmt: skip
    """Diffuse flux (rows, columns) at the ground that sweeps find in the clear air of a grid, in `some_columns` of it;
    ``beam`` (nz, rows, columns) and its flux on the ground there."""
    ny, nx = grid.ground_node.shape
    j, i = some_columns((ny, nx))
    shape = rows, columns = len(j), len(i)
    nz, (species, *_) = len(grid.levels_m), grid.extinction.shape
    wider = np.array([nx - 1, ny - 1]) / np.maximum([columns - 1, rows - 1], 1)
    ground_node = np.full(shape, int(np.median(grid.ground_node)))
    even = grid._replace(
        extinction=whole_blocks(np.zeros((species, nz, *shape), FLOAT)), beam=whole_blocks(beam),
        sun_harmonics=whole_blocks(grid.sun_harmonics[j.ravel()][..., i]), cell_m=grid.cell_m * wider,
        ground_node=ground_node, cloudy=near_blocks(np.zeros((nz, *shape), bool), False),
    ).decided(decide)  # fmt: skip
    albedo = np.full(shape, clear.ground_albedo, FLOAT)
    sweeper = Sweeper.of(even, clear.inflow, albedo, direct_flux, ordinates, Pool(), decide=decide)
    sweeper.solve(sweeper.nothing(), 0.05 * tolerance, _MOST_SWEEPS, _MEMORY)
    return sweeper.fluxes()[0]
