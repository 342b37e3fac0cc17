"""The sun's light in the grid: optical depth from every node to the sun, terrain shadows, direct transmission.

`sun` is the direction to the sun in each column's own axes. Grids are (nz, ny, nx), lengths in metres.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.pack import PACK, flat, put, read, spread, write
from openswim.transport.sample import sun_table_coordinate
from openswim.transport.scalar import shadow_fraction, table_index
from openswim.transport.threads import in_threads
from openswim.transport.volume import SHELL_TABLE_PER_M, SUN_RADIUS_RAD

if TYPE_CHECKING:
    from openswim.transport.medium import Medium

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_ALONG_PER_M = 1e-9  # cells per metre that a ray along a side may drift
_GAP = 3  # levels free of cloud that part one layer from another
_DARKEST, _MOST_AIR = 1e-12, np.float32(27.631)  # transmission, and its depth, that stand for none


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def _wrap(x, count, periodic):
    return x - math.floor(x / count) * count if periodic else x


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def _plane_value(plane, x, y, periodic):
    """Bilinear value at fractional (x, y); the caller has made sure that the point is inside."""
    ny, nx = plane.shape
    i = min(int(x), nx - 1)
    j = min(int(y), ny - 1)
    a = np.float32(x - i)
    b = np.float32(y - j)
    i1 = i + 1 if i + 1 < nx else (0 if periodic else i)
    j1 = j + 1 if j + 1 < ny else (0 if periodic else j)
    return (plane[j, i] * (_ONE - a) + plane[j, i1] * a) * (_ONE - b) + (
        plane[j1, i] * (_ONE - a) + plane[j1, i1] * a
    ) * b


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _pack_at(grid, level, x, y, c, periodic):
    """Pack at channel c of (nz, ny, nx, channels), bilinear at fractional (x, y) inside."""
    _, ny, nx, nc = grid.shape
    i, j = min(int(x), nx - 1), min(int(y), ny - 1)
    a, b = np.float32(x - i), np.float32(y - j)
    right, up = nc, nx * nc
    if i + 1 >= nx:
        right = -i * nc if periodic else 0
    if j + 1 >= ny:
        up = -j * nx * nc if periodic else 0
    n = ((level * ny + j) * nx + i) * nc + c
    low = read(grid, n)
    low += a * (read(grid, n + right) - low)
    high = read(grid, n + up)
    high += a * (read(grid, n + up + right) - high)
    return low + b * (high - low)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _way_up_m(mu, bend, rise_m):
    """Distance after which a ray has risen by so much."""
    root = math.sqrt(mu * mu + 4.0 * bend * rise_m)
    return 2.0 * rise_m / (mu + root) if mu > 0.0 else (root - mu) / (2.0 * bend)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, inline="always")
def _way_out(i, count, per_m):
    """Distance from node ``i`` of a row to its end, at so many cells per metre."""
    if abs(per_m) < _ALONG_PER_M:
        return 1e30
    return (count - 1 - i if per_m > 0.0 else i) / abs(per_m)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _depth_to_sun(
    extinction, depth, c, k, i, j, mu, vx, vy, last, filled, levels_m, level_origin_m, level_per_m, level_table,
    radius_m, periodic,
):  # fmt: skip
    """Optical depths from node (k, j, i) toward the sun up to level ``last``, then what is known there.

    Samples where the ray meets a level and, between levels, once a cell, until it leaves an open domain; ``vx``,
    ``vy``: cells per metre.
    """
    nz, ny, nx, nc = extinction.shape
    bend = (1.0 - mu * mu) / (2.0 * radius_m)
    fastest = max(abs(vx), abs(vy))
    leave = 1e30 if periodic else min(_way_out(i, nx, vx), _way_out(j, ny, vy))
    below = read(extinction, ((k * ny + j) * nx + i) * nc + c)
    total = spread(_ZERO)
    s, at = 0.0, k
    for level in range(k + 1, last + 1):
        if not (filled[level] or filled[level - 1]) and (mu > 0.0 or level > k + 1):
            continue
        if at < level - 1:
            s = min(_way_up_m(mu, bend, levels_m[level - 1] - levels_m[k]), leave)
        end = min(_way_up_m(mu, bend, levels_m[level] - levels_m[k]), leave)
        at = level
        count = int(fastest * (end - s)) + 1
        ds = (end - s) / count
        half = np.float32(0.5 * ds)
        for n in range(1, count + 1):
            s += ds
            x, y = _wrap(i + vx * s, nx, periodic), _wrap(j + vy * s, ny, periodic)
            if n == count and end < leave:
                here = _pack_at(extinction, level, x, y, c, periodic)
            else:
                fk = table_index(levels_m[k] + mu * s + bend * s * s, level_origin_m, level_per_m, level_table)
                m = min(int(fk), nz - 2)
                here = _pack_at(extinction, m, x, y, c, periodic)
                here += np.float32(fk - m) * (_pack_at(extinction, m + 1, x, y, c, periodic) - here)
            total += half * (below + here)
            below = here
        if end >= leave:
            return total
    if at < last:
        s = _way_up_m(mu, bend, levels_m[last] - levels_m[k])
        if s >= leave:
            return total
    x, y = _wrap(i + vx * s, nx, periodic), _wrap(j + vy * s, ny, periodic)
    return total + _pack_at(depth, last, x, y, c, periodic)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _row_to_sun(
    k, j, extinction, exact, followed, passed, filled, sun, levels_m, level_origin_m, level_per_m, level_table, cell_m,
    radius_m, periodic, depth,
):  # fmt: skip
    """The nodes of a row."""
    _, ny, nx, nc = extinction.shape
    for i in range(nx):
        last = followed[k] if exact[k, j, i] else passed[k]
        vx, vy = sun[j, i, 0] / cell_m[0], sun[j, i, 1] / cell_m[1]
        for c in range(0, nc, PACK):
            total = _depth_to_sun(
                extinction, depth, c, k, i, j, sun[j, i, 2], vx, vy, last, filled, levels_m, level_origin_m,
                level_per_m, level_table, radius_m, periodic,
            )  # fmt: skip
            write(depth, ((k * ny + j) * nx + i) * nc + c, total)


@njit(cache=True, error_model="numpy", nogil=True, fastmath=_FLAGS)
def _share_level(
    t, threads, k, extinction, exact, followed, passed, filled, sun, levels_m, level_origin_m, level_per_m,
    level_table, cell_m, radius_m, periodic, depth,
):  # fmt: skip
    """Thread t's rows of level k: see `sun_sweep`."""
    for j in range(t, exact.shape[1], threads):
        _row_to_sun(
            k, j, extinction, exact, followed, passed, filled, sun, levels_m, level_origin_m, level_per_m, level_table,
            cell_m, radius_m, periodic, depth,
        )  # fmt: skip


