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

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
SHELL_TABLE_PER_M = 0.01  # the level tables have an entry every 100 m
DARK = 3e-5  # transmission below which a ray has seen enough
SUN_RADIUS_RAD = 0.00465
PACK = 4  # wavelengths marched together: a constant, so that LLVM unrolls; more of them take more passes
MOST_SAMPLES = 20_000
_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)

# A ray's scratch: one flat array of rows of PACK, so that LLVM sees that rows are apart and vectorises over them.
N_EXT, N_FWD, N_SMOOTH, N_PEAK, N_AIR = 0, PACK, 2 * PACK, 3 * PACK, 4 * PACK  # at the near end of a step
F_EXT, F_FWD, F_SMOOTH, F_PEAK, F_AIR = 5 * PACK, 6 * PACK, 7 * PACK, 8 * PACK, 9 * PACK  # at its far end
BEAM, DEPTH, SINGLE, RADIANCE = 10 * PACK, 11 * PACK, 12 * PACK, 13 * PACK
SCALED, FULL, FRONT, ROWS = 14 * PACK, 15 * PACK, 16 * PACK, 17 * PACK
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
    horizon: F64  # (nl,) cosine of the zenith angle of the horizon
    moment_level_table: F64  # fractional index into the levels of `moments`, per 100 m
    moment_sun_table: F64  # fractional index into the suns of `moments`, by cosine from -1 to 1
    moments: F32  # (nlm, ns, M(M+1)/2, PACK) cosine harmonics of the diffuse radiance
    ground_flux: F32  # (ns, PACK) total flux reaching the ground below the shells, for E_TOA = 1 (delta-scaled)
    ground_albedo: F32  # (PACK,)


