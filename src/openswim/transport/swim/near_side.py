"""What eye rays meet of cloud with the `swim` setting: depths, and how much light the near side of a cloud has.

Rays walk as the march's do (`march/walk.py`), and add up what Eqs 12 and 32-34 of Albers et al. (2020) ask for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import PACK, flat, low, put, read, read_quadruple, spread, write
from openswim.transport.engine.scalar import share_of_step, step_emission, transmission
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.cloud_detail import NO_DETAIL
from openswim.transport.march.march import MOST_SAMPLES, TILE, eye_rays, parts_of, world_of
from openswim.transport.march.sample import air_at, sample_grid
from openswim.transport.march.state import Lanes, Ray, lane_of
from openswim.transport.march.volume import FAR_M, Shells, Volume
from openswim.transport.march.walk import (
    BATCH,
    COUNT,
    GOING,
    HIT,
    PLACE,
    PLACE_LEVEL,
    PLACE_S,
    PLACE_STEP,
    PLACE_X,
    PLACE_Y,
    SAMPLES,
    START,
    STATE,
    S,
    start_walk,
    walk_on,
)

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ZERO, _HALF, _ONE = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0)
_NOTHING = FLOAT(1e-12)
DEPTH_OF_VIEW = FLOAT(2.0)  # l of Eq. 12


class NearSide(NamedTuple):
    """What rays (n) bring back; (n, PACK) where nothing else is said. Depths of cloud are of all species, at the
    reference wavelength."""

    lit: F32  # Eq. 12: integral of omega beta E/E_TOA e^-tau to `DEPTH_OF_VIEW` of cloud
    full: F32  # e^-tau of the whole ray
    front: F32  # optical depth of air and haze in front of unit depth of cloud
    species_depth: F32  # (n, ns) optical depth of each species along the whole ray
    cloud_m: F32  # (n,) mean distance of the first unit of cloud depth
    distance_m: F64  # (n,) to the ground, negative where the ray leaves to space
    samples: NDArray[np.int64]  # (n,)


@part(FINITE, inlined=True)
def _lit_step(near, far, extinction, extinction_far, ds_m):
    """What a step adds at its near end of sources ``near`` and ``far``, extinction and source linear along it (F9)."""
    depth = (_HALF * ds_m) * (extinction + extinction_far)
    return step_emission(depth, transmission(depth), ds_m, near, far, extinction, extinction_far)


@part(FINITE, inlined=True)
def _mean_depth(depth):
    """int x e^-x dx / int e^-x dx from 0 to ``depth``, by its series: within .3 % up to `DEPTH_OF_VIEW`."""
    return depth * (_HALF - depth * (FLOAT(1 / 12) - depth * depth * FLOAT(1 / 720)))


@part(FINITE, inlined=True)
def _row(fields, at, right, share):
    """All channels between a node, from flat element ``at`` on, and the next in its row."""
    here = read_quadruple(fields, at)
    return here + share * (read_quadruple(fields, at + right) - here)


@part(FINITE, inlined=True)
def _transmittance(ix, iy, level, volume, nodes):
    """T of Eq. 6 at fractional indices, T_abs/(1 + B): the way to the sun of ``volume.fields``' B and of -ln T_abs is
    bent within the cell as `within_cells` has it, both by as much of themselves. ``nodes``: scratch."""
    nz, ny, nx, nc = volume.fields.shape
    k, i, j = min(int(level), nz - 2), min(int(ix), nx - 1), min(int(iy), ny - 1)
    a, b, g = FLOAT(ix - i), FLOAT(iy - j), FLOAT(level - k)
    right, up = nc, nx * nc
    if i + 1 >= nx:
        right = -i * nc if volume.periodic else 0
    if j + 1 >= ny:
        up = -j * nx * nc if volume.periodic else 0
    cell, f = (k * ny + j) * nx + i, volume.fields
    for base in range(0, nc, 4 * PACK):
        at = cell * nc + base
        above = at + ny * nx * nc
        lower, upper = _row(f, at, right, a), _row(f, above, right, a)
        lower += b * (_row(f, at + up, right, a) - lower)
        upper += b * (_row(f, above + up, right, a) - upper)
        write(nodes, base, lower + g * (upper - lower))
    first, depth = _ZERO, spread(_ZERO)
    for n in range(volume.forward_factors.shape[0]):
        told = flat(nodes, 2 * PACK + volume.species + n)
        depth += told * read(volume.forward_factors, n * PACK)
        first += told * flat(volume.forward_factors, n * PACK)
    bent = first + a * (_ONE - a) * flat(volume.bend, cell * PACK) + b * (_ONE - b) * flat(volume.bend, cell * PACK + 1)
    bent += g * (_ONE - g) * flat(volume.bend, cell * PACK + 2)
    share = max(bent, _ZERO) / max(first, _NOTHING)
    return transmission(share * read(nodes, 0)) / (_ONE + share * depth)


@part(FINITE, inlined=True)
def _between(near, far, share, count, periodic):
    """An index between two, the shorter way round where there is a period."""
    step = far - near
    if periodic:
        step -= count * math.floor(step / count + 0.5)
        there = near + share * step
        return there - count * math.floor(there / count)
    return near + share * step


@part(FINITE)
def _follow(n, lane, world, out):
    """Ray ``n`` from `start_walk` on to its end. With extinction beta of air and cloud, x of all cloud alone, and the
    source S = omega beta E/E_TOA of Eq. 8, all but its T linear along a step,

        lit = int S e^-tau ds to l = int x ds, the step in which l is met ending there; T is that of the place at the
        mean depth from which a step's light comes, int x e^-x dx / int e^-x dx; front = int beta_air ds to
        int x ds = 1, likewise; cloud_m = int s x ds / int x ds to int x ds = 1, by the middles of steps.
    """
    w, places, nodes = lane.walk, lane.places, lane.nodes
    shells, volume, species_depth = world.shells, world.volume, out.species_depth[n]
    ray = Ray(0.0, _ZERO, lane.constants, lane.peak)  # nothing is scattered of the beam but by the nodes' source
    lit, through, front, ahead = spread(_ZERO), spread(_ONE), spread(_ZERO), spread(_ZERO)
    extinction, forward, source, air = spread(_ZERO), spread(_ZERO), spread(_ZERO), spread(_ZERO)
    cloud, cloud_depth, distance_m = _ZERO, _ZERO, _ZERO
    _, ny, nx, _ = volume.fields.shape
    ix, iy, level = 0.0, 0.0, -1.0
    while w[STATE] == GOING and w[SAMPLES] < MOST_SAMPLES:
        w[COUNT] = 0.0
        while w[STATE] == GOING and w[COUNT] < BATCH:
            walk_on(w, places, shells, volume, world.highest_m, world.scale)
        for place in range(0, int(w[COUNT]) * PLACE, PLACE):
            ds_m = FLOAT(flat(places, place + PLACE_STEP))
            half_step_m = _HALF * ds_m
            if cloud > _ZERO:
                for m in range(volume.species):
                    put(species_depth, m, flat(species_depth, m) + half_step_m * flat(nodes, 2 * PACK + m))
            ix_far, iy_far = flat(places, place + PLACE_X), flat(places, place + PLACE_Y)
            level_far = flat(places, place + PLACE_LEVEL)
            if level_far >= 0.0:
                there = sample_grid(ix_far, iy_far, level_far, ray, ahead, half_step_m, volume, nodes)
                extinction_far, forward_far, source_far = there.extinction, there.forward, there.diffuse
                air_far, cloud_far = there.air, there.cloud
            else:
                row, _, _ = air_at(ix_far, shells)
                extinction_far, forward_far, source_far = low(low(row)), spread(_ZERO), spread(_ZERO)
                air_far, cloud_far = extinction_far, _ZERO
            added = half_step_m * (cloud + cloud_far)
            fronting = _ONE if cloud_depth < _ONE else _ZERO
            if added > _ZERO:
                if cloud_far > _ZERO:
                    for m in range(volume.species):
                        put(species_depth, m, flat(species_depth, m) + half_step_m * flat(nodes, 2 * PACK + m))
                if cloud_depth < _ONE and cloud_depth + added > _ONE:
                    fronting = share_of_step(cloud, cloud_far, ds_m, _ONE - cloud_depth)
                middle_m = FLOAT(flat(places, place + PLACE_S)) - ds_m * (_ONE - _HALF * fronting)
                distance_m += middle_m * min(added, max(_ONE - cloud_depth, _ZERO))
                if cloud_depth < DEPTH_OF_VIEW:
                    seen, part = min(added, DEPTH_OF_VIEW - cloud_depth), _ONE
                    if seen < added:
                        part = share_of_step(cloud, cloud_far, ds_m, seen)
                    end, last = source + part * (source_far - source), extinction + part * (extinction_far - extinction)
                    share = 1.0
                    if level >= 0.0 and level_far >= 0.0:
                        share = 1.0 * share_of_step(cloud, cloud_far, ds_m, _mean_depth(seen))
                    elif level >= 0.0:
                        share = 0.0
                    near = _transmittance(
                        _between(ix, ix_far, share, nx, volume.periodic),
                        _between(iy, iy_far, share, ny, volume.periodic), level + share * (level_far - level),
                        volume, lane.gathered,
                    )  # fmt: skip
                    lit += (through * near) * _lit_step(source, end, extinction, last, part * ds_m)
                cloud_depth += added
            through *= transmission((extinction + extinction_far) * half_step_m)
            ahead += half_step_m * (forward + forward_far)
            front += (fronting * half_step_m) * (air + air_far)
            extinction, forward, source, air = extinction_far, forward_far, source_far, air_far
            cloud, ix, iy, level = cloud_far, ix_far, iy_far, level_far
    write(out.lit, n * PACK, lit)
    write(out.front, n * PACK, front)
    write(out.full, n * PACK, through)
    write(lane.gathered, 0, ahead)
    for c in range(PACK):
        out.full[n, c] *= math.exp(-lane.gathered[c])
    out.cloud_m[n] = w[START] + distance_m / max(min(cloud_depth, _ONE), _NOTHING)
    out.distance_m[n] = w[START] + w[S] if w[STATE] == HIT else -1.0
    out.samples[n] = int(w[SAMPLES])


@part(FINITE)
def _near_side_share(t, threads, rays, world, lanes, out):
    """Part t's tiles of rays, every so-manieth."""
    lane = lane_of(lanes, t, 0)
    for first in range(t * TILE, rays.order.shape[0], threads * TILE):
        for m in range(first, min(first + TILE, rays.order.shape[0])):
            n = rays.order[m]
            end_m = rays.ends_m[n] if rays.ends_m.size > 0 else -FAR_M
            start_walk(lane.walk, rays.origin_m[n], rays.direction[n], end_m, world.shells, world.volume)
            _follow(n, lane, world, out)


def near_side(
    origin: F64, direction: F64, shells: Shells, volume: Volume, scale: float, ends: F64 | None
) -> NearSide:
    """What rays (n, 3) meet of cloud; ``ends`` and ``scale`` as `march_rays` has them."""
    n = len(direction)
    out = NearSide(
        *(np.zeros((n, PACK), FLOAT) for _ in range(3)), np.zeros((n, max(volume.species, 1)), FLOAT),
        np.zeros(n, FLOAT), np.zeros(n), np.zeros(n, np.int64),
    )  # fmt: skip
    parts, peaks = parts_of(n), np.zeros((volume.species + 1, 2, 1, PACK), FLOAT)
    world = world_of(np.zeros(3), peaks, shells, volume, scale, NO_DETAIL)
    in_threads(
        _near_side_share, eye_rays(origin, direction, ends, None), world, Lanes.of(parts, volume, peaks), out,
        parts=parts,
    )  # fmt: skip
    return out
