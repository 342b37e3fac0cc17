"""The sun's light in the grid: optical depth from every node to the sun, terrain shadows, direct transmission.

`sun` is the direction to the sun in each column's own axes. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from openswim.transport.sample import sun_table_coordinate
from openswim.transport.scalar import shadow_fraction, table_index
from openswim.transport.volume import SHELL_TABLE_PER_M, SUN_RADIUS_RAD

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ONE = np.float32(1.0)


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def _wrap(x, count, periodic):
    return x - math.floor(x / count) * count if periodic else x


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def _plane_value(plane, x, y, periodic):
    """Bilinear value at fractional (x, y); the caller has made sure that the point is inside."""
    ny, nx = plane.shape
    i = min(int(x), nx - 1)
    j = min(int(y), ny - 1)
    a = np.float32(x - i)
    b = np.float32(y - j)
    i1 = i + 1 if i + 1 < nx else (0 if periodic else i)
    j1 = j + 1 if j + 1 < ny else (0 if periodic else j)
    return (plane[j, i] * (_ONE - a) + plane[j, i1] * a) * (_ONE - b) + (
        plane[j1, i] * (_ONE - a) + plane[j1, i1] * a
    ) * b


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def _depth_to_sun(
    extinction,
    depth,
    k,
    i,
    j,
    sun,
    last_level,
    levels_m,
    level_origin_m,
    level_per_m,
    level_table,
    cell_m,
    radius_m,
    periodic,
):
    """Optical depth from node (k, j, i) toward the sun up to ``last_level``, then what is known there.

    Samples where the ray meets a level and, between levels, once a cell.
    """
    nz, ny, nx = extinction.shape
    mu = sun[2]
    bend = (1.0 - mu * mu) / (2.0 * radius_m)
    vx, vy = sun[0] / cell_m[0], sun[1] / cell_m[1]
    fastest = max(abs(vx), abs(vy))
    longest = 1e30 if periodic else 4.0 * (nx + ny) / max(fastest, 1e-12)  # the way out of an open domain
    below = extinction[k, j, i]
    total = 0.0
    s = 0.0
    for level in range(k + 1, last_level + 1):
        rise = levels_m[level] - levels_m[k]
        root = math.sqrt(mu * mu + 4.0 * bend * rise)
        end = 2.0 * rise / (mu + root) if mu > 0.0 else (root - mu) / (2.0 * bend)
        if end > longest:
            end = longest
        count = int(fastest * (end - s)) + 1
        ds = (end - s) / count
        for n in range(1, count + 1):
            s += ds
            x, y = _wrap(i + vx * s, nx, periodic), _wrap(j + vy * s, ny, periodic)
            if not periodic and (x < 0.0 or y < 0.0 or x > nx - 1.0 or y > ny - 1.0):
                # half a step to the edge on average; beyond it there is nothing
                return total + 0.5 * below * ds
            if n == count and end < longest:
                here = _plane_value(extinction[level], x, y, periodic)
            else:
                fk = table_index(levels_m[k] + mu * s + bend * s * s, level_origin_m, level_per_m, level_table)
                m = min(int(fk), nz - 2)
                c = np.float32(fk - m)
                here = (
                    _plane_value(extinction[m], x, y, periodic) * (_ONE - c)
                    + _plane_value(extinction[m + 1], x, y, periodic) * c
                )
            total += 0.5 * (below + here) * ds
            below = here
        if end >= longest:
            return total
    x, y = _wrap(i + vx * s, nx, periodic), _wrap(j + vy * s, ny, periodic)
    return total + _plane_value(depth[last_level], x, y, periodic)


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def sun_sweep(
    extinction, exact, sun, levels_m, level_origin_m, level_per_m, level_table, cell_m, radius_m, periodic, depth
):
    """Optical depth (nz, ny, nx) from every node to the sun; ``sun`` (ny, nx, 3) in each column's own axes.

    Nodes marked ``exact`` follow their ray to the top of the cloud; the others go one level up and interpolate there,
    which is cheap but blurs shadows by a cell per level. Handles any sun, also one below the horizon of a node on the
    curved Earth: the way up then starts downward.
    """
    nz, ny, nx = extinction.shape
    top = 0
    for k in range(nz):
        if extinction[k].max() > 0.0:
            top = k
    for k in range(min(top + 1, nz - 1), nz):
        depth[k] = 0.0
    for step in range(nz - 1 - min(top + 1, nz - 1), nz - 1):
        k = nz - 2 - step
        for j in prange(ny):
            for i in range(nx):
                last = min(top + 1, nz - 1) if exact[k, j, i] else k + 1
                depth[k, j, i] = _depth_to_sun(
                    extinction,
                    depth,
                    k,
                    i,
                    j,
                    sun[j, i],
                    last,
                    levels_m,
                    level_origin_m,
                    level_per_m,
                    level_table,
                    cell_m,
                    radius_m,
                    periodic,
                )


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def terrain_shadow(terrain_m, sun, cell_m, radius_m, periodic, shadow_m, distance_m):
    """Height (ny, nx) up to which the terrain hides the sun, and the distance of the ridge that does it."""
    ny, nx = terrain_m.shape
    for j in prange(ny):
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
                if periodic or x < 0.0 or y < 0.0 or x > nx - 1.0 or y > ny - 1.0:
                    break
                h = _plane_value(terrain_m, x, y, False) - s * mu / sine - s * s / (2.0 * radius_m)
                if h > highest:
                    highest = h
                    ridge = s
            shadow_m[j, i] = highest
            distance_m[j, i] = ridge


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
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


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def direct_beam(depth, sun, levels_m, terrain_m, shadow_m, distance_m, w, shells, beam, surface, fields, channel):
    """Direct transmission at every node, beam (nz, ny, nx), at the ground, surface (ny, nx), its depth in fields."""
    nz, ny, nx = depth.shape
    for j in prange(ny):
        for i in range(nx):
            mu = sun[j, i, 2]
            ground = terrain_m[j, i]
            at_ground = -1.0
            for k in range(nz):
                lit = lit_fraction(
                    levels_m[k],
                    shadow_m[j, i],
                    distance_m[j, i],
                    levels_m[min(k + 1, nz - 1)] - levels_m[max(k - 1, 0)],
                )
                air = lit * shell_transmission(levels_m[k], mu, w, shells)
                beam[k, j, i] = air * math.exp(-depth[k, j, i])
                fields[k, j, i, channel] = depth[k, j, i] - math.log(max(air, 1e-12))
                if at_ground < 0.0 and levels_m[k] >= ground:
                    before = max(k - 1, 0)
                    span = levels_m[k] - levels_m[before]
                    c = (levels_m[k] - ground) / span if span > 0.0 else 0.0
                    at_ground = depth[k, j, i] * (1 - c) + depth[before, j, i] * c
            lit = lit_fraction(ground, shadow_m[j, i], distance_m[j, i], 20.0)
            surface[j, i] = lit * shell_transmission(ground, mu, w, shells) * math.exp(-max(at_ground, 0.0))


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def lit_fraction(height_m, shadow_m, distance_m, softness_m):
    """Share of the sun seen above a ridge: penumbra of the disc, at least ``softness_m`` wide."""
    width = max(softness_m, 2.0 * SUN_RADIUS_RAD * distance_m)
    return min(1.0, max(0.0, 1.0 - (shadow_m - height_m) / width))
