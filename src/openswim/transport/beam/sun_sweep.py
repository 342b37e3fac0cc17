"""Optical depth from every node of a grid to the sun, along the rays of LANES neighbours at a time.

`sun` is the direction to the sun in each column's own axes. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from openswim.transport.engine.compiled import REORDERED, kernel, part
from openswim.transport.engine.pack import (
    LANES,
    choose_above,
    largest,
    put,
    read_quadruple,
    spread_quadruple,
    write,
)
from openswim.transport.engine.scalar import greater, smaller, table_index
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import SUN_RADIUS_RAD
from openswim.transport.medium.plan import WIDE_CELL_M

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ZERO, _HALF, _ONE, _TWO = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0), FLOAT(2.0)
_LANE = np.arange(LANES, dtype=FLOAT)
BEYOND = LANES  # nodes beyond a row's ends, where packs of rays that leave it or wrap around may read
_BLOCK = 8  # nodes along a side of a part of a level of which is known whether anything is there
_FAR_M = 1e30
_ALONG_PER_M = 1e-9  # cells per metre that a ray along a side may drift
_APART, _LONGER = 0.2, 0.1  # cells between the ends of rays that go side by side, share by which one is longer
_GAP = 3  # levels free of cloud that part one layer from another
_DEEPEST_M = 5000.0  # below the grid, to which rays go on their way to a sun under the horizon
_CLOUDS_M = 10_000.0  # height of clouds; in cells so wide that columns are lit each by itself, rays are read,
_FOLLOWED = 8  # where they move by less than a cell in it, after so many levels,
_RISE_M, _CELLS = 3300.0, 4.0  # else after such a rise or so many cells: views of IFS, GFS, UM, ERA5 keep within 1 %
_MOST_STEPS = 256  # from one level to the next in a period, which a level ray goes through again and again


class SunGrid(NamedTuple):
    """What a sweep toward the sun reads, and the depths that it fills; see `sun_sweep`."""

    extinction: np.ndarray  # (fields, nz, ny, nodes and what lies beyond) 1/m
    depth: np.ndarray  # alike
    exact: np.ndarray  # (nz, ny, nx) nodes that follow their ray
    followed: np.ndarray  # (nz,) to which level those of a level go
    passed: np.ndarray  # (nz,) to which level the others go
    filled: np.ndarray  # (nz,) levels with any extinction
    cloudy: np.ndarray  # (nz, blocks, blocks) parts of levels with any that packs beginning there may read
    sun: np.ndarray  # (ny, nx, 3)
    levels_m: np.ndarray
    level_origin_m: float
    level_per_m: float
    level_table: np.ndarray
    cell_m: np.ndarray  # (2,) along x and y
    radius_m: float
    periodic: bool


@part(REORDERED, merged=True)
def _within(x, least, most, count, periodic):
    """Where a ray is on an axis, or where it left: lanes beside it may stay a little longer."""
    return x - math.floor(x / count) * count if periodic else min(max(x, least), most)


@part(REORDERED, inlined=True)
def _nodes_at(grid, n, level, x, y, aside_x, aside_y, ny, nx, periodic):
    """LANES nodes of field n of (fields, nz, ny, nodes and what lies beyond), from fractional (x, y) on, bilinear, each
    a little aside: where that is beyond the next node, a steep field would go on below zero."""
    width = grid.shape[3]
    j = min(int(y), ny - 1)
    i = min(math.floor(x), nx)
    a, b = FLOAT(x - i) + aside_x, FLOAT(y - j) + aside_y
    up = width
    if j + 1 >= ny:
        up = -j * width if periodic else 0
    at = ((n * grid.shape[1] + level) * ny + j) * width + BEYOND + i
    low = read_quadruple(grid, at)
    low += a * (read_quadruple(grid, at + 1) - low)
    high = read_quadruple(grid, at + up)
    high += a * (read_quadruple(grid, at + up + 1) - high)
    value = low + b * (high - low)
    return choose_above(value, _ZERO, value, _ZERO)


@part(REORDERED, inlined=True)
def _between(before, here, there, after, a):
    """The cubic through ``here`` and ``there`` that has the slopes of their neighbours, at share ``a`` of the way."""
    bend = before - _TWO * here + there
    turn = (after - there) - (there - here) - bend
    return here + a * (there - here) - _HALF * a * (_ONE - a) * (bend + a * turn)


@part(REORDERED)
def _known_at(grid, n, level, x, y, aside_x, aside_y, ny, nx, periodic):
    """As `_nodes_at`, by cubics within what the four nodes around have: along rays that cross cells depths are smooth,
    and what is read again and again stays sharp."""
    width = grid.shape[3]
    j = min(int(y), ny - 1)
    i = min(max(math.floor(x), 1 - BEYOND), nx - 1)
    a, b = FLOAT(x - i) + aside_x, FLOAT(y - j) + aside_y
    plane = (n * grid.shape[1] + level) * ny
    before = here = there = after = least = most = spread_quadruple(_ZERO)
    for m in range(4):
        row = j + m - 1
        row = row % ny if periodic else min(max(row, 0), ny - 1)
        at = (plane + row) * width + BEYOND + i
        one, two = read_quadruple(grid, at), read_quadruple(grid, at + 1)
        value = _between(read_quadruple(grid, at - 1), one, two, read_quadruple(grid, at + 2), a)
        if m == 0:
            before = value
        elif m == 1:
            here, least, most = value, smaller(one, two), greater(one, two)
        elif m == 2:
            there, least, most = value, smaller(least, smaller(one, two)), greater(most, greater(one, two))
        else:
            after = value
    return smaller(greater(_between(before, here, there, after, b), least), most)


@part(REORDERED)
def _way_up_m(mu, bend, rise_m):
    """Distance after which a ray has risen by so much."""
    root = math.sqrt(mu * mu + 4.0 * bend * rise_m)
    return 2.0 * rise_m / (mu + root) if mu > 0.0 else (root - mu) / (2.0 * bend)


@part(REORDERED, inlined=True)
def _ways_out(nodes, count, per_m):
    """Distances from packs of nodes to the end of an axis that they go to, at so many cells per metre; none of nodes
    beyond it."""
    along = FLOAT(_ALONG_PER_M)
    fast = choose_above(per_m, _ZERO, per_m, -_ONE * per_m)
    left = choose_above(per_m, _ZERO, FLOAT(count - 1) - nodes, nodes)
    ways = choose_above(left, _ZERO, left, _ZERO) / choose_above(fast, along, fast, along)
    return choose_above(fast, along, ways, FLOAT(_FAR_M))


@part(REORDERED)
def _depths_to_sun(k, j, i, middle, ray, turn, last, far, grid, total, below):
    """Optical depths from LANES nodes (k, j, i on) toward the sun up to level ``last``, then what is known there, into
    ``total`` (fields, LANES); ``below``: scratch as large.

    Samples where the rays meet a level and, between levels, once a cell, until they leave an open domain. ``far``:
    whether they go so far that depths are smooth, and read by cubics. ``ray``:
    cells per metre along x and y, and the cosine of the zenith angle, of the node ``middle``; ``turn``: by how much
    they change from one node to the next, of which only the first order counts.
    """
    extinction, depth, levels_m, cloudy = grid.extinction, grid.depth, grid.levels_m, grid.cloudy
    fields, nz, ny, width = extinction.shape
    nx, periodic = grid.exact.shape[2], grid.periodic
    vx, vy, mu = ray[0], ray[1], ray[2]
    bend = (1.0 - mu * mu) / (2.0 * grid.radius_m)
    fastest = max(abs(vx), abs(vy))
    off = read_quadruple(_LANE, 0) - FLOAT(middle - i)
    leave = spread_quadruple(FLOAT(_FAR_M))
    gone = _FAR_M  # the last of them
    if not periodic:
        leave_x = _ways_out(read_quadruple(_LANE, 0) + FLOAT(i), nx, FLOAT(vx) + FLOAT(turn[0]) * off)
        leave_y = _ways_out(spread_quadruple(FLOAT(j)), ny, FLOAT(vy) + FLOAT(turn[1]) * off)
        leave = choose_above(leave_x, leave_y, leave_y, leave_x)
        gone = float(largest(leave))
    for n in range(fields):
        write(below, n * LANES, read_quadruple(extinction, ((n * nz + k) * ny + j) * width + BEYOND + i))
        write(total, n * LANES, spread_quadruple(_ZERO))
    s, at, clouded = 0.0, k, True  # the sample before may have cloud
    for level in range(k + 1, last + 1):
        if not (grid.filled[level] or grid.filled[level - 1]) and (mu > 0.0 or level > k + 1):
            continue
        if at < level - 1:
            s = min(_way_up_m(mu, bend, levels_m[level - 1] - levels_m[k]), gone)
        end = min(_way_up_m(mu, bend, levels_m[level] - levels_m[k]), gone)
        longer = _longer(mu, bend, levels_m[level] - levels_m[k], turn[2])
        stretch = FLOAT(longer) * off + _ONE
        at = level
        count = int(fastest * (end - s)) + 1
        if periodic:
            count = min(count, _MOST_STEPS)
        ds = (end - s) / count
        for piece in range(1, count + 1):
            before, s = s, s + ds
            x = _within(i + vx * s, -BEYOND, nx, nx, periodic)
            y = _within(j + vy * s, 0.0, ny - 1.0, ny, periodic)
            m, g = level, _ZERO
            if piece < count or end >= gone:
                fk = table_index(
                    levels_m[k] + mu * s + bend * s * s, grid.level_origin_m, grid.level_per_m, grid.level_table
                )
                m = min(int(fk), nz - 2)
                g = FLOAT(fk - m)
            row, column = min(int(y), ny - 1) // _BLOCK, (min(math.floor(x), nx) + BEYOND) // _BLOCK
            was_clouded = clouded
            clouded = cloudy[m, row, column] or (g > _ZERO and cloudy[m + 1, row, column])
            if not (was_clouded or clouded):
                continue
            left, step = leave - FLOAT(before) * stretch, FLOAT(ds) * stretch
            left = choose_above(left, step, step, left)
            half = _HALF * choose_above(left, _ZERO, left, _ZERO)
            aside_x = FLOAT(s * (turn[0] + vx * longer)) * off
            aside_y = FLOAT(s * (turn[1] + vy * longer)) * off
            for n in range(fields):
                here = _nodes_at(extinction, n, m, x, y, aside_x, aside_y, ny, nx, periodic)
                if g > _ZERO:
                    here += g * (_nodes_at(extinction, n, m + 1, x, y, aside_x, aside_y, ny, nx, periodic) - here)
                added = half * (read_quadruple(below, n * LANES) + here)
                write(total, n * LANES, read_quadruple(total, n * LANES) + added)
                write(below, n * LANES, here)
        if end >= gone:
            return
    rise = levels_m[last] - levels_m[k]
    if at < last:
        s = _way_up_m(mu, bend, rise)
        if s >= gone:
            return
    longer = _longer(mu, bend, rise, turn[2])
    x = _within(i + vx * s, -BEYOND, nx, nx, periodic)
    y = _within(j + vy * s, 0.0, ny - 1.0, ny, periodic)
    aside_x = FLOAT(s * (turn[0] + vx * longer)) * off
    aside_y = FLOAT(s * (turn[1] + vy * longer)) * off
    for n in range(fields):
        if far:
            beyond = _known_at(depth, n, last, x, y, aside_x, aside_y, ny, nx, periodic)
        else:
            beyond = _nodes_at(depth, n, last, x, y, aside_x, aside_y, ny, nx, periodic)
        beyond = choose_above(leave, FLOAT(s) * (FLOAT(longer) * off + _ONE), beyond, _ZERO)
        write(total, n * LANES, read_quadruple(total, n * LANES) + beyond)


@part(REORDERED)
def _fill_beyond(row, nx, periodic):
    """Nodes beyond the ends of a row: the other end's where periodic, else the end itself."""
    for n in range(1, BEYOND + 1):
        row[BEYOND - n] = row[BEYOND + ((-n) % nx if periodic else 0)]
        row[BEYOND + nx - 1 + n] = row[BEYOND + ((n - 1) % nx if periodic else nx - 1)]
    row[nx + 2 * BEYOND] = row[nx + 2 * BEYOND - 1]


