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
    forward_depth_coordinate,
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
PEAK_INNER = math.cos(math.radians(30.0))  # forward peak read out fully within 30 degrees of the sun,
PEAK_OUTER = 0.0  # not at all beyond 90 (transport.md section 2)


class Shells(NamedTuple):
    """The spherically symmetric part of the atmosphere, on levels (nl) above ``ground_m``, at nw wavelengths."""

    radius_m: float
    ground_m: float
    top_m: float
    level_table: F64  # fractional level per 100 m above the ground
    extinction: F32  # (nl, nw) delta-scaled, 1/m
    forward: F32  # (nl, nw) what delta scaling takes off: omega f beta of the aerosol, 1/m
    scattering: F32  # (nl, nw, M) Legendre moments of the delta-scaled scattering coefficient, 1/m
    sun_depth: F32  # (nl, n_mu, nw) delta-scaled slant optical depth to the sun; axis sqrt of cosine above horizon
    sun_forward: F32  # (nl, n_mu, nw) slant depth of `forward`
    moment_level_table: F64  # fractional index into the levels of `moments`, per 100 m
    moment_sun_table: F64  # fractional index into the suns of `moments`, by cosine from -1 to 1
    moments: F32  # (nlm, ns, M(M+1)/2, nw) cosine harmonics of the diffuse radiance
    ground_flux: F32  # (ns, nw) total flux reaching the ground below the shells, for E_TOA = 1 (delta-scaled)
    ground_albedo: F32  # (nw,)


