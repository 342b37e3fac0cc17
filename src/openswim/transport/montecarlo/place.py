"""Where a photon is, and what is there: the grid's cells, the air and the ground, as scalars of a ray."""

from __future__ import annotations

import math

from openswim.transport.engine.compiled import IN_ORDER, part
from openswim.transport.engine.scalar import flat, height_of_square_m
from openswim.transport.montecarlo.world import AIR_NODES, AIR_STEP_M

FAR = 1e30


@part(IN_ORDER, inlined=True)
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


@part(IN_ORDER, inlined=True)
def place(x, y, z, world):
    """Fractional (ix, iy) of a point."""
    if world.curved:
        ix, iy, _, _ = chart_place(x, y, z, 0.0, 0.0, 0.0, world)
        return ix, iy
    return world.index_x0 + x * world.index_per_x, world.index_y0 + y * world.index_per_y


@part(IN_ORDER, inlined=True)
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


@part(IN_ORDER, inlined=True)
def on_ray(s, square, rise, world):
    """Height at a distance along a ray, and (r^2 - R^2, r mu); in flat scenes twice the height, and dz."""
    if world.curved:
        here = square + s * (2.0 * rise + s)
        return height_of_square_m(here, world.radius_m), here, rise + s
    h = square + s * rise
    return h, h, rise


@part(IN_ORDER, inlined=True)
def in_domain(ix, iy, world):
    ny, nx = world.terrain_m.shape
    return world.periodic or (ix >= 0.0 and iy >= 0.0 and ix <= nx - 1.0 and iy <= ny - 1.0)


@part(IN_ORDER, inlined=True)
def level_below(h, world):
    """Level under a height, clamped to the grid."""
    nz = world.levels_m.shape[0]
    t = (h - world.level_origin_m) * world.level_per_m
    k = int(flat(world.level_table, int(min(max(t, 0.0), world.level_table.shape[0] - 1.0))))
    while k < nz - 2 and h >= flat(world.levels_m, k + 1):
        k += 1
    return k


@part(IN_ORDER, inlined=True)
def wrapped(ix, iy, world):
    """Indices within one period."""
    ny, nx = world.terrain_m.shape
    if world.periodic:
        ix -= math.floor(ix / nx) * nx
        iy -= math.floor(iy / ny) * ny
    return ix, iy


@part(IN_ORDER, inlined=True)
def species_at(ix, iy, h, world, nodes):
    """Reference extinction of the species at a point of the grid into ``nodes``: trilinear. Returns their sum."""
    ny, nx = world.terrain_m.shape
    ns = nodes.shape[0]
    k = level_below(h, world)
    low = flat(world.levels_m, k)
    g = min(max((h - low) / (flat(world.levels_m, k + 1) - low), 0.0), 1.0)
    ix, iy = wrapped(ix, iy, world)
    i = min(max(int(ix), 0), nx - 1)
    j = min(max(int(iy), 0), ny - 1)
    a, b = ix - i, iy - j
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


@part(IN_ORDER, inlined=True)
def air_place(h, world):
    """Row of the air's table under a height, and the share of the next."""
    x = min(max((h - world.ground_m) / AIR_STEP_M, 0.0), AIR_NODES - 1.000001)
    i = int(x)
    return i, x - i


@part(IN_ORDER, inlined=True)
def ground_height_m(ix, iy, world):
    """Height of the ground at a place of the grid, or outside it; as `volume.terrain_height_m`."""
    if world.periodic or not in_domain(ix, iy, world):
        return world.ground_m
    ny, nx = world.terrain_m.shape
    i = min(int(ix), max(nx - 2, 0))
    j = min(int(iy), max(ny - 2, 0))
    a, b = ix - i, iy - j
    i1, j1 = min(i + 1, nx - 1), min(j + 1, ny - 1)
    t = world.terrain_m
    return (t[j, i] * (1 - a) + t[j, i1] * a) * (1 - b) + (t[j1, i] * (1 - a) + t[j1, i1] * a) * b


@part(IN_ORDER)
def above_ground_m(x, y, z, h, world):
    ix, iy = place(x, y, z, world)
    return h - ground_height_m(ix, iy, world)


@part(IN_ORDER)
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


@part(IN_ORDER, inlined=True)
def upward(x, y, z, h, world):
    """Away from the Earth's centre at a place of height h."""
    if not world.curved:
        return 0.0, 0.0, 1.0
    r = world.radius_m + h
    return x / r, y / r, (world.radius_m + z) / r


@part(IN_ORDER, inlined=True)
def facet(ix, iy, x, y, z, h, world):
    """Normal of the ground at a place: the terrain's, or the sphere's outside the grid."""
    if world.periodic or not world.gridded or not in_domain(ix, iy, world):
        return upward(x, y, z, h, world)
    ny, nx = world.terrain_m.shape
    i, j = min(int(ix), max(nx - 2, 0)), min(int(iy), max(ny - 2, 0))
    a, b = ix - i, iy - j
    i1, j1 = min(i + 1, nx - 1), min(j + 1, ny - 1)
    v = world.normal
    w00, w01, w10, w11 = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
    px = v[j, i, 0] * w00 + v[j, i1, 0] * w01 + v[j1, i, 0] * w10 + v[j1, i1, 0] * w11
    py = v[j, i, 1] * w00 + v[j, i1, 1] * w01 + v[j1, i, 1] * w10 + v[j1, i1, 1] * w11
    pz = v[j, i, 2] * w00 + v[j, i1, 2] * w01 + v[j1, i, 2] * w10 + v[j1, i1, 2] * w11
    scale = 1.0 / math.sqrt(px * px + py * py + pz * pz)
    return px * scale, py * scale, pz * scale


@part(IN_ORDER, inlined=True)
def diffuse_albedo(ix, iy, world, out):
    """Albedo (nw,) of the ground met by light that has been scattered: the grid's, or the domain's mean outside."""
    nw = out.shape[0]
    ny, nx = world.terrain_m.shape
    if not world.gridded or not in_domain(ix, iy, world):
        for w in range(nw):
            out[w] = world.mean_albedo[w]
        return
    x, y = ix, iy
    if world.periodic:
        x -= math.floor(x / nx) * nx
        y -= math.floor(y / ny) * ny
    i, j = min(int(x), nx - 1), min(int(y), ny - 1)
    a, b = x - i, y - j
    i1 = (i + 1) % nx if world.periodic else min(i + 1, nx - 1)
    j1 = (j + 1) % ny if world.periodic else min(j + 1, ny - 1)
    v = world.albedo
    for w in range(nw):
        low = v[j, i, w] + a * (v[j, i1, w] - v[j, i, w])
        out[w] = low + b * (v[j1, i, w] + a * (v[j1, i1, w] - v[j1, i, w]) - low)
