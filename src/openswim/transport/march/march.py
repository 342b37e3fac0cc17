"""March: light gathered along an eye ray through shells and volume.

Walk a little (`walk.py`), look at the places (`sample.py`), add up: the same for every camera, the inflow at the
sides of the grid and the diffuse field of the clear atmosphere. All lengths in metres; radiances solar-relative
(Eq. 2, L' = 4 pi L/E_TOA).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, kernel, part
from openswim.transport.engine.pack import PACK, flat, largest, put, write
from openswim.transport.engine.scalar import step_emission, table_index, transmission
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.cloud_detail import FRESH, NO_DETAIL, Detail
from openswim.transport.march.detail_step import FAINT, WIDEST, Step, detailed_step
from openswim.transport.march.level_ice import NO_LEVEL_ICE, LevelIce, add_level_ice
from openswim.transport.march.sample import prepare_ray, sample_air, sample_grid, turn_ray
from openswim.transport.march.state import (
    AHEAD,
    ANGLE,
    DETAIL,
    IN_TURN,
    LAST,
    SHARE,
    WHICH,
    EyeRays,
    Gathered,
    Lanes,
    Ray,
    Sample,
    World,
    begin,
    gathered,
    keep,
    lane_of,
)
from openswim.transport.march.volume import AIR_DEGREE, FAR_M, Shells, Volume, tidy
from openswim.transport.march.walk import (
    BATCH,
    COUNT,
    GOING,
    GONE,
    HIT,
    OX,
    OY,
    OZ,
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

DARK = FLOAT(3e-5)  # transmission below which a ray has seen enough
# Within 10 degrees of the sun ever less, for what is behind is ever brighter: its disc (L' = 2e5) would show through
_PER_NEAR_SUN, _DARKEST = 1 / (1 - math.cos(math.radians(10.0))), FLOAT(1e-10)
MOST_SAMPLES = 20_000
TILE = 256  # rays that follow each other
_PARTS = 16  # of a view's rays for each thread, taken one by one
_ZERO, _SIXTH, _HALF = FLOAT(0.0), FLOAT(1 / 6), FLOAT(0.5)


class Marched(NamedTuple):
    """What rays (n) bring back; (n, PACK) where nothing else is said."""

    radiance: F32
    scaled: F32  # e^-tau', transmission that the smooth field sees
    full: F32  # e^-tau
    species_depth: F32  # (n, ns) optical depth of each species
    distance_m: F64  # (n,) to the ground, negative where the ray leaves to space
    samples: NDArray[np.int64]  # (n,)


@part(FINITE, inlined=True)
def _plain_step(seen, near, far, ds_m, ahead):
    """`Gathered` after a step of ``ds_m`` between two `Sample`s without detail; ``ahead``: depth of the forward peaks
    but for the far sample's.

        dL'/ds = S e^-tau',  dtau'/ds = beta',  S = J + P b

    of the diffuse source J, and P what is scattered of the beam b; beta' and S linear along the step (F9). In cloud P
    and b change together, and the mean of their product is that of its ends less (P_f - P_n)(b_f - b_n)/6.
    """
    half_step_m = _HALF * ds_m
    source, source_far = near.diffuse + near.single * near.beam, far.diffuse + far.single * far.beam
    if near.cloud + far.cloud > _ZERO:
        bend = _SIXTH * (far.single - near.single) * (far.beam - near.beam)
        source -= bend
        source_far -= bend
    depth = (near.extinction + far.extinction) * half_step_m
    trans = transmission(depth)
    added = step_emission(depth, trans, ds_m, source, source_far, near.extinction, far.extinction)
    return Gathered(
        seen.radiance + seen.through * added, seen.through * trans, ahead + half_step_m * far.forward
    )  # fmt: skip


@part(FINITE, inlined=True)
def _gather(lane, world, cone, species_depth):
    """Look at the places that a ray has walked to, and add up: radiance, transmission and the forward peaks' depth by
    `_plain_step` or `detailed_step`, and ``species_depth`` (ns,), by the trapezoidal rule over the reference extinction
    that sampling leaves in ``lane.nodes``. ``cone`` (2,): see `EyeRays`. Returns how many, fewer where it became dark.
    """
    w, places, nodes = lane.walk, lane.places, lane.nodes
    shells, volume, detail, sun = world.shells, world.volume, world.detail, world.sun
    ns, radius_m = volume.species, shells.radius_m
    ray = Ray(lane.own[ANGLE], FLOAT(lane.own[SHARE]), lane.constants, lane.peak)
    # r mu_sun = sunward + s cos_angle
    sunward = w[OX] * sun[0] + w[OY] * sun[1] + (radius_m + w[OZ]) * sun[2]
    aside = FLOAT(min(1.0, (1.0 - ray.cos_angle) * _PER_NEAR_SUN))
    dark = max(DARK * aside * aside, _DARKEST)
    seen, near = gathered(lane)
    count = int(w[COUNT])
    looked = count
    widens = cone[1]
    widest_m = flat(detail.wavelength_m, 0) * WIDEST if detail.wavelength_m.shape[0] > 0 and widens > 0.0 else 0.0
    before = np.int64(LAST)  # no literal, for which what is called would be compiled once more
    for n in range(count):
        place = n * PLACE
        s, level = flat(places, place + PLACE_S), flat(places, place + PLACE_LEVEL)
        ds_m = FLOAT(flat(places, place + PLACE_STEP))
        a, b = flat(places, place + PLACE_X), flat(places, place + PLACE_Y)
        half_step_m = _HALF * ds_m
        ahead = seen.ahead + half_step_m * near.forward
        if near.cloud > _ZERO:
            for m in range(ns):
                species_depth[m] += half_step_m * flat(nodes, 2 * PACK + m)
        if level >= 0.0:
            there = sample_grid(a, b, level, ray, ahead, half_step_m, volume, nodes)
        else:
            mu_sun = (sunward + s * ray.cos_angle) / (radius_m + a)
            there = sample_air(b, mu_sun, a, ray, ahead, half_step_m, shells)
        width_m = cone[0] + widens * (w[START] + s)
        refined = _ZERO
        if there.cloud > _ZERO:
            for m in range(ns):
                x = flat(nodes, 2 * PACK + m)
                species_depth[m] += half_step_m * x
                if width_m < widest_m:
                    refined += flat(detail.refined, m) * x
        far = Sample(
            there.extinction, there.forward, there.diffuse, there.single, there.beam, there.air, there.cloud, refined
        )
        if (
            near.refined + refined > _ZERO and ds_m > _ZERO and level >= 0.0
            and flat(places, before + PLACE_LEVEL) >= 0.0 and largest(seen.through) > FLOAT(FAINT)
        ):  # fmt: skip
            step = Step(ds_m, width_m, width_m / widens, before, place)
            seen = detailed_step(
                seen, near, far, step, w, places, lane.gathered[DETAIL:], radius_m, volume.cell_m, detail
            )
        else:
            put(lane.gathered, DETAIL + FRESH, _ZERO)
            seen = _plain_step(seen, near, far, ds_m, ahead)
        near, before = far, place
        if largest(seen.through) < dark:
            looked = n + 1
            break
    keep(lane, seen, near)
    if count > 0:
        for n in range(PLACE):
            put(places, LAST + n, flat(places, (count - 1) * PLACE + n))
    return looked


@part(FINITE)
def _finish(n, lane, out):
    """What ray ``n`` brings back."""
    w = lane.walk
    seen, _ = gathered(lane)
    write(out.radiance, n * PACK, seen.radiance)
    write(out.scaled, n * PACK, seen.through)
    for c in range(PACK):
        out.full[n, c] = out.scaled[n, c] * math.exp(-lane.gathered[AHEAD + c])
    out.distance_m[n] = w[START] + w[S] if w[STATE] == HIT else -1.0
    out.samples[n] = int(w[SAMPLES])


@part(FINITE, inlined=True)
def _send(n, lane, rays, world, species_depth):
    """Begin ray ``n``."""
    sun, own = world.sun, lane.own
    own[WHICH] = n
    dx, dy, dz = rays.direction[n, 0], rays.direction[n, 1], rays.direction[n, 2]
    angle = dx * sun[0] + dy * sun[1] + dz * sun[2]
    plates = world.level_ice.table.shape[0] > 0
    if angle != own[ANGLE] or plates:  # parallel rays are alike
        own[ANGLE] = angle
        own[SHARE] = prepare_ray(angle, world.table, world.shells.phase, world.volume, lane.constants, lane.peak)
    if plates:
        add_level_ice(dx, dy, dz, world.level_ice, lane.constants)
    turn_ray(dx, dy, dz, world.volume, lane.constants)
    end_m = rays.ends_m[n] if rays.ends_m.size > 0 else -FAR_M
    start_walk(lane.walk, rays.origin_m[n], rays.direction[n], end_m, world.shells, world.volume)
    begin(lane, species_depth)


@part(FINITE)
def _march_share(t, threads, rays, world, lanes, out):
    """Part t's tiles of rays, see `march_rays`: every so-manieth, for sky and ground do not cost the same. Some walk in
    turn, for each step waits for the one before."""
    count = rays.order.shape[0]
    following = t * TILE
    for n in range(IN_TURN):
        lanes.own[t, n, WHICH], lanes.own[t, n, ANGLE] = -1.0, FAR_M  # an angle that no ray has
    while True:
        going = False
        for n in range(IN_TURN):
            if lanes.own[t, n, WHICH] < 0.0 and following < count:
                which = rays.order[following]
                following += 1
                if following % TILE == 0:
                    following += (threads - 1) * TILE
                _send(which, lane_of(lanes, t, n), rays, world, out.species_depth[which])
            going = going or lanes.own[t, n, WHICH] >= 0.0
        if not going:
            break
        for _ in range(BATCH):
            for n in range(IN_TURN):
                if lanes.own[t, n, WHICH] >= 0.0 and lanes.walk[t, n, STATE] == GOING:
                    walk_on(
                        lanes.walk[t, n], lanes.places[t, n], world.shells, world.volume, world.highest_m, world.scale
                    )
        for n in range(IN_TURN):
            lane = lane_of(lanes, t, n)
            w = lane.walk
            if lane.own[WHICH] < 0.0:
                continue
            which = int(lane.own[WHICH])
            looked = _gather(lane, world, rays.cone[which], out.species_depth[which])
            if looked < w[COUNT]:
                w[SAMPLES] -= w[COUNT] - looked
                w[STATE] = GONE
            w[COUNT] = 0.0
            if w[STATE] != GOING or w[SAMPLES] >= MOST_SAMPLES:
                _finish(which, lane, out)
                lane.own[WHICH] = -1.0


def march_rays(
    origin: F64, direction: F64, sun: F64, table: F32, shells: Shells, volume: Volume, scale: float,
    ends: F64 | None = None, cone: F64 | None = None, detail: Detail = NO_DETAIL,
    level_ice: LevelIce = NO_LEVEL_ICE,
) -> Marched:  # fmt: skip
    """March every ray: origin and direction (n, 3) or (3,), forward peaks ``table`` (species and aerosol, angle, depth,
    PACK), steps ``scale`` times the usual. ``ends`` (n,): distances to the ground in place of the grid's and the
    shells' own, FAR_M where there is none; what lies under the grid's terrain is as the air on it. Negative ones stop
    rays there that have not met the grid's ground or the shells' before. ``cone`` (n, 2): what rays are wide at their
    origins (m), and what they widen per metre; clouds have ``detail`` where rays that widen are narrow enough.
    ``level_ice``: plates among the species."""
    if shells.phase.shape[1] != AIR_DEGREE:
        raise ValueError("the shells were built for another truncation order")
    rays = eye_rays(origin, direction, ends, cone)
    n = len(rays.order)
    out = Marched(
        *(np.zeros((n, PACK), FLOAT) for _ in range(3)), np.zeros((n, max(volume.species, 1)), FLOAT),
        np.zeros(n), np.zeros(n, np.int64),
    )  # fmt: skip
    parts = parts_of(n)
    peaks = np.require(table, FLOAT, ["C", "W"])  # large: not copied where it need not be
    world = world_of(sun, peaks, shells, volume, scale, detail, level_ice)
    in_threads(_march_share, rays, world, Lanes.of(parts, volume, peaks), out, parts=parts)
    return out


def eye_rays(origin: F64, direction: F64, ends: F64 | None, cone: F64 | None) -> EyeRays:
    """Rays as kernels are compiled for them, in arrays of one kind: contiguous, writable."""
    n = max(len(np.atleast_2d(origin)), len(np.atleast_2d(direction)))
    order = _by_neighbours(np.asarray(origin), np.asarray(direction)) if n > 4 * TILE else np.arange(n)
    o, d = (np.array(np.broadcast_to(v, (n, 3)), float, order="C") for v in (origin, direction))
    own = np.zeros(0) if ends is None else np.array(ends, float, order="C")
    return EyeRays(order, o, d, own, np.zeros((n, 2)) if cone is None else np.array(cone, float, order="C"))


def world_of(
    sun: F64, table: F32, shells: Shells, volume: Volume, scale: float, detail: Detail,
    level_ice: LevelIce = NO_LEVEL_ICE,
) -> World:  # fmt: skip
    """The same for what they go through."""
    highest_m = max(shells.ground_m, float(volume.terrain_m.max()))
    return World(tidy(shells), tidy(volume), detail, np.array(sun, float), table, highest_m, float(scale), level_ice)


def parts_of(n: int) -> int:
    """Into how many parts n rays are divided among the threads."""
    return max(get_num_threads(), min(_PARTS * get_num_threads(), n // (4 * TILE)))


def _by_neighbours(origin: F64, direction: F64) -> NDArray[np.int64]:
    """An order of rays in which those that look at about the same place follow each other, whatever the image."""
    n = max(len(np.atleast_2d(origin)), len(np.atleast_2d(direction)))
    key = np.zeros(n, np.uint16)
    bins = int(np.clip((n / TILE / 3) ** 0.5, 1, 40))  # directions lie on a sphere: about 3 bins^2 are in use
    for vectors in (origin, direction):
        if vectors.ndim == 1:
            continue
        for axis in range(3):
            v = vectors[:, axis]
            low, high = v.min(), v.max()
            if high - low > 1e-9:
                key = key * np.uint16(bins) + ((v - low) * ((bins - 1e-6) / (high - low))).astype(np.uint16)
    return np.argsort(key, kind="stable")


@part(FINITE)
def ground_radiance(x, y, z, sx, sy, sz, shells, out):
    """L' of the Lambertian ground below the shells, lit by `ground_flux` at the local sun: 4 a E/E_TOA (Eq. 35)."""
    radius = shells.radius_m
    r = math.sqrt(x * x + y * y + (radius + z) * (radius + z))
    mu_sun = (x * sx + y * sy + (radius + z) * sz) / r
    t = table_index(mu_sun, -1.0, 0.5 * (shells.moment_sun_table.shape[0] - 1), shells.moment_sun_table)
    m = min(int(t), shells.ground_flux.shape[0] - 2)
    e = t - m
    for w in range(PACK):
        flux = (1 - e) * shells.ground_flux[m, w] + e * shells.ground_flux[m + 1, w]
        out[w] = 4.0 * shells.ground_albedo[w] * flux


@kernel(FINITE)
def ground_radiance_rows(place, sun, shells):
    """`ground_radiance` (n, PACK) at places (n, 3) on the ground."""
    out = np.zeros((place.shape[0], PACK), FLOAT)
    for n in range(place.shape[0]):
        ground_radiance(place[n, 0], place[n, 1], place[n, 2], sun[0], sun[1], sun[2], shells, out[n])
    return out
