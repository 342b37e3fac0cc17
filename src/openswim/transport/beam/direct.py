"""The sun's light in the grid: terrain shadows, direct transmission.

`sun` is the direction to the sun in each column's own axes. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math

from openswim.transport.beam.sun_sweep import BEYOND
from openswim.transport.engine.compiled import REORDERED, kernel, part
from openswim.transport.engine.pack import PACK, choose_above, flat, read, write
from openswim.transport.engine.scalar import shadow_fraction, table_index, transmission
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.sample import sun_table_coordinate
from openswim.transport.march.volume import SHELL_TABLE_PER_M, SUN_RADIUS_RAD

_HALF, _ONE = FLOAT(0.5), FLOAT(1.0)
_DARKEST, _MOST_AIR = 1e-12, FLOAT(27.631)  # transmission, and its depth, that stand for none
_MOST = FLOAT(80.0)  # depth: what lies deeper still has a beam that `beam.py` can tell from none


@part(REORDERED, merged=True)
def _plane_value(plane, x, y):
    """Bilinear value at fractional (x, y); the caller has made sure that the point is inside."""
    ny, nx = plane.shape
    i = min(int(x), nx - 1)
    j = min(int(y), ny - 1)
    a = FLOAT(x - i)
    b = FLOAT(y - j)
    i1, j1 = min(i + 1, nx - 1), min(j + 1, ny - 1)
    return (plane[j, i] * (_ONE - a) + plane[j, i1] * a) * (_ONE - b) + (
        plane[j1, i] * (_ONE - a) + plane[j1, i1] * a
    ) * b


@part(REORDERED)
def _shadow_row(j, terrain_m, sun, cell_m, radius_m, shadow_m, distance_m):
    """A row of nodes: see `shadow_rows`."""
    ny, nx = terrain_m.shape
    for i in range(nx):
        mu = sun[j, i, 2]
        sine = math.sqrt(max(1e-12, 1.0 - mu * mu))
        vx, vy = sun[j, i, 0] / sine / cell_m[0], sun[j, i, 1] / sine / cell_m[1]
        ds = 0.7 / max(abs(vx), abs(vy), 1e-9)
        highest = -1e9
        ridge = 0.0
        steps = int(1.5 * (nx + ny) / 0.7)
        for n in range(1, steps):
            s = n * ds
            x, y = i + vx * s, j + vy * s
            if x < 0.0 or y < 0.0 or x > nx - 1.0 or y > ny - 1.0:
                break
            h = _plane_value(terrain_m, x, y) - s * mu / sine - s * s / (2.0 * radius_m)
            if h > highest:
                highest = h
                ridge = s
        shadow_m[j, i] = highest
        distance_m[j, i] = ridge


@kernel(REORDERED)
def shadow_rows(t, threads, terrain_m, sun, cell_m, radius_m, shadow_m, distance_m):
    """Height (ny, nx) up to which the terrain of an open domain hides the sun, and the distance of the ridge."""
    for j in range(t, terrain_m.shape[0], threads):
        _shadow_row(j, terrain_m, sun, cell_m, radius_m, shadow_m, distance_m)


@kernel(REORDERED)
def shell_transmission(height_m, mu_sun, w, shells):
    """Delta-scaled transmission of the shells from the sun to a height (m above sea level), at wavelength w."""
    above = max(height_m - shells.ground_m, 0.0)
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    k = min(int(level), shells.rows.shape[0] - 2)
    c = level - k
    ratio = (shells.radius_m + shells.ground_m) / (shells.radius_m + shells.ground_m + above)
    mu_horizon = -math.sqrt(max(0.0, 1.0 - ratio * ratio))
    lit = shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD)
    if lit <= 0.0:
        return 0.0
    t = sun_table_coordinate(mu_sun, mu_horizon, shells.slant.shape[1])
    m = int(t)
    e = t - m
    d = shells.slant
    depth = (d[k, m, w] * (1 - e) + d[k, m + 1, w] * e) * (1 - c) + (
        d[k + 1, m, w] * (1 - e) + d[k + 1, m + 1, w] * e
    ) * c
    return lit * math.exp(-depth)


@part(REORDERED)
def _beam_row(k, j, depth, factors, sun, levels_m, shadow_m, distance_m, count, shells, beams, fields):
    """The nodes of a row: see `direct_beam`."""
    mixtures, nz, ny, width = depth.shape
    above = max(levels_m[k] - shells.ground_m, 0.0)
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    row = min(int(level), shells.rows.shape[0] - 2)
    c = FLOAT(level - row)
    ratio = (shells.radius_m + shells.ground_m) / (shells.radius_m + shells.ground_m + above)
    mu_horizon = -math.sqrt(max(0.0, 1.0 - ratio * ratio))
    softness = levels_m[min(k + 1, nz - 1)] - levels_m[max(k - 1, 0)]
    columns = shells.slant.shape[1]
    for i in range(sun.shape[1]):
        mu = sun[j, i, 2]
        lit = lit_fraction(levels_m[k], shadow_m[j, i], distance_m[j, i], softness)
        lit *= shadow_fraction(mu, mu_horizon, SUN_RADIUS_RAD)
        t = sun_table_coordinate(mu, mu_horizon, columns)
        m = int(t)
        e = FLOAT(t - m)
        n = (row * columns + m) * 2 * PACK
        up = columns * 2 * PACK
        near, far = read(shells.slant, n), read(shells.slant, n + up)
        near += e * (read(shells.slant, n + 2 * PACK) - near)
        far += e * (read(shells.slant, n + up + 2 * PACK) - far)
        total = near + c * (far - near)
        if lit < 1.0:
            total += FLOAT(-math.log(max(lit, _DARKEST)))
        total = choose_above(total, _MOST_AIR, _MOST_AIR, total)
        at = (k * ny + j) * width + BEYOND + i
        level = nz * ny * width
        for n in range(mixtures):
            total += flat(depth, n * level + at) * read(factors, n * PACK)
        total = choose_above(total, _MOST, _MOST, total)
        place = ((k * ny + j) * sun.shape[1] + i) * fields.shape[3]
        write(fields, place, transmission(_HALF * total))
        for w in range(count):
            root = flat(fields, place + w)
            beams[w, k, j, i] = root * root


@part(REORDERED)
def _ground_row(j, depth, factors, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface):
    """The ground under a row: see `direct_beam`."""
    nz = depth.shape[1]
    for i in range(sun.shape[1]):
        ground = terrain_m[j, i]
        k = 0
        while k < nz and levels_m[k] < ground:
            k += 1
        before = max(k - 1, 0)
        lit = lit_fraction(ground, shadow_m[j, i], distance_m[j, i], 20.0)
        for w in range(count):
            total = FLOAT(0.0)
            if k < nz:
                span = levels_m[k] - levels_m[before]
                c = (levels_m[k] - ground) / span if span > 0.0 else 0.0
                at = BEYOND + i
                for n in range(depth.shape[0]):
                    total += factors[n, w] * FLOAT(depth[n, k, j, at] * (1 - c) + depth[n, before, j, at] * c)
            surface[w, j, i] = lit * shell_transmission(ground, sun[j, i, 2], w, shells) * math.exp(-total)


@kernel(REORDERED)
def direct_beam(
    t, threads, depth, factors, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, beams, surface, fields
):  # fmt: skip
    """Direct transmission at the first ``count`` wavelengths at every node, ``beams`` (count, nz, ny, nx), and at the
    ground, ``surface`` (count, ny, nx); its root at every node into fields[..., :PACK].

    Between nodes the beam lies between a straight line and the exponential of one, since extinction changes there too;
    so does the square of its root.

    ``depth``: see `sun_sweep`; ``factors`` (fields, PACK): by which its fields are summed at a wavelength.
    """
    nz, ny = depth.shape[1:3]
    for j in range(t, ny, threads):
        for k in range(nz):
            _beam_row(k, j, depth, factors, sun, levels_m, shadow_m, distance_m, count, shells, beams, fields)
        _ground_row(j, depth, factors, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface)


@kernel(REORDERED)
def ground_beam(
    t, threads, depth, factors, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface
):  # fmt: skip
    """Direct transmission ``surface`` at the ground alone: see `direct_beam`."""
    for j in range(t, depth.shape[2], threads):
        _ground_row(j, depth, factors, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface)


@part(REORDERED, merged=True)
def lit_fraction(height_m, shadow_m, distance_m, softness_m):
    """Share of the sun seen above a ridge: penumbra of the disc, at least ``softness_m`` wide."""
    width = max(softness_m, 2.0 * SUN_RADIUS_RAD * distance_m)
    return min(1.0, max(0.0, 1.0 - (shadow_m - height_m) / width))
