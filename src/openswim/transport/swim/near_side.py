"""What eye rays meet of cloud with the `swim` setting: depths, and how much light the near side of a cloud has.

Rays walk as the march's do (`march/walk.py`), and add up what Eqs 12 and 32-34 of Albers et al. (2020) ask for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.engine.pack import PACK, flat, low, put, spread, write
from openswim.transport.engine.scalar import share_of_step, step_emission, transmission
from openswim.transport.engine.threads import in_threads
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

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_NOTHING = np.float32(1e-12)
DEPTH_OF_VIEW = np.float32(2.0)  # l of Eq. 12


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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _lit_step(near, far, extinction, extinction_far, ds_m):
    """What a step adds at its near end of sources ``near`` and ``far``, extinction and source linear along it (F9)."""
    depth = (_HALF * ds_m) * (extinction + extinction_far)
    return step_emission(depth, transmission(depth), ds_m, near, far, extinction, extinction_far)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _follow(n, lane, world, out):
    """Ray ``n`` from `start_walk` on to its end. With extinction beta of air and cloud, x of all cloud alone, and the
    source S = omega beta E/E_TOA of Eq. 8 at the nodes, all linear along a step,

        lit = int S e^-tau ds to l = int x ds, the step in which l is met ending there; front = int beta_air ds to
        int x ds = 1, likewise; cloud_m = int s x ds / int x ds to int x ds = 1, by the middles of steps.
    """
    w, places, nodes = lane.walk, lane.places, lane.nodes
    shells, volume, species_depth = world.shells, world.volume, out.species_depth[n]
    ray = Ray(0.0, _ZERO, lane.constants, lane.peak)  # nothing is scattered of the beam but by the nodes' source
    lit, through, front, ahead = spread(_ZERO), spread(_ONE), spread(_ZERO), spread(_ZERO)
    extinction, forward, source, air = spread(_ZERO), spread(_ZERO), spread(_ZERO), spread(_ZERO)
    cloud, cloud_depth, distance_m = _ZERO, _ZERO, _ZERO
    while w[STATE] == GOING and w[SAMPLES] < MOST_SAMPLES:
        w[COUNT] = 0.0
        while w[STATE] == GOING and w[COUNT] < BATCH:
            walk_on(w, places, shells, volume, world.highest_m, world.scale)
        for place in range(0, int(w[COUNT]) * PLACE, PLACE):
            ds_m = np.float32(flat(places, place + PLACE_STEP))
            half_step_m = _HALF * ds_m
            if cloud > _ZERO:
                for m in range(volume.species):
                    put(species_depth, m, flat(species_depth, m) + half_step_m * flat(nodes, 2 * PACK + m))
            a, level = flat(places, place + PLACE_X), flat(places, place + PLACE_LEVEL)
            if level >= 0.0:
                b = flat(places, place + PLACE_Y)
                there = sample_grid(a, b, level, ray, ahead, half_step_m, volume, nodes)
                extinction_far, forward_far, source_far = there.extinction, there.forward, there.diffuse
                air_far, cloud_far = there.air, there.cloud
            else:
                row, _, _ = air_at(a, shells)
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
                middle_m = np.float32(flat(places, place + PLACE_S)) - ds_m * (_ONE - _HALF * fronting)
                distance_m += middle_m * min(added, max(_ONE - cloud_depth, _ZERO))
                if cloud_depth + added <= DEPTH_OF_VIEW:
                    lit += through * _lit_step(source, source_far, extinction, extinction_far, ds_m)
                elif cloud_depth < DEPTH_OF_VIEW:
                    part = share_of_step(cloud, cloud_far, ds_m, DEPTH_OF_VIEW - cloud_depth)
                    end, last = source + part * (source_far - source), extinction + part * (extinction_far - extinction)
                    lit += through * _lit_step(source, end, extinction, last, part * ds_m)
                cloud_depth += added
            through *= transmission((extinction + extinction_far) * half_step_m)
            ahead += half_step_m * (forward + forward_far)
            front += (fronting * half_step_m) * (air + air_far)
            extinction, forward, source, air = extinction_far, forward_far, source_far, air_far
            cloud = cloud_far
    write(out.lit, n * PACK, lit)
    write(out.front, n * PACK, front)
    write(out.full, n * PACK, through)
    write(lane.gathered, 0, ahead)
    for c in range(PACK):
        out.full[n, c] *= math.exp(-lane.gathered[c])
    out.cloud_m[n] = w[START] + distance_m / max(min(cloud_depth, _ONE), _NOTHING)
    out.distance_m[n] = w[START] + w[S] if w[STATE] == HIT else -1.0
    out.samples[n] = int(w[SAMPLES])


@njit(cache=True, error_model="numpy", _nrt=False, nogil=True, fastmath=_FLAGS)
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
        *(np.zeros((n, PACK), np.float32) for _ in range(3)), np.zeros((n, max(volume.species, 1)), np.float32),
        np.zeros(n, np.float32), np.zeros(n), np.zeros(n, np.int64),
    )  # fmt: skip
    parts, peaks = parts_of(n), np.zeros((volume.species + 1, 2, 1, PACK), np.float32)
    world = world_of(np.zeros(3), peaks, shells, volume, scale, NO_DETAIL)
    in_threads(
        _near_side_share, eye_rays(origin, direction, ends, None), world, Lanes.of(parts, volume, peaks), out,
        parts=parts,
    )  # fmt: skip
    return out
