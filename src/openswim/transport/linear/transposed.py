"""The transpose of a sweep: from the bars of what an ordinate carries to those of what it is given.

It goes through the grid as `sweep.carry` does, backwards, and does at every node the transpose of what is done there.
"""

from typing import NamedTuple

import numpy as np

from openswim.transport.engine.compiled import CONTRACTED, kernel, part
from openswim.transport.engine.lanes import LANES, read, write
from openswim.transport.linear.cell import amendment, step_slopes, trusted
from openswim.transport.linear.course import (
    add,
    between,
    course_of,
    highest_of,
    pair_at,
    pairs_of,
    set_out,
    step_of,
    within,
)
from openswim.transport.linear.sweep import weigh_row


class Bars(NamedTuple):
    """Of what `carry` makes, light (b, nodes), used up, and more (b, nodes); and, filled from them, of what it is
    given: emission (b, nodes) and ground (b, columns)."""

    light: np.ndarray
    more: np.ndarray
    emission: np.ndarray
    ground: np.ndarray


class Lit(NamedTuple):
    """Of `carry` what it was given and made, (b, nodes), and bars of the extinction (b, nodes), to be filled."""

    emission: np.ndarray
    light: np.ndarray
    ext_bar: np.ndarray


@part(CONTRACTED, inlined=True)
def _ask_some(p, at, i, some, ext, step, own, mb, rows):
    """What the amendments of steps are asked for, over what they are divided by."""
    more = read(mb, p, some) + between(mb, p, step, some)
    write(rows[0], LANES + i, more * read(own, 3 * own.shape[1] + at, some), some)


@part(CONTRACTED, inlined=True)
def _first_some(p, at, i, some, ext, step, own, rows):
    """What amendments ask of the light at first corners, directly and by that at the nodes."""
    share, to, ds = step
    rate = 2.0 / ds
    by_node = read(own, at, some) * (rate + read(ext, p, some))
    more = share[0] * read(rows[0], LANES + i, some)
    write(rows[3], LANES + i, more * (rate - by_node - read(ext, p + to[0], some)), some)


@part(CONTRACTED, inlined=True)
def _back_some(p, at, i, some, ext, step, own, bars, rows, of):
    """From the bars of light at nodes those of their sources and, where ``of`` is given, of their extinction; into
    ``rows`` what comes to corners by their light, sources and extinction."""
    share, to, ds = step
    lb, _, eb = bars
    asked, to_light, to_source, to_ext = rows
    width, rate, place = own.shape[1], 2.0 / ds, LANES + i
    more, near = read(asked, place, some), read(ext, p, some)
    bar = read(lb, p, some) - (rate + near) * more
    add(eb, p, read(own, width + at, some) * bar + more, some)
    write(to_source, place, read(own, 2 * width + at, some) * bar + more, some)
    write(to_light, place, read(own, at, some) * bar + rate * more, some)
    if of is None:
        return
    e, out, xb = of
    a, b, c, d = (
        read(out, p + to[0], some), read(out, p + to[1], some), read(out, p + to[2], some), read(out, p + to[3], some),
    )  # fmt: skip
    x0, x1, x2, x3 = (
        share[0] * read(ext, p + to[0], some), share[1] * read(ext, p + to[1], some),
        share[2] * read(ext, p + to[2], some), share[3] * read(ext, p + to[3], some),
    )  # fmt: skip
    up, far = (share[0] * a + share[1] * b) + (share[2] * c + share[3] * d), (x0 + x1) + (x2 + x3)
    here, source, e_up = read(out, p, some), read(e, p, some), between(e, p, step, some)
    told = (x0 * a + x1 * b) + (x2 * c + x3 * d)
    taken = amendment(here, up, source, e_up, near, told, trusted(near, far, ds), ds)
    t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(near, far, ds)
    add(xb, p, (t_n * up + n_n * source + f_n * e_up) * bar - (here + taken) * more, some)
    write(to_ext, place, (t_f * up + n_f * source + f_f * e_up) * bar - taken * more, some)


@part(CONTRACTED, inlined=True)
def _give_some(q, i, some, ext, pair, with_light, bars, rows, of):
    """What comes to corners from q on of a row of steps."""
    lb, _, eb = bars
    asked, to_light, to_source, to_ext = rows
    place = LANES + i
    more = pair_at(asked, place, some, pair)
    add(eb, q, pair_at(to_source, place, some, pair), some)
    if with_light:
        add(lb, q, pair_at(to_light, place, some, pair) - read(ext, q, some) * more, some)
    if of is not None:
        _, out, xb = of
        add(xb, q, pair_at(to_ext, place, some, pair) - read(out, q, some) * more, some)


@part(CONTRACTED)
def _give(q, i, count, ext, pair, with_light, bars, rows, of):
    for s in range(0, count - LANES + 1, LANES):
        _give_some(q + s, i + s, None, ext, pair, with_light, bars, rows, of)
    s = count % LANES
    if s:
        _give_some(q + count - s, i + count - s, s, ext, pair, with_light, bars, rows, of)


