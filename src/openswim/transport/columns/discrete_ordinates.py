"""Layers without sides: discrete ordinates and Fourier modes in azimuth, all orders of scattering at once.

One column costs so little that it may have the streams that a phase function asks for (Chandrasekhar 1960; Stamnes et
al. 1988 for delta scaling and modes). Between levels the source is linear in optical depth, as in the sweeps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.medium.levels import LAYERS_DEGREE

F64 = NDArray[np.float64]

_STREAMS = LAYERS_DEGREE // 2  # in each hemisphere: Gauss' rule there is exact for products with the first moment
_FAINT = 1e-7  # of the sun's light, that a mode must have to count


class _Streams(NamedTuple):
    """Cosines mu (N,) of the streams of a hemisphere; the harmonics (modes, M, 2N) toward where light comes from, down
    before up, and what makes moments of radiance, receive (modes, 2N, M)."""

    mu: F64
    weight: F64
    harmonics: F64
    receive: F64


@dataclass(frozen=True)
class Layers:
    """The light in layers, at one wavelength, on levels (nz,) from below.

    light (mode, nz, M): moments of diffuse light and beam over the associated Legendre functions; scattering (nz, M):
    (2l+1) times the delta-scaled moments of the scattering coefficient, 1/m. down, up: diffuse flux at the lowest and
    the highest level, for E_TOA = 1.
    """

    light: F64
    scattering: F64
    sun: F64
    down: float
    up: float

    def source(self, toward: F64) -> F64:
        """What the levels (nz,) scatter of the light, seen along ``toward`` (3,) from an eye, 1/m."""
        harmonics = associated_legendre(toward[2:3], len(self.light))[..., 0]
        azimuth = np.arctan2(toward[1], toward[0]) - np.arctan2(self.sun[1], self.sun[0])
        modes = harmonics * np.cos(np.arange(len(self.light)) * azimuth)[:, None]
        return np.asarray(np.einsum("mkl,ml,kl->k", self.light, modes, self.scattering))


def associated_legendre(mu: F64, modes: int) -> F64:
    """sqrt((l-m)!/(l+m)!) P_lm(mu), (modes, M, n); zero where l < m."""
    out, order = np.zeros((modes, LAYERS_DEGREE, len(mu))), np.arange(modes)[:, None]
    before, this = np.zeros((2, modes, len(mu)))
    first = np.ones(len(mu))
    for ell in range(LAYERS_DEGREE):  # all m <= l side by side
        if ell < modes:
            this[ell] = first
            first = first * np.sqrt((2 * ell + 1) / (2 * ell + 2)) * np.sqrt(np.maximum(1 - mu**2, 0))
        m = order[: ell + 1]
        known = slice(0, len(m))
        out[known, ell] = this[known]
        following = (2 * ell + 1) * mu * this[known] - np.sqrt(ell**2 - m**2) * before[known]
        before[known], this[known] = this[known], following / np.sqrt((ell + 1) ** 2 - m**2)
    return out


def solve_layers(
    levels_m: F64, extinction: F64, scattering: F64, beam: F64, sun: F64, albedo: float, direct: float
) -> Layers:
    """The light in delta-scaled layers over Lambertian ground.

    extinction (nz,) and moments of the scattering coefficient, scattering (nz, M), 1/m; beam (nz,) transmission from
    the sun (3,); direct: its flux on the ground.
    """
    nz = len(levels_m)
    g, w = np.polynomial.legendre.leggauss(_STREAMS)
    mu, weight = (g + 1) / 2, np.concatenate([w, w]) / 2
    weighted = scattering * (2 * np.arange(LAYERS_DEGREE) + 1)
    lit = associated_legendre(sun[2:3], LAYERS_DEGREE)[..., 0] * np.where(np.arange(LAYERS_DEGREE) > 0, 2, 1)[:, None]
    strength = np.abs(lit).max(axis=1) * (beam.max() > 0)
    modes = max(1, int(np.flatnonzero(strength > _FAINT)[-1:].sum()) + 1)
    lit = lit[:modes]
    harmonics = associated_legendre(np.concatenate([mu, -mu]), modes)
    streams = _Streams(mu, weight[: len(mu)], harmonics, 0.5 * np.swapaxes(harmonics, 1, 2) * weight[:, None])
    depth = 0.5 * (extinction[1:] + extinction[:-1]) * np.diff(levels_m)
    per_depth = _per_depth(extinction, weighted)
    radiance = _radiance(depth, per_depth, beam, streams, lit, albedo, direct)
    light = np.einsum("mkj,mjl->mkl", radiance, streams.receive) + lit[:, None] * beam[None, :, None]
    half = 0.5 * mu * streams.weight
    return Layers(
        light, weighted, sun, float(half @ radiance[0, 0, : len(mu)]), float(half @ radiance[0, nz - 1, len(mu) :])
    )


def _per_depth(extinction: F64, scattering: F64) -> tuple[F64, F64]:
    """What cells (nz - 1, M) scatter per optical depth at their lower and upper ends, linear in depth between.

    Their mean is that of the scattering over that of the extinction: where cloud ends in vacuum, or in air, most of the
    cell's depth is the cloud's.
    """
    own = np.divide(scattering, extinction[:, None], out=np.zeros_like(scattering), where=extinction[:, None] > 0)
    low, high = extinction[:-1, None], extinction[1:, None]
    total = np.maximum(low + high, 1e-300)
    mean = (scattering[:-1] + scattering[1:]) / total
    alike = np.minimum(low, high) / np.maximum(np.maximum(low, high), 1e-300)
    half = 0.5 * alike * (own[1:] - own[:-1])
    return mean - half, mean + half


def _radiance(
    depth: F64, per_depth: tuple[F64, F64], beam: F64, streams: _Streams, lit: F64, albedo: float, direct: float
) -> F64:
    """Diffuse radiance (modes, nz, 2N), light that comes down first: elimination from the top, then back."""
    mu, _, harmonics, receive = streams
    n, nz, modes = len(mu), len(depth) + 1, len(lit)
    # at each level down = above @ up + above_const, and up = through @ up of the next lower level + through_const
    above, above_const = np.zeros((nz, modes, n, n)), np.zeros((nz, modes, n))
    through, through_const = np.empty((nz, modes, n, n)), np.empty((nz, modes, n))
    identity = np.eye(2 * n)
    lower = None
    for k in range(nz - 2, -1, -1):
        low, high = per_depth[0][k], per_depth[1][k]
        if lower is None or not np.array_equal(high, per_depth[0][k + 1]):
            lower = _scattered(high, harmonics, receive)
        upper, lower = lower, lower if np.array_equal(low, high) else _scattered(low, harmonics, receive)
        upper_beam = _scattered_beam(high, harmonics, lit, beam[k + 1])
        lower_beam = _scattered_beam(low, harmonics, lit, beam[k])
        t, far, near = _step(depth[k] / mu)
        # unknown are what comes down at the lower level and what goes up at the upper one; given is what goes up below
        rows_far, rows_near = np.concatenate([far, near]), np.concatenate([near, far])  # weights of upper and lower
        up_there = upper[:, :, :n] @ above[k + 1] + upper[:, :, n:]  # scattered per upward radiance
        matrix = np.broadcast_to(identity, (modes, 2 * n, 2 * n)).copy()
        matrix[:, :, :n] -= rows_near[:, None] * lower[:, :, :n]
        matrix[:, :, n:] -= rows_far[:, None] * up_there
        matrix[:, :n, n:] -= t[:, None] * above[k + 1]
        given = np.empty((modes, 2 * n, n + 1))
        given[:, :, :n] = rows_near[:, None] * lower[:, :, n:]
        given[:, n:, :n] += np.diag(t)
        constant = upper_beam + np.einsum("mij,mj->mi", upper[:, :, :n], above_const[k + 1])
        given[:, :, n] = rows_far * constant + rows_near * lower_beam
        given[:, :n, n] += t * above_const[k + 1]
        solved = np.linalg.solve(matrix, given)
        above[k], above_const[k] = solved[:, :n, :n], solved[:, :n, n]
        through[k + 1], through_const[k + 1] = solved[:, n:, :n], solved[:, n:, n]
    flux = 0.5 * mu * streams.weight
    up = np.zeros((modes, n))
    returned = np.eye(n) - 4 * albedo * (flux @ above[0, 0])
    up[0] = np.linalg.solve(returned, np.full(n, 4 * albedo * (direct + flux @ above_const[0, 0])))
    radiance = np.empty((modes, nz, 2 * n))
    for k in range(nz):
        if k > 0:
            up = np.einsum("mij,mj->mi", through[k], up) + through_const[k]
        radiance[:, k, :n] = np.einsum("mij,mj->mi", above[k], up) + above_const[k]
        radiance[:, k, n:] = up
    return radiance


def _scattered(per_depth: F64, harmonics: F64, receive: F64) -> F64:
    """Source per radiance (modes, 2N, 2N)."""
    return np.asarray((np.swapaxes(harmonics, 1, 2) * per_depth) @ np.swapaxes(receive, 1, 2))


def _scattered_beam(per_depth: F64, harmonics: F64, lit: F64, beam: float) -> F64:
    """Source of the beam (modes, 2N)."""
    return np.asarray(beam * np.einsum("mlj,ml->mj", harmonics, lit * per_depth))


def _step(x: F64) -> tuple[F64, F64, F64]:
    """Transmission, and the shares of the source at the far and the near end, of steps of depth x."""
    t = np.exp(-x)
    mean = np.where(x > 1e-6, -np.expm1(-x) / np.maximum(x, 1e-300), 1 - 0.5 * x)
    near = np.where(x > 1e-3, 1 - mean, x * (0.5 - x * (1 / 6 - x / 24)))
    far = np.where(x > 1e-3, mean - t, x * (0.5 - x * (1 / 3 - x / 8)))
    return t, far, near
