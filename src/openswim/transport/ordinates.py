"""Directions and weights of the discrete ordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.scalar import harmonics

Array = NDArray[np.float64]

# Lebedev & Laikov (1999): orbits of the octahedral group as (generating point, weight), weights sum to 1
_R11 = 11**-0.5
_LEBEDEV = {
    26: [((1, 0, 0), 1 / 21), ((2**-0.5, 2**-0.5, 0), 4 / 105), ((3**-0.5,) * 3, 9 / 280)],
    50: [
        ((1, 0, 0), 4 / 315),
        ((2**-0.5, 2**-0.5, 0), 64 / 2835),
        ((3**-0.5,) * 3, 27 / 1280),
        ((_R11, _R11, 3 * _R11), 14641 / 725760),
    ],
}


def lebedev(count: int) -> tuple[Array, Array]:
    """Unit vectors (count, 3) and weights (count,), summing to 4 pi, of the Lebedev rule of 26 or 50 points."""
    points, weights = [], []
    for generator, weight in _LEBEDEV[count]:
        permutations = {(generator[i], generator[j], generator[3 - i - j]) for i in range(3) for j in range(3) if i != j}
        orbit = {
            (sx * p[0] + 0.0, sy * p[1] + 0.0, sz * p[2] + 0.0)
            for p in permutations
            for sx in (1, -1)
            for sy in (1, -1)
            for sz in (1, -1)
        }
        points += sorted(orbit)
        weights += [4 * np.pi * weight] * len(orbit)
    return np.array(points, float), np.array(weights)


def harmonic_matrix(directions: Array, degree: int) -> Array:
    """Y[n, l*l + l + m] of unit vectors (n, 3), l < degree."""
    out = np.empty((len(directions), degree * degree))
    for row, (x, y, z) in zip(out, directions, strict=True):
        harmonics(x, y, z, degree, row)
    return out


def hemisphere_product(mu_count: int, azimuth_count: int) -> tuple[Array, Array, Array]:
    """Cosines mu, azimuths (rad, 0..pi) and weights of a product rule over the whole sphere.

    Gauss-Legendre separately in the upward and downward half, midpoints in azimuth; for fields even in
    azimuth, the weights count both sides and sum to 4 pi.
    """
    g, w = np.polynomial.legendre.leggauss(mu_count)
    mu = np.concatenate([-(g + 1) / 2, (g + 1) / 2])
    wmu = np.concatenate([w, w]) / 2
    phi = (np.arange(azimuth_count) + 0.5) * np.pi / azimuth_count
    m, p = np.meshgrid(mu, phi, indexing="ij")
    weight = np.repeat(wmu, azimuth_count) * 2 * np.pi / azimuth_count
    return m.ravel(), p.ravel(), weight
