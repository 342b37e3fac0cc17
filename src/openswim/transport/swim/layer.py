"""Layers of cloud and aerosol as a whole: albedo and absorption (Albers et al. 2020, Eqs 24, 30-31, as corrected)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]

_LEAST_MU = 0.02


def layer_albedo(backscatter_depth: F64) -> F64:
    """Eq. 24, b tau/(1 + b tau), with the slant depth of the sun's way; summed over species (sum of b_i tau_i)."""
    return backscatter_depth / (1 + backscatter_depth)


def diffuse_albedo(backscatter_depth: F64) -> F64:
    """The same for diffuse light: the two streams' 3/4 (1 - g) tau, which is 1.5 b tau for b = (1 - g)/2."""
    return layer_albedo(1.5 * backscatter_depth)


def two_stream(omega: ArrayLike, g: ArrayLike, tau: ArrayLike, mu0: ArrayLike) -> tuple[F64, F64]:
    """Reflectance and transmittance of a layer of vertical depth ``tau`` for the sun's beam, over black ground.

    Delta-Eddington (Joseph et al. 1976; Meador & Weaver 1980): within .05 of DISORT; its ratios to the conservative
    layer's, which is all they are used for, within 6 %.
    """
    w, gg, depth, mu = np.broadcast_arrays(*(np.asarray(x, float) for x in (omega, g, tau, mu0)))
    w, mu = np.minimum(w, 1 - 1e-7), np.clip(mu, _LEAST_MU, 1)
    f = gg**2
    t = (1 - w * f) * depth
    o = (1 - f) * w / (1 - w * f)
    gp = gg / (1 + gg)
    g1, g2, g3 = (7 - o * (4 + 3 * gp)) / 4, -(1 - o * (4 - 3 * gp)) / 4, (2 - 3 * gp * mu) / 4
    k = np.sqrt(np.maximum(g1**2 - g2**2, 1e-12))
    a1, a2 = g1 * (1 - g3) + g2 * g3, g1 * g3 + g2 * (1 - g3)
    q = 1 - (k * mu) ** 2
    q = np.where(np.abs(q) < 1e-4, 1e-4, q)
    far, beam, way = np.exp(-2 * k * t), np.exp(-t / mu), np.exp(-k * t)
    scale = o / (q * ((k + g1) + (k - g1) * far))
    reflected = scale * (
        (1 - k * mu) * (a2 + k * g3) - (1 + k * mu) * (a2 - k * g3) * far - 2 * k * (g3 - a2 * mu) * beam * way
    )
    back = 1 - g3
    lost = (1 + k * mu) * (a1 + k * back) - (1 - k * mu) * (a1 - k * back) * far
    transmitted = beam - scale * (lost * beam - 2 * k * (back + a1 * mu) * way)
    return np.clip(reflected, 0, 1), np.clip(transmitted, 0, 1)


def multiple_scattering_albedo(omega: ArrayLike, g: ArrayLike, tau: ArrayLike, mu0: ArrayLike) -> F64:
    """omega' of Eq. 31: what absorption leaves of the light that a layer reflects.

    The paper leaves it open; here the ratio of the two-stream reflectances with and without absorption. It tends to
    omega for thin layers, which is Eq. 30.
    """
    return two_stream(omega, g, tau, mu0)[0] / np.maximum(two_stream(1.0, g, tau, mu0)[0], 1e-12)


def absorbed_transmittance(omega: ArrayLike, g: ArrayLike, tau: ArrayLike, mu0: ArrayLike) -> F64:
    """What absorption leaves of the light that a layer lets through: the same for the other side."""
    return two_stream(omega, g, tau, mu0)[1] / np.maximum(two_stream(1.0, g, tau, mu0)[1], 1e-12)
