"""Sample: what a point of the grid, or of the shells, does to light on its way to the eye.

Eye rays are dimmed by the delta-scaled extinction; what the forward peaks scatter besides is gathered by itself, for by
it they broaden (docs/fast.md, F17) and the sun's disc fades.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import (
    PACK,
    choose_above,
    flat,
    high,
    low,
    read,
    read_double,
    read_lanes,
    read_quadruple,
    spread,
    whole,
    write,
)
from openswim.transport.engine.scalar import harmonics, shadow_fraction, smoothstep, table_index, transmission
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.forward_peak import peak_row
from openswim.transport.march.state import AEROSOL, MOLECULES, SPECIES, Sample
from openswim.transport.march.volume import AIR_DEGREE, DEGREE, SHELL_TABLE_PER_M, SUN_RADIUS_RAD

_ZERO, _ONE = FLOAT(0.0), FLOAT(1.0)
_LEAST = FLOAT(1e-20)  # extinction by which to divide, 1/m

# directions of `Shells.source`: cosines of the zenith angle, then of the azimuth from the sun's, each from -1 to 1
SOURCE_ZENITHS, SOURCE_AZIMUTHS = 33, 9


class Corners(NamedTuple):
    """The four nodes of a level around a place: steps to the right and up, in elements of an array; weights."""

    right: Any
    up: Any
    v00: Any
    v01: Any
    v10: Any
    v11: Any


@part(FINITE)
def prepare_ray(cos_angle, table, phase, volume, constants, peak):
    """Fill in `Ray.constants` and `Ray.peak` of straight rays by the cosine of their angle to the sun. Returns
    `Ray.share`.

    Molecules and aerosol: sum_l (2l+1) chi_l P_l(cos Theta) of the ``phase`` (2, AIR_DEGREE, PACK), and of each species
    the same of `Volume.single`, to which the part (1 - share) R(Theta, 0) of the peaks is added; ``peak`` is
    R(Theta, phi).
    """
    inner, outer = volume.peak_inner, volume.peak_outer
    share = FLOAT(smoothstep((cos_angle - outer) / (inner - outer)))
    for s in range(volume.species):
        write(constants, SPECIES + s * PACK, spread(_ZERO))
    for kind in range(2):
        p0, p1 = 1.0, cos_angle
        total = spread(_ZERO)
        for ell in range(AIR_DEGREE):
            legendre = FLOAT((2 * ell + 1) * p0)
            total += legendre * read(phase, (kind * AIR_DEGREE + ell) * PACK)
            if kind == 0 and ell < DEGREE:
                for s in range(volume.species):
                    once = legendre * read(volume.single, (s * DEGREE + ell) * PACK)
                    write(constants, SPECIES + s * PACK, read(constants, SPECIES + s * PACK) + once)
            p0, p1 = p1, ((2 * ell + 3) * cos_angle * p1 - (ell + 1) * p0) / (ell + 2)
        write(constants, kind * PACK, total)
    angle = math.acos(min(1.0, max(-1.0, cos_angle)))
    t = peak_row(angle, table.shape[1])
    i = min(int(t), table.shape[1] - 2)
    a = FLOAT(t - i)
    depths = table.shape[2] if share > _ZERO else 1
    stride = table.shape[2] * PACK
    for s in range(table.shape[0]):
        start = (s * table.shape[1] + i) * stride
        for d in range(depths):
            near = read(table, start + d * PACK)
            write(peak, s * stride + d * PACK, near + a * (read(table, start + stride + d * PACK) - near))
    write(constants, AEROSOL, read(constants, AEROSOL) + (_ONE - share) * read(peak, (table.shape[0] - 1) * stride))
    for s in range(volume.species):
        narrow = (_ONE - share) * read(peak, s * stride)
        write(constants, SPECIES + s * PACK, read(constants, SPECIES + s * PACK) + narrow)
    return share


@part(FINITE, inlined=True)
def _lerp(a, b, share):
    return a + share * (b - a)


@part(FINITE, inlined=True)
def _four(array, n, corners):
    """Bilinear mean of four quadruple packs of an array, the first at flat element n."""
    right, up = corners.right, corners.up
    low_row = corners.v00 * read_quadruple(array, n) + corners.v01 * read_quadruple(array, n + right)
    return low_row + (corners.v10 * read_quadruple(array, n + up) + corners.v11 * read_quadruple(array, n + up + right))


@part(FINITE, inlined=True)
def sun_table_coordinate(mu, mu_horizon, count):
    """Fractional index on the sun axis of `Shells.slant`: square root of the cosine above the horizon."""
    t = math.sqrt(max(0.0, (mu - mu_horizon) / (1.0 - mu_horizon))) * (count - 1)
    return min(t, count - 1.000001)


@part(FINITE, inlined=True)
def _peak_place(depth, count):
    """Row and share of the next of a peak table at forward optical depths: axis depth/(1 + depth). As sums of few
    mixtures' these may come out below zero."""
    last = FLOAT(count - 1)
    met = choose_above(depth, _ZERO, depth, _ZERO)
    p = met / (_ONE + met) * last
    q = whole(choose_above(p, last - _ONE, last - _ONE, p))
    return q, p - q


