"""Eye rays: tangent and transpose of `march.march`.

The transposed march goes along a ray as `march` does, keeps what it finds, and walks back; what it then knows of
places is added to the nodes around. Rays are dealt to teams, whose bars are added in their order, so that sums do not
depend on threads.
"""

from typing import NamedTuple

import numpy as np

from openswim.transport.engine.compiled import CONTRACTED, kernel, part
from openswim.transport.engine.lanes import LANES, read, write
from openswim.transport.linear.cell import less_between, step_slopes, step_weights
from openswim.transport.linear.march import (
    aim_of,
    along_of,
    at_end,
    bent_by,
    corner,
    dims,
    fetch,
    go_along,
    phase_of,
    step_ends,
    take_aim,
)

_SHORT = 1e-30  # m: a step without length has no slopes


class Slopes(NamedTuple):
    """Of the steps to places (m,): slopes of what a step emits by what there is at its ends, of which the nearer one to
    the eye is the first; and of what it lets through by either extinction."""

    near: np.ndarray  # by the emission of diffuse light
    far: np.ndarray
    single0: np.ndarray  # by what is scattered of a beam of 1
    single: np.ndarray
    beam0: np.ndarray  # by the beam
    beam: np.ndarray
    ext0: np.ndarray  # by the extinction
    ext: np.ndarray
    passed: np.ndarray
    before: np.ndarray  # transmission from the eye to the step


@kernel(CONTRACTED)
def _slopes_of(room):
    a, b, c, d, e = np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room)
    f, g, h, i, j = np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room), np.zeros(room)
    return Slopes(a, b, c, d, e, f, g, h, i, j)


@part(CONTRACTED, inlined=True)
def _change_along(count, share, matter, d_between, aim, along, d_value):
    """Changes of what comes out of the grid, and of what it lets through; what it does let through. Into d_value (m,
    channels) the changes at places."""
    shape, scaled, forward, value = matter.shape, matter.scaled, matter.forward, along.value
    kinds, d_light, trans, d_trans, d_ahead = scaled.shape[0], 0.0, 1.0, 0.0, 0.0
    de0, d_ext0, d_fwd0, d_single0, d_beam0 = 0.0, 0.0, 0.0, 0.0, 0.0
    for m in range(count):
        fetch(d_between.fields, m, shape, along, d_value)
        d_ext, d_fwd, ds = dims(d_value, m, scaled), dims(d_value, m, forward), along.length[m]
        d_ahead += 0.5 * ds * (d_fwd0 + d_fwd)
        single, beam, ext = along.single[m], along.beam[m], along.ext[m]
        d_beam = 2.0 * value[m, 2 * kinds] * along.bent[m] * d_value[m, 2 * kinds]
        d_beam -= beam * bent_by(d_between.bends, m, along)
        d_diffuse, d_single = 0.0, along.by_depth[m] * (d_value[m, 2 * kinds + 1] + d_ahead)
        for s in range(kinds):
            d_diffuse += d_value[m, s] * value[m, kinds + s] + value[m, s] * d_value[m, kinds + s]
            d_single += d_value[m, s] * phase_of(s, share, along.depth[m], forward, aim)
        de = d_diffuse + d_single * beam + single * d_beam
        if m > 0:
            single0, beam0, ext0, ds = along.single[m - 1], along.beam[m - 1], along.ext[m - 1], max(ds, _SHORT)
            passed, near, far = step_weights(ext0, ext, ds)
            t_n, t_f, n_n, n_f, f_n, f_f = step_slopes(ext0, ext, ds)
            less = less_between(single0, single, beam0, beam)
            d_less = less_between(d_single0, d_single, beam0, beam) + less_between(single0, single, d_beam0, d_beam)
            one, two = along.diffuse[m - 1] + single0 * beam0 - less, along.diffuse[m] + single * beam - less
            d_step = near * (de0 - d_less) + far * (de - d_less)
            d_step += (n_n * one + f_n * two) * d_ext0 + (n_f * one + f_f * two) * d_ext
            d_light += trans * d_step + d_trans * (near * one + far * two)
            d_trans = d_trans * passed + trans * (t_n * d_ext0 + t_f * d_ext)
            trans *= passed
        de0, d_ext0, d_fwd0, d_single0, d_beam0 = de, d_ext, d_fwd, d_single, d_beam
    return d_light, d_trans, trans


@kernel(CONTRACTED)
def march_tangent(t, threads, rays, matter, between, d_between, d_ground, out):
    """Change (n,) of `march`'s radiance with changes of what there is between nodes, and of the ground."""
    aim, along = aim_of(matter.table), along_of(rays.first, between.fields.shape[1])
    d_value = np.zeros_like(along.value)
    for n in range(t, out.shape[0], threads):
        take_aim(rays.cosine[n], rays.share[n], matter, aim)
        count = go_along(n, rays, matter, between, aim, along)
        d_light, d_trans, trans = _change_along(count, rays.share[n], matter, d_between, aim, along, d_value)
        if rays.ground_hit[n]:
            d_light += d_trans * at_end(matter.ground, count - 1, matter.shape, along)
            d_light += trans * at_end(d_ground, count - 1, matter.shape, along)
        else:
            d_light += d_trans * rays.back[n]
        out[n] = rays.dim[n] * d_light


