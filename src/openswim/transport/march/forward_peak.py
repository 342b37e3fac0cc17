"""The forward peak that delta scaling takes out of the phase function, broadened by repeated scattering.

docs/fast.md, F17: with f = max(chi_M, 0) and r_l = f (l < M), chi_l above, light that meets the forward depth phi on
its way from the sun to a point and on to the eye is scattered there by what truncation leaves of the phase function,
R(Theta, phi) = sum_l (2l+1) r_l (exp(-phi (1 - p_l)) - exp(-phi))/(p_l phi) P_l(cos Theta), p_l = min(r_l/f, 1).
Of n narrow scatterings each is as likely the one at the point: that is the 1/(p phi). See
docs/decisions/0029-peaks-on-both-ways.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from openswim.scene.phase import PhaseFunction
from openswim.transport.engine.compiled import kernel
from openswim.transport.engine.types import FLOAT

Array = NDArray[np.float64]

_ANGLES = 3601
_BEND = 1 / 24  # of the tables' angles: see `angles`
_DEPTHS = 32
_MOST_MOMENTS = 900
_NO_PEAK = 1e-6
# ice has a peak so narrow that its moments do not end here: cut off, they would draw rings .4 degrees apart
_TAPER = np.exp(-12.0 * (np.arange(_MOST_MOMENTS) / _MOST_MOMENTS) ** 4)


def _legendre(x: Array, count: int) -> Array:
    """P_l(x), (count, n)."""
    out = np.empty((count, len(x)))
    out[0], out[1] = 1, x
    for ell in range(1, count - 1):
        out[ell + 1] = ((2 * ell + 1) * x * out[ell] - ell * out[ell - 1]) / (ell + 1)
    return out


def forward_share(moments: Array, degree: int) -> Array:
    """f of Legendre moments (..., l): what delta scaling counts as not scattered; 0 where there is no forward peak."""
    return np.maximum(moments[..., degree], 0.0)


def angles() -> Array:
    """The tables' scattering angles (n,), pi (1 + c) u^2/(u + c) of an even u from 0 to 1: .0003 degrees apart in the
    peak, .05 where bows, halos and the glory are. `peak_row` is the inverse."""
    u = np.arange(_ANGLES) / (_ANGLES - 1)
    return np.pi * (1 + _BEND) * u**2 / (u + _BEND)


@kernel()
def peak_row(angle, count):
    """Fractional row of the forward peaks' tables, of ``count`` rows, at an angle: see `angles`."""
    half = angle / (2.0 * math.pi * (1.0 + _BEND))
    return (half + math.sqrt(half * (half + 2.0 * _BEND))) * (count - 1)


@lru_cache(maxsize=1)
def _basis() -> tuple[Array, Array]:
    """cos(angle) (n,) and Legendre polynomials (l, n) of the tables' angles."""
    x = np.cos(angles())
    return x, _legendre(x, _MOST_MOMENTS)


@lru_cache(maxsize=64)
def peak_table(phase: PhaseFunction, degree: int, smooth: int | None = None) -> NDArray[np.float32]:
    """R (angle, depth): at `angles`, 32 depths at phi/(1 + phi) = j/31. ``smooth``: of how many moments of the
    truncated part the ray knows, if of fewer than ``degree``; the others are in the table, whatever the depth.

    Column 0 (phi = 0) is the exact phase function less its truncated part: the TMS correction (Nakajima & Tanaka
    1988). Without a forward peak it is what all the beam is scattered by.
    """
    moments = phase.moments(_MOST_MOMENTS)
    f = forward_share(moments, degree)
    x, legendre = _basis()
    weight = 2 * np.arange(_MOST_MOMENTS) + 1.0
    low, known = weight[:degree] * (moments[:degree] - f), degree if smooth is None else smooth
    table = np.repeat((phase.value(x) - low[:known] @ legendre[:known])[:, None], _DEPTHS, axis=1)
    if f < _NO_PEAK:
        return table.astype(FLOAT)
    left = moments.copy()
    left[:degree] = f
    p = np.minimum(left / f, 1.0)  # the beam holds no more of a moment than of all its light
    u = np.arange(1, _DEPTHS) / (_DEPTHS - 1)
    phi = np.where(u < 1, u / np.maximum(1 - u, 1e-9), 1e6)[:, None]
    met = phi * p
    size = np.maximum(np.abs(met), 1e-12)
    growth = np.exp(np.maximum(met, 0) - phi) * -np.expm1(-size) / size
    # less exp(-phi), the share that met nothing else: converges twice as fast as the peak itself
    growth = (growth - np.exp(-phi)) * _TAPER
    rest = (low[known:] @ legendre[known:degree])[:, None]
    table[:, 1:] = rest + (table[:, :1] - rest) * np.exp(-phi[:, 0]) + legendre.T @ (weight * left * growth).T
    return table.astype(FLOAT)


def blunted(tables: NDArray[np.float32], angle_deg: float) -> NDArray[np.float32]:
    """`peak_tables` no higher within an angle of the sun than at it."""
    first = round(peak_row(np.radians(angle_deg), tables.shape[1]))
    out = tables.copy()
    out[:, :first] = out[:, first : first + 1]
    return out


def peak_tables(phases: Sequence[Sequence[PhaseFunction]], degree: int) -> NDArray[np.float32]:
    """Stacked tables (scatterer, angle, depth, wavelength) for the kernels."""
    return np.stack([np.stack([peak_table(p, degree) for p in row], axis=-1) for row in phases])
