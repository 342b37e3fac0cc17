"""Sweep: light carried through the grid, node after node, along fixed directions.

`sun_sweep` accumulates the optical depth from every node to the sun; `diffuse_sweep` carries radiance with a source
along the discrete ordinates and returns its spherical-harmonic moments. Directions point to where the light comes
from; "upstream" is that way. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from openswim.transport.march import SHELL_TABLE_PER_M, SUN_RADIUS_RAD, prepare_ray, sun_table_coordinate
from openswim.transport.scalar import harmonics, shadow_fraction, step_emission, table_index, transmission

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ONE = np.float32(1.0)
_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)
_FOUR_PI = np.float32(4.0 * math.pi)


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
    return (plane[j, i] * (_ONE - a) + plane[j, i1] * a) * (_ONE - b) + (plane[j1, i] * (_ONE - a) + plane[j1, i1] * a) * b


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def _depth_to_sun(extinction, depth, k, i, j, sun, last_level, levels_m, level_origin_m, level_per_m, level_table, cell_m,
                  radius_m, periodic):
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
def sun_sweep(extinction, exact, sun, levels_m, level_origin_m, level_per_m, level_table, cell_m, radius_m, periodic, depth):
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
                    extinction, depth, k, i, j, sun[j, i], last, levels_m, level_origin_m, level_per_m, level_table,
                    cell_m, radius_m, periodic,
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
    k = min(int(level), shells.extinction.shape[0] - 2)
    c = level - k
    ratio = (shells.radius_m + shells.ground_m) / (shells.radius_m + shells.ground_m + above)
    mu_horizon = -math.sqrt(max(0.0, 1.0 - ratio * ratio))
    lit = shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD)
    if lit <= 0.0:
        return 0.0
    t = sun_table_coordinate(mu_sun, mu_horizon, shells.sun_depth.shape[1])
    m = int(t)
    e = t - m
    d = shells.sun_depth
    depth = (d[k, m, w] * (1 - e) + d[k, m + 1, w] * e) * (1 - c) + (d[k + 1, m, w] * (1 - e) + d[k + 1, m + 1, w] * e) * c
    return lit * math.exp(-depth)


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def direct_beam(depth, sun, levels_m, terrain_m, shadow_m, distance_m, w, shells, beam, surface, fields, channel):
    """Direct transmission at every node, beam (nz, ny, nx), at the ground, surface (ny, nx), and its depth in fields."""
    nz, ny, nx = depth.shape
    for j in prange(ny):
        for i in range(nx):
            mu = sun[j, i, 2]
            ground = terrain_m[j, i]
            at_ground = -1.0
            for k in range(nz):
                lit = lit_fraction(levels_m[k], shadow_m[j, i], distance_m[j, i], levels_m[min(k + 1, nz - 1)] - levels_m[max(k - 1, 0)])
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


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def _arrive(upstream, source_up, extinction_up, source, extinction, ds):
    """Radiance at a node from that at its upstream point, source and extinction linear between."""
    tau = (extinction_up + extinction) * _HALF * ds
    trans = transmission(tau)
    return upstream * trans + step_emission(tau, trans, ds, source, source_up, extinction, extinction_up)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _blend(out, row_a, row_c, wa, wb, wc, wd, shift):
    """Bilinear value at the upstream points of a row: corners straight and one node aside, in two finished rows."""
    nx = out.shape[0]
    # slices, since a signed offset in the index would stop vectorisation; few arrays in a loop, since LLVM gives up
    # on proving more than eight pairs apart
    a, b = row_a[1 : nx + 1], row_a[1 + shift : nx + 1 + shift]
    c, d = row_c[1 : nx + 1], row_c[1 + shift : nx + 1 + shift]
    for i in range(nx):
        out[i] = wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _row(out, source, extinction, i_a, i_c, s_a, s_c, b_a, b_c, wa, wb, wc, wd, shift, ds, upstream):
    """One row of nodes whose upstream points lie between finished rows a and c; ``upstream`` (3, nx) is scratch."""
    nx = upstream.shape[1]
    up, su, bu = upstream[0], upstream[1], upstream[2]
    _blend(up, i_a, i_c, wa, wb, wc, wd, shift)
    _blend(su, s_a, s_c, wa, wb, wc, wd, shift)
    _blend(bu, b_a, b_c, wa, wb, wc, wd, shift)
    o, s, b = out[1 : nx + 1], source[1 : nx + 1], extinction[1 : nx + 1]
    for i in range(nx):
        o[i] = _arrive(up[i], su[i], bu[i], s[i], b[i], ds)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _blend_aside(out, row, row_b, row_c, row_d, wa, wb, wc, wd, shift):
    """As `_blend`, all four corners one node aside in four rows."""
    nx = out.shape[0]
    a, b = row[1 + shift : nx + 1 + shift], row_b[1 + shift : nx + 1 + shift]
    c, d = row_c[1 + shift : nx + 1 + shift], row_d[1 + shift : nx + 1 + shift]
    for i in range(nx):
        out[i] = wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _recurrent_row(out, source, extinction, i_b, i_c, i_d, s_b, s_c, s_d, b_b, b_c, b_d, wa, wb, wc, wd, shift, ds,
                   upstream):
    """One row of nodes swept along itself: one upstream corner is the neighbour in the same row.

    All but that neighbour's radiance is known beforehand, so that only a multiply-add is sequential.
    """
    nx = upstream.shape[1]
    up, su, bu = upstream[0], upstream[1], upstream[2]
    _blend_aside(up, i_b, i_b, i_c, i_d, _ZERO, wb, wc, wd, shift)
    _blend_aside(su, source, s_b, s_c, s_d, wa, wb, wc, wd, shift)
    _blend_aside(bu, extinction, b_b, b_c, b_d, wa, wb, wc, wd, shift)
    s, b = source[1 : nx + 1], extinction[1 : nx + 1]
    for i in range(nx):
        tau = (bu[i] + b[i]) * _HALF * ds
        trans = transmission(tau)
        bu[i] = step_emission(tau, trans, ds, s[i], su[i], b[i], bu[i]) + up[i] * trans
        up[i] = wa * trans
    if shift > 0:
        last = out[nx + 1]
        for n in range(nx):
            last = last * up[nx - 1 - n] + bu[nx - 1 - n]
            out[nx - n] = last
    else:
        last = out[0]
        for i in range(nx):
            last = last * up[i] + bu[i]
            out[i + 1] = last


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def _sweep_plane(q, dz, cell_m, cur_i, old_i, cur_s, old_s, cur_b, old_b, inflow, first, periodic):
    """One ordinate through one plane: short characteristics along the axis whose cells it crosses fastest.

    Buffers carry one ghost node on every side. ``inflow``: radiance entering through open sides at this level.
    """
    ny, nx = cur_i.shape[0] - 2, cur_i.shape[1] - 2
    tx = cell_m[0] / max(abs(q[0]), 1e-12)
    ty = cell_m[1] / max(abs(q[1]), 1e-12)
    tz = dz / max(abs(q[2]), 1e-12)
    sx = 1 if q[0] > 0 else -1
    sy = 1 if q[1] > 0 else -1
    j_first = ny if sy > 0 else 1
    upstream = np.empty((3, nx), np.float32)
    i_first = nx if sx > 0 else 1
    if tz <= tx and tz <= ty:
        if first:
            cur_i[:, :] = inflow
            return
        ds = np.float32(tz)
        ax, ay = np.float32(tz / tx), np.float32(tz / ty)
        for j in range(1, ny + 1):
            t = j + sy
            _row(
                cur_i[j], cur_s[j], cur_b[j], old_i[j], old_i[t], old_s[j], old_s[t], old_b[j], old_b[t],
                (_ONE - ax) * (_ONE - ay), ax * (_ONE - ay), (_ONE - ax) * ay, ax * ay, sx, ds, upstream,
            )
        return
    if ty <= tx:
        ds = np.float32(ty)
        ax, az = np.float32(ty / tx), np.float32(ty / tz)
        for n in range(ny):
            j = j_first - sy * n
            t = j + sy
            if n == 0 and not periodic:
                cur_i[j, :] = inflow
                continue
            _row(
                cur_i[j], cur_s[j], cur_b[j], cur_i[t], old_i[t], cur_s[t], old_s[t], cur_b[t], old_b[t],
                (_ONE - ax) * (_ONE - az), ax * (_ONE - az), (_ONE - ax) * az, ax * az, sx, ds, upstream,
            )
        return
    ds = np.float32(tx)
    ay, az = np.float32(tx / ty), np.float32(tx / tz)
    for n in range(ny):
        j = j_first - sy * n
        t = j + sy
        _recurrent_row(
            cur_i[j], cur_s[j], cur_b[j], cur_i[t], old_i[j], old_i[t], cur_s[t], old_s[j], old_s[t], cur_b[t], old_b[j],
            old_b[t], (_ONE - ay) * (_ONE - az), ay * (_ONE - az), (_ONE - ay) * az, ay * az, sx, ds, upstream,
        )
        if not periodic:
            cur_i[j, i_first] = inflow


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _fill_ghosts(plane, periodic, outside, use_outside):
    """Ghost nodes: the other side where periodic, else ``outside`` or the edge itself."""
    ny, nx = plane.shape[0] - 2, plane.shape[1] - 2
    for j in range(1, ny + 1):
        if periodic:
            plane[j, 0], plane[j, nx + 1] = plane[j, nx], plane[j, 1]
        elif use_outside:
            plane[j, 0] = plane[j, nx + 1] = outside
        else:
            plane[j, 0], plane[j, nx + 1] = plane[j, 1], plane[j, nx]
    for i in range(nx + 2):
        if periodic:
            plane[0, i], plane[ny + 1, i] = plane[ny, i], plane[1, i]
        elif use_outside:
            plane[0, i] = plane[ny + 1, i] = outside
        else:
            plane[0, i], plane[ny + 1, i] = plane[1, i], plane[ny, i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _add(out, c, row):
    """out += c row."""
    for i in range(out.shape[0]):
        out[i] += c * row[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _add_five(out, c0, c1, c2, c3, c4, r0, r1, r2, r3, r4):
    """out += sum of five rows: fewer passes over the row."""
    for i in range(out.shape[0]):
        out[i] += c0 * r0[i] + c1 * r1[i] + c2 * r2[i] + c3 * r3[i] + c4 * r4[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _term(out, sigma, moment, sun_harmonic, beam):
    """sigma_l (I_lm + 4 pi Y_lm(sun) T')."""
    for i in range(out.shape[0]):
        out[i] = sigma[i] * (moment[i] + _FOUR_PI * sun_harmonic[i] * beam[i])


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _source_row(k, j, lo, hi, species_extinction, scaled, scattering, air_extinction, air_scattering, beam, sun_harmonics,
                moments, matrix, terms, source, extinction):
    """Emission of the ordinates along one row, S_n = sum_lm Y_nlm sigma_l (I_lm + 4 pi Y_lm(sun) T'), and extinction.

    Only nodes lo to hi scatter; rows are cut to them, so that every loop starts at zero and vectorises.
    """
    ns = species_extinction.shape[0]
    degree = air_scattering.shape[1]
    nx = beam.shape[2]
    row_b = extinction[j + 1, 1 : nx + 1]
    row_b[:] = air_extinction[k]
    for s in range(ns):
        _add(row_b, scaled[s], species_extinction[s, k, j])
    count = degree * degree
    sigma = terms[count, : hi - lo]
    row_t = beam[k, j, lo:hi]
    for ell in range(degree):
        sigma[:] = air_scattering[k, ell]
        for s in range(ns):
            _add(sigma, scattering[s, ell], species_extinction[s, k, j, lo:hi])
        for index in range(ell * ell, (ell + 1) * (ell + 1)):
            _term(terms[index, : hi - lo], sigma, moments[index, k, j, lo:hi], sun_harmonics[index, j, lo:hi], row_t)
    for n in range(matrix.shape[0]):
        source[n, j + 1, :] = _ZERO
        row_s = source[n, j + 1, lo + 1 : hi + 1]
        index = 0
        while index + 5 <= count:
            _add_five(
                row_s, matrix[n, index], matrix[n, index + 1], matrix[n, index + 2], matrix[n, index + 3],
                matrix[n, index + 4], terms[index], terms[index + 1], terms[index + 2], terms[index + 3], terms[index + 4],
            )
            index += 5
        while index < count:
            _add(row_s, matrix[n, index], terms[index])
            index += 1


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _collect_row(k, j, lo, hi, intensity, matrix, weight, moments):
    """Add w_n Y_nlm I_n of one row, nodes lo to hi, to the moments."""
    total = matrix.shape[0]
    for index in range(matrix.shape[1]):
        row_m = moments[index, k, j, lo:hi]
        n = 0
        while n + 5 <= total:
            _add_five(
                row_m, matrix[n, index] * weight[n], matrix[n + 1, index] * weight[n + 1],
                matrix[n + 2, index] * weight[n + 2], matrix[n + 3, index] * weight[n + 3],
                matrix[n + 4, index] * weight[n + 4], intensity[n, j + 1, lo + 1 : hi + 1],
                intensity[n + 1, j + 1, lo + 1 : hi + 1], intensity[n + 2, j + 1, lo + 1 : hi + 1],
                intensity[n + 3, j + 1, lo + 1 : hi + 1], intensity[n + 4, j + 1, lo + 1 : hi + 1],
            )
            n += 5
        while n < total:
            _add(row_m, matrix[n, index] * weight[n], intensity[n, j + 1, lo + 1 : hi + 1])
            n += 1


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def half_sweep(downward, species_extinction, scaled, scattering, air_extinction, air_scattering, beam, sun_harmonics,
               levels_m, cell_m, periodic, first_node, last_node, ordinates, matrix, weight, inflow, edges,
               ground_node, ground_radiance, moments, new_moments, flux):
    """Carry the light of one hemisphere through the grid, plane by plane, and add its moments to ``new_moments``.

    downward: ordinates whose light comes from above (or level), else from below, starting at the ground's radiance.
    species_extinction (s, nz, ny, nx) 1/m; scaled (s,), scattering (s, M): coefficients of the delta-scaled medium;
    air_* the same on levels, (nz,), (nz, M); beam (nz, ny, nx): direct transmission; sun_harmonics (M*M, ny, nx).
    first_node, last_node (nz, ny): nodes of each row that scatter; ordinates (n, 3) toward the light's origin, matrix
    (n, M*M) their harmonics, weight (n,); inflow (n, nz) radiance entering the sides and the top; edges (n, nz, 2, m)
    last sweep's sides, for periodic grids. flux (ny, nx): through the ground (down) or through the top (up).
    """
    nz, ny, nx = beam.shape
    count = ordinates.shape[0]
    degree = air_scattering.shape[1]
    f32 = np.float32
    intensity = np.zeros((2, count, ny + 2, nx + 2), f32)
    source = np.zeros((2, count, ny + 2, nx + 2), f32)
    extinction = np.zeros((2, ny + 2, nx + 2), f32)
    for step in range(nz):
        k = nz - 1 - step if downward else step
        cur, old = step % 2, 1 - step % 2
        before = k + 1 if downward else k - 1
        dz = abs(levels_m[k] - levels_m[before]) if step > 0 else 1.0
        for j in prange(ny):
            terms = np.empty((degree * degree + 1, nx), f32)
            _source_row(
                k, j, first_node[k, j], last_node[k, j], species_extinction, scaled, scattering, air_extinction,
                air_scattering, beam, sun_harmonics, moments, matrix, terms, source[cur], extinction[cur],
            )
        _fill_ghosts(extinction[cur], periodic, 0.0, False)
        for n in prange(count):
            cur_i = intensity[cur, n]
            _fill_ghosts(source[cur, n], periodic, 0.0, False)
            if periodic:
                # the sides of the last sweep stand in for what this one has not reached yet
                side = edges[n, k]
                for j in range(ny):
                    cur_i[j + 1, 0], cur_i[j + 1, nx + 1] = side[0, j], side[1, j]
                for i in range(nx):
                    cur_i[0, i + 1], cur_i[ny + 1, i + 1] = side[2, i], side[3, i]
            else:
                _fill_ghosts(cur_i, False, inflow[n, k], True)
            _sweep_plane(
                ordinates[n], dz, cell_m, cur_i, intensity[old, n], source[cur, n], source[old, n], extinction[cur],
                extinction[old], inflow[n, k], step == 0, periodic,
            )
            if not downward:
                for j in range(ny):
                    for i in range(nx):
                        if k < ground_node[j, i] or k == 0:
                            cur_i[j + 1, i + 1] = ground_radiance[j, i]
            if periodic:
                side = edges[n, k]
                for j in range(ny):
                    side[0, j], side[1, j] = cur_i[j + 1, nx], cur_i[j + 1, 1]
                for i in range(nx):
                    side[2, i], side[3, i] = cur_i[ny, i + 1], cur_i[1, i + 1]
            _fill_ghosts(cur_i, periodic, inflow[n, k], True)
        for j in prange(ny):
            lo, hi = first_node[k, j], last_node[k, j]
            # one row and node beyond the cloud, so that interpolation at its edge finds the field
            for t in range(max(0, j - 1), min(ny, j + 2)):
                if last_node[k, t] > first_node[k, t]:
                    lo = min(lo, first_node[k, t]) if hi > lo else first_node[k, t]
                    hi = max(hi, last_node[k, t])
            for t in range(max(0, k - 1), min(nz, k + 2)):
                if last_node[t, j] > first_node[t, j]:
                    lo = min(lo, first_node[t, j]) if hi > lo else first_node[t, j]
                    hi = max(hi, last_node[t, j])
            if hi > lo:
                _collect_row(k, j, max(0, lo - 1), min(nx, hi + 1), intensity[cur], matrix, weight, new_moments)
            for i in range(nx):
                if (downward and k == ground_node[j, i]) or (not downward and k == nz - 1):
                    total = 0.0
                    for n in range(count):
                        total += weight[n] * abs(ordinates[n, 2]) * intensity[cur, n, j + 1, i + 1]
                    flux[j, i] = total / (4.0 * math.pi)


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def view_source(species_extinction, scattering, air_scattering, air_forward, beam, sun_harmonics, moments, axes, place,
                levels_m, eye, parallel_view, sun, haze_table, w, forward_channel, channel, fields):
    """Smooth source toward one eye at every node, and the haze's forward peak, into fields[..., channel].

    axes (ny, nx, 3, 3): the columns' own axes (rows) in the scene frame; place (ny, nx, 3): their sea-level points.
    eye: the eye's position, or its viewing direction where ``parallel_view``. haze_table (angle, depth, PACK).
    """
    nz, ny, nx = beam.shape
    ns = species_extinction.shape[0]
    degree = air_scattering.shape[1]
    for j in prange(ny):
        harmonic = np.zeros(degree * degree)
        legendre = np.zeros(degree + 1)
        peak = np.zeros((1, haze_table.shape[2], haze_table.shape[3]), np.float32)
        for k in range(nz):
            for i in range(nx):
                a = axes[j, i]
                if parallel_view:
                    vx, vy, vz = eye[0], eye[1], eye[2]
                else:
                    h = levels_m[k]
                    vx = place[j, i, 0] + h * a[2, 0] - eye[0]
                    vy = place[j, i, 1] + h * a[2, 1] - eye[1]
                    vz = place[j, i, 2] + h * a[2, 2] - eye[2]
                    r = 1.0 / (math.sqrt(vx * vx + vy * vy + vz * vz) + 1e-6)
                    vx, vy, vz = vx * r, vy * r, vz * r
                lx = a[0, 0] * vx + a[0, 1] * vy + a[0, 2] * vz
                ly = a[1, 0] * vx + a[1, 1] * vy + a[1, 2] * vz
                lz = a[2, 0] * vx + a[2, 1] * vy + a[2, 2] * vz
                harmonics(lx, ly, lz, degree, harmonic)
                total = 0.0
                for ell in range(degree):
                    sigma = air_scattering[k, ell]
                    for s in range(ns):
                        sigma += scattering[s, ell] * species_extinction[s, k, j, i]
                    if sigma == 0.0:
                        continue
                    part = 0.0
                    for index in range(ell * ell, (ell + 1) * (ell + 1)):
                        part += harmonic[index] * (
                            moments[index, k, j, i] + _FOUR_PI * sun_harmonics[index, j, i] * beam[k, j, i]
                        )
                    total += sigma * part
                if air_forward[k] > 0.0:
                    prepare_ray(vx * sun[0] + vy * sun[1] + vz * sun[2], haze_table, legendre, peak)
                    phi = fields[k, j, i, forward_channel]
                    p = phi / (1.0 + phi) * (peak.shape[1] - 1)
                    q = min(int(p), peak.shape[1] - 2)
                    p -= q
                    share = legendre[degree]
                    seen = (1.0 - share) * peak[0, 0, w]
                    if share > 0.0:
                        seen += share * (peak[0, q, w] * (1.0 - p) + peak[0, q + 1, w] * p)
                    total += air_forward[k] * seen * beam[k, j, i]
                fields[k, j, i, channel] = total
