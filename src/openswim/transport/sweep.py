"""Sweep: light with a source carried through the grid along discrete ordinates, plane after plane.

`half_sweep` returns the spherical-harmonic moments of one hemisphere. Directions point to where the light comes from;
"upstream" is that way. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from openswim.transport.pack import put
from openswim.transport.products import BLOCK
from openswim.transport.sweep_row import carry_row, step_weights
from openswim.transport.sweep_source import coarse_rows, collect_row, source_row

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}


class Half(NamedTuple):
    """The ordinates of one hemisphere: ``direction`` (n, 3) toward the light's origin, ``weight`` (n,)."""

    direction: np.ndarray
    weight: np.ndarray
    inflow: np.ndarray  # (nz, n) radiance entering the sides and the top
    edges: np.ndarray  # (n, nz, 4, m) the sides of the last sweep, for periodic grids


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
        s[5], s[6], s[7] = step_weights(air, up, s[4])


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _sweep_row(n, j, begins, way, step, cur, intensity, source, extinction, cloudy, inflow, top, periodic, nx, work):
    """Row j of ordinate n in plane ``cur``. begins: the first row on the way through the plane; top: the first plane.

    ``inflow``: radiance entering through open sides at this level.
    """
    rows, count, stride = intensity.shape[1], intensity.shape[2], intensity.shape[3]
    axis, sx, t = way[0], way[1], j + way[2]
    here, old = cur * rows, (1 - cur) * rows
    out = ((here + j) * count + n) * stride
    if (axis == _ALONG_Z and top) or (axis == _ALONG_Y and begins and not periodic):
        for i in range(nx + 2):
            put(intensity, out + i, inflow)
        return
    # rows of the four corners: `_ALONG_Z` has all on the plane before, the others two on each
    if axis == _ALONG_Z:
        a, b = old + j, old + j
    elif axis == _ALONG_Y:
        a, b = here + t, here + t
    else:
        a, b = here + j, here + t
    along_x = axis == _ALONG_X
    c = old + (j if along_x else t)
    carry_row(
        intensity, source, extinction, here + j, a, b, c, old + t, n, sx if along_x else 0, sx, along_x, step, cloudy,
        nx, work,
    )  # fmt: skip
    if along_x and not periodic:
        put(intensity, out + (nx if sx > 0 else 1), inflow)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _sweep_plane(
    first, stride, way, steps, cur, intensity, source, extinction, cloudy, inflow, top, periodic, nx, work
):  # fmt: skip
    """Ordinates first, first + stride, ... through one plane, row by row together: their rows lie side by side."""
    ny = intensity.shape[1] - 2
    for side in (1, -1):
        for m in range(ny):
            j = ny - m if side > 0 else 1 + m
            for n in range(first, way.shape[0], stride):
                if way[n, 2] == side:
                    _sweep_row(
                        n, j, m == 0, way[n], steps[n], cur, intensity, source, extinction, cloudy[j - 1], inflow[n],
                        top, periodic, nx, work,
                    )  # fmt: skip


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _set_sides(plane, n, nx, periodic, inflow, side):
    """Ghost nodes of ordinate n before a plane is swept.

    Periodic: the last sweep's sides (4, m) stand in for what this one has not reached yet.
    """
    ny = plane.shape[0] - 2
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
def _wrap_sides(plane, n, nx, side):
    """Ghost nodes of ordinate n of a swept periodic plane: the other side; the next sweep begins from them."""
    ny = plane.shape[0] - 2
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
def _flux(ordinates, weight, intensity, i):
    """Flux of one hemisphere at node i of a row, for radiance on the scale of E_TOA = 1."""
    total = 0.0
    for n in range(weight.shape[0]):
        total += weight[n] * abs(ordinates[n, 2]) * intensity[n, i + 1]
    return total / (4.0 * math.pi)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _finish_rows(first, last, k, downward, plane, intensity, grid, half, gather, spread, place, sums, values, flux):
    """Rows first to last of a plane just swept: moments, and the flux through the ground or the top."""
    nz = grid.beam.shape[0]
    nx = grid.ground_node.shape[1]
    rows = intensity.shape[1]
    for j in range(first, last):
        collect_row(k, j, plane * rows + j + 1, not downward, intensity, gather, spread, place, sums, values, nx)
        for i in range(nx):
            if k == (grid.ground_node[j, i] if downward else nz - 1):
                flux[j, i] = _flux(half.direction, half.weight, intensity[plane, j + 1], i)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _sweep_share(
    first, stride, k, downward, top, cur, grid, half, ground_radiance, highest, way, steps, intensity, source,
    extinction, work,
):  # fmt: skip
    """One thread's share of a plane: ordinates first, first + stride, ..., and what bounds them."""
    inflow = half.inflow[k]
    nx = grid.ground_node.shape[1]
    swept, own = intensity[cur], source[cur]
    for n in range(first, way.shape[0], stride):
        _set_sides(swept, n, nx, grid.periodic, inflow[n], half.edges[n, k if grid.periodic else 0])
        _end_rows(own, n, grid.periodic)
    _sweep_plane(
        first, stride, way, steps, cur, intensity, source, extinction, grid.cloudy[k], inflow, top, grid.periodic, nx,
        work,
    )  # fmt: skip
    for n in range(first, way.shape[0], stride):
        if not downward and k <= highest:
            _set_ground(swept, n, k, grid.ground_node, ground_radiance)
        if grid.periodic:
            _wrap_sides(swept, n, nx, half.edges[n, k])


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
    nz, ny, columns = grid.beam.shape
    degree = grid.air_scattering.shape[1]
    count, sum_count = half.direction.shape[0], parts.start.shape[0] - 1
    f32 = np.float32
    intensity = np.zeros((2, ny + 2, count, columns + 2), f32)
    source = np.zeros((2, ny + 2, count, columns + 2), f32)
    extinction = np.zeros((2, ny + 2, 1, columns + 2), f32)
    way, steps = np.empty((count, 3), np.int64), np.empty((count, 8), f32)
    work = np.empty((threads, 2, columns + 2), f32)
    terms, sums = np.empty((threads, degree * degree, BLOCK), f32), np.empty((threads, sum_count, BLOCK), f32)
    rows = coarser.beam.shape[1]
    kinds = 1 + grid.extinction.shape[0] if coarser.factor > 0 else 0
    planes = np.zeros((kinds, rows, count, columns + 2), f32)
    lines = np.empty((threads, count, coarser.beam.shape[2] + 2), f32)
    highest = grid.ground_node.max()
    for step in range(nz + 1):
        k = nz - 1 - step if downward else step
        before = k + 1 if downward else k - 1
        cur, old = step % 2, 1 - step % 2
        for share in prange(threads):
            t = np.int64(share)  # an unsigned index makes floats of differences
            if step > 0:
                _finish_rows(
                    t * ny // threads, (t + 1) * ny // threads, before, downward, old, intensity, grid, half, gather,
                    spread, place, sums[t], new_values, flux,
                )  # fmt: skip
            if step < nz and kinds > 0:
                coarse_rows(
                    t * rows // threads, (t + 1) * rows // threads, k, grid, parts, whole, coarser, grid.present[k],
                    terms[t], sums[t], lines[t], planes,
                )  # fmt: skip
        if step < nz:
            for share in prange(threads):
                t = np.int64(share)
                for j in range(t * ny // threads, (t + 1) * ny // threads):
                    source_row(
                        k, j, cur * (ny + 2) + j + 1, grid, parts, whole, place, values, coarser, planes,
                        grid.present[k], terms[t], sums[t], source, extinction,
                    )  # fmt: skip
            _end_rows(extinction[cur], 0, grid.periodic)
            _plan_steps(half.direction, k, before, grid.levels_m, grid.cell_m, grid.air_extinction, way, steps)
            for share in prange(threads):
                t = np.int64(share)
                _sweep_share(
                    t, threads, k, downward, step == 0, cur, grid, half, ground_radiance, highest, way, steps,
                    intensity, source, extinction, work[t],
                )  # fmt: skip