@part(FINITE, inlined=True)
def _peak_at(peak, start, q, part):
    """A forward peak (depths, PACK) that begins at flat element ``start``."""
    return _lerp(read_lanes(peak, start, q), read_lanes(peak, start + PACK, q), part)


@part(FINITE)
def turn_ray(dx, dy, dz, volume, constants):
    """Fill in the harmonics of the ray's direction behind what `prepare_ray` does, where sources are read by them."""
    if volume.turning.shape[0] > 0:
        harmonics(dx, dy, dz, DEGREE, constants[SPECIES + volume.species * PACK :])


@part(FINITE)
def _turned(node, corners, g, constants, volume):
    """The smooth source in the ray's direction between eight nodes, from flat element ``node`` on, ``g`` of the way to
    the level above: sum_lm Y_lm S_lm of those that have harmonics; of the others, toward the eye."""
    _, ny, nx, nc = volume.fields.shape
    right, up = corners.right // nc, corners.up // nc
    size = DEGREE * DEGREE * PACK
    first = SPECIES + volume.species * PACK
    total = spread(_ZERO)
    for corner in range(8):
        at = node + (ny * nx if corner >= 4 else 0) + (up if corner & 2 else 0) + (right if corner & 1 else 0)
        share = (g if corner >= 4 else _ONE - g) * (
            (corners.v11 if corner & 1 else corners.v10) if corner & 2 else (corners.v01 if corner & 1 else corners.v00)
        )
        start = int(flat(volume.turning_row, at)) * size
        if share > _ZERO:
            here = read(volume.fields, at * nc + PACK)
            if start > 0:
                here = spread(_ZERO)
                for n in range(DEGREE * DEGREE):
                    here += flat(constants, first + n) * read(volume.turning, start + n * PACK)
            total += share * here
    return total


