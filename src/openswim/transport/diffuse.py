"""The diffuse field of `fast`: ordinates swept through the grid until the source they carry no longer changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from openswim.transport.ordinates import Ordinates, harmonic_matrix
from openswim.transport.products import Mirrored, SparseRows
from openswim.transport.sweep import CLEAR_BLOCK, add_prolonged, half_sweep

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ALIKE = 0.5  # change of the coarse moments, relative, up to which one fine sweep follows


@dataclass
class Coefficients:
    """The delta-scaled medium at one wavelength: scaled (s,), scattering (s, M), and the air on levels (nz,), 1/m."""

    scaled: F32
    scattering: F32
    air_extinction: F32
    air_scattering: F32  # (nz, M)
    air_forward: F32


@dataclass
class Sweeper:
    """Everything one grid needs to sweep one wavelength; `sweep` maps moments (nz, ny, M*M, nx) to moments."""

    extinction: F32
    coefficients: Coefficients
    beam: F32
    sun_harmonics: F32
    levels_m: F64
    cell_m: F64
    periodic: bool
    inflow: F32  # (ordinates, nz), in the order of `ordinates`
    ground_node: NDArray[np.int64]
    ground_albedo: F32
    direct_flux: F32
    ordinates: Ordinates
    degree: int

    def __post_init__(self) -> None:
        directions, weights = self.ordinates.direction, self.ordinates.weight
        down = directions[:, 2] >= 0
        _, ny, nx = self.beam.shape
        nz = len(self.levels_m)
        self.halves = []
        for half in (down, ~down):
            q = directions[half]
            edges = np.zeros((len(q), nz if self.periodic else 1, 4, max(nx, ny)), np.float32)
            w = weights[half].astype(np.float32)
            self.halves.append((q, mirrored(q, w, self.degree), w, np.ascontiguousarray(self.inflow[half].T), edges))
        up = self.halves[1]
        # discrete flux of unit radiance, so that the ground gives back what it takes
        self.unit_flux = float((up[2] * np.abs(up[0][:, 2])).sum() / (4 * np.pi))
        scatters: NDArray[np.bool_] = np.asarray((self.extinction > 0).any(axis=0))
        if (self.coefficients.air_scattering[:, 0] > 0).any():
            scatters[:] = True
        self.first = np.where(scatters.any(-1), scatters.argmax(-1), 0).astype(np.int64)
        last = nx - scatters[..., ::-1].argmax(-1)
        self.last = np.where(scatters.any(-1), last, 0).astype(np.int64)
        self.fills = bool((self.first == 0).all() and (self.last == nx).all())  # a sweep leaves no node out
        self.row_harmonics = np.ascontiguousarray(np.moveaxis(self.sun_harmonics, 0, 1))
        self.cloudy = cloudy_blocks(self.extinction, self.periodic)
        self.down_flux = np.zeros((ny, nx), np.float32)
        self.up_flux = np.zeros((ny, nx), np.float32)

    def sweep(self, moments: F32, out: F32 | None = None) -> F32:
        """One pass over all ordinates; ``out``, an earlier result of a like sweep, saves the pages of a new one."""
        new = np.zeros_like(moments) if out is None else out
        if out is not None and not self.fills:
            out[:] = 0
        c = self.coefficients
        radiance = np.zeros_like(self.ground_albedo)
        for downward, (q, harmonics, weight, inflow, edges) in zip((True, False), self.halves, strict=True):
            flux = self.down_flux if downward else self.up_flux
            half_sweep(
                get_num_threads(), downward, self.extinction, c.scaled, c.scattering, c.air_extinction,
                c.air_scattering, self.beam, self.row_harmonics, self.levels_m, self.cell_m, self.periodic, self.first,
                self.last, self.cloudy, q, weight, *harmonics, inflow, edges, self.ground_node, radiance, moments, new,
                flux,
            )  # fmt: skip
            if downward:
                radiance = np.asarray(
                    self.ground_albedo * (self.direct_flux + self.down_flux) / np.float32(self.unit_flux), np.float32
                )
        return new

    def solve(self, moments: F32, tolerance: float, most: int, memory: int = 3) -> tuple[F32, int]:
        """Fixed point by Anderson acceleration over the last ``memory`` sweeps; inner products over l < 2."""
        sources: list[F32] = []
        images: list[F32] = []
        for n in range(1, most + 1):
            image = self.sweep(moments)
            residual = (image[:, :, :4] - moments[:, :, :4]).ravel()
            scale = float(np.linalg.norm(image[:, :, :4]))
            if scale == 0 or float(np.linalg.norm(residual)) < tolerance * scale:
                return image, n
            sources = [*sources, moments][-memory:]
            images = [*images, image][-memory:]
            moments = _anderson(sources, images)
        return image, most


def _anderson(sources: list[F32], images: list[F32]) -> F32:
    """Combination of the images whose residual is least."""
    if len(images) == 1:
        return images[0]
    residuals = [(i[:, :, :4] - s[:, :, :4]).ravel() for s, i in zip(sources, images, strict=True)]
    last = residuals[-1].astype(float)
    differences = np.stack([r - last for r in residuals[:-1]])
    gram = differences @ differences.T
    gram += 1e-9 * np.trace(gram) * np.eye(len(gram))
    weights = np.linalg.solve(gram, -(differences @ last))
    out = images[-1] * np.float32(1 - weights.sum())
    for w, image in zip(weights, images[:-1], strict=True):
        out += np.float32(w) * image
    return out


class Solution(NamedTuple):
    """Moments of one wavelength on the 2x2-coarse and on the full grid, and the sweeps they took."""

    coarse: F32
    fine: F32
    coarse_sweeps: int
    fine_sweeps: int


def coarse_to_fine(
    coarse: Sweeper, fine: Sweeper, before: Solution | None, tolerance: float, most: int, sweeps: int
) -> Solution:
    """Converge on the coarse grid, then ``sweeps`` on the full one.

    From the solution of a wavelength ``before``, one fine sweep will do: what changes between the two changes alike on
    both grids, and the error of the fine field goes on decreasing from wavelength to wavelength.
    """
    levels, rows, columns = coarse.beam.shape
    if before is None:
        nothing = np.zeros((levels, rows, fine.degree**2, columns), np.float32)
        start, n = coarse.solve(nothing, tolerance, most)
        moments = np.zeros((*fine.beam.shape[:2], fine.degree**2, fine.beam.shape[2]), np.float32)
        add_prolonged(start, moments)
    else:
        start, n = coarse.solve(before.coarse, tolerance, most)
        change = start - before.coarse
        if float(np.linalg.norm(change)) < _ALIKE * float(np.linalg.norm(start)):
            sweeps = 1
        moments = before.fine.copy()
        add_prolonged(change, moments)
    spare = None
    for _ in range(sweeps):
        moments, spare = fine.sweep(moments, spare), moments
    return Solution(start, moments, n, sweeps)


def cloudy_blocks(extinction: F32, periodic: bool) -> NDArray[np.bool_]:
    """Blocks of nodes along each row (nz, ny, block) with cloud in them or next to them."""
    found = (extinction > 0).any(axis=0)
    for axis in range(3):
        edge = "wrap" if periodic and axis > 0 else "constant"
        padded = np.pad(found, [(1, 1) if a == axis else (0, 0) for a in range(3)], mode=edge)  # type: ignore[call-overload]
        n = found.shape[axis]
        found = padded.take(range(n), axis) | found | padded.take(range(2, n + 2), axis)
    return np.ascontiguousarray(np.logical_or.reduceat(found, range(0, found.shape[2], CLEAR_BLOCK), axis=2))


def mirrored(directions: F64, weight: F32, degree: int) -> Mirrored:
    """Harmonics of ordinates (n, 3), factored by their mirror images in x and y."""
    matrix = harmonic_matrix(directions, degree)
    images = np.round(np.abs(directions * [1, 1, 0]) + directions * [0, 0, 1], 9)
    _, family = np.unique(images, axis=0, return_inverse=True)
    parts: list[F64] = []
    columns: list[F64] = []
    for f in np.unique(family):
        members = np.flatnonzero(family.ravel() == f)
        for part in _parities(matrix[members]):
            column = np.zeros(len(directions))
            # rank one: every member's harmonics are those of the first, up to their sign
            largest = np.abs(part[0]).argmax()
            column[members] = part[:, largest] / part[0, largest]
            parts.append(part[0])
            columns.append(column)
    whole = np.stack(columns, axis=-1)
    first = np.stack(parts)
    return Mirrored(*(_sparse(m) for m in (first, whole, whole.T * weight, first.T)))


def _parities(rows: F64) -> list[F64]:
    """Harmonics of mirror images split into those that change sign alike; a lone ordinate stays whole."""
    rows = np.where(np.abs(rows) < 1e-12, 0, rows)
    signs = np.sign(rows) * np.where(rows[0] == 0, 1, np.sign(rows[0]))
    kinds = {tuple(column) for column in signs.T if column.any()}
    return [np.where((np.array(kind) == signs.T).all(axis=1), rows, 0) for kind in sorted(kinds)]


def _sparse(matrix: F64) -> SparseRows:
    row, column = np.nonzero(np.abs(matrix) > 1e-12)
    start = np.searchsorted(row, np.arange(len(matrix) + 1))
    return SparseRows(start.astype(np.int64), column.astype(np.int64), matrix[row, column].astype(np.float32))


def coarsen(field: F32) -> F32:
    """Mean of 2x2 columns (the last row or column stands alone where the count is odd)."""
    ny, nx = field.shape[-2:]
    pad = [(0, 0)] * (field.ndim - 2) + [(0, ny % 2), (0, nx % 2)]
    f = np.pad(field, pad, mode="edge")
    return np.ascontiguousarray(
        0.25 * (f[..., ::2, ::2] + f[..., 1::2, ::2] + f[..., ::2, 1::2] + f[..., 1::2, 1::2]), np.float32
    )
