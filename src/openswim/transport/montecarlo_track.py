"""Photons on their way: delta tracking from block to block and layer to layer (Woodcock et al. 1965)."""

from __future__ import annotations

import math

from numba import njit

from openswim.transport.montecarlo_phase import uniform
from openswim.transport.montecarlo_world import (
    AIR_NODES,
    AIR_STEP_M,
    BLOCK,
    SUN_COSINES,
    SUN_HEIGHTS,
)
from openswim.transport.scalar import flat, height_of_square_m, shadow_fraction
from openswim.transport.volume import SUN_RADIUS_RAD

_FLAGS = {"contract", "nsz", "arcp"}
NUDGE_M = 0.01  # past a face, so that no step ends on it; blocks reach a cell beyond their faces
FAR = 1e30
LEAST_BEAM = 0.25  # of a beam through cloud: below it chance decides whether it goes on
ESCAPED, GROUND, CLOUD, AIR = 0, 1, 2, 3


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def sizes(world, spectrum):
    """Wavelengths and species: known to the compiler where there is one of each."""
    if world.kind.ndim == 3:
        return 1, 1
    return spectrum.shape[0], world.extinction.shape[3]


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def chart_place(x, y, z, dx, dy, dz, world):
    """Fractional (ix, iy) of a point, and their change per metre along a direction; see `volume.grid_index`."""
    depth = world.radius_m + z
    r = math.sqrt(x * x + y * y + depth * depth)
    if depth <= -0.99 * r:
        return -1e9, -1e9, 0.0, 0.0
    q = world.radius_m * math.sqrt(2.0 / (r * (r + depth)))
    u = (x * q - world.chart_origin_m) * world.chart_per_m
    v = (y * q - world.chart_origin_m) * world.chart_per_m
    n = world.chart.shape[0] - 1
    if not world.periodic and (u < 0.0 or v < 0.0 or u > n or v > n):
        return -1e9, -1e9, 0.0, 0.0
    dr = (x * dx + y * dy + depth * dz) / r
    shrink = 0.5 * (dr / r + (dr + dz) / (r + depth))
    du = world.chart_per_m * q * (dx - x * shrink)
    dv = world.chart_per_m * q * (dy - y * shrink)
    i = min(max(int(u), 0), n - 1)
    j = min(max(int(v), 0), n - 1)
    a = u - i
    b = v - j
    c = world.chart
    here = 2 * (j * (n + 1) + i)
    up = here + 2 * (n + 1)
    x00, x01, x10, x11 = flat(c, here), flat(c, here + 2), flat(c, up), flat(c, up + 2)
    y00, y01, y10, y11 = flat(c, here + 1), flat(c, here + 3), flat(c, up + 1), flat(c, up + 3)
    low, high = x00 + a * (x01 - x00), x10 + a * (x11 - x10)
    ix = low + b * (high - low)
    ux = du * ((1 - b) * (x01 - x00) + b * (x11 - x10)) + dv * (high - low)
    low, high = y00 + a * (y01 - y00), y10 + a * (y11 - y10)
    iy = low + b * (high - low)
    uy = du * ((1 - b) * (y01 - y00) + b * (y11 - y10)) + dv * (high - low)
    return ix, iy, ux, uy


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def place(x, y, z, world):
    """Fractional (ix, iy) of a point."""
    if world.curved:
        ix, iy, _, _ = chart_place(x, y, z, 0.0, 0.0, 0.0, world)
        return ix, iy
    return world.index_x0 + x * world.index_per_x, world.index_y0 + y * world.index_per_y


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def ray_constants(x, y, z, dx, dy, dz, world):
    """What is the same all along a ray: (r^2 - R^2, r mu) at its origin; in flat scenes metres per cell and per metre
    of height."""
    if world.curved:
        square = x * x + y * y + z * (2.0 * world.radius_m + z)
        return square, x * dx + y * dy + (world.radius_m + z) * dz, 0.0, 0.0, 0.0
    across, along = dx * world.index_per_x, dy * world.index_per_y
    return (
        z, dz, 1.0 / across if across != 0.0 else FAR, 1.0 / along if along != 0.0 else FAR,
        1.0 / dz if dz != 0.0 else FAR,
    )  # fmt: skip


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def on_ray(s, square, rise, world):
    """Height at a distance along a ray, and (r^2 - R^2, r mu); in flat scenes twice the height, and dz."""
    if world.curved:
        here = square + s * (2.0 * rise + s)
        return height_of_square_m(here, world.radius_m), here, rise + s
    h = square + s * rise
    return h, h, rise


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def in_domain(ix, iy, world):
    ny, nx = world.terrain_m.shape
    return world.periodic or (ix >= 0.0 and iy >= 0.0 and ix <= nx - 1.0 and iy <= ny - 1.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def level_below(h, world):
    """Level under a height, clamped to the grid."""
    nz = world.levels_m.shape[0]
    t = (h - world.level_origin_m) * world.level_per_m
    n = world.level_table.shape[0] - 1
    k = int(flat(world.level_table, int(min(max(t, 0.0), 1.0 * n))))
    k = min(k, nz - 2)
    if k < nz - 2 and h >= flat(world.levels_m, k + 1):
        k += 1
    return k


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def wrapped(ix, iy, world):
    """Indices within one period."""
    ny, nx = world.terrain_m.shape
    if world.periodic:
        ix -= math.floor(ix / nx) * nx
        iy -= math.floor(iy / ny) * ny
    return ix, iy


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def in_cell(i, j, k, a, b, g, world, nodes):
    """As `species_at`, at the shares (a, b, g) of a cell's edges along x, y and z."""
    ny, nx = world.terrain_m.shape
    _, ns = sizes(world, nodes)
    right, up = ns, nx * ns
    if i + 1 >= nx:
        right = -i * ns if world.periodic else 0
    if j + 1 >= ny:
        up = -j * nx * ns if world.periodic else 0
    here = ((k * ny + j) * nx + i) * ns
    above = here + ny * nx * ns
    f = world.extinction
    total = 0.0
    for s in range(ns):
        n, m = here + s, above + s
        l0 = flat(f, n) + a * (flat(f, n + right) - flat(f, n))
        l1 = flat(f, n + up) + a * (flat(f, n + up + right) - flat(f, n + up))
        h0 = flat(f, m) + a * (flat(f, m + right) - flat(f, m))
        h1 = flat(f, m + up) + a * (flat(f, m + up + right) - flat(f, m + up))
        low_value = l0 + b * (l1 - l0)
        value = low_value + g * (h0 + b * (h1 - h0) - low_value)
        nodes[s] = value
        total += value
    return total


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def species_at(ix, iy, h, world, nodes):
    """Reference extinction of the species at a point of the grid into ``nodes``: trilinear. Returns their sum."""
    ny, nx = world.terrain_m.shape
    k = level_below(h, world)
    low = flat(world.levels_m, k)
    g = min(max((h - low) / (flat(world.levels_m, k + 1) - low), 0.0), 1.0)
    ix, iy = wrapped(ix, iy, world)
    i = min(max(int(ix), 0), nx - 1)
    j = min(max(int(iy), 0), ny - 1)
    return in_cell(i, j, k, ix - i, iy - j, g, world, nodes)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def air_place(h, world):
    """Row of the air's table under a height, and the share of the next."""
    x = min(max((h - world.ground_m) / AIR_STEP_M, 0.0), AIR_NODES - 1.000001)
    i = int(x)
    return i, x - i


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def ground_height_m(ix, iy, world):
    """Height of the ground at a place of the grid, or outside it; as `march._ground_m`."""
    if world.periodic or not in_domain(ix, iy, world):
        return world.ground_m
    ny, nx = world.terrain_m.shape
    i = min(int(ix), max(nx - 2, 0))
    j = min(int(iy), max(ny - 2, 0))
    a, b = ix - i, iy - j
    i1, j1 = min(i + 1, nx - 1), min(j + 1, ny - 1)
    t = world.terrain_m
    return (t[j, i] * (1 - a) + t[j, i1] * a) * (1 - b) + (t[j1, i] * (1 - a) + t[j1, i1] * a) * b


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def above_ground_m(x, y, z, h, world):
    ix, iy = place(x, y, z, world)
    return h - ground_height_m(ix, iy, world)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def ground_crossing_m(ox, oy, oz, dx, dy, dz, square, rise, low, high, world):
    """Distance between ``low`` (above ground) and ``high`` (not above) at which a ray meets the terrain, to a cm."""
    while high - low > 0.01:
        s = 0.5 * (low + high)
        h, _, _ = on_ray(s, square, rise, world)
        if above_ground_m(ox + s * dx, oy + s * dy, oz + s * dz, h, world) < 0.0:
            high = s
        else:
            low = s
    return low


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def climb_m(b, here, h, per_rise, world):
    """Distance up to height h from below it."""
    if not world.curved:
        return (h - here) * per_rise if b > 0.0 else FAR
    c = h * (2.0 * world.radius_m + h) - here
    root = math.sqrt(max(b * b + c, 0.0))
    return c / (b + root) if b > 0.0 else root - b


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _face_m(x, per, block, free, cells):
    """Way to the face of the blocks around index x that are alike: ``free`` blocks either way; ``per``: m a cell."""
    if per >= FAR:  # along the face, and perhaps in it
        return FAR
    if per > 0.0:
        return (min((block + free + 1) * BLOCK, cells) - x) * per
    return (max((block - free) * BLOCK, 0) - x) * per


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def block_step(x, y, z, dx, dy, dz, h, here, b, per_x, per_y, per_rise, world):
    """At a point of a ray: (way on within what is alike, majorant, ix, iy); see `ray_constants`, `on_ray`."""
    ny, nx = world.terrain_m.shape
    nz = world.levels_m.shape[0]
    top = flat(world.levels_m, nz - 1)
    if h > top or (h > top - 1e-6 and b >= 0.0):
        return fall_m(b, here, top, per_rise, world), 0.0, -1e9, -1e9
    if world.curved:
        ix, iy, ux, uy = chart_place(x, y, z, dx, dy, dz, world)
        per_x = 1.0 / ux if ux != 0.0 else FAR
        per_y = 1.0 / uy if uy != 0.0 else FAR
    else:
        ix, iy = place(x, y, z, world)
    if not in_domain(ix, iy, world):
        return _beside_m(ix, iy, per_x, per_y, world), 0.0, ix, iy
    px, py = wrapped(ix, iy, world)
    kb = level_below(h, world) // BLOCK
    jb = min(int(py) // BLOCK, world.majorant.shape[1] - 1)
    ib = min(int(px) // BLOCK, world.majorant.shape[2] - 1)
    n = (kb * world.majorant.shape[1] + jb) * world.majorant.shape[2] + ib
    majorant = flat(world.majorant, n)
    free = 0
    if majorant == 0.0:
        free = int(flat(world.skip, n))
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def terrain_step(step, b, h, world):
    """A step no longer than terrain can be followed with: half a cell where the ray may be among hills."""
    if h < world.high_m + 1.0 or b < 0.0:
        half = 0.5 * min(world.cell_m[0], world.cell_m[1])
        if h > world.high_m:  # above the hills: down to them
            half = max(half, (h - world.high_m))
        return min(step, half)
    return step


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
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
    if not world.gridded:
        return True
    dx, dy, dz = world.sun[0], world.sun[1], world.sun[2]
    square, rise, per_x, per_y, per_rise = ray_constants(x, y, z, dx, dy, dz, world)
    ns = world.extinction.shape[3]
    hilly = world.low_m < world.high_m
    top = flat(world.levels_m, world.levels_m.shape[0] - 1)
    s = 0.0
    left = 1.0  # of the beam, by cloud
    depth = -math.log(1.0 - uniform(rng))
    while True:
        h, here, b = on_ray(s, square, rise, world)
        if b >= 0.0 and h >= top - 1e-6:
            return True
        step, majorant, ix, iy = block_step(
            x + s * dx, y + s * dy, z + s * dz, dx, dy, dz, h, here, b, per_x, per_y, per_rise, world
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
        depth = -math.log(1.0 - uniform(rng))
        h, _, _ = on_ray(s, square, rise, world)
        ix, iy = place(x + s * dx, y + s * dy, z + s * dz, world)
        if species_at(ix, iy, h, world, nodes) <= 0.0:
            continue
        most = 0.0
        for w in range(nw):
            taken = 0.0
            for n in range(ns):
                taken += nodes[n] * flat(world.relative, n * nw + w)
            share = max(1.0 - taken / majorant, 0.0)
            beam[w] *= share
            most = max(most, share)
        left *= most
        if left < LEAST_BEAM:
            if uniform(rng) >= left:
                return False
            for w in range(nw):
                beam[w] /= left
            left = 1.0
