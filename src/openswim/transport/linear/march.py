"""Eye rays: value, tangent and transpose.

The places of a ray are fixed by its geometry: none is skipped where it is empty now, for an empty place must receive
its gradient, and none is left out where it has become dark. Channels at the nodes (nodes, 2 kinds + 2), linear
between: extinction of every kind of matter; what it scatters toward the eye of the diffuse light, per its extinction;
the root of the scaled beam; the forward depth to the sun. At a place kind s emits

    beta_s (J_s + (once_s + share R_s(phi)) T),   phi: forward depth to the sun and on to the eye (F16-F18);

along a step what is scattered of the beam and the beam change together, which `cell.bend` takes into account.

The transposed march looks at the places once more, keeps what it finds, and walks back. Rays are dealt to teams, whose
bars are added in their order, so that sums do not depend on threads.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from openswim.transport.linear.cell import beam_of, bend, peak, peak_slope, step_slopes, step_weights
from openswim.transport.march.forward_peak import peak_row

_FLAGS: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "fastmath": {"contract"}}


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


@njit(**_FLAGS)
def _look(z, y, x, shape, node, weight):
    """Flat nodes and weights (8,) around a place at fractional indices; the lowest level's come first."""
    k, j, i = int(z), int(y), int(x)
    k, j, i = min(max(k, 0), shape[0] - 2), min(max(j, 0), shape[1] - 2), min(max(i, 0), shape[2] - 2)
    c, b, a = min(max(z - k, 0.0), 1.0), min(max(y - j, 0.0), 1.0), min(max(x - i, 0.0), 1.0)
    here = (k * shape[1] + j) * shape[2] + i
    for n in range(8):
        node[n] = here + (n & 1) + (n >> 1 & 1) * shape[2] + (n >> 2) * shape[1] * shape[2]
        weight[n] = (c if n >> 2 else 1.0 - c) * (b if n >> 1 & 1 else 1.0 - b) * (a if n & 1 else 1.0 - a)
    return k, c


@njit(**_FLAGS)
def _read(fields, node, weight, out):
    for ch in range(out.shape[0]):
        out[ch] = 0.0
    for n in range(8):
        w, p = weight[n], node[n]
        for ch in range(out.shape[0]):
            out[ch] += w * fields[p, ch]


@njit(**_FLAGS)
def _ground(value, node, weight, columns):
    """Bilinear value (columns,) where a ray has ended."""
    total = 0.0
    for n in range(8):
        total += weight[n] * value[node[n] % columns]
    return total


@njit(**_FLAGS)
def _aim(cosine, share, table, low, kinds, row, once):
    """Of a ray by its angle to the sun: forward peaks (kinds, depths), and what is scattered of the beam whatever the
    depth (kinds,)."""
    u = peak_row(math.acos(min(1.0, max(-1.0, cosine))), table.shape[1])
    i = min(int(u), table.shape[1] - 2)
    a = u - i
    for kind in range(kinds):
        for d in range(table.shape[2]):
            row[kind, d] = (1.0 - a) * table[kind, i, d] + a * table[kind, i + 1, d]
        p0, p1, total = 1.0, cosine, (1.0 - share) * row[kind, 0]
        for ell in range(low.shape[1]):
            total += (2 * ell + 1) * low[kind, ell] * p0
            p0, p1 = p1, ((2 * ell + 3) * cosine * p1 - (ell + 1) * p0) / (ell + 2)
        once[kind] = total


@njit(**_FLAGS)
def _emits(v, kinds, forward, once, share, row, depth):
    """Of a place with channels v: (emission of the diffuse light; what is scattered of a beam of 1; its slope by the
    forward depth)."""
    diffuse, single, by_depth = 0.0, 0.0, 0.0
    for s in range(kinds):
        phase = once[s]
        if share > 0.0 and forward[s] > 0.0:
            phase += share * peak(row[s], depth)
            by_depth += v[s] * share * peak_slope(row[s], depth)
        diffuse += v[s] * v[kinds + s]
        single += v[s] * phase
    return diffuse, single, by_depth


