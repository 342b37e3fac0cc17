"""The `swim` setting, radiance: effective phase functions for cloud and aerosol, merged with the clear sky.

Albers et al. 2020, Eqs 11-15, 21-23, 26 and 32-34 as corrected; docs/swim.md lists every equation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.beam.direct import shell_transmission
from openswim.transport.engine.compiled import kernel
from openswim.transport.ground_light.fluxes import ground_flux, sky_flux
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.march.march import march_rays
from openswim.transport.march.volume import FAR_M, Shells, Volume, blank_fields
from openswim.transport.medium.medium import Medium
from openswim.transport.swim.layer import (
    absorbed_transmittance,
    diffuse_albedo,
    layer_albedo,
    multiple_scattering_albedo,
)
from openswim.transport.swim.near_side import DEPTH_OF_VIEW, near_side
from openswim.transport.swim.phase import anisotropy, shaded_phase, sunlit_phase, thin_phases

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_CLOUDY = 1e-6  # optical depth
_LEAST_MU = 0.02
_FROM_ABOVE = 0.3  # cosine of a falling ray to the vertical from which a cloud is seen wholly from above


class Sight(NamedTuple):
    """Rays (n,) that meet cloud, at one wavelength.

    depth (ns, n) of the species and tau of all; near: depth that Eq. 12 integrates over; irradiance: mean E/E_TOA
    there as seen from the eye, and transmittance: the cloud's share of it (T of Eq. 6); mu_theta: cosine of the
    scattering angle; rise: cosine of the ray's zenith angle at the cloud; mu_sun of the sun's there, mu0 kept positive.
    """

    depth: F64
    tau: F64
    near: F64
    irradiance: F64
    transmittance: F64
    mu_theta: F64
    rise: F64
    mu0: F64
    mu_sun: F64


def view(
    lit: LitGrid, volume: Volume, origin: F64, direction: F64, shells: Shells, ends: F64 | None = None
) -> tuple[F32, F32, F32, F64, NDArray[np.int64]]:
    """Radiance and e^-tau (n, PACK), depth of the species (n, ns), distance of the ground or -1, samples of rays, which
    end at distances ``ends`` (n,) where these are given."""
    species = lit.volume.species
    # the air dims but does not shine: the cloud's share of Eq. 34, dimmed by e^-tau_1 along the way (Eq. 33)
    seen = near_side(origin, direction, shells, volume, lit.options.step, ends)
    front, depth, distance = seen.front, seen.species_depth, seen.distance_m
    clear, air_depth = _clear_view(lit, origin, direction, distance, shells, ends)
    out = clear.copy()
    cloudy = np.flatnonzero(depth[:, :species].sum(axis=1) > _CLOUDY)
    if cloudy.size:
        o, d = origin[cloudy], direction[cloudy]
        place = o + d * seen.cloud_m[cloudy, None].astype(float)
        for w in range(lit.count):
            sight = _sight(lit, shells, place, d, depth[cloudy, :species], seen.lit[cloudy, w], front[cloudy, w], w)
            cloud = cloud_radiance(lit, sight, shells, front[cloudy, w].astype(float), w)
            share = clear_share(sight.tau, front[cloudy, w].astype(float), air_depth[cloudy, w])
            out[cloudy, w] = share * clear[cloudy, w] + cloud  # Eq. 34
    out[:, lit.count :] = out[:, lit.count - 1 : lit.count]
    return np.maximum(out, 0), seen.full, depth, distance, seen.samples


def _clear_view(
    lit: LitGrid, origin: F64, direction: F64, distance: F64, shells: Shells, ends: F64 | None = None
) -> tuple[F32, F32]:
    """L'_clear of the air alone along rays that end where the terrain does, and its depth (Eq. 3, all orders)."""
    volume = lit.volume._replace(fields=blank_fields((1, 1, 1), 1))

    def march(start: F64, along: F64) -> tuple[F32, F32]:
        seen = march_rays(start, along, lit.sun, lit.table, shells, volume, lit.options.step, ends=ends)
        return np.maximum(seen.radiance, 0), seen.scaled

    def height(place: F64) -> F64:
        return np.linalg.norm(place + np.array([0, 0, shells.radius_m]), axis=-1) - shells.radius_m - shells.ground_m

    if ends is not None:
        ends = np.where(distance >= 0, distance, FAR_M)
        radiance, through = march(origin, direction)
        return radiance, -np.log(np.clip(through, 1e-12, 1))
    # the shells know of no valleys: rays that begin in one are lifted out of it
    start = origin + np.maximum(2.0 - height(origin), 0)[:, None] * _up(origin, shells)
    radiance, through = march(start, direction)
    end = start + direction * np.maximum(distance, 0)[:, None]
    beyond = np.flatnonzero((distance >= 0) & (height(end) > 1.0))  # behind a mountain is no more air to be seen
    if beyond.size:
        rest, rest_through = march(end[beyond], direction[beyond])
        before = through[beyond] / np.maximum(rest_through, 1e-12)
        radiance[beyond] = np.maximum(radiance[beyond] - before * rest, 0)
        through[beyond] = before
    return radiance, -np.log(np.clip(through, 1e-12, 1))