class Volume(NamedTuple):
    """The gridded part: (nz, ny, nx) nodes with channels interleaved, and how to find one's place in it.

    Channels: delta-scaled depth to the sun, air included (PACK); smooth source with the haze's peak (PACK); species
    extinctions; forward depths to the sun; cells free of cloud around; padding to a multiple of PACK.
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
    forward_channel: NDArray[np.int64]  # (PACK,) channel of the forward depth to the sun
    air: F32  # (nz, 2, PACK) delta-scaled and forward extinction of the air on the levels, 1/m
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


@njit(cache=True, error_model="numpy", _nrt=False, inline="always", fastmath=_FLAGS)
def _sample_grid(ix, iy, h, legendre, peak, volume, nodes, row):
    """What a point of the grid does to light, into the far rows of the scratch (see `_sample_air`).

    Returns (reference extinction of all species, cells free of cloud).
    """
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
    cloud = _ZERO
    ns = volume.species
    for s in range(ns):
        cloud += nodes[2 * PACK + s]
    for w in range(PACK):
        low, high = volume.air[k, 0, w], volume.air[k + 1, 0, w]
        row[F_EXT + w] = low + g * (high - low)
        low, high = volume.air[k, 1, w], volume.air[k + 1, 1, w]
        row[F_FWD + w] = low + g * (high - low)
        row[F_SMOOTH + w] = nodes[PACK + w]
        row[BEAM + w] = nodes[w]
    for w in range(PACK):
        row[F_AIR + w] = row[F_EXT + w]
        row[F_PEAK + w] = _ZERO
    if cloud > _ZERO:
        # the forward peak: read out near the sun with its broadening, elsewhere as single scattering (TMS)
        share = np.float32(legendre[legendre.shape[0] - 1])
        n_depth = peak.shape[1] - 1
        for w in range(PACK):
            row[BEAM + w] = transmission(row[BEAM + w])
        if share < _ONE:
            for w in range(PACK):
                single = _ZERO
                for s in range(ns):
                    single += nodes[2 * PACK + s] * volume.forward[s, w] * peak[s, 0, w]
                row[SINGLE + w] = single
            for w in range(PACK):
                row[F_SMOOTH + w] += (_ONE - share) * row[SINGLE + w] * row[BEAM + w]
        if share > _ZERO:
            for w in range(PACK):
                row[DEPTH + w] = nodes[volume.forward_channel[w]]
            for w in range(PACK):
                row[DEPTH + w] = row[DEPTH + w] / (_ONE + row[DEPTH + w]) * np.float32(n_depth)
            for w in range(PACK):
                p = row[DEPTH + w]
                q = min(int(p), n_depth - 1)
                p -= np.float32(q)
                resolved = _ZERO
                for s in range(ns):
                    x = nodes[2 * PACK + s] * volume.forward[s, w]
                    resolved += x * (peak[s, q, w] * (_ONE - p) + peak[s, q + 1, w] * p)
                row[F_PEAK + w] = share * resolved * row[BEAM + w]
        for s in range(ns):
            x = nodes[2 * PACK + s]
            for w in range(PACK):
                row[F_EXT + w] += x * volume.scaled[s, w]
                row[F_FWD + w] += x * volume.forward[s, w]
    return cloud, nodes[volume.free_channel]


@njit(cache=True, error_model="numpy", _nrt=False, inline="always", fastmath=_FLAGS)
def _sample_air(mu, mu_sun, cos_angle, h, legendre, peak, shells, haze, basis, row):
    """What a point of the shells does to light, into the far rows of the scratch.

    F_EXT delta-scaled extinction; F_FWD forward extinction; F_SMOOTH smooth source; F_PEAK source read with the full
    eye depth; F_AIR delta-scaled extinction of the air alone. ``haze``: row of the aerosol in ``peak``.
    """
    above = max(h - shells.ground_m, 0.0)
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    k = min(int(level), shells.extinction.shape[0] - 2)
    c = np.float32(level - k)
    mu_horizon = shells.horizon[k] + (level - k) * (shells.horizon[k + 1] - shells.horizon[k])
    lit = np.float32(shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD))
    t = sun_table_coordinate(mu_sun, mu_horizon, shells.sun_depth.shape[1])
    m = int(t)
    e = np.float32(t - m)
    w00, w01, w10, w11 = (_ONE - c) * (_ONE - e), (_ONE - c) * e, c * (_ONE - e), c * e
    d, f = shells.sun_depth, shells.sun_forward
    degree = shells.scattering.shape[1]
    hazy = f.shape[1] > 2
    for w in range(PACK):
        low, high = shells.extinction[k, w], shells.extinction[k + 1, w]
        row[F_EXT + w] = low + c * (high - low)
        row[BEAM + w] = w00 * d[k, m, w] + w01 * d[k, m + 1, w] + w10 * d[k + 1, m, w] + w11 * d[k + 1, m + 1, w]
    for w in range(PACK):
        row[BEAM + w] = lit * transmission(row[BEAM + w])
        row[F_AIR + w] = row[F_EXT + w]
        row[F_FWD + w] = _ZERO
        row[F_PEAK + w] = _ZERO
        row[F_SMOOTH + w] = _ZERO
    for ell in range(degree):
        p = np.float32(legendre[ell])
        for w in range(PACK):
            low, high = shells.scattering[k, ell, w], shells.scattering[k + 1, ell, w]
            row[F_SMOOTH + w] += p * (low + c * (high - low))
    for w in range(PACK):
        row[F_SMOOTH + w] *= row[BEAM + w]
    if hazy:
        share = np.float32(legendre[degree])
        n_depth = peak.shape[1] - 1
        for w in range(PACK):
            low, high = shells.forward[k, w], shells.forward[k + 1, w]
            row[F_FWD + w] = low + c * (high - low)
            row[DEPTH + w] = w00 * f[k, m, w] + w01 * f[k, m + 1, w] + w10 * f[k + 1, m, w] + w11 * f[k + 1, m + 1, w]
            row[SINGLE + w] = peak[haze, 0, w]
        for w in range(PACK):
            row[F_SMOOTH + w] += (_ONE - share) * row[F_FWD + w] * row[SINGLE + w] * row[BEAM + w]
        if share > _ZERO:
            for w in range(PACK):
                row[DEPTH + w] = row[DEPTH + w] / (_ONE + row[DEPTH + w]) * np.float32(n_depth)
            for w in range(PACK):
                p = row[DEPTH + w]
                q = min(int(p), n_depth - 1)
                p -= np.float32(q)
                row[SINGLE + w] = peak[haze, q, w] * (_ONE - p) + peak[haze, q + 1, w] * p
            for w in range(PACK):
                row[F_PEAK + w] = share * row[F_FWD + w] * row[SINGLE + w] * row[BEAM + w]

    mom = shells.moments
    if mom.shape[0] > 0:
        sines = math.sqrt(max(0.0, (1.0 - mu * mu) * (1.0 - mu_sun * mu_sun)))
        cos_azimuth = 1.0
        if sines > 1e-9:
            cos_azimuth = min(1.0, max(-1.0, (cos_angle - mu * mu_sun) / sines))
        harmonics_symmetric(mu, cos_azimuth, degree, basis)
        km = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.moment_level_table)
        ms = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
        k0 = min(int(km), mom.shape[0] - 2)
        m0 = min(int(ms), mom.shape[1] - 2)
        c1 = np.float32(km - k0)
        e1 = np.float32(ms - m0)
        u00, u01, u10, u11 = (_ONE - c1) * (_ONE - e1), (_ONE - c1) * e1, c1 * (_ONE - e1), c1 * e1
        for ell in range(degree):
            for w in range(PACK):
                row[SINGLE + w] = _ZERO
            for index in range(ell * (ell + 1) // 2, (ell + 1) * (ell + 2) // 2):
                y = np.float32(basis[index])
                y00, y01, y10, y11 = y * u00, y * u01, y * u10, y * u11
                for w in range(PACK):
                    row[SINGLE + w] += (
                        y00 * mom[k0, m0, index, w]
                        + y01 * mom[k0, m0 + 1, index, w]
                        + y10 * mom[k0 + 1, m0, index, w]
                        + y11 * mom[k0 + 1, m0 + 1, index, w]
                    )
            for w in range(PACK):
                low, high = shells.scattering[k, ell, w], shells.scattering[k + 1, ell, w]
                row[F_SMOOTH + w] += row[SINGLE + w] * (low + c * (high - low))


@njit(cache=True, error_model="numpy", _nrt=False, inline="always", fastmath=_FLAGS)
def _step_m(h, mu, extinction, shells, volume, inside, free, ix, iy, scale):
    """Length of the next step: a fraction of the scale of what is there, and never past the grid's edge."""
    above = max(h - shells.ground_m, 0.0)
    scale_m = scale * (500.0 + 0.11 * above)
    vacuum = shells.extinction[0, 0] == 0.0
    step = 1e30 if vacuum else scale_m / max(abs(mu), 0.015)  # level rays bend out of their layer in 50 km or so
    if extinction > 0.0:
        step = min(step, scale * 0.25 / extinction)
    if volume.fields.shape[0] <= 1:
        return step
    fk = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
    k = int(fk)
    if mu < 0.0 and fk == k and k > 0:
        k -= 1
    across, along = min(volume.cell_m[0], volume.cell_m[1]), volume.spacing_m[k]
    # the step that crosses one cell: 1/max of the two rates, in one division
    sine = math.sqrt(max(0.0, 1.0 - mu * mu))
    cell = across * along / max(max(sine * along, abs(mu) * across), 1e-9)
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


