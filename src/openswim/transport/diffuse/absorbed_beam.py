"""What cells take of the sun's beam: as much as enters them and does not leave.

Where extinction grows, the beam fades, and products at the nodes do not tell how much a cell scatters of it. But along
its way v the beam obeys v . grad T = beta T, so that in a cell

    integral of beta T = sum over the axes of v_i h_j h_k (mean of T on the face toward the sun - mean on the other),

whatever lies between, and all cells together take what the sun loses. A face's mean is that of the square of what is
bilinear between the roots at its corners. This over the mean of the corners' products is what their light is to be
amended by, a node's by the mean of the cells around it. docs/decisions/0015-light-between-nodes.md.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.optical_grid import OpticalGrid, total_extinction, with_ghosts
from openswim.transport.engine.compiled import FINITE, kernel, part
from openswim.transport.engine.pack import LANES, choose_above, read_quadruple, root, write
from openswim.transport.engine.scalar import greater, smaller
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]

_ZERO, _ONE, _EIGHTH, _QUARTER = FLOAT(0.0), FLOAT(1.0), FLOAT(0.125), FLOAT(0.25)
_NINTH, _EIGHTEENTH = FLOAT(1 / 9), FLOAT(1 / 18)
_CLOUDY = FLOAT(1e-3)  # share of the extinction that cloud must be
_OFF = FLOAT(20.0)  # times its greatest optical depth, a cell may be so far off,
_THICK = FLOAT(2.0)  # and from so much on as far as the beam fades in it,
_ASLANT = FLOAT(5.0)  # where it crosses so many times as many cells as levels
_TINY = FLOAT(1e-37)
_DARK = FLOAT(1e-36)  # at a corner of less light there is the terrain's shadow, or nothing left


@part(FINITE, inlined=True)
def _face(a, b, c, d):
    """Mean of the square of what is bilinear between corners; a and d, b and c lie across from each other."""
    return ((a * a + b * b) + (c * c + d * d) + (a + d) * (b + c)) * _NINTH + (a * d + b * c) * _EIGHTEENTH


@kernel(FINITE)
def cell_ratios(t, threads, beam, extinction, clear, sun, levels_m, cell_m, near_cloud, out):
    """What thread t's levels of cells take of the beam, over what their corners say, 1 in clear air.

    beam, extinction: `with_ghosts`; clear (nz,): the air's part; sun (3, rows, width): toward it along x, y, z; out
    (nz - 1, rows, width): the cell beyond each node.
    """
    nz, rows, width = beam.shape
    along_x, along_y = FLOAT(1.0 / cell_m[0]), FLOAT(1.0 / cell_m[1])
    for k in range(t, nz - 1, threads):
        out[k] = _ONE
        if not (near_cloud[k] and near_cloud[k + 1]):
            continue
        along_z = FLOAT(1.0 / (levels_m[k + 1] - levels_m[k]))
        air = max(clear[k], clear[k + 1])
        for j in range(rows - 1):
            for at in range(0, width - 1, LANES):
                i = min(at, width - 1 - LANES)  # the last ones twice
                n = (k * rows + j) * width + i
                m = n + rows * width
                e000, e001 = read_quadruple(extinction, n), read_quadruple(extinction, n + 1)
                e010, e011 = read_quadruple(extinction, n + width), read_quadruple(extinction, n + width + 1)
                e100, e101 = read_quadruple(extinction, m), read_quadruple(extinction, m + 1)
                e110, e111 = read_quadruple(extinction, m + width), read_quadruple(extinction, m + width + 1)
                t000, t001 = read_quadruple(beam, n), read_quadruple(beam, n + 1)
                t010, t011 = read_quadruple(beam, n + width), read_quadruple(beam, n + width + 1)
                t100, t101 = read_quadruple(beam, m), read_quadruple(beam, m + 1)
                t110, t111 = read_quadruple(beam, m + width), read_quadruple(beam, m + width + 1)
                told = (t000 * e000 + t001 * e001) + (t010 * e010 + t011 * e011)
                told += (t100 * e100 + t101 * e101) + (t110 * e110 + t111 * e111)
                least = smaller(smaller(smaller(t000, t001), smaller(t010, t011)), smaller(
                    smaller(t100, t101), smaller(t110, t111)
                ))  # fmt: skip
                most = greater(greater(greater(e000, e001), greater(e010, e011)), greater(
                    greater(e100, e101), greater(e110, e111)
                ))  # fmt: skip
                r000, r001, r010, r011 = root(t000), root(t001), root(t010), root(t011)
                r100, r101, r110, r111 = root(t100), root(t101), root(t110), root(t111)
                c = j * width + i
                vx, vy = read_quadruple(sun, c) * along_x, read_quadruple(sun, rows * width + c) * along_y
                vz = read_quadruple(sun, 2 * rows * width + c) * along_z
                taken = vx * (_face(r001, r011, r101, r111) - _face(r000, r010, r100, r110))
                taken += vy * (_face(r010, r011, r110, r111) - _face(r000, r001, r100, r101))
                taken += vz * (_face(r100, r101, r110, r111) - _face(r000, r001, r010, r011))
                brightest = greater(greater(greater(t000, t001), greater(t010, t011)), greater(
                    greater(t100, t101), greater(t110, t111)
                ))  # fmt: skip
                # not more than the thickest would take of the brightest
                ratio = smaller(taken, most * brightest) / (_EIGHTH * told + _TINY)
                # what is thin amends little: at the edge of another cloud's shadow it would seem to take more, or less
                speed = root(vx * vx + vy * vy + vz * vz)
                depth = _OFF * most / speed
                aslant = speed / (greater(vz, _ZERO - vz) + _TINY) - _ASLANT
                faded = greater(depth - _THICK, _ZERO) * greater(aslant, _ZERO) * (brightest / (least + _DARK))
                ratio = smaller(ratio, _ONE + depth + faded)
                ratio = greater(greater(ratio, _ONE - depth), _ZERO)
                ratio = choose_above(least, _DARK, ratio, _ONE)
                write(out, n, choose_above(most - air, _CLOUDY * most, ratio, _ONE))


@kernel(FINITE)
def amend_beam(t, threads, ratios, levels_m, near_cloud, ground_node, periodic, beam):
    """The beam (nz, ny, columns) of thread t's levels, by the mean of the ``ratios`` of the cells around each node, and
    of those above it on the ground."""
    nz, ny, columns = beam.shape
    rows, width = ratios.shape[1], ratios.shape[2]
    highest = ground_node.max()
    around = np.empty(2 * LANES, FLOAT)
    for k in range(t, nz, threads):
        if not near_cloud[k]:
            continue
        down = levels_m[k] - levels_m[k - 1] if k > 0 else 0.0
        up = levels_m[k + 1] - levels_m[k] if k + 1 < nz else 0.0
        below = FLOAT(0.25 * down / (down + up))
        above = FLOAT(0.25 * up / (down + up))
        lower, upper = max(k - 1, 0), min(k, nz - 2)
        for j in range(ny):
            # open sides have no cells beyond
            one, two = (j, j + 1) if periodic or ny == 1 else (max(j, 1), min(j + 1, ny - 1))
            a, b = (lower * rows + one) * width, (lower * rows + two) * width
            c, d = (upper * rows + one) * width, (upper * rows + two) * width
            for i in range(0, columns, LANES):
                low = read_quadruple(ratios, a + i) + read_quadruple(ratios, a + i + 1)
                low += read_quadruple(ratios, b + i) + read_quadruple(ratios, b + i + 1)
                high = read_quadruple(ratios, c + i) + read_quadruple(ratios, c + i + 1)
                high += read_quadruple(ratios, d + i) + read_quadruple(ratios, d + i + 1)
                write(around, 0, below * low + above * high)
                if 0 < k <= highest:
                    write(around, LANES, _QUARTER * high)
                    for m in range(min(LANES, ground_node.shape[1] - i)):
                        if ground_node[j, i + m] == k:
                            around[m] = around[LANES + m]
                n = (k * ny + j) * columns + i
                write(beam, n, read_quadruple(beam, n) * read_quadruple(around, 0))


def beam_around(grid: OpticalGrid) -> F32:
    """The beam that lights the nodes' surroundings, such that cells scatter what they take; in clear air the beam."""
    nz, nx = len(grid.levels_m), grid.ground_node.shape[1]
    near_cloud = grid.cloudy.any(axis=(1, 2))
    out = grid.beam.copy()
    if nz < 2 or not near_cloud.any():
        return out
    # the harmonics of the first degree are those of a vector
    sun = np.moveaxis(grid.sun_harmonics[:, (3, 1, 2)], 1, 0) * np.array([-1, -1, 1], FLOAT)[:, None, None]
    sun = with_ghosts(FLOAT(math.sqrt(4 * math.pi / 3)) * sun, nx, False)
    beam, extinction = (with_ghosts(field, nx, grid.periodic) for field in (grid.beam, total_extinction(grid)))
    ratios = np.empty((nz - 1, *beam.shape[1:]), FLOAT)
    in_threads(
        cell_ratios, beam, extinction, grid.air_extinction, sun, grid.levels_m, grid.cell_m, near_cloud, ratios
    )
    if not grid.periodic and nx > 1:
        ratios[..., 0], ratios[..., nx] = ratios[..., 1], ratios[..., nx - 1]
    in_threads(amend_beam, ratios, grid.levels_m, near_cloud, grid.ground_node, grid.periodic, out)
    return out