def _up(place: F64, shells: Shells) -> F64:
    """Unit vectors away from the Earth's centre (n, 3)."""
    up = place + np.array([0, 0, shells.radius_m])
    return np.asarray(up / np.linalg.norm(up, axis=-1, keepdims=True))


@kernel()
def _air_transmission(height_m, mu, w, shells, out):
    for n in range(out.shape[0]):
        out[n] = shell_transmission(height_m[n], mu[n], w, shells)


def _sight(
    lit: LitGrid, shells: Shells, place: F64, direction: F64, depth: F32, integral: F32, front: F32, w: int
) -> Sight:
    """Take the integral of Eq. 12, of omega E/E_TOA e^-tau, apart."""
    medium = lit.medium
    assert medium is not None
    up = _up(place, shells)
    height_m = np.linalg.norm(place + np.array([0, 0, shells.radius_m]), axis=-1) - shells.radius_m
    mu0 = up @ lit.sun
    relative = np.array([s.relative_extinction[w] for s in medium.species])
    own = depth.astype(float).T * relative[:, None]
    tau = own.sum(axis=0)
    reference = depth.astype(float).sum(axis=1)
    near = np.minimum(reference, DEPTH_OF_VIEW) * tau / reference
    omega = _mean(own, [s.single_scattering_albedo[w] for s in medium.species], tau)
    irradiance = integral / (-np.expm1(-near) * np.maximum(omega, 1e-9))  # what only absorbs is not lit
    air = np.zeros(len(tau))
    _air_transmission(height_m, mu0, w, shells, air)
    air *= np.exp(-front)
    transmittance = np.clip(irradiance / np.maximum(air, 1e-12), 0, 1)
    return Sight(
        own, tau, near, irradiance, transmittance, direction @ lit.sun, (direction * up).sum(-1),
        np.clip(mu0, _LEAST_MU, 1), mu0,
    )  # fmt: skip


def _mean(depth: F64, values: list[float], tau: F64) -> F64:
    """Mean (n,) of a property of the species, weighted by their depths (ns, n)."""
    return np.asarray(np.array(values, float) @ depth / tau)


def cloud_radiance(lit: LitGrid, sight: Sight, shells: Shells, front: F64, w: int) -> F64:
    """L'_cloud (n,) as seen from the eye, f_cloud of Eq. 33 included: from below (Eq. 12) or from above (Eq. 26)."""
    medium = lit.medium
    assert medium is not None
    blend = _smoothstep(np.clip(-sight.rise / _FROM_ABOVE, 0, 1))
    out = (1 - blend) * from_below(sight, medium, w, lit.options.paper_phases)
    above = np.flatnonzero(blend > 0)
    if above.size:
        part = Sight(*(a[..., above] for a in sight))
        out[above] += blend[above] * from_above(part, medium, w)
    return out + np.exp(-front) * _lit_by_sky_and_ground(lit, sight, shells, w)


def from_below(sight: Sight, medium: Medium, w: int, paper: bool = False) -> F64:
    """Eq. 12 with the effective phase function of Eqs 13-23."""
    tau, s = sight.tau, np.maximum(sight.tau, 1)
    species = medium.species
    omega = _mean(sight.depth, [one.single_scattering_albedo[w] for one in species], tau)
    thin = thin_phases(species, sight.depth / tau, sight.mu_theta, s, w, float(medium.wavelengths_nm[w]), paper)
    b = _mean(sight.depth, [one.backscatter_fraction for one in species], tau)
    c1 = np.exp(-((tau / 10) ** 2)) * sight.transmittance  # Eq. 14
    c3 = layer_albedo(b * tau) * _four_smoothsteps(sight.transmittance**2.2)  # Eq. 22: SWIm's practice, times Eq. 24
    shaded = 9 / 7 * sight.mu0 * shaded_phase(sight.rise)  # so that an overcast sky integrates to mu0 T
    g = _mean(sight.depth, [one.phase[w].asymmetry for one in species], tau)
    lit = multiple_scattering_albedo(omega, g, tau, sight.mu0) * sunlit_phase(sight.mu_theta)
    thick = 2 * c3 * lit + 4 * (1 - c3) * shaded  # Eqs 21, 23
    return (c1 * omega * thin + (1 - c1) * thick) * -np.expm1(-tau) * sight.irradiance  # Eqs 12, 13, 15


