"""Every column of a grid by itself: in parts as thin as its light asks, and what the eye is to see of its cells."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from openswim.transport.columns.spherical_harmonics import MODES, ORDERS, back, direction, eliminate, ground_start
from openswim.transport.engine.eye_ways import way_to_eye
from openswim.transport.engine.pack import (
    LANES,
    PACK,
    choose_above,
    flat,
    largest,
    put,
    read_quadruple,
    spread_quadruple,
    write,
)
from openswim.transport.engine.scalar import step_emission, transmission
from openswim.transport.march.volume import DEGREE

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}

MOST_PARTS = 12  # of a cell
_PART_DEPTH = np.float32(0.8)  # delta-scaled optical depth of a part
_ENDLESS = 1e30  # way of a sunbeam that enters by no open side
_DARKEST = np.float32(1e-30)  # root of a beam that stands for none
_MOST, _LEAST = np.float32(4.0), np.float32(0.25)  # of a node's source, that the eye may be shown in its place
_ZERO, _HALF, _ONE, _TWO = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _write_legendre(cosine, out, at):
    """(2l+1) P_l (DEGREE, LANES) of cosines, from flat element ``at`` of ``out`` on."""
    p0, p1 = spread_quadruple(_ONE), cosine
    for ell in range(DEGREE):
        write(out, at + ell * LANES, np.float32(2 * ell + 1) * p0)
        up = (np.float32((2 * ell + 3) / (ell + 2)) * cosine) * p1 - np.float32((ell + 1) / (ell + 2)) * p0
        p0, p1 = p1, up


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _looks(j, i, levels_m, columns, sun, eye, parallel, looks, phases, slopes):
    """Of the way to the eye at every level: weights of the moments (nz, MODES, ORDERS), (2l+1) P_l of the angle from
    the sun (nz, DEGREE), and the cosine upward (nz), for LANES columns."""
    nx = columns.shape[2]
    c = j * 12 * nx + i
    s = j * 3 * nx + i
    sx, sy, sz = read_quadruple(sun, s), read_quadruple(sun, s + nx), read_quadruple(sun, s + 2 * nx)
    for k in range(levels_m.shape[0]):
        _, _, _, x, y, z = way_to_eye(c, nx, columns, np.float32(levels_m[k]), eye, parallel)
        along = x * sx + y * sy  # sines of both zenith angles, times the cosine between azimuths
        _write_legendre(along + z * sz, phases, k * DEGREE * LANES)
        write(slopes, k * LANES, _ZERO - z)
        for m in range(MODES):
            n = (k * MODES + m) * ORDERS * LANES
            direction(m, _ZERO - z, n, looks)
            turn = spread_quadruple(_ONE)
            if m == 1:
                turn = _TWO * along
            elif m == 2:
                turn = _TWO * (_TWO * along * along - (_ONE - z * z) * (_ONE - sz * sz))
            for ell in range(m, m + ORDERS):
                at = n + (ell - m) * LANES
                write(looks, at, np.float32(2 * ell + 1) * turn * read_quadruple(looks, at))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _nodes(w, j, i, extinction, scaled, scattering, air_extinction, air_scattering, phases, with_once, fields, nodes):
    """At every level (nz, DEGREE + 3) extinction and moments of scattering, air's too, what the species scatter of the
    beam toward the eye, and the depth to the sun, at LANES nodes and wavelength w."""
    ns, nz, ny, nx = extinction.shape
    channels = fields.shape[3]
    for k in range(nz):
        out = k * (DEGREE + 3) * LANES
        node = (k * ny + j) * nx + i
        total = spread_quadruple(air_extinction[w, k])
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
            write(nodes, out + (1 + ell) * LANES, sigma + air_scattering[w, k, ell])
        write(nodes, out + (DEGREE + 1) * LANES, once)
        for n in range(LANES):
            root_of_beam = max(flat(fields, (node + n) * channels + w), _DARKEST)
            put(nodes, out + (DEGREE + 2) * LANES + n, np.float32(-2.0 * math.log(root_of_beam)))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _shade_sides(j, i, ny, nx, levels_m, clear, sun, half_m, nodes):
    """Depths to the sun of columns through whose open side it shines: the cell goes on there for half its width, or its
    whole depth would scatter a beam that a little of it takes. ``clear``: extinction of the air (nz,)."""
    nz = levels_m.shape[0]
    apart = (DEGREE + 3) * LANES
    for n in range(LANES):
        x, y, z = sun[j, 0, i + n], sun[j, 1, i + n], sun[j, 2, i + n]
        way = _ENDLESS
        if (i + n == 0 and x < 0.0) or (i + n == nx - 1 and x > 0.0):
            way = half_m[0] / abs(x)
        if (j == 0 and y < 0.0) or (j == ny - 1 and y > 0.0):
            way = min(way, half_m[1] / abs(y))
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
            put(nodes, at, flat(nodes, at) + np.float32(depth))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _count_parts(nodes, levels_m, parts):
    """Into how many parts each cell (nz - 1) is divided, and how many places there are."""
    count = 1
    for k in range(levels_m.shape[0] - 1):
        a = k * (DEGREE + 3) * LANES
        mean = _HALF * (read_quadruple(nodes, a) + read_quadruple(nodes, a + (DEGREE + 3) * LANES))
        depth = largest(mean) * np.float32(levels_m[k + 1] - levels_m[k])
        parts[k] = max(1, min(MOST_PARTS, int(np.ceil(depth / _PART_DEPTH))))
        count += parts[k]
    return count


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _place_at(s, k, share, nodes, medium, sunlit, source):
    """Place s between levels k and k + 1: extinction and scattering, depth to the sun, light scattered once."""
    a = k * (DEGREE + 3) * LANES
    b = a + (DEGREE + 3) * LANES
    for c in range(DEGREE + 1):
        low, up = read_quadruple(nodes, a + c * LANES), read_quadruple(nodes, b + c * LANES)
        write(medium, (s * (DEGREE + 1) + c) * LANES, low + share * (up - low))
    low, up = read_quadruple(nodes, a), read_quadruple(nodes, b)
    # the way to the sun goes on through this cloud: its depth grows as the column's own does
    below = share * (low + (_HALF * share) * (up - low)) / (_HALF * (low + up) + np.float32(1e-12))
    low, up = read_quadruple(nodes, a + (DEGREE + 2) * LANES), read_quadruple(nodes, b + (DEGREE + 2) * LANES)
    depth = low + below * (up - low)
    write(sunlit, s * LANES, depth)
    low, up = read_quadruple(nodes, a + (DEGREE + 1) * LANES), read_quadruple(nodes, b + (DEGREE + 1) * LANES)
    write(source, s * LANES, (low + share * (up - low)) * transmission(depth))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _places(nodes, levels_m, parts, thick, node, below, medium, sunlit, light, source):
    """Every cell in its parts; ``light``: the mean beam in each. Returns the number of places."""
    nz = levels_m.shape[0]
    s = 0
    for k in range(nz - 1):
        for p in range(parts[k]):
            share = np.float32(p) / np.float32(parts[k])
            put(thick, s, np.float32((levels_m[k + 1] - levels_m[k]) / parts[k]))
            put(node, s, np.float32(k) + share)
            put(below, s, np.float32(k))
            _place_at(s, k, share, nodes, medium, sunlit, source)
            s += 1
    put(node, s, np.float32(nz - 1))
    put(below, s, np.float32(nz - 1))
    _place_at(s, nz - 2, _ONE, nodes, medium, sunlit, source)
    for p in range(s):
        low, up = read_quadruple(sunlit, p * LANES), read_quadruple(sunlit, (p + 1) * LANES)
        difference = choose_above(low, up, low - up, up - low)
        mean = choose_above(
            difference, np.float32(0.01), (_ONE - transmission(difference)) / difference, _ONE - _HALF * difference
        )
        write(light, p * LANES, mean * transmission(choose_above(low, up, up, low)))
    return s + 1


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _lacking(w, k, m, share, cosine, lacking):
    """What the air of a column lacks along a way of this zenith cosine, between suns m and m + 1."""
    suns, ways = lacking.shape[2], lacking.shape[3]
    at = np.float32(0.5 * (ways - 1)) * (_ONE + min(max(cosine, -_ONE), _ONE))
    z = min(int(at), ways - 2)
    n = ((w * lacking.shape[1] + k) * suns + m) * ways + z
    part = at - np.float32(z)
    near = flat(lacking, n) + part * (flat(lacking, n + 1) - flat(lacking, n))
    far = flat(lacking, n + ways) + part * (flat(lacking, n + ways + 1) - flat(lacking, n + ways))
    return near + share * (far - near)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _seen(w, count, j, i, levels_m, parts, thick, medium, source, slopes, missing, fields):
    """Into the fields each node's source: its own, or in thick cells what makes the eye, which takes it as linear to
    the next node, see what the parts send up."""
    nz, ny, nx = fields.shape[:3]
    channels = fields.shape[3]
    last = 0
    for k in range(nz - 1):
        last += parts[k]
    shown = read_quadruple(source, last * LANES)
    for k in range(nz - 1, -1, -1):
        if k < nz - 1:
            first = last - parts[k]
            own = read_quadruple(source, first * LANES)
            if parts[k] == 1:
                shown = own
            else:
                slope = read_quadruple(slopes, k * LANES)
                slope = choose_above(slope, _ZERO, slope, _ZERO - slope)
                stretch = _ONE / choose_above(slope, np.float32(0.15), slope, np.float32(0.15))
                through, real = spread_quadruple(_ONE), spread_quadruple(_ZERO)
                near, far = spread_quadruple(_ZERO), spread_quadruple(_ZERO)
                part = _ONE / np.float32(parts[k])
                for p in range(parts[k] - 1, -1, -1):
                    s = first + p
                    length = stretch * flat(thick, s)
                    up, low = read_quadruple(medium, (s + 1) * (DEGREE + 1) * LANES), read_quadruple(
                        medium, s * (DEGREE + 1) * LANES
                    )
                    depth = _HALF * (up + low) * length
                    trans = transmission(depth)
                    real += through * step_emission(
                        depth, trans, length, read_quadruple(source, (s + 1) * LANES),
                        read_quadruple(source, s * LANES), up, low,
                    )  # fmt: skip
                    upper, lower = np.float32(p + 1) * part, np.float32(p) * part
                    near += through * step_emission(
                        depth, trans, length, spread_quadruple(upper), spread_quadruple(lower), up, low
                    )
                    far += through * step_emission(
                        depth, trans, length, spread_quadruple(_ONE - upper), spread_quadruple(_ONE - lower), up, low
                    )
                    through *= trans
                wanted = (real - near * shown) / (far + np.float32(1e-20))
                most, least = _MOST * own, _LEAST * own
                wanted = choose_above(wanted, most, most, wanted)
                wanted = choose_above(least, wanted, least, wanted)
                shown = choose_above(read_quadruple(slopes, k * LANES), _ZERO, wanted, own)
            last = first
        place = ((k * ny + j) * nx + i) * channels + PACK + w
        write(slopes, nz * LANES, shown + read_quadruple(missing, k * LANES))
        for n in range(LANES):
            value = flat(slopes, nz * LANES + n)
            put(fields, place + n * channels, value)
            for other in range(w + 1, PACK if w == count - 1 else w + 1):
                put(fields, place + n * channels + other - w, value)


@njit(cache=True, error_model="numpy", nogil=True, fastmath=_FLAGS)
def column_light(
    t, threads, extinction, scaled, scattering, air_extinction, air_scattering, levels_m, ground_node, sun, mu_sun,
    albedo, direct, inflow, lacking, tables, columns, half_m, eye, parallel, count, once, part, fields, down, up,
):  # fmt: skip
    """Light of every column, and the smooth source toward one eye at its nodes, into fields[..., PACK:2 PACK].

    ``once``: with what is scattered but once.

    At the first ``count`` wavelengths delta-scaled extinction and moments of scattering per extinction (ns, nz, ny, nx)
    of the species, ``scaled`` (count, ns) and ``scattering`` (count, ns, DEGREE), those of the air (count, nz) and
    (count, nz, DEGREE), 1/m; ``ground_node`` (ny, nx) lowest level not under the ground, ``sun`` (ny, 3, nx) in the
    columns' axes; ``albedo`` and the beam's flux ``direct`` at the ground (count, ny, nx), the light from above the
    grid ``inflow`` (count, suns, 2) as `columns.top_light` makes it, what clear air scatters beyond what is found here
    ``lacking`` (count, nz, suns, ways), 1/m, as `columns.lacking_source` finds it; fields[..., :count] holds the root
    of the beam; ``half_m`` (2,): what cells at open sides have of their width beyond the nodes. ``down``, ``up``
    (count, ny, nx): diffuse flux at the ground, flux at the top. ``part``: rows and columns (2, 2) from and to which it
    is wanted, and maybe a few more. nx >= LANES. See `eye_source.view_source`.
    """
    _, nz, ny, nx = extinction.shape
    most = nz * MOST_PARTS + 1
    f32 = np.float32
    nodes = np.empty(nz * (DEGREE + 3) * LANES, f32)
    medium = np.empty(most * (DEGREE + 1) * LANES, f32)
    sunlit, light, source = np.empty(most * LANES, f32), np.empty(most * LANES, f32), np.empty(most * LANES, f32)
    thick, node, below = np.empty(most, f32), np.empty(most, f32), np.empty(most, f32)
    rows, start = np.empty(most * 6 * LANES, f32), np.empty(6 * LANES, f32)
    looks, phases = np.empty(nz * MODES * ORDERS * LANES, f32), np.empty(nz * DEGREE * LANES, f32)
    missing = np.empty(nz * LANES, f32)
    slopes, lit = np.empty((nz + 1) * LANES, f32), np.empty(MODES * ORDERS * LANES, f32)
    ground, above, flux = np.empty(3 * LANES, f32), np.empty(2 * LANES, f32), np.zeros(2 * LANES, f32)
    parts = np.empty(nz, np.int64)
    for j in range(part[0, 0] + t, part[0, 1], threads):
        for block in range(part[1, 0] // LANES, (part[1, 1] + LANES - 1) // LANES):
            i = min(block * LANES, nx - LANES)
            _looks(j, i, levels_m, columns, sun, eye, parallel, looks, phases, slopes)
            for m in range(MODES):
                direction(m, _ZERO - read_quadruple(sun, (j * 3 + 2) * nx + i), m * ORDERS * LANES, lit)
            least = nz
            for n in range(LANES):
                put(ground, n, f32(ground_node[j, i + n]))
                least = min(least, ground_node[j, i + n])
            for w in range(count):
                _nodes(
                    w, j, i, extinction, scaled, scattering, air_extinction, air_scattering, phases, once, fields, nodes
                )
                if half_m[0] > 0.0:
                    _shade_sides(j, i, ny, nx, levels_m, air_extinction[w], sun, half_m, nodes)
                if w == 0:
                    _count_parts(nodes, levels_m, parts)
                places = _places(nodes, levels_m, parts, thick, node, below, medium, sunlit, light, source)
                first = 0
                for k in range(min(least, nz - 1)):
                    first += parts[k]
                for n in range(LANES):
                    put(ground, LANES + n, albedo[w, j, i + n])
                    put(ground, 2 * LANES + n, direct[w, j, i + n])
                    at = 0.5 * (inflow.shape[1] - 1) * (1.0 + mu_sun[j, i + n])
                    at = min(max(at, 0.0), inflow.shape[1] - 1.0)
                    m = min(int(at), inflow.shape[1] - 2)
                    for k in range(nz):
                        cosine = -flat(slopes, k * LANES + n)
                        put(missing, k * LANES + n, _lacking(w, k, m, f32(at - m), cosine, lacking))
                    for c in range(2):
                        low = inflow[w, m, c]
                        put(above, c * LANES + n, f32(low + (at - m) * (inflow[w, m + 1, c] - low)))
                for m in range(MODES):
                    ground_start(m, tables, ground, start)
                    if m > 0:
                        write(start, 4 * LANES, spread_quadruple(_ZERO))
                        write(start, 5 * LANES, spread_quadruple(_ZERO))
                    eliminate(m, places, tables, thick, medium, light, lit, first, node, ground, start, rows)
                    back(
                        m, places, tables, thick, medium, light, lit, first, node, below, ground, above, rows, looks,
                        source, flux,
                    )  # fmt: skip
                for n in range(LANES):
                    down[w, j, i + n], up[w, j, i + n] = flux[n], flux[LANES + n]
                _seen(w, count, j, i, levels_m, parts, thick, medium, source, slopes, missing, fields)
