"""One row of nodes of a sweep: light carried from the upstream points to the nodes, LANES of them at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from openswim.transport.engine.compiled import REORDERED, part
from openswim.transport.engine.pack import LANES, choose_above, flat, put, read_quadruple, spread_quadruple, write
from openswim.transport.engine.types import FLOAT

_ZERO, _HALF, _ONE = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0)
_TWO, _TWELVE = FLOAT(2.0), FLOAT(12.0)
_SIXTEENTH, _SIXTH = FLOAT(0.0625), FLOAT(1 / 6)
_SHORT = FLOAT(0.1)
ALONG_X, ALONG_Y, ALONG_Z = 0, 1, 2  # the axis whose cells an ordinate crosses fastest


class Step(NamedTuple):
    """Scratch: how an ordinate steps to a plane, and to a row of it."""

    weights: np.ndarray  # (8,) of the upstream corners, length, and (trans, near, far) in clear air
    at: np.ndarray  # (4,) the first upstream node of each corner, in the buffers
    at_e: np.ndarray  # (4,) the same in the extinction


class Plane(NamedTuple):
    """Rows of a plane of an ordinate: the strip that the buffers hold."""

    k: int
    before: int  # the plane before, or k itself
    level_e: int  # this plane in the extinction
    before_e: int  # and the one before
    begin: int  # the strip's first row,
    end: int  # and the one after its last
    now: int  # this strip's first flat element in the buffers
    last: int  # and that of the plane before
    axis: int  # see `ALONG_X`
    to_x: float  # the ordinate: to the light's origin
    to_y: float
    sx: int  # to which side the upstream point lies
    sy: int
    top: bool  # light enters the plane from outside
    side: bool  # light enters the strip's first row from outside
    inflow: float  # radiance of that light
    scratch: int  # flat element of ``Room.work`` on which two rows of this thread begin


class Row(NamedTuple):
    """A row of a plane."""

    out: int  # flat element of its first node in the buffers
    out_e: int  # in the extinction
    packs: int  # in the grid's ``cloudy``: the packs of nodes whose steps differ
    nx: int
    entry: int  # the node where light enters the row from beside, there is no medium upstream of it; or -1


@part(REORDERED, inlined=True)
def step_weights(extinction, extinction_up, ds):
    """(trans, near, far) of a step: radiance = trans upstream + near source + far source_up; scalars or packs.

    The same step as `step_emission`, source and extinction linear between, written with a single division since
    divisions are what it costs: e^-tau is the 16th power of what five terms of the exponential series give at tau/16,
    within 2e-5.
    """
    tau = (extinction + extinction_up) * (_HALF * ds)
    y = tau * _SIXTEENTH
    p = y * (_HALF + y * (_SIXTH + y * (FLOAT(1 / 24) + y * FLOAT(1 / 120)))) + _ONE
    p = y * p + _ONE
    q = tau * _TWO + _TWELVE
    d = choose_above(tau, _SHORT, tau, _SHORT)
    pq = p * q
    r = _ONE / (pq * d)
    t = r * q * d  # e^(-tau/16)
    t = t * t
    t = t * t
    t = t * t
    t = t * t
    series = _ONE - tau * (_HALF - tau * (_SIXTH - tau * FLOAT(1 / 24)))
    mean = choose_above(tau, _SHORT, (_ONE - t) * (r * pq), series) * ds
    c = (r * p * d) * ds
    return t, mean * (_HALF + extinction_up * c), mean * (_HALF - extinction * c)


@part(REORDERED, inlined=True)
def upstream(plane, row, aside, now_e, last_e, step):
    """The first upstream corners of a row, in the order of the step's weights: `ALONG_Z` has all on the plane before,
    the others two on each. row, aside: this row's first node from the plane's first on, and that of the row upstream;
    now_e, last_e: the planes' first elements in the extinction."""
    axis, sx, last, at, at_e = plane.axis, plane.sx, plane.last, step.at, step.at_e
    near, near_e = (last, last_e) if axis == ALONG_Z else (plane.now, now_e)
    first = aside if axis == ALONG_Y else row
    second = row if axis == ALONG_Z else aside
    third = row if axis == ALONG_X else aside
    at[0], at_e[0] = near + first, near_e + first
    at[1], at_e[1] = near + second + sx, near_e + second + sx
    at[2], at_e[2] = last + third, last_e + third
    at[3], at_e[3] = last + aside + sx, last_e + aside + sx
    if axis == ALONG_X:
        at[0], at_e[0], at[2], at_e[2] = at[0] + sx, at_e[0] + sx, at[2] + sx, at_e[2] + sx


@part(REORDERED, inlined=True)
def between_corners(array, a, b, c, d, wa, wb, wc, wd):
    """Bilinear values at the upstream points of LANES nodes, from the corners' four rows."""
    low = wa * read_quadruple(array, a) + wb * read_quadruple(array, b)
    return low + (wc * read_quadruple(array, c) + wd * read_quadruple(array, d))


