"""One column's diffuse light in spherical harmonics: even moments by odd ones from the ground up, then back down.

P3: four degrees in each Fourier mode about the sun's azimuth (Chandrasekhar 1960), Marshak's conditions at the ground
and at the top, and between places the box scheme. LANES columns at a time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import LANES, choose_above, flat, read_quadruple, spread_quadruple, write
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import DEGREE

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MODES, ORDERS = 3, 4  # Fourier modes; degrees in each, from the mode's own on
LOOKS = DEGREE  # modes, and degrees in each, of ways to the eye and to the sun: all that scattering knows
_ZERO, _HALF, _ONE, _TWO = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0), FLOAT(2.0)


class Places(NamedTuple):
    """Places along LANES columns from the lowest level up, the parts of cells between them."""

    thick_m: F32  # (most,) of the part above each
    level: F32  # (most,) fractional
    below: F32  # (most,) the level that is not above it
    medium: F32  # (most, DEGREE + 1, LANES) delta-scaled extinction and Legendre moments of scattering, 1/m
    sunlit: F32  # (most, LANES) depth to the sun
    beam: F32  # (most, LANES) mean beam in the part above
    source: F32  # (most, LANES) what is scattered toward the eye, 1/m
    bend: F32  # (most, LANES) four times what it has more in the middle of the part above than the mean of its ends


class Ends(NamedTuple):
    """What is at both ends of LANES columns."""

    ground: F32  # (3, LANES) level, albedo, the beam's flux
    start: F32  # (6, LANES) R and q there, see `eliminate`
    above: F32  # (2, LANES) the half-range integrals of what comes in at the top
    flux: F32  # (2, LANES) found: down at the ground, diffuse; up at the top


# Rows of `mode_tables`
_C1, _C2, _C3, _HO, _HE, _FIRST, _UP_EVEN, _UP_ODD, _TABLE = 0, 1, 2, 3, 7, 11, 13, 15, 17


def _first(m: int) -> float:
    """sqrt(1/(2m)!) P_mm / sin^m, without its sign."""
    return float(np.prod(np.sqrt((2 * np.arange(m) + 1) / (2 * np.arange(m) + 2))))


def harmonics_of_mode(mu: F64, m: int, orders: int = ORDERS) -> F64:
    """sqrt((l-m)!/(l+m)!) P_lm(mu) / sin^m, l = m ... m + orders - 1: (orders, n)."""
    before, this = np.zeros_like(mu), np.full_like(mu, _first(m))
    out = []
    for ell in range(m, m + orders):
        out.append(this)
        following = (2 * ell + 1) * mu * this - np.sqrt(ell**2 - m**2) * before
        before, this = this, following / np.sqrt((ell + 1) ** 2 - m**2)
    return np.array(out)


def mode_tables() -> F32:
    """Of every mode (MODES, _TABLE) what streaming couples, and what Marshak's conditions ask of odd harmonics."""
    x, w = np.polynomial.legendre.leggauss(16)
    x, w = (x + 1) / 2, w / 2
    out = np.zeros((MODES, _TABLE), FLOAT)
    for m in range(MODES):
        y = harmonics_of_mode(x, m) * np.sqrt(1 - x**2) ** m
        ell = np.arange(m, m + ORDERS)
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
    m, ell = np.arange(LOOKS)[:, None], np.arange(LOOKS)[:, None] + np.arange(LOOKS)
    root_of_next = np.sqrt((ell + 1) ** 2 - m**2)
    first = np.array([_first(n) for n in range(LOOKS)])
    up, down = (2 * ell + 1) / root_of_next, np.sqrt(ell**2 - m**2) / root_of_next
    return up.astype(FLOAT), down.astype(FLOAT), first.astype(FLOAT)


_UP, _BACK, _BEGIN = _recurrence()


@part(FINITE)
def direction(m, mu, n, out):
    """`harmonics_of_mode` of LANES cosines into out[n:], those that scattering knows."""
    p0, p1 = spread_quadruple(_ZERO), spread_quadruple(_BEGIN[m])
    for i in range(LOOKS - m):
        write(out, n + i * LANES, p1)
        up = _UP[m, i] * (mu * p1) - _BACK[m, i] * p0
        p0, p1 = p1, up


@part(FINITE)
def ground_start(m, table, ground, start):
    """R and q on the ground; ``ground``: its level, albedo, and the beam's flux on it."""
    t = m * _TABLE
    h00, h01 = flat(table, t + _HO), flat(table, t + _HO + 1)
    h10, h11 = flat(table, t + _HO + 2), flat(table, t + _HO + 3)
    e00, e01 = flat(table, t + _HE), flat(table, t + _HE + 1)
    e10, e11 = flat(table, t + _HE + 2), flat(table, t + _HE + 3)
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


