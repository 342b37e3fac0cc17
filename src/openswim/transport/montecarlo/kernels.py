"""The launchers of the Monte Carlo solver: what rays meet on their straight way, and sums over their paths."""

from __future__ import annotations

import math

import numpy as np

from openswim.transport.engine.compiled import IN_ORDER, kernel, part
from openswim.transport.montecarlo.path import Drawing, Sight, black, trace, work_space
from openswim.transport.montecarlo.phase import start_stream, turned, uniform, unit_circle
from openswim.transport.montecarlo.place import (
    FAR,
    air_place,
    ground_crossing_m,
    ground_height_m,
    in_domain,
    on_ray,
    place,
    ray_constants,
    species_at,
)
from openswim.transport.montecarlo.track import (
    FARTHEST_M,
    NUDGE_M,
    air_beam,
    block_step,
    fall_m,
    layer_step,
    sunlight,
    terrain_step,
)
from openswim.transport.montecarlo.world import BLOCK

_RAYS = 8  # handed to a thread at a time
_CELLS = 0.5  # of a cell between two points of the straight way's quadrature
_AIR_RISE_M = 400.0
_WANTED_DEPTH = 1.2  # of the air along a straight way that ends in space, after stretching
_WANTED_BEFORE = 0.6  # where there is ground or cloud to be seen as well
_GAUSS = 0.21132486540518708
_WIDEST = 8  # blocks; of pixels, whose rays are moved on together


@part(IN_ORDER, inlined=True)
def entry_m(ox, oy, oz, dx, dy, dz, world):
    """Distance to where a ray enters the world: 0 inside it, FAR if it never does."""
    square, rise, _, _, per_rise = ray_constants(ox, oy, oz, dx, dy, dz, world)
    h, here, b = on_ray(0.0, square, rise, world)
    return 0.0 if h <= world.top_m else fall_m(b, here, world.top_m, per_rise, world)


@part(IN_ORDER)
def scout(ox, oy, oz, dx, dy, dz, margin, world, depth, species_depth, beam, nodes, wanted, boost):
    """Follow a ray straight on: optical depths (nw,) and (ns,), and how much to stretch the air's collisions (layers,).

    Gauss-Legendre with two points a step. Returns where it first may meet cloud (-1: nowhere), and the ground (-1).
    ``margin``: blocks aside, within which cloud ends it; -1: no cloud does.
    """
    nw, ns = depth.shape[0], world.extinction.shape[3]
    depth[:] = 0.0
    species_depth[:] = 0.0
    wanted[:] = 0.0
    boost[:] = 1.0
    s = start_m = entry_m(ox, oy, oz, dx, dy, dz, world)
    if s >= FAR:
        return -1.0, -1.0
    square, rise, per_x, per_y, per_rise = ray_constants(ox, oy, oz, dx, dy, dz, world)
    hilly = world.low_m < world.high_m
    cloud_m, ground_m = -1.0, -1.0
    seen = 0.0  # light of the air, as single scattering
    while True:
        h, here, b = on_ray(s, square, rise, world)
        mu = b / (world.radius_m + h) if world.curved else dz
        if h >= world.top_m - 1e-6 and b >= 0.0:
            break
        step, cloud, layer, ix, iy = FAR, 0.0, 0, -1e9, -1e9
        if world.gridded:
            step, cloud, ix, iy = block_step(
                ox + s * dx, oy + s * dy, oz + s * dz, dx, dy, dz, h, here, b, per_x, per_y, per_rise,
                max(margin, 0), world,
            )  # fmt: skip
            if cloud > 0.0 and margin >= 0:
                return s, -1.0
        if world.airy:
            edge, layer = layer_step(h, here, b, per_rise, world)
            step = min(step, edge, _AIR_RISE_M / max(abs(mu), 0.02))
        hills, base = hilly, world.low_m
        if hilly and not in_domain(ix, iy, world):
            hills = False
            if h <= world.cloud_high_m:
                base = world.ground_m
        ground = max(fall_m(b, here, base, per_rise, world), 0.0)
        if (step >= FAR and ground >= FAR) or s > start_m + FARTHEST_M:
            break
        step = min(step, ground + 1.0)
        if hills:
            step = terrain_step(step, b, h, world)
        step = max(step, 0.0) + NUDGE_M
        if cloud > 0.0:
            if cloud_m < 0.0:
                cloud_m = s
            tall = (world.levels_m[-1] - world.levels_m[0]) / (world.levels_m.shape[0] - 1)
            cell = min(world.cell_m[0], world.cell_m[1])
            sine = math.sqrt(max(1.0 - mu * mu, 0.0))
            step = min(step, _CELLS * min(tall / max(abs(mu), 1e-6), cell / max(sine, 1e-6)))
        ended = step >= ground
        if ended:
            step = ground
        if hills:
            t = s + step
            high, _, _ = on_ray(t, square, rise, world)
            if high < world.high_m:
                ix, iy = place(ox + t * dx, oy + t * dy, oz + t * dz, world)
                if high < ground_height_m(ix, iy, world):
                    step = ground_crossing_m(ox, oy, oz, dx, dy, dz, square, rise, s, t, world) - s
                    ended = True
        for point in range(2):
            t = s + step * (_GAUSS if point == 0 else 1.0 - _GAUSS)
            x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
            high, _, _ = on_ray(t, square, rise, world)
            if cloud > 0.0:
                ix, iy = place(x, y, z, world)
                if species_at(ix, iy, high, world, nodes) > 0.0:
                    for n in range(ns):
                        species_depth[n] += 0.5 * step * nodes[n]
                        for w in range(nw):
                            depth[w] += 0.5 * step * nodes[n] * world.relative[n, w]
            if world.airy:
                i, f = air_place(high, world)
                air_beam(x, y, z, high, world, beam)
                light, scattering = 0.0, 0.0
                for w in range(nw):
                    scattering += world.air[i, 1, w] + world.air[i, 2, w]
                    light += beam[w] * math.exp(-depth[w])
                    depth[w] += 0.5 * step * (world.air[i, 0, w] + f * (world.air[i + 1, 0, w] - world.air[i, 0, w]))
                # what is drawn is drawn from the mean over the wavelengths, whichever of them has light there
                seen += scattering / nw * light / nw * 0.5 * step
                wanted[layer] = max(wanted[layer], light / nw)
        s += step
        if ended:
            ground_m = s
            break
    if seen > 0.0:
        whole = _WANTED_DEPTH if ground_m < 0.0 and cloud_m < 0.0 else _WANTED_BEFORE
        for n in range(boost.shape[0]):
            boost[n] = max(1.0, whole * wanted[n] / seen)
    return cloud_m, ground_m


