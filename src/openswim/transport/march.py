"""March: light gathered along an eye ray through shells and volume.

One function, `march_ray`, serves every camera, the inflow at the sides of the grid and the diffuse
field of the clear atmosphere. All lengths in metres; radiances solar-relative (Eq. 2, L' = 4 pi L/E_TOA).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from openswim.transport.scalar import (
    harmonics_symmetric,
    height_m,
    shadow_fraction,
    smoothstep,
    step_emission,
    table_index,
    transmission,
)

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
SHELL_TABLE_PER_M = 0.01  # the level tables have an entry every 100 m
DARK = 3e-5  # transmission below which a ray has seen enough
SUN_RADIUS_RAD = 0.00465
PACK = 4  # wavelengths marched together: a constant, so that LLVM unrolls; more of them take more passes
MOST_SAMPLES = 20_000
_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
PEAK_INNER = math.cos(math.radians(30.0))  # forward peak read out fully within 30 degrees of the sun,
PEAK_OUTER = 0.0  # not at all beyond 90 (transport.md section 2)


class Shells(NamedTuple):
    """The spherically symmetric part of the atmosphere, on levels (nl) above ``ground_m``, at PACK wavelengths."""

    radius_m: float
    ground_m: float
    top_m: float
    level_table: F64  # fractional level per 100 m above the ground
    extinction: F32  # (nl, PACK) delta-scaled, 1/m
    forward: F32  # (nl, PACK) what delta scaling takes off: omega f beta of the aerosol, 1/m
    scattering: F32  # (nl, M, PACK) Legendre moments of the delta-scaled scattering coefficient, 1/m
    sun_depth: F32  # (nl, n_mu, PACK) delta-scaled slant optical depth to the sun; axis sqrt of cosine above horizon
    sun_forward: F32  # (nl, n_mu, PACK) slant depth of `forward`
    moment_level_table: F64  # fractional index into the levels of `moments`, per 100 m
    moment_sun_table: F64  # fractional index into the suns of `moments`, by cosine from -1 to 1
    moments: F32  # (nlm, ns, M(M+1)/2, PACK) cosine harmonics of the diffuse radiance
    ground_flux: F32  # (ns, PACK) total flux reaching the ground below the shells, for E_TOA = 1 (delta-scaled)
    ground_albedo: F32  # (PACK,)


class Volume(NamedTuple):
    """The gridded part: (nz, ny, nx) nodes with channels interleaved, and how to find one's place in it.

    Channels: species extinctions; depths to the sun; cells free of cloud around; padding; sources (PACK) last.
    """

    chart_origin_m: float  # tangent-plane coordinate of chart[0, 0]
    chart_per_m: float
    chart: F64  # (n, n, 2): fractional ix, iy at [row v, column u]
    level_origin_m: float
    level_per_m: float
    level_table: F64  # fractional level, uniform in height
    top_m: float
    cell_m: F32  # (2,) nominal dx, dy
    spacing_m: F32  # (nz,) distance to the next level up
    periodic: bool
    species: int
    free_channel: int
    fields: F32  # (nz, ny, nx, channels), a multiple of PACK channels
    scaled: F32  # (species, PACK) delta-scaled extinction per reference extinction
    forward: F32  # (species, PACK) omega f times relative extinction
    depth_channel: NDArray[np.int64]  # (PACK,) channel of the delta-scaled depth to the sun
    forward_channel: NDArray[np.int64]  # (PACK,) channel of the forward depth to the sun
    terrain_m: F32  # (ny, nx)
    clear_cells: int  # longest step in clear air of the grid, in cells


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, inline="always")
def grid_index(x, y, z, radius_m, volume):
    """Fractional (ix, iy) of a point by the gnomonic chart; far outside the domain, a large negative pair."""
    depth = radius_m + z
    if depth <= 0.1 * radius_m:
        return -1e9, -1e9
    q = radius_m / depth
    u = (x * q - volume.chart_origin_m) * volume.chart_per_m
    v = (y * q - volume.chart_origin_m) * volume.chart_per_m
    n = volume.chart.shape[0] - 1
    if not volume.periodic and (u < 0.0 or v < 0.0 or u > n or v > n):
        return -1e9, -1e9
    i = min(max(int(u), 0), n - 1)
    j = min(max(int(v), 0), n - 1)
    a = u - i
    b = v - j
    c = volume.chart
    w00, w01, w10, w11 = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
    ix = c[j, i, 0] * w00 + c[j, i + 1, 0] * w01 + c[j + 1, i, 0] * w10 + c[j + 1, i + 1, 0] * w11
    iy = c[j, i, 1] * w00 + c[j, i + 1, 1] * w01 + c[j + 1, i, 1] * w10 + c[j + 1, i + 1, 1] * w11
    return ix, iy


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, inline="always")
def _bilinear(field, ix, iy):
    ny, nx = field.shape
    i = min(max(int(ix), 0), max(nx - 2, 0))
    j = min(max(int(iy), 0), max(ny - 2, 0))
    a = min(max(ix - i, 0.0), 1.0)
    b = min(max(iy - j, 0.0), 1.0)
    i1 = min(i + 1, nx - 1)
    j1 = min(j + 1, ny - 1)
    return (field[j, i] * (1 - a) + field[j, i1] * a) * (1 - b) + (field[j1, i] * (1 - a) + field[j1, i1] * a) * b


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, inline="always")
def _inside(ix, iy, volume):
    ny, nx = volume.terrain_m.shape
    return volume.periodic or (ix >= 0.0 and iy >= 0.0 and ix <= nx - 1.0 and iy <= ny - 1.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, inline="always")
def _ground_m(ix, iy, ground_m, volume):
    """Height of the ground at a place of the grid, or of the base of the shells outside it."""
    if _inside(ix, iy, volume) and not volume.periodic:
        return _bilinear(volume.terrain_m, ix, iy)
    return ground_m


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _above_ground_m(x, y, z, radius_m, ground_m, volume):
    """Height of a point over the terrain, or over the base of the shells outside the grid."""
    ix, iy = grid_index(x, y, z, radius_m, volume)
    return height_m(x, y, z, radius_m) - _ground_m(ix, iy, ground_m, volume)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, inline="always")
def sun_table_coordinate(mu, mu_horizon, count):
    """Fractional index on the sun axis of `sun_depth`: square root of the cosine above the horizon."""
    t = math.sqrt(max(0.0, (mu - mu_horizon) / (1.0 - mu_horizon))) * (count - 1)
    return min(t, count - 1.000001)


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True, fastmath=_FLAGS)
def _grid_nodes(ix, iy, h, volume, nodes):
    """Trilinear interpolation of all channels into ``nodes``."""
    nz, ny, nx, nc = volume.fields.shape
    fk = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
    k = min(int(fk), nz - 2)
    g = np.float32(fk - k)
    if volume.periodic:
        ix -= math.floor(ix / nx) * nx
        iy -= math.floor(iy / ny) * ny
    i0 = min(int(ix), nx - 1)
    j0 = min(int(iy), ny - 1)
    a = np.float32(ix - i0)
    b = np.float32(iy - j0)
    i1 = i0 + 1
    j1 = j0 + 1
    if i1 >= nx:
        i1 = 0 if volume.periodic else nx - 1
    if j1 >= ny:
        j1 = 0 if volume.periodic else ny - 1
    v00, v01, v10, v11 = (_ONE - b) * (_ONE - a), (_ONE - b) * a, b * (_ONE - a), b * a
    f = volume.fields
    for block in range(nc // PACK):
        base = block * PACK
        for w in range(PACK):
            n = base + w
            low = v00 * f[k, j0, i0, n] + v01 * f[k, j0, i1, n] + v10 * f[k, j1, i0, n] + v11 * f[k, j1, i1, n]
            high = (
                v00 * f[k + 1, j0, i0, n]
                + v01 * f[k + 1, j0, i1, n]
                + v10 * f[k + 1, j1, i0, n]
                + v11 * f[k + 1, j1, i1, n]
            )
            nodes[n] = low + g * (high - low)


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True, fastmath=_FLAGS)
def _sample(px, py, pz, h, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, nodes, basis, out, side):
    """Extinction, forward part and sources at a point, into out[side] (6, PACK).

    Rows: delta-scaled extinction; forward extinction; smooth source; source read with the full eye depth; reference
    extinction of all species (entry 0); delta-scaled extinction of the air alone.
    Returns (inside, cells free of cloud, ground height, ix, iy).
    """
    r = shells.radius_m + h
    up_x, up_y, up_z = px / r, py / r, (shells.radius_m + pz) / r
    mu_sun = up_x * sx + up_y * sy + up_z * sz
    above = max(h - shells.ground_m, 0.0)
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    k = min(int(level), shells.extinction.shape[0] - 2)
    c = np.float32(level - k)
    ratio = (r - above) / r
    mu_horizon = -math.sqrt(max(0.0, 1.0 - ratio * ratio))
    lit = np.float32(shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD))
    t = sun_table_coordinate(mu_sun, mu_horizon, shells.sun_depth.shape[1])
    m = int(t)
    e = np.float32(t - m)
    w00, w01, w10, w11 = (_ONE - c) * (_ONE - e), (_ONE - c) * e, c * (_ONE - e), c * e

    ix, iy = grid_index(px, py, pz, shells.radius_m, volume)
    over = _inside(ix, iy, volume)
    inside = over and h <= volume.top_m and volume.fields.shape[0] > 1
    ground = _ground_m(ix, iy, shells.ground_m, volume)
    free = 1.0e9
    ns = volume.species
    first = volume.fields.shape[3] - PACK
    cloud = _ZERO
    if inside:
        _grid_nodes(ix, iy, h, volume, nodes)
        free = nodes[volume.free_channel]
        for s in range(ns):
            cloud += nodes[s]

    # the air
    d, f = shells.sun_depth, shells.sun_forward
    degree = shells.scattering.shape[1]
    hazy = _ZERO
    deepest = _ZERO
    for w in range(PACK):
        extinction = shells.extinction[k, w] + c * (shells.extinction[k + 1, w] - shells.extinction[k, w])
        forward = shells.forward[k, w] + c * (shells.forward[k + 1, w] - shells.forward[k, w])
        depth = w00 * d[k, m, w] + w01 * d[k, m + 1, w] + w10 * d[k + 1, m, w] + w11 * d[k + 1, m + 1, w]
        peaked = w00 * f[k, m, w] + w01 * f[k, m + 1, w] + w10 * f[k + 1, m, w] + w11 * f[k + 1, m + 1, w]
        out[side, 0, w] = extinction
        out[side, 1, w] = forward
        out[side, 3, w] = _ZERO
        out[side, 4, w] = depth
        out[side, 5, w] = peaked
        hazy = max(hazy, forward)
    if inside:
        for w in range(PACK):
            out[side, 4, w] += nodes[volume.depth_channel[w]]
            out[side, 5, w] += nodes[volume.forward_channel[w]]
    for w in range(PACK):
        out[side, 4, w] = lit * transmission(out[side, 4, w])  # the beam
    if inside:
        for w in range(PACK):
            out[side, 2, w] = nodes[first + w]
    else:
        for w in range(PACK):
            out[side, 2, w] = _ZERO
        for ell in range(degree):
            p = np.float32(legendre[ell])
            for w in range(PACK):
                out[side, 2, w] += p * (
                    shells.scattering[k, ell, w] + c * (shells.scattering[k + 1, ell, w] - shells.scattering[k, ell, w])
                )
        for w in range(PACK):
            out[side, 2, w] *= out[side, 4, w]

    # the forward peak, read out near the sun with its broadening, elsewhere as single scattering (TMS)
    if hazy > _ZERO or cloud > _ZERO:
        share = np.float32(legendre[degree])
        n_depth = peak.shape[1] - 1
        for w in range(PACK):
            deepest = out[side, 5, w]
            p = deepest / (_ONE + deepest) * np.float32(n_depth)
            q = min(int(p), n_depth - 1)
            p -= np.float32(q)
            single = out[side, 1, w] * peak[ns, 0, w]
            resolved = out[side, 1, w] * (peak[ns, q, w] * (_ONE - p) + peak[ns, q + 1, w] * p)
            for s in range(ns):
                x = nodes[s] * volume.forward[s, w] if inside else _ZERO
                single += x * peak[s, 0, w]
                resolved += x * (peak[s, q, w] * (_ONE - p) + peak[s, q + 1, w] * p)
            out[side, 2, w] += (_ONE - share) * single * out[side, 4, w]
            out[side, 3, w] = share * resolved * out[side, 4, w]
    for w in range(PACK):
        out[side, 5, w] = out[side, 0, w]
        out[side, 4, w] = cloud
    if cloud > _ZERO:
        for s in range(ns):
            x = nodes[s]
            for w in range(PACK):
                out[side, 0, w] += x * volume.scaled[s, w]
                out[side, 1, w] += x * volume.forward[s, w]

    if not inside and shells.moments.shape[0] > 0:
        mu = up_x * dx + up_y * dy + up_z * dz
        sines = math.sqrt(max(0.0, (1.0 - mu * mu) * (1.0 - mu_sun * mu_sun)))
        cos_azimuth = 1.0
        if sines > 1e-9:
            cos_azimuth = min(1.0, max(-1.0, (dx * sx + dy * sy + dz * sz - mu * mu_sun) / sines))
        harmonics_symmetric(mu, cos_azimuth, degree, basis)
        km = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.moment_level_table)
        ms = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
        mom = shells.moments
        k0 = min(int(km), mom.shape[0] - 2)
        m0 = min(int(ms), mom.shape[1] - 2)
        c1 = np.float32(km - k0)
        e1 = np.float32(ms - m0)
        u00, u01, u10, u11 = (_ONE - c1) * (_ONE - e1), (_ONE - c1) * e1, c1 * (_ONE - e1), c1 * e1
        for ell in range(degree):
            for index in range(ell * (ell + 1) // 2, (ell + 1) * (ell + 2) // 2):
                y = np.float32(basis[index])
                for w in range(PACK):
                    sigma = shells.scattering[k, ell, w] + c * (shells.scattering[k + 1, ell, w] - shells.scattering[k, ell, w])
                    out[side, 2, w] += (
                        y
                        * sigma
                        * (
                            u00 * mom[k0, m0, index, w]
                            + u01 * mom[k0, m0 + 1, index, w]
                            + u10 * mom[k0 + 1, m0, index, w]
                            + u11 * mom[k0 + 1, m0 + 1, index, w]
                        )
                    )
    return inside, free, ground, ix, iy


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True, fastmath=_FLAGS)
def _step_m(h, mu, extinction, shells, volume, inside, free, ix, iy, scale):
    """Length of the next step: a fraction of the scale of what is there, and never past the grid's edge."""
    above = max(h - shells.ground_m, 0.0)
    scale_m = scale * (500.0 + 0.11 * above)
    slope = max(abs(mu), 0.02)
    vacuum = shells.extinction[0, 0] == 0.0
    step = 1e30 if vacuum else min(scale_m / slope, math.sqrt(shells.radius_m * scale_m))
    if extinction > 0.0:
        step = min(step, scale * 0.25 / extinction)
    if volume.fields.shape[0] <= 1:
        return step
    fk = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
    k = int(fk)
    if mu < 0.0 and fk == k and k > 0:
        k -= 1
    sine = math.sqrt(max(0.0, 1.0 - mu * mu))
    cell = min(min(volume.cell_m[0], volume.cell_m[1]) / max(sine, 1e-9), volume.spacing_m[k] / max(abs(mu), 1e-9))
    if inside:
        cells = max(free - 1.0, 1.0) if vacuum else min(max(free - 1.0, 1.0), volume.clear_cells * 1.0)
        step = scale * cells * cell if vacuum else min(step, scale * cells * cell)
        if mu > 0.0 and step > cell and h + step * mu > volume.top_m:
            step = max((volume.top_m - h) / mu + 0.01 * cell, 0.05 * cell)
    elif ix > -1e8:
        # like sphere tracing: no step longer than the way to the box
        ny, nx = volume.terrain_m.shape
        gx = max(max(-ix, ix - (nx - 1.0)), 0.0) * volume.cell_m[0]
        gy = max(max(-iy, iy - (ny - 1.0)), 0.0) * volume.cell_m[1]
        away = 0.0 if volume.periodic else 0.9 * max(gx, gy)
        if h > volume.top_m:
            fall = (h - volume.top_m) / max(-mu, 1e-9) if mu < 0.0 else 1e30
            away = max(away, fall * 0.999 + 0.01 * cell)
        step = min(step, max(away, cell))
    elif not vacuum:
        # outside the chart its margin is the least distance to the box
        step = min(step, max(0.1 * (volume.chart.shape[0] - 1) / volume.chart_per_m, cell))
    return step


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def march_ray(ox, oy, oz, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, depth_limit, scale, sides, nodes, basis,
              radiance, scaled_trans, full_trans, species_depth, front_depth):
    """Follow one eye ray to the ground, to space, or until nothing more is seen.

    Fills radiance, scaled_trans (e^-tau', what the smooth field sees), full_trans (e^-tau) (PACK,), the optical depth
    of each species, and the depth of air and haze in front of unit cloud depth. ``depth_limit``: cloud depth that ends
    the source (Eq. 12). ``sides`` (2, 6, PACK), ``nodes``, ``basis``: scratch. Returns (distance_m or -1, samples).
    """
    ns = volume.species
    for w in range(PACK):
        radiance[w] = _ZERO
        scaled_trans[w] = _ONE
        full_trans[w] = _ONE
        front_depth[w] = _ZERO
    for n in range(ns):
        species_depth[n] = _ZERO
    radius = shells.radius_m
    start = 0.0
    h = height_m(ox, oy, oz, radius)
    if h > shells.top_m:
        b = ox * dx + oy * dy + (radius + oz) * dz
        q = ox * ox + oy * oy + oz * (2.0 * radius + oz) - shells.top_m * (2.0 * radius + shells.top_m)
        disc = b * b - q
        if b >= 0.0 or disc <= 0.0:
            return -1.0, 0
        start = q / (-b + math.sqrt(disc))
        ox, oy, oz = ox + start * dx, oy + start * dy, oz + start * dz
        h = shells.top_m
    s = 0.0
    px, py, pz = ox, oy, oz
    near, far = 0, 1
    inside, free, ground, ix, iy = _sample(
        px, py, pz, h, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, nodes, basis, sides, near
    )
    resolved = legendre[legendre.shape[0] - 1] > 0.0
    samples = 1
    hit = False
    cloud_depth = _ZERO
    while samples < MOST_SAMPLES:
        mu = (px * dx + py * dy + (radius + pz) * dz) / (radius + h)
        most = _ZERO
        for w in range(PACK):
            most = max(most, sides[near, 5, w])
        step = _step_m(h, mu, most, shells, volume, inside, free, ix, iy, scale)
        if step > 1e20:  # nothing between here and the ground or space
            if mu >= 0.0:
                break
            step = (shells.ground_m - h) / mu * 1.0000001
        if inside and sides[near, 4, 0] > _ZERO:
            for n in range(ns):
                species_depth[n] += _HALF * np.float32(step) * nodes[n]
        qx, qy, qz = px + step * dx, py + step * dy, pz + step * dz
        hq = height_m(qx, qy, qz, radius)
        inside, free, ground, ix, iy = _sample(
            qx, qy, qz, hq, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, nodes, basis, sides, far
        )
        samples += 1
        if hq < ground:
            hit = True
            low, high = 0.0, step
            for _ in range(24):
                middle = 0.5 * (low + high)
                if _above_ground_m(px + middle * dx, py + middle * dy, pz + middle * dz, radius, shells.ground_m, volume) < 0.0:
                    high = middle
                else:
                    low = middle
                if high - low < 0.05:
                    break
            step = max(low, 1e-3)
            qx, qy, qz = px + step * dx, py + step * dy, pz + step * dz
            hq = height_m(qx, qy, qz, radius)
            inside, free, ground, ix, iy = _sample(
                qx, qy, qz, hq, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, nodes, basis, sides, far
            )
        ds = np.float32(step)
        if inside and sides[far, 4, 0] > _ZERO:
            for n in range(ns):
                species_depth[n] += _HALF * ds * nodes[n]
        shining = cloud_depth < depth_limit
        fronting = cloud_depth < _ONE
        cloud_depth += _HALF * ds * (sides[near, 4, 0] + sides[far, 4, 0])
        seen = _ZERO
        if shining and resolved:
            for w in range(PACK):
                bn = sides[near, 0, w] + sides[near, 1, w]
                bf = sides[far, 0, w] + sides[far, 1, w]
                tau = _HALF * (bn + bf) * ds
                radiance[w] += full_trans[w] * step_emission(
                    tau, transmission(tau), ds, sides[near, 3, w], sides[far, 3, w], bn, bf
                )
        for w in range(PACK):
            tau = _HALF * (sides[near, 0, w] + sides[far, 0, w]) * ds
            trans = transmission(tau)
            gain = step_emission(tau, trans, ds, sides[near, 2, w], sides[far, 2, w], sides[near, 0, w], sides[far, 0, w])
            radiance[w] += scaled_trans[w] * gain if shining else _ZERO
            full_trans[w] *= trans * transmission(_HALF * (sides[near, 1, w] + sides[far, 1, w]) * ds)
            scaled_trans[w] *= trans
            front_depth[w] += _HALF * (sides[near, 5, w] + sides[far, 5, w]) * ds if fronting else _ZERO
            seen = max(seen, scaled_trans[w])
        near = far
        far = 1 - near
        s += step
        px, py, pz, h = qx, qy, qz, hq
        if hit or seen < DARK or h >= shells.top_m:
            break
    return start + s if hit else -1.0, samples


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def prepare_ray(cos_angle, table, legendre, peak):
    """What is constant along a straight ray: (2l+1) P_l, the weight of the resolved peak, and the peak tables."""
    degree = legendre.shape[0] - 1
    p0, p1 = 1.0, cos_angle
    for ell in range(degree):
        legendre[ell] = (2 * ell + 1) * p0
        p0, p1 = p1, ((2 * ell + 3) * cos_angle * p1 - (ell + 1) * p0) / (ell + 2)
    legendre[degree] = smoothstep((cos_angle - PEAK_OUTER) / (PEAK_INNER - PEAK_OUTER))
    angle = math.acos(min(1.0, max(-1.0, cos_angle)))
    n = table.shape[1] - 1
    t = math.sqrt(angle / math.pi) * n
    i = min(int(t), n - 1)
    a = np.float32(t - i)
    depths = table.shape[2] if legendre[degree] > 0.0 else 1
    for s in range(table.shape[0]):
        for d in range(depths):
            for w in range(PACK):
                peak[s, d, w] = table[s, i, d, w] + a * (table[s, i + 1, d, w] - table[s, i, d, w])


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def view_kernel(origin, direction, sun, table, shells, volume, depth_limit, scale, radiance, scaled_trans, full_trans,
                species_depth, front_depth, distance, samples):
    """March every ray (n, 3); outputs per ray, distance negative where the ray leaves to space."""
    count = direction.shape[0]
    degree = shells.scattering.shape[1]
    block = 64
    for tile in prange((count + block - 1) // block):
        sides = np.zeros((2, 6, PACK), np.float32)
        nodes = np.zeros(volume.fields.shape[3], np.float32)
        basis = np.zeros(degree * (degree + 1) // 2, np.float64)
        legendre = np.zeros(degree + 1, np.float64)
        peak = np.zeros((table.shape[0], table.shape[2], PACK), np.float32)
        for n in range(tile * block, min(count, (tile + 1) * block)):
            dx, dy, dz = direction[n, 0], direction[n, 1], direction[n, 2]
            prepare_ray(dx * sun[0] + dy * sun[1] + dz * sun[2], table, legendre, peak)
            distance[n], samples[n] = march_ray(
                origin[n, 0], origin[n, 1], origin[n, 2], dx, dy, dz, sun[0], sun[1], sun[2], legendre, peak, shells,
                volume, depth_limit, scale, sides, nodes, basis, radiance[n], scaled_trans[n], full_trans[n],
                species_depth[n], front_depth[n],
            )


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def gather_kernel(place_m, sun_mu, mu, azimuth, weight, table, shells, volume, scale, moments, downward):
    """Diffuse field of the shells at (level, sun): harmonics of what arrives from every direction.

    One iteration of orders of scattering: rays from each node see the source of the moments now in ``shells``,
    and the lit ground. Peaks are not read (delta-scaled transport keeps them in the beam).
    ``downward`` (level, sun, PACK): diffuse flux through a horizontal surface.
    """
    nl, ns = place_m.shape[0], sun_mu.shape[0]
    degree = shells.scattering.shape[1]
    for node in prange(nl * ns):
        level, star = node // ns, node % ns
        h = place_m[level]
        sx = math.sqrt(max(0.0, 1.0 - sun_mu[star] ** 2))
        sz = sun_mu[star]
        sides = np.zeros((2, 6, PACK), np.float32)
        nodes = np.zeros(volume.fields.shape[3], np.float32)
        basis = np.zeros(degree * (degree + 1) // 2, np.float64)
        legendre = np.zeros(degree + 1, np.float64)
        peak = np.zeros((table.shape[0], table.shape[2], PACK), np.float32)
        radiance = np.zeros(PACK, np.float32)
        scaled = np.zeros(PACK, np.float32)
        full = np.zeros(PACK, np.float32)
        front = np.zeros(PACK, np.float32)
        none = np.zeros(max(volume.species, 1), np.float32)
        total = np.zeros((basis.shape[0], PACK), np.float64)
        flux = np.zeros(PACK, np.float64)
        for n in range(mu.shape[0]):
            sine = math.sqrt(max(0.0, 1.0 - mu[n] * mu[n]))
            dx, dy, dz = sine * math.cos(azimuth[n]), sine * math.sin(azimuth[n]), mu[n]
            prepare_ray(dx * sx + dz * sz, table, legendre, peak)
            length, _ = march_ray(
                0.0, 0.0, h, dx, dy, dz, sx, 0.0, sz, legendre, peak, shells, volume, 1e30, scale, sides, nodes, basis,
                radiance, scaled, full, none, front,
            )
            if length >= 0.0:
                ground_radiance(dx * length, dy * length, h + dz * length, sx, 0.0, sz, shells, front)
                for w in range(PACK):
                    radiance[w] += scaled[w] * front[w]
            harmonics_symmetric(mu[n], math.cos(azimuth[n]), degree, basis)
            for w in range(PACK):
                for index in range(basis.shape[0]):
                    total[index, w] += weight[n] * basis[index] * radiance[w]
                if mu[n] > 0.0:
                    flux[w] += weight[n] * mu[n] * radiance[w] / (4.0 * math.pi)
        for w in range(PACK):
            downward[level, star, w] = flux[w]
            for index in range(basis.shape[0]):
                moments[level, star, index, w] = total[index, w]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def ground_radiance(x, y, z, sx, sy, sz, shells, out):
    """L' of the Lambertian ground below the shells, lit by `ground_flux` at the local sun: 4 a E/E_TOA (Eq. 35)."""
    radius = shells.radius_m
    r = math.sqrt(x * x + y * y + (radius + z) * (radius + z))
    mu_sun = (x * sx + y * sy + (radius + z) * sz) / r
    t = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
    m = min(int(t), shells.ground_flux.shape[0] - 2)
    e = t - m
    for w in range(PACK):
        flux = (1 - e) * shells.ground_flux[m, w] + e * shells.ground_flux[m + 1, w]
        out[w] = 4.0 * shells.ground_albedo[w] * flux


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def ground_radiance_rows(place, sun, shells):
    """`ground_radiance` (n, PACK) at places (n, 3) on the ground."""
    out = np.zeros((place.shape[0], PACK), np.float32)
    for n in range(place.shape[0]):
        ground_radiance(place[n, 0], place[n, 1], place[n, 2], sun[0], sun[1], sun[2], shells, out[n])
    return out
