"""Sweep: light with a source carried through the grid along discrete ordinates, node after node.

`half_sweep` returns the spherical-harmonic moments of one hemisphere. Directions point to where the light comes from;
"upstream" is that way. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from openswim.transport.moments import BLOCK, between, coarser_row
from openswim.transport.products import add, add_products

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_ONE = np.float32(1.0)
_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)
_FOUR_PI = np.float32(4.0 * math.pi)

class OpticalGrid(NamedTuple):
    """The delta-scaled medium of one wavelength on the nodes (nz, ny, nx) of a grid, and the beam that lights it."""

    extinction: np.ndarray  # (s, nz, ny, nx) of every species at its reference wavelength, 1/m
    scaled: np.ndarray  # (s,) delta-scaled extinction per reference extinction
    scattering: np.ndarray  # (s, M) Legendre moments of scattering per reference extinction
    air_extinction: np.ndarray  # (nz,) of the air on the levels, 1/m
    air_scattering: np.ndarray  # (nz, M)
    beam: np.ndarray  # direct transmission
    sun_harmonics: np.ndarray  # (ny, M*M, nx) harmonics of the direction to the sun in the column's axes
    levels_m: np.ndarray
    cell_m: np.ndarray
    periodic: bool
    ground_node: np.ndarray  # (ny, nx) lowest level not under the ground
    cloudy: np.ndarray  # (nz, ny, blocks) blocks with cloud in or next to them


class Half(NamedTuple):
    """The ordinates of one hemisphere: ``direction`` (n, 3) toward the light's origin, ``weight`` (n,)."""

    direction: np.ndarray
    weight: np.ndarray
    inflow: np.ndarray  # (nz, n) radiance entering the sides and the top
    edges: np.ndarray  # (n, nz, 4, m) the sides of the last sweep, for periodic grids


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
        lo, hi = 1 + block * BLOCK, 1 + min(nx, end * BLOCK)
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
def _kept_end(place, block):
    """The block after the last that is kept like ``block``."""
    n = block + 1
    while n < place.shape[0] and (place[n] >= 0) == (place[block] >= 0):
        n += 1
    return n


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _coarse_row(k, j, degree, sigma, coarser, parts, whole, scratch, terms, sums, lines, out):
    """Source (ordinate, nx + 2) per unit of a medium that scatters ``sigma`` (M,), from the coarser field at row j.

    Row j is one of the coarser grid; what it brings is stretched to the nodes of the finer one.
    """
    nx = coarser.beam.shape[2]
    coarser_row(coarser.place, coarser.values, k, j, 1, scratch)
    row_t = coarser.beam[k, j]
    for ell in range(degree):
        terms[degree * degree, :nx] = sigma[ell]
        for index in range(ell * ell, (ell + 1) * (ell + 1)):
            harmonic = coarser.sun_harmonics[j, index]
            _term(terms[index, :nx], terms[degree * degree, :nx], scratch[index], harmonic, row_t)
    lines[:, :] = _ZERO
    add_products(parts, whole, terms, 0, sums, lines, 0, nx)
    far, near = np.float32(0.25), np.float32(0.75)
    for n in range(out.shape[0]):
        line, row = lines[n], out[n]
        for i in range(out.shape[1] - 2):
            m = i // 2
            aside = min(nx - 1, m + 1) if i % 2 else max(0, m - 1)
            row[i + 1] = near * line[m] + far * line[aside]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _add_coarse(k, j, lo, hi, grid, coarser, planes, source):
    """Add the source of what is not kept, nodes lo to hi: the air's, and that of thin cloud by its extinction.

    planes (1 + s, rows of the coarser grid, ordinate, nx + 2): source per unit of the air and of every species.
    """
    m, share = between(j, coarser.factor, planes.shape[1])
    near = min(m + 1, planes.shape[1] - 1)
    rest = _ONE - share
    if grid.air_scattering[k, 0] > _ZERO:
        for n in range(source.shape[0]):
            out, one = source[n, lo + 1 : hi + 1], planes[0, m, n, lo + 1 : hi + 1]
            two = planes[0, near, n, lo + 1 : hi + 1]
            for i in range(hi - lo):
                out[i] += rest * one[i] + share * two[i]
    for s in range(grid.extinction.shape[0]):
        row = grid.extinction[s, k, j, lo:hi]
        most = _ZERO
        for i in range(hi - lo):
            most = max(most, row[i])
        if most > _ZERO:
            for n in range(source.shape[0]):
                out, one = source[n, lo + 1 : hi + 1], planes[1 + s, m, n, lo + 1 : hi + 1]
                two = planes[1 + s, near, n, lo + 1 : hi + 1]
                for i in range(hi - lo):
                    out[i] += row[i] * (rest * one[i] + share * two[i])


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _source_row(k, j, grid, parts, whole, place, values, coarser, planes, terms, sums, source, extinction):
    """Emission (ordinate, nx + 2) along one row, S_n = sum_lm Y_nlm sigma_l (I_lm + 4 pi Y_lm(sun) T'), and extinction.

    Rows are cut to runs of blocks, so that every loop starts at zero and vectorises.
    """
    ns = grid.extinction.shape[0]
    degree = grid.air_scattering.shape[1]
    nx = grid.beam.shape[2]
    extinction[:] = grid.air_extinction[k]
    for s in range(ns):
        add(extinction[1 : nx + 1], grid.scaled[s], grid.extinction[s, k, j])
    _row_ends(extinction, grid.periodic)
    source[:, :] = _ZERO
    block = 0
    while block < place.shape[2]:
        end = _kept_end(place[k, j], block)
        lo, hi = block * BLOCK, min(nx, end * BLOCK)
        if place[k, j, block] >= 0:
            sigma = terms[degree * degree]
            for ell in range(degree):
                sigma[lo:hi] = grid.air_scattering[k, ell]
                for s in range(ns):
                    add(sigma[lo:hi], grid.scattering[s, ell], grid.extinction[s, k, j, lo:hi])
                for b in range(block, end):
                    a, z = b * BLOCK, min(nx, (b + 1) * BLOCK)
                    one = values[place[k, j, b]]
                    for index in range(ell * ell, (ell + 1) * (ell + 1)):
                        _term(
                            terms[index, a:z], sigma[a:z], one[index, : z - a], grid.sun_harmonics[j, index, a:z],
                            grid.beam[k, j, a:z],
                        )  # fmt: skip
            add_products(parts, whole, terms, lo, sums, source, lo + 1, hi - lo)
        elif coarser.factor > 0:
            _add_coarse(k, j, lo, hi, grid, coarser, planes, source)
        block = end
    for n in range(source.shape[0]):
        _row_ends(source[n], grid.periodic)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _collect_row(place, again, intensity, gather, spread, sums, rows, values):
    """Sum of w_n Y_nlm I_n over one row's ``intensity`` (ordinate, nx + 2) into the blocks that are kept.

    again: add to what is there, as the second half of the ordinates does. rows (M*M, nx) is scratch.
    """
    nx = intensity.shape[1] - 2
    block = 0
    while block < place.shape[0]:
        end = _kept_end(place, block)
        if place[block] >= 0:
            lo, hi = block * BLOCK, min(nx, end * BLOCK)
            rows[: values.shape[1], lo:hi] = _ZERO
            add_products(gather, spread, intensity, lo + 1, sums, rows, lo, hi - lo)
            for b in range(block, end):
                a, z = b * BLOCK, min(nx, (b + 1) * BLOCK)
                one = values[place[b]]
                for index in range(one.shape[0]):
                    out, row = one[index, : z - a], rows[index, a:z]
                    before = _ONE if again else _ZERO
                    for i in range(z - a):
                        out[i] = before * out[i] + row[i]
        block = end


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _flux(ordinates, weight, intensity, i):
    """Flux of one hemisphere at node i of a row, for radiance on the scale of E_TOA = 1."""
    total = 0.0
    for n in range(weight.shape[0]):
        total += weight[n] * abs(ordinates[n, 2]) * intensity[n, i + 1]
    return total / (4.0 * math.pi)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _finish_rows(first, last, k, downward, grid, half, gather, spread, place, swept, terms, sums, values, flux):
    """Rows first to last of a plane just swept: moments, and the flux through the ground or the top."""
    nz, nx = grid.beam.shape[0], grid.beam.shape[2]
    for j in range(first, last):
        _collect_row(place[k, j], not downward, swept[j + 1], gather, spread, sums, terms, values)
        for i in range(nx):
            if k == (grid.ground_node[j, i] if downward else nz - 1):
                flux[j, i] = _flux(half.direction, half.weight, swept[j + 1], i)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _coarse_rows(first, last, k, grid, parts, whole, coarser, scratch, terms, sums, lines, planes):
    """Rows first to last of what the coarser field gives the air and the species of level k: see `_add_coarse`."""
    degree = grid.air_scattering.shape[1]
    for j in range(first, last):
        for s in range(planes.shape[0]):
            sigma = grid.air_scattering[k] if s == 0 else grid.scattering[s - 1]
            if s == 0 and sigma[0] == _ZERO:
                continue
            if s > 0 and grid.extinction[s - 1, k].max() == _ZERO:
                continue
            _coarse_row(
                k, j, degree, sigma, coarser, parts, whole, scratch, terms, sums, lines, planes[s, j]
            )  # fmt: skip


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _sweep_share(
    first, stride, k, downward, top, grid, half, ground_radiance, way, steps, swept, old, source, old_source,
    extinction, old_extinction, work,
):  # fmt: skip
    """One thread's share of a plane: ordinates first, first + stride, ..., and what bounds them."""
    inflow = half.inflow[k]
    for n in range(first, way.shape[0], stride):
        _set_sides(swept, n, grid.periodic, inflow[n], half.edges[n, k if grid.periodic else 0])
        _end_rows(source, n, grid.periodic)
    _sweep_plane(
        first, stride, way, steps, swept, old, source, old_source, extinction, old_extinction, grid.cloudy[k], inflow,
        top, grid.periodic, work,
    )  # fmt: skip
    for n in range(first, way.shape[0], stride):
        if not downward:
            _set_ground(swept, n, k, grid.ground_node, ground_radiance)
        if grid.periodic:
            _wrap_sides(swept, n, half.edges[n, k])


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def half_sweep(
    threads, downward, grid, half, parts, whole, gather, spread, place, values, coarser, ground_radiance,
    new_values, flux,
):  # fmt: skip
    """Carry the light of one hemisphere through the grid, plane by plane, and sum its moments into ``new_values``.

    threads: how many share the work. downward: ordinates whose light comes from above (or level), else from below,
    starting at the ground's radiance (ny, nx); the downward half comes first and overwrites, the other adds.
    parts to spread: the ordinates' harmonics, `Mirrored`.
    place, values: `Moments` before; new_values: after; coarser: the field that lights what is not kept.
    flux (ny, nx): through the ground (down) or through the top (up).
    """
    nz, ny, nx = grid.beam.shape
    degree = grid.air_scattering.shape[1]
    count, sum_count = half.direction.shape[0], parts.start.shape[0] - 1
    f32 = np.float32
    intensity = np.zeros((2, ny + 2, count, nx + 2), f32)
    source = np.zeros((2, ny + 2, count, nx + 2), f32)
    extinction = np.zeros((2, ny + 2, 1, nx + 2), f32)
    way, steps = np.empty((count, 3), np.int64), np.empty((count, 8), f32)
    work = np.empty((threads, 3, nx), f32)
    terms, sums = np.empty((threads, degree * degree + 1, nx), f32), np.empty((threads, sum_count, nx), f32)
    rows, columns = coarser.beam.shape[1], coarser.beam.shape[2]
    species = grid.extinction.shape[0]
    planes = np.zeros((1 + species if coarser.factor > 0 else 0, rows, count, nx + 2), f32)
    scratch = np.empty((threads, degree * degree, columns), f32)
    lines = np.empty((threads, count, columns), f32)
    for step in range(nz + 1):
        k = nz - 1 - step if downward else step
        before = k + 1 if downward else k - 1
        cur, old = step % 2, 1 - step % 2
        for share in prange(threads):
            t = np.int64(share)  # an unsigned index makes floats of differences
            first, last = t * ny // threads, (t + 1) * ny // threads
            if step > 0:
                _finish_rows(
                    first, last, before, downward, grid, half, gather, spread, place, intensity[old], terms[t],
                    sums[t], new_values, flux,
                )  # fmt: skip
            if step < nz and coarser.factor > 0:
                _coarse_rows(
                    t * rows // threads, (t + 1) * rows // threads, k, grid, parts, whole, coarser, scratch[t],
                    terms[t], sums[t], lines[t], planes,
                )  # fmt: skip
        if step < nz:
            for share in prange(threads):
                t = np.int64(share)
                for j in range(t * ny // threads, (t + 1) * ny // threads):
                    _source_row(
                        k, j, grid, parts, whole, place, values, coarser, planes, terms[t], sums[t], source[cur, j + 1],
                        extinction[cur, j + 1, 0],
                    )  # fmt: skip
            _end_rows(extinction[cur], 0, grid.periodic)
            _plan_steps(half.direction, k, before, grid.levels_m, grid.cell_m, grid.air_extinction, way, steps)
            for share in prange(threads):
                t = np.int64(share)
                _sweep_share(
                    t, threads, k, downward, step == 0, grid, half, ground_radiance, way, steps, intensity[cur],
                    intensity[old], source[cur], source[old], extinction[cur], extinction[old], work[t],
                )  # fmt: skip
