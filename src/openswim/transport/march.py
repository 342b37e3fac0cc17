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
    PACK,
    choose_above,
    flat,
    height_m,
    height_of_square_m,
    largest,
    legendre_factor,
    pack_of,
    read,
    read_lanes,
    read_row,
    shadow_fraction,
    smoothstep,
    spread,
    step_emission,
    table_index,
    transmission,
    whole,
    write,
)

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
SHELL_TABLE_PER_M = 0.01  # the level tables have an entry every 100 m
DARK = 3e-5  # transmission below which a ray has seen enough
SUN_RADIUS_RAD = 0.00465
DEGREE = 5  # truncation order M of the smooth field: a constant, so that LLVM unrolls
HARMONICS = DEGREE * (DEGREE + 1) // 2
MOST_SAMPLES = 20_000
TILE = 64  # rays handed to a thread at a time
_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)

# What a ray leaves in its scratch, a row of packs
RADIANCE, SCALED, FULL, FRONT, ROWS = 0, PACK, 2 * PACK, 3 * PACK, 4 * PACK
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
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
    here = 2 * (j * (n + 1) + i)
    up = here + 2 * (n + 1)
    w00, w01, w10, w11 = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
    ix = flat(c, here) * w00 + flat(c, here + 2) * w01 + flat(c, up) * w10 + flat(c, up + 2) * w11
    iy = flat(c, here + 1) * w00 + flat(c, here + 3) * w01 + flat(c, up + 1) * w10 + flat(c, up + 3) * w11
    return ix, iy


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _bilinear(field, ix, iy):
    ny, nx = field.shape
    i = min(max(int(ix), 0), max(nx - 2, 0))
    j = min(max(int(iy), 0), max(ny - 2, 0))
    a = min(max(ix - i, 0.0), 1.0)
    b = min(max(iy - j, 0.0), 1.0)
    i1 = min(i + 1, nx - 1)
    j1 = min(j + 1, ny - 1)
    return (field[j, i] * (1 - a) + field[j, i1] * a) * (1 - b) + (field[j1, i] * (1 - a) + field[j1, i1] * a) * b


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _inside(ix, iy, volume):
    ny, nx = volume.terrain_m.shape
    return volume.periodic or (ix >= 0.0 and iy >= 0.0 and ix <= nx - 1.0 and iy <= ny - 1.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def sun_table_coordinate(mu, mu_horizon, count):
    """Fractional index on the sun axis of `sun_depth`: square root of the cosine above the horizon."""
    t = math.sqrt(max(0.0, (mu - mu_horizon) / (1.0 - mu_horizon))) * (count - 1)
    return min(t, count - 1.000001)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _lerp(a, b, share):
    return a + share * (b - a)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _four(array, n, right, up, v00, v01, v10, v11):
    """Bilinear mean of four packs of an array, at flat element n, to the right of it, and up."""
    return (
        v00 * read(array, n)
        + v01 * read(array, n + right)
        + v10 * read(array, n + up)
        + v11 * read(array, n + up + right)
    )


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _peak_row(peak, start, depth):
    """A forward peak (depths, PACK), from flat element ``start``, at forward optical depths: axis depth/(1 + depth)."""
    last = peak.shape[1] - 1
    p = depth / (_ONE + depth) * np.float32(last)
    q = whole(choose_above(p, np.float32(last - 1), np.float32(last - 1), p))
    low = read_lanes(peak, start, q)
    return low + (p - q) * (read_lanes(peak, start + PACK, q) - low)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _sample_grid(ix, iy, h, mu, legendre, peak, volume, nodes):
    """What a point of the grid does to light.

    Returns packs of delta-scaled extinction, forward extinction, smooth source, source read with the full eye depth
    and extinction of the air alone; then reference extinction of all species (each left in ``nodes``), cells free of
    cloud, and height of the layer ahead.
    """
    nz, ny, nx, nc = volume.fields.shape
    level = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
    k = min(int(level), nz - 2)
    g = np.float32(level - k)
    if volume.periodic:
        ix -= math.floor(ix / nx) * nx
        iy -= math.floor(iy / ny) * ny
    i = min(int(ix), nx - 1)
    j = min(int(iy), ny - 1)
    a = np.float32(ix - i)
    b = np.float32(iy - j)
    right, up = nc, nx * nc
    if i + 1 >= nx:
        right = -i * nc if volume.periodic else 0
    if j + 1 >= ny:
        up = -j * nx * nc if volume.periodic else 0
    v00, v01, v10, v11 = (_ONE - b) * (_ONE - a), (_ONE - b) * a, b * (_ONE - a), b * a
    here = ((k * ny + j) * nx + i) * nc
    above = here + ny * nx * nc
    f = volume.fields
    smooth = _lerp(
        _four(f, here + PACK, right, up, v00, v01, v10, v11), _four(f, above + PACK, right, up, v00, v01, v10, v11), g
    )
    for base in range(2 * PACK, nc, PACK):
        low = _four(f, here + base, right, up, v00, v01, v10, v11)
        write(nodes, base, _lerp(low, _four(f, above + base, right, up, v00, v01, v10, v11), g))
    cloud = _ZERO
    for s in range(volume.species):
        cloud += flat(nodes, 2 * PACK + s)
    air = _lerp(read_row(volume.air[k], 0), read_row(volume.air[k + 1], 0), g)
    forward = _lerp(read_row(volume.air[k], 1), read_row(volume.air[k + 1], 1), g)
    extinction = air
    resolved = spread(_ZERO)
    if cloud > _ZERO:
        beam = transmission(
            _lerp(_four(f, here, right, up, v00, v01, v10, v11), _four(f, above, right, up, v00, v01, v10, v11), g)
        )
        depth = spread(_ZERO)
        share = np.float32(legendre[DEGREE])
        if share > _ZERO:
            c = volume.forward_channel
            depth = pack_of(nodes[c[0]], nodes[c[1]], nodes[c[2]], nodes[c[3]])
        # the forward peak: read out near the sun with its broadening, elsewhere as single scattering (TMS)
        single = spread(_ZERO)
        for s in range(volume.species):
            x = flat(nodes, 2 * PACK + s)
            start = s * peak.shape[1] * PACK
            taken = x * read(volume.forward, s * PACK)
            extinction += x * read(volume.scaled, s * PACK)
            forward += taken
            single += taken * read(peak, start)
            if share > _ZERO:
                resolved += taken * _peak_row(peak, start, depth)
        smooth += (_ONE - share) * single * beam
        resolved *= share * beam
    ahead = int(level)
    if mu < 0.0 and level == ahead and ahead > 0:
        ahead -= 1
    return (
        extinction,
        forward,
        smooth,
        resolved,
        air,
        cloud,
        flat(nodes, volume.free_channel),
        flat(volume.spacing_m, ahead),
    )


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _diffuse_source(mu, mu_sun, cos_angle, above, lit_beam, level, share, legendre, shells):
    """Source of what is scattered by air and haze, once (``lit_beam``) and more often (`moments`), as a pack.

    ``level``, ``share``: place among the levels of `scattering`.
    """
    mom = shells.moments
    near, far = shells.scattering[level], shells.scattering[level + 1]
    source = spread(_ZERO)
    if mom.shape[0] == 0:
        for ell in range(DEGREE):
            scattering = _lerp(read_row(near, ell), read_row(far, ell), share)
            source += scattering * lit_beam * np.float32(legendre[ell])
        return source
    # cos(azimuth) sin(angle from zenith), limited to what round-off may bring
    sine = math.sqrt(max(0.0, 1.0 - mu * mu))
    sine_sun = math.sqrt(max(1e-12, 1.0 - mu_sun * mu_sun))
    x = np.float32(min(sine, max(-sine, (cos_angle - mu * mu_sun) / sine_sun)))
    z, square = np.float32(mu), np.float32(sine * sine)
    km = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.moment_level_table)
    ms = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
    k0 = min(int(km), mom.shape[0] - 2)
    m0 = min(int(ms), mom.shape[1] - 2)
    c1 = np.float32(km - k0)
    e1 = np.float32(ms - m0)
    u00, u01, u10, u11 = (_ONE - c1) * (_ONE - e1), (_ONE - c1) * e1, c1 * (_ONE - e1), c1 * e1
    right = HARMONICS * PACK
    up = mom.shape[1] * right
    start = k0 * up + m0 * right
    c, c_before = _ONE, _ZERO  # sin^m cos(m azimuth) of this order and the one before
    for ell in range(DEGREE):
        scattering = _lerp(read_row(near, ell), read_row(far, ell), share)
        total = lit_beam * np.float32(legendre[ell])
        c, c_before = _ONE, _ZERO
        for m in range(ell + 1):
            index = ell * (ell + 1) // 2 + m
            y = legendre_factor(index, z) * c
            total += y * _four(mom, start + index * PACK, right, up, u00, u01, u10, u11)
            c, c_before = (x if m == 0 else np.float32(2.0) * x * c - square * c_before), c
        source += scattering * total
    return source


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _sample_air(mu, mu_sun, cos_angle, h, legendre, peak, shells, haze):
    """What a point of the shells does to light: see `_sample_grid`. ``haze``: row of the aerosol in ``peak``."""
    above = max(h - shells.ground_m, 0.0)
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    k = min(int(level), shells.extinction.shape[0] - 2)
    c = np.float32(level - k)
    mu_horizon = _lerp(flat(shells.horizon, k), flat(shells.horizon, k + 1), level - k)
    lit = np.float32(shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD))
    columns = shells.sun_depth.shape[1]
    t = sun_table_coordinate(mu_sun, mu_horizon, columns)
    m = int(t)
    e = np.float32(t - m)
    w00, w01, w10, w11 = (_ONE - c) * (_ONE - e), (_ONE - c) * e, c * (_ONE - e), c * e
    place = (k * columns + m) * PACK
    extinction = _lerp(read_row(shells.extinction, k), read_row(shells.extinction, k + 1), c)
    beam = lit * transmission(_four(shells.sun_depth, place, PACK, columns * PACK, w00, w01, w10, w11))
    smooth = _diffuse_source(mu, mu_sun, cos_angle, above, beam, k, c, legendre, shells)
    forward, resolved = spread(_ZERO), spread(_ZERO)
    columns = shells.sun_forward.shape[1]
    if columns > 2:
        share = np.float32(legendre[DEGREE])
        forward = _lerp(read_row(shells.forward, k), read_row(shells.forward, k + 1), c)
        start = haze * peak.shape[1] * PACK
        smooth += (_ONE - share) * forward * read(peak, start) * beam
        if share > _ZERO:
            place = (k * columns + m) * PACK
            depth = _four(shells.sun_forward, place, PACK, columns * PACK, w00, w01, w10, w11)
            resolved = share * forward * beam * _peak_row(peak, start, depth)
    return extinction, forward, smooth, resolved, extinction


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _cell_m(mu, along, volume):
    """The way through one cell, whose layer is ``along`` high."""
    across = min(flat(volume.cell_m, 0), flat(volume.cell_m, 1))
    m = np.float32(mu)
    sine = math.sqrt(max(_ZERO, _ONE - m * m))
    # 1/max of the two rates, in one division
    return across * along / max(max(sine * along, abs(m) * across), np.float32(1e-9))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _next_level_m(h, mu, cell, along, volume):
    """Way to the next level of the grid, or just out of it where the ray stands on its last one."""
    near = 2e-3 * along
    if (mu > 0.0 and volume.top_m - h < near) or (mu < 0.0 and h - volume.level_origin_m < near):
        return 0.01 * cell
    level = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
    k = int(level)
    rise = (k + 1 - level) if mu > 0.0 else (level - k)
    if rise < 2e-3:
        rise += 1.0
    return max(rise * along, near) / max(abs(mu), 1e-3)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _step_m(h, mu, extinction, shells, volume, inside, free, along, ix, iy, scale):
    """Length of the next step: a fraction of the scale of what is there, and never past the grid's edge."""
    above = max(h - shells.ground_m, 0.0)
    scale_m = scale * (500.0 + 0.11 * above)
    vacuum = shells.extinction[0, 0] == 0.0
    step = 1e30 if vacuum else scale_m / max(abs(mu), 0.015)  # level rays bend out of their layer in 50 km or so
    if extinction > 0.0:
        step = min(step, scale * 0.25 / extinction)
    if volume.fields.shape[0] <= 1:
        return step
    if inside:
        cell = 1.0 * _cell_m(mu, along, volume)
        if free > 2.0:
            cells = free - 1.0 if vacuum else min(free - 1.0, volume.clear_cells * 1.0)
            step = scale * cells * cell if vacuum else min(step, scale * cells * cell)
            if mu > 0.0 and step > cell and h + step * mu > volume.top_m:
                step = max((volume.top_m - h) / mu + 0.01 * cell, 0.05 * cell)
            return step
        # within cloud the step does not wait for the fields; it ends on a level, where the fields have their kinks
        plane = _next_level_m(h, mu, cell, along, volume)
        return min(plane, scale * cell) if vacuum else min(min(step, plane), scale * cell)
    return _approach_m(h, mu, step, vacuum, volume, ix, iy)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _approach_m(h, mu, step, vacuum, volume, ix, iy):
    """A step outside the grid, made no longer than the way to the box (sphere tracing)."""
    level = table_index(h, volume.level_origin_m, volume.level_per_m, volume.level_table)
    k = int(level)
    if mu < 0.0 and level == k and k > 0:
        k -= 1
    cell = 1.0 * _cell_m(mu, flat(volume.spacing_m, k), volume)
    if ix > -1e8:
        ny, nx = volume.terrain_m.shape
        gx = max(max(-ix, ix - (nx - 1.0)), 0.0) * flat(volume.cell_m, 0)
        gy = max(max(-iy, iy - (ny - 1.0)), 0.0) * flat(volume.cell_m, 1)
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
def _ground_step_m(x, y, z, dx, dy, dz, step_m, radius_m, ground_m, volume):
    """Where in a step that ends below ground the ray meets it."""
    low, high = 0.0, step_m
    for _ in range(24):
        middle = 0.5 * (low + high)
        if _above_ground_m(x + middle * dx, y + middle * dy, z + middle * dz, radius_m, ground_m, volume) < 0.0:
            high = middle
        else:
            low = middle
        if high - low < 0.05:
            break
    return max(low, 1e-3)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def march_ray(
    ox,
    oy,
    oz,
    dx,
    dy,
    dz,
    sx,
    sy,
    sz,
    legendre,
    peak,
    shells,
    volume,
    highest_m,
    depth_limit,
    scale,
    row,
    nodes,
    species_depth,
):
    """Follow one eye ray to the ground, to space, or until nothing more is seen.

    Leaves in ``row`` (ROWS,): RADIANCE; SCALED, e^-tau', what the smooth field sees; FULL, e^-tau; FRONT, the depth of
    air and haze in front of unit cloud depth; and in ``species_depth`` the optical depth of each species.
    ``depth_limit``: cloud depth that ends the source (Eq. 12). ``highest_m``: no ground is higher. ``nodes``: scratch.
    Returns (distance_m or -1, samples).
    """
    ns = volume.species
    radiance, scaled, full, front = spread(_ZERO), spread(_ONE), spread(_ONE), spread(_ZERO)
    for n in range(ns):
        species_depth[n] = _ZERO
    radius = shells.radius_m
    start = 0.0
    h = height_m(ox, oy, oz, radius)
    met = True
    if h > shells.top_m:
        b = ox * dx + oy * dy + (radius + oz) * dz
        q = ox * ox + oy * oy + oz * (2.0 * radius + oz) - shells.top_m * (2.0 * radius + shells.top_m)
        disc = b * b - q
        met = b < 0.0 and disc > 0.0
        if met:
            start = q / (-b + math.sqrt(disc))
            ox, oy, oz = ox + start * dx, oy + start * dy, oz + start * dz
            h = shells.top_m
    # along the ray (R + h)^2 - R^2 = square + s (2 rise + s); r mu = rise + s; r mu_sun = sunward + s cos_angle
    square = ox * ox + oy * oy + oz * (2.0 * radius + oz)
    rise = ox * dx + oy * dy + (radius + oz) * dz
    sunward = ox * sx + oy * sy + (radius + oz) * sz
    cos_angle = dx * sx + dy * sy + dz * sz
    resolved = legendre[DEGREE] > 0.0
    gridded = volume.fields.shape[0] > 1
    s, step, mu, ix, iy = 0.0, 0.0, 0.0, -1e9, -1e9
    samples = 0
    hit, inside = False, False
    cloud_depth, near_cloud = _ZERO, _ZERO
    free, along = _ZERO, _ZERO
    extinction, forward, smooth, peaked, air = spread(_ZERO), spread(_ZERO), spread(_ZERO), spread(_ZERO), spread(_ZERO)
    while met and samples < MOST_SAMPLES:
        # one place in the code samples, so that it is inlined once; the first pass has no step yet
        if samples > 0:
            step = _step_m(h, mu, largest(air), shells, volume, inside, free, along, ix, iy, scale)
            if step > 1e20:  # nothing between here and the ground or space
                if mu >= 0.0:
                    break
                step = (shells.ground_m - h) / mu * 1.0000001
        t = s + step
        h = height_of_square_m(square + t * (2.0 * rise + t), radius)
        if gridded:
            ix, iy = grid_index(ox + t * dx, oy + t * dy, oz + t * dz, radius, volume)
        if h < highest_m and samples > 0 and h < _ground_m(ix, iy, shells.ground_m, volume):
            hit = True
            step = _ground_step_m(
                ox + s * dx, oy + s * dy, oz + s * dz, dx, dy, dz, step, radius, shells.ground_m, volume
            )
            t = s + step
            h = height_of_square_m(square + t * (2.0 * rise + t), radius)
            if gridded:
                ix, iy = grid_index(ox + t * dx, oy + t * dy, oz + t * dz, radius, volume)
        s = t
        ds = np.float32(step)
        if near_cloud > _ZERO:
            for n in range(ns):
                species_depth[n] += _HALF * ds * flat(nodes, 2 * PACK + n)
        inverse_r = 1.0 / (radius + h)
        mu = (rise + s) * inverse_r
        inside = gridded and h <= volume.top_m + 1e-3 and _inside(ix, iy, volume)
        cloud = _ZERO
        if inside:
            extinction_far, forward_far, smooth_far, peaked_far, air_far, cloud, free, along = _sample_grid(
                ix, iy, h, mu, legendre, peak, volume, nodes
            )
        else:
            extinction_far, forward_far, smooth_far, peaked_far, air_far = _sample_air(
                mu, (sunward + s * cos_angle) * inverse_r, cos_angle, h, legendre, peak, shells, ns
            )
        samples += 1
        if samples > 1:
            if cloud > _ZERO:
                for n in range(ns):
                    species_depth[n] += _HALF * ds * flat(nodes, 2 * PACK + n)
            shining = _ONE if cloud_depth < depth_limit else _ZERO
            fronting = _ONE if cloud_depth < _ONE else _ZERO
            cloud_depth += _HALF * ds * (near_cloud + cloud)
            depth = _HALF * (extinction + extinction_far) * ds
            trans = transmission(depth)
            gain = scaled * step_emission(depth, trans, ds, smooth, smooth_far, extinction, extinction_far)
            peak_depth = _HALF * (forward + forward_far) * ds
            peak_trans = transmission(peak_depth) * trans
            if resolved:
                gain += full * step_emission(
                    depth + peak_depth,
                    peak_trans,
                    ds,
                    peaked,
                    peaked_far,
                    extinction + forward,
                    extinction_far + forward_far,
                )
            radiance += shining * gain
            scaled *= trans
            full *= peak_trans
            front += fronting * _HALF * ds * (air + air_far)
        extinction, forward, smooth, peaked, air = extinction_far, forward_far, smooth_far, peaked_far, air_far
        near_cloud = cloud
        if samples > 1 and (hit or largest(scaled) < DARK or h >= shells.top_m):
            break
    write(row, RADIANCE, radiance)
    write(row, SCALED, scaled)
    write(row, FULL, full)
    write(row, FRONT, front)
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
    stride = table.shape[2] * PACK
    for s in range(table.shape[0]):
        start = (s * table.shape[1] + i) * stride
        for d in range(depths):
            low = read(table, start + d * PACK)
            write(peak, s * stride + d * PACK, low + a * (read(table, start + stride + d * PACK) - low))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _march_tile(
    first,
    last,
    origin,
    direction,
    sun,
    table,
    shells,
    volume,
    highest_m,
    depth_limit,
    scale,
    radiance,
    scaled_trans,
    full_trans,
    species_depth,
    front_depth,
    distance,
    samples,
    row,
    nodes,
    legendre,
    peak,
):
    """March rays ``first`` to ``last``: see `view_kernel`. One call for many: the arguments are long."""
    for n in range(first, last):
        dx, dy, dz = direction[n, 0], direction[n, 1], direction[n, 2]
        prepare_ray(dx * sun[0] + dy * sun[1] + dz * sun[2], table, legendre, peak)
        distance[n], samples[n] = march_ray(
            origin[n, 0],
            origin[n, 1],
            origin[n, 2],
            dx,
            dy,
            dz,
            sun[0],
            sun[1],
            sun[2],
            legendre,
            peak,
            shells,
            volume,
            highest_m,
            depth_limit,
            scale,
            row,
            nodes,
            species_depth[n],
        )
        for w in range(PACK):
            radiance[n, w] = row[RADIANCE + w]
            scaled_trans[n, w] = row[SCALED + w]
            full_trans[n, w] = row[FULL + w]
            front_depth[n, w] = row[FRONT + w]


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def view_kernel(
    origin,
    direction,
    sun,
    table,
    shells,
    volume,
    depth_limit,
    scale,
    radiance,
    scaled_trans,
    full_trans,
    species_depth,
    front_depth,
    distance,
    samples,
):
    """March every ray (n, 3); outputs per ray, distance negative where the ray leaves to space."""
    if shells.scattering.shape[1] != DEGREE:
        raise ValueError("the shells were built for another truncation order")
    count = direction.shape[0]
    highest_m = max(shells.ground_m, volume.terrain_m.max() * 1.0)
    for tile in prange((count + TILE - 1) // TILE):
        row = np.zeros(ROWS, np.float32)
        nodes = np.zeros(volume.fields.shape[3], np.float32)
        legendre = np.zeros(DEGREE + 1, np.float64)
        peak = np.zeros((table.shape[0], table.shape[2], PACK), np.float32)
        _march_tile(
            tile * TILE,
            min(count, (tile + 1) * TILE),
            origin,
            direction,
            sun,
            table,
            shells,
            volume,
            highest_m,
            depth_limit,
            scale,
            radiance,
            scaled_trans,
            full_trans,
            species_depth,
            front_depth,
            distance,
            samples,
            row,
            nodes,
            legendre,
            peak,
        )


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