@kernel()
def scout_kernel(t, threads, origin, direction, world, depth, species_depth, ground_m):
    """`scout` for thread t's of the rays (n, 3): depths (n, nw) and (n, ns), distance to the ground (n,) or -1."""
    n, layers = direction.shape[0], world.layer_majorant.shape[0]
    nodes, beam = np.zeros(world.extinction.shape[3]), np.zeros(depth.shape[1])
    wanted, boost = np.zeros(layers), np.zeros(layers)
    no_cloud = np.int64(-1)  # for a literal Numba would compile `scout` once more
    for tile in range(t, (n + _RAYS - 1) // _RAYS, threads):
        for ray in range(tile * _RAYS, min(n, (tile + 1) * _RAYS)):
            o, d = origin[ray], direction[ray]
            _, ground_m[ray] = scout(
                o[0], o[1], o[2], d[0], d[1], d[2], no_cloud, world, depth[ray], species_depth[ray], beam, nodes,
                wanted, boost,
            )  # fmt: skip


@part(IN_ORDER)
def pixel_width(dx, dy, dz, across, along, world):
    """How far aside of a pixel's middle ray the others are, in blocks, and how far before it they may start (m).

    -1: the rays have to be followed one by one.
    """
    half_z = 0.5 * (abs(across[2]) + abs(along[2]))
    if world.low_m < world.high_m or world.curved or (half_z > 0.0 and dz >= 0.0):
        return -1, 0.0
    ahead = 1.0 / dz if half_z > 0.0 else 0.0
    x0, y0 = across[0] - dx * across[2] * ahead, across[1] - dy * across[2] * ahead
    x1, y1 = along[0] - dx * along[2] * ahead, along[1] - dy * along[2] * ahead
    cells = 0.5 * max((abs(x0) + abs(x1)) * abs(world.index_per_x), (abs(y0) + abs(y1)) * abs(world.index_per_y))
    blocks = math.ceil(cells / BLOCK)
    return blocks if blocks <= _WIDEST else -1, half_z * abs(ahead)


@kernel()
def path_kernel(
    t, threads, origin, direction, across, along, seed, numbers, first, count, seen, aiming, world, phases, sums,
    squares,
):  # fmt: skip
    """Add ``count`` paths of each of thread t's rays (n, 3), from path number ``first``, to sums and squares (n, nw).

    ``across``, ``along`` (3,): sides of the parallelogram over which each ray's origin is spread. ``numbers`` (n,):
    what the rays are called: a path's chances depend on seed, ray number and path number alone.
    """
    n, nw = sums.shape
    ns, layers = world.extinction.shape[3], world.layer_majorant.shape[0]
    spread = False
    for k in range(3):
        spread = spread or across[k] != 0.0 or along[k] != 0.0
    work, out = work_space(nw, ns), np.zeros(nw)
    wanted, boost, species_depth = np.zeros(layers), np.zeros(layers), np.zeros(ns)
    rng = np.zeros(1, np.uint64)
    for tile in range(t, (n + _RAYS - 1) // _RAYS, threads):
        for ray in range(tile * _RAYS, min(n, (tile + 1) * _RAYS)):
            o, d = origin[ray], direction[ray]
            begin = -1.0
            margin, ahead_m = 0, 0.0
            if spread:
                margin, ahead_m = pixel_width(d[0], d[1], d[2], across, along, world)
            if world.airy or margin >= 0:
                cloud_m, ground_m = scout(
                    o[0], o[1], o[2], d[0], d[1], d[2], -1 if world.airy else margin, world, work.scratch[0],
                    species_depth, work.scratch[1], work.nodes, wanted, boost,
                )  # fmt: skip
                if not world.airy:  # straight to the first cloud
                    if cloud_m < 0.0 and (ground_m < 0.0 or black(0.0, 0.0, np.bool_(True), ray, seen, world, out)):
                        continue
                    begin = max(max(cloud_m, ground_m) - ahead_m - 1.0, 0.0)
            for path in range(first, first + count):
                start_stream(rng, seed, numbers[ray], path)
                x, y, z = o[0], o[1], o[2]
                if spread:
                    a, b = uniform(rng) - 0.5, uniform(rng) - 0.5
                    x += a * across[0] + b * along[0]
                    y += a * across[1] + b * along[1]
                    z += a * across[2] + b * along[2]
                start_m = begin if begin >= 0.0 else entry_m(x, y, z, d[0], d[1], d[2], world)
                if start_m >= FAR:
                    continue
                out[:] = 0.0
                place = (x + start_m * d[0], y + start_m * d[1], z + start_m * d[2])
                trace(
                    place, (d[0], d[1], d[2]), Sight(True, ray, seen), Drawing(world.airy, boost, aiming), world,
                    phases, work, rng, out,
                )  # fmt: skip
                for w in range(nw):
                    sums[ray, w] += out[w]
                    squares[ray, w] += out[w] * out[w]


@kernel()
def flux_kernel(t, threads, place_m, up, seed, first, count, seen, aiming, world, phases, sums, squares):
    """Add ``count`` photons for each of thread t's places (n, 3) to sums (n, nw, 2): diffuse flux from the half-space
    about ``up`` (n, 3) and the unscattered sun's, over E_TOA."""
    n, nw = sums.shape[:2]
    ns, layers = world.extinction.shape[3], world.layer_majorant.shape[0]
    work, out, beam = work_space(nw, ns), np.zeros(nw), np.zeros(nw)
    sight, drawing = Sight(False, 0, seen), Drawing(False, np.ones(layers), aiming)
    rng = np.zeros(1, np.uint64)
    for tile in range(t, (n + _RAYS - 1) // _RAYS, threads):
        for k in range(tile * _RAYS, min(n, (tile + 1) * _RAYS)):
            p, v = place_m[k], up[k]
            mu = v[0] * world.sun[0] + v[1] * world.sun[1] + v[2] * world.sun[2]
            for path in range(first, first + count):
                start_stream(rng, seed, k, path)
                c, e = unit_circle(rng)
                q = 1.0 - math.sqrt(uniform(rng))
                out[:] = 0.0
                direction = turned(v[0], v[1], v[2], q, c, e)
                trace((p[0], p[1], p[2]), direction, sight, drawing, world, phases, work, rng, out)
                beam[:] = 0.0
                if mu > 0.0:
                    square, rise, _, _, _ = ray_constants(p[0], p[1], p[2], v[0], v[1], v[2], world)
                    h, _, _ = on_ray(0.0, square, rise, world)
                    if not sunlight(p[0], p[1], p[2], h, world, beam, work.nodes, rng):
                        beam[:] = 0.0
                for w in range(nw):
                    sums[k, w, 0] += 0.25 * out[w]
                    squares[k, w, 0] += 0.0625 * out[w] * out[w]
                    sums[k, w, 1] += beam[w] * mu
                    squares[k, w, 1] += (beam[w] * mu) ** 2
