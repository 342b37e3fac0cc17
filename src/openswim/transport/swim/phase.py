"""Effective phase functions of `swim`: Albers et al. 2020, Eqs 9-10, 16-20, 25 and B1-B3, as corrected.

All take cosines as arrays and have a mean of 1 over the sphere, unless said otherwise. s = max(tau_o, 1).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.optics import OpticalSpecies
from openswim.scene.phase import AlbersDHG, PhaseFunction

F64 = NDArray[np.float64]

_SUNLIT_CAP = 12.0
_BROADENED_ANGLES = 361
_BROADENED_DEPTHS = np.array([1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.5, 8.0, 10.0, 13.0, 16.0, 20.0, 26.0, 32.0])
_MOST_MOMENTS = 900
_SMOOTH_DEGREE = 300.0
_PAPER_KINDS = ("liquid", "rain", "ice", "snow", "graupel")
_ANISOTROPY_PHASE = AlbersDHG(0.7, 0.4)  # the water cloud of Eq. 25


def henyey_greenstein(mu: F64, g: ArrayLike) -> F64:
    """Eq. 9."""
    g = np.asarray(g, float)
    return (1 - g**2) / np.maximum(1 + g**2 - 2 * g * mu, 1e-12) ** 1.5


def thin_phase(kind: str, mu: F64, s: F64, wavelength_nm: float) -> F64:
    """Effective phase function of optically thin cloud (Eqs 10, 16-18, B1-B3, corrected); graupel has none: ice."""
    p = henyey_greenstein
    if kind == "rain":  # B1
        return 0.1 * p(mu, 0.99**s) + 1.05 * p(mu, 0.75**s) - 0.35 + 0.20 * p(mu, -0.2)
    if kind in ("ice", "graupel"):  # B2
        sharp = 0.5 * 2.0 ** (1 - s)
        return sharp * p(mu, 0.999**s) + (1 - sharp - 0.22) * p(mu, 0.86**s) + 0.20 + 0.02 * p(mu, -0.6)
    if kind == "snow":  # B3
        return 0.50 * p(mu, 0.999**s) + 0.45 * p(mu, 0.86**s) + 0.03 + 0.02 * p(mu, -0.6)
    g = np.interp(wavelength_nm, [450.0, 546.0, 615.0], [0.955, 0.950, 0.945])  # Eq. 16
    f1 = 0.8**s  # Eq. 17
    return f1 * p(mu, g**s) + (1.06 - f1) * p(mu, 0.6**s) + 0.02 * p(mu, -0.6) - 0.08  # Eq. 18


@lru_cache(maxsize=64)
def _broadened_table(phase: PhaseFunction) -> F64:
    """Phase function with moments chi_l^s on (depth, angle), angles equally spaced in their square root."""
    angle = np.pi * np.linspace(0, 1, _BROADENED_ANGLES) ** 2
    x = np.cos(angle)
    chi = np.clip(phase.moments(_MOST_MOMENTS), 0, 1)
    degree = np.arange(_MOST_MOMENTS)
    smooth = np.exp(-((degree / _SMOOTH_DEGREE) ** 2))  # by a quarter of a degree: pristine ice's series does not end
    powers = np.array([(2 * degree + 1) * smooth * chi**s for s in _BROADENED_DEPTHS])
    table = np.zeros((len(_BROADENED_DEPTHS), len(x)))
    before, now = np.zeros_like(x), np.ones_like(x)
    for ell in range(_MOST_MOMENTS):
        table += powers[:, ell, None] * now
        before, now = now, ((2 * ell + 1) * x * now - ell * before) / (ell + 1)
    table[0] = phase.value(x)
    return np.maximum(table, 1e-3)


def broadened(phase: PhaseFunction, mu: F64, s: F64) -> F64:
    """What a phase function becomes when it has acted s times: its moments to the power s.

    For Henyey-Greenstein this is p(theta, g^s), which Eqs 18 and B1-B3 are made of; here for any phase function.
    """
    table = _broadened_table(phase)
    angle = np.arccos(np.clip(mu, -1, 1))
    x = np.sqrt(angle / np.pi) * (_BROADENED_ANGLES - 1)
    i = np.minimum(x.astype(int), _BROADENED_ANGLES - 2)
    y = np.interp(s, _BROADENED_DEPTHS, np.arange(len(_BROADENED_DEPTHS), dtype=float))
    k = np.minimum(y.astype(int), len(_BROADENED_DEPTHS) - 2)
    a, c = x - i, y - k
    low = table[k, i] * (1 - a) + table[k, i + 1] * a
    high = table[k + 1, i] * (1 - a) + table[k + 1, i + 1] * a
    return np.asarray(low ** (1 - c) * high**c)


def sunlit_phase(mu: F64) -> F64:
    """P_thick,h: brightness of the sunlit side of a thick cloud, after the planet Venus, 1.94 at full phase (Eq. 19).

    m is Mallama's magnitude relative to full phase (the paper gives none); capped near the sun, where the lit crescent
    becomes infinitely thin.
    """
    a = np.degrees(np.pi - np.arccos(np.clip(mu, -1, 1)))  # phase angle
    m = np.where(
        a < 163.7,
        a * (-1.044e-3 + a * (3.687e-4 + a * (-2.814e-6 + a * 8.938e-9))),
        240.442 - 2.81914 * a + 8.39034e-3 * a**2,
    )
    return np.minimum(1.94 / 10 ** (0.4 * m) / np.maximum((1 - mu) / 2, 1e-3), _SUNLIT_CAP)


def shaded_phase(cos_z: F64) -> F64:
    """P_thick,l: brightness of a thick cloud that light leaks through, z the zenith angle of the ray (Eq. 20)."""
    return (1 + 2 * np.clip(cos_z, 0, 1)) / 3


def anisotropy(mu: F64, cos_z: F64, mu0: F64) -> F64:
    """Anisotropic reflectance factor of a thick cloud seen from above (Eq. 25, denominator after Kokhanovsky 2004)."""
    return (1.48 + 7.76 * cos_z * mu0 + _ANISOTROPY_PHASE.value(mu)) / (4 * (cos_z + mu0))


def thin_phases(
    species: list[OpticalSpecies], shares: F64, mu: F64, s: F64, w: int, wavelength_nm: float, paper: bool
) -> F64:
    """P_thin of a mixture, interpolated by the species' ``shares`` (ns, n) of the scattering (Eq. 13, Appendix B).

    By default the species' own phase functions, broadened; with ``paper`` Eqs 18 and B1-B3 for cloud and rain.
    """
    out = np.zeros_like(mu)
    for share, one in zip(shares, species, strict=True):
        if paper and one.kind in _PAPER_KINDS:
            out += share * thin_phase(one.kind, mu, s, wavelength_nm)
        else:
            out += share * broadened(one.phase[w], mu, s)
    return out
