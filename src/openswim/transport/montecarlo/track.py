"""Photons on their way: delta tracking from block to block and layer to layer (Woodcock et al. 1965)."""

from __future__ import annotations

import math

import numpy as np

from openswim.transport.engine.compiled import IN_ORDER, part
from openswim.transport.engine.scalar import flat, shadow_fraction
from openswim.transport.march.volume import SUN_RADIUS_RAD
from openswim.transport.montecarlo.covered import cover
from openswim.transport.montecarlo.phase import exponential, uniform
from openswim.transport.montecarlo.place import (
    FAR,
    air_place,
    chart_place,
    ground_crossing_m,
    ground_height_m,
    in_domain,
    level_below,
    on_ray,
    place,
    ray_constants,
    species_at,
    wrapped,
)
from openswim.transport.montecarlo.world import AIR_NODES, AIR_STEP_M, BLOCK, SUN_COSINES, SUN_HEIGHTS

PAST_FACE = 1e-6  # cells: rays that all but keep to a face, as those along meridians, would stop there at each nudge
NUDGE_M = 0.01  # past a face, so that no step ends on it; blocks reach a cell beyond their faces
LEAST_BEAM = 0.25  # of a beam through cloud: below it chance decides whether it goes on
ESCAPED, GROUND, CLOUD, AIR = 0, 1, 2, 3
FARTHEST_M = 1e8  # level rays in periodic scenes end somewhere
_STRETCH = 4.0  # tentative collisions per wanted one where the air's are multiplied


@part(IN_ORDER, inlined=True)
def fall_m(b, here, h, per_rise, world):
    """Distance down to height h, FAR where it is missed; ``here`` and b from `on_ray`."""
    if b >= 0.0:
        return FAR
    if not world.curved:
        return (h - here) * per_rise
    c = here - h * (2.0 * world.radius_m + h)
    root = b * b - c
    if root <= 0.0:
        return FAR
    return c / (-b + math.sqrt(root))


@part(IN_ORDER, inlined=True)
def climb_m(b, here, h, per_rise, world):
    """Distance up to height h from below it."""
    if not world.curved:
        return (h - here) * per_rise if b > 0.0 else FAR
    c = h * (2.0 * world.radius_m + h) - here
    root = math.sqrt(max(b * b + c, 0.0))
    return c / (b + root) if b > 0.0 else root - b


@part(IN_ORDER, inlined=True)
def _beside_m(ix, iy, per_x, per_y, world):
    """A step beside the domain that ends before it, or FAR where the ray never meets it."""
    ny, nx = world.terrain_m.shape
    cell = min(world.cell_m[0], world.cell_m[1])
    if ix < -1e8:
        return max(0.1 * (world.chart.shape[0] - 1) / world.chart_per_m, 0.3 * cell)
    gap_x = max(-ix, ix - (nx - 1.0), 0.0)
    gap_y = max(-iy, iy - (ny - 1.0), 0.0)
    if world.curved:
        return max(0.8 * max(gap_x * world.cell_m[0], gap_y * world.cell_m[1]), 0.3 * cell)
    step = 0.0
    if gap_x > 0.0:
        toward = -per_x if ix > 0.0 else per_x
        step = gap_x * toward if toward > 0.0 else FAR
    if gap_y > 0.0:
        toward = -per_y if iy > 0.0 else per_y
        step = max(step, gap_y * toward if toward > 0.0 else FAR)
    return step


@part(IN_ORDER, inlined=True)
def _face_m(x, per, block, free, cells):
    """Way to the face of the blocks around index x that are alike: ``free`` blocks either way; ``per``: m a cell."""
    if per >= FAR:  # along the face, and perhaps in it
        return FAR
    if per > 0.0:
        way = (min((block + free + 1) * BLOCK, cells) - x) * per
    else:
        way = (max((block - free) * BLOCK, 0) - x) * per
    return max(way, PAST_FACE * abs(per))