class Volume(NamedTuple):
    """The gridded part: (nz, ny, nx) nodes with channels interleaved, and how to find one's place in it."""

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
    fields: F32  # (nz, ny, nx, channels): species extinctions, sun depths, sources (nw), cells free of cloud
    scaled: F32  # (species, nw) delta-scaled extinction per reference extinction
    forward: F32  # (species, nw) omega f times relative extinction
    depth_channel: NDArray[np.int64]  # (nw,) channel of the delta-scaled depth to the sun
    forward_channel: NDArray[np.int64]  # (nw,) channel of the forward depth to the sun
    terrain_m: F32  # (ny, nx)
    clear_cells: int  # longest step in clear air of the grid, in cells


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
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
    ix = (c[j, i, 0] * (1 - a) + c[j, i + 1, 0] * a) * (1 - b) + (c[j + 1, i, 0] * (1 - a) + c[j + 1, i + 1, 0] * a) * b
    iy = (c[j, i, 1] * (1 - a) + c[j, i + 1, 1] * a) * (1 - b) + (c[j + 1, i, 1] * (1 - a) + c[j + 1, i + 1, 1] * a) * b
    return ix, iy


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def _bilinear(field, ix, iy):
    ny, nx = field.shape
    i = min(max(int(ix), 0), max(nx - 2, 0))
    j = min(max(int(iy), 0), max(ny - 2, 0))
    a = min(max(ix - i, 0.0), 1.0)
    b = min(max(iy - j, 0.0), 1.0)
    i1 = min(i + 1, nx - 1)
    j1 = min(j + 1, ny - 1)
    return (field[j, i] * (1 - a) + field[j, i1] * a) * (1 - b) + (field[j1, i] * (1 - a) + field[j1, i1] * a) * b


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def _inside(ix, iy, volume):
    ny, nx = volume.terrain_m.shape
    return volume.periodic or (ix >= 0.0 and iy >= 0.0 and ix <= nx - 1.0 and iy <= ny - 1.0)


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def surface_height_m(x, y, z, radius_m, ground_m, volume):
    """Height of the ground below a point: the terrain inside the grid, the base of the shells outside."""
    ix, iy = grid_index(x, y, z, radius_m, volume)
    if _inside(ix, iy, volume) and not volume.periodic:
        return _bilinear(volume.terrain_m, ix, iy)
    return ground_m


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def sun_table_coordinate(mu, mu_horizon, count):
    """Fractional index on the sun axis of `sun_depth`: square root of the cosine above the horizon."""
    t = math.sqrt(max(0.0, (mu - mu_horizon) / (1.0 - mu_horizon))) * (count - 1)
    return min(t, count - 1.000001)


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def _sample(px, py, pz, h, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, nodes, basis, out):
    """Extinction, forward part and sources at a point, into out (6, nw).

    Rows: delta-scaled extinction; forward extinction; smooth source; source read with the full eye depth; reference
    extinction of all species (entry 0); delta-scaled extinction of the air alone. Returns (inside, free cells).
    """
    nw = shells.extinction.shape[1]
    r = shells.radius_m + h
    up_x, up_y, up_z = px / r, py / r, (shells.radius_m + pz) / r
    mu_sun = up_x * sx + up_y * sy + up_z * sz
    above = h - shells.ground_m
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    k = min(int(level), shells.extinction.shape[0] - 2)
    c = level - k
    ratio = (shells.radius_m + shells.ground_m) / (r if above > 0.0 else shells.radius_m + shells.ground_m)
    mu_horizon = -math.sqrt(max(0.0, 1.0 - ratio * ratio))
    lit = shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD)
    t = sun_table_coordinate(mu_sun, mu_horizon, shells.sun_depth.shape[1])
    m = int(t)
    e = t - m
    w00, w01, w10, w11 = (1 - c) * (1 - e), (1 - c) * e, c * (1 - e), c * e

    ix, iy = grid_index(px, py, pz, shells.radius_m, volume)
    inside = _inside(ix, iy, volume) and h <= volume.top_m and volume.fields.shape[0] > 1
    free = 1.0e9
    ns = volume.species
    if inside:
        nz, ny, nx, nc = volume.fields.shape
        fk = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
        kk = min(int(fk), nz - 2)
        g = np.float32(fk - kk)
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
        one = np.float32(1.0)
        v000, v001 = (one - g) * (one - b) * (one - a), (one - g) * (one - b) * a
        v010, v011 = (one - g) * b * (one - a), (one - g) * b * a
        v100, v101 = g * (one - b) * (one - a), g * (one - b) * a
        v110, v111 = g * b * (one - a), g * b * a
        f = volume.fields
        for n in range(nc):
            nodes[n] = (
                v000 * f[kk, j0, i0, n]
                + v001 * f[kk, j0, i1, n]
                + v010 * f[kk, j1, i0, n]
                + v011 * f[kk, j1, i1, n]
                + v100 * f[kk + 1, j0, i0, n]
                + v101 * f[kk + 1, j0, i1, n]
                + v110 * f[kk + 1, j1, i0, n]
                + v111 * f[kk + 1, j1, i1, n]
            )
        free = nodes[nc - 1]

    cloud = np.float32(0.0)
    if inside:
        for s in range(ns):
            cloud += nodes[s]
    out[4, 0] = cloud

    for w in range(nw):
        extinction = (1 - c) * shells.extinction[k, w] + c * shells.extinction[k + 1, w]
        forward = (1 - c) * shells.forward[k, w] + c * shells.forward[k + 1, w]
        depth = 0.0
        sun_forward = 0.0
        if lit > 0.0:
            d = shells.sun_depth
            depth = w00 * d[k, m, w] + w01 * d[k, m + 1, w] + w10 * d[k + 1, m, w] + w11 * d[k + 1, m + 1, w]
            if forward > 0.0:
                d = shells.sun_forward
                sun_forward = w00 * d[k, m, w] + w01 * d[k, m + 1, w] + w10 * d[k + 1, m, w] + w11 * d[k + 1, m + 1, w]
        if inside:
            depth += nodes[volume.depth_channel[w]]
            sun_forward += nodes[volume.forward_channel[w]]
        beam = lit * transmission(np.float32(depth))
        smooth = 0.0
        if inside:
            smooth = nodes[nc - 1 - nw + w]
        else:
            for ell in range(shells.scattering.shape[2]):
                smooth += (
                    (1 - c) * shells.scattering[k, w, ell] + c * shells.scattering[k + 1, w, ell]
                ) * legendre[ell]
            smooth *= beam
        # the forward peak, read out near the sun with its broadening, elsewhere as single scattering (TMS)
        resolved = 0.0
        if forward > 0.0 or cloud > 0.0:
            n_depth = peak.shape[2] - 1
            p = forward_depth_coordinate(sun_forward) * n_depth
            q = min(int(p), n_depth - 1)
            p -= q
            single = 0.0
            if forward > 0.0:
                single += forward * peak[ns, w, 0]
                resolved += forward * (peak[ns, w, q] * (1 - p) + peak[ns, w, q + 1] * p)
            if cloud > 0.0:
                for s in range(ns):
                    x = nodes[s] * volume.forward[s, w]
                    single += x * peak[s, w, 0]
                    resolved += x * (peak[s, w, q] * (1 - p) + peak[s, w, q + 1] * p)
            smooth += (1.0 - legendre[-1]) * single * beam
            resolved *= legendre[-1] * beam
        out[5, w] = extinction
        if cloud > 0.0:
            for s in range(ns):
                extinction += nodes[s] * volume.scaled[s, w]
                forward += nodes[s] * volume.forward[s, w]
        out[0, w] = extinction
        out[1, w] = forward
        out[2, w] = smooth
        out[3, w] = resolved

    if not inside and shells.moments.shape[0] > 0:
        mu = up_x * dx + up_y * dy + up_z * dz
        sines = math.sqrt(max(0.0, (1.0 - mu * mu) * (1.0 - mu_sun * mu_sun)))
        cos_azimuth = 1.0
        if sines > 1e-9:
            cos_azimuth = min(1.0, max(-1.0, (dx * sx + dy * sy + dz * sz - mu * mu_sun) / sines))
        degree = shells.scattering.shape[2]
        harmonics_symmetric(mu, cos_azimuth, degree, basis)
        km = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.moment_level_table)
        ms = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
        k0 = min(int(km), shells.moments.shape[0] - 2)
        m0 = min(int(ms), shells.moments.shape[1] - 2)
        c1 = km - k0
        e1 = ms - m0
        u00, u01, u10, u11 = (1 - c1) * (1 - e1), (1 - c1) * e1, c1 * (1 - e1), c1 * e1
        mom = shells.moments
        for w in range(nw):
            total = 0.0
            index = 0
            for ell in range(degree):
                part = 0.0
                for _ in range(ell + 1):
                    part += basis[index] * (
                        u00 * mom[k0, m0, index, w]
                        + u01 * mom[k0, m0 + 1, index, w]
                        + u10 * mom[k0 + 1, m0, index, w]
                        + u11 * mom[k0 + 1, m0 + 1, index, w]
                    )
                    index += 1
                total += part * ((1 - c) * shells.scattering[k, w, ell] + c * shells.scattering[k + 1, w, ell])
            out[2, w] += max(total, 0.0)
    return inside, free


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def _step_m(h, mu, extinction, shells, volume, inside, free, px, py, pz, scale):
    """Length of the next step: a fraction of the scale of what is there, and never past the grid's edge."""
    above = max(h - shells.ground_m, 0.0)
    scale_m = scale * (500.0 + 0.11 * above)
    slope = max(abs(mu), 0.02)
    step = min(scale_m / slope, math.sqrt(shells.radius_m * scale_m))
    if extinction > 0.0:
        step = min(step, scale * 0.25 / extinction)
    else:
        step = 1e30 if shells.extinction[0, 0] == 0.0 else step
    if volume.fields.shape[0] > 1:
        fk = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
        level = volume.spacing_m[int(fk)]
        if mu < 0.0 and fk == int(fk) and fk > 0.0:
            level = volume.spacing_m[int(fk) - 1]
        sine = math.sqrt(max(0.0, 1.0 - mu * mu))
        cell = min(min(volume.cell_m[0], volume.cell_m[1]) / max(sine, 1e-9), level / max(abs(mu), 1e-9))
        if inside:
            cells = min(max(free - 1.0, 1.0), volume.clear_cells * 1.0)
            step = min(step, scale * cells * cell) if shells.extinction[0, 0] > 0.0 else scale * max(free - 1.0, 1.0) * cell
            if step > cell and h - volume.top_m + step * mu > 0.0 and mu > 0.0:
                step = max((volume.top_m - h) / mu + 0.01 * cell, 0.05 * cell)
        else:
            # like sphere tracing: no step longer than the way to the box
            ny, nx = volume.terrain_m.shape
            ix, iy = grid_index(px, py, pz, shells.radius_m, volume)
            if ix > -1e8:
                gx = max(max(-ix, ix - (nx - 1.0)), 0.0) * volume.cell_m[0]
                gy = max(max(-iy, iy - (ny - 1.0)), 0.0) * volume.cell_m[1]
                away = 0.0 if volume.periodic else 0.9 * max(gx, gy)
                if h > volume.top_m:
                    fall = (h - volume.top_m) / max(-mu, 1e-9) if mu < 0.0 else 1e30
                    away = max(away, fall * 0.999 + 0.01 * cell)
                step = min(step, max(away, cell))
            else:
                # outside the chart: the margin of the chart is the distance to the box
                n = volume.chart.shape[0] - 1
                margin = 0.1 * n / volume.chart_per_m
                step = min(step, max(margin, cell)) if n > 1 else step
    return step


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def march_ray(ox, oy, oz, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, depth_limit, scale, work, radiance,
              scaled_trans, full_trans, species_depth, front_depth):
    """Follow one eye ray to the ground, to space, or until nothing more is seen.

    Fills radiance, scaled_trans (e^-tau', what the smooth field sees), full_trans (e^-tau) (nw,), the optical depth of
    each species, and the depth of air and haze in front of unit cloud depth. ``depth_limit`` ends the source (Eq. 12).
    Returns (hit, distance_m, samples).
    """
    nw = radiance.shape[0]
    ns = volume.species
    near, far, nodes, basis = work
    for w in range(nw):
        radiance[w] = 0.0
        scaled_trans[w] = 1.0
        full_trans[w] = 1.0
        front_depth[w] = 0.0
    for s in range(ns):
        species_depth[s] = 0.0
    radius = shells.radius_m
    s = 0.0
    h = height_m(ox, oy, oz, radius)
    if h > shells.top_m:
        b = ox * dx + oy * dy + (radius + oz) * dz
        q = ox * ox + oy * oy + oz * (2.0 * radius + oz) - shells.top_m * (2.0 * radius + shells.top_m)
        disc = b * b - q
        if b >= 0.0 or disc <= 0.0:
            return False, -1.0, 0
        s = q / (-b + math.sqrt(disc))
        ox, oy, oz = ox + s * dx, oy + s * dy, oz + s * dz
        h = shells.top_m
    start = s
    s = 0.0
    px, py, pz = ox, oy, oz
    inside, free = _sample(px, py, pz, h, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, nodes, basis, near)
    species_near = np.float32(0.0)
    samples = 1
    hit = False
    cloud_depth = 0.0
    while samples < 20000:
        mu = (px * dx + py * dy + (radius + pz) * dz) / (radius + h)
        most = 0.0
        for w in range(nw):
            most = max(most, near[0, w])
        step = _step_m(h, mu, most, shells, volume, inside, free, px, py, pz, scale)
        if step > 1e20:  # nothing between here and the ground or space
            step = (shells.ground_m - h) / min(mu, -1e-12) * 1.0000001 if mu < 0.0 else 1e30
            if step > 1e20:
                break
        qx, qy, qz = px + step * dx, py + step * dy, pz + step * dz
        hq = height_m(qx, qy, qz, radius)
        ground = surface_height_m(qx, qy, qz, radius, shells.ground_m, volume)
        if hq < ground:
            hit = True
            lo, hi = 0.0, step
            for _ in range(24):
                mid = 0.5 * (lo + hi)
                qx, qy, qz = px + mid * dx, py + mid * dy, pz + mid * dz
                hq = height_m(qx, qy, qz, radius)
                if hq < surface_height_m(qx, qy, qz, radius, shells.ground_m, volume):
                    hi = mid
                else:
                    lo = mid
                if hi - lo < 0.05:
                    break
            step = max(lo, 1e-3)
            qx, qy, qz = px + step * dx, py + step * dy, pz + step * dz
            hq = height_m(qx, qy, qz, radius)
        for n in range(ns):
            species_near = nodes[n] if inside else np.float32(0.0)
            species_depth[n] += 0.5 * step * species_near
        inside, free = _sample(qx, qy, qz, hq, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, nodes, basis, far)
        samples += 1
        for n in range(ns):
            species_near = nodes[n] if inside else np.float32(0.0)
            species_depth[n] += 0.5 * step * species_near
        gain = 0.5 * step * (near[4, 0] + far[4, 0])
        seen = 0.0
        ds = np.float32(step)
        for w in range(nw):
            tau = np.float32(0.5) * (near[0, w] + far[0, w]) * ds
            tr = transmission(tau)
            if cloud_depth < depth_limit:
                radiance[w] += scaled_trans[w] * step_emission(
                    tau, tr, ds, near[2, w], far[2, w], near[0, w], far[0, w]
                )
                if near[3, w] != 0.0 or far[3, w] != 0.0:
                    bn = near[0, w] + near[1, w]
                    bf = far[0, w] + far[1, w]
                    tau_full = np.float32(0.5) * (bn + bf) * ds
                    radiance[w] += full_trans[w] * step_emission(
                        tau_full, transmission(tau_full), ds, near[3, w], far[3, w], bn, bf
                    )
            full_trans[w] *= tr * transmission(np.float32(0.5) * (near[1, w] + far[1, w]) * ds)
            scaled_trans[w] *= tr
            if cloud_depth < 1.0:
                front_depth[w] += np.float32(0.5) * (near[5, w] + far[5, w]) * ds
            seen = max(seen, scaled_trans[w])
        cloud_depth += gain
        near, far = far, near
        s += step
        px, py, pz, h = qx, qy, qz, hq
        if hit or seen < DARK:
            break
        if h >= shells.top_m:
            break
    return hit, start + s, samples


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def prepare_ray(cos_angle, table, legendre, peak):
    """What is constant along a straight ray: (2l+1) P_l, the weight of the resolved peak, and the peak tables."""
    degree = legendre.shape[0] - 1
    p0, p1 = 1.0, cos_angle
    for ell in range(degree):
        legendre[ell] = (2 * ell + 1) * p0
        p0, p1 = p1, ((2 * ell + 3) * cos_angle * p1 - (ell + 1) * p0) / (ell + 2)
    legendre[degree] = smoothstep((cos_angle - PEAK_OUTER) / (PEAK_INNER - PEAK_OUTER))
    angle = math.acos(min(1.0, max(-1.0, cos_angle)))
    n = table.shape[2] - 1
    t = math.sqrt(angle / math.pi) * n
    i = min(int(t), n - 1)
    a = t - i
    for s in range(table.shape[0]):
        for w in range(table.shape[1]):
            for d in range(table.shape[3]):
                peak[s, w, d] = table[s, w, i, d] * (1 - a) + table[s, w, i + 1, d] * a