@part(FINITE, inlined=True)
def sample_grid(ix, iy, level, ray, ahead, half_step_m, volume, nodes):
    """`Sample` of a point of the grid, at fractional indices; its channels are left in ``nodes``. With B' the root of
    the beam and x_s the species' reference extinction, all trilinear between nodes,

        beta' = beta'_air + sum_s x_s k_s,   beam = min(1, B'^2 e^-c),   single = sum_s x_s [P_s + w R_s(phi)] + air's,

    c what the beam's depth bends within the cell (`Volume.bend`), P_s and w R_s what `prepare_ray` filled in, R_s read
    at the forward depth phi from the sun to here and on to the eye: ``ahead`` is that between the eye and here but for
    this point's ``half_step_m``. What has detail is left out (0).
    """
    nz, ny, nx, nc = volume.fields.shape
    k = min(int(level), nz - 2)
    g = FLOAT(level - k)
    i = min(int(ix), nx - 1)
    j = min(int(iy), ny - 1)
    a = FLOAT(ix - i)
    b = FLOAT(iy - j)
    right, up = nc, nx * nc
    if i + 1 >= nx:
        right = -i * nc if volume.periodic else 0
    if j + 1 >= ny:
        up = -j * nx * nc if volume.periodic else 0
    v11 = a * b
    v01, v10 = a - v11, b - v11
    v00 = _ONE - a - v10
    corners = Corners(right, up, v00, v01, v10, v11)
    here = ((k * ny + j) * nx + i) * nc
    above = here + ny * nx * nc
    f = volume.fields
    node = _lerp(_four(f, here, corners), _four(f, above, corners), g)
    write(nodes, 0, node)
    for base in range(4 * PACK, nc, 4 * PACK):  # only where there are many species
        lower = _four(f, here + base, corners)
        write(nodes, base, _lerp(lower, _four(f, above + base, corners), g))
    air_row = _lerp(read_quadruple(volume.air, k * 4 * PACK), read_quadruple(volume.air, (k + 1) * 4 * PACK), g)
    air, forward = low(low(air_row)), high(high(air_row))
    resolved, single = spread(_ZERO), spread(_ZERO)
    root_of_beam = low(low(node))
    beam = root_of_beam * root_of_beam
    extinction, own = air, spread(_ZERO)
    cloud = flat(nodes, volume.cloud_channel)
    if cloud > _ZERO or volume.shining:
        for s in range(volume.species if cloud > _ZERO else 0):
            x = flat(nodes, 2 * PACK + s)
            own += x * read(volume.scaled, s * PACK)
            forward += x * read(volume.forward, s * PACK)
        extinction = air + own
        q, part = spread(_ZERO), spread(_ZERO)
        depths = ray.peak.shape[1]
        if ray.share > _ZERO:
            depth = spread(_ZERO)
            for n in range(volume.forward_factors.shape[0]):
                told = flat(nodes, 2 * PACK + volume.species + n)
                depth += told * read(volume.forward_factors, n * PACK)
            haze = _lerp(read(volume.haze_depth, k * PACK), read(volume.haze_depth, (k + 1) * PACK), g)
            q, part = _peak_place(depth + haze + ahead + half_step_m * forward, depths)
        # the forward peaks: read out near the sun with their broadening, elsewhere as single scattering (TMS)
        if volume.shining:
            # not from the nodes, whose own angles differ from the ray's
            aerosol = low(high(air_row))
            single = high(low(air_row)) * read(ray.constants, MOLECULES) + aerosol * read(ray.constants, AEROSOL)
            if ray.share > _ZERO:
                resolved = aerosol * _peak_at(ray.peak, volume.species * depths * PACK, q, part)
        if cloud > _ZERO:
            if volume.bend.shape[0] > 0:
                at = ((k * ny + j) * nx + i) * PACK
                bend = a * (_ONE - a) * flat(volume.bend, at) + b * (_ONE - b) * flat(volume.bend, at + 1)
                bend += g * (_ONE - g) * flat(volume.bend, at + 2)
                first = _ZERO  # of cloud's ``own`` extinctions, in proportion to which depths bend
                for s in range(volume.species):
                    first += flat(nodes, 2 * PACK + s) * flat(volume.scaled, s * PACK)
                beam *= transmission((bend / max(first, _LEAST)) * own)
                beam = choose_above(beam, _ONE, spread(_ONE), beam)
            for s in range(volume.species):
                x = flat(nodes, 2 * PACK + s)
                start = s * depths * PACK
                single += x * read(ray.constants, SPECIES + s * PACK)
                if ray.share > _ZERO:
                    resolved += x * _peak_at(ray.peak, start, q, part)
        single += ray.share * resolved
    source = high(low(node))
    if volume.turning.shape[0] > 0:
        source = _turned((k * ny + j) * nx + i, corners, g, ray.constants, volume)
    if volume.per_extinction:
        source *= extinction
    return Sample(extinction, forward, source, single, beam, air, cloud, _ZERO)


@part(FINITE, inlined=True)
def _towards(source, n, share):
    """Two packs of `Shells.source` that differ in azimuth, between a zenith angle and the next."""
    near = read_double(source, n)
    return near + share * (read_double(source, n + SOURCE_AZIMUTHS * PACK) - near)


