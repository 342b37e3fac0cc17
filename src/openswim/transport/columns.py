"""The diffuse light of very large domains: every column on its own, under the sun's beam that all of them share.

Cells of kilometres are so much wider than the way light diffuses in cloud that little passes between columns. What
does not is solved without sweeps: spherical harmonics of four degrees in each of three Fourier modes about the sun's
azimuth (P3; Chandrasekhar 1960; Marshak's boundaries), layer by layer with the box scheme, in layers as thin as the
light asks. The eye then sees of each cell what its thin layers send up. docs/decisions/0013-large-domains.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.eye_source import columns_of
from openswim.transport.medium import Medium
from openswim.transport.optical_grid import Coefficients
from openswim.transport.pack import (
    LANES,
    PACK,
    choose_above,
    flat,
    largest,
    put,
    read_quadruple,
    root,
    spread_quadruple,
    write,
)
from openswim.transport.scalar import step_emission, transmission
from openswim.transport.shells import clear_radiance
from openswim.transport.threads import in_threads
from openswim.transport.volume import DEGREE

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MODES, _ORDERS = 3, 4  # Fourier modes; degrees in each, from the mode's own on
MOST_PARTS = 12  # of a cell
_PART_DEPTH = np.float32(0.8)  # delta-scaled optical depth of a part
_COLUMN_SUNS = 33
_MOST, _LEAST = np.float32(4.0), np.float32(0.25)  # of a node's source, that the eye may be shown in its place
_ZERO, _HALF, _ONE, _TWO = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)

# Rows of `mode_tables`
_C1, _C2, _C3, _HO, _HE, _FIRST, _UP_EVEN, _UP_ODD, _TABLE = 0, 1, 2, 3, 7, 11, 13, 15, 17


def _first(m: int) -> float:
    """sqrt(1/(2m)!) P_mm / sin^m, without its sign."""
    return float(np.prod(np.sqrt((2 * np.arange(m) + 1) / (2 * np.arange(m) + 2))))


def harmonics_of_mode(mu: F64, m: int) -> F64:
    """sqrt((l-m)!/(l+m)!) P_lm(mu) / sin^m, l = m ... m + 3: (4, n)."""
    before, this = np.zeros_like(mu), np.full_like(mu, _first(m))
    out = []
    for ell in range(m, m + _ORDERS):
        out.append(this)
        following = (2 * ell + 1) * mu * this - np.sqrt(ell**2 - m**2) * before
        before, this = this, following / np.sqrt((ell + 1) ** 2 - m**2)
    return np.array(out)


def mode_tables() -> F32:
    """Of every mode (MODES, _TABLE) what streaming couples, and what Marshak's conditions ask of odd harmonics."""
    x, w = np.polynomial.legendre.leggauss(16)
    x, w = (x + 1) / 2, w / 2
    out = np.zeros((MODES, _TABLE), np.float32)
    for m in range(MODES):
        y = harmonics_of_mode(x, m) * np.sqrt(1 - x**2) ** m
        ell = np.arange(m, m + _ORDERS)
        half = (w * y) @ y.T * (2 * ell + 1)
        up = (2 * ell + 1) * ((w * x) @ y.T)
        out[m, _C1 : _C3 + 1] = np.sqrt(ell[1:] ** 2 - m**2)
        out[m, _HO:_HE] = half[np.ix_([1, 3], [1, 3])].ravel()
        out[m, _HE:_FIRST] = half[np.ix_([1, 3], [0, 2])].ravel()
        if m == 0:
            out[m, _FIRST:_UP_EVEN] = (w @ y.T)[[1, 3]]
            out[m, _UP_EVEN:_UP_ODD], out[m, _UP_ODD:] = up[[0, 2]], up[[1, 3]]
    return out


def _recurrence() -> tuple[F32, F32, F32]:
    """Coefficients of `harmonics_of_mode`, [m, l - m] and [m]."""
    m, ell = np.arange(MODES)[:, None], np.arange(MODES)[:, None] + np.arange(_ORDERS)
    root_of_next = np.sqrt((ell + 1) ** 2 - m**2)
    first = np.array([_first(n) for n in range(MODES)])
    f32 = np.float32
    return ((2 * ell + 1) / root_of_next).astype(f32), (np.sqrt(ell**2 - m**2) / root_of_next).astype(f32), first.astype(f32)


