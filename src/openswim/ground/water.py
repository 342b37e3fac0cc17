"""A wind-blown water surface: the sun's glint, the mirrored sky, foam.

`fresnel_reflectance`, `facing`, `glint` and `shadowing` are of arrays here and compiled for one photon in
`transport.montecarlo.ground`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

REFRACTIVE_INDEX = 1.34
FOAM_ALBEDO = 0.22  # effective, foam of all ages (Koepke 1984)
_MOST_FOAM = 0.3
LEAST_MU = 0.01
_MU_NODES = np.linspace(0.0, 1.0, 41)[1:] ** 1.5


def fresnel_reflectance(cos_incidence: Any) -> Any:
    """Reflected share of unpolarised light falling on flat water of index 1.34; .0211 at normal incidence."""
    c = np.minimum(np.maximum(cos_incidence, 0.0), 1.0)
    refracted = np.sqrt(REFRACTIVE_INDEX**2 - 1 + c**2)
    perpendicular = (c - refracted) / (c + refracted)
    parallel = (REFRACTIVE_INDEX**2 * c - refracted) / (REFRACTIVE_INDEX**2 * c + refracted)
    return 0.5 * (perpendicular**2 + parallel**2)


def mean_square_slope(wind_speed_m_s: ArrayLike) -> FloatArray:
    """Total slope variance of clean water by the 10-m wind (Cox & Munk 1954): .003 + .00512 W, W <= 40
    m/s."""
    return 0.003 + 0.00512 * np.clip(np.asarray(wind_speed_m_s, float), 0.0, 40.0)


_VARIANCE_NODES = mean_square_slope([0.0, 1.0, 2.0, 4.0, 7.0, 11.0, 16.0, 24.0, 36.0])  # of these winds, m/s
_KEPT = 0.96  # seen along the sea waves keep so much of azimuth, which is all that matters


def foam_fraction(wind_speed_m_s: ArrayLike) -> FloatArray:
    """Foam cover 2.95e-6 W^3.52 (Monahan & O'Muircheartaigh 1980), within 2 % up to 20 m/s, that levels off at .3.

    Above some 25 m/s whitecaps were seen to remain constant, joined by streaks that merge at 40 m/s (Holthuijsen et al.
    2012); .3 lies between the few per cent of the ones and the thin white-out of the others.
    """
    whitecaps = 2.95e-6 * np.maximum(np.asarray(wind_speed_m_s, float), 0.0) ** 3.52
    return np.asarray(whitecaps / (1 + (whitecaps / _MOST_FOAM) ** 3) ** (1 / 3))


def glint_reflectance(
    mu_sun: ArrayLike, mu_view: ArrayLike, relative_azimuth_rad: ArrayLike, slope_variance: ArrayLike
) -> FloatArray:
    """Bidirectional reflectance factor (n,) of the waves for the direct sun: pi L / E on the horizontal.

    pi F(omega) p(slope) G / (4 mu mu0 cos^4 beta) with the Gaussian slope density p = exp(-tan^2 beta / s^2)
    / (pi s^2), s^2 = slope_variance (Cox & Munk 1954; Albers et al. 2020, section 3.7, corrected: wind,
    normalised density), and G the shadowing of waves by waves (Smith 1967). Wind direction is not used.
    Reciprocal; mu not below .01. Light that meets a second wave is left out: of the reflected flux .1 % at
    sun zenith 40, 6 % at 55 and 16 % at 65 degrees in 8 m/s wind, below 3 % there in 3 m/s.
    """
    mu0 = np.maximum(np.asarray(mu_sun, float), LEAST_MU)
    mu = np.maximum(np.asarray(mu_view, float), LEAST_MU)
    sines = np.sqrt((1 - np.minimum(mu0, 1) ** 2) * (1 - np.minimum(mu, 1) ** 2))
    cos_omega, cos_beta = facing(mu0, mu, mu * mu0 + sines * np.cos(relative_azimuth_rad))
    variance = np.asarray(slope_variance, float)
    hidden = shadowing(mu, variance) + shadowing(mu0, variance)
    return np.asarray(glint(mu0, mu, cos_beta, fresnel_reflectance(cos_omega), hidden, variance))


def facing(mu0: Any, mu: Any, cos_angle: Any) -> tuple[Any, Any]:
    """Cosines of the angle of incidence on facets that mirror the sun to the eye, ``cos_angle`` apart, and of their
    tilt."""
    cos_omega = np.sqrt(0.5 * (1 + np.minimum(np.maximum(cos_angle, -1.0), 1.0)))
    return cos_omega, np.minimum((mu + mu0) / np.maximum(2 * cos_omega, 1e-9), 1.0)


def glint(mu0: Any, mu: Any, cos_beta: Any, mirrored: Any, hidden: Any, variance: Any) -> Any:
    """`glint_reflectance` of facets that reflect the share ``mirrored``; ``hidden``: both ways' `shadowing`, summed."""
    density = np.exp(-(cos_beta**-2 - 1) / variance) / (np.pi * variance)
    return np.pi * mirrored * density / (1 + hidden) / (4 * mu * mu0 * cos_beta**4)


def mirrored_sky(mu_view: ArrayLike, slope_variance: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Reflectance of the waves seen along `mu_view` (n,), the mean mu of the sky they mirror, and how much of what
    this differs with azimuth they keep: nothing seen straight down, where facets on all sides mirror the sky all round.

    Averages over the facets that face the viewer, of slopes that are Gaussian; near the horizon a sea under
    5 m/s wind mirrors the sky 12 degrees up with half of flat water's reflectance.
    """
    tables = _mirror_tables()
    mu = np.clip(np.asarray(mu_view, float), 0.0, 1.0)
    i = np.interp(mu, _MU_NODES, np.arange(_MU_NODES.size))
    k = np.interp(np.asarray(slope_variance, float), _VARIANCE_NODES, np.arange(_VARIANCE_NODES.size))
    i0 = np.minimum(i.astype(int), _MU_NODES.size - 2)
    k0 = np.minimum(k.astype(int), _VARIANCE_NODES.size - 2)
    fi, fk = i - i0, k - k0
    value = (1 - fk) * ((1 - fi) * tables[:, k0, i0] + fi * tables[:, k0, i0 + 1]) + fk * (
        (1 - fi) * tables[:, k0 + 1, i0] + fi * tables[:, k0 + 1, i0 + 1]
    )
    kept = value[2] * np.sqrt((1 - mu**2) / np.maximum(1 - value[1] ** 2, 1e-6))
    return value[0], value[1], np.clip(kept / _KEPT, 0.0, 1.0)


def isotropic_sky_albedo(slope_variance: ArrayLike) -> FloatArray:
    """Share of an isotropic sky's flux that the waves reflect (n,): .066 calm, .05 in a gale."""
    reflectance = _mirror_tables()[0]
    albedo = 2 * np.trapezoid(reflectance * _MU_NODES, _MU_NODES, axis=1)
    return np.interp(np.asarray(slope_variance, float), _VARIANCE_NODES, albedo)


@cache
def _mirror_tables() -> FloatArray:
    """(reflectance, mean mirrored mu, how far mirrored ways lead on across, over what the view's do) on nodes of (slope
    variance, mu).

    Facets weigh by their slope density and the area they show, max(cos omega, 0) / cos beta, and by what of their light
    comes past a second wave (`returned`); that from below the horizon counts as from just above it.
    """
    u = (np.arange(80) + 0.5) / 80  # slope tan(beta) = s sqrt(-ln(1 - u)): equal shares of the density
    azimuth = (np.arange(48) + 0.5) * 2 * np.pi / 48
    tables = np.empty((3, _VARIANCE_NODES.size, _MU_NODES.size))
    mu = _MU_NODES[:, None, None]
    sine = np.sqrt(1 - mu**2)
    for k, variance in enumerate(_VARIANCE_NODES):
        slope = np.sqrt(-variance * np.log1p(-u))[None, :, None]
        shown = mu - slope * sine * np.cos(azimuth)  # cos omega / cos beta
        cos_beta = 1 / np.sqrt(1 + slope**2)
        weight = np.maximum(shown, 0.0)
        cos_omega = np.minimum(weight * cos_beta, 1.0)
        sky_mu = 2 * cos_omega * cos_beta - mu
        mirrored = weight * fresnel_reflectance(cos_omega) * returned(sky_mu, mu, variance)
        reflected = mirrored.sum(axis=(1, 2))
        tables[0, k] = reflected / weight.sum(axis=(1, 2))
        tables[1, k] = (mirrored * np.maximum(sky_mu, LEAST_MU)).sum(axis=(1, 2)) / reflected
        away = sine + 2 * cos_omega * cos_beta * slope * np.cos(azimuth)
        tables[2, k] = (mirrored * away).sum(axis=(1, 2)) / (reflected * np.maximum(sine[:, 0, 0], 1e-6))
    tables[2, :, -1] = tables[2, :, -2]  # straight down nothing leads on
    return tables


def returned(mu_sky: Any, mu_view: Any, variance: Any) -> Any:
    """Share of what facets seen along a cosine mirror of the sky at another, if a second wave may be in the way.

    Facets that see this sky: Smith's (1967) shadowing of both ways over that of the view's. The light of the others
    meets a wave that stands up to it, on the mean of Gaussian slopes at a cosine of .886 s, and is mirrored once more.
    """
    seen = 1 + shadowing(np.maximum(mu_view, LEAST_MU), variance)
    free = (mu_sky > 0) * seen / (seen + shadowing(np.maximum(mu_sky, LEAST_MU), variance))
    return free + (1 - free) * fresnel_reflectance(0.5 * np.sqrt(np.pi * variance))


def shadowing(mu: Any, variance: Any) -> Any:
    """Smith's Lambda for Gaussian slopes, by a rational fit (Walter et al. 2007; .35 %)."""
    tangent = np.sqrt(np.maximum(1 - mu**2, 0.0)) / mu
    a = np.minimum(1 / np.maximum(np.sqrt(variance) * tangent, 1e-9), 1.6)
    return ((1 + 2.276 * a + 2.577 * a**2) / (3.535 * a + 2.181 * a**2) - 1) * (a < 1.6)