@part(FINITE, inlined=True)
def _diffuse_source(mu, mu_sun, cos_angle, level, share, shells):
    """What diffuse light the shells scatter toward the eye, by the cosines of the zenith angle and of the azimuth."""
    x = (cos_angle - mu * mu_sun) / math.sqrt(max(1e-12, (1.0 - mu * mu) * (1.0 - mu_sun * mu_sun)))
    z = 0.5 * (SOURCE_ZENITHS - 1) * (1.0 + min(max(mu, -1.0), 1.0))
    x = 0.5 * (SOURCE_AZIMUTHS - 1) * (1.0 + min(max(x, -1.0), 1.0))
    i, j = min(int(z), SOURCE_ZENITHS - 2), min(int(x), SOURCE_AZIMUTHS - 2)
    a, b = FLOAT(z - i), FLOAT(x - j)
    suns = shells.source.shape[1]
    place = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
    m = min(int(place), suns - 2)
    e = FLOAT(place - m)
    u11 = share * e
    u01, u10 = e - u11, share - u11
    u00 = _ONE - share - u01
    right = SOURCE_ZENITHS * SOURCE_AZIMUTHS * PACK
    up = suns * right
    n = (level * suns + m) * right + (i * SOURCE_AZIMUTHS + j) * PACK
    f = shells.source
    both = u00 * _towards(f, n, a) + u01 * _towards(f, n + right, a)
    both += u10 * _towards(f, n + up, a) + u11 * _towards(f, n + up + right, a)
    return low(both) + b * (high(both) - low(both))


@part(FINITE, inlined=True)
def air_at(h_m, shells):
    """`Shells.rows` at a height, and between which levels that is: the lower, and the share of the other."""
    above_m = max(h_m - shells.ground_m, 0.0)
    level = table_index(above_m, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    k = min(int(level), shells.rows.shape[0] - 2)
    c = level - k
    rows = shells.rows
    row = _lerp(read_quadruple(rows, k * 4 * PACK), read_quadruple(rows, (k + 1) * 4 * PACK), FLOAT(c))
    return row, k, c


@part(FINITE, inlined=True)
def sample_air(mu, mu_sun, h_m, ray, ahead, half_step_m, shells):
    """`Sample` of a point of the shells, by the cosines of the zenith angles of the ray and of the sun, see
    `sample_grid`: beam = (the sun's disc over the horizon) e^-tau', tau' bilinear in level and root of the sun's
    cosine above the horizon; the aerosol's peak is the last of the ray's."""
    row, k, part_up = air_at(h_m, shells)
    mu_horizon = _lerp(flat(shells.horizon, k), flat(shells.horizon, k + 1), part_up)
    c = FLOAT(part_up)
    lit = FLOAT(shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD))
    columns = shells.slant.shape[1]
    t = sun_table_coordinate(mu_sun, mu_horizon, columns)
    m = int(t)
    e = FLOAT(t - m)
    v11 = c * e
    v01, v10 = e - v11, c - v11
    v00 = _ONE - c - v01
    right = 2 * PACK
    up = columns * right
    n = k * up + m * right
    slant = (
        v00 * read_double(shells.slant, n)
        + v01 * read_double(shells.slant, n + right)
        + v10 * read_double(shells.slant, n + up)
        + v11 * read_double(shells.slant, n + right + up)
    )
    extinction, molecules = low(low(row)), high(low(row))
    aerosol, forward = low(high(row)), high(high(row))
    beam = lit * transmission(low(slant))
    single = molecules * read(ray.constants, MOLECULES) + aerosol * read(ray.constants, AEROSOL)
    smooth = _diffuse_source(mu, mu_sun, ray.cos_angle, k, c, shells)
    if ray.share > _ZERO:
        depths = ray.peak.shape[1]
        q, part = _peak_place(high(slant) + ahead + half_step_m * forward, depths)
        haze = (ray.peak.shape[0] - 1) * depths * PACK
        single += ray.share * aerosol * _peak_at(ray.peak, haze, q, part)
    return Sample(extinction, forward, smooth, single, beam, extinction, _ZERO, _ZERO)
