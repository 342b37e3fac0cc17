"""Reflection off the ground, for one photon: the laws of `ground.reflectance` and `ground.water`, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.ground import reflectance, spectra, water
from openswim.ground.reflectance import LEAST_MU, balance
from openswim.ground.sample import SurfaceSample
from openswim.transport.engine.compiled import part
from openswim.transport.montecarlo.phase import turned, uniform, unit_circle

F64 = NDArray[np.float64]

_MIRRORED = 0.75  # of the ways on from water, by its waves
_FOAM_ALBEDO, _LEAST_WET_MU = water.FOAM_ALBEDO, water.LEAST_MU

_compiled = part()
_land_shape, _snow_shape = _compiled(reflectance.land_shape), _compiled(reflectance.snow_shape)
_cos_phase_angle = _compiled(reflectance.cos_phase_angle)
_fresnel, _facing = _compiled(water.fresnel_reflectance), _compiled(water.facing)
_glint, _shadowing = _compiled(water.glint), _compiled(water.shadowing)


class Seen(NamedTuple):
    """The ground where each ray's straight way ends (n rays): what `bidirectional_reflectance` needs of it."""

    albedo: F64  # (n, nw)
    water: F64  # (n,)
    snow: F64  # (n,)
    variance: F64  # (n,) of the waves' slopes
    foam: F64  # (n,)
    water_leaving: F64  # (n, nw)
    lambertian: bool
    land_norm: F64  # `reflectance.balance` at even cosines from LEAST_MU to 1
    snow_norm: F64


def seen_ground(sample: SurfaceSample, wavelengths_nm: F64) -> Seen:
    """Tables for the kernel."""
    mu = np.linspace(LEAST_MU, 1.0, 256)
    return Seen(
        np.ascontiguousarray(sample.albedo, float), np.asarray(sample.water, float), np.asarray(sample.snow, float),
        np.asarray(sample.slope_variance, float),
        np.asarray(water.foam_fraction(sample.wind_speed), float),
        np.ascontiguousarray(spectra.water_leaving(wavelengths_nm, sample.chlorophyll)), sample.lambertian,
        np.interp(mu, *balance("land")), np.interp(mu, *balance("snow")),
    )  # fmt: skip


@part()
def _norm(mu, table):
    x = (mu - LEAST_MU) / (1.0 - LEAST_MU) * (table.shape[0] - 1)
    x = min(max(x, 0.0), table.shape[0] - 1.000001)
    i = int(x)
    return table[i] + (x - i) * (table[i + 1] - table[i])


@part()
def reflected(mu_in, mu_out, cos_angle, ray, seen, out):
    """Reflectance factor pi L / E (nw,) into ``out`` for light from ``mu_in`` to ``mu_out``.

    ``cos_angle``: cosine of the angle between the directions from the ground to the light and to the eye.
    """
    nw = out.shape[0]
    if seen.lambertian:
        for w in range(nw):
            out[w] = seen.albedo[ray, w]
        return
    mu0, mu = min(max(mu_in, 0.0), 1.0), min(max(mu_out, 0.0), 1.0)
    c = min(max(cos_angle, -1.0), 1.0)
    wet, snow, variance = seen.water[ray], seen.snow[ray], seen.variance[ray]
    a0, a = max(mu0, LEAST_MU), max(mu, LEAST_MU)
    cos_xi = c
    if mu0 < LEAST_MU or mu < LEAST_MU:  # the models keep the azimuth, and see the angle of what is bounded
        sines = math.sqrt(max((1.0 - mu0 * mu0) * (1.0 - mu * mu), 1e-12))
        cos_xi = _cos_phase_angle(a0, a, min(max((c - mu0 * mu) / sines, -1.0), 1.0))
    factor = _land_shape(a0, a, cos_xi) / (_norm(a0, seen.land_norm) * _norm(a, seen.land_norm))
    if snow > 0.0:
        white = _snow_shape(a0, a, cos_xi) / (_norm(a0, seen.snow_norm) * _norm(a, seen.snow_norm))
        factor += snow * (white - factor)
    glint = 0.0
    if wet > 0.0:
        mu0, mu = max(mu0, _LEAST_WET_MU), max(mu, _LEAST_WET_MU)
        cos_omega, cos_beta = _facing(mu0, mu, c)
        hidden = _shadowing(mu, variance) + _shadowing(mu0, variance)
        glint = (1.0 - seen.foam[ray]) * _glint(mu0, mu, cos_beta, _fresnel(cos_omega), hidden, variance)
    for w in range(nw):
        body = seen.foam[ray] * _FOAM_ALBEDO + (1.0 - seen.foam[ray]) * seen.water_leaving[ray, w]
        out[w] = (1.0 - wet) * factor * seen.albedo[ray, w] + wet * (glint + body)


@part()
def level_water(ray, seen):
    """Whether what is seen is water, which is level whatever the slope between the grid's nodes."""
    return not seen.lambertian and seen.water[ray] > 0.5


@part()
def mirrored_share(toward_eye, ray, seen):
    """Of the ways on from the ground, those that waves are to mirror: none of slopes that turn away from the eye, to
    which `reflected` gives what a bounded angle has, and `mirrored_density` what theirs has."""
    if seen.lambertian or toward_eye < _LEAST_WET_MU:
        return 0.0
    return _MIRRORED * seen.water[ray] * (1.0 - seen.foam[ray])


@part()
def mirrored_light(toward_eye, ray, seen):
    """About what water returns of light all around to an eye at a cosine; chances may hang on it."""
    return (1.0 - seen.foam[ray]) * seen.water[ray] * _fresnel(min(max(toward_eye, 0.1), 1.0))


@part()
def mirrored(ax, ay, az, nx, ny, nz, ray, seen, rng):
    """A direction into which a facet by chance, of waves on ground of normal n, mirrors what comes along a."""
    steep = -seen.variance[ray] * math.log(1.0 - uniform(rng))  # squared tangent (Cox and Munk 1954, isotropic)
    c, e = unit_circle(rng)
    fx, fy, fz = turned(nx, ny, nz, 1.0 - 1.0 / math.sqrt(1.0 + steep), c, e)
    twice = 2.0 * (ax * fx + ay * fy + az * fz)
    return ax - twice * fx, ay - twice * fy, az - twice * fz


@part()
def mirrored_density(ax, ay, az, dx, dy, dz, nx, ny, nz, ray, seen):
    """Density of the directions d of `mirrored`, mean 1 over the sphere."""
    hx, hy, hz = dx - ax, dy - ay, dz - az
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    cos_beta = (nx * hx + ny * hy + nz * hz) / max(length, 1e-12)
    cos_omega = 0.5 * length
    if cos_beta <= 1e-3 or cos_omega <= 1e-9:
        return 0.0
    variance = seen.variance[ray]
    return math.exp(-(1.0 / (cos_beta * cos_beta) - 1.0) / variance) / (variance * cos_beta**3 * cos_omega)
