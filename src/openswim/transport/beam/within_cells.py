"""The sun's optical depth between nodes: no straight line, but one that knows what extinction lies there.

Toward the sun the depth falls by the extinction, v . grad tau = -beta with v the sun's direction in cells per metre,
and beta is linear between nodes. Of all

    tau = what is linear between its values at the cell's corners + sum of c_i h_i (1 - h_i), h_i in 0..1 along axis i,

the one with

    c_i = v_i (d_i beta + sum over the other axes of v_j d_ij tau) / (2 v_i^2)

fits that best; d_i, d_ij: mean differences across the cell. It is exact behind a face that the light meets at any
angle, or runs along, however thick the cell. The march has the square of a line between roots instead of the linear
part: what that lacks is part of the c that it gets; `swim` has lines between depths.
docs/decisions/0019-beam-between-nodes.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.beam.sun_sweep import BEYOND, weighted
from openswim.transport.engine.compiled import REORDERED, kernel, part
from openswim.transport.engine.pack import LANES, PACK, choose_above, flat, largest, put, read_quadruple, write
from openswim.transport.engine.scalar import greater, smaller
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import Volume
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ASIDE = 0.005  # share of v^2 below which v_i^2 would tell of rounding more than of light
_ASIDE = FLOAT(ASIDE)
_MOST = FLOAT(2.0)  # times the change of the depth along an axis
_LEAST = FLOAT(-2.0)  # by then light has all of a cell, and does not grow
_ZERO, _ONE, _TWO, _HALF, _QUARTER = FLOAT(0.0), FLOAT(1.0), FLOAT(2.0), FLOAT(0.5), FLOAT(0.25)
_THIRD, _FOUR = FLOAT(1 / 3), FLOAT(4.0)


@part(REORDERED, inlined=True)
def _size(a):
    return choose_above(a, _ZERO, a, _ZERO - a)


@part(REORDERED)
def _over_root(rise):
    """c of a straight line over the square of a straight line from 1 to e^(-rise/2), which keeps the mean light within
    2 %: rise^2/4 where that is small, rise where it is large, rise^2 / (64 + rise^3)^(1/3) in all."""
    most = greater(rise, _FOUR)
    ratio = smaller(rise, _FOUR) / most
    rest = ratio * ratio * ratio  # the cube root of 1 + this, by a quotient and a step of Newton's: within 7e-5
    near = (_ONE + _TWO * _THIRD * rest) / (_ONE + _THIRD * rest)
    near = _THIRD * (_TWO * near + (_ONE + rest) / (near * near))
    return rise * rise / (most * near)


@part(REORDERED)
def _along(r00, r10, r01, r11, extinction_rise, own_v, v_a, v_b, least_v2, rooted):
    """c along an axis on whose four edges depths rise by ``r``, told by where these are on the other two axes, a and b,
    on which light goes at ``v_a`` and ``v_b`` cells per metre; packs of cells, see `bend_cells`."""
    mean = _QUARTER * (r00 + r10 + r01 + r11)
    most = _MOST * greater(greater(_size(r00), _size(r10)), greater(_size(r01), _size(r11)))
    # means of the two mixed differences
    own = extinction_rise + _HALF * (v_a * (r10 - r00 + r11 - r01) + v_b * (r01 - r00 + r11 - r10))
    c = own * own_v / (_TWO * (own_v * own_v + least_v2))
    c = smaller(greater(c, _ZERO - most), most)
    return greater(c + _over_root(_size(mean)), _LEAST) if rooted else c


@kernel(REORDERED)
def bend_cells(t, threads, depth, extinction, way, levels_m, free, rooted, periodic, bend):
    """`Volume.bend` of thread t's levels: of the cells with cloud at a corner, the others stay zero.

    depth, extinction (nz, ny, BEYOND + nx + BEYOND + 1): `beyond_sides`, to the sun and of the species; way (3, ny,
    nx + LANES): toward it, in cells per metre along x and y, and its cosine with z; free: `Volume.free`; ``rooted``:
    for the square of a line between roots, else for a line between depths.
    """
    nz, ny, nx = bend.shape[0], bend.shape[1], bend.shape[2]
    width, of_way = depth.shape[2], way.shape[2]
    last_j, last_i = (ny, nx) if periodic else (ny - 1, nx - 1)
    found = np.empty(4 * LANES, FLOAT)
    for k in range(t, nz - 1, threads):
        per_m = FLOAT(1.0 / (levels_m[k + 1] - levels_m[k]))
        for j in range(last_j):
            row, next_row = k * ny + j, k * ny + (j + 1) % ny
            for i in range(0, last_i, LANES):
                a, b = row * width + BEYOND + i, next_row * width + BEYOND + i
                c, d = a + ny * width, b + ny * width
                e000, e001 = read_quadruple(extinction, a), read_quadruple(extinction, a + 1)
                e010, e011 = read_quadruple(extinction, b), read_quadruple(extinction, b + 1)
                e100, e101 = read_quadruple(extinction, c), read_quadruple(extinction, c + 1)
                e110, e111 = read_quadruple(extinction, d), read_quadruple(extinction, d + 1)
                cloud = e000 + e001 + e010 + e011 + (e100 + e101 + e110 + e111)
                if not largest(cloud) > _ZERO:
                    continue
                t000, t001 = read_quadruple(depth, a), read_quadruple(depth, a + 1)
                t010, t011 = read_quadruple(depth, b), read_quadruple(depth, b + 1)
                t100, t101 = read_quadruple(depth, c), read_quadruple(depth, c + 1)
                t110, t111 = read_quadruple(depth, d), read_quadruple(depth, d + 1)
                at = j * of_way + i
                vx, vy = read_quadruple(way, at), read_quadruple(way, ny * of_way + at)
                vz = per_m * read_quadruple(way, 2 * ny * of_way + at)
                least_v2 = _ASIDE * (vx * vx + vy * vy + vz * vz)
                write(found, 0, _along(
                    t001 - t000, t011 - t010, t101 - t100, t111 - t110,
                    _QUARTER * (e001 - e000 + e011 - e010 + (e101 - e100 + e111 - e110)), vx, vy, vz, least_v2, rooted,
                ))  # fmt: skip
                write(found, LANES, _along(
                    t010 - t000, t011 - t001, t110 - t100, t111 - t101,
                    _QUARTER * (e010 - e000 + e011 - e001 + (e110 - e100 + e111 - e101)), vy, vx, vz, least_v2, rooted,
                ))  # fmt: skip
                write(found, 2 * LANES, _along(
                    t100 - t000, t101 - t001, t110 - t010, t111 - t011,
                    _QUARTER * (e100 - e000 + e101 - e001 + (e110 - e010 + e111 - e011)), vz, vx, vy, least_v2, rooted,
                ))  # fmt: skip
                write(found, 3 * LANES, cloud)
                for m in range(min(LANES, last_i - i)):
                    node = row * nx + i + m
                    if found[3 * LANES + m] > _ZERO and flat(free, node) == 0:
                        put(bend, node * PACK, found[m])
                        put(bend, node * PACK + 1, found[LANES + m])
                        put(bend, node * PACK + 2, found[2 * LANES + m])


def bent(volume: Volume, medium: Medium, depth: F32, weights: F32, local_sun: F64, rooted: bool) -> None:
    """Fill in `Volume.bend`. depth (nz, ny, ...): `beyond_sides`, to the sun, of the species' extinctions with
    ``weights`` (ns,); local_sun (ny, nx, 3): toward it, in each column's axes; ``rooted``: see `bend_cells`."""
    way = np.moveaxis(local_sun, -1, 0) / np.array([*medium.cell_m, 1.0])[:, None, None]
    in_threads(
        bend_cells, depth, weighted(medium.extinction, weights[None], medium.periodic)[0],
        np.ascontiguousarray(np.pad(way, ((0, 0), (0, 0), (0, LANES))), FLOAT), medium.levels_m, volume.free, rooted,
        volume.periodic, volume.bend,
    )  # fmt: skip