@part(CONTRACTED)
def _give_corners(p, i, count, beside, ext, step, bars, rows, of):
    share, to, _ = step
    for c in range(4):
        if share[c] > 0.0:
            _give(p + to[c], i, count, ext, (share[c], 0.0, np.int64(0)), not beside or c > 0, bars, rows, of)


@part(CONTRACTED)
def _back_row(line, at, first, count, turn, beside, ext, step, own, bars, rows, of):
    """Transpose of `_carry_row`; turn: against the light."""
    p, rest = line + first, count % LANES
    for s in range(0, count - LANES + 1, LANES):
        _ask_some(p + s, at + s, first + s, None, ext, step, own, bars[1], rows)
        if beside:
            _first_some(p + s, at + s, first + s, None, ext, step, own, rows)
    if rest:
        s = count - rest
        _ask_some(p + s, at + s, first + s, rest, ext, step, own, bars[1], rows)
        if beside:
            _first_some(p + s, at + s, first + s, rest, ext, step, own, rows)
    if beside:
        lb, share, to, s = bars[0], step[0][0], step[1][0], 0 if turn > 0 else count - 1
        bar, to_first = np.float64(lb[p + s]), rows[3]
        for _ in range(count):
            bar = lb[p + s + to] + (share * own[0, at + s] * bar + to_first[LANES + first + s])
            lb[p + s + to] = bar
            s += turn
    for s in range(0, count - LANES + 1, LANES):
        _back_some(p + s, at + s, first + s, None, ext, step, own, bars, rows, of)
    if rest:
        s = count - rest
        _back_some(p + s, at + s, first + s, rest, ext, step, own, bars, rows, of)
    one, two = pairs_of(step)
    if one[2] == 0:
        _give_corners(p, first, count, beside, ext, step, bars, rows, of)
    else:
        nx, to, begin, with_light = rows[0].shape[0] - 2 * LANES, step[1], np.int64(0), np.bool_(True)
        _give(line + to[0], begin, nx, ext, one, with_light, bars, rows, of)
        if two[0] + two[1] > 0.0:
            _give(line + to[2], begin, nx, ext, two, with_light, bars, rows, of)


@kernel(CONTRACTED)
def carry_transposed(t, threads, grid, directions, ext, steps, bars, lit):
    """Transpose of `carry` by emission and ground, and, where ``lit`` is given, by extinction; ``steps`` as there."""
    shape, _, _, ground_node = grid
    course = course_of(grid)
    way, entry = course.way, course.entry
    light_bar, more_bar, emission_bar, ground_bar = bars
    scratch_rows = np.zeros((4, shape[2] + 2 * LANES), ext.dtype)
    rows, single = (scratch_rows[0], scratch_rows[1], scratch_rows[2], scratch_rows[3]), np.int64(1)
    kept, scratch, highest = steps.shape[0] > 0, np.zeros((4, shape[2]), ext.dtype), highest_of(ground_node)
    for n in range(t, directions.shape[0], threads):
        q, lb, mb, eb = directions[n], light_bar[n], more_bar[n], emission_bar[n]
        own, own_bars = steps[n] if kept else scratch, (lb, mb, eb)
        of = None if lit is None else (lit.emission[n], lit.light[n], lit.ext_bar[n])
        set_out(q, grid, course, True)
        ny, nx, rising, turn = shape[1], shape[2], q[2] < 0.0, way[2, 2]
        first, count = within(entry, nx)
        ground_bar[n] = 0.0
        scratch_rows[:] = 0.0
        if lit is not None:
            lit.ext_bar[n] = 0.0
        for node in range(ext.shape[0]):
            eb[node] = 0.0
        for k in range(way[0, 0], way[0, 1], way[0, 2]):
            step, beside = step_of(course, k)
            for j in range(way[1, 0], way[1, 1], way[1, 2]):
                row, line = k == entry[0] or j == entry[1], (k * ny + j) * nx
                at = line if kept else 0
                if not (kept or row):
                    weigh_row(line + first, first, count, ext, step, own)
                if rising and k <= highest[j]:
                    for i in range(way[2, 0], way[2, 1], way[2, 2]):
                        if k <= ground_node[j, i]:
                            ground_bar[n, j * nx + i] += lb[line + i]
                        elif not (row or i == entry[2]):
                            _ask_some(line + i, at + i, i, single, ext, step, own, mb, rows)
                            _back_some(line + i, at + i, i, single, ext, step, own, own_bars, rows, of)
                            _give_corners(line + i, i, single, np.bool_(False), ext, step, own_bars, rows, of)
                elif not row:
                    _back_row(line, at + first, first, count, turn, beside, ext, step, own, own_bars, rows, of)
