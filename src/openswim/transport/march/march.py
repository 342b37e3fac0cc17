"""March: light gathered along an eye ray through shells and volume.

Walk a little (`walk.py`), look at the places (`sample.py`), add up: the same for every camera, the inflow at the
sides of the grid and the diffuse field of the clear atmosphere. All lengths in metres; radiances solar-relative
(Eq. 2, L' = 4 pi L/E_TOA).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import get_num_threads, njit
from numpy.typing import NDArray

from openswim.transport.engine.pack import PACK, flat, largest, put, read, write
from openswim.transport.engine.scalar import share_of_step, step_emission, table_index, transmission
from openswim.transport.engine.threads import in_threads
from openswim.transport.march.cloud_detail import FRESH, NO_DETAIL, SCRATCH, Detail
from openswim.transport.march.detail_step import FAINT, WIDEST, detailed_step
from openswim.transport.march.sample import RAY, prepare_ray, sample_air, sample_grid, turn_ray
from openswim.transport.march.volume import DEGREE, FAR_M, Shells, Volume, blank_fields, tidy
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
    WALK,
    S,
    start_walk,
    walk_on,
)

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
DARK = 3e-5  # transmission below which a ray has seen enough
NO_LIMIT = 1e30  # cloud depth that no ray meets
MOST_SAMPLES = 20_000
TILE = 256  # rays that follow each other
_PARTS = 16  # of a view's rays for each thread, taken one by one
_ZERO, _SIXTH, _HALF, _ONE = np.float32(0.0), np.float32(1 / 6), np.float32(0.5), np.float32(1.0)

# What a ray has gathered, a row of packs and numbers: radiance and transmission; where it stands extinction, what the
# forward peaks scatter besides, diffuse source, what is scattered of the beam, the beam, the air's extinction; depth in
# front of unit cloud depth; depth of the forward peaks to the eye; then depth of cloud, cloud's extinction where it
# stands, mean distance of unit cloud depth (sum), extinction of what is refined where it stands; scratch of detail
RADIANCE, THROUGH, EXTINCTION, FORWARD, SOURCE, SINGLE = 0, PACK, 2 * PACK, 3 * PACK, 4 * PACK, 5 * PACK
BEAM, AIR, FRONT, AHEAD = 6 * PACK, 7 * PACK, 8 * PACK, 9 * PACK
CLOUD_DEPTH, NEAR_CLOUD, DISTANCE, REFINED = 10 * PACK, 10 * PACK + 1, 10 * PACK + 2, 10 * PACK + 3
DETAIL, GATHERED = 11 * PACK, 11 * PACK + SCRATCH
LAST = BATCH * PLACE  # where among the places the last one of the batch before is kept
LANES = 4  # rays that walk in turn
WHICH, ANGLE, SHARE, LANE = 0, 1, 2, 8  # of a lane: its ray or -1, cosine of the angle to the sun, share of the peak


class Marched(NamedTuple):
    """What rays (n) bring back; (n, PACK) where nothing else is said."""

    radiance: F32
    scaled: F32  # e^-tau', transmission that the smooth field sees
    full: F32  # e^-tau
    front: F32  # optical depth of air and haze in front of unit cloud depth
    species_depth: F32  # (n, ns) optical depth of each species
    cloud_m: F32  # (n,) mean distance of the first unit of cloud depth
    distance_m: F64  # (n,) to the ground, negative where the ray leaves to space
    samples: NDArray[np.int64]  # (n,)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _start(got, species_depth):
    """A ray that has seen nothing."""
    for n in range(GATHERED):
        put(got, n, _ONE if THROUGH <= n < THROUGH + PACK else _ZERO)
    for n in range(species_depth.shape[0]):
        species_depth[n] = _ZERO


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _gather(
    w, places, got, nodes, share, ray, peak, sun, cos_angle, shells, volume, depth_limit, species_depth, cone, growth,
    detail,
):  # fmt: skip
    """Look at the places that a ray has walked to, and add up. Returns how many, fewer where it became dark."""
    ns = volume.species
    dark = np.float32(DARK if depth_limit >= NO_LIMIT else -1.0)
    radius = shells.radius_m
    # r mu_sun = sunward + s cos_angle
    sunward = w[OX] * sun[0] + w[OY] * sun[1] + (radius + w[OZ]) * sun[2]
    radiance, through = read(got, RADIANCE), read(got, THROUGH)
    extinction, forward, diffuse = read(got, EXTINCTION), read(got, FORWARD), read(got, SOURCE)
    single, beam = read(got, SINGLE), read(got, BEAM)
    air, front, ahead = read(got, AIR), read(got, FRONT), read(got, AHEAD)
    cloud_depth, near_cloud, distance = flat(got, CLOUD_DEPTH), flat(got, NEAR_CLOUD), flat(got, DISTANCE)
    count = int(w[COUNT])
    looked = count
    refined = flat(got, REFINED)
    widest_m = flat(detail.wavelength_m, 0) * WIDEST if detail.wavelength_m.shape[0] > 0 and growth > 0.0 else 0.0
    before = np.int64(LAST)  # no literal, for which what is called would be compiled once more
    for n in range(count):
        place = n * PLACE
        s, level = flat(places, place + PLACE_S), flat(places, place + PLACE_LEVEL)
        ds = np.float32(flat(places, place + PLACE_STEP))
        a, b = flat(places, place + PLACE_X), flat(places, place + PLACE_Y)
        half_step = _HALF * ds
        behind = ahead + half_step * forward
        if near_cloud > _ZERO:
            for m in range(ns):
                species_depth[m] += half_step * flat(nodes, 2 * PACK + m)
        cloud = _ZERO
        if level >= 0.0:
            extinction_far, forward_far, diffuse_far, single_far, beam_far, air_far, cloud = sample_grid(
                a, b, level, ray, peak, share, behind, half_step, volume, nodes
            )
        else:
            mu_sun = (sunward + s * cos_angle) / (radius + a)
            extinction_far, forward_far, diffuse_far, single_far, beam_far, air_far = sample_air(
                b, mu_sun, cos_angle, a, ray, peak, share, behind, half_step, shells, ns
            )
        if cloud > _ZERO:
            for m in range(ns):
                species_depth[m] += half_step * flat(nodes, 2 * PACK + m)
        added = half_step * (near_cloud + cloud)
        fronting = _ONE
        if added > _ZERO:
            if cloud_depth + added > _ONE:
                fronting = _ZERO
                if cloud_depth < _ONE:
                    fronting = share_of_step(near_cloud, cloud, ds, _ONE - cloud_depth)
            middle = np.float32(s) - ds * (_ONE - _HALF * fronting)
            distance += middle * min(added, max(_ONE - cloud_depth, _ZERO))
        elif cloud_depth >= _ONE:
            fronting = _ZERO
        source, source_far = diffuse + single * beam, diffuse_far + single_far * beam_far
        if added > _ZERO:
            # a cloud's scattering and the beam change together: their product's mean is not that of its ends
            bend = _SIXTH * (single_far - single) * (beam_far - beam)
            source -= bend
            source_far -= bend
        depth = (extinction + extinction_far) * half_step
        width_m = cone + growth * (w[START] + s)
        refined_far = _ZERO
        if cloud > _ZERO and width_m < widest_m:
            for m in range(ns):
                refined_far += flat(detail.refined, m) * flat(nodes, 2 * PACK + m)
        if (
            refined + refined_far > _ZERO and ds > _ZERO and level >= 0.0 and flat(places, before + PLACE_LEVEL) >= 0.0
            and largest(through) > np.float32(FAINT)
        ):  # fmt: skip
            radiance, through, ahead = detailed_step(
                radiance, through, ahead, ds, width_m, extinction, extinction_far, forward, forward_far, diffuse,
                diffuse_far, single, single_far, beam, beam_far, air, near_cloud, cloud, refined, refined_far, w,
                places, before, place, got[DETAIL:], radius, 1.0 * flat(volume.cell_m, 0), 1.0 * flat(volume.cell_m, 1),
                detail,
            )  # fmt: skip
        else:
            put(got, DETAIL + FRESH, _ZERO)
            trans = transmission(depth)
            if cloud_depth + added <= depth_limit:
                radiance += through * step_emission(depth, trans, ds, source, source_far, extinction, extinction_far)
            elif cloud_depth < depth_limit:
                # the source ends within the step
                part = share_of_step(near_cloud, cloud, ds, np.float32(depth_limit) - cloud_depth)
                last = extinction + part * (extinction_far - extinction)
                ended = (extinction + last) * (part * half_step)
                source_end = source + part * (source_far - source)
                radiance += through * step_emission(
                    ended, transmission(ended), part * ds, source, source_end, extinction, last
                )
            through *= trans
            ahead = behind + half_step * forward_far
        cloud_depth += added
        front += (fronting * half_step) * (air + air_far)
        extinction, forward, diffuse, single, beam = extinction_far, forward_far, diffuse_far, single_far, beam_far
        air, near_cloud, refined, before = air_far, cloud, refined_far, place
        if largest(through) < dark:
            looked = n + 1
            break
    write(got, RADIANCE, radiance)
    write(got, THROUGH, through)
    write(got, EXTINCTION, extinction)
    write(got, FORWARD, forward)
    write(got, SOURCE, diffuse)
    write(got, SINGLE, single)
    write(got, BEAM, beam)
    write(got, AIR, air)
    write(got, FRONT, front)
    write(got, AHEAD, ahead)
    put(got, CLOUD_DEPTH, cloud_depth)
    put(got, NEAR_CLOUD, near_cloud)
    put(got, DISTANCE, distance)
    put(got, REFINED, refined)
    if count > 0:
        for n in range(PLACE):
            put(places, LAST + n, flat(places, (count - 1) * PLACE + n))
    return looked


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _finish(n, w, got, out):
    """What ray ``n`` brings back."""
    for c in range(PACK):
        out.radiance[n, c] = got[RADIANCE + c]
        out.scaled[n, c] = got[THROUGH + c]
        out.full[n, c] = got[THROUGH + c] * math.exp(-got[AHEAD + c])
        out.front[n, c] = got[FRONT + c]
    out.cloud_m[n] = w[START] + got[DISTANCE] / max(min(got[CLOUD_DEPTH], _ONE), np.float32(1e-12))
    out.distance_m[n] = w[START] + w[S] if w[STATE] == HIT else -1.0
    out.samples[n] = int(w[SAMPLES])


@njit(cache=True, error_model="numpy", _nrt=False, nogil=True, fastmath=_FLAGS)
def _march_share(
    t, threads, order, scratch, walks_of, places_of, peaks_of, lanes_of, origin, direction, ends, sun, table, shells,
    volume, highest_m, depth_limit, scale, out, cone, detail,
):  # fmt: skip
    """Part t's tiles of rays, see `march_rays`: every so-manieth, for sky and ground do not cost the same. LANES of
    them walk in turn."""
    nodes, got, rays = scratch[0, t], scratch[1, t], scratch[2, t]
    walks, places, peaks, lanes = walks_of[t], places_of[t], peaks_of[t], lanes_of[t]
    count = direction.shape[0]
    following = t * TILE
    for lane in range(LANES):
        lanes[lane, WHICH], lanes[lane, ANGLE] = -1.0, FAR_M  # an angle that no ray has
    while True:
        going = False
        for lane in range(LANES):
            own = lanes[lane]
            if own[WHICH] < 0.0 and following < count:
                n = order[following]
                following += 1
                if following % TILE == 0:
                    following += (threads - 1) * TILE
                own[WHICH] = n
                dx, dy, dz = direction[n, 0], direction[n, 1], direction[n, 2]
                angle = dx * sun[0] + dy * sun[1] + dz * sun[2]
                if angle != own[ANGLE]:  # parallel rays are alike
                    own[ANGLE] = angle
                    own[SHARE] = prepare_ray(angle, table, shells.phase, volume, rays[lane], peaks[lane])
                turn_ray(dx, dy, dz, volume, rays[lane])
                end = ends[n] if ends.size > 0 else -FAR_M
                start_walk(walks[lane], origin[n, 0], origin[n, 1], origin[n, 2], dx, dy, dz, end, shells, volume)
                _start(got[lane], out.species_depth[n])
                places[lane, LAST + PLACE_LEVEL] = -1.0
            going = going or own[WHICH] >= 0.0
        if not going:
            break
        for _ in range(BATCH):
            for lane in range(LANES):
                if lanes[lane, WHICH] >= 0.0 and walks[lane, STATE] == GOING:
                    walk_on(walks[lane], places[lane], shells, volume, highest_m, scale)
        for lane in range(LANES):
            own, w = lanes[lane], walks[lane]
            if own[WHICH] < 0.0:
                continue
            n = int(own[WHICH])
            looked = _gather(
                w, places[lane], got[lane], nodes[lane], np.float32(own[SHARE]), rays[lane], peaks[lane], sun,
                own[ANGLE], shells, volume, depth_limit, out.species_depth[n], cone[n, 0], cone[n, 1], detail,
            )  # fmt: skip
            if looked < w[COUNT]:
                w[SAMPLES] -= w[COUNT] - looked
                w[STATE] = GONE
            w[COUNT] = 0.0
            if w[STATE] != GOING or w[SAMPLES] >= MOST_SAMPLES:
                _finish(n, w, got[lane], out)
                own[WHICH] = -1.0


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


def march_rays(
    origin: F64, direction: F64, sun: F64, table: F32, shells: Shells, volume: Volume, scale: float,
    depth_limit: float = NO_LIMIT, ends: F64 | None = None, cone: F64 | None = None, detail: Detail = NO_DETAIL,
) -> Marched:  # fmt: skip
    """March every ray: origin and direction (n, 3) or (3,), forward peaks ``table`` (species and aerosol, angle, depth,
    PACK), steps ``scale`` times the usual. ``ends`` (n,): distances to the ground in place of the grid's and the
    shells' own, FAR_M where there is none; what lies under the grid's terrain is as the air on it. Negative ones stop
    rays there that have not met the grid's ground or the shells' before. ``cone`` (n, 2): what rays are wide at their
    origins (m), and what they widen per metre; clouds have ``detail`` where rays that widen are narrow enough."""
    if shells.phase.shape[1] != DEGREE:
        raise ValueError("the shells were built for another truncation order")
    n = max(len(np.atleast_2d(origin)), len(np.atleast_2d(direction)))
    order = _by_neighbours(np.asarray(origin), np.asarray(direction)) if n > 4 * TILE else np.arange(n)
    # the kernel is compiled for arrays of one kind: contiguous, writable
    o, d = (np.array(np.broadcast_to(v, (n, 3)), float, order="C") for v in (origin, direction))
    out = Marched(
        *(np.zeros((n, PACK), np.float32) for _ in range(4)), np.zeros((n, max(volume.species, 1)), np.float32),
        np.zeros(n, np.float32), np.zeros(n), np.zeros(n, np.int64),
    )  # fmt: skip
    widest = max(volume.fields.shape[3], GATHERED, RAY + volume.species * PACK + DEGREE * DEGREE)
    parts = max(get_num_threads(), min(_PARTS * get_num_threads(), n // (4 * TILE)))
    scratch = blank_fields((3, parts, LANES), widest)
    peaks = np.zeros((parts, LANES, table.shape[0], table.shape[2], PACK), np.float32)
    walks, places, lanes = (np.zeros((parts, LANES, size)) for size in (WALK, (BATCH + 1) * PLACE, LANE))
    highest_m = max(shells.ground_m, float(volume.terrain_m.max()))
    own = np.zeros(0) if ends is None else np.array(ends, float, order="C")
    in_threads(
        _march_share, order, scratch, walks, places, peaks, lanes, o, d, own, np.array(sun, float),
        np.array(table, np.float32, order="C"), tidy(shells), tidy(volume), highest_m, float(depth_limit), float(scale),
        out, np.zeros((n, 2)) if cone is None else np.array(cone, float, order="C"), detail,
        parts=parts,
    )  # fmt: skip
    return out


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
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


@njit(cache=True, error_model="numpy", fastmath=_FLAGS)
def ground_radiance_rows(place, sun, shells):
    """`ground_radiance` (n, PACK) at places (n, 3) on the ground."""
    out = np.zeros((place.shape[0], PACK), np.float32)
    for n in range(place.shape[0]):
        ground_radiance(place[n, 0], place[n, 1], place[n, 2], sun[0], sun[1], sun[2], shells, out[n])
    return out
