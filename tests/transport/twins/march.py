"""Twin of the march: places along a ray, and the steps between them added up (docs/fast.md, F5, F9, F16 to F18)."""

from __future__ import annotations

import numpy as np
from tests.transport.twins.steps import between, disc_above_horizon, emission, shell_place, sun_column, transmission

SUN_RADIUS_RAD = 0.00465
PACK = 4


class Ray:
    """What is the same all along a ray that makes an angle with the sun.

    w, share of the forward peaks that is read out with their broadening: smoothstep between two cosines. Legendre sums
    of the smooth phase functions of molecules, aerosol and species (n, PACK), with (1 - w) of their peaks at depth 0;
    ``peaks`` (n, depths, PACK) at the angle, the aerosol's last.
    """

    def __init__(self, cosine, table, shells, volume):
        x = np.clip((cosine - volume.peak_outer) / (volume.peak_inner - volume.peak_outer), 0, 1)
        self.cosine, self.share = cosine, x * x * (3 - 2 * x)
        turn = np.arccos(cosine) / np.pi  # (1 + c) u^2/(u + c) of a row's share u of all rows, c = 1/24
        row = np.roots([25 / 24, -turn, -turn / 24]).real.max() * (table.shape[1] - 1)
        self.peaks = np.array([between(t, row) for t in table])
        weights = np.polynomial.legendre.legvander([cosine], shells.phase.shape[1] - 1)[0]
        weights *= 2 * np.arange(len(weights)) + 1
        self.molecules = weights @ shells.phase[0]
        self.aerosol = weights @ shells.phase[1] + (1 - self.share) * self.peaks[-1, 0]
        self.species = [
            weights[: len(single)] @ single + (1 - self.share) * peak[0]
            for single, peak in zip(volume.single, self.peaks, strict=False)
        ]

    def peak(self, kind, depth):
        """R at forward optical depths (PACK,), from a table even in depth/(1 + depth)."""
        at = depth / (1 + depth) * (len(self.peaks[kind]) - 1)
        return np.array([between(self.peaks[kind][:, w], at[w]) for w in range(PACK)])


def in_grid(ix, iy, level, ray, ahead, half_step, volume):
    """A point of the grid: extinction, what forward peaks scatter, diffuse source, what is scattered of the beam, beam,
    each (PACK,). ahead: forward depth to the eye but for ``half_step`` at the point itself."""
    nodes = between(volume.fields, level, iy, ix)
    species = nodes[2 * PACK : 2 * PACK + volume.species]
    extinction, molecules, aerosol, forward = np.split(between(volume.air, level), 4)
    extinction = extinction + species @ volume.scaled
    forward = forward + species @ volume.forward
    place = np.array([ix, iy, level])
    nz, ny, nx = volume.free.shape
    cell = np.minimum(place.astype(int), [nx - 1, ny - 1, nz - 2])
    h = place - cell
    bent = (volume.bend[cell[2], cell[1], cell[0], :3] * h * (1 - h)).sum()
    own = species @ volume.scaled
    beam = np.minimum(nodes[:PACK] ** 2 * transmission(bent * own / max(own[0], 1e-20)), 1.0)  # F5
    told = nodes[2 * PACK + volume.species : volume.cloud_channel] @ volume.forward_factors
    met = told + between(volume.haze_depth, level) + ahead + half_step * forward
    single = molecules * ray.molecules + aerosol * ray.aerosol + ray.share * aerosol * ray.peak(-1, met)
    for s, x in enumerate(species):
        single = single + x * (ray.species[s] + ray.share * ray.peak(s, met))
    return extinction, forward, nodes[PACK : 2 * PACK] * extinction, single, beam


def in_air(height_m, mu, mu_sun, ray, ahead, half_step, shells, zeniths, azimuths):
    """The same of a point of the shells, at the cosine ``mu`` of the ray's own zenith angle there."""
    level, _ = shell_place(shells, height_m)
    mu_horizon = between(shells.horizon, level)
    slant = between(shells.slant, level, sun_column(mu_sun, mu_horizon, shells.slant.shape[1]))
    extinction, molecules, aerosol, forward = np.split(between(shells.rows, level), 4)
    beam = disc_above_horizon(mu_sun, mu_horizon, SUN_RADIUS_RAD) * transmission(slant[:PACK])
    met = slant[PACK:] + ahead + half_step * forward
    single = molecules * ray.molecules + aerosol * ray.aerosol + ray.share * aerosol * ray.peak(-1, met)
    azimuth = (ray.cosine - mu * mu_sun) / np.sqrt((1 - mu * mu) * (1 - mu_sun * mu_sun))
    table = shells.moment_sun_table
    star = np.interp((mu_sun + 1) / 2 * (len(table) - 1), np.arange(len(table)), table)
    z, x = (1 + mu) / 2 * (zeniths - 1), (1 + np.clip(azimuth, -1, 1)) / 2 * (azimuths - 1)
    return extinction, forward, between(shells.source, level, star, z, x), single, beam


def march(places, look, species_at=None):
    """Radiance, e^-tau' and e^-tau (PACK,) of the ``places`` (distance, step, ...) of a ray. ``look(place, ahead,
    half_step)``: see `in_grid`; ``species_at(place)``: whether there is cloud."""
    radiance, through, ahead = np.zeros(PACK), np.ones(PACK), np.zeros(PACK)
    extinction = forward = diffuse = single = beam = np.zeros(PACK)
    clouded = False
    for place in places:
        step = place[1]
        behind = ahead + step / 2 * forward
        far = look(place, behind, step / 2)
        cloud = species_at is not None and species_at(place)
        near_source, far_source = diffuse + single * beam, far[2] + far[3] * far[4]
        if (clouded or cloud) and step > 0:
            # the mean of a product of two lines is not that of its ends
            product = (far[3] - single) * (far[4] - beam) / 6
            near_source, far_source = near_source - product, far_source - product
        depth = (extinction + far[0]) * step / 2
        added = [
            emission(depth[w], step, near_source[w], far_source[w], extinction[w], far[0][w], 0.01, 3)
            for w in range(PACK)
        ]
        radiance = radiance + through * added
        through = through * transmission(depth)
        ahead = behind + step / 2 * far[1]
        extinction, forward, diffuse, single, beam = far
        clouded = cloud
    return radiance, through, through * np.exp(-ahead)
