"""One camera path of the Monte Carlo solver, from the eye to wherever its light came from.

Backward paths with next-event estimation to the sun. All wavelengths share a path: each has its own weight, and what
is drawn is drawn from the mean of their distributions (Wilkie et al. 2014). Weights never estimate the same light
twice: directions toward the sun's forward peak are drawn both by the phase function and by aiming at the sun, joined
by the balance heuristic (detection-directional importance sampling of Buras & Mayer 2011, made a split).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from openswim.transport.engine.compiled import IN_ORDER, kernel, part
from openswim.transport.march.level_ice import map_place
from openswim.transport.montecarlo.ground import (
    level_water,
    mirrored,
    mirrored_density,
    mirrored_light,
    mirrored_share,
    reflected,
)
from openswim.transport.montecarlo.phase import drawn_q, phase_place, turned, uniform, unit_circle
from openswim.transport.montecarlo.place import air_place, diffuse_albedo, facet, upward
from openswim.transport.montecarlo.track import CLOUD, ESCAPED, GROUND, NUDGE_M, fly, sunlight

STACK = 48  # split paths that wait
LEAST_WORTH = 0.2  # of the path's first collision: below it chance decides whether a path goes on
LEAST_GROUND = 0.4  # likewise, where it leaves the ground,
LEAST_RETURN = 0.1  # which is never rarer than this
_CLEAR = 0.98  # of the sun's light: from ground that has as much, the sun is not aimed at
LEAST_SOURCE = 0.1  # of a local estimate, likewise


class Sight(NamedTuple):
    """What a path begins with."""

    eye: bool  # the ground that it meets first is seen as ``seen`` says, else as by scattered light
    ray: int  # its number in ``seen``
    seen: NamedTuple


class Drawing(NamedTuple):
    """How a path's chances are shifted, which its weights undo."""

    boosted: bool  # by ``boost``, until it first meets something
    boost: np.ndarray  # (layers,) how much more often
    aiming: float  # chance to split toward the sun at a scattering


class Work(NamedTuple):
    """Work space of a thread."""

    scratch: np.ndarray  # (6, wavelengths)
    shares: np.ndarray  # (species + 2, wavelengths)
    nodes: np.ndarray  # (species,)
    stack: np.ndarray  # (STACK + 1, 7 + wavelengths): split paths that wait, and one that is kept


@kernel()
def work_space(nw, ns):
    """`Work` for so many wavelengths and species."""
    return Work(np.zeros((6, nw)), np.zeros((ns + 2, nw)), np.zeros(ns), np.zeros((STACK + 1, 7 + max(nw, ns))))


@part(IN_ORDER, inlined=True)
def scatterers(event, h, world, shares, scattered, nodes):
    """Shares (ns + 2, nw) of the species, molecules and haze in what was scattered at an event."""
    nw, ns = scattered.shape[0], nodes.shape[0]
    if event == CLOUD:
        for w in range(nw):
            inverse = 1.0 / scattered[w] if scattered[w] > 0.0 else 0.0
            for n in range(ns):
                shares[n, w] = nodes[n] * world.scattering[n, w] * inverse
        return 0, ns
    i, f = air_place(h, world)
    low, high = world.air[i], world.air[i + 1]
    for w in range(nw):
        inverse = 1.0 / scattered[w] if scattered[w] > 0.0 else 0.0
        for n in range(2):
            shares[ns + n, w] = (low[1 + n, w] + f * (high[1 + n, w] - low[1 + n, w])) * inverse
    return ns, ns + 2


@part(IN_ORDER, inlined=True)
def mixed_phase(q, w, first, last, nw, shares, phases):
    """Phase function of the mixture at wavelength w."""
    i, f = phase_place(q, phases.q)
    p = 0.0
    for n in range(first, last):
        v = phases.value[n * nw + w]
        p += shares[n, w] * (v[i] + f * (v[i + 1] - v[i]))
    return p


@part(IN_ORDER, inlined=True)
def black(ix, iy, straight, ray, seen, world, out):
    """Whether ground at a place is known to reflect nothing; ``out`` (nw,) is work space."""
    nw = out.shape[0]
    if straight and not seen.lambertian:
        return False
    if not straight:
        diffuse_albedo(ix, iy, world, out)
    most = 0.0
    for w in range(nw):
        most = max(most, seen.albedo[ray, w] if straight else out[w])
    return most <= 0.0


@part(IN_ORDER, inlined=True)
def off_sun(dx, dy, dz, world):
    """1 - cos of the angle between a direction and the sun's, without cancellation."""
    x, y, z = dx - world.sun[0], dy - world.sun[1], dz - world.sun[2]
    return 0.5 * (x * x + y * y + z * z)