_UP, _BACK, _BEGIN = _recurrence()


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _direction(m, mu, n, out):
    """`harmonics_of_mode` of LANES cosines into out[n:]."""
    p0, p1 = spread_quadruple(_ZERO), spread_quadruple(_BEGIN[m])
    for i in range(_ORDERS):
        write(out, n + i * LANES, p1)
        up = _UP[m, i] * (mu * p1) - _BACK[m, i] * p0
        p0, p1 = p1, up


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _looks(j, i, levels_m, columns, sun, eye, parallel, looks, phases, slopes):
    """Of the way to the eye at every level: weights of the moments (nz, MODES, _ORDERS), (2l+1) P_l of the angle from
    the sun (nz, DEGREE), and the cosine upward (nz), for LANES columns."""
    nx = columns.shape[2]
    c = j * 12 * nx + i
    s = j * 3 * nx + i
    sx, sy, sz = read_quadruple(sun, s), read_quadruple(sun, s + nx), read_quadruple(sun, s + 2 * nx)
    ax, ay, az = read_quadruple(columns, c + 9 * nx), read_quadruple(columns, c + 10 * nx), read_quadruple(
        columns, c + 11 * nx
    )
    for k in range(levels_m.shape[0]):
        height = np.float32(levels_m[k])
        if parallel:
            vx, vy, vz = spread_quadruple(eye[0]), spread_quadruple(eye[1]), spread_quadruple(eye[2])
        else:
            vx = read_quadruple(columns, c) + height * ax
            vy = read_quadruple(columns, c + nx) + height * ay
            vz = read_quadruple(columns, c + 2 * nx) + height * az
            r = _ONE / (root(vx * vx + vy * vy + vz * vz) + np.float32(1e-6))
            vx, vy, vz = vx * r, vy * r, vz * r
        x = read_quadruple(columns, c + 3 * nx) * vx + read_quadruple(columns, c + 4 * nx) * vy
        x += read_quadruple(columns, c + 5 * nx) * vz
        y = read_quadruple(columns, c + 6 * nx) * vx + read_quadruple(columns, c + 7 * nx) * vy
        y += read_quadruple(columns, c + 8 * nx) * vz
        z = ax * vx + ay * vy + az * vz
        along = x * sx + y * sy  # sines of both zenith angles, times the cosine between azimuths
        angle = along + z * sz
        p0, p1 = spread_quadruple(_ONE), angle
        for ell in range(DEGREE):
            write(phases, (k * DEGREE + ell) * LANES, np.float32(2 * ell + 1) * p0)
            up = (np.float32((2 * ell + 3) / (ell + 2)) * angle) * p1 - np.float32((ell + 1) / (ell + 2)) * p0
            p0, p1 = p1, up
        write(slopes, k * LANES, _ZERO - z)
        for m in range(MODES):
            n = (k * MODES + m) * _ORDERS * LANES
            _direction(m, _ZERO - z, n, looks)
            turn = spread_quadruple(_ONE)
            if m == 1:
                turn = _TWO * along
            elif m == 2:
                turn = _TWO * (_TWO * along * along - (_ONE - z * z) * (_ONE - sz * sz))
            for ell in range(m, m + _ORDERS):
                at = n + (ell - m) * LANES
                write(looks, at, np.float32(2 * ell + 1) * turn * read_quadruple(looks, at))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _eliminate(m, count, table, thick, medium, light, lit, first, node, ground, start, rows):
    """From the ground up the odd moments by the even ones, ``rows`` (part, 6): o = R e + q."""
    t = m * _TABLE
    c1, c2, c3 = flat(table, t + _C1), flat(table, t + _C2), flat(table, t + _C3)
    r00, r01 = read_quadruple(start, 0), read_quadruple(start, LANES)
    r10, r11 = read_quadruple(start, 2 * LANES), read_quadruple(start, 3 * LANES)
    q0, q1 = read_quadruple(start, 4 * LANES), read_quadruple(start, 5 * LANES)
    low = read_quadruple(ground, 0)
    k = 0
    for s in range(first, count):
        if s > first:
            h = flat(thick, s - 1)
            a = (s - 1) * (DEGREE + 1) * LANES
            b = a + (DEGREE + 1) * LANES
            half = _HALF * h
            ext = half * _HALF * (read_quadruple(medium, a) + read_quadruple(medium, b))
            beam = h * read_quadruple(light, (s - 1) * LANES)
            s0 = _HALF * (read_quadruple(medium, a + (1 + m) * LANES) + read_quadruple(medium, b + (1 + m) * LANES))
            s1 = _HALF * (read_quadruple(medium, a + (2 + m) * LANES) + read_quadruple(medium, b + (2 + m) * LANES))
            s2 = _HALF * (read_quadruple(medium, a + (3 + m) * LANES) + read_quadruple(medium, b + (3 + m) * LANES))
            s3 = spread_quadruple(_ZERO)
            if m + 3 < DEGREE:
                s3 = _HALF * (read_quadruple(medium, a + (4 + m) * LANES) + read_quadruple(medium, b + (4 + m) * LANES))
            w0, w1, w2, w3 = (np.float32(2 * m + 1), np.float32(2 * m + 3), np.float32(2 * m + 5), np.float32(2 * m + 7))
            ae0, ao0 = w0 * (ext - half * s0), w1 * (ext - half * s1)
            ae1, ao1 = w2 * (ext - half * s2), w3 * (ext - half * s3)
            y = m * _ORDERS * LANES
            se0 = w0 * beam * s0 * read_quadruple(lit, y)
            so0 = w1 * beam * s1 * read_quadruple(lit, y + LANES)
            se1 = w2 * beam * s2 * read_quadruple(lit, y + 2 * LANES)
            so1 = w3 * beam * s3 * read_quadruple(lit, y + 3 * LANES)
            p00, p01 = ao0 * r00 - c1, ao0 * r01 - c2
            p10, p11 = ao1 * r10, ao1 * r11 - c3
            det = _ONE / (p00 * p11 - p01 * p10)
            n00, n01 = ae0 - c1 * r00, _ZERO - c1 * r01
            n10, n11 = _ZERO - c2 * r00 - c3 * r10, ae1 - c2 * r01 - c3 * r11
            g00, g01 = (n00 * p11 - n01 * p10) * det, (n01 * p00 - n00 * p01) * det
            g10, g11 = (n10 * p11 - n11 * p10) * det, (n11 * p00 - n10 * p01) * det
            m00, m01 = c1 - g00 * ao0, _ZERO - g01 * ao1
            m10, m11 = c2 - g10 * ao0, c3 - g11 * ao1
            det = _ONE / (m00 * m11 - m01 * m10)
            i00, i01, i10, i11 = m11 * det, _ZERO - m01 * det, _ZERO - m10 * det, m00 * det
            v0, v1 = so0 - ao0 * q0, so1 - ao1 * q1
            u0 = se0 + c1 * q0 - (g00 * v0 + g01 * v1)
            u1 = se1 + c2 * q0 + c3 * q1 - (g10 * v0 + g11 * v1)
            q0, q1 = i00 * u0 + i01 * u1, i10 * u0 + i11 * u1
            x00, x01 = g00 * c1 - ae0, g00 * c2 + g01 * c3
            x10, x11 = g10 * c1, g10 * c2 + g11 * c3 - ae1
            r00, r01 = i00 * x00 + i01 * x10, i00 * x01 + i01 * x11
            r10, r11 = i10 * x00 + i11 * x10, i10 * x01 + i11 * x11
            # columns whose ground lies higher begin there
            here = spread_quadruple(flat(node, s))
            r00 = choose_above(here, low, r00, read_quadruple(start, 0))
            r01 = choose_above(here, low, r01, read_quadruple(start, LANES))
            r10 = choose_above(here, low, r10, read_quadruple(start, 2 * LANES))
            r11 = choose_above(here, low, r11, read_quadruple(start, 3 * LANES))
            q0 = choose_above(here, low, q0, read_quadruple(start, 4 * LANES))
            q1 = choose_above(here, low, q1, read_quadruple(start, 5 * LANES))
        k = s * 6 * LANES
        write(rows, k, r00)
        write(rows, k + LANES, r01)
        write(rows, k + 2 * LANES, r10)
        write(rows, k + 3 * LANES, r11)
        write(rows, k + 4 * LANES, q0)
        write(rows, k + 5 * LANES, q1)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _ground_start(m, table, ground, start):
    """R and q on the ground; ``ground``: its level, albedo, and the beam's flux on it."""
    t = m * _TABLE
    h00, h01, h10, h11 = flat(table, t + _HO), flat(table, t + _HO + 1), flat(table, t + _HO + 2), flat(table, t + _HO + 3)
    e00, e01, e10, e11 = flat(table, t + _HE), flat(table, t + _HE + 1), flat(table, t + _HE + 2), flat(table, t + _HE + 3)
    f0, f1 = flat(table, t + _FIRST), flat(table, t + _FIRST + 1)
    twice = _TWO * read_quadruple(ground, LANES)
    o00 = h00 + twice * (f0 * flat(table, t + _UP_ODD))
    o01 = h01 + twice * (f0 * flat(table, t + _UP_ODD + 1))
    o10 = h10 + twice * (f1 * flat(table, t + _UP_ODD))
    o11 = h11 + twice * (f1 * flat(table, t + _UP_ODD + 1))
    g00 = twice * (f0 * flat(table, t + _UP_EVEN)) - e00
    g01 = twice * (f0 * flat(table, t + _UP_EVEN + 1)) - e01
    g10 = twice * (f1 * flat(table, t + _UP_EVEN)) - e10
    g11 = twice * (f1 * flat(table, t + _UP_EVEN + 1)) - e11
    det = _ONE / (o00 * o11 - o01 * o10)
    given = _TWO * twice * read_quadruple(ground, 2 * LANES)
    write(start, 0, (o11 * g00 - o01 * g10) * det)
    write(start, LANES, (o11 * g01 - o01 * g11) * det)
    write(start, 2 * LANES, (o00 * g10 - o10 * g00) * det)
    write(start, 3 * LANES, (o00 * g11 - o10 * g01) * det)
    write(start, 4 * LANES, given * (o11 * f0 - o01 * f1) * det)
    write(start, 5 * LANES, given * (o00 * f1 - o10 * f0) * det)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _back(m, count, table, thick, medium, light, lit, first, node, below, ground, inflow, rows, looks, source, flux):
    """From the top down the moments; what they scatter toward the eye is added to ``source`` (part), and ``flux`` gets
    the light that comes down to the ground and goes up at the top."""
    t = m * _TABLE
    c1, c2, c3 = flat(table, t + _C1), flat(table, t + _C2), flat(table, t + _C3)
    h00, h01, h10, h11 = flat(table, t + _HO), flat(table, t + _HO + 1), flat(table, t + _HO + 2), flat(table, t + _HO + 3)
    d00, d01, d10, d11 = flat(table, t + _HE), flat(table, t + _HE + 1), flat(table, t + _HE + 2), flat(table, t + _HE + 3)
    k = (count - 1) * 6 * LANES
    r00, r01 = read_quadruple(rows, k), read_quadruple(rows, k + LANES)
    r10, r11 = read_quadruple(rows, k + 2 * LANES), read_quadruple(rows, k + 3 * LANES)
    q0, q1 = read_quadruple(rows, k + 4 * LANES), read_quadruple(rows, k + 5 * LANES)
    a00, a01 = d00 - (h00 * r00 + h01 * r10), d01 - (h00 * r01 + h01 * r11)
    a10, a11 = d10 - (h10 * r00 + h11 * r10), d11 - (h10 * r01 + h11 * r11)
    b0, b1 = h00 * q0 + h01 * q1, h10 * q0 + h11 * q1
    if m == 0:
        b0 += read_quadruple(inflow, 0)
        b1 += read_quadruple(inflow, LANES)
    det = _ONE / (a00 * a11 - a01 * a10)
    e0, e1 = (a11 * b0 - a01 * b1) * det, (a00 * b1 - a10 * b0) * det
    o0, o1 = r00 * e0 + r01 * e1 + q0, r10 * e0 + r11 * e1 + q1
    ve0, ve1 = flat(table, t + _UP_EVEN), flat(table, t + _UP_EVEN + 1)
    vo0, vo1 = flat(table, t + _UP_ODD), flat(table, t + _UP_ODD + 1)
    low = read_quadruple(ground, 0)
    if m == 0:
        write(flux, LANES, _HALF * (ve0 * e0 + ve1 * e1 + vo0 * o0 + vo1 * o1))
    for s in range(count - 1, first - 1, -1):
        if s < count - 1:
            h = flat(thick, s)
            a = s * (DEGREE + 1) * LANES
            b = a + (DEGREE + 1) * LANES
            half = _HALF * h
            ext = half * _HALF * (read_quadruple(medium, a) + read_quadruple(medium, b))
            beam = h * read_quadruple(light, s * LANES)
            s1 = _HALF * (read_quadruple(medium, a + (2 + m) * LANES) + read_quadruple(medium, b + (2 + m) * LANES))
            s3 = spread_quadruple(_ZERO)
            if m + 3 < DEGREE:
                s3 = _HALF * (read_quadruple(medium, a + (4 + m) * LANES) + read_quadruple(medium, b + (4 + m) * LANES))
            w1, w3 = np.float32(2 * m + 3), np.float32(2 * m + 7)
            ao0, ao1 = w1 * (ext - half * s1), w3 * (ext - half * s3)
            y = m * _ORDERS * LANES
            so0 = w1 * beam * s1 * read_quadruple(lit, y + LANES)
            so1 = w3 * beam * s3 * read_quadruple(lit, y + 3 * LANES)
            k = s * 6 * LANES
            r00, r01 = read_quadruple(rows, k), read_quadruple(rows, k + LANES)
            r10, r11 = read_quadruple(rows, k + 2 * LANES), read_quadruple(rows, k + 3 * LANES)
            q0, q1 = read_quadruple(rows, k + 4 * LANES), read_quadruple(rows, k + 5 * LANES)
            p00, p01 = ao0 * r00 - c1, ao0 * r01 - c2
            p10, p11 = ao1 * r10, ao1 * r11 - c3
            v0 = so0 - c1 * e0 - c2 * e1 - ao0 * (o0 + q0)
            v1 = so1 - c3 * e1 - ao1 * (o1 + q1)
            det = _ONE / (p00 * p11 - p01 * p10)
            e0, e1 = (p11 * v0 - p01 * v1) * det, (p00 * v1 - p10 * v0) * det
            o0, o1 = r00 * e0 + r01 * e1 + q0, r10 * e0 + r11 * e1 + q1
        if m == 0:
            down = _HALF * (ve0 * e0 + ve1 * e1 - vo0 * o0 - vo1 * o1)
            here = spread_quadruple(flat(node, s))
            write(flux, 0, choose_above(low - np.float32(0.01), here, read_quadruple(flux, 0), down))
        a = s * (DEGREE + 1) * LANES
        n = (int(flat(below, s)) * MODES + m) * _ORDERS * LANES
        total = read_quadruple(source, s * LANES)
        total += read_quadruple(looks, n) * read_quadruple(medium, a + (1 + m) * LANES) * e0
        total += read_quadruple(looks, n + LANES) * read_quadruple(medium, a + (2 + m) * LANES) * o0
        total += read_quadruple(looks, n + 2 * LANES) * read_quadruple(medium, a + (3 + m) * LANES) * e1
        if m + 3 < DEGREE:
            total += read_quadruple(looks, n + 3 * LANES) * read_quadruple(medium, a + (4 + m) * LANES) * o1
        write(source, s * LANES, total)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _nodes(w, j, i, extinction, scaled, scattering, air_extinction, air_scattering, phases, fields, nodes):
    """At every level (nz, DEGREE + 3) extinction and moments of scattering, air's too, what the species scatter of the
    beam toward the eye, and the depth to the sun, at LANES nodes and wavelength w."""
    ns, nz, ny, nx = extinction.shape
    channels = fields.shape[3]
    for k in range(nz):
        out = k * (DEGREE + 3) * LANES
        node = (k * ny + j) * nx + i
        total = spread_quadruple(air_extinction[w, k])
        for s in range(ns):
            total += scaled[w, s] * read_quadruple(extinction, s * nz * ny * nx + node)
        write(nodes, out, total)
        once = spread_quadruple(_ZERO)
        for ell in range(DEGREE):
            sigma = spread_quadruple(_ZERO)
            for s in range(ns):
                sigma += scattering[w, s, ell] * read_quadruple(extinction, s * nz * ny * nx + node)
            once += sigma * read_quadruple(phases, (k * DEGREE + ell) * LANES)
            write(nodes, out + (1 + ell) * LANES, sigma + air_scattering[w, k, ell])
        write(nodes, out + (DEGREE + 1) * LANES, once)
        for n in range(LANES):
            put(nodes, out + (DEGREE + 2) * LANES + n, flat(fields, (node + n) * channels + w))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _count_parts(nodes, levels_m, parts):
    """Into how many parts each cell (nz - 1) is divided, and how many places there are."""
    count = 1
    for k in range(levels_m.shape[0] - 1):
        a = k * (DEGREE + 3) * LANES
        mean = _HALF * (read_quadruple(nodes, a) + read_quadruple(nodes, a + (DEGREE + 3) * LANES))
        depth = largest(mean) * np.float32(levels_m[k + 1] - levels_m[k])
        parts[k] = max(1, min(MOST_PARTS, int(np.ceil(depth / _PART_DEPTH))))
        count += parts[k]
    return count


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _place_at(s, k, share, nodes, medium, sunlit, source):
    """Place s between levels k and k + 1: extinction and scattering, depth to the sun, light scattered once."""
    a = k * (DEGREE + 3) * LANES
    b = a + (DEGREE + 3) * LANES
    for c in range(DEGREE + 1):
        low, up = read_quadruple(nodes, a + c * LANES), read_quadruple(nodes, b + c * LANES)
        write(medium, (s * (DEGREE + 1) + c) * LANES, low + share * (up - low))
    low, up = read_quadruple(nodes, a), read_quadruple(nodes, b)
    # the way to the sun goes on through this cloud: its depth grows as the column's own does
    below = share * (low + (_HALF * share) * (up - low)) / (_HALF * (low + up) + np.float32(1e-12))
    low, up = read_quadruple(nodes, a + (DEGREE + 2) * LANES), read_quadruple(nodes, b + (DEGREE + 2) * LANES)
    depth = low + below * (up - low)
    write(sunlit, s * LANES, depth)
    low, up = read_quadruple(nodes, a + (DEGREE + 1) * LANES), read_quadruple(nodes, b + (DEGREE + 1) * LANES)
    write(source, s * LANES, (low + share * (up - low)) * transmission(depth))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _places(nodes, levels_m, parts, thick, node, below, medium, sunlit, light, source):
    """Every cell in its parts; ``light``: the mean beam in each. Returns the number of places."""
    nz = levels_m.shape[0]
    s = 0
    for k in range(nz - 1):
        for p in range(parts[k]):
            share = np.float32(p) / np.float32(parts[k])
            put(thick, s, np.float32((levels_m[k + 1] - levels_m[k]) / parts[k]))
            put(node, s, np.float32(k) + share)
            put(below, s, np.float32(k))
            _place_at(s, k, share, nodes, medium, sunlit, source)
            s += 1
    put(node, s, np.float32(nz - 1))
    put(below, s, np.float32(nz - 1))
    _place_at(s, nz - 2, _ONE, nodes, medium, sunlit, source)
    for p in range(s):
        low, up = read_quadruple(sunlit, p * LANES), read_quadruple(sunlit, (p + 1) * LANES)
        difference = choose_above(low, up, low - up, up - low)
        mean = choose_above(
            difference, np.float32(0.01), (_ONE - transmission(difference)) / difference, _ONE - _HALF * difference
        )
        write(light, p * LANES, mean * transmission(choose_above(low, up, up, low)))
    return s + 1


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _seen(w, count, j, i, levels_m, parts, thick, medium, source, slopes, fields):
    """Into the fields each node's source: its own, or in thick cells what makes the eye, which takes it as linear to
    the next node, see what the parts send up."""
    nz, ny, nx = fields.shape[:3]
    channels = fields.shape[3]
    last = 0
    for k in range(nz - 1):
        last += parts[k]
    shown = read_quadruple(source, last * LANES)
    for k in range(nz - 1, -1, -1):
        if k < nz - 1:
            first = last - parts[k]
            own = read_quadruple(source, first * LANES)
            if parts[k] == 1:
                shown = own
            else:
                slope = read_quadruple(slopes, k * LANES)
                slope = choose_above(slope, _ZERO, slope, _ZERO - slope)
                stretch = _ONE / choose_above(slope, np.float32(0.15), slope, np.float32(0.15))
                through, real = spread_quadruple(_ONE), spread_quadruple(_ZERO)
                near, far = spread_quadruple(_ZERO), spread_quadruple(_ZERO)
                part = _ONE / np.float32(parts[k])
                for p in range(parts[k] - 1, -1, -1):
                    s = first + p
                    length = stretch * flat(thick, s)
                    up, low = read_quadruple(medium, (s + 1) * (DEGREE + 1) * LANES), read_quadruple(
                        medium, s * (DEGREE + 1) * LANES
                    )
                    depth = _HALF * (up + low) * length
                    trans = transmission(depth)
                    real += through * step_emission(
                        depth, trans, length, read_quadruple(source, (s + 1) * LANES), read_quadruple(source, s * LANES),
                        up, low,
                    )  # fmt: skip
                    upper, lower = np.float32(p + 1) * part, np.float32(p) * part
                    near += through * step_emission(
                        depth, trans, length, spread_quadruple(upper), spread_quadruple(lower), up, low
                    )
                    far += through * step_emission(
                        depth, trans, length, spread_quadruple(_ONE - upper), spread_quadruple(_ONE - lower), up, low
                    )
                    through *= trans
                wanted = (real - near * shown) / (far + np.float32(1e-20))
                most, least = _MOST * own, _LEAST * own
                wanted = choose_above(wanted, most, most, wanted)
                wanted = choose_above(least, wanted, least, wanted)
                shown = choose_above(read_quadruple(slopes, k * LANES), _ZERO, wanted, own)
            last = first
        place = ((k * ny + j) * nx + i) * channels + PACK + w
        write(slopes, nz * LANES, shown)
        for n in range(LANES):
            value = flat(slopes, nz * LANES + n)
            put(fields, place + n * channels, value)
            for other in range(w + 1, PACK if w == count - 1 else w + 1):
                put(fields, place + n * channels + other - w, value)


