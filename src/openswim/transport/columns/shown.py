"""What a march is to see of columns: sources at their nodes that send what the cells between them really do."""

from __future__ import annotations

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import (
    LANES,
    PACK,
    choose_above,
    flat,
    put,
    read_quadruple,
    spread_quadruple,
    write,
)
from openswim.transport.engine.scalar import transmission
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import DEGREE

_MOST, _LEAST = FLOAT(4.0), FLOAT(0.25)  # of a cell's light if its source were linear, that it may send
_FLATTEST = FLOAT(0.15)  # cosine of the way to the eye, by which that is told
_ZERO, _QUARTER, _HALF, _ONE, _TWO = FLOAT(0.0), FLOAT(0.25), FLOAT(0.5), FLOAT(1.0), FLOAT(2.0)


@part(FINITE)
def _read_as_linear(above, first, count, steep, places, read):
    """Of a cell of ``count`` parts from place ``first`` on, as an eye ``above`` or below sees it along a way that is
    ``steep`` (|cosine|): what passes it, what of a source linear in it is that of the near node and of the far one, and
    by what share light is more than it would be with a source linear between the nodes; into ``read`` (4, LANES)."""
    medium, source, bend = places.medium, places.source, places.bend
    row = (DEGREE + 1) * LANES
    through, real = spread_quadruple(_ONE), spread_quadruple(_ZERO)
    near, far = spread_quadruple(_ZERO), spread_quadruple(_ZERO)
    share = _ONE / FLOAT(2 * count)
    for step in range(2 * count):
        half = 2 * count - 1 - step if above else step  # of parts, from below
        s = first + half // 2
        low, up = read_quadruple(medium, s * row), read_quadruple(medium, (s + 1) * row)
        low_source, up_source = read_quadruple(source, s * LANES), read_quadruple(source, (s + 1) * LANES)
        middle = _HALF * (low + up)
        middle_source = _HALF * (low_source + up_source) + _QUARTER * read_quadruple(bend, s * LANES)
        if half % 2 == 0:
            up, up_source = middle, middle_source
        else:
            low, low_source = middle, middle_source
        length = _HALF * flat(places.thick_m, s) / steep
        depth = _HALF * (low + up) * length
        trans = transmission(depth)
        mean = choose_above(depth, FLOAT(0.01), (_ONE - trans) / depth, _ONE - _HALF * depth)
        seen = through * mean * length
        slope = length / (FLOAT(12.0) + _TWO * depth)  # see `step_emission`
        if above:
            from_low, from_up = seen * (_HALF - up * slope), seen * (_HALF + low * slope)
        else:
            from_low, from_up = seen * (_HALF + up * slope), seen * (_HALF - low * slope)
        real += from_low * low_source + from_up * up_source
        nearer, farther = FLOAT(step) * share, FLOAT(step + 1) * share
        at_low, at_up = nearer, farther
        if above:
            at_low, at_up = farther, nearer
        rest = from_low * at_low + from_up * at_up
        far += rest
        near += from_low + from_up - rest
        through *= trans
    own, other = read_quadruple(source, first * LANES), read_quadruple(source, (first + count) * LANES)
    linear = near * own + far * other
    if above:
        linear = near * other + far * own
    more = real / (linear + FLOAT(1e-20)) - _ONE
    more = choose_above(more, _MOST - _ONE, spread_quadruple(_MOST - _ONE), more)
    more = choose_above(_LEAST - _ONE, more, spread_quadruple(_LEAST - _ONE), more)
    write(read, 0, through)
    write(read, LANES, near)
    write(read, 2 * LANES, far)
    write(read, 3 * LANES, more)


@part(FINITE)
def show_cells(above, parts, places, slopes, read, shown):
    """Into ``shown`` (nz, LANES) the nodes' sources for those of LANES eyes that are ``above`` or below what they see.

    A march takes the source as linear between nodes. What that lacks in a cell, thick ones most, the nodes at both its
    ends are given, each the mean share of its two cells by how much the eye sees of it in them.
    """
    nz = parts.shape[0]
    last = 0
    for k in range(nz - 1):
        last += parts[k]
    place = 0 if above else last
    weight, share = spread_quadruple(_ZERO), spread_quadruple(_ZERO)  # the cell's behind
    for n in range(nz):  # from the farthest node on
        k = n if above else nz - 1 - n
        own, slope = read_quadruple(places.source, place * LANES), read_quadruple(slopes, k * LANES)
        lack = share
        if n < nz - 1:
            steep = choose_above(slope, _ZERO, slope, _ZERO - slope)
            steep = choose_above(steep, _FLATTEST, steep, spread_quadruple(_FLATTEST))
            count = parts[k] if above else parts[k - 1]
            _read_as_linear(above, place if above else place - count, count, steep, places, read)
            place += count if above else -count
            behind, far = read_quadruple(read, 0) * weight, read_quadruple(read, 2 * LANES)
            weight, share = read_quadruple(read, LANES), read_quadruple(read, 3 * LANES)
            lack = (behind * lack + far * share) / (behind + far + FLOAT(1e-20))
        value, before = own * (_ONE + lack), read_quadruple(shown, k * LANES)
        if above:
            write(shown, k * LANES, choose_above(slope, _ZERO, value, before))
        else:
            write(shown, k * LANES, choose_above(slope, _ZERO, before, value))


@part(FINITE)
def fill_sources(w, count, j, i, missing, shown, fields):
    """What the eye is shown of LANES columns, and what their air lacks, into the fields; beyond the last wavelength
    its own again."""
    nz, ny, nx = fields.shape[:3]
    channels = fields.shape[3]
    for k in range(nz):
        place = ((k * ny + j) * nx + i) * channels + PACK + w
        for n in range(LANES):
            value = flat(shown, k * LANES + n) + flat(missing, k * LANES + n)
            put(fields, place + n * channels, value)
            for other in range(w + 1, PACK if w == count - 1 else w + 1):
                put(fields, place + n * channels + other - w, value)
