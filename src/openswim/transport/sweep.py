"""Sweep: light with a source carried through the grid along discrete ordinates, node after node.

`half_sweep` returns the spherical-harmonic moments of one hemisphere. Directions point to where the light comes from;
"upstream" is that way. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from openswim.transport.products import add, add_products

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ONE = np.float32(1.0)
_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)
_FOUR_PI = np.float32(4.0 * math.pi)

CLEAR_BLOCK = 32  # nodes of a row that are swept as clear or as cloudy together


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, inline="always")
def _step_weights(extinction, extinction_up, ds):
    """(trans, near, far) of a step: radiance = trans upstream + near source + far source_up.

    The same step as `step_emission`, source and extinction linear between, written with a single division since
    divisions are what it costs.
    """
    tau = (extinction + extinction_up) * _HALF * ds
    y = tau * np.float32(0.0625)
    p = _ONE + y * (_ONE + y * (_HALF + y * (np.float32(1 / 6) + y * (np.float32(1 / 24) + y * np.float32(1 / 120)))))
    q = np.float32(12.0) + np.float32(2.0) * tau
    d = max(tau, np.float32(0.1))
    pq = p * q
    r = _ONE / (pq * d)
    t = r * q * d  # e^(-tau/16), see `transmission`
    t = t * t
    t = t * t
    t = t * t
    t = t * t
    mean = (
        (_ONE - t) * (r * pq)
        if tau > np.float32(0.1)
        else _ONE - tau * (_HALF - tau * (np.float32(1 / 6) - tau * np.float32(1 / 24)))
    )
    mean *= ds
    c = ds * (r * p * d)
    return t, mean * (_HALF + extinction_up * c), mean * (_HALF - extinction * c)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _blend(out, row_a, row_b, row_c, row_d, wa, wb, wc, wd):
    """Bilinear value at the upstream points of a run of nodes, from the corners' four rows."""
    for i in range(out.shape[0]):
        out[i] = wa * row_a[i] + wb * row_b[i] + wc * row_c[i] + wd * row_d[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _blend_more(out, row_a, row_b, row_c, row_d, wa, wb, wc, wd, row, w):
    """As `_blend` and ``w`` times one more row, added to what is there."""
    for i in range(out.shape[0]):
        out[i] += wa * row_a[i] + wb * row_b[i] + wc * row_c[i] + wd * row_d[i] + w * row[i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _arrive(upstream, source_up, extinction_up, source, extinction, ds, w):
    """Radiance at a run of nodes, into ``upstream``, from that at their upstream points.

    ``extinction_up`` becomes the share of a neighbour of weight w in the same row.
    """
    for i in range(upstream.shape[0]):
        trans, near, far = _step_weights(extinction[i], extinction_up[i], ds)
        upstream[i] = trans * upstream[i] + near * source[i] + far * source_up[i]
        extinction_up[i] = w * trans


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _run_end(cloudy, block):
    """The block after the last of the same kind."""
    n = block + 1
    while n < cloudy.shape[0] and cloudy[n] == cloudy[block]:
        n += 1
    return n


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _row(
    out,
    source,
    extinction,
    i_a,
    i_b,
    i_c,
    i_d,
    s_a,
    s_b,
    s_c,
    s_d,
    b_a,
    b_b,
    b_c,
    b_d,
    shift_a,
    shift,
    recurrent,
    step,
    cloudy,
    work,
):
    """One row of nodes whose upstream points lie between the corners a, b, c, d, each in a row of its own.

    Corners b and d lie ``shift`` nodes aside, a and c ``shift_a``. recurrent: corner a is the neighbour in this very
    row; all but its radiance is known beforehand, so that only a multiply-add is sequential. Runs of clear blocks share
    the step's weights. ``work`` (3, nx) is scratch; step: see `_plan_steps`.
    """
    nx = work.shape[1]
    wa, wb, wc, wd, ds = step[0], step[1], step[2], step[3], step[4]
    trans, near, far = step[5], step[6], step[7]
    known_a = _ZERO if recurrent else wa
    block = 0
    while block < cloudy.shape[0]:
        end = _run_end(cloudy, block)
        # slices, since a signed offset in an index stops vectorisation; few arrays in a loop, since LLVM gives up on
        # proving more than eight pairs apart
        lo, hi = 1 + block * CLEAR_BLOCK, 1 + min(nx, end * CLEAR_BLOCK)
        a0, a1, b0, b1 = lo + shift_a, hi + shift_a, lo + shift, hi + shift
        up = work[0, lo - 1 : hi - 1] if recurrent else out[lo:hi]
        share = work[2, lo - 1 : hi - 1]
        if cloudy[block]:
            su = work[1, lo - 1 : hi - 1]
            _blend(up, i_a[a0:a1], i_b[b0:b1], i_c[a0:a1], i_d[b0:b1], known_a, wb, wc, wd)
            _blend(su, s_a[a0:a1], s_b[b0:b1], s_c[a0:a1], s_d[b0:b1], wa, wb, wc, wd)
            _blend(share, b_a[a0:a1], b_b[b0:b1], b_c[a0:a1], b_d[b0:b1], wa, wb, wc, wd)
            _arrive(up, su, share, source[lo:hi], extinction[lo:hi], ds, wa)
        else:
            t, f = trans, far
            _blend(up, i_a[a0:a1], i_b[b0:b1], i_c[a0:a1], i_d[b0:b1], t * known_a, t * wb, t * wc, t * wd)
            _blend_more(
                up, s_a[a0:a1], s_b[b0:b1], s_c[a0:a1], s_d[b0:b1], f * wa, f * wb, f * wc, f * wd, source[lo:hi], near
            )
            if recurrent:
                share[:] = wa * trans
        block = end
    if recurrent:
        _recur(out, work[0], work[2], shift)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _recur(out, known, share, shift):
    """out[i] = known[i] + share[i] out[upstream neighbour], from the ghost node on.

    Four stretches of the row at once, each from zero, since one alone waits for its own last node; what enters a
    stretch, times the product of the shares on the way, is added after.
    """
    nx = known.shape[0]
    quarter = nx // 4
    # node n of the way lies at `begin` + n `way`
    way = -1 if shift > 0 else 1
    begin = nx - 1 if shift > 0 else 0
    r0, r1, r2, r3 = out[begin + 1 + shift], _ZERO, _ZERO, _ZERO
    p1, p2, p3 = _ONE, _ONE, _ONE
    for n in range(quarter):
        a = begin + way * n
        b = a + way * quarter
        c = b + way * quarter
        d = c + way * quarter
        r0 = r0 * share[a] + known[a]
        r1 = r1 * share[b] + known[b]
        r2 = r2 * share[c] + known[c]
        r3 = r3 * share[d] + known[d]
        p1 *= share[b]
        p2 *= share[c]
        p3 *= share[d]
        out[a + 1], out[b + 1], out[c + 1], out[d + 1] = r0, r1, r2, r3
        share[b], share[c], share[d] = p1, p2, p3
    last = r0
    for part in range(1, 4):
        if quarter == 0:
            break
        ends = begin + way * (part * quarter), begin + way * ((part + 1) * quarter - 1)
        lo, hi = min(ends), max(ends) + 1
        add(out[lo + 1 : hi + 1], last, share[lo:hi])
        last = out[ends[1] + 1]
    for n in range(4 * quarter, nx):
        a = begin + way * n
        last = last * share[a] + known[a]
        out[a + 1] = last


_ALONG_X, _ALONG_Y, _ALONG_Z = 0, 1, 2


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _plan_steps(ordinates, k, before, levels_m, cell_m, air_extinction, way, steps):
    """How each ordinate steps through one plane: short characteristics along the axis whose cells it crosses fastest.

    way (n, 3): that axis, and to which side in x and y the upstream point lies. steps (n, 8): weights of its four
    corners, length, and (trans, near, far) of a step through clear air.
    """
    nz = levels_m.shape[0]
    if before < 0 or before == nz:
        before, dz = k, 1.0
    else:
        dz = abs(levels_m[k] - levels_m[before])
    air, air_old = air_extinction[k], air_extinction[before]
    for n in range(ordinates.shape[0]):
        q = ordinates[n]
        tx = cell_m[0] / max(abs(q[0]), 1e-12)
        ty = cell_m[1] / max(abs(q[1]), 1e-12)
        tz = dz / max(abs(q[2]), 1e-12)
        way[n, 1] = 1 if q[0] > 0 else -1
        way[n, 2] = 1 if q[1] > 0 else -1
        if tz <= tx and tz <= ty:
            way[n, 0] = _ALONG_Z
            ds, a, c = tz, tz / tx, tz / ty
        elif ty <= tx:
            way[n, 0] = _ALONG_Y
            ds, a, c = ty, ty / tx, ty / tz
        else:
            way[n, 0] = _ALONG_X
            ds, a, c = tx, tx / ty, tx / tz
        s = steps[n]
        s[0], s[1], s[2], s[3], s[4] = (1 - a) * (1 - c), a * (1 - c), (1 - a) * c, a * c, ds
        up = np.float32(air_old if way[n, 0] == _ALONG_Z else air * (1 - c) + air_old * c)
        s[5], s[6], s[7] = _step_weights(air, up, s[4])


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _sweep_row(n, j, begins, way, step, cur_i, old_i, cur_s, old_s, cur_b, old_b, cloudy, inflow, top, periodic, work):
    """Row j of ordinate n. begins: the first row on the way through the plane; top: this is the first plane.

    Buffers (ny + 2, ordinate, nx + 2) carry one ghost node on every side. ``inflow``: radiance entering through open
    sides at this level.
    """
    nx = cur_i.shape[2] - 2
    axis, sx, t = way[0], way[1], j + way[2]
    if (axis == _ALONG_Z and top) or (axis == _ALONG_Y and begins and not periodic):
        cur_i[j, n, :] = inflow
        return
    # rows of the four corners: `_ALONG_Z` has all on the plane before, the others two on each
    if axis == _ALONG_Z:
        p_i, p_s, p_b, ja, jb, jc, jd = old_i, old_s, old_b, j, j, t, t
    elif axis == _ALONG_Y:
        p_i, p_s, p_b, ja, jb, jc, jd = cur_i, cur_s, cur_b, t, t, t, t
    else:
        p_i, p_s, p_b, ja, jb, jc, jd = cur_i, cur_s, cur_b, j, t, j, t
    _row(
        cur_i[j, n],
        cur_s[j, n],
        cur_b[j, 0],
        p_i[ja, n],
        p_i[jb, n],
        old_i[jc, n],
        old_i[jd, n],
        p_s[ja, n],
        p_s[jb, n],
        old_s[jc, n],
        old_s[jd, n],
        p_b[ja, 0],
        p_b[jb, 0],
        old_b[jc, 0],
        old_b[jd, 0],
        sx if axis == _ALONG_X else 0,
        sx,
        axis == _ALONG_X,
        step,
        cloudy,
        work,
    )
    if axis == _ALONG_X and not periodic:
        cur_i[j, n, nx if sx > 0 else 1] = inflow


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _sweep_plane(
    first, stride, way, steps, cur_i, old_i, cur_s, old_s, cur_b, old_b, cloudy, inflow, top, periodic, work
):
    """Ordinates first, first + stride, ... through one plane, row by row together: their rows lie side by side."""
    ny = cur_i.shape[0] - 2
    for side in (1, -1):
        for m in range(ny):
            j = ny - m if side > 0 else 1 + m
            for n in range(first, way.shape[0], stride):
                if way[n, 2] == side:
                    _sweep_row(
                        n,
                        j,
                        m == 0,
                        way[n],
                        steps[n],
                        cur_i,
                        old_i,
                        cur_s,
                        old_s,
                        cur_b,
                        old_b,
                        cloudy[j - 1],
                        inflow[n],
                        top,
                        periodic,
                        work,
                    )


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _set_sides(plane, n, periodic, inflow, side):
    """Ghost nodes of ordinate n before a plane is swept.

    Periodic: the last sweep's sides (4, m) stand in for what this one has not reached yet.
    """
    ny, nx = plane.shape[0] - 2, plane.shape[2] - 2
    if periodic:
        for j in range(ny):
            plane[j + 1, n, 0], plane[j + 1, n, nx + 1] = side[0, j], side[1, j]
        for i in range(nx):
            plane[0, n, i + 1], plane[ny + 1, n, i + 1] = side[2, i], side[3, i]
        return
    for j in range(1, ny + 1):
        plane[j, n, 0] = plane[j, n, nx + 1] = inflow
    plane[0, n, :] = inflow
    plane[ny + 1, n, :] = inflow


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _wrap_sides(plane, n, side):
    """Ghost nodes of ordinate n of a swept periodic plane: the other side; the next sweep begins from them."""
    ny, nx = plane.shape[0] - 2, plane.shape[2] - 2
    for j in range(1, ny + 1):
        plane[j, n, 0] = side[0, j - 1] = plane[j, n, nx]
        plane[j, n, nx + 1] = side[1, j - 1] = plane[j, n, 1]
    for i in range(nx):
        side[2, i], side[3, i] = plane[ny, n, i + 1], plane[1, n, i + 1]
    _end_rows(plane, n, True)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _set_ground(plane, n, k, ground_node, ground_radiance):
    """Radiance of ordinate n at and below the ground."""
    ny, nx = ground_node.shape
    for j in range(ny):
        for i in range(nx):
            if k < ground_node[j, i] or k == 0:
                plane[j + 1, n, i + 1] = ground_radiance[j, i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _end_rows(plane, n, periodic):
    """Ghost rows of ordinate n: the other side where periodic, else the edge itself."""
    ny = plane.shape[0] - 2
    first, last = (ny, 1) if periodic else (1, ny)
    for i in range(plane.shape[2]):
        plane[0, n, i] = plane[first, n, i]
        plane[ny + 1, n, i] = plane[last, n, i]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _row_ends(row, periodic):
    """Ghost nodes at the ends of a row."""
    nx = row.shape[0] - 2
    row[0] = row[nx if periodic else 1]
    row[nx + 1] = row[1 if periodic else nx]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _term(out, sigma, moment, sun_harmonic, beam):
    """sigma_l (I_lm + 4 pi Y_lm(sun) T')."""
    for i in range(out.shape[0]):
        out[i] = sigma[i] * (moment[i] + _FOUR_PI * sun_harmonic[i] * beam[i])


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _source_row(
    k,
    j,
    lo,
    hi,
    species_extinction,
    scaled,
    scattering,
    air_extinction,
    air_scattering,
    beam,
    sun_harmonics,
    moments,
    parts,
    whole,
    periodic,
    terms,
    sums,
    source,
    extinction,
):
    """Emission (ordinate, nx + 2) along one row, S_n = sum_lm Y_nlm sigma_l (I_lm + 4 pi Y_lm(sun) T'), and extinction.

    Only nodes lo to hi scatter; rows are cut to them, so that every loop starts at zero and vectorises.
    """
    ns = species_extinction.shape[0]
    degree = air_scattering.shape[1]
    nx = beam.shape[2]
    extinction[:] = air_extinction[k]
    for s in range(ns):
        add(extinction[1 : nx + 1], scaled[s], species_extinction[s, k, j])
    _row_ends(extinction, periodic)
    count = degree * degree
    sigma = terms[count, lo:hi]
    row_t = beam[k, j, lo:hi]
    for ell in range(degree):
        sigma[:] = air_scattering[k, ell]
        for s in range(ns):
            add(sigma, scattering[s, ell], species_extinction[s, k, j, lo:hi])
        for index in range(ell * ell, (ell + 1) * (ell + 1)):
            _term(terms[index, lo:hi], sigma, moments[k, j, index, lo:hi], sun_harmonics[j, index, lo:hi], row_t)
    source[:, :] = _ZERO
    add_products(parts, whole, terms, lo, sums, source, lo + 1, hi - lo)
    for n in range(source.shape[0]):
        _row_ends(source[n], periodic)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _collect_row(k, j, lo, hi, again, intensity, gather, spread, sums, moments):
    """Sum of w_n Y_nlm I_n over one row's ``intensity`` (ordinate, nx + 2), nodes lo to hi, into the moments.

    again: add to what is there, as the second half of the ordinates does.
    """
    if not again:
        moments[k, j, :, lo:hi] = _ZERO
    add_products(gather, spread, intensity, lo + 1, sums, moments[k, j], lo, hi - lo)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _range_to_keep(k, j, first_node, last_node, nx):
    """Nodes of a row where the field is kept: those that scatter, and one row and node beyond them.

    Without the rim, interpolation at the edge of a cloud finds no field.
    """
    nz, ny = first_node.shape
    lo, hi = first_node[k, j], last_node[k, j]
    for n in range(4):
        t = max(0, k - 1) if n == 0 else min(nz - 1, k + 1) if n == 1 else k
        u = max(0, j - 1) if n == 2 else min(ny - 1, j + 1) if n == 3 else j
        if last_node[t, u] > first_node[t, u]:
            lo = min(lo, first_node[t, u]) if hi > lo else first_node[t, u]
            hi = max(hi, last_node[t, u])
    return max(0, lo - 1), (min(nx, hi + 1) if hi > lo else 0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _rows_between(
    first,
    last,
    k,
    before,
    downward,
    species_extinction,
    scaled,
    scattering,
    air_extinction,
    air_scattering,
    beam,
    sun_harmonics,
    first_node,
    last_node,
    ordinates,
    weight,
    parts,
    whole,
    gather,
    spread,
    periodic,
    ground_node,
    moments,
    new_moments,
    flux,
    swept,
    source,
    extinction,
    terms,
    sums,
):
    """Rows first to last: moments of the level ``before``, just swept, and the source at level k, swept next.

    Levels out of the grid are left out, so that every level is met once as either.
    """
    nz, nx = beam.shape[0], beam.shape[2]
    for j in range(first, last):
        if 0 <= before < nz:
            lo, hi = _range_to_keep(before, j, first_node, last_node, nx)
            if hi > lo:
                _collect_row(before, j, lo, hi, not downward, swept[j + 1], gather, spread, sums, new_moments)
            for i in range(nx):
                if before == (ground_node[j, i] if downward else nz - 1):
                    flux[j, i] = _flux(ordinates, weight, swept[j + 1], i)
        if 0 <= k < nz:
            _source_row(
                k,
                j,
                first_node[k, j],
                last_node[k, j],
                species_extinction,
                scaled,
                scattering,
                air_extinction,
                air_scattering,
                beam,
                sun_harmonics,
                moments,
                parts,
                whole,
                periodic,
                terms,
                sums,
                source[j + 1],
                extinction[j + 1, 0],
            )


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _flux(ordinates, weight, intensity, i):
    """Flux of one hemisphere at node i of a row, for radiance on the scale of E_TOA = 1."""
    total = 0.0
    for n in range(weight.shape[0]):
        total += weight[n] * abs(ordinates[n, 2]) * intensity[n, i + 1]
    return total / (4.0 * math.pi)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _sweep_share(
    first,
    stride,
    k,
    downward,
    top,
    periodic,
    cloudy,
    inflow,
    edges,
    ground_node,
    ground_radiance,
    way,
    steps,
    swept,
    old,
    source,
    old_source,
    extinction,
    old_extinction,
    work,
):
    """One thread's share of a plane: ordinates first, first + stride, ..., and what bounds them."""
    for n in range(first, way.shape[0], stride):
        _set_sides(swept, n, periodic, inflow[n], edges[n, k if periodic else 0])
        _end_rows(source, n, periodic)
    _sweep_plane(
        first,
        stride,
        way,
        steps,
        swept,
        old,
        source,
        old_source,
        extinction,
        old_extinction,
        cloudy,
        inflow,
        top,
        periodic,
        work,
    )
    for n in range(first, way.shape[0], stride):
        if not downward:
            _set_ground(swept, n, k, ground_node, ground_radiance)
        if periodic:
            _wrap_sides(swept, n, edges[n, k])


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def half_sweep(
    threads,
    downward,
    species_extinction,
    scaled,
    scattering,
    air_extinction,
    air_scattering,
    beam,
    sun_harmonics,
    levels_m,
    cell_m,
    periodic,
    first_node,
    last_node,
    cloudy,
    ordinates,
    weight,
    parts,
    whole,
    gather,
    spread,
    inflow,
    edges,
    ground_node,
    ground_radiance,
    moments,
    new_moments,
    flux,
):
    """Carry the light of one hemisphere through the grid, plane by plane, and sum its moments into ``new_moments``.

    threads: how many share the work. downward: ordinates whose light comes from above (or level), else from below,
    starting at the ground's radiance; the downward half comes first and overwrites, the other adds.
    species_extinction (s, nz, ny, nx) 1/m; scaled (s,), scattering (s, M): coefficients of the delta-scaled medium;
    air_* the same on levels, (nz,), (nz, M); beam (nz, ny, nx): direct transmission; sun_harmonics (ny, M*M, nx).
    moments, new_moments (nz, ny, M*M, nx): what a row needs lies together.
    first_node, last_node (nz, ny): nodes of each row that scatter; cloudy (nz, ny, block): see `cloudy_blocks`;
    ordinates (n, 3) toward the light's origin, weight (n,); parts to spread: their harmonics, `Mirrored`; inflow
    (nz, n) radiance entering the sides and the top; edges (n, nz, 4, m) last sweep's sides, for periodic grids.
    flux (ny, nx): through the ground (down) or through the top (up).
    """
    nz, ny, nx = beam.shape
    count, degree, sum_count = ordinates.shape[0], air_scattering.shape[1], parts.start.shape[0] - 1
    f32 = np.float32
    intensity = np.zeros((2, ny + 2, count, nx + 2), f32)
    source = np.zeros((2, ny + 2, count, nx + 2), f32)
    extinction = np.zeros((2, ny + 2, 1, nx + 2), f32)
    way, steps = np.empty((count, 3), np.int64), np.empty((count, 8), f32)
    work = np.empty((threads, 3, nx), f32)
    terms, sums = np.empty((threads, degree * degree + 1, nx), f32), np.empty((threads, sum_count, nx), f32)
    for step in range(nz + 1):
        k = nz - 1 - step if downward else step
        before = k + 1 if downward else k - 1
        cur, old = step % 2, 1 - step % 2
        for share in prange(threads):
            t = np.int64(share)  # an unsigned index makes floats of differences
            _rows_between(
                t * ny // threads,
                (t + 1) * ny // threads,
                k,
                before,
                downward,
                species_extinction,
                scaled,
                scattering,
                air_extinction,
                air_scattering,
                beam,
                sun_harmonics,
                first_node,
                last_node,
                ordinates,
                weight,
                parts,
                whole,
                gather,
                spread,
                periodic,
                ground_node,
                moments,
                new_moments,
                flux,
                intensity[old],
                source[cur],
                extinction[cur],
                terms[t],
                sums[t],
            )
        if step < nz:
            _end_rows(extinction[cur], 0, periodic)
            _plan_steps(ordinates, k, before, levels_m, cell_m, air_extinction, way, steps)
            for share in prange(threads):
                t = np.int64(share)
                _sweep_share(
                    t,
                    threads,
                    k,
                    downward,
                    step == 0,
                    periodic,
                    cloudy[k],
                    inflow[k],
                    edges,
                    ground_node,
                    ground_radiance,
                    way,
                    steps,
                    intensity[cur],
                    intensity[old],
                    source[cur],
                    source[old],
                    extinction[cur],
                    extinction[old],
                    work[t],
                )


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def add_prolonged(coarse, moments):
    """Add moments of 2x2-coarse columns (nz, ny, M*M, nx), bilinearly interpolated, to those of the full grid."""
    nz, ny, count, nx = moments.shape
    last_j, last_i = coarse.shape[1] - 1, coarse.shape[3] - 1
    far, near = np.float32(0.25), np.float32(0.75)
    for row in prange(nz * ny):
        k, j = np.int64(row) // ny, np.int64(row) % ny
        m = j // 2
        aside = min(last_j, m + 1) if j % 2 else max(0, m - 1)
        between = np.empty(last_i + 1, np.float32)
        for index in range(count):
            a, b, out = coarse[k, m, index], coarse[k, aside, index], moments[k, j, index]
            for i in range(last_i + 1):
                between[i] = near * a[i] + far * b[i]
            for i in range(nx):
                n = i // 2
                out[i] += near * between[n] + far * between[min(last_i, n + 1) if i % 2 else max(0, n - 1)]