@njit(cache=True, error_model="numpy", nogil=True, fastmath=_FLAGS)
def column_light(
    t, threads, extinction, scaled, scattering, air_extinction, air_scattering, levels_m, ground_node, sun, mu_sun,
    albedo, direct, inflow, tables, columns, eye, parallel, count, fields, down, up,
):  # fmt: skip
    """Light of every column by itself, and the smooth source toward one eye at its nodes, into fields[..., PACK:2 PACK].

    At the first ``count`` wavelengths delta-scaled extinction and moments of scattering per extinction (ns, nz, ny, nx)
    of the species, ``scaled`` (count, ns) and ``scattering`` (count, ns, DEGREE), those of the air (count, nz) and
    (count, nz, DEGREE), 1/m; ``ground_node`` (ny, nx) lowest level not under the ground, ``sun`` (ny, 3, nx) in the
    columns' axes; ``albedo`` and the beam's flux ``direct`` at the ground (count, ny, nx), the light from above the grid
    ``inflow`` (count, suns, 2) as `top_light` makes it; fields[..., :count] holds depths to the sun. ``down``, ``up``
    (count, ny, nx): diffuse flux at the ground, flux at the top. nx >= LANES. See `eye_source.view_source`.
    """
    ns, nz, ny, nx = extinction.shape
    most = nz * MOST_PARTS + 1
    f32 = np.float32
    nodes = np.empty(nz * (DEGREE + 3) * LANES, f32)
    medium = np.empty(most * (DEGREE + 1) * LANES, f32)
    sunlit, light, source = np.empty(most * LANES, f32), np.empty(most * LANES, f32), np.empty(most * LANES, f32)
    thick, node, below = np.empty(most, f32), np.empty(most, f32), np.empty(most, f32)
    rows, start = np.empty(most * 6 * LANES, f32), np.empty(6 * LANES, f32)
    looks, phases = np.empty(nz * MODES * _ORDERS * LANES, f32), np.empty(nz * DEGREE * LANES, f32)
    slopes, lit = np.empty((nz + 1) * LANES, f32), np.empty(MODES * _ORDERS * LANES, f32)
    ground, above, flux = np.empty(3 * LANES, f32), np.empty(2 * LANES, f32), np.zeros(2 * LANES, f32)
    parts = np.empty(nz, np.int64)
    for j in range(t, ny, threads):
        for block in range((nx + LANES - 1) // LANES):
            i = min(block * LANES, nx - LANES)
            _looks(j, i, levels_m, columns, sun, eye, parallel, looks, phases, slopes)
            for m in range(MODES):
                _direction(m, _ZERO - read_quadruple(sun, (j * 3 + 2) * nx + i), m * _ORDERS * LANES, lit)
            least = nz
            for n in range(LANES):
                put(ground, n, f32(ground_node[j, i + n]))
                least = min(least, ground_node[j, i + n])
            for w in range(count):
                _nodes(w, j, i, extinction, scaled, scattering, air_extinction, air_scattering, phases, fields, nodes)
                if w == 0:
                    _count_parts(nodes, levels_m, parts)
                places = _places(nodes, levels_m, parts, thick, node, below, medium, sunlit, light, source)
                first = 0
                for k in range(min(least, nz - 1)):
                    first += parts[k]
                for n in range(LANES):
                    put(ground, LANES + n, albedo[w, j, i + n])
                    put(ground, 2 * LANES + n, direct[w, j, i + n])
                    at = 0.5 * (inflow.shape[1] - 1) * (1.0 + mu_sun[j, i + n])
                    at = min(max(at, 0.0), inflow.shape[1] - 1.0)
                    m = min(int(at), inflow.shape[1] - 2)
                    for c in range(2):
                        put(above, c * LANES + n, f32(inflow[w, m, c] + (at - m) * (inflow[w, m + 1, c] - inflow[w, m, c])))
                for m in range(MODES):
                    _ground_start(m, tables, ground, start)
                    if m > 0:
                        write(start, 4 * LANES, spread_quadruple(_ZERO))
                        write(start, 5 * LANES, spread_quadruple(_ZERO))
                    _eliminate(m, places, tables, thick, medium, light, lit, first, node, ground, start, rows)
                    _back(
                        m, places, tables, thick, medium, light, lit, first, node, below, ground, above, rows, looks,
                        source, flux,
                    )  # fmt: skip
                for n in range(LANES):
                    down[w, j, i + n], up[w, j, i + n] = flux[n], flux[LANES + n]
                _seen(w, count, j, i, levels_m, parts, thick, medium, source, slopes, fields)


@dataclass
class Columns:
    """The light of a grid's columns: all that `column_light` asks for but the eye, and where it writes fluxes."""

    medium: Medium
    coefficients: list[Coefficients]
    ground_node: NDArray[np.int64]
    local_sun: F64
    mu_sun: F64
    albedo: F32
    direct: F32
    inflow: F32
    down: F32
    up: F32
    count: int

    def aim(self, fields: F32, eye: F64, parallel: bool) -> None:
        """Fill the source channels for one eye."""
        m, some = self.medium, self.coefficients[: self.count]
        in_threads(
            column_light, m.extinction, np.stack([c.scaled for c in some]), np.stack([c.scattering for c in some]),
            np.stack([c.air_extinction for c in some]), np.stack([c.air_scattering for c in some]), m.levels_m,
            self.ground_node, np.ascontiguousarray(np.moveaxis(self.local_sun, -1, 1), np.float32), self.mu_sun,
            self.albedo, self.direct, self.inflow, mode_tables(), columns_of(m.axes, m.place, eye, parallel), eye,
            parallel, self.count, fields, self.down, self.up,
        )  # fmt: skip


def top_light(shells: Any, top_m: float, count: int) -> F32:
    """What the clear air above ``top_m`` sends down, for cosines of the sun's zenith angle from -1 to 1 (count, suns,
    2): its half-range integrals with P1 and P3."""
    x, weight = np.polynomial.legendre.leggauss(6)
    mu, weight = (x + 1) / 2, weight / 2
    azimuth = (np.arange(8) + 0.5) * np.pi / 8
    suns = np.linspace(-1, 1, _COLUMN_SUNS)
    z, phi = (a.ravel() for a in np.meshgrid(mu, azimuth, indexing="ij"))
    direction = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=-1)
    origin = np.tile([0.0, 0.0, max(top_m, shells.ground_m + 1.0)], (len(z), 1))
    tests = harmonics_of_mode(mu, 0)[[1, 3]] * weight
    out = np.zeros((count, _COLUMN_SUNS, 2), np.float32)
    for n, cosine in enumerate(suns):
        sun = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
        radiance = clear_radiance(origin, direction, sun, shells, 1.0)[:, :count].reshape(mu.size, azimuth.size, count)
        out[:, n] = (tests @ radiance.mean(axis=1)).T
    return out