def from_above(sight: Sight, medium: Medium, w: int) -> F64:
    """Eq. 26 for a cloud of any shape: lit as Eq. 12 finds its near side, over what a level layer's would be.

    P is that of single scattering, and the Lambertian part has only what scatters again, 1 - (1 - e^-tau)/tau.
    """
    tau, mu0, cos_z, species = sight.tau, sight.mu0, np.clip(-sight.rise, 0, 1), medium.species
    slant = cos_z / mu0  # the sun's way through the layer per depth along the ray
    omega = _mean(sight.depth, [one.single_scattering_albedo[w] for one in species], tau)
    g = _mean(sight.depth, [one.phase[w].asymmetry for one in species], tau)
    b = _mean(sight.depth, [one.backscatter_fraction for one in species], tau)
    near = sight.near
    depth_seen = (1 - (1 + near) * np.exp(-near)) / -np.expm1(-near)
    lit = sight.irradiance * (1 + b * depth_seen * slant)
    a = multiple_scattering_albedo(omega, g, tau * cos_z, mu0) * layer_albedo(b * tau * slant)  # Eqs 24, 30, 31
    single = thin_phases(species, sight.depth / tau, sight.mu_theta, np.ones_like(tau), w, 0.0, False)
    again = 1 + np.expm1(-tau) / tau
    arf = anisotropy(sight.mu_theta, cos_z, mu0)
    return lit * (omega * single * -np.expm1(-tau) * (1 - a) + 4 * mu0 * arf * a * again)  # Eq. 26


def _lit_by_sky_and_ground(lit: LitGrid, sight: Sight, shells: Shells, w: int) -> F64:
    """L' of a cloud in the light of the sky and of the ground, which Eq. 8 leaves for later: Lambertian."""
    medium = lit.medium
    assert medium is not None
    tau = sight.tau
    # a level ray sees sides of clouds, half in the light of the ground
    base = _smoothstep(0.5 + 0.5 * np.clip(sight.rise / _FROM_ABOVE, -1, 1))
    b = _mean(sight.depth, [one.backscatter_fraction for one in medium.species], tau)
    omega = _mean(sight.depth, [one.single_scattering_albedo[w] for one in medium.species], tau)
    g = _mean(sight.depth, [one.phase[w].asymmetry for one in medium.species], tau)
    vertical = tau * np.abs(sight.rise)
    back = diffuse_albedo(b * tau) * multiple_scattering_albedo(omega, g, vertical, 0.5)
    mu, columns = sight.mu_sun, lit.lighting.mu_sun.ravel()
    total, sky = ground_flux(shells, mu)[:, w], sky_flux(shells, mu)[:, w]
    # the ground's mean light, by the hour of the day at the cloud
    usual = float(ground_flux(shells, columns[:: max(1, columns.size // 1000)])[:, w].mean())
    ground = float(np.mean(lit.lighting.mean_fluxes()["up_bottom"][w])) * total / max(usual, 1e-9)
    facing, behind = base * ground + (1 - base) * sky, base * sky + (1 - base) * ground
    through = (1 - diffuse_albedo(b * tau)) * absorbed_transmittance(omega, g, vertical, 0.5)
    through *= base * 9 / 7 * shaded_phase(sight.rise) + (1 - base)
    return 4 * -np.expm1(-tau) * (back * facing + through * behind)


def _four_smoothsteps(x: F64) -> F64:
    for _ in range(4):
        x = _smoothstep(x)
    return x


def _smoothstep(x: F64) -> F64:
    return x * x * (3 - 2 * x)


def clear_share(tau: F64, front: F64, air_depth: F64) -> F64:
    """f_clear of Eq. 32 (corrected): the clear sky in front of the cloud, and what of the rest comes through it.

    f_front is the share of the air's light that arises in front of the first unit of optical depth on the mean,
    (1 - e^-tau_1)/(1 - e^-tau_air).
    """
    in_front = np.clip(np.expm1(-front) / np.minimum(np.expm1(-air_depth), -1e-12), 0, 1)
    return np.asarray(in_front + (1 - in_front) * np.exp(-tau))
