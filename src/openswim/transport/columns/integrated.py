"""The light of columns, integrated along slanted ways from what P3's moments scatter, and scattered once more.

Four harmonics do not hold light that runs level through thin layers, which is most of what haze scatters more than
once. Integrated over its source it is nearly right (the source function technique, Kourganoff 1952), and has all modes
and degrees that scattering knows, not P3's alone. LANES columns at a time. docs/decisions/0016-wide-cells.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.columns.spherical_harmonics import LOOKS, MODES, ORDERS, harmonics_of_mode
from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import LANES, choose_above, flat, read_quadruple, spread_quadruple, write
from openswim.transport.engine.scalar import transmission
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import DEGREE

F32 = NDArray[np.float32]

WAYS = 5  # zenith angles of the ways, up and as many down
_ZERO, _HALF, _ONE, _FOUR = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0), FLOAT(4.0)


def _tables() -> tuple[F32, F32, F32]:
    """Of the ways (WAYS,) the cosines; half their weights times harmonics (LOOKS, LOOKS, WAYS); half 2l+1 times
    harmonics (LOOKS, WAYS, LOOKS)."""
    x, weight = np.polynomial.legendre.leggauss(WAYS)
    mu, weight = (x + 1) / 2, weight / 2
    harmonics = np.array([(harmonics_of_mode(mu, m, LOOKS) * np.sqrt(1 - mu**2) ** m).T for m in range(LOOKS)])
    degrees = 2 * (np.arange(LOOKS)[:, None, None] + np.arange(LOOKS)) + 1
    return (
        mu.astype(FLOAT), (0.5 * weight[:, None] * harmonics).transpose(0, 2, 1).astype(FLOAT, "C"),
        (0.5 * degrees * harmonics).astype(FLOAT),
    )  # fmt: skip


_COSINE, _TAKEN, _SENT = _tables()


@part(FINITE)
def pass_parts(first, count, places, ends, passed):
    """Of every part (count, WAYS, 2) its transmission along the ways, and the length that its source counts for. Under
    the ground light stays as it is."""
    level = read_quadruple(ends.ground, 0)
    for s in range(first, count - 1):
        a = s * (DEGREE + 1) * LANES
        extinction = read_quadruple(places.medium, a) + read_quadruple(places.medium, a + (DEGREE + 1) * LANES)
        here, thick = spread_quadruple(flat(places.level, s)), spread_quadruple(flat(places.thick_m, s))
        thick = choose_above(level, here, spread_quadruple(_ZERO), thick)
        for i in range(WAYS):
            length = thick / flat(_COSINE, i)
            depth = (_HALF * length) * extinction
            through = transmission(depth)
            mean = choose_above(depth, FLOAT(0.01), (_ONE - through) / depth, _ONE - _HALF * depth)
            n = (s * WAYS + i) * 2 * LANES
            write(passed, n, through)
            write(passed, n + LANES, length * mean)


@part(FINITE)
def scatter_integrated(m, first, count, places, lit, ends, moments, passed, looks, ways, work):
    """Into `Places.source` and `Places.bend` what mode m of the integrated light scatters toward the eye.

    ``moments`` (place, 6, LANES): P3's, of which the ways' source is, from degree m on; ``passed``: see `pass_parts`;
    ``looks`` (nz, LOOKS, LOOKS, LANES): weights of moments in what the eye sees. ``ways`` (place, WAYS, 2, LANES) and
    ``work`` (2 WAYS + LOOKS, LANES) are scratch.
    """
    medium, source, bend = places.medium, places.source, places.bend
    known, held = DEGREE - m, ORDERS if m < MODES else 0
    y, row = m * LOOKS * LANES, (DEGREE + 1) * LANES
    turned, kept = WAYS * LANES, 2 * WAYS * LANES
    ground = top = slope = spread_quadruple(_ZERO)
    if m == 0:
        arrives = read_quadruple(ends.flux, 0) + read_quadruple(ends.ground, 2 * LANES)
        ground = (_FOUR * read_quadruple(ends.ground, LANES)) * arrives
        # what comes in at the top, linear in the cosine, by its integrals with P1 and P3
        top = FLOAT(-8.0) * read_quadruple(ends.above, LANES)
        slope = FLOAT(3.0) * (read_quadruple(ends.above, 0) - _HALF * top)
    for i in range(WAYS):
        write(work, i * LANES, ground)
        write(ways, (first * WAYS + i) * 2 * LANES, ground)
    for s in range(first, count - 1):
        a = s * row + (1 + m) * LANES
        beam = read_quadruple(places.beam, s * LANES)
        for c in range(known):
            low, up = read_quadruple(medium, a + c * LANES), read_quadruple(medium, a + row + c * LANES)
            sent = (low + up) * (beam * read_quadruple(lit, y + c * LANES))
            if c < held:
                k = (s * 6 + c) * LANES
                sent += low * read_quadruple(moments, k) + up * read_quadruple(moments, k + 6 * LANES)
            write(work, kept + c * LANES, sent)
        for i in range(WAYS):
            even, odd = spread_quadruple(_ZERO), spread_quadruple(_ZERO)
            n = (m * WAYS + i) * LOOKS
            for c in range(0, known, 2):
                even += flat(_SENT, n + c) * read_quadruple(work, kept + c * LANES)
            for c in range(1, known, 2):
                odd += flat(_SENT, n + c) * read_quadruple(work, kept + c * LANES)
            p = (s * WAYS + i) * 2 * LANES
            length = read_quadruple(passed, p + LANES)
            light = read_quadruple(work, i * LANES) * read_quadruple(passed, p) + (even + odd) * length
            write(ways, p + LANES, (even - odd) * length)
            write(work, i * LANES, light)
            write(ways, p + 2 * WAYS * LANES, light)
    for i in range(WAYS):
        light = top + flat(_COSINE, i) * slope
        write(work, i * LANES, choose_above(light, _ZERO, light, spread_quadruple(_ZERO)))
    for c in range(known):
        write(work, kept + c * LANES, spread_quadruple(_ZERO))
    for s in range(count - 1, first - 1, -1):
        for i in range(WAYS):
            p = (s * WAYS + i) * 2 * LANES
            down = read_quadruple(work, i * LANES)
            if s < count - 1:
                down = down * read_quadruple(passed, p) + read_quadruple(ways, p + LANES)
                write(work, i * LANES, down)
            up = read_quadruple(ways, p)
            write(ways, p, up + down)
            write(work, turned + i * LANES, up - down)
        a = s * row + (1 + m) * LANES
        eye = (int(flat(places.below, s)) * LOOKS + m) * LOOKS * LANES
        total, bent = read_quadruple(source, s * LANES), read_quadruple(bend, s * LANES)
        for c in range(known):
            light = spread_quadruple(_ZERO)
            n = (m * LOOKS + c) * WAYS
            if c % 2 == 0:
                for i in range(WAYS):
                    light += flat(_TAKEN, n + i) * read_quadruple(ways, (s * WAYS + i) * 2 * LANES)
            else:
                for i in range(WAYS):
                    light += flat(_TAKEN, n + i) * read_quadruple(work, turned + i * LANES)
            seen, here = read_quadruple(looks, eye + c * LANES), read_quadruple(medium, a + c * LANES)
            total += seen * here * light
            if s < count - 1:
                more = read_quadruple(medium, a + row + c * LANES) - here
                bent += seen * more * (light - read_quadruple(work, kept + c * LANES))
            write(work, kept + c * LANES, light)
        write(source, s * LANES, total)
        write(bend, s * LANES, bent)