@njit(cache=True, error_model="numpy")
def ray_work(nw, channels, degree):
    """Scratch arrays of one ray."""
    return (
        np.zeros((6, nw), np.float32),
        np.zeros((6, nw), np.float32),
        np.zeros(channels, np.float32),
        np.zeros(degree * (degree + 1) // 2, np.float64),
    )


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def view_kernel(origin, direction, sun, table, shells, volume, depth_limit, scale, radiance, scaled_trans, full_trans,
                species_depth, front_depth, distance, samples):
    """March every ray (n, 3); outputs per ray, distance negative where the ray leaves to space."""
    count = direction.shape[0]
    nw = radiance.shape[1]
    degree = shells.scattering.shape[2]
    block = 64
    for tile in prange((count + block - 1) // block):
        work = ray_work(nw, volume.fields.shape[3], degree)
        legendre = np.zeros(degree + 1, np.float64)
        peak = np.zeros((table.shape[0], nw, table.shape[3]), np.float32)
        for n in range(tile * block, min(count, (tile + 1) * block)):
            dx, dy, dz = direction[n, 0], direction[n, 1], direction[n, 2]
            prepare_ray(dx * sun[0] + dy * sun[1] + dz * sun[2], table, legendre, peak)
            hit, length, steps = march_ray(
                origin[n, 0], origin[n, 1], origin[n, 2], dx, dy, dz, sun[0], sun[1], sun[2], legendre, peak, shells,
                volume, depth_limit, scale, work, radiance[n], scaled_trans[n], full_trans[n], species_depth[n],
                front_depth[n],
            )
            distance[n] = length if hit else -1.0
            samples[n] = steps


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def gather_kernel(place_m, sun_mu, mu, azimuth, weight, table, shells, volume, scale, moments, downward):
    """Diffuse field of the shells at (level, sun): harmonics of what arrives from every direction.

    One iteration of orders of scattering: rays from each node see the source of the moments now in ``shells``,
    and the lit ground. Peaks are not read (delta-scaled transport keeps them in the beam).
    ``downward`` (level, sun, nw): diffuse flux through a horizontal surface.
    """
    nl, ns = place_m.shape[0], sun_mu.shape[0]
    nw = shells.extinction.shape[1]
    degree = shells.scattering.shape[2]
    for node in prange(nl * ns):
        level, star = node // ns, node % ns
        h = place_m[level]
        sx = math.sqrt(max(0.0, 1.0 - sun_mu[star] ** 2))
        sz = sun_mu[star]
        work = ray_work(nw, volume.fields.shape[3], degree)
        legendre = np.zeros(degree + 1, np.float64)
        peak = np.zeros((table.shape[0], nw, table.shape[3]), np.float32)
        radiance = np.zeros(nw, np.float32)
        scaled = np.zeros(nw, np.float32)
        full = np.zeros(nw, np.float32)
        front = np.zeros(nw, np.float32)
        none = np.zeros(max(volume.species, 1), np.float32)
        basis = np.zeros(degree * (degree + 1) // 2, np.float64)
        total = np.zeros((basis.shape[0], nw), np.float64)
        flux = np.zeros(nw, np.float64)
        for n in range(mu.shape[0]):
            sine = math.sqrt(max(0.0, 1.0 - mu[n] * mu[n]))
            dx, dy, dz = sine * math.cos(azimuth[n]), sine * math.sin(azimuth[n]), mu[n]
            prepare_ray(dx * sx + dz * sz, table, legendre, peak)
            hit, length, _ = march_ray(
                0.0, 0.0, h, dx, dy, dz, sx, 0.0, sz, legendre, peak, shells, volume, 1e30, scale, work, radiance,
                scaled, full, none, front,
            )
            if hit:
                ground_radiance(dx * length, dy * length, h + dz * length, sx, 0.0, sz, shells, front)
                for w in range(nw):
                    radiance[w] += scaled[w] * front[w]
            harmonics_symmetric(mu[n], math.cos(azimuth[n]), degree, basis)
            for w in range(nw):
                for index in range(basis.shape[0]):
                    total[index, w] += weight[n] * basis[index] * radiance[w]
                if mu[n] > 0.0:
                    flux[w] += weight[n] * mu[n] * radiance[w] / (4.0 * math.pi)
        for w in range(nw):
            downward[level, star, w] = flux[w]
            for index in range(basis.shape[0]):
                moments[level, star, index, w] = total[index, w]


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def ground_radiance(x, y, z, sx, sy, sz, shells, out):
    """L' of the Lambertian ground below the shells, lit by `ground_flux` at the local sun: 4 a E/E_TOA (Eq. 35)."""
    radius = shells.radius_m
    r = math.sqrt(x * x + y * y + (radius + z) * (radius + z))
    mu_sun = (x * sx + y * sy + (radius + z) * sz) / r
    t = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
    m = min(int(t), shells.ground_flux.shape[0] - 2)
    e = t - m
    for w in range(shells.ground_albedo.shape[0]):
        flux = (1 - e) * shells.ground_flux[m, w] + e * shells.ground_flux[m + 1, w]
        out[w] = 4.0 * shells.ground_albedo[w] * flux


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def ground_radiance_rows(place, sun, shells):
    """`ground_radiance` (n, nw) at places (n, 3) on the ground."""
    out = np.zeros((place.shape[0], shells.ground_albedo.shape[0]), np.float32)
    for n in range(place.shape[0]):
        ground_radiance(place[n, 0], place[n, 1], place[n, 2], sun[0], sun[1], sun[2], shells, out[n])
    return out
