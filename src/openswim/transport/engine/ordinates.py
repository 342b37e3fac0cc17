"""Directions and weights of the discrete ordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.scalar import harmonics

Array = NDArray[np.float64]

# Lebedev & Laikov (1999): orbits of the octahedral group as (generating point, weight), weights sum to 1
_R11 = 11**-0.5


def _two_alike(a: float) -> tuple[float, float, float]:
    return a, a, (1 - 2 * a * a) ** 0.5


_LEBEDEV = {
    14: [((1, 0, 0), 1 / 15), ((3**-0.5,) * 3, 3 / 40)],
    26: [((1, 0, 0), 1 / 21), ((2**-0.5, 2**-0.5, 0), 4 / 105), ((3**-0.5,) * 3, 9 / 280)],
    50: [
        ((1, 0, 0), 4 / 315),
        ((2**-0.5, 2**-0.5, 0), 64 / 2835),
        ((3**-0.5,) * 3, 27 / 1280),
        ((_R11, _R11, 3 * _R11), 14641 / 725760),
    ],
    110: [
        ((1, 0, 0), 0.003828270494937162),
        ((3**-0.5,) * 3, 0.009793737512487512),
        (_two_alike(0.1851156353447362), 0.008211737283191111),
        (_two_alike(0.6904210483822922), 0.009942814891178103),
        (_two_alike(0.3956894730559419), 0.009595471336070963),
        ((0.4783690288121502, (1 - 0.4783690288121502**2) ** 0.5, 0), 0.009694996361663028),
    ],
}
_FLAT = {26: (3, 7), 50: (4, 9), 110: (5, 11)}  # rules of `double_gauss` about as large


LEVEL = 1e-6  # least |z| of an ordinate that is not level


class Ordinates(NamedTuple):
    """Unit vectors ``direction`` (n, 3) toward the light's origin, and ``weight`` (n,), summing to 4 pi."""

    direction: Array
    weight: Array


def ordinates_for(
    cell_m: tuple[float, float], levels_m: Array, count: int = 50, endless: bool = False
) -> Ordinates:  # fmt: skip
    """Lebedev's rule of ``count`` ordinates in cells about as high as wide; flat ones: exact for fluxes.

    Lebedev's level ordinates stand for a seventh of all directions. In a layer without sides they see an endless path,
    and a thin layer then looks too bright at grazing angles; so does the air of a period (``endless``).
    """
    flat = min(cell_m) / float(np.median(np.diff(levels_m)))
    if flat > 1e3:
        return double_gauss(6, 10)
    return double_gauss(*_FLAT[count]) if flat > 5 or endless else lebedev(count)


def double_gauss(mu_count: int, azimuth_count: int) -> Ordinates:
    """Gauss-Legendre in the cosine of each hemisphere, even azimuths: exact half-range fluxes, none level."""
    g, w = np.polynomial.legendre.leggauss(mu_count)
    mu = np.concatenate([(g + 1) / 2, -(g + 1) / 2])
    phi = (np.arange(azimuth_count) + 0.25) * 2 * np.pi / azimuth_count
    m, p = np.meshgrid(mu, phi, indexing="ij")
    sine = np.sqrt(1 - m**2)
    direction = np.stack([sine * np.cos(p), sine * np.sin(p), m], axis=-1).reshape(-1, 3)
    return Ordinates(direction, np.repeat(np.concatenate([w, w]) / 2, azimuth_count) * 2 * np.pi / azimuth_count)


def lebedev(count: int) -> Ordinates:
    """The Lebedev rule of 14, 26, 50 or 110 points."""
    points, weights = [], []
    for generator, weight in _LEBEDEV[count]:
        permutations = {
            (generator[i], generator[j], generator[3 - i - j]) for i in range(3) for j in range(3) if i != j
        }
        orbit = {
            (sx * p[0] + 0.0, sy * p[1] + 0.0, sz * p[2] + 0.0)
            for p in permutations
            for sx in (1, -1)
            for sy in (1, -1)
            for sz in (1, -1)
        }
        points += sorted(orbit)
        weights += [4 * np.pi * weight] * len(orbit)
    return Ordinates(np.array(points, float), np.array(weights))


def level_zone(ordinates: Ordinates) -> float:
    """Up to which |z| level ordinates stand for all directions: as much of the sphere as they have weight."""
    level = np.abs(ordinates.direction[:, 2]) < LEVEL
    return float(ordinates.weight[level].sum()) / (4 * np.pi)


def harmonic_matrix(directions: Array, degree: int) -> Array:
    """Y[n, l*l + l + m] of unit vectors (n, 3), l < degree."""
    out = np.empty((degree * degree, len(directions)))
    harmonics.py_func(*directions.T, degree, out)  # of all at once: numpy's arithmetic in place of the kernels'
    return out.T


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