@njit(**_FLAGS)
def _dims(v, kinds, scaled):
    total = 0.0
    for s in range(kinds):
        total += scaled[s] * v[s]
    return total


@njit(**_FLAGS)
def march(t, threads, rays, matter, fields, out):
    """Radiance (n,) of rays, with channels ``fields`` at the nodes."""
    first, place, cosine, share, ground_hit, front, dim, back = rays
    shape, gas, ground, table, low, scaled, forward = matter
    kinds, columns = scaled.shape[0], shape[1] * shape[2]
    node, weight, v, row, once = (
        np.empty(8, np.int64), np.empty(8), np.empty(2 * kinds + 2), np.empty((kinds, table.shape[2])), np.empty(kinds),
    )  # fmt: skip
    for n in range(t, cosine.shape[0], threads):
        _aim(cosine[n], share[n], table, low, kinds, row, once)
        light, trans, ahead, e0, ext0, fwd0, single0, beam0 = 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(first[n], first[n + 1]):
            k, c = _look(place[m, 0], place[m, 1], place[m, 2], shape, node, weight)
            _read(fields, node, weight, v)
            ext, fwd = _dims(v, kinds, scaled) + gas[k] * (1 - c) + gas[k + 1] * c, _dims(v, kinds, forward)
            ds = place[m, 3] - place[m - 1, 3] if m > first[n] else 0.0
            ahead += 0.5 * ds * (fwd0 + fwd)
            diffuse, single, _ = _emits(v, kinds, forward, once, share[n], row, v[2 * kinds + 1] + ahead)
            beam = beam_of(v[2 * kinds])
            e = diffuse + single * beam
            if ds > 0.0:
                passed, near, far = step_weights(ext0, ext, ds)
                less = bend(single0, single, beam0, beam)
                light += trans * (near * (e0 - less) + far * (e - less))
                trans *= passed
            e0, ext0, fwd0, single0, beam0 = e, ext, fwd, single, beam
        behind = _ground(ground, node, weight, columns) if ground_hit[n] else back[n]
        out[n] = front[n] + dim[n] * (light + trans * behind)


