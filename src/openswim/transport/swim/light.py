"""The `swim` setting, light: scalar irradiance from the optical depth to the sun instead of a solved diffuse field.

Albers et al. 2020, Eqs 4-8 as corrected; `swim_view` makes radiance of it. docs/swim.md lists every equation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.beam.direct import direct_beam
from openswim.transport.beam.lit_volume import Channels, depths_to_sun
from openswim.transport.beam.sun_sweep import beyond_sides, inside, weighted
from openswim.transport.beam.within_cells import bent
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import Lighting, clear_sky_table, sky_flux
from openswim.transport.lit.lit_grid import GridLight
from openswim.transport.march.empty_space import beside, occupied
from openswim.transport.march.volume import Shells, Volume
from openswim.transport.medium.medium import Medium
from openswim.transport.swim.layer import (
    absorbed_transmittance,
    diffuse_albedo,
    layer_albedo,
    multiple_scattering_albedo,
)

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_LEAST_LEFT = 1e-9  # of light that is absorbed
_CONSERVATIVE = 0.999  # single-scattering albedo above which absorption is not followed


def backscatter_weights(medium: Medium) -> F32:
    """b_i (ns, nw) of Eq. 4, per reference extinction."""
    rows = [s.backscatter_fraction * s.relative_extinction for s in medium.species]
    return np.array(rows, FLOAT).reshape(len(rows), len(medium.wavelengths_nm))


def light_grid(
    light: GridLight, volume: Volume, channels: Channels, lighting: Lighting, shells: Shells, local_sun: F64, sun: F64
) -> Volume:
    """Eq. 8 at every node, beta omega e^-tau_R in the channels of sources and -ln of what absorption leaves of T in
    those of the beam; how depths to the sun bend between nodes; and the flux below at the ground (Sect. 3.7)."""
    medium, source = light.medium, channels.source
    assert source is not None
    mu = lighting.mu_sun.ravel()
    shape = lighting.mu_sun.shape
    clear_diffuse = sky_flux(shells, mu)
    lighting.clear_sky = clear_sky_table(shells, sun)
    ground = (medium.levels_m[:, None, None] < medium.terrain_m).sum(axis=0)
    ground = np.minimum(ground, len(medium.levels_m) - 1)[None]
    airs = np.empty((light.count, *medium.shape), FLOAT)
    clears = np.empty((light.count, *shape), FLOAT)
    in_threads(
        direct_beam, beyond_sides(1, medium.shape), np.zeros((1, PACK), FLOAT), local_sun, medium.levels_m,
        medium.terrain_m, light.shadow_m, light.ridge_m, light.count, shells, airs, clears, channels.beam,
    )  # fmt: skip
    absorbed = _absorbed_depths(medium, local_sun, light.count)
    for w in range(len(medium.wavelengths_nm)):
        if w >= light.count:  # padding
            source[..., w] = source[..., w - 1]
            channels.beam[..., w] = channels.beam[..., w - 1]
            lighting.diffuse[w], lighting.up_top[w] = lighting.diffuse[w - 1], lighting.up_top[w - 1]
            continue
        air, clear = airs[w], clears[w]
        backscatter_depth = np.tensordot(volume.forward_factors[:, w], channels.forward_depth, 1)
        transmittance = 1.0 / (1.0 + backscatter_depth)  # Eqs 4-6 (corrected): T = T1 with the slant depth
        reflected = layer_albedo(np.take_along_axis(backscatter_depth, ground, 0)[0])  # Eq. 24
        channels.beam[..., w] = 0
        if w in absorbed:
            path = _sun_path(absorbed[w], local_sun)
            left = absorbed_transmittance(*path).astype(FLOAT)
            channels.beam[..., w] = -np.log(np.maximum(left, _LEAST_LEFT))
            transmittance *= left
            reflected *= multiple_scattering_albedo(*(np.take_along_axis(x, ground, 0)[0] for x in path))  # Eq. 31
        scattering = np.zeros(medium.shape, FLOAT)
        for s, extinction in zip(medium.species, medium.extinction, strict=True):
            scattering += FLOAT(s.relative_extinction[w] * s.single_scattering_albedo[w]) * extinction
        source[..., w] = scattering * air  # Eq. 8 but for T
        below = np.take_along_axis(transmittance, ground, 0)[0]
        vertical = np.take_along_axis(backscatter_depth, ground, 0)[0] * np.maximum(lighting.mu_sun, 0.02)
        total = clear * below * np.maximum(lighting.mu_sun, 0) + clear_diffuse[:, w].reshape(shape) * below
        # what the ground sends up and the cloud back again (the surface albedo that Eq. 8 leaves for later)
        total /= 1 - lighting.albedo[w] * np.mean(diffuse_albedo(vertical))
        lighting.diffuse[w] = np.maximum(total - lighting.direct_horizontal(w), 0)
        # the air's own light is left out
        from_ground = lighting.albedo[w] * total * (1 - diffuse_albedo(vertical))
        lighting.up_top[w] = clear * np.maximum(lighting.mu_sun, 0) * reflected + from_ground
    first = np.tensordot(volume.forward_factors[:, 0], channels.forward_depth, 1)
    return _with_bends(medium, volume, first, local_sun)


def _with_bends(medium: Medium, volume: Volume, backscatter_depth: F32, local_sun: F64) -> Volume:
    """The volume with what it lacks between nodes of a depth to the sun (nz, ny, nx), of the first wavelength."""
    volume = volume._replace(bend=np.zeros((*medium.shape, PACK), FLOAT))
    depth = weighted(backscatter_depth[None], np.ones((1, 1), FLOAT), medium.periodic)
    bent(volume, medium, depth[0], backscatter_weights(medium)[:, 0], local_sun, rooted=False)
    return volume


def _absorbed_depths(medium: Medium, local_sun: F64, count: int) -> dict[int, F32]:
    """Depths (3, nz, ny, nx) to the sun of extinction, of scattering and of that times g, at those of ``count``
    wavelengths at which any species absorbs.

    Absorption is what the paper announces ("how dark it becomes ... when heavy smoke and/or thick dust is present").
    """
    weights = {}
    for w in range(count):
        omegas = np.array([s.single_scattering_albedo[w] for s in medium.species])
        if (omegas > _CONSERVATIVE).all():
            continue
        relative = np.array([s.relative_extinction[w] for s in medium.species])
        asymmetry = np.array([s.phase[w].asymmetry for s in medium.species])
        weights[w] = np.stack([relative, relative * omegas, relative * omegas * asymmetry])
    if not weights:
        return {}
    exact = beside(occupied(medium.extinction, medium.levels_m, medium.terrain_m), medium.periodic)
    depths = inside(depths_to_sun(medium, np.concatenate(list(weights.values())), exact, local_sun))
    return dict(zip(weights, np.split(depths, len(weights)), strict=True))


def _sun_path(depths: F32, local_sun: F64) -> tuple[F64, F64, F64, F64]:
    """Mean omega and g of what lies between every node and the sun, its vertical depth, and mu0."""
    whole, scattered, forward = depths
    mu0 = np.broadcast_to(np.clip(local_sun[..., 2], 0.02, 1), whole.shape)
    omega = np.where(whole > 0, scattered / np.maximum(whole, 1e-12), 1.0)
    g = np.where(scattered > 0, forward / np.maximum(scattered, 1e-12), 0.0)
    return omega, g, whole * mu0, mu0