@part(IN_ORDER, inlined=True)
def aimed(q, phases):
    """Density of directions aimed at the sun, mean 1 over the sphere."""
    i, f = phase_place(q, phases.q)
    return phases.aim[i] + f * (phases.aim[i + 1] - phases.aim[i])


@part(IN_ORDER, inlined=True)
def _add_sunlight(x, y, z, h, weight, factor, whole, world, beam, before, nodes, rng, out):
    """Add the sun's light at a place, times ``weight`` and ``factor`` (nw,), to ``out``. Returns how much arrives.

    ``whole``: sum of weights at the path's first collision; where the light is small beside it, chance decides whether
    it is looked at. ``beam``, ``before`` (nw,), ``nodes`` (ns,): work space.
    """
    nw = beam.shape[0]
    worth = 0.0
    for w in range(nw):
        worth = max(worth, weight[w] * factor[w])
    chance = min(1.0, worth * nw / (LEAST_SOURCE * whole))
    if worth <= 0.0 or (chance < 1.0 and uniform(rng) >= chance):
        return 0.0
    for w in range(nw):
        before[w] = weight[w] * factor[w] / chance
    most = 0.0
    if sunlight(x, y, z, h, world, beam, nodes, rng):
        for w in range(nw):
            out[w] += before[w] * beam[w]
            most = max(most, beam[w])
    return most


