"""The `swim` setting: scalar irradiance and effective phase functions instead of a solved diffuse field.

Albers et al. 2020, Eqs 4-23 and 32-34 as corrected in docs/decisions; equation numbers stand at each line.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.transport.march import PACK, Shells, Volume
from openswim.transport.medium import Medium
from openswim.transport.shells import beam_transmission
from openswim.transport.sun import direct_beam
from openswim.transport.surface import Lighting, clear_sky_table, ground_flux

if TYPE_CHECKING:
    from openswim.transport.field import PackField
    from openswim.transport.grid_light import GridLight

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_DEPTH_OF_VIEW = 2.0  # l of Eq. 12


def backscatter_weights(medium: Medium) -> F32:
    """b_i (ns, nw) of Eq. 4, per reference extinction."""
    rows = [s.backscatter_fraction * s.relative_extinction for s in medium.species]
    return np.array(rows, np.float32).reshape(len(rows), len(medium.wavelengths_nm))


def cloud_only(shells: Shells) -> Shells:
    """Air that dims but does not shine: the cloud's share of Eq. 34, dimmed by e^-tau_1 along the way (Eq. 33)."""
    return shells._replace(
        scattering=np.zeros_like(shells.scattering), forward=np.zeros_like(shells.forward), moments=shells.moments[:0]
    )


def light_grid(light: GridLight, volume: Volume, lighting: Lighting, shells: Shells, local_sun: F64, sun: F64) -> None:
    """Source beta omega E/E_TOA at every node (Eqs 4-8) and the flux below it at the ground (Sect. 3.7)."""
    medium = light.medium
    mu = lighting.mu_sun.ravel()
    shape = lighting.mu_sun.shape
    clear_beam = beam_transmission(shells, mu)
    clear_diffuse = np.maximum(ground_flux(shells, mu) - clear_beam * np.maximum(mu, 0)[:, None], 0)
    lighting.clear_sky = clear_sky_table(shells, sun)
    ground = (medium.levels_m[:, None, None] < medium.terrain_m).sum(axis=0)
    ground = np.minimum(ground, len(medium.levels_m) - 1)[None]
    air = np.empty(medium.shape, np.float32)
    unused = np.empty(shape, np.float32)
    for w in range(len(medium.wavelengths_nm)):
        direct_beam(
            np.zeros(medium.shape, np.float32), local_sun, medium.levels_m, medium.terrain_m, light.shadow_m,
            light.ridge_m,
            w, shells, air, unused, volume.fields, w,
        )  # fmt: skip
        # Eqs 4-6 (corrected): T = T1 with the slant depth, summed over species (b_i tau_i)
        transmittance = 1.0 / (1.0 + volume.fields[..., volume.forward_channel[w]])
        scattering = np.zeros(medium.shape, np.float32)
        for s, extinction in zip(medium.species, medium.extinction, strict=True):
            scattering += np.float32(s.relative_extinction[w] * s.single_scattering_albedo[w]) * extinction
        volume.fields[..., PACK + w] = scattering * transmittance * air  # Eq. 8
        below = np.take_along_axis(transmittance, ground, 0)[0]
        total = unused * below * np.maximum(lighting.mu_sun, 0)
        lighting.diffuse[w] = (
            np.maximum(total - lighting.direct_horizontal(w), 0) + clear_diffuse[:, w].reshape(shape) * below
        )


def henyey_greenstein(mu: F64, g: F64) -> F64:
    """Eq. 9, mean 1 over the sphere."""
    return (1 - g**2) / np.maximum(1 + g**2 - 2 * g * mu, 1e-12) ** 1.5