@part(REORDERED, inlined=True)
def carry_row(row, plane, step, cloudy, buffers):
    """Light carried to a `Row` of a `Plane` by its `Step`, in the buffers ``light``, ``emitted``, ``extinction`` and
    ``work`` of a sweep's room.

    Along x, corner a is the neighbour in this very row; all but its radiance is known beforehand, so that only a
    multiply-add is sequential.
    """
    intensity, source, extinction, work = buffers.light, buffers.emitted, buffers.extinction, buffers.work
    out, out_e, packs, nx, entry = row
    room, shift, inflow = plane.scratch, plane.sx, plane.inflow
    recurrent = plane.axis == ALONG_X
    share = room + intensity.shape[3]
    weights, at, at_e = step
    wa, wb, wc, wd, ds = flat(weights, 0), flat(weights, 1), flat(weights, 2), flat(weights, 3), flat(weights, 4)
    trans, near, far = flat(weights, 5), flat(weights, 6), flat(weights, 7)
    known = _ZERO if recurrent else wa
    a, b, c, d = flat(at, 0), flat(at, 1), flat(at, 2), flat(at, 3)
    e_a, e_b, e_c, e_d = flat(at_e, 0), flat(at_e, 1), flat(at_e, 2), flat(at_e, 3)
    ghost = flat(intensity, out + nx)  # the last pack may reach over it
    for i in range(0, nx, LANES):
        up = between_corners(intensity, a + i, b + i, c + i, d + i, known, wb, wc, wd)
        source_up = between_corners(source, a + i, b + i, c + i, d + i, wa, wb, wc, wd)
        own = read_quadruple(source, out + i)
        if flat(cloudy, packs + i // LANES):
            extinction_up = between_corners(extinction, e_a + i, e_b + i, e_c + i, e_d + i, wa, wb, wc, wd)
            t, w_near, w_far = step_weights(read_quadruple(extinction, out_e + i), extinction_up, ds)
            up = t * up + (w_near * own + w_far * source_up)
            if recurrent:
                write(work, share + i, wa * t)
        else:
            up = trans * up + (near * own + far * source_up)
            if recurrent:
                write(work, share + i, spread_quadruple(wa * trans))
        if recurrent:
            write(work, room + i, up)
        else:
            write(intensity, out + i, up)
    if recurrent:
        if entry >= 0:
            put(work, room + entry, inflow)
            put(work, share + entry, _ZERO)
        _recur(intensity, out, work, room, share, nx, shift)
    else:
        put(intensity, out + nx, ghost)
        if entry >= 0:
            put(intensity, out + entry, inflow)


@part(REORDERED)
def _recur(out, at, work, room, share, nx, shift):
    """out[i] = known[i] + share[i] out[upstream neighbour], from the ghost node on.

    ``work`` holds what is known, from flat element ``room`` on, and the shares, from ``share`` on. Four stretches of
    the row at once, each from zero, since one alone waits for its own last node; what enters a stretch, times the
    product of the shares on the way, is added after.
    """
    quarter = nx // 4
    # node n of the way lies at `begin` + n `way`
    way = -1 if shift > 0 else 1
    begin = nx - 1 if shift > 0 else 0
    r0, r1, r2, r3 = flat(out, at + begin + shift), _ZERO, _ZERO, _ZERO
    p1, p2, p3 = _ONE, _ONE, _ONE
    for n in range(quarter):
        a = begin + way * n
        b = a + way * quarter
        c = b + way * quarter
        d = c + way * quarter
        r0 = r0 * flat(work, share + a) + flat(work, room + a)
        r1 = r1 * flat(work, share + b) + flat(work, room + b)
        r2 = r2 * flat(work, share + c) + flat(work, room + c)
        r3 = r3 * flat(work, share + d) + flat(work, room + d)
        p1 *= flat(work, share + b)
        p2 *= flat(work, share + c)
        p3 *= flat(work, share + d)
        put(out, at + a, r0)
        put(out, at + b, r1)
        put(out, at + c, r2)
        put(out, at + d, r3)
        put(work, share + b, p1)
        put(work, share + c, p2)
        put(work, share + d, p3)
    last = r0
    if quarter > 0:
        for part in range(1, 4):
            end = begin + way * ((part + 1) * quarter - 1)
            low = min(begin + way * (part * quarter), end)
            for i in range(low, low + quarter):
                put(out, at + i, flat(out, at + i) + last * flat(work, share + i))
            last = flat(out, at + end)
    for n in range(4 * quarter, nx):
        a = begin + way * n
        last = last * flat(work, share + a) + flat(work, room + a)
        put(out, at + a, last)