@part(CONTRACTED, inlined=True)
def _take_slopes(count, along, slopes):
    """All of `Slopes`, and what steps let through and emit; what comes through all of them."""
    for m in range(0, count - 1, LANES):
        single0, single, beam0, beam, one, two = step_ends(m, along)
        ext0, ext = read(along.ext, m, None), read(along.ext, m + 1, None)
        ds = max(read(along.length, m + 1, None), _SHORT)
        passed, near, far = step_weights(ext0, ext, ds)
        t_n, _, n_n, n_f, f_n, f_f = step_slopes(ext0, ext, ds)
        by_single, by_beam = less_between(0.0, 1.0, beam0, beam), less_between(single0, single, 0.0, 1.0)
        both = near + far
        write(along.passed, m + 1, passed, None)
        write(along.told, m + 1, near * one + far * two, None)
        write(slopes.passed, m + 1, t_n, None)
        write(slopes.near, m + 1, near, None)
        write(slopes.far, m + 1, far, None)
        write(slopes.single0, m + 1, near * beam0 + by_single * both, None)
        write(slopes.single, m + 1, far * beam - by_single * both, None)
        write(slopes.beam0, m + 1, near * single0 + by_beam * both, None)
        write(slopes.beam, m + 1, far * single - by_beam * both, None)
        write(slopes.ext0, m + 1, n_n * one + f_n * two, None)
        write(slopes.ext, m + 1, n_f * one + f_f * two, None)
    trans = 1.0
    for m in range(1, count):
        slopes.before[m] = trans
        trans *= along.passed[m]
    return trans


@part(CONTRACTED, inlined=True)
def _walk_back(count, share, light_bar, trans_bar, matter, aim, along, slopes):
    """In place of what there is at places its bars."""
    scaled, forward, value, kinds = matter.scaled, matter.forward, along.value, matter.scaled.shape[0]
    # of the place at hand, from the step beyond it
    ahead_bar, diffuse_bar, single_bar, beam_bar, ext_bar, fwd_bar = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for m in range(count - 1, -1, -1):
        diffuse0_bar, single0_bar, beam0_bar, ext0_bar = 0.0, 0.0, 0.0, 0.0
        if m > 0:
            step_bar = slopes.before[m] * light_bar
            passed_bar = slopes.passed[m] * slopes.before[m] * trans_bar
            diffuse0_bar, single0_bar = slopes.near[m] * step_bar, slopes.single0[m] * step_bar
            beam0_bar, ext0_bar = slopes.beam0[m] * step_bar, slopes.ext0[m] * step_bar + passed_bar
            diffuse_bar += slopes.far[m] * step_bar
            single_bar += slopes.single[m] * step_bar
            beam_bar += slopes.beam[m] * step_bar
            ext_bar += slopes.ext[m] * step_bar + passed_bar
            trans_bar = along.passed[m] * trans_bar + along.told[m] * light_bar
        depth_bar = along.by_depth[m] * single_bar
        ahead_bar += depth_bar
        fwd0_bar = 0.5 * along.length[m] * ahead_bar
        fwd_bar += fwd0_bar
        for s in range(kinds):
            by_ext = value[m, kinds + s] * diffuse_bar + phase_of(s, share, along.depth[m], forward, aim) * single_bar
            value[m, kinds + s] = value[m, s] * diffuse_bar
            value[m, s] = by_ext + scaled[s] * ext_bar + forward[s] * fwd_bar
        value[m, 2 * kinds] *= 2.0 * along.bent[m] * beam_bar
        value[m, 2 * kinds + 1] = depth_bar
        along.bent[m] = -along.beam[m] * beam_bar
        diffuse_bar, single_bar, beam_bar = diffuse0_bar, single0_bar, beam0_bar
        ext_bar, fwd_bar = ext0_bar, fwd0_bar


@part(CONTRACTED, inlined=True)
def _scatter(count, shape, along, own, own_bends):
    """Add bars at places to those of the nodes around and of their cells."""
    value, weight, width = along.value, along.weight, own.shape[1]
    for m in range(count):
        for axis in range(3):
            own_bends[along.node[m], axis] += along.inside[m, axis] * along.bent[m]
        for c in range(0, width, LANES):
            bar = read(value, m * width + c, None)
            for n in range(8):
                p = corner(along.node[m], n, shape) * width + c
                write(own, p, read(own, p, None) + weight[m, n] * bar, None)


@kernel(CONTRACTED)
def march_transposed(t, threads, rays, matter, between, bar, between_bar, ground_bar):
    """Transpose of `march_tangent`: bar (n,) added to between_bar, of which each team has its own (TEAMS, nodes, ...),
    and ground_bar (TEAMS, columns)."""
    aim, along, shape = aim_of(matter.table), along_of(rays.first, between.fields.shape[1]), matter.shape
    slopes, columns = _slopes_of(along.length.shape[0]), shape[1] * shape[2]
    teams = ground_bar.shape[0]
    for team in range(t, teams, threads):
        own, own_bends, own_ground = between_bar.fields[team], between_bar.bends[team], ground_bar[team]
        for n in range(team, bar.shape[0], teams):
            light_bar = rays.dim[n] * bar[n]
            if light_bar == 0.0 or rays.first[n + 1] == rays.first[n]:
                continue
            take_aim(rays.cosine[n], rays.share[n], matter, aim)
            count = go_along(n, rays, matter, between, aim, along)
            trans, behind = _take_slopes(count, along, slopes), rays.back[n]
            if rays.ground_hit[n]:
                behind = at_end(matter.ground, count - 1, shape, along)
                for q in range(8):
                    own_ground[corner(along.node[count - 1], q, shape) % columns] += (
                        along.weight[count - 1, q] * trans * light_bar
                    )
            _walk_back(count, rays.share[n], light_bar, behind * light_bar, matter, aim, along, slopes)
            _scatter(count, shape, along, own, own_bends)