@njit(**_FLAGS)
def march_tangent(t, threads, rays, matter, fields, d_fields, d_ground, out):
    """Change (n,) of `march`'s radiance with changes of its fields and ground."""
    first, place, cosine, share, ground_hit, _, dim, back = rays
    shape, gas, ground, table, low, scaled, forward = matter
    kinds, columns = scaled.shape[0], shape[1] * shape[2]
    node, weight, v, dv = np.empty(8, np.int64), np.empty(8), np.empty(2 * kinds + 2), np.empty(2 * kinds + 2)
    row, once = np.empty((kinds, table.shape[2])), np.empty(kinds)
    for n in range(t, cosine.shape[0], threads):
        _aim(cosine[n], share[n], table, low, kinds, row, once)
        d_light, trans, d_trans, ahead, d_ahead = 0.0, 1.0, 0.0, 0.0, 0.0
        e0, ext0, fwd0, single0, beam0 = 0.0, 0.0, 0.0, 0.0, 0.0
        de0, d_ext0, d_fwd0, d_single0, d_beam0 = 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(first[n], first[n + 1]):
            k, c = _look(place[m, 0], place[m, 1], place[m, 2], shape, node, weight)
            _read(fields, node, weight, v)
            _read(d_fields, node, weight, dv)
            ext, fwd = _dims(v, kinds, scaled) + gas[k] * (1 - c) + gas[k + 1] * c, _dims(v, kinds, forward)
            d_ext, d_fwd = _dims(dv, kinds, scaled), _dims(dv, kinds, forward)
            ds = place[m, 3] - place[m - 1, 3] if m > first[n] else 0.0
            ahead += 0.5 * ds * (fwd0 + fwd)
            d_ahead += 0.5 * ds * (d_fwd0 + d_fwd)
            depth, root = v[2 * kinds + 1] + ahead, v[2 * kinds]
            diffuse, single, by_depth = _emits(v, kinds, forward, once, share[n], row, depth)
            beam, d_beam = beam_of(root), 2.0 * root * dv[2 * kinds]
            d_diffuse, d_single = 0.0, by_depth * (dv[2 * kinds + 1] + d_ahead)
            for s in range(kinds):
                phase = once[s]
                if share[n] > 0.0 and forward[s] > 0.0:
                    phase += share[n] * peak(row[s], depth)
                d_diffuse += dv[s] * v[kinds + s] + v[s] * dv[kinds + s]
                d_single += dv[s] * phase
            e, de = diffuse + single * beam, d_diffuse + d_single * beam + single * d_beam
            if ds > 0.0:
                passed, near, far = step_weights(ext0, ext, ds)
                t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(ext0, ext, ds)
                less = bend(single0, single, beam0, beam)
                d_less = bend(d_single0, d_single, beam0, beam) + bend(single0, single, d_beam0, d_beam)
                one, two = e0 - less, e - less
                d_step = near * (de0 - d_less) + far * (de - d_less)
                d_step += (n_n * one + f_n * two) * d_ext0 + (n_f * one + f_f * two) * d_ext
                d_light += trans * d_step + d_trans * (near * one + far * two)
                d_trans = d_trans * passed + trans * (t_n * d_ext0 + t_f * d_ext)
                trans *= passed
            e0, ext0, fwd0, single0, beam0 = e, ext, fwd, single, beam
            de0, d_ext0, d_fwd0, d_single0, d_beam0 = de, d_ext, d_fwd, d_single, d_beam
        if ground_hit[n]:
            d_light += d_trans * _ground(ground, node, weight, columns)
            d_light += trans * _ground(d_ground, node, weight, columns)
        else:
            d_light += d_trans * back[n]
        out[n] = dim[n] * d_light


