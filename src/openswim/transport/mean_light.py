"""What the medium around a node is lit by: light and extinction vary together between nodes.

Where both are linear between two nodes a and b, a distance h apart, what is scattered there is not the mean of the
nodes' products:

    integral of beta J ds = h (beta_a J_a + beta_b J_b)/2 - h (beta_b - beta_a)(J_b - J_a)/6 - ...

A cloud's edge scatters more of the beam, which fades inward, than its nodes say (a tenth of all that is scattered once,
in cumulus on cells of optical depth one), and less of the diffuse light, which fades outward. The rest is given to both
nodes in proportion to their extinction: then it is the light at a node that is amended, whatever its moments,

    J~ = J - sum over the six neighbours b of (h_b/V) [(beta_b - beta)/(6 (beta_b + beta)) + c] (J_b - J),

V the mean of the two h along that axis. c is for light that is not linear: 1/12 by the trapezoidal rule for a smooth
one. That is for the eye, and for light carried beyond a grid; sweeps themselves tell what their steps take, see
`sweep_taken.py`. docs/decisions/0015-light-between-nodes.md.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.moments import Moments
from openswim.transport.optical_grid import OpticalGrid
from openswim.transport.pack import LANES, choose_above, flat, put, read_quadruple, spread_quadruple, write
from openswim.transport.pool import Pool
from openswim.transport.products import BLOCK
from openswim.transport.threads import in_threads

F32 = NDArray[np.float32]

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_TINY = np.float32(1e-30)
# The factors of (beta_b - beta)/(beta_b + beta) and of 1. In sweeps a step loses light along its dominant axis (1/6 and
# 1/12), and across as interpolation upstream has it (1/12 on the average, and 0): means over the three axes
SWEPT = (1.0 / 9.0, 1.0 / 36.0)
SEEN = (1.0 / 6.0, 0.0)  # by an eye, to which light is linear between nodes
_ROW = BLOCK + 2 * LANES  # of a block with a node on either side; the first stands before element LANES
_NEIGHBOURS = 6


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _share(here, there, light, other, part, weights):
    """What a neighbour's difference counts for; nothing where either lies in darkness, such as underground."""
    lit = choose_above(light, _ZERO, choose_above(other, _ZERO, spread_quadruple(part), _ZERO), _ZERO)
    rise, bend = weights
    return lit * (rise * (there - here) / (there + here + _TINY) + bend)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _row_with_sides(at, west, east, moment, last, values, row):
    """A block's moment with the nodes beside it, into ``row``: see `_ROW`. west, east: flat elements of those nodes'
    first moments; last: nodes of the block that are nodes of the grid."""
    start = at + moment * BLOCK
    for i in range(0, BLOCK, LANES):
        write(row, LANES + i, read_quadruple(values, start + i))
    put(row, LANES - 1, flat(values, west + moment * BLOCK))
    put(row, LANES + last, flat(values, east + moment * BLOCK))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _block(place, k, j, b, otherwise):
    """Index of a block that is kept, else ``otherwise``."""
    kept = flat(place, (k * place.shape[1] + j) * place.shape[2] + b)
    return kept if kept >= 0 else otherwise