def sun_sweep(
    extinction: F32, exact: NDArray[np.bool_], sun: F64, levels_m: F64, lookup: tuple[float, float, F64], cell_m: F64,
    radius_m: float, periodic: bool,
) -> F32:  # fmt: skip
    """Optical depths (nz, ny, nx, channels) from every node to the sun; ``sun`` (ny, nx, 3) in each column's own axes.

    ``extinction``: as many channels, whole packs. Nodes marked ``exact`` follow their ray through the layer of cloud
    that they are in, or the next above, and read what lies beyond a gap on the level that ends it; the others go one
    level up and read there, which is cheap but blurs shadows by a cell per level. Handles any sun, also one below the
    horizon of a node on the curved Earth: the way up then starts downward.
    """
    filled = extinction.any(axis=(1, 2, 3))
    followed, passed, gates = _stops(filled)
    exact = exact.copy()
    exact[gates] = True
    depth = np.zeros(extinction.shape, np.float32)  # which touches no memory yet
    for k in range(len(levels_m) - 2, -1, -1):
        in_threads(
            _share_level, k, extinction, exact, followed, passed, filled, sun, levels_m, *lookup, cell_m, radius_m,
            periodic, depth,
        )  # fmt: skip
    return depth


def depths_to_sun(medium: Medium, weights: F32, exact: NDArray[np.bool_], local_sun: F64) -> F32:
    """`sun_sweep` of a medium (nz, ny, nx, n or more), for each row of ``weights`` (n, ns) of its species."""
    extinction = np.zeros((*medium.shape, -(-len(weights) // PACK) * PACK), np.float32)

    def weigh(t: int, threads: int) -> None:
        for k in range(t, len(extinction), threads):
            for n, row in enumerate(weights):
                for weight, species in zip(row, medium.extinction, strict=True):
                    extinction[k, ..., n] += weight * species[k]

    in_threads(weigh)
    return sun_sweep(
        extinction, exact, local_sun, medium.levels_m, medium.level_lookup, np.array(medium.cell_m, float),
        medium.frame.radius_m, medium.periodic,
    )  # fmt: skip


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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _shadow_row(j, terrain_m, sun, cell_m, radius_m, shadow_m, distance_m):
    """A row of nodes: see `shadow_rows`."""
    ny, nx = terrain_m.shape
    for i in range(nx):
        mu = sun[j, i, 2]
        sine = math.sqrt(max(1e-12, 1.0 - mu * mu))
        vx, vy = sun[j, i, 0] / sine / cell_m[0], sun[j, i, 1] / sine / cell_m[1]
        ds = 0.7 / max(abs(vx), abs(vy), 1e-9)
        highest = -1e9
        ridge = 0.0
        steps = int(1.5 * (nx + ny) / 0.7)
        for n in range(1, steps):
            s = n * ds
            x, y = i + vx * s, j + vy * s
            if x < 0.0 or y < 0.0 or x > nx - 1.0 or y > ny - 1.0:
                break
            h = _plane_value(terrain_m, x, y, False) - s * mu / sine - s * s / (2.0 * radius_m)
            if h > highest:
                highest = h
                ridge = s
        shadow_m[j, i] = highest
        distance_m[j, i] = ridge


@njit(cache=True, error_model="numpy", nogil=True, fastmath=_FLAGS)
def shadow_rows(t, threads, terrain_m, sun, cell_m, radius_m, shadow_m, distance_m):
    """Height (ny, nx) up to which the terrain of an open domain hides the sun, and the distance of the ridge."""
    for j in range(t, terrain_m.shape[0], threads):
        _shadow_row(j, terrain_m, sun, cell_m, radius_m, shadow_m, distance_m)


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def shell_transmission(height_m, mu_sun, w, shells):
    """Delta-scaled transmission of the shells from the sun to a height (m above sea level), at wavelength w."""
    above = max(height_m - shells.ground_m, 0.0)
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    k = min(int(level), shells.rows.shape[0] - 2)
    c = level - k
    ratio = (shells.radius_m + shells.ground_m) / (shells.radius_m + shells.ground_m + above)
    mu_horizon = -math.sqrt(max(0.0, 1.0 - ratio * ratio))
    lit = shadow_fraction(mu_sun, mu_horizon, SUN_RADIUS_RAD)
    if lit <= 0.0:
        return 0.0
    t = sun_table_coordinate(mu_sun, mu_horizon, shells.slant.shape[1])
    m = int(t)
    e = t - m
    d = shells.slant
    depth = (d[k, m, w] * (1 - e) + d[k, m + 1, w] * e) * (1 - c) + (
        d[k + 1, m, w] * (1 - e) + d[k + 1, m + 1, w] * e
    ) * c
    return lit * math.exp(-depth)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _beam_row(k, j, depth, lanes, sun, levels_m, shadow_m, distance_m, count, shells, beams, fields):
    """The nodes of a row: see `direct_beam`."""
    nz, ny, nx, nc = depth.shape
    above = max(levels_m[k] - shells.ground_m, 0.0)
    level = table_index(above, 0.0, SHELL_TABLE_PER_M, shells.level_table)
    row = min(int(level), shells.rows.shape[0] - 2)
    c = np.float32(level - row)
    ratio = (shells.radius_m + shells.ground_m) / (shells.radius_m + shells.ground_m + above)
    mu_horizon = -math.sqrt(max(0.0, 1.0 - ratio * ratio))
    softness = levels_m[min(k + 1, nz - 1)] - levels_m[max(k - 1, 0)]
    columns = shells.slant.shape[1]
    for i in range(nx):
        mu = sun[j, i, 2]
        lit = lit_fraction(levels_m[k], shadow_m[j, i], distance_m[j, i], softness)
        lit *= shadow_fraction(mu, mu_horizon, SUN_RADIUS_RAD)
        t = sun_table_coordinate(mu, mu_horizon, columns)
        m = int(t)
        e = np.float32(t - m)
        n = (row * columns + m) * 2 * PACK
        up = columns * 2 * PACK
        near, far = read(shells.slant, n), read(shells.slant, n + up)
        near += e * (read(shells.slant, n + 2 * PACK) - near)
        far += e * (read(shells.slant, n + up + 2 * PACK) - far)
        node = (k * ny + j) * nx + i
        place = node * fields.shape[3]
        air = near + c * (far - near)
        if lit < 1.0:
            air += np.float32(-math.log(max(lit, _DARKEST)))
        write(fields, place, air)
        for w in range(PACK):
            total = min(flat(fields, place + w), _MOST_AIR) + flat(depth, node * nc + lanes[min(w, count - 1)])
            root = math.exp(-0.5 * total)
            put(fields, place + w, root)
            if w < count:
                beams[w, k, j, i] = root * root


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _ground_row(j, depth, lanes, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface):
    """The ground under a row: see `direct_beam`."""
    nz, _, nx, _ = depth.shape
    for i in range(nx):
        ground = terrain_m[j, i]
        k = 0
        while k < nz and levels_m[k] < ground:
            k += 1
        before = max(k - 1, 0)
        lit = lit_fraction(ground, shadow_m[j, i], distance_m[j, i], 20.0)
        for w in range(count):
            total = np.float32(0.0)
            if k < nz:
                span = levels_m[k] - levels_m[before]
                c = (levels_m[k] - ground) / span if span > 0.0 else 0.0
                total = depth[k, j, i, lanes[w]] * (1 - c) + depth[before, j, i, lanes[w]] * c
            surface[w, j, i] = lit * shell_transmission(ground, sun[j, i, 2], w, shells) * math.exp(-total)


@njit(cache=True, error_model="numpy", nogil=True, fastmath=_FLAGS)
def direct_beam(
    t, threads, depth, lanes, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, beams, surface, fields
):  # fmt: skip
    """Direct transmission at the first ``count`` wavelengths at every node, ``beams`` (count, nz, ny, nx), and at the
    ground, ``surface`` (count, ny, nx); its root at every node into fields[..., :PACK].

    Between nodes the beam lies between a straight line and the exponential of one, since extinction changes there too;
    so does the square of its root.

    ``depth``: see `sun_sweep`; ``lanes`` (PACK,): which of its channels a wavelength reads.
    """
    nz, ny = depth.shape[:2]
    for j in range(t, ny, threads):
        for k in range(nz):
            _beam_row(k, j, depth, lanes, sun, levels_m, shadow_m, distance_m, count, shells, beams, fields)
        _ground_row(j, depth, lanes, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface)


@njit(cache=True, error_model="numpy", nogil=True, fastmath=_FLAGS)
def ground_beam(
    t, threads, depth, lanes, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface
):  # fmt: skip
    """Direct transmission ``surface`` at the ground alone: see `direct_beam`."""
    for j in range(t, depth.shape[1], threads):
        _ground_row(j, depth, lanes, sun, levels_m, terrain_m, shadow_m, distance_m, count, shells, surface)


@njit(cache=True, error_model="numpy", fastmath=_FLAGS, inline="always")
def lit_fraction(height_m, shadow_m, distance_m, softness_m):
    """Share of the sun seen above a ridge: penumbra of the disc, at least ``softness_m`` wide."""
    width = max(softness_m, 2.0 * SUN_RADIUS_RAD * distance_m)
    return min(1.0, max(0.0, 1.0 - (shadow_m - height_m) / width))