@njit(**_FLAGS)
def march_transposed(t, threads, rays, matter, fields, bar, fields_bar, ground_bar):
    """Transpose of `march_tangent`: bar (n,) added to fields_bar (TEAMS, nodes, channels), ground_bar (TEAMS,
    columns)."""
    first, place, cosine, share, ground_hit, _, dim, back = rays
    shape, gas, ground, table, low, scaled, forward = matter
    kinds, columns = scaled.shape[0], shape[1] * shape[2]
    channels, most = 2 * kinds + 2, 1
    for n in range(cosine.shape[0]):
        most = max(most, first[n + 1] - first[n])
    node, weight, vb = np.empty(8, np.int64), np.empty(8), np.empty(channels)
    row, once = np.empty((kinds, table.shape[2])), np.empty(kinds)
    value, kept = np.empty((most, channels)), np.empty((most, 8))
    for team in range(t, fields_bar.shape[0], threads):
        own, own_ground = fields_bar[team], ground_bar[team]
        for n in range(team, cosine.shape[0], fields_bar.shape[0]):
            light_bar, start, count = dim[n] * bar[n], first[n], first[n + 1] - first[n]
            if light_bar == 0.0 or count == 0:
                continue
            _aim(cosine[n], share[n], table, low, kinds, row, once)
            trans, ahead, ext0, fwd0 = 1.0, 0.0, 0.0, 0.0
            for m in range(count):
                k, c = _look(place[start + m, 0], place[start + m, 1], place[start + m, 2], shape, node, weight)
                v = value[m]
                _read(fields, node, weight, v)
                ext, fwd = _dims(v, kinds, scaled) + gas[k] * (1 - c) + gas[k + 1] * c, _dims(v, kinds, forward)
                ds = place[start + m, 3] - place[start + m - 1, 3] if m > 0 else 0.0
                ahead += 0.5 * ds * (fwd0 + fwd)
                if ds > 0.0:
                    trans *= step_weights(ext0, ext, ds)[0]
                depth = v[2 * kinds + 1] + ahead
                diffuse, single, by_depth = _emits(v, kinds, forward, once, share[n], row, depth)
                kept[m, 0], kept[m, 1], kept[m, 2] = diffuse, single, by_depth
                kept[m, 3], kept[m, 4], kept[m, 5], kept[m, 6] = trans, ext, depth, ds
                ext0, fwd0 = ext, fwd
            behind = back[n]
            if ground_hit[n]:
                behind = _ground(ground, node, weight, columns)
                for q in range(8):
                    own_ground[node[q] % columns] += weight[q] * trans * light_bar
            trans_bar = behind * light_bar
            # of the place at hand, from the step beyond it
            ahead_bar, diffuse_bar, single_bar, beam_bar, ext_bar, fwd_bar = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for m in range(count - 1, -1, -1):
                v, ds, root, single, depth = value[m], kept[m, 6], value[m, 2 * kinds], kept[m, 1], kept[m, 5]
                beam = beam_of(root)
                diffuse0_bar, single0_bar, beam0_bar, ext0_bar, fwd0_bar = 0.0, 0.0, 0.0, 0.0, 0.0
                if ds > 0.0:
                    single0, beam0, before = kept[m - 1, 1], beam_of(value[m - 1, 2 * kinds]), kept[m - 1, 3]
                    less = bend(single0, single, beam0, beam)
                    one, two = kept[m - 1, 0] + single0 * beam0 - less, kept[m, 0] + single * beam - less
                    passed, near, far = step_weights(kept[m - 1, 4], kept[m, 4], ds)
                    t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(kept[m - 1, 4], kept[m, 4], ds)
                    step_bar = before * light_bar
                    less_bar = -(near + far) * step_bar
                    by_single, by_beam = bend(0.0, 1.0, beam0, beam), bend(single0, single, 0.0, 1.0)
                    diffuse0_bar, single0_bar = near * step_bar, near * step_bar * beam0 - by_single * less_bar
                    beam0_bar = near * step_bar * single0 - by_beam * less_bar
                    diffuse_bar += far * step_bar
                    single_bar += far * step_bar * beam + by_single * less_bar
                    beam_bar += far * step_bar * single + by_beam * less_bar
                    ext0_bar = (n_n * one + f_n * two) * step_bar + t_n * before * trans_bar
                    ext_bar += (n_f * one + f_f * two) * step_bar + t_f * before * trans_bar
                    trans_bar = passed * trans_bar + (near * one + far * two) * light_bar
                depth_bar = kept[m, 2] * single_bar
                ahead_bar += depth_bar
                fwd0_bar = 0.5 * ds * ahead_bar
                fwd_bar += 0.5 * ds * ahead_bar
                for s in range(kinds):
                    phase = once[s]
                    if share[n] > 0.0 and forward[s] > 0.0:
                        phase += share[n] * peak(row[s], depth)
                    vb[s] = v[kinds + s] * diffuse_bar + phase * single_bar
                    vb[s] += scaled[s] * ext_bar + forward[s] * fwd_bar
                    vb[kinds + s] = v[s] * diffuse_bar
                vb[2 * kinds], vb[2 * kinds + 1] = 2.0 * root * beam_bar, depth_bar
                _look(place[start + m, 0], place[start + m, 1], place[start + m, 2], shape, node, weight)
                for q in range(8):
                    w, p = weight[q], node[q]
                    for ch in range(channels):
                        own[p, ch] += w * vb[ch]
                diffuse_bar, single_bar, beam_bar = diffuse0_bar, single0_bar, beam0_bar
                ext_bar, fwd_bar = ext0_bar, fwd0_bar