@njit(cache=True, error_model="numpy", _nrt=False, inline="always", fastmath=_FLAGS)
def _advance(row, step_m, resolved, shining, fronting):
    """Add the light of one step and dim what lies behind it; then the far end becomes the near end of the next.

    Returns the largest delta-scaled transmission left. ``shining``, ``fronting``: 1 or 0.
    """
    ds = np.float32(step_m)
    if resolved:
        for w in range(PACK):
            near = row[N_EXT + w] + row[N_FWD + w]
            far = row[F_EXT + w] + row[F_FWD + w]
            tau = _HALF * (near + far) * ds
            gain = step_emission(tau, transmission(tau), ds, row[N_PEAK + w], row[F_PEAK + w], near, far)
            row[RADIANCE + w] += shining * row[FULL + w] * gain
    for w in range(PACK):
        tau = _HALF * (row[N_EXT + w] + row[F_EXT + w]) * ds
        trans = transmission(tau)
        gain = step_emission(
            tau, trans, ds, row[N_SMOOTH + w], row[F_SMOOTH + w], row[N_EXT + w], row[F_EXT + w]
        )
        row[RADIANCE + w] += shining * row[SCALED + w] * gain
        row[SCALED + w] *= trans
        row[FULL + w] *= trans * transmission(_HALF * (row[N_FWD + w] + row[F_FWD + w]) * ds)
        row[FRONT + w] += fronting * _HALF * (row[N_AIR + w] + row[F_AIR + w]) * ds
    for w in range(5 * PACK):
        row[N_EXT + w] = row[F_EXT + w]
    seen = _ZERO
    for w in range(PACK):
        seen = max(seen, row[SCALED + w])
    return seen


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def march_ray(ox, oy, oz, dx, dy, dz, sx, sy, sz, legendre, peak, shells, volume, depth_limit, scale, row, nodes, basis,
              species_depth):
    """Follow one eye ray to the ground, to space, or until nothing more is seen.

    Leaves in the scratch ``row`` (ROWS,): RADIANCE; SCALED, e^-tau', what the smooth field sees; FULL, e^-tau; FRONT,
    the depth of air and haze in front of unit cloud depth; and in ``species_depth`` the optical depth of each species.
    ``depth_limit``: cloud depth that ends the source (Eq. 12). ``nodes``, ``basis``: scratch.
    Returns (distance_m or -1, samples).
    """
    ns = volume.species
    for w in range(PACK):
        row[RADIANCE + w] = _ZERO
        row[SCALED + w] = _ONE
        row[FULL + w] = _ONE
        row[FRONT + w] = _ZERO
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
    qx, qy, qz, hq = px, py, pz, h
    resolved = legendre[legendre.shape[0] - 1] > 0.0
    samples = 0
    step = 0.0
    hit = False
    cloud_depth = _ZERO
    near_cloud = _ZERO
    inside = False
    gridded = volume.fields.shape[0] > 1
    cos_angle = dx * sx + dy * sy + dz * sz
    free, mu, ix, iy = 0.0, 0.0, 0.0, 0.0
    while samples < MOST_SAMPLES:
        # one place in the code samples, so that it is inlined once; the first pass has no step yet
        if samples > 0:
            most = _ZERO
            for w in range(PACK):
                most = max(most, row[N_AIR + w])
            step = _step_m(h, mu, most, shells, volume, inside, free, ix, iy, scale)
            if step > 1e20:  # nothing between here and the ground or space
                if mu >= 0.0:
                    break
                step = (shells.ground_m - h) / mu * 1.0000001
            qx, qy, qz = px + step * dx, py + step * dy, pz + step * dz
        hq = height_m(qx, qy, qz, radius)
        ix, iy = grid_index(qx, qy, qz, radius, volume)
        if samples > 0 and hq < _ground_m(ix, iy, shells.ground_m, volume):
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
            ix, iy = grid_index(qx, qy, qz, radius, volume)
        if near_cloud > _ZERO:
            for n in range(ns):
                species_depth[n] += _HALF * np.float32(step) * nodes[2 * PACK + n]
        inverse_r = 1.0 / (radius + hq)
        mu = (qx * dx + qy * dy + (radius + qz) * dz) * inverse_r
        inside = gridded and hq <= volume.top_m and _inside(ix, iy, volume)
        cloud = _ZERO
        if inside:
            cloud, free = _sample_grid(ix, iy, hq, legendre, peak, volume, nodes, row)
        else:
            mu_sun = (qx * sx + qy * sy + (radius + qz) * sz) * inverse_r
            _sample_air(mu, mu_sun, cos_angle, hq, legendre, peak, shells, ns, basis, row)
        samples += 1
        if samples == 1:
            for w in range(5 * PACK):
                row[N_EXT + w] = row[F_EXT + w]
            near_cloud = cloud
            continue
        if cloud > _ZERO:
            for n in range(ns):
                species_depth[n] += _HALF * np.float32(step) * nodes[2 * PACK + n]
        shining = _ONE if cloud_depth < depth_limit else _ZERO
        fronting = _ONE if cloud_depth < _ONE else _ZERO
        cloud_depth += _HALF * np.float32(step) * (near_cloud + cloud)
        seen = _advance(row, step, resolved, shining, fronting)
        near_cloud = cloud
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
        row = np.zeros(ROWS, np.float32)
        nodes = np.zeros(volume.fields.shape[3], np.float32)
        basis = np.zeros(degree * (degree + 1) // 2, np.float64)
        legendre = np.zeros(degree + 1, np.float64)
        peak = np.zeros((table.shape[0], table.shape[2], PACK), np.float32)
        for n in range(tile * block, min(count, (tile + 1) * block)):
            dx, dy, dz = direction[n, 0], direction[n, 1], direction[n, 2]
            prepare_ray(dx * sun[0] + dy * sun[1] + dz * sun[2], table, legendre, peak)
            distance[n], samples[n] = march_ray(
                origin[n, 0], origin[n, 1], origin[n, 2], dx, dy, dz, sun[0], sun[1], sun[2], legendre, peak, shells,
                volume, depth_limit, scale, row, nodes, basis, species_depth[n],
            )
            for w in range(PACK):
                radiance[n, w] = row[RADIANCE + w]
                scaled_trans[n, w] = row[SCALED + w]
                full_trans[n, w] = row[FULL + w]
                front_depth[n, w] = row[FRONT + w]


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
        row = np.zeros(ROWS, np.float32)
        nodes = np.zeros(volume.fields.shape[3], np.float32)
        basis = np.zeros(degree * (degree + 1) // 2, np.float64)
        legendre = np.zeros(degree + 1, np.float64)
        peak = np.zeros((table.shape[0], table.shape[2], PACK), np.float32)
        radiance = np.zeros(PACK, np.float32)
        front = np.zeros(PACK, np.float32)
        none = np.zeros(max(volume.species, 1), np.float32)
        total = np.zeros((basis.shape[0], PACK), np.float64)
        flux = np.zeros(PACK, np.float64)
        for n in range(mu.shape[0]):
            sine = math.sqrt(max(0.0, 1.0 - mu[n] * mu[n]))
            dx, dy, dz = sine * math.cos(azimuth[n]), sine * math.sin(azimuth[n]), mu[n]
            prepare_ray(dx * sx + dz * sz, table, legendre, peak)
            length, _ = march_ray(
                0.0, 0.0, h, dx, dy, dz, sx, 0.0, sz, legendre, peak, shells, volume, 1e30, scale, row, nodes, basis,
                none,
            )
            for w in range(PACK):
                radiance[w] = row[RADIANCE + w]
            if length >= 0.0:
                ground_radiance(dx * length, dy * length, h + dz * length, sx, 0.0, sz, shells, front)
                for w in range(PACK):
                    radiance[w] += row[SCALED + w] * front[w]
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