@part(REORDERED)
def _longer(mu, bend, rise_m, turn):
    """Share by which the way up changes where the cosine of the zenith angle does by ``turn``."""
    return -turn / max(math.sqrt(max(mu * mu + 4.0 * bend * rise_m, 0.0)), 1e-9)


@part(REORDERED)
def _pieces(ray, turn, rise_m, radius_m, nodes):
    """In how many pieces so many nodes go up by ``rise_m``, that their rays stay side by side and are about as long;
    ``ray``, ``turn``: see `_depths_to_sun`."""
    bend = (1.0 - ray[2] * ray[2]) / (2.0 * radius_m)
    way, longer = _way_up_m(ray[2], bend, rise_m), _longer(ray[2], bend, rise_m, turn[2])
    apart = way * max(abs(turn[0] + ray[0] * longer), abs(turn[1] + ray[1] * longer))
    return int(min(nodes * max(apart / _APART, abs(longer) / _LONGER) + 1.0, float(nodes)))


@part(REORDERED)
def _moved(ray, rise_m, radius_m):
    """Cells that a ray moves by, along the axis that it is faster on, while it rises by ``rise_m``."""
    bend = (1.0 - ray[2] * ray[2]) / (2.0 * radius_m)
    return max(abs(ray[0]), abs(ray[1])) * _way_up_m(ray[2], bend, rise_m)