@part(FINITE)
def eliminate(m, first, count, table, places, lit, ends, rows):
    """From the ground up the odd moments o by the even ones e, ``rows`` (place, 6, LANES): o = R e + q.

    In a part of thickness h the box scheme takes moments as the mean of those at its ends and their slopes as the
    difference over h: with C what streaming couples (`mode_tables`), A_e, A_o = (2l+1)(beta' - sigma_l) h/2 and the
    beam's s_e, s_o,

        C (e' - e) + A_o (o' + o) = s_o,    C^T (o' - o) + A_e (e' + e) = s_e;

    R and q below give those above. ``lit`` (LOOKS, LOOKS, LANES): harmonics toward the sun.
    """
    thick, node, light, medium, start = places.thick_m, places.level, places.beam, places.medium, ends.start
    t = m * _TABLE
    c1, c2, c3 = flat(table, t + _C1), flat(table, t + _C2), flat(table, t + _C3)
    r00, r01 = read_quadruple(start, 0), read_quadruple(start, LANES)
    r10, r11 = read_quadruple(start, 2 * LANES), read_quadruple(start, 3 * LANES)
    q0, q1 = read_quadruple(start, 4 * LANES), read_quadruple(start, 5 * LANES)
    low = read_quadruple(ends.ground, 0)
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
            w0, w1 = FLOAT(2 * m + 1), FLOAT(2 * m + 3)
            w2, w3 = FLOAT(2 * m + 5), FLOAT(2 * m + 7)
            ae0, ao0 = w0 * (ext - half * s0), w1 * (ext - half * s1)
            ae1, ao1 = w2 * (ext - half * s2), w3 * (ext - half * s3)
            y = m * LOOKS * LANES
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


@part(FINITE)
def back(m, first, count, table, places, lit, ends, rows):
    """From the top down the moments, where Marshak's conditions with `Ends.above` and o = R e + q give e. They are left
    in ``rows`` (place, 6, LANES), four of each; the first mode fills in `Ends.flux`."""
    thick, node, light, medium = places.thick_m, places.level, places.beam, places.medium
    flux = ends.flux
    t = m * _TABLE
    c1, c2, c3 = flat(table, t + _C1), flat(table, t + _C2), flat(table, t + _C3)
    h00, h01 = flat(table, t + _HO), flat(table, t + _HO + 1)
    h10, h11 = flat(table, t + _HO + 2), flat(table, t + _HO + 3)
    d00, d01 = flat(table, t + _HE), flat(table, t + _HE + 1)
    d10, d11 = flat(table, t + _HE + 2), flat(table, t + _HE + 3)
    k = (count - 1) * 6 * LANES
    r00, r01 = read_quadruple(rows, k), read_quadruple(rows, k + LANES)
    r10, r11 = read_quadruple(rows, k + 2 * LANES), read_quadruple(rows, k + 3 * LANES)
    q0, q1 = read_quadruple(rows, k + 4 * LANES), read_quadruple(rows, k + 5 * LANES)
    a00, a01 = d00 - (h00 * r00 + h01 * r10), d01 - (h00 * r01 + h01 * r11)
    a10, a11 = d10 - (h10 * r00 + h11 * r10), d11 - (h10 * r01 + h11 * r11)
    b0, b1 = h00 * q0 + h01 * q1, h10 * q0 + h11 * q1
    if m == 0:
        b0 += read_quadruple(ends.above, 0)
        b1 += read_quadruple(ends.above, LANES)
    det = _ONE / (a00 * a11 - a01 * a10)
    e0, e1 = (a11 * b0 - a01 * b1) * det, (a00 * b1 - a10 * b0) * det
    o0, o1 = r00 * e0 + r01 * e1 + q0, r10 * e0 + r11 * e1 + q1
    ve0, ve1 = flat(table, t + _UP_EVEN), flat(table, t + _UP_EVEN + 1)
    vo0, vo1 = flat(table, t + _UP_ODD), flat(table, t + _UP_ODD + 1)
    low = read_quadruple(ends.ground, 0)
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
            w1, w3 = FLOAT(2 * m + 3), FLOAT(2 * m + 7)
            ao0, ao1 = w1 * (ext - half * s1), w3 * (ext - half * s3)
            y = m * LOOKS * LANES
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
            write(flux, 0, choose_above(low - FLOAT(0.01), here, read_quadruple(flux, 0), down))
        k = s * 6 * LANES
        write(rows, k, e0)
        write(rows, k + LANES, o0)
        write(rows, k + 2 * LANES, e1)
        write(rows, k + 3 * LANES, o1)
