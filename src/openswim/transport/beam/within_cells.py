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

from openswim.transport.beam.sun_sweep import BEYOND
from openswim.transport.engine.compiled import REORDERED, kernel, part
from openswim.transport.engine.pack import PACK, flat, put
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]

ASIDE = 0.005  # share of v^2 below which v_i^2 would tell of rounding more than of light
_MOST = 2.0  # times the change of the depth along an axis
_LEAST = -2.0  # by then light has all of a cell, and does not grow


@part(REORDERED, inlined=True)
def _over_root(rise):
    """c of a straight line over the square of a straight line from 1 to e^(-rise/2), which keeps the mean light within
    2 %: rise^2/4 where that is small, rise where it is large."""
    return rise * rise / (64.0 + rise * rise * rise) ** (1.0 / 3.0)


@part(REORDERED)
def _cell(t, e, v, rooted, bend, at):
    """c along x, y, z of one cell, from depths and extinctions (8,) at its corners, z y x in binary, into ``bend``;
    where ``rooted``, for the square of a line between roots, else for a line between depths."""
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    for axis in range(3):
        one = 1 << axis
        own, mean, most = 0.0, 0.0, 0.0
        for n in range(8):
            if n & one:
                continue
            rise = t[n | one] - t[n]
            mean += 0.25 * rise
            most = max(most, abs(rise))
            own += 0.25 * (e[n | one] - e[n])
            for other in range(3):
                if other != axis:
                    # mean of the two mixed differences: over the fourth of n it counts four times
                    own += 0.5 * v[other] * (rise if n & (1 << other) else -rise)
        c = own * v[axis] / (2.0 * (v[axis] * v[axis] + ASIDE * square))
        c = min(max(c, -_MOST * most), _MOST * most)
        put(bend, at + axis, FLOAT(max(c + _over_root(abs(mean)), _LEAST) if rooted else c))


@kernel(REORDERED)
def bend_cells(t, threads, depth, weights, sun, levels_m, cell_m, rooted, volume):
    """`Volume.bend` of thread t's levels: of the cells with cloud at a corner, the others stay zero.

    depth: to the sun, see `sun_sweep`, of which the first field is meant, with ``weights`` (species,) of the species'
    extinctions; sun (ny, nx, 3): toward it, in each column's axes; ``rooted``: see `_cell`.
    """
    nz, ny, nx, nc = volume.fields.shape
    width = depth.shape[3]
    taus, betas, v = np.empty(8), np.empty(8), np.empty(3)
    for k in range(t, nz - 1, threads):
        for j in range(ny if volume.periodic else ny - 1):
            for i in range(nx if volume.periodic else nx - 1):
                node = (k * ny + j) * nx + i
                if flat(volume.free, node) > 0:
                    continue
                cloud = 0.0
                for n in range(8):
                    x, y, z = (i + (n & 1)) % nx, (j + (n >> 1 & 1)) % ny, k + (n >> 2)
                    corner = (z * ny + y) * nx + x
                    taus[n] = flat(depth, (z * ny + y) * width + BEYOND + x)
                    betas[n] = 0.0
                    for s in range(weights.shape[0]):
                        betas[n] += weights[s] * flat(volume.fields, corner * nc + 2 * PACK + s)
                    cloud += betas[n]
                if cloud > 0.0:
                    v[0], v[1] = sun[j, i, 0] / cell_m[0], sun[j, i, 1] / cell_m[1]
                    v[2] = sun[j, i, 2] / (levels_m[k + 1] - levels_m[k])
                    _cell(taus, betas, v, rooted, volume.bend, node * PACK)