@part(IN_ORDER, inlined=True)
def trace(place, direction, sight, drawing, world, phases, work, rng, out):
    """Add one path's radiance to ``out`` (nw,); it begins at a place (x, y, z) in a direction (x, y, z)."""
    nw = out.shape[0]
    x, y, z = place
    dx, dy, dz = direction
    eye, ray, seen = sight
    boosted, boost, aiming = drawing
    scratch, shares, nodes, stack = work
    weight, scattered, taken, beam, factor, before = (
        scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5],
    )  # fmt: skip
    straight = eye
    whole = 0.0
    for w in range(nw):
        weight[w] = 1.0
    waiting = 0
    while True:
        event, s, h, ix, iy = fly(
            x, y, z, dx, dy, dz, 0.0, boosted and straight, boost, weight, scattered, taken, nodes, world, rng
        )  # fmt: skip
        alive = event != ESCAPED and not (event == GROUND and black(ix, iy, straight, ray, seen, world, factor))
        if alive:
            x, y, z = x + s * dx, y + s * dy, z + s * dz
            total = 0.0
            for w in range(nw):
                total += weight[w]
            if whole == 0.0:
                whole = total
            first, last, bright, by_waves = 0, 0, 0.0, 0.0
            nx, ny, nz = 0.0, 0.0, 1.0
            if event == GROUND:
                nx, ny, nz = facet(ix, iy, x, y, z, h, world)
                if straight and level_water(ray, seen):
                    nx, ny, nz = upward(x, y, z, h, world)
                x, y, z = x + NUDGE_M * nx, y + NUDGE_M * ny, z + NUDGE_M * nz
                h += NUDGE_M * nz
                toward_sun = nx * world.sun[0] + ny * world.sun[1] + nz * world.sun[2]
                toward_eye = -(nx * dx + ny * dy + nz * dz)
                cos_angle = -(dx * world.sun[0] + dy * world.sun[1] + dz * world.sun[2])
                if straight:
                    reflected(toward_sun, toward_eye, cos_angle, ray, seen, factor)
                    by_waves = mirrored_share(toward_eye, ray, seen)
                    if by_waves > 0.0:
                        bright = total * mirrored_light(toward_eye, ray, seen)
                else:
                    diffuse_albedo(ix, iy, world, factor)
                for w in range(nw):
                    bright += weight[w] * factor[w]
                    factor[w] *= 4.0 * max(toward_sun, 0.0)
            else:
                first, last = scatterers(event, h, world, shares, scattered, nodes)
                q = off_sun(dx, dy, dz, world)
                for w in range(nw):
                    factor[w] = mixed_phase(q, w, first, last, nw, shares, phases)
                if event == CLOUD and world.plates >= 0:
                    i, j, f, g = map_place(dx, dy, dz, world.plate_axes, world.plate_map.shape)
                    for w in range(nw):
                        more = (1.0 - f) * (1.0 - g) * world.plate_map[i, j, w]
                        more += (1.0 - f) * g * world.plate_map[i, j + 1, w]
                        more += f * (1.0 - g) * world.plate_map[i + 1, j, w] + f * g * world.plate_map[i + 1, j + 1, w]
                        factor[w] = max(factor[w] + shares[world.plates, w] * more, 0.0)
            lit = _add_sunlight(x, y, z, h, weight, factor, whole, world, beam, before, nodes, rng, out)
            if event == GROUND:
                chance = min(max(bright / (LEAST_GROUND * whole), LEAST_RETURN), 1.0)
                alive = uniform(rng) < chance
                total /= chance
                for w in range(nw):
                    weight[w] /= chance
            # two ways on: by the phase function, and by chance a second photon aimed at the sun
            density = 0.0
            if alive and waiting < STACK and not (event == GROUND and lit > _CLEAR):
                density = aiming
            split = density > 0.0 and uniform(rng) < density
            for w in range(nw):
                before[w] = weight[w]
            ax, ay, az = dx, dy, dz
            for way in range(alive + split):
                own = 0.0
                if way == 1:
                    q, _ = drawn_q(uniform(rng), phases.q, phases.aim, phases.aim_chance, phases.aim_guide)
                    c, e = unit_circle(rng)
                    dx, dy, dz = turned(world.sun[0], world.sun[1], world.sun[2], q, c, e)
                elif event == GROUND and by_waves > 0.0 and uniform(rng) < by_waves:
                    dx, dy, dz = mirrored(ax, ay, az, nx, ny, nz, ray, seen, rng)
                elif event == GROUND:
                    c, e = unit_circle(rng)
                    q = 1.0 - math.sqrt(uniform(rng))
                    dx, dy, dz = turned(nx, ny, nz, q, c, e)
                else:
                    lead = 0
                    if nw > 1:
                        pick = uniform(rng) * total
                        while lead < nw - 1 and pick >= before[lead]:
                            pick -= before[lead]
                            lead += 1
                    n = first
                    if last - first > 1:
                        pick = uniform(rng)
                        while n < last - 1 and pick >= shares[n, lead]:
                            pick -= shares[n, lead]
                            n += 1
                    row = n * nw + lead
                    q, own = drawn_q(uniform(rng), phases.q, phases.value[row], phases.chance[row], phases.guide[row])
                    c, e = unit_circle(rng)
                    dx, dy, dz = turned(ax, ay, az, q, c, e)
                # densities of this direction: by the photon's own way, and by aiming
                if event == GROUND:
                    toward = nx * dx + ny * dy + nz * dz
                    own = 4.0 * max(toward, 0.0)
                    if straight:
                        cos_angle = -(dx * ax + dy * ay + dz * az)
                        reflected(toward, -(nx * ax + ny * ay + nz * az), cos_angle, ray, seen, factor)
                    else:
                        diffuse_albedo(ix, iy, world, factor)
                    for w in range(nw):
                        factor[w] *= own
                    if by_waves > 0.0:
                        own *= 1.0 - by_waves
                        own += by_waves * mirrored_density(ax, ay, az, dx, dy, dz, nx, ny, nz, ray, seen)
                elif way == 0 and nw == 1 and last - first == 1:
                    factor[0] = own
                else:
                    if way == 1:
                        ux, uy, uz = dx - ax, dy - ay, dz - az
                        q = 0.5 * (ux * ux + uy * uy + uz * uz)
                    own = 0.0
                    for w in range(nw):
                        factor[w] = mixed_phase(q, w, first, last, nw, shares, phases)
                        own += before[w] * factor[w]
                    own /= total
                worth = 0.0
                toward_sun = aimed(off_sun(dx, dy, dz, world), phases) if density > 0.0 else 0.0
                both = own + density * toward_sun
                scale = 1.0 / both if both > 0.0 else 0.0
                for w in range(nw):
                    weight[w] = before[w] * factor[w] * scale
                    worth += weight[w]
                # a path is worth its weight, and more where the sun's forward peak is near
                worth *= (1.0 + density * toward_sun) / (LEAST_WORTH * whole)
                if worth < 1.0:
                    if worth <= 0.0 or uniform(rng) >= worth:
                        weight[0] = -1.0
                    else:
                        for w in range(nw):
                            weight[w] /= worth
                if way == 0:
                    alive = weight[0] >= 0.0
                    if split:
                        # kept while the second way is tried
                        keep = stack[STACK]
                        keep[0], keep[1], keep[2] = dx, dy, dz
                        for w in range(nw):
                            keep[7 + w] = weight[w]
                elif weight[0] >= 0.0:
                    entry = stack[waiting]
                    entry[0], entry[1], entry[2], entry[3], entry[4], entry[5] = x, y, z, dx, dy, dz
                    for w in range(nw):
                        entry[7 + w] = weight[w]
                    waiting += 1
            if split:
                keep = stack[STACK]
                dx, dy, dz = keep[0], keep[1], keep[2]
                for w in range(nw):
                    weight[w] = keep[7 + w]
            straight = False
        if not alive:
            if waiting == 0:
                return
            waiting -= 1
            entry = stack[waiting]
            x, y, z, dx, dy, dz = entry[0], entry[1], entry[2], entry[3], entry[4], entry[5]
            for w in range(nw):
                weight[w] = entry[7 + w]
            straight = False
