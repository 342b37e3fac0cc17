"""The diffuse field of `fast`: ordinates swept through the grid until the source they carry no longer changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.transport.ordinates import Ordinates, harmonic_matrix
from openswim.transport.sweep import half_sweep

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass
class Coefficients:
    """The delta-scaled medium at one wavelength: scaled (s,), scattering (s, M), and the air on the levels (nz,), 1/m."""

    scaled: F32
    scattering: F32
    air_extinction: F32
    air_scattering: F32  # (nz, M)
    air_forward: F32


@dataclass
class Sweeper:
    """Everything one grid needs to sweep one wavelength; `sweep` maps moments to moments."""

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
            matrix = harmonic_matrix(q, self.degree).astype(np.float32)
            self.halves.append((q, matrix, weights[half].astype(np.float32), self.inflow[half], edges))
        up = self.halves[1]
        # discrete flux of unit radiance, so that the ground gives back what it takes
        self.unit_flux = float((up[2] * np.abs(up[0][:, 2])).sum() / (4 * np.pi))
        scatters = (self.extinction > 0).any(axis=0)
        if (self.coefficients.air_scattering[:, 0] > 0).any():
            scatters[:] = True
        self.first = np.where(scatters.any(-1), scatters.argmax(-1), 0).astype(np.int64)
        last = nx - scatters[..., ::-1].argmax(-1)
        self.last = np.where(scatters.any(-1), last, 0).astype(np.int64)
        self.down_flux = np.zeros((ny, nx), np.float32)
        self.up_flux = np.zeros((ny, nx), np.float32)

    def sweep(self, moments: F32) -> F32:
        """One pass over all ordinates."""
        new = np.zeros_like(moments)
        c = self.coefficients
        radiance = np.zeros_like(self.ground_albedo)
        for downward, (q, matrix, weight, inflow, edges) in zip((True, False), self.halves, strict=True):
            flux = self.down_flux if downward else self.up_flux
            half_sweep(
                downward, self.extinction, c.scaled, c.scattering, c.air_extinction, c.air_scattering, self.beam,
                self.sun_harmonics, self.levels_m, self.cell_m, self.periodic, self.first, self.last, q, matrix, weight,
                inflow, edges, self.ground_node, radiance, moments, new, flux,
            )  # fmt: skip
            if downward:
                radiance = self.ground_albedo * (self.direct_flux + self.down_flux) / np.float32(self.unit_flux)
        return new

    def solve(self, moments: F32, tolerance: float, most: int, memory: int = 3) -> tuple[F32, int]:
        """Fixed point by Anderson acceleration over the last ``memory`` sweeps; inner products over l < 2."""
        sources: list[F32] = []
        images: list[F32] = []
        for n in range(1, most + 1):
            image = self.sweep(moments)
            residual = (image[:4] - moments[:4]).ravel()
            scale = float(np.linalg.norm(image[:4]))
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
    residuals = [(i[:4] - s[:4]).ravel() for s, i in zip(sources, images, strict=True)]
    last = residuals[-1].astype(float)
    differences = np.stack([r - last for r in residuals[:-1]])
    gram = differences @ differences.T
    gram += 1e-9 * np.trace(gram) * np.eye(len(gram))
    weights = np.linalg.solve(gram, -(differences @ last))
    out = images[-1] * np.float32(1 - weights.sum())
    for w, image in zip(weights, images[:-1], strict=True):
        out += np.float32(w) * image
    return out


def coarsen(field: F32) -> F32:
    """Mean of 2x2 columns (the last row or column stands alone where the count is odd)."""
    ny, nx = field.shape[-2:]
    pad = [(0, 0)] * (field.ndim - 2) + [(0, ny % 2), (0, nx % 2)]
    f = np.pad(field, pad, mode="edge")
    return np.ascontiguousarray(
        0.25 * (f[..., ::2, ::2] + f[..., 1::2, ::2] + f[..., ::2, 1::2] + f[..., 1::2, 1::2]), np.float32
    )


def prolong(field: F32, shape: tuple[int, int]) -> F32:
    """Bilinear interpolation from 2x2-coarse columns to ``shape``."""
    for axis, size in ((-2, shape[0]), (-1, shape[1])):
        f = np.moveaxis(field, axis, -1)
        left = np.concatenate([f[..., :1], f[..., :-1]], axis=-1)
        right = np.concatenate([f[..., 1:], f[..., -1:]], axis=-1)
        out = np.empty((*f.shape[:-1], 2 * f.shape[-1]), np.float32)
        out[..., ::2] = 0.75 * f + 0.25 * left
        out[..., 1::2] = 0.75 * f + 0.25 * right
        field = np.moveaxis(out[..., :size], -1, axis)
    return np.ascontiguousarray(field)
