"""How the ground reflects: sun and sky in, radiance toward the viewer out.

The relative azimuth is the angle between the horizontal directions from the surface to the viewer and to the
sun: 0 with the viewer on the sun's side (hot spot), pi opposite (glint). `land_shape`, `snow_shape` and
`cos_phase_angle` are of arrays here and compiled for one photon in `transport.montecarlo.ground`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground import spectra, water
from openswim.ground.sample import SurfaceSample

FloatArray = NDArray[np.float64]
SkyRadiance = Callable[[NDArray[np.int64], FloatArray, FloatArray], FloatArray]

LEAST_MU = 0.05  # the models diverge at grazing sun and view


def bidirectional_reflectance(
    sample: SurfaceSample,
    mu_sun: ArrayLike,
    mu_view: ArrayLike,
    relative_azimuth_rad: ArrayLike,
    wavelengths_nm: ArrayLike,
) -> FloatArray:
    """Reflectance factor pi L / E (n, nwl) for the direct sun; E on the horizontal surface.

    Land: albedo times an anisotropic reflectance factor with a hot spot; snow: one that peaks forward;
    both are reciprocal and keep the albedo for every sun height (within 2e-3). Water: glint, foam and water-leaving
    light.
    """
    mu_sun, mu_view, azimuth = _per_place(sample, mu_sun, mu_view, relative_azimuth_rad)
    if sample.lambertian:
        return sample.albedo.copy()
    factor = land_factor(mu_sun, mu_view, azimuth)
    snowy = np.flatnonzero(sample.snow > 0)
    if snowy.size:
        white = snow_factor(mu_sun[snowy], mu_view[snowy], azimuth[snowy])
        factor[snowy] += sample.snow[snowy] * (white - factor[snowy])
    out = ((1 - sample.water) * factor)[:, None] * sample.albedo
    wet = np.flatnonzero(sample.water > 0)
    if wet.size:
        some = sample[wet]
        foam = water.foam_fraction(some.wind_speed)
        glint = (1 - foam) * water.glint_reflectance(mu_sun[wet], mu_view[wet], azimuth[wet], some.slope_variance)
        out[wet] += some.water[:, None] * (glint[:, None] + _water_body(some, foam, wavelengths_nm))
    return out


def diffuse_reflectance(sample: SurfaceSample, mu_view: ArrayLike, wavelengths_nm: ArrayLike) -> FloatArray:
    """Reflectance pi L / E (n, nwl) toward `mu_view` under an isotropic sky."""
    (mu_view,) = _per_place(sample, mu_view)
    if sample.lambertian:
        return sample.albedo.copy()
    foam = water.foam_fraction(sample.wind_speed)
    mirror, *_ = water.mirrored_sky(mu_view, sample.slope_variance)
    wet = ((1 - foam) * mirror)[:, None] + _water_body(sample, foam, wavelengths_nm)
    return sample.albedo + sample.water[:, None] * (wet - sample.albedo)


def hemispherical_albedo(sample: SurfaceSample, wavelengths_nm: ArrayLike) -> FloatArray:
    """Albedo (n, nwl) for an isotropic sky: the lower boundary of diffuse light."""
    if sample.lambertian:
        return sample.albedo.copy()
    foam = water.foam_fraction(sample.wind_speed)
    mirror = (1 - foam) * water.isotropic_sky_albedo(sample.slope_variance)
    wet = mirror[:, None] + _water_body(sample, foam, wavelengths_nm)
    return sample.albedo + sample.water[:, None] * (wet - sample.albedo)


def reflected_radiance(
    sample: SurfaceSample,
    wavelengths_nm: ArrayLike,
    mu_sun: ArrayLike,
    mu_view: ArrayLike,
    relative_azimuth_rad: ArrayLike,
    direct_flux: FloatArray,
    diffuse_flux: FloatArray,
    sky_radiance: SkyRadiance | None = None,
) -> FloatArray:
    """Solar-relative radiance L' (n, nwl) of the ground (Albers et al. 2020, Eq. 35).

    L' = 4 (brf E_direct + albedo E_diffuse), fluxes (n, nwl) on the horizontal for E_TOA = 1. Over water the
    sky part is `sky_radiance(which, mu, relative_azimuth_to_sun_rad) -> (m, nwl) L'`, asked at the mirrored
    direction at the places `which` (m,) among the n that are wet, and weighted with the waves' Fresnel reflectance;
    without it the sky is taken as isotropic.
    """
    mu_sun, mu_view, azimuth = _per_place(sample, mu_sun, mu_view, relative_azimuth_rad)
    lit = np.where((mu_sun > 0)[:, None], direct_flux, 0.0)
    direct = 4 * bidirectional_reflectance(sample, mu_sun, mu_view, azimuth, wavelengths_nm) * lit
    if sky_radiance is None or sample.lambertian:
        return direct + 4 * diffuse_reflectance(sample, mu_view, wavelengths_nm) * diffuse_flux
    out = direct + 4 * sample.albedo * diffuse_flux
    wet = np.flatnonzero(sample.water > 0)
    if wet.size:
        some, flux = sample[wet], diffuse_flux[wet]
        foam = water.foam_fraction(some.wind_speed)
        mirror, sky_mu, kept = water.mirrored_sky(mu_view[wet], some.slope_variance)
        sky = sky_radiance(wet, sky_mu, np.pi - azimuth[wet])
        steep = np.flatnonzero(kept < 1)
        if steep.size:  # what the sky on the other side differs by
            other = sky_radiance(wet[steep], sky_mu[steep], azimuth[wet[steep]])
            sky[steep] += 0.5 * (1 - kept[steep])[:, None] * (other - sky[steep])
        seen = ((1 - foam) * mirror)[:, None] * sky + 4 * _water_body(some, foam, wavelengths_nm) * flux
        out[wet] += some.water[:, None] * (seen - 4 * some.albedo * flux)
    return out


def land_factor(mu_sun: ArrayLike, mu_view: ArrayLike, relative_azimuth_rad: ArrayLike) -> FloatArray:
    """Anisotropic reflectance factor of land: about 1.5 at the hot spot, .8 against a low sun, bright at grazing view.

    The shape of Rahman, Pinty & Verstraete (1993) with k = .78 and Theta = -.1, mid-range of what they fitted to soil,
    grass and forest in the visible; mu and mu0 not below .05. Scaled as `balance` tells.
    """
    return _factor("land", mu_sun, mu_view, relative_azimuth_rad)


def snow_factor(mu_sun: ArrayLike, mu_view: ArrayLike, relative_azimuth_rad: ArrayLike) -> FloatArray:
    """Anisotropic reflectance factor of snow: near 1 for a high sun, several at low sun and forward scattering.

    The reflectance of a semi-infinite non-absorbing snow pack (Kokhanovsky & Breon 2012); mu and mu0 not below .05.
    Scaled as `balance` tells.
    """
    return _factor("snow", mu_sun, mu_view, relative_azimuth_rad)


def _factor(surface: str, mu_sun: ArrayLike, mu_view: ArrayLike, azimuth: ArrayLike) -> FloatArray:
    mu0, mu = (np.maximum(np.asarray(v, float), LEAST_MU) for v in (mu_sun, mu_view))
    node, g = balance(surface)
    shape = _SHAPES[surface](mu0, mu, cos_phase_angle(mu0, mu, np.cos(azimuth)))
    return np.asarray(shape / (np.interp(mu0, node, g) * np.interp(mu, node, g)))


def land_shape(mu0: Any, mu: Any, cos_xi: Any) -> Any:
    """``cos_xi``: of the angle between the directions to sun and eye, 1 at the hot spot."""
    bowl = (mu0 * mu * (mu0 + mu)) ** (0.78 - 1)
    # Theta = -.1 scatters back
    scattering = (1 - 0.1**2) / (1 - 2 * 0.1 * cos_xi + 0.1**2) ** 1.5
    tan0, tan = np.sqrt(np.maximum(1 - mu0**2, 0)) / mu0, np.sqrt(np.maximum(1 - mu**2, 0)) / mu
    # tan0 tan cos(azimuth) = cos_xi / (mu0 mu) - 1
    apart = np.sqrt(np.maximum(tan0**2 + tan**2 - 2 * (cos_xi / (mu0 * mu) - 1), 0.0))
    return bowl * scattering * (1 + 0.9 / (1 + apart))


def snow_shape(mu0: Any, mu: Any, cos_xi: Any) -> Any:
    scattering_deg = 180 - np.degrees(np.arccos(cos_xi))
    single = 11.1 * np.exp(-0.087 * scattering_deg) + 1.1 * np.exp(-0.014 * scattering_deg)
    return (1.247 + 1.186 * (mu + mu0) + 5.157 * mu * mu0 + single) / (4 * (mu + mu0))


def cos_phase_angle(mu0: Any, mu: Any, cos_azimuth: Any) -> Any:
    sines = np.sqrt(np.maximum(1 - mu0**2, 0.0) * np.maximum(1 - mu**2, 0.0))
    return np.minimum(np.maximum(mu * mu0 + sines * cos_azimuth, -1.0), 1.0)


_SHAPES = {"land": land_shape, "snow": snow_shape}


@cache
def balance(surface: str) -> tuple[FloatArray, FloatArray]:
    """Nodes of mu and the g(mu) for which shape / (g(mu0) g(mu)) reflects all light, whatever the sun's height.

    (2/pi) int shape / (g g) mu dmu dphi = 1 for every mu0 (Sinkhorn's iteration, symmetric): albedo times the factor
    is reciprocal and has that albedo from every direction. The measured rise of land's albedo toward low sun is
    given up for it.
    """
    node, weight = np.polynomial.legendre.leggauss(64)
    mu, mu_weight = 0.5 * (node + 1), 0.5 * weight
    azimuth, azimuth_weight = 0.5 * np.pi * (node + 1), 0.5 * np.pi * weight
    bounded = np.maximum(mu, LEAST_MU)
    mu0, mu1 = bounded[:, None, None], bounded[:, None]
    kernel = 2 / np.pi * _SHAPES[surface](mu0, mu1, cos_phase_angle(mu0, mu1, np.cos(azimuth))) @ azimuth_weight
    g = np.ones(mu.size)
    for _ in range(60):
        g = np.sqrt(g * (kernel @ (mu * mu_weight / g)))
    return mu, g


def _water_body(sample: SurfaceSample, foam: FloatArray, wavelengths_nm: ArrayLike) -> FloatArray:
    """Lambertian part of water (n, nwl): foam, and light from below the surface."""
    below = spectra.water_leaving(wavelengths_nm, sample.chlorophyll)
    return foam[:, None] * water.FOAM_ALBEDO + (1 - foam)[:, None] * below


def _per_place(sample: SurfaceSample, *values: ArrayLike) -> list[FloatArray]:
    n = sample.albedo.shape[0]
    return [np.broadcast_to(np.asarray(value, float), (n,)) for value in values]