@part(IN_ORDER, inlined=True)
def block_step(x, y, z, dx, dy, dz, h, here, b, per_x, per_y, per_rise, margin, world):
    """At a point of a ray: (way on within what is alike, majorant, ix, iy); see `ray_constants`, `on_ray`.

    ``margin``: blocks aside within which there is to be no cloud; where there may be some, the majorant is not 0.
    """
    ny, nx = world.terrain_m.shape
    nz = world.levels_m.shape[0]
    top = world.cloud_high_m
    if h > top or (h > top - 1e-6 and b >= 0.0):
        return fall_m(b, here, top, per_rise, world), 0.0, -1e9, -1e9
    if h < world.cloud_low_m:
        return climb_m(b, here, world.cloud_low_m, per_rise, world), 0.0, -1e9, -1e9
    if world.curved:
        ix, iy, ux, uy = chart_place(x, y, z, dx, dy, dz, world)
        per_x = 1.0 / ux if ux != 0.0 else FAR
        per_y = 1.0 / uy if uy != 0.0 else FAR
    else:
        ix, iy = place(x, y, z, world)
    if not in_domain(ix, iy, world):
        return _beside_m(ix, iy, per_x, per_y, world), 1.0 * margin, ix, iy
    px, py = wrapped(ix, iy, world)
    kb = level_below(h, world) // BLOCK
    jb = min(int(py) // BLOCK, world.majorant.shape[1] - 1)
    ib = min(int(px) // BLOCK, world.majorant.shape[2] - 1)
    n = (kb * world.majorant.shape[1] + jb) * world.majorant.shape[2] + ib
    majorant = flat(world.majorant, n)
    free = 0
    if majorant <= 0.0:
        free = int(-majorant) - margin
        majorant = 0.0
        if free < 0:
            majorant, free = 1.0, 0
    step = FAR
    if nx > 1:
        step = _face_m(px, per_x, ib, free, nx if world.periodic else nx - 1)
    if ny > 1:
        step = min(step, _face_m(py, per_y, jb, free, ny if world.periodic else ny - 1))
    low = (kb - free) * BLOCK
    if b < 0.0 and low > 0:
        step = min(step, fall_m(b, here, flat(world.levels_m, low), per_rise, world))
    if b > 0.0 or world.curved:
        high = min((kb + free + 1) * BLOCK, nz - 1)
        step = min(step, climb_m(b, here, flat(world.levels_m, high), per_rise, world))
    return step, majorant * 1.0, ix, iy


@part(IN_ORDER, inlined=True)
def layer_step(h, here, b, per_rise, world):
    """Way to the edge of the air's layer, and its index."""
    i, _ = air_place(h, world)
    layer = flat(world.layer_of, i)
    step = FAR
    if b < 0.0 and layer > 0:
        step = fall_m(b, here, world.ground_m + flat(world.layer_edge_m, layer), per_rise, world)
    if step == FAR:
        step = climb_m(b, here, world.ground_m + flat(world.layer_edge_m, layer + 1), per_rise, world)
    return step, layer


@part(IN_ORDER, inlined=True)
def terrain_step(step, b, h, world):
    """A step no longer than terrain can be followed with: half a cell where the ray may be among hills."""
    if h < world.high_m + 1.0 or b < 0.0:
        half = 0.5 * min(world.cell_m[0], world.cell_m[1])
        if h > world.high_m:  # above the hills: down to them
            half = max(half, (h - world.high_m))
        return min(step, half)
    return step


@part(IN_ORDER, inlined=True)
def collided(chance, majorant, nw, weight, total, scattered, taken, rng):
    """Whether a tentative collision scatters; weights are kept right. ``chance``: that it does."""
    if uniform(rng) < chance:
        for w in range(nw):
            weight[w] *= scattered[w] / (majorant * chance)
        return True
    for w in range(nw):
        weight[w] *= (majorant - taken[w]) / (majorant * (1.0 - chance))
    return False


@part(IN_ORDER, inlined=True)
def dimmed(beam, left, majorant, nodes, world, rng):
    """A beam keeps the share of its light that the majorant takes in excess: how much is ``left`` of it, times that.

    Below `LEAST_BEAM` chance decides whether it goes on as strong as at first; 0 where it does not.
    """
    nw, ns = beam.shape[0], nodes.shape[0]
    most = 0.0
    for w in range(nw):
        extinct = 0.0
        for n in range(ns):
            extinct += nodes[n] * flat(world.relative, n * nw + w)
        share = max(1.0 - extinct / majorant, 0.0)
        beam[w] *= share
        most = max(most, share)
    left *= most
    if left < LEAST_BEAM:
        if uniform(rng) >= left:
            return 0.0
        for w in range(nw):
            beam[w] /= left
        left = 1.0
    return left


@part(IN_ORDER, inlined=True)
def fly(ox, oy, oz, dx, dy, dz, s, boosted, boost, weight, scattered, taken, nodes, world, rng):
    """Follow a photon from distance s of its ray to its next real event: (event, distance, height, ix, iy).

    Absorption is taken from the weights. ``boost``: factors (layers,) on the air's collisions while ``boosted``.
    """
    nw = weight.shape[0]
    ns = world.extinction.shape[3]
    square, rise, per_x, per_y, per_rise = ray_constants(ox, oy, oz, dx, dy, dz, world)
    hilly, no_margin = world.low_m < world.high_m, np.int64(0)  # for a literal Numba would compile `block_step` again
    depth = exponential(rng)
    while True:
        h, here, b = on_ray(s, square, rise, world)
        if h >= world.top_m - 1e-6 and b >= 0.0:
            return ESCAPED, s, h, -1e9, -1e9
        step, cloud, air, ix, iy = FAR, 0.0, 0.0, -1e9, -1e9
        if world.gridded:
            step, cloud, ix, iy = block_step(
                ox + s * dx, oy + s * dy, oz + s * dz, dx, dy, dz, h, here, b, per_x, per_y, per_rise, no_margin,
                world,
            )  # fmt: skip
        if world.airy:
            edge, layer = layer_step(h, here, b, per_rise, world)
            step = min(step, edge)
            air = flat(world.layer_majorant, layer)
            if boosted and boost[layer] > 1.0:
                air *= boost[layer] * _STRETCH
        hills, base = hilly, world.low_m
        if hilly and not in_domain(ix, iy, world):
            hills = False
            if h <= world.cloud_high_m:
                base = world.ground_m
        ground = max(fall_m(b, here, base, per_rise, world), 0.0)
        if (step >= FAR and ground >= FAR) or s > FARTHEST_M:
            return ESCAPED, s, h, ix, iy
        step = min(step, ground + 1.0)
        if hills:
            step = terrain_step(step, b, h, world)
        step = max(step, 0.0) + NUDGE_M
        majorant = cloud + air
        met = step * majorant
        tentative = met >= depth
        if tentative:
            step = depth / majorant
            depth = exponential(rng)
        else:
            depth -= met
        landed = step >= ground
        if landed:
            if not hills:
                s += ground
                ix, iy = place(ox + s * dx, oy + s * dy, oz + s * dz, world)
                return GROUND, s, base, ix, iy
            step = ground
            tentative = False
        before = s
        s += step
        if tentative or hills:
            h, here, b = on_ray(s, square, rise, world)
            ix, iy = place(ox + s * dx, oy + s * dy, oz + s * dz, world)
            if landed or (hills and h < world.high_m and h < ground_height_m(ix, iy, world)):
                s = ground_crossing_m(ox, oy, oz, dx, dy, dz, square, rise, before, s, world)
                h, here, b = on_ray(s, square, rise, world)
                ix, iy = place(ox + s * dx, oy + s * dy, oz + s * dz, world)
                return GROUND, s, h, ix, iy
        if not tentative:
            continue
        total = 0.0
        for w in range(nw):
            total += weight[w]
        if total <= 0.0:
            return ESCAPED, s, h, ix, iy
        chance = 0.0
        if cloud > 0.0 and (air == 0.0 or uniform(rng) * majorant < cloud):
            if species_at(ix, iy, h, world, nodes) <= 0.0:
                continue
            for w in range(nw):
                scattered[w] = 0.0
                taken[w] = 0.0
                for n in range(ns):
                    scattered[w] += nodes[n] * world.scattering[n, w]
                    taken[w] += nodes[n] * world.relative[n, w]
                chance += weight[w] * scattered[w]
            chance = min(chance / (total * cloud), 1.0)
            if collided(chance, cloud, nw, weight, total, scattered, taken, rng):
                return CLOUD, s, h, ix, iy
        else:
            i, f = air_place(h, world)
            a = world.air
            for w in range(nw):
                taken[w] = a[i, 0, w] + f * (a[i + 1, 0, w] - a[i, 0, w])
                molecules = a[i, 1, w] + f * (a[i + 1, 1, w] - a[i, 1, w])
                haze = a[i, 2, w] + f * (a[i + 1, 2, w] - a[i, 2, w])
                scattered[w] = molecules + haze
                chance += weight[w] * scattered[w]
            factor = boost[layer] if boosted else 1.0
            chance = min(max(factor, 1.0) * chance / (total * air), 1.0)
            if collided(chance, air, nw, weight, total, scattered, taken, rng):
                return AIR, s, h, ix, iy


@part(IN_ORDER)
def air_beam(x, y, z, h, world, beam):
    """Transmission of the air from a point to the sun into ``beam`` (nw,): 0, and false, in the Earth's shadow."""
    nw = beam.shape[0]
    radius = world.radius_m + world.ground_m
    above = max(h - world.ground_m, 0.0)
    r = world.radius_m + h
    mu = (x * world.sun[0] + y * world.sun[1] + (world.radius_m + z) * world.sun[2]) / r
    horizon = -math.sqrt(max(above * (2.0 * radius + above), 0.0)) / (radius + above)
    lit = shadow_fraction(mu, horizon, SUN_RADIUS_RAD)
    if lit == 0.0:
        for w in range(nw):
            beam[w] = 0.0
        return False
    level = math.sqrt(above / ((AIR_NODES - 1) * AIR_STEP_M)) * (SUN_HEIGHTS - 1)
    level = min(level, SUN_HEIGHTS - 1.000001)
    t = math.sqrt(max(0.0, (mu - horizon) / (1.0 - horizon))) * (SUN_COSINES - 1)
    t = min(t, SUN_COSINES - 1.000001)
    k, m = int(level), int(t)
    c, e = level - k, t - m
    table = world.sun_depth
    for w in range(nw):
        low = table[k, m, w] * (1 - e) + table[k, m + 1, w] * e
        high = table[k + 1, m, w] * (1 - e) + table[k + 1, m + 1, w] * e
        beam[w] = lit * math.exp(-math.exp(low + c * (high - low)))
    return True


@part(IN_ORDER, inlined=True)
def sunlight(x, y, z, h, world, beam, nodes, rng):
    """Transmission from a point to the sun into ``beam`` (nw,); through cloud an unbiased estimate by ratio tracking.

    Returns whether any light arrives. Where little is left, chance decides whether to go on.
    """
    nw = beam.shape[0]
    if world.airy:
        if not air_beam(x, y, z, h, world, beam):
            return False
    else:
        for w in range(nw):
            beam[w] = 1.0
    cover(x, y, z, world.moon, beam)
    if not world.gridded:
        return True
    dx, dy, dz = world.sun[0], world.sun[1], world.sun[2]
    square, rise, per_x, per_y, per_rise = ray_constants(x, y, z, dx, dy, dz, world)
    hilly, no_margin = world.low_m < world.high_m, np.int64(0)
    top = world.cloud_high_m
    s = 0.0
    left = 1.0  # of the beam, by cloud
    depth = exponential(rng)
    while True:
        h, here, b = on_ray(s, square, rise, world)
        if (b >= 0.0 and h >= top - 1e-6) or s > FARTHEST_M:
            return True
        step, majorant, ix, iy = block_step(
            x + s * dx, y + s * dy, z + s * dz, dx, dy, dz, h, here, b, per_x, per_y, per_rise, no_margin, world
        )  # fmt: skip
        if hilly and h < world.high_m and s > 0.0 and h < ground_height_m(ix, iy, world) - 0.05:
            return False
        if b < 0.0 and not world.airy and h < world.low_m - 0.05:
            return False
        if step >= FAR:
            return b >= 0.0 or world.airy or fall_m(b, here, world.low_m, per_rise, world) >= FAR
        if hilly and in_domain(ix, iy, world):
            step = terrain_step(step, b, h, world)
        step = max(step, 0.0) + NUDGE_M
        met = step * majorant
        if met < depth:
            depth -= met
            s += step
            continue
        # tentative collision: keep the share of the light that the majorant takes in excess
        s += depth / majorant
        depth = exponential(rng)
        h, _, _ = on_ray(s, square, rise, world)
        ix, iy = place(x + s * dx, y + s * dy, z + s * dz, world)
        if species_at(ix, iy, h, world, nodes) <= 0.0:
            continue
        left = dimmed(beam, left, majorant, nodes, world, rng)
        if left == 0.0:
            return False
