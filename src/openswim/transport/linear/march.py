"""Eye rays: what lies along one, and the light that comes out of it. `march_slopes` has tangent and transpose.

The places of a ray are fixed by its geometry: none is skipped where it is empty now, for an empty place must receive
its gradient, and none is left out where it has become dark. Channels at the nodes (nodes, `channels`), linear
between: extinction of every kind of matter; what it scatters toward the eye of the diffuse light, per its extinction;
the root of the scaled beam; the forward depth to the sun; and unused ones up to a multiple of eight, which are read at
once. Of the cells, how the depth to the sun bends within (`sun_depth.bends`). At a place kind s emits

    beta_s (J_s + (once_s + share R_s(phi)) T),   phi: forward depth to the sun and on to the eye (F16-F18);

along a step what is scattered of the beam and the beam change together, which `cell.less_between` takes into account.
A ray is gone along three times: places one after the other, then eight steps at once, then what is left of the light.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import CONTRACTED, kernel, part
from openswim.transport.engine.lanes import LANES, read, write
from openswim.transport.linear.cell import beam_of, less_between, peak, peak_slope, step_weights
from openswim.transport.march.forward_peak import peak_row


class Sent(NamedTuple):
    """Rays (n,) of an eye."""

    first: np.ndarray  # (n + 1,) each has places first[n] to first[n + 1] of
    place: np.ndarray  # (m, 4) level, row, column, distance
    cosine: np.ndarray  # of the angle to the sun
    share: np.ndarray  # of the forward peak that broadens
    ground_hit: np.ndarray  # whether they end on the ground, else before ``back``
    front: np.ndarray  # radiance
    dim: np.ndarray  # and transmission of what lies between the eye and the grid
    back: np.ndarray  # radiance of what lies behind it


class Matter(NamedTuple):
    """What they go through, of k kinds: see `optics.Optics`."""

    shape: np.ndarray  # (3,) levels, rows, columns
    gas: np.ndarray  # (nz,) absorption, besides
    ground: np.ndarray  # (columns,) its radiance
    table: np.ndarray  # (k, angles, depths)
    low: np.ndarray  # (k, M)
    scaled: np.ndarray  # (k,)
    forward: np.ndarray  # (k,)


class Between(NamedTuple):
    """What there is between nodes, or changes or bars of it."""

    fields: np.ndarray  # (nodes, `channels`) linear between them
    bends: np.ndarray  # (nodes, 3) see `sun_depth.bends`


class Along(NamedTuple):
    """Of the places (m,) of a ray; for eight at once there is room for LANES more."""

    value: np.ndarray  # (m, channels)
    node: np.ndarray  # the lowest of the eight nodes around
    weight: np.ndarray  # (m, 8) and their weights; the lowest level's come first
    inside: np.ndarray  # (m, 3) along x, y, z: h (1 - h), h the place in the cell
    length: np.ndarray  # of the step to it, m
    ext: np.ndarray  # scaled extinction and gas
    depth: np.ndarray  # forward depth to the sun and to the eye
    diffuse: np.ndarray  # emission of the diffuse light
    single: np.ndarray  # what is scattered of a beam of 1,
    by_depth: np.ndarray  # and its slope by the depth
    beam: np.ndarray
    bent: np.ndarray  # e to the minus what its depth bends
    passed: np.ndarray  # transmission of the step to it
    told: np.ndarray  # what the step emits


class Aim(NamedTuple):
    """Of a ray, by its angle to the sun."""

    row: np.ndarray  # (k, depths) forward peaks
    once: np.ndarray  # (k,) what is scattered of the beam whatever the depth


def channels(*shape: int) -> NDArray[np.float64]:
    """Zeros (..., nodes, channels) for the channels of so many kinds of matter, the last of the shape. Where a node's
    begin, there begins a line of a cache."""
    *lead, kinds = shape
    whole = (*lead, -(-(2 * kinds + 2) // LANES) * LANES)
    size, line = math.prod(whole), 64
    raw = np.zeros(size + line // 8)
    first = -raw.ctypes.data % line // 8
    return raw[first : first + size].reshape(whole)


@kernel(CONTRACTED)
def along_of(first, channels):
    """`Along` for the longest of rays."""
    most = 1
    for n in range(first.shape[0] - 1):
        most = max(most, first[n + 1] - first[n])
    room = most + LANES
    a, b, c, d, e = np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room)
    f, g, h, i, j = np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room)
    value, node = np.zeros((most, channels)), np.zeros(most, np.int64)
    return Along(value, node, np.zeros((most, 8)), np.zeros((most, 3)), a, b, c, d, e, f, g, h, i, j)


@kernel(CONTRACTED)
def aim_of(table):
    """`Aim`, to be filled by `take_aim`."""
    return Aim(np.empty((table.shape[0], table.shape[2])), np.empty(table.shape[0]))


@kernel(CONTRACTED)
def take_aim(cosine, share, matter, aim):
    """Fill an `Aim`; where the forward peak does not broaden, with its first depth alone."""
    row, once = aim
    table, low = matter.table, matter.low
    u = peak_row(math.acos(min(1.0, max(-1.0, cosine))), table.shape[1])
    i = min(int(u), table.shape[1] - 2)
    a = u - i
    for kind in range(table.shape[0]):
        for d in range(table.shape[2] if share > 0.0 else 1):
            row[kind, d] = (1.0 - a) * table[kind, i, d] + a * table[kind, i + 1, d]
        p0, p1, total = 1.0, cosine, (1.0 - share) * row[kind, 0]
        for ell in range(low.shape[1]):
            total += (2 * ell + 1) * low[kind, ell] * p0
            p0, p1 = p1, ((2 * ell + 3) * cosine * p1 - (ell + 1) * p0) / (ell + 2)
        once[kind] = total


@part(CONTRACTED, inlined=True)
def corner(node, n, shape):
    """The n-th of the eight nodes of which ``node`` is the lowest."""
    return node + (n & 1) + (n >> 1 & 1) * shape[2] + (n >> 2) * shape[1] * shape[2]


@part(CONTRACTED, inlined=True)
def look(z, y, x, m, shape, along):
    """Of place m, at fractional indices, the nodes around and their weights; its level, and how far above it lies."""
    k, j, i = int(z), int(y), int(x)
    k, j, i = min(max(k, 0), shape[0] - 2), min(max(j, 0), shape[1] - 2), min(max(i, 0), shape[2] - 2)
    c, b, a = min(max(z - k, 0.0), 1.0), min(max(y - j, 0.0), 1.0), min(max(x - i, 0.0), 1.0)
    along.node[m] = (k * shape[1] + j) * shape[2] + i
    along.inside[m, 0], along.inside[m, 1], along.inside[m, 2] = a * (1.0 - a), b * (1.0 - b), c * (1.0 - c)
    weight = along.weight
    b0, b1, b2, b3 = (1.0 - b) * (1.0 - a), (1.0 - b) * a, b * (1.0 - a), b * a
    low = 1.0 - c
    weight[m, 0], weight[m, 1], weight[m, 2], weight[m, 3] = low * b0, low * b1, low * b2, low * b3
    weight[m, 4], weight[m, 5], weight[m, 6], weight[m, 7] = c * b0, c * b1, c * b2, c * b3
    return k, c


@part(CONTRACTED, inlined=True)
def fetch(fields, m, shape, along, out):
    """Channels (channels,) at place m, into row m of ``out``."""
    node, weight, width = along.node[m], along.weight, fields.shape[1]
    for c in range(0, width, LANES):
        found = weight[m, 0] * read(fields, corner(node, 0, shape) * width + c, None)
        for n in range(1, 8):
            found = found + weight[m, n] * read(fields, corner(node, n, shape) * width + c, None)
        write(out, m * width + c, found, None)


@part(CONTRACTED, inlined=True)
def bent_by(bends, m, along):
    """By how much the depth to the sun bends at place m."""
    node, inside = along.node[m], along.inside
    return inside[m, 0] * bends[node, 0] + inside[m, 1] * bends[node, 1] + inside[m, 2] * bends[node, 2]


@part(CONTRACTED, inlined=True)
def dims(value, m, scaled):
    total = 0.0
    for s in range(scaled.shape[0]):
        total += scaled[s] * value[m, s]
    return total


@part(CONTRACTED, inlined=True)
def phase_of(s, share, depth, forward, aim):
    """What kind s scatters of the beam toward the eye, per its extinction."""
    if share > 0.0 and forward[s] > 0.0:
        return aim.once[s] + share * peak(aim.row[s], depth)
    return aim.once[s]


@part(CONTRACTED, inlined=True)
def go_along(n, rays, matter, between, aim, along):
    """What lies at the places of ray n: all of `Along` but for its steps. How many they are."""
    shape, gas, scaled, forward = matter.shape, matter.gas, matter.scaled, matter.forward
    start, place, share, kinds = rays.first[n], rays.place, rays.share[n], scaled.shape[0]
    count, value, ahead, before, at = rays.first[n + 1] - start, along.value, 0.0, 0.0, 0.0
    for m in range(count):
        k, c = look(place[start + m, 0], place[start + m, 1], place[start + m, 2], m, shape, along)
        fetch(between.fields, m, shape, along, value)
        ds, at = place[start + m, 3] - at if m > 0 else 0.0, place[start + m, 3]
        along.length[m] = ds
        along.ext[m] = dims(value, m, scaled) + gas[k] * (1 - c) + gas[k + 1] * c
        fwd = dims(value, m, forward)
        ahead += 0.5 * ds * (before + fwd)
        before = fwd
        depth = value[m, 2 * kinds + 1] + ahead
        diffuse, single, by_depth = 0.0, 0.0, 0.0
        for s in range(kinds):
            diffuse += value[m, s] * value[m, kinds + s]
            single += value[m, s] * phase_of(s, share, depth, forward, aim)
            if share > 0.0 and forward[s] > 0.0:
                by_depth += value[m, s] * share * peak_slope(aim.row[s], depth)
        along.depth[m], along.diffuse[m], along.single[m], along.by_depth[m] = depth, diffuse, single, by_depth
        along.beam[m], along.bent[m] = beam_of(value[m, 2 * kinds], bent_by(between.bends, m, along))
    return count


@part(CONTRACTED, inlined=True)
def step_ends(m, along):
    """Of eight steps from place m on, at either end: scattering of a beam of 1, the beam, what is emitted; and by how
    much less than that is in between."""
    single0, single = read(along.single, m, None), read(along.single, m + 1, None)
    beam0, beam = read(along.beam, m, None), read(along.beam, m + 1, None)
    less = less_between(single0, single, beam0, beam)
    one = read(along.diffuse, m, None) + single0 * beam0 - less
    two = read(along.diffuse, m + 1, None) + single * beam - less
    return single0, single, beam0, beam, one, two


@part(CONTRACTED, inlined=True)
def _take_steps(count, along):
    """What steps let through and emit."""
    for m in range(0, count - 1, LANES):
        _, _, _, _, one, two = step_ends(m, along)
        passed, near, far = step_weights(
            read(along.ext, m, None), read(along.ext, m + 1, None), read(along.length, m + 1, None)
        )
        write(along.passed, m + 1, passed, None)
        write(along.told, m + 1, near * one + far * two, None)


@part(CONTRACTED, inlined=True)
def at_end(value, m, shape, along):
    """Bilinear value (columns,) where a ray ends at place m."""
    total, columns = 0.0, shape[1] * shape[2]
    for n in range(8):
        total += along.weight[m, n] * value[corner(along.node[m], n, shape) % columns]
    return total


@part(CONTRACTED, inlined=True)
def _come_out(count, along):
    """What comes out of the grid, and what of light behind it does."""
    light, trans = 0.0, 1.0
    for m in range(1, count):
        light += trans * along.told[m]
        trans *= along.passed[m]
    return light, trans


@kernel(CONTRACTED)
def march(t, threads, rays, matter, between, out):
    """Radiance (n,) of rays."""
    aim, along = aim_of(matter.table), along_of(rays.first, between.fields.shape[1])
    for n in range(t, out.shape[0], threads):
        take_aim(rays.cosine[n], rays.share[n], matter, aim)
        count = go_along(n, rays, matter, between, aim, along)
        _take_steps(count, along)
        light, trans = _come_out(count, along)
        behind = at_end(matter.ground, count - 1, matter.shape, along) if rays.ground_hit[n] else rays.back[n]
        out[n] = rays.front[n] + rays.dim[n] * (light + trans * behind)