@njit(cache=True, error_model="numpy", nogil=True, fastmath=_FLAGS)
def mean_light_rows(t, threads, place, values, extinction, levels_m, nx, periodic, weights, out):
    """J~ of the moments ``values`` (blocks, moments, BLOCK) of the blocks that are kept, ``place``, into ``out``.

    ``extinction``: `with_ghosts`. Light beyond a block that is not kept is taken for the same as at the node.
    """
    nz, ny, nb = place.shape
    moments = values.shape[1]
    size = moments * BLOCK
    width = extinction.shape[2]
    row, shares = np.zeros(_ROW, np.float32), np.empty((_NEIGHBOURS, BLOCK), np.float32)
    for at_row in range(t, nz * ny, threads):
        k, j = at_row // ny, at_row % ny
        below, above = max(k - 1, 0), min(k + 1, nz - 1)
        step_down, step_up = levels_m[k] - levels_m[below], levels_m[above] - levels_m[k]
        both = max(step_down + step_up, 1e-9)
        down, up = np.float32(2.0 * step_down / both), np.float32(2.0 * step_up / both)
        if nz > 1 and (k == 0 or k == nz - 1):
            down, up = np.float32(k > 0), np.float32(k < nz - 1)
        south = (j - 1) % ny if periodic else max(j - 1, 0)
        north = (j + 1) % ny if periodic else min(j + 1, ny - 1)
        for b in range(nb):
            kept = flat(place, at_row * nb + b)
            if kept < 0:
                continue
            at = kept * size
            last = min(BLOCK, nx - b * BLOCK)
            west, east = at, at + last - 1
            before, after = b - 1, b + 1
            if periodic:
                before, after = before % nb, after % nb
            if before >= 0 and _block(place, k, j, before, -1) >= 0:
                west = _block(place, k, j, before, -1) * size + min(BLOCK, nx - before * BLOCK) - 1
            if after < nb and _block(place, k, j, after, -1) >= 0:
                east = _block(place, k, j, after, -1) * size
            ways = (
                _block(place, below, j, b, kept) * size, _block(place, above, j, b, kept) * size,
                _block(place, k, south, b, kept) * size, _block(place, k, north, b, kept) * size,
            )  # fmt: skip
            node = (k * (ny + 2) + j + 1) * width + 1 + b * BLOCK
            beyond = (
                node + (below - k) * (ny + 2) * width, node + (above - k) * (ny + 2) * width, node - width, node + width
            )
            _row_with_sides(at, west, east, 0, last, values, row)
            for i in range(0, BLOCK, LANES):
                here, light = read_quadruple(extinction, node + i), read_quadruple(row, LANES + i)
                for n in range(4):
                    part = down if n == 0 else up if n == 1 else _ONE
                    there, other = read_quadruple(extinction, beyond[n] + i), read_quadruple(values, ways[n] + i)
                    write(shares, n * BLOCK + i, _share(here, there, light, other, part, weights))
                for n in range(2):
                    side = i - 1 + 2 * n
                    there, other = read_quadruple(extinction, node + side), read_quadruple(row, LANES + side)
                    write(shares, (4 + n) * BLOCK + i, _share(here, there, light, other, _ONE, weights))
            for m in range(moments):
                _row_with_sides(at, west, east, m, last, values, row)
                for i in range(0, BLOCK, LANES):
                    own = read_quadruple(row, LANES + i)
                    total = own
                    for n in range(4):
                        other = read_quadruple(values, ways[n] + m * BLOCK + i)
                        total -= read_quadruple(shares, n * BLOCK + i) * (other - own)
                    for n in range(2):
                        other = read_quadruple(row, LANES + i - 1 + 2 * n)
                        total -= read_quadruple(shares, (4 + n) * BLOCK + i) * (other - own)
                    write(out, at + m * BLOCK + i, total)


def light_around(
    grid: OpticalGrid, place: NDArray[np.int32], values: F32, extinction: F32, out: F32,
    weights: tuple[float, float],
) -> F32:  # fmt: skip
    """The light of `mean_light_rows` around the nodes of a grid, of diffuse moments kept in blocks."""
    nx = grid.ground_node.shape[1]
    factors = tuple(np.float32(w) for w in weights)
    in_threads(mean_light_rows, place, values, extinction, grid.levels_m, nx, grid.periodic, factors, out)
    return out


def seen(grid: OpticalGrid, moments: Moments, extinction: F32, pool: Pool) -> None:
    """Turn the solved moments of a grid into what an eye sees scattered."""
    out = pool.take("begin", *moments.values.shape)  # where the solution began is no longer needed
    np.copyto(moments.values, light_around(grid, moments.place, moments.values, extinction, out, SEEN))