@part(REORDERED)
def _read_on(k, last, ray, levels_m, radius_m):
    """Level not above ``last`` on which a ray from level k that crosses cells is read."""
    until = k + 1
    while until < last:
        risen_m = levels_m[until] - levels_m[k]
        if risen_m >= _RISE_M or _moved(ray, risen_m, radius_m) >= _CELLS:
            break
        until += 1
    return until


@part(REORDERED)
def _dip(above_m, radius_m):
    """Cosine of the zenith angle of a ray that starts so high above the level that it touches."""
    return -math.sqrt(2.0 * above_m / (radius_m + 2.0 * above_m))


@part(REORDERED)
def _aim(sun, cell_m, lowest, ray):
    """``ray`` of `_depths_to_sun` toward a sun, or to where its cosine is the ``lowest``."""
    ray[0], ray[1], ray[2] = sun[0] / cell_m[0], sun[1] / cell_m[1], max(sun[2], lowest)


@part(REORDERED)
def _row_to_sun(k, j, grid, scratch, ray, turn):
    """The nodes of a row, LANES at a time: along rays beside that of the middle one or, where the Earth bends and they
    part, of the middle one of each of some pieces. Once for those that follow their rays, once for those that do not,
    if a pack has both."""
    fields, nz, ny, width = grid.depth.shape
    nx = grid.exact.shape[2]
    sun, levels_m, cell_m, radius_m = grid.sun, grid.levels_m, grid.cell_m, grid.radius_m
    above_m = levels_m[k] - levels_m[0]
    wide = min(cell_m[0], cell_m[1]) >= WIDE_CELL_M
    deepest = _dip(above_m + _DEEPEST_M, radius_m)
    dark = min(deepest, _dip(above_m, radius_m) - SUN_RADIUS_RAD)
    lowest = 0.0 if grid.periodic else deepest  # in a period, which is flat, the cloud would be but a bit of the way
    for first in range(0, nx, LANES):
        i = max(min(first, nx - LANES), 0)
        end = min(i + LANES, nx)
        steps = max(end - 1 - i, 1)
        turn[0] = (sun[j, end - 1, 0] - sun[j, i, 0]) / (cell_m[0] * steps)
        turn[1] = (sun[j, end - 1, 1] - sun[j, i, 1]) / (cell_m[1] * steps)
        turn[2] = (sun[j, end - 1, 2] - sun[j, i, 2]) / steps
        for follow in (True, False):
            last = grid.followed[k] if follow else grid.passed[k]
            if max(sun[j, i, 2], sun[j, end - 1, 2]) < dark:
                continue
            _aim(sun[j, (i + end) // 2], cell_m, lowest, ray)
            far = False
            if wide and last > k + _FOLLOWED:
                far = _moved(ray, _CLOUDS_M, radius_m) >= 1.0
                last = _read_on(k, last, ray, levels_m, radius_m) if far else k + _FOLLOWED
            pieces = _pieces(ray, turn, levels_m[last] - levels_m[k], radius_m, end - i)
            for piece in range(pieces):
                one, next_one = i + (end - i) * piece // pieces, i + (end - i) * (piece + 1) // pieces
                middle = (one + next_one) // 2
                count = 0
                for m in range(one, next_one):
                    count += grid.exact[k, j, m] == follow
                if count == 0:
                    continue
                _aim(sun[j, middle], cell_m, lowest, ray)
                _depths_to_sun(k, j, i, middle, ray, turn, last, far, grid, scratch[0], scratch[1])
                for n in range(fields):
                    at = ((n * nz + k) * ny + j) * width + BEYOND
                    for m in range(one, next_one):
                        if grid.exact[k, j, m] == follow:
                            put(grid.depth, at + m, scratch[0, n, m - i])
    for n in range(fields):
        _fill_beyond(grid.depth[n, k, j], nx, grid.periodic)


@kernel(REORDERED)
def _share_level(t, threads, k, grid, scratch):
    """Thread t's rows of level k: see `sun_sweep`."""
    ray, turn = np.empty(3), np.empty(3)
    for j in range(t, grid.exact.shape[1], threads):
        _row_to_sun(k, j, grid, scratch[t], ray, turn)


@kernel(REORDERED)
def _look_for_cloud(t, threads, extinction, there):
    """Thread t's levels of where any of _BLOCK nodes of a row has any extinction: ``there`` (nz, ny, blocks)."""
    fields, nz, ny, width = extinction.shape
    for k in range(t, nz, threads):
        for n in range(fields):
            for j in range(ny):
                row = extinction[n, k, j]
                for block in range(there.shape[2]):
                    i, end = block * _BLOCK, min((block + 1) * _BLOCK, width)
                    while i < end and not there[k, j, block]:
                        there[k, j, block] = row[i] > _ZERO
                        i += 1


def _cloudy_parts(extinction: F32, periodic: bool) -> NDArray[np.bool_]:
    """`SunGrid.cloudy`: of each block its own rows and the next one, and as many nodes more as a pack reaches."""
    _, nz, ny, width = extinction.shape
    there = np.zeros((nz, ny, -(-width // _BLOCK)), np.bool_)
    in_threads(_look_for_cloud, extinction, there)
    found = there | (np.roll(there, -1, axis=1) if periodic else there[:, [*range(1, ny), ny - 1]])
    ahead = found.copy()
    for n in range(1, (LANES + _BLOCK - 1) // _BLOCK + 1):
        ahead[..., :-n] |= found[..., n:]
    return np.logical_or.reduceat(ahead, np.arange(0, ny, _BLOCK), axis=1)


def sun_sweep(
    extinction: F32, exact: NDArray[np.bool_], sun: F64, levels_m: F64, lookup: tuple[float, float, F64], cell_m: F64,
    radius_m: float, periodic: bool,
) -> F32:  # fmt: skip
    """Optical depths of fields of ``extinction`` from every node to the sun, both as `beyond_sides` makes them.

    ``sun`` (ny, nx, 3) in each column's own axes. Nodes marked ``exact`` follow their ray through the layer of cloud
    that they are in, or the next above, and read what lies beyond a gap on the level that ends it; the others go one
    level up and read there, which is cheap but blurs shadows by a cell per level. In wide cells rays that move by less
    than a cell through clouds are followed for `_FOLLOWED` levels, others for a third of the clouds' height or four
    cells; these are read by cubics. In all that smears by much less than a cell. Handles any sun, also one below the
    horizon of a node on the curved Earth: the way up then starts downward. Depths are 0 where the Earth hides the sun.
    """
    cloudy = _cloudy_parts(extinction, periodic)
    filled = cloudy.any(axis=(1, 2))
    followed, passed, gates = _stops(filled)
    exact = exact.copy()
    exact[gates] = True
    depth = np.zeros(extinction.shape, FLOAT)  # which touches no memory yet
    grid = SunGrid(
        extinction, depth, exact, followed, passed, filled, cloudy, sun, levels_m, *lookup, cell_m, radius_m,
        periodic,
    )  # fmt: skip
    scratch = np.zeros((get_num_threads(), 2, len(extinction), LANES), FLOAT)
    for k in range(len(levels_m) - 2, -1, -1):
        in_threads(_share_level, k, grid, scratch)
    return depth


@kernel(REORDERED)
def _weigh(t, threads, extinction, weights, periodic, out):
    """Thread t's levels of `weighted`."""
    ns, nz, ny, nx = extinction.shape
    for k in range(t, nz, threads):
        for n in range(weights.shape[0]):
            for j in range(ny):
                row = out[n, k, j]
                for i in range(nx if ns else 0):  # written, not read first: memory that is read before costs twice
                    row[BEYOND + i] = weights[n, 0] * extinction[0, k, j, i]
                for s in range(1, ns):
                    for i in range(nx):
                        row[BEYOND + i] += weights[n, s] * extinction[s, k, j, i]
                _fill_beyond(row, nx, periodic)


def beyond_sides(fields: int, shape: tuple[int, int, int]) -> F32:
    """Zeros (fields, nz, ny, BEYOND + nx + BEYOND + 1), for what `sun_sweep` gives and takes on a grid (nz, ny, nx)."""
    return np.zeros((fields, *shape[:2], shape[2] + 2 * BEYOND + 1), FLOAT)


def inside(fields: F32) -> F32:
    """What of the last axis is no `beyond_sides`."""
    return fields[..., BEYOND : -BEYOND - 1]


def weighted(extinction: F32, weights: F32, periodic: bool) -> F32:
    """Sums of species, ``extinction`` (ns, nz, ny, nx), a field for each row of ``weights`` (n, ns), as `sun_sweep`
    takes them."""
    out = beyond_sides(len(weights), (extinction.shape[1], extinction.shape[2], extinction.shape[3]))
    in_threads(_weigh, np.require(extinction, FLOAT, ["C", "W"]), np.array(weights, FLOAT), periodic, out)
    return out


def _stops(filled: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], list[int]]:
    """To which level nodes of each level follow their ray exactly; to which they just go; levels that end a gap."""
    top = len(filled) - 1
    levels = np.flatnonzero(filled)
    breaks = np.flatnonzero(np.diff(levels) > _GAP) + 1
    layers = [(int(part[0]), int(part[-1])) for part in np.split(levels, breaks) if part.size]
    gates = [max(first - 1, 0) for first, _ in layers]
    ends = [*gates[1:], min(int(levels[-1]) + 1, top)] if layers else []
    followed, passed = np.full(top + 1, top), np.minimum(np.arange(top + 1) + 1, top)
    for gate, (_, last), end in reversed(list(zip(gates, layers, ends, strict=True))):
        followed[: last + 1] = end
        passed[:gate] = gate
        passed[gate : last + 1] = np.arange(gate, last + 1) + 1
    return followed, np.minimum(passed, top), gates
