"""Scattering by large particles of irregular shape, after Pollack & Cuzzi (1980, J. Atmos. Sci. 37, 868).

Spheres have a bow and a glory, dust has not: Mie theory makes its backscatter several times too strong. Above a size
parameter of a few, the light is split as they do: diffraction, reflection from outside, and the rest, which leaves
with exp(-b angle). Where they fit b to measurements, here it follows from Mie theory's asymmetry factor for the equal
sphere, which shape changes little (Dubovik et al. 2006: .01-.03); extinction and absorption stay the sphere's. A part
of the rest leaves in all directions alike (`DIFFUSE`), so that phase functions level off beyond 120 degrees as those
measured on dust do (Volten et al. 2001), and the lidar ratio is dust's 50-60 sr (Mueller et al. 2007).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BLEND_FROM, BLEND_TO = 3.0, 8.0  # size parameters between which spheres turn irregular
DIFFUSE = 0.3
_THETA = np.linspace(0.0, np.pi, 4001)


def share(size_parameter: float) -> float:
    """Share of irregular particles: 0 below a size parameter of 3, 1 above 8."""
    return float(np.clip(np.log(size_parameter / BLEND_FROM) / np.log(BLEND_TO / BLEND_FROM), 0.0, 1.0))


def irregular_value(
    mu: FloatArray, size_parameter: float, refractive_index: complex, scattering: float, asymmetry: float
) -> FloatArray:
    """Phase function (mean 1) at `mu`; `scattering`, `asymmetry`: efficiency and g of the equal sphere."""
    outside = _mean(fresnel_reflectance(_THETA, refractive_index))
    rest = max(scattering - 1.0 - outside, 0.05)
    diffracted, reflected = _diffraction(_THETA, size_parameter), fresnel_reflectance(_THETA, refractive_index)
    norm = _mean(diffracted)
    g_diffracted = _mean(diffracted * np.cos(_THETA)) / norm
    g_rest = (scattering * asymmetry - g_diffracted - _mean(reflected * np.cos(_THETA))) / rest
    theta = np.arccos(np.clip(mu, -1.0, 1.0))
    total = (
        _diffraction(theta, size_parameter) / norm
        + fresnel_reflectance(theta, refractive_index)
        + rest * (DIFFUSE + (1 - DIFFUSE) * exponential(theta, g_rest / (1 - DIFFUSE)))
    )
    return total / (1.0 + outside + rest)


def fresnel_reflectance(theta: FloatArray, refractive_index: complex) -> FloatArray:
    """Share of unpolarised light that a convex particle's surface reflects toward the scattering angle theta."""
    cosine = np.sin(0.5 * theta).astype(complex)  # of the angle of incidence, (pi - theta)/2
    square = refractive_index**2
    inside = np.sqrt(square - 1 + cosine**2)
    across = (cosine - inside) / (cosine + inside)
    along = (square * cosine - inside) / (square * cosine + inside)
    return np.asarray(0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2))


def exponential(theta: FloatArray, asymmetry: float) -> FloatArray:
    """c exp(-b theta) with a mean of 1 and a mean cosine of `asymmetry` (kept within 0 and .95)."""
    steepness = np.linspace(0.0, 12.0, 601)
    fade = np.exp(-steepness * np.pi)
    g = (1 - fade) * (1 + steepness**2) / ((1 + fade) * (4 + steepness**2))
    b = float(np.interp(asymmetry, g, steepness))
    return np.asarray(2 * (1 + b**2) / (1 + np.exp(-b * np.pi)) * np.exp(-b * theta))


def _diffraction(theta: FloatArray, x: float) -> FloatArray:
    """Light diffracted by a disc of size parameter x (Airy), with the obliquity factor; unscaled."""
    from scipy.special import j1

    z = np.maximum(x * np.sin(theta), 1e-9)
    return np.asarray((x * 2 * j1(z) / z * 0.5 * (1 + np.cos(theta))) ** 2)


def _mean(value: FloatArray) -> float:
    return float(0.5 * np.trapezoid(value * np.sin(_THETA), _THETA))