def thin_phase(kind: str, mu: F64, s: F64, wavelength_nm: float) -> F64:
    """Effective phase function of an optically thin cloud, s = max(tau_o, 1) (Eqs 16-18, B1-B3, corrected)."""
    p = henyey_greenstein
    if kind == "rain":  # B1
        return 0.1 * p(mu, 0.99**s) + 1.05 * p(mu, 0.75**s) - 0.35 + 0.20 * p(mu, -0.2 + 0 * s)
    if kind in ("ice", "graupel"):  # B2; graupel has no equation of its own
        sharp = 0.5 * 2.0 ** (1 - s)
        return sharp * p(mu, 0.999**s) + (1 - sharp - 0.22) * p(mu, 0.86**s) + 0.20 + 0.02 * p(mu, -0.6 + 0 * s)
    if kind == "snow":  # B3
        return 0.50 * p(mu, 0.999**s) + 0.45 * p(mu, 0.86**s) + 0.03 + 0.02 * p(mu, -0.6 + 0 * s)
    g = np.interp(wavelength_nm, [450.0, 546.0, 615.0], [0.955, 0.950, 0.945])  # Eq. 16
    f1 = 0.8**s  # Eq. 17
    return f1 * p(mu, g**s) + (1.06 - f1) * p(mu, 0.6**s) + 0.02 * p(mu, -0.6 + 0 * s) - 0.08  # Eq. 18


def venus_phase(mu: F64) -> F64:
    """Sunlit side of a thick cloud, after the planet Venus (Eq. 19, with Mallama's magnitudes from full phase)."""
    a = np.degrees(np.pi - np.arccos(np.clip(mu, -1, 1)))  # phase angle
    m = np.where(
        a < 163.7,
        a * (-1.044e-3 + a * (3.687e-4 + a * (-2.814e-6 + a * 8.938e-9))),
        240.442 - 2.81914 * a + 8.39034e-3 * a**2,
    )
    return np.minimum(1.94 / 10 ** (0.4 * m) / np.maximum((1 - mu) / 2, 1e-3), 12.0)


def merge(
    field: PackField, direction: F64, origin: F64, radiance: F32, full: F32, species_depth: F32, front: F32, clear: F32
) -> None:
    """From the integral of Eq. 12 to what is seen: effective phase functions, then the clear sky (Eqs 13-23, 32-34).

    ``radiance`` (n, nw) holds the integral of E/E_TOA over the first two optical depths on entry, L' on return.
    """
    medium = field.medium
    assert medium is not None
    mu_theta = direction @ field.sun
    up = origin + np.array([0, 0, field.frame.radius_m])
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    cos_z = np.clip((up * direction).sum(-1), 0, 1)
    mu0 = np.clip(up @ field.sun, 0, 1)
    for w, wavelength in enumerate(field.wavelengths_nm):
        depths = species_depth[:, : len(medium.species)] * np.array([s.relative_extinction[w] for s in medium.species])
        tau = depths.sum(axis=1)
        cloudy = tau > 1e-6
        s = np.maximum(tau, 1.0)
        ell = np.minimum(tau, _DEPTH_OF_VIEW)
        seen = np.where(cloudy, -np.expm1(-ell), 1.0)
        irradiance = np.where(cloudy, radiance[:, w] / seen, 0.0)  # mean E/E_TOA of the cloud's near side
        thin = np.zeros_like(tau)
        for share, one in zip((depths / np.maximum(tau, 1e-30)[:, None]).T, medium.species, strict=True):
            own = (
                one.phase[w].value(mu_theta) if one.kind == "aerosol" else thin_phase(one.kind, mu_theta, s, wavelength)
            )
            thin += share * own
        c1 = np.exp(-((tau / 10) ** 2)) * np.minimum(irradiance, 1)  # Eq. 14
        c3 = c1  # Eq. 22
        low = (1 + 2 * cos_z) / 3 * mu0 * 9 / 7  # Eq. 20, scaled so that an overcast sky integrates to mu0 T
        thick = 2 * c3 * venus_phase(mu_theta) + 4 * (1 - c3) * low  # Eqs 21, 23
        phase = c1 * thin + (1 - c1) * thick  # Eqs 13, 15
        cloud = phase * -np.expm1(-tau) * irradiance  # Eq. 12
        # Eq. 32 (corrected): the clear sky in front of the cloud, and what of the rest comes through it
        behind = np.maximum(-np.log(np.maximum(full[:, w], 1e-30)) - tau, front[:, w])
        share = np.where(cloudy, np.expm1(-front[:, w]) / np.minimum(np.expm1(-behind), -1e-12), 1.0)
        share = np.clip(share, 0, 1)
        radiance[:, w] = (share + (1 - share) * np.exp(-tau)) * clear[:, w] + cloud  # Eq. 34
