"""Every column of a grid by itself, in parts as thin as its light asks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.columns.integrated import WAYS, pass_parts, scatter_integrated
from openswim.transport.columns.shown import fill_sources, show_cells
from openswim.transport.columns.spherical_harmonics import (
    LOOKS,
    MODES,
    Ends,
    Places,
    back,
    direction,
    eliminate,
    ground_start,
)
from openswim.transport.engine.compiled import FINITE, kernel, part
from openswim.transport.engine.eye_ways import way_from_eye
from openswim.transport.engine.pack import (
    LANES,
    choose_above,
    flat,
    largest,
    put,
    read_quadruple,
    spread_quadruple,
    write,
)
from openswim.transport.engine.scalar import table_index, transmission
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import DEGREE

MOST_PARTS = 12  # of a cell
_PART_DEPTH = FLOAT(0.8)  # delta-scaled optical depth of a part
_PART_BEAM = FLOAT(0.3)  # share of sunlight that is lost in a part
_ENDLESS = 1e30  # way of a sunbeam that enters by no open side
_DARKEST = FLOAT(1e-30)  # root of a beam that stands for none
_ZERO, _HALF, _ONE, _TWO = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0), FLOAT(2.0)

F32 = NDArray[np.float32]


class Bounds(NamedTuple):
    """What columns (ny, nx) have at their ground, their top and their sides, at ``count`` wavelengths."""

    ground_node: NDArray[np.int64]  # (ny, nx) lowest level not under the ground
    sun: F32  # (ny, 3, nx) toward it, in the columns' axes
    mu_sun: NDArray[np.float64]  # (ny, nx)
    albedo: F32  # (count, ny, nx)
    direct: F32  # (count, ny, nx) the beam's flux on level ground
    inflow: F32  # (count, suns, 2) light from above the grid, see `columns.top_light`
    lacking: F32  # (count, nz, suns, ways) 1/m, see `what_clear_air_lacks`
    sun_table: NDArray[np.float64]  # fractional index into these suns, by cosine from -1 to 1
    half_m: NDArray[np.float64]  # (2, 2) of x and y, below and above: what cells at open sides have beyond their nodes


class Wanted(NamedTuple):
    """What is asked of columns."""

    count: int  # wavelengths
    seen: bool  # whether an eye is to see them, or fluxes alone are wanted
    once: bool  # whether sources hold what is scattered but once
    part: NDArray[np.int64]  # (2, 2) rows and columns from and to which it is wanted, and maybe a few more


class Found(NamedTuple):
    """Where what is asked goes."""

    fields: F32  # (nz, ny, nx, channels) `Volume.fields`: the beam's roots are read, the source channels filled in
    down: F32  # (count, ny, nx) diffuse flux at the ground
    up: F32  # (count, ny, nx) flux at the top


@part(FINITE, inlined=True)
def _write_legendre(cosine, out, at):
    """(2l+1) P_l (DEGREE, LANES) of cosines, from flat element ``at`` of ``out`` on."""
    p0, p1 = spread_quadruple(_ONE), cosine
    for ell in range(DEGREE):
        write(out, at + ell * LANES, FLOAT(2 * ell + 1) * p0)
        up = (FLOAT((2 * ell + 3) / (ell + 2)) * cosine) * p1 - FLOAT((ell + 1) / (ell + 2)) * p0
        p0, p1 = p1, up


@part(FINITE)
def _looks(j, i, levels_m, sun, eye, looks, phases, slopes):
    """Of the way to the eye at every level: weights of the moments (nz, LOOKS, LOOKS), (2l+1) P_l of the angle from
    the sun (nz, DEGREE), and the cosine upward (nz), for LANES columns."""
    nx = sun.shape[2]
    s = j * 3 * nx + i
    sx, sy, sz = read_quadruple(sun, s), read_quadruple(sun, s + nx), read_quadruple(sun, s + 2 * nx)
    for k in range(levels_m.shape[0]):
        x, y, z = way_from_eye(j, i, FLOAT(levels_m[k]), eye)
        along = x * sx + y * sy  # sines of both zenith angles, times the cosine between azimuths
        _write_legendre(along + z * sz, phases, k * DEGREE * LANES)
        write(slopes, k * LANES, _ZERO - z)
        sines = (_ONE - z * z) * (_ONE - sz * sz)
        turn, next_turn = spread_quadruple(_ONE), along  # sines^m cos(m azimuth)
        for m in range(LOOKS):
            n = (k * LOOKS + m) * LOOKS * LANES
            direction(m, _ZERO - z, n, looks)
            for ell in range(m, DEGREE):
                at = n + (ell - m) * LANES
                write(looks, at, FLOAT((2 * ell + 1) * min(m + 1, 2)) * turn * read_quadruple(looks, at))
            turn, next_turn = next_turn, _TWO * along * next_turn - sines * turn


@part(FINITE)
def _nodes(w, j, i, scatterers, phases, with_once, fields, nodes):
    """At every level (nz, DEGREE + 3) extinction and moments of scattering, air's too, what the species scatter of the
    beam toward the eye, and the depth to the sun, at LANES nodes and wavelength w."""
    extinction, scaled, scattering = scatterers.extinction, scatterers.scaled, scatterers.scattering
    ns, nz, ny, nx = extinction.shape
    channels = fields.shape[3]
    for k in range(nz):
        out = k * (DEGREE + 3) * LANES
        node = (k * ny + j) * nx + i
        total = spread_quadruple(scatterers.air_extinction[w, k])
        for s in range(ns):
            total += scaled[w, s] * read_quadruple(extinction, s * nz * ny * nx + node)
        write(nodes, out, total)
        once = spread_quadruple(_ZERO)
        for ell in range(DEGREE):
            sigma = spread_quadruple(_ZERO)
            for s in range(ns):
                sigma += scattering[w, s, ell] * read_quadruple(extinction, s * nz * ny * nx + node)
            if with_once:
                once += sigma * read_quadruple(phases, (k * DEGREE + ell) * LANES)
            write(nodes, out + (1 + ell) * LANES, sigma + scatterers.air_scattering[w, k, ell])
        write(nodes, out + (DEGREE + 1) * LANES, once)
        for n in range(LANES):
            root_of_beam = max(flat(fields, (node + n) * channels + w), _DARKEST)
            put(nodes, out + (DEGREE + 2) * LANES + n, FLOAT(-2.0 * math.log(root_of_beam)))


@part(FINITE)
def _shade_sides(j, i, ny, nx, levels_m, clear, sun, half_m, nodes):
    """Depths to the sun of columns through whose open side it shines: the cell goes on there for half its width, or its
    whole depth would scatter a beam that a little of it takes. ``clear``: extinction of the air (nz,)."""
    nz = levels_m.shape[0]
    apart = (DEGREE + 3) * LANES
    for n in range(LANES):
        x, y, z = sun[j, 0, i + n], sun[j, 1, i + n], sun[j, 2, i + n]
        way = _ENDLESS
        if (i + n == 0 and x < 0.0) or (i + n == nx - 1 and x > 0.0):
            half = half_m[0, 1 if x > 0.0 else 0]
            if half > 0.0:
                way = half / abs(x)
        if (j == 0 and y < 0.0) or (j == ny - 1 and y > 0.0):
            half = half_m[1, 1 if y > 0.0 else 0]
            if half > 0.0:
                way = min(way, half / abs(y))
        if way == _ENDLESS or z <= 0.0:
            continue
        for k in range(nz):
            height, end, depth = levels_m[k], levels_m[k] + way * z, 0.0
            own = flat(nodes, k * apart + n) - clear[k]
            for m in range(k, nz - 1):
                up = min(levels_m[m + 1], end)
                share = (up - levels_m[m]) / (levels_m[m + 1] - levels_m[m])
                low, high = flat(nodes, m * apart + n) - clear[m], flat(nodes, (m + 1) * apart + n) - clear[m + 1]
                at_end = low + share * (high - low)
                depth += 0.5 * (own + at_end) * (up - height) / z
                if up == end:
                    break
                own, height = at_end, up
            at = k * apart + (DEGREE + 2) * LANES + n
            put(nodes, at, flat(nodes, at) + FLOAT(depth))


@part(FINITE)
def _count_parts(nodes, levels_m, parts):
    """Into how many parts each cell (nz - 1) is divided, and how many places there are."""
    count = 1
    for k in range(levels_m.shape[0] - 1):
        a = k * (DEGREE + 3) * LANES
        mean = _HALF * (read_quadruple(nodes, a) + read_quadruple(nodes, a + (DEGREE + 3) * LANES))
        depth = largest(mean) * FLOAT(levels_m[k + 1] - levels_m[k])
        low = transmission(read_quadruple(nodes, a + (DEGREE + 2) * LANES))
        up = transmission(read_quadruple(nodes, a + (2 * DEGREE + 5) * LANES))
        count_of_cell = max(depth / _PART_DEPTH, largest(up - low) / _PART_BEAM)
        parts[k] = max(1, min(MOST_PARTS, int(np.ceil(count_of_cell))))
        count += parts[k]
    return count


@part(FINITE)
def _place_at(s, k, share, nodes, places):
    """Place s between levels k and k + 1: extinction and scattering, depth to the sun, light scattered once."""
    a = k * (DEGREE + 3) * LANES
    b = a + (DEGREE + 3) * LANES
    for c in range(DEGREE + 1):
        low, up = read_quadruple(nodes, a + c * LANES), read_quadruple(nodes, b + c * LANES)
        write(places.medium, (s * (DEGREE + 1) + c) * LANES, low + share * (up - low))
    low, up = read_quadruple(nodes, a), read_quadruple(nodes, b)
    # the way to the sun goes on through this cloud: its depth grows as the column's own does
    below = share * (low + (_HALF * share) * (up - low)) / (_HALF * (low + up) + FLOAT(1e-12))
    low, up = read_quadruple(nodes, a + (DEGREE + 2) * LANES), read_quadruple(nodes, b + (DEGREE + 2) * LANES)
    depth = low + below * (up - low)
    write(places.sunlit, s * LANES, depth)
    low, up = read_quadruple(nodes, a + (DEGREE + 1) * LANES), read_quadruple(nodes, b + (DEGREE + 1) * LANES)
    write(places.source, s * LANES, (low + share * (up - low)) * transmission(depth))
    write(places.bend, s * LANES, spread_quadruple(_ZERO))


@part(FINITE)
def _fill_places(nodes, levels_m, parts, places):
    """`Places` of every cell in its parts. With depths to the sun t_1 >= t_2 at a part's ends the mean beam in it is
    e^-t_2 (1 - e^-(t_1 - t_2))/(t_1 - t_2). Returns the number of places."""
    nz = levels_m.shape[0]
    s = np.int64(0)
    for k in range(nz - 1):
        for p in range(parts[k]):
            share = FLOAT(p) / FLOAT(parts[k])
            put(places.thick_m, s, FLOAT((levels_m[k + 1] - levels_m[k]) / parts[k]))
            put(places.level, s, FLOAT(k) + share)
            put(places.below, s, FLOAT(k))
            _place_at(s, k, share, nodes, places)
            s += 1
    put(places.level, s, FLOAT(nz - 1))
    put(places.below, s, FLOAT(nz - 1))
    _place_at(s, nz - 2, _ONE, nodes, places)
    for p in range(s):
        low, up = read_quadruple(places.sunlit, p * LANES), read_quadruple(places.sunlit, (p + 1) * LANES)
        difference = choose_above(low, up, low - up, up - low)
        mean = choose_above(
            difference, FLOAT(0.01), (_ONE - transmission(difference)) / difference, _ONE - _HALF * difference
        )
        write(places.beam, p * LANES, mean * transmission(choose_above(low, up, up, low)))
    return s + 1


@part(FINITE, inlined=True)
def _lacking(w, k, m, share, cosine, lacking):
    """What the air of a column lacks along a way of this zenith cosine, between suns m and m + 1."""
    suns, ways = lacking.shape[2], lacking.shape[3]
    at = FLOAT(0.5 * (ways - 1)) * (_ONE + min(max(cosine, -_ONE), _ONE))
    z = min(int(at), ways - 2)
    n = ((w * lacking.shape[1] + k) * suns + m) * ways + z
    part = at - FLOAT(z)
    near = flat(lacking, n) + part * (flat(lacking, n + 1) - flat(lacking, n))
    far = flat(lacking, n + ways) + part * (flat(lacking, n + ways + 1) - flat(lacking, n + ways))
    return near + share * (far - near)


@kernel(FINITE)
def column_light(t, threads, scatterers, bounds, tables, eye, wanted, found):
    """Light of every column, and the smooth source toward one eye at its nodes, into fields[..., PACK:2 PACK].

    In each Fourier mode m about the sun's azimuth P3's equations for the moments L_l (`spherical_harmonics.py`) of

        mu dL/dz + beta' L = sum_l (2l+1) sigma_l P_l(mu) [L_l + P_l(mu_sun) b],    b = e^-(depth to the sun),

    are eliminated from the ground up and solved back down, cell by cell in parts as thin as the light asks; what they
    scatter toward the eye is the source S = sum_m sum_l (2l+1) sigma_l Y_l^m(eye) L_l^m, with L_l^m of light that is
    integrated along slanted ways (`integrated.py`), and ``wanted.once`` adds that of the beam. The shapes are those of
    `Scatterers`, `Bounds`, `Eye`, `Wanted`, `Found`; ``tables``: `mode_tables`.
    nx >= LANES. See `source_function.view_source`.
    """
    _, nz, ny, nx = scatterers.extinction.shape
    # once for all: asked for in loops, a tuple's arrays have their references counted, by threads in turn
    levels_m, air_extinction, part = scatterers.levels_m, scatterers.air_extinction, wanted.part
    ground_node, sun, mu_sun, half_m = bounds.ground_node, bounds.sun, bounds.mu_sun, bounds.half_m
    albedo, direct, inflow, lacking = bounds.albedo, bounds.direct, bounds.inflow, bounds.lacking
    sun_table = bounds.sun_table
    per_cosine = 0.5 * (sun_table.shape[0] - 1)
    fields, down, up, count = found.fields, found.down, found.up, wanted.count
    most = nz * MOST_PARTS + 1
    nodes = np.empty(nz * (DEGREE + 3) * LANES, FLOAT)
    places = Places(
        np.empty(most, FLOAT), np.empty(most, FLOAT), np.empty(most, FLOAT),
        np.empty(most * (DEGREE + 1) * LANES, FLOAT), np.empty(most * LANES, FLOAT), np.empty(most * LANES, FLOAT),
        np.empty(most * LANES, FLOAT), np.empty(most * LANES, FLOAT),
    )  # fmt: skip
    ground, start = np.empty(3 * LANES, FLOAT), np.empty(6 * LANES, FLOAT)
    above, flux = np.empty(2 * LANES, FLOAT), np.zeros(2 * LANES, FLOAT)
    ends = Ends(ground, start, above, flux)
    rows, lit = np.empty(most * 6 * LANES, FLOAT), np.zeros(LOOKS * LOOKS * LANES, FLOAT)
    passed, ways = np.empty(most * WAYS * 2 * LANES, FLOAT), np.empty(most * WAYS * 2 * LANES, FLOAT)
    work = np.empty((2 * WAYS + LOOKS) * LANES, FLOAT)
    looks, phases = np.empty(nz * LOOKS * LOOKS * LANES, FLOAT), np.empty(nz * DEGREE * LANES, FLOAT)
    missing, slopes = np.empty(nz * LANES, FLOAT), np.empty(nz * LANES, FLOAT)
    read, shown = np.empty(4 * LANES, FLOAT), np.empty(nz * LANES, FLOAT)
    parts = np.empty(nz, np.int64)
    for j in range(part[0, 0] + t, part[0, 1], threads):
        for column in range(part[1, 0], part[1, 1], LANES):
            i = min(column, nx - LANES)
            some_above = some_below = False
            if wanted.seen:
                _looks(j, i, levels_m, sun, eye, looks, phases, slopes)
                for k in range(nz):
                    slope = read_quadruple(slopes, k * LANES)
                    some_above |= largest(slope) > _ZERO
                    some_below |= largest(_ZERO - slope) >= _ZERO
            for m in range(LOOKS):
                direction(m, _ZERO - read_quadruple(sun, (j * 3 + 2) * nx + i), m * LOOKS * LANES, lit)
            least = nz
            for n in range(LANES):
                put(ground, n, FLOAT(ground_node[j, i + n]))
                least = min(least, ground_node[j, i + n])
            for w in range(count):
                _nodes(w, j, i, scatterers, phases, wanted.seen and wanted.once, fields, nodes)
                if half_m[0, 0] + half_m[0, 1] + half_m[1, 0] + half_m[1, 1] > 0.0:
                    _shade_sides(j, i, ny, nx, levels_m, air_extinction[w], sun, half_m, nodes)
                if w == 0:
                    _count_parts(nodes, levels_m, parts)
                last = _fill_places(nodes, levels_m, parts, places)
                first = np.int64(0)  # a literal is a type of its own, for which Numba compiles once more
                for k in range(min(least, nz - 1)):
                    first += parts[k]
                for n in range(LANES):
                    put(ground, LANES + n, albedo[w, j, i + n])
                    put(ground, 2 * LANES + n, direct[w, j, i + n])
                    at = table_index(mu_sun[j, i + n], -1.0, per_cosine, sun_table)
                    m = min(int(at), inflow.shape[1] - 2)
                    for k in range(nz if wanted.seen else 0):
                        cosine = -flat(slopes, k * LANES + n)
                        put(missing, k * LANES + n, _lacking(w, k, m, FLOAT(at - m), cosine, lacking))
                    for c in range(2):
                        low = inflow[w, m, c]
                        put(above, c * LANES + n, FLOAT(low + (at - m) * (inflow[w, m + 1, c] - low)))
                if wanted.seen:
                    pass_parts(first, last, places, ends, passed)
                for m in range(LOOKS if wanted.seen else 1):  # fluxes are of the first
                    if m < MODES:
                        ground_start(m, tables, ground, start)
                        if m > 0:
                            write(start, 4 * LANES, spread_quadruple(_ZERO))
                            write(start, 5 * LANES, spread_quadruple(_ZERO))
                        eliminate(m, first, last, tables, places, lit, ends, rows)
                        back(m, first, last, tables, places, lit, ends, rows)
                    if wanted.seen:
                        scatter_integrated(m, first, last, places, lit, ends, rows, passed, looks, ways, work)
                for n in range(LANES):
                    down[w, j, i + n], up[w, j, i + n] = flat(flux, n), flat(flux, LANES + n)
                if some_above:
                    show_cells(True, parts, places, slopes, read, shown)
                if some_below:
                    show_cells(False, parts, places, slopes, read, shown)
                if wanted.seen:
                    fill_sources(w, count, j, i, missing, shown, fields)
