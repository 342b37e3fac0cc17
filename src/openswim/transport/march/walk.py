"""Walk: where along an eye ray to look, one place after the other.

Walking is apart from looking (`sample.py`) because each step waits for the one before, so that a processor would idle:
the march walks several rays in turn, some steps each, and then looks at all the places that it has found.

A ray goes by legs, in air or in the grid, where its height is a parabola and its indices are linear over a segment.
All lengths in metres.
"""

from __future__ import annotations

import math

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import expect, flat, put
from openswim.transport.engine.scalar import height_m, height_of_square_m, level_at
from openswim.transport.march.empty_space import STEEP_CELLS
from openswim.transport.march.volume import (
    FAR_M,
    SHELL_TABLE_PER_M,
    above_ground_m,
    grid_index,
    inside_grid,
    sphere_crossings,
    terrain_height_m,
    way_through,
)

_CHART_ERROR = 0.01  # of a cell, that a segment of a ray may lie off its chord in the grid's indices
_CLOUD_STEP = 0.75  # of a cell, that a step in cloud is long
_LEAST_STEP = 0.25  # or at least one near the ground
_PAST = 0.005  # of a free cell, that a step may end beyond it: the next may be much thinner
BATCH = 24  # places that a ray walks to before they are looked at

# A place: how far along the ray, the step to it; then level, ix, iy in the grid, or -1, height, cosine of zenith angle
PLACE_S, PLACE_STEP, PLACE_LEVEL, PLACE_X, PLACE_Y, PLACE = 0, 1, 2, 3, 4, 5

# The state of a walk, a row of float64
STATE, COUNT, SAMPLES, START = 0, 1, 2, 3  # where it stands; places of this batch, of all; way to the shells' top
OX, OY, OZ, DX, DY, DZ, SQUARE, RISE, GROUND, ENTER, LEAVE, S, STEP, SAFE, HEIGHT, GRIDDED, TURNING = range(4, 21)
BEGIN, END, H0, H1, H2, X0, VX, PER_VX, Y0, VY, PER_VY, X_END, Y_END, PER_COSINE, ACROSS = range(21, 36)
ENDED, STOP, WALK = range(36, 39)
GOING, GONE, HIT = 0.0, 1.0, 2.0


@part(FINITE)
def start_walk(w, origin_m, direction, end, shells, volume):
    """Begin a walk at an eye, or where its ray meets the top of the shells. The ground is at distance ``end``, or,
    where that is negative, is yet to be met, and the ray stops at -``end`` if it is not."""
    ox, oy, oz = origin_m[0], origin_m[1], origin_m[2]
    dx, dy, dz = direction[0], direction[1], direction[2]
    radius = shells.radius_m
    w[STATE], w[COUNT], w[SAMPLES], w[START], w[S], w[STEP], w[SAFE] = GOING, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0
    h = height_m(ox, oy, oz, radius)
    if h > shells.top_m:
        square = ox * ox + oy * oy + oz * (2.0 * radius + oz)
        first, _ = sphere_crossings(square, ox * dx + oy * dy + (radius + oz) * dz, shells.top_m, radius)
        if first <= 0.0 or first >= FAR_M or (end < 0.0 and first >= -end):
            w[STATE] = GONE
            return
        w[START] = first
        ox, oy, oz = ox + first * dx, oy + first * dy, oz + first * dz
        h = shells.top_m
    # along the ray (R + h)^2 - R^2 = square + s (2 rise + s); r mu = rise + s
    square = ox * ox + oy * oy + oz * (2.0 * radius + oz)
    rise = ox * dx + oy * dy + (radius + oz) * dz
    w[ENDED] = 1.0 if end >= 0.0 else 0.0
    w[STOP] = FAR_M if end >= 0.0 else -end - w[START]
    if end >= 0.0:
        w[GROUND] = max(end - w[START], 0.0)
    else:
        ground, _ = sphere_crossings(square, rise, shells.ground_m, radius)
        w[GROUND] = ground if ground >= 0.0 else FAR_M
    w[ENTER], w[LEAVE] = way_through(ox, oy, oz, dx, dy, dz, square, rise, radius, volume)
    w[OX], w[OY], w[OZ], w[DX], w[DY], w[DZ], w[SQUARE], w[RISE], w[HEIGHT] = ox, oy, oz, dx, dy, dz, square, rise, h
    w[GRIDDED] = 1.0 if w[ENTER] <= 0.0 else 0.0
    w[TURNING], w[END] = 0.0, -1.0


@part(FINITE)
def _next_leg(w, shells, volume):
    """Where a step ends that may pass the end of its leg. A ray that passes the grid's faces looks there twice."""
    s, step = w[S], w[STEP]
    if w[TURNING] > 0.0:
        w[TURNING] = 0.0
        w[GRIDDED] = 1.0 - w[GRIDDED]
        step = 0.0
        if w[GRIDDED] == 0.0 and w[ENDED] == 0.0 and w[HEIGHT] < shells.ground_m - 0.01:
            w[STATE] = HIT
    bound = w[GROUND]
    if w[GRIDDED] > 0.0:
        bound = min(bound, w[LEAVE]) if w[ENDED] > 0.0 else w[LEAVE]
    elif s < w[ENTER]:
        bound = min(bound, w[ENTER])
    bound = min(bound, w[STOP])
    if step >= FAR_M and bound >= FAR_M:  # nothing between here and space
        w[STATE] = GONE
        return s
    t = s + step
    if w[SAMPLES] > 0.0 and step > 0.0 and t >= bound:
        t = max(bound, s)
        if bound == w[STOP] or (bound == w[GROUND] and (w[GRIDDED] == 0.0 or w[ENDED] > 0.0)):
            w[STATE] = HIT
        else:
            w[TURNING] = 1.0
    w[STEP] = t - s
    w[SAFE] = -1.0 if w[TURNING] > 0.0 else bound
    if w[GRIDDED] > 0.0:
        if t > w[END]:
            _next_segment(w, s, t, shells.radius_m, volume)
        w[SAFE] = min(w[SAFE], w[END])
    return t


@part(FINITE)
def _next_segment(w, s, t, radius, volume):
    """Fit height and indices between the end of the last segment and somewhere beyond ``t``."""
    ox, oy, oz, dx, dy, dz, square, rise = w[OX], w[OY], w[OZ], w[DX], w[DY], w[DZ], w[SQUARE], w[RISE]
    across = min(flat(volume.cell_m, 0), flat(volume.cell_m, 1))
    begin, x0, y0 = w[END], w[X_END], w[Y_END]
    if begin < 0.0:
        begin = s
        x0, y0 = grid_index(ox + s * dx, oy + s * dy, oz + s * dz, radius, volume)
    # a straight ray is straight in the grid's indices as far as maps bend no more than the Earth does
    end = max(min(begin + math.sqrt(8.0 * _CHART_ERROR * radius * across), w[LEAVE]), t)
    x1, y1 = grid_index(ox + end * dx, oy + end * dy, oz + end * dz, radius, volume)
    length = max(end - begin, 1e-6)
    middle = begin + 0.5 * length
    h0 = height_of_square_m(square + begin * (2.0 * rise + begin), radius)
    h1 = height_of_square_m(square + middle * (2.0 * rise + middle), radius)
    h2 = height_of_square_m(square + end * (2.0 * rise + end), radius)
    w[BEGIN], w[END], w[X_END], w[Y_END], w[X0], w[Y0] = begin, end, x1, y1, x0, y0
    w[VX], w[VY] = (x1 - x0) / length, (y1 - y0) / length
    w[PER_VX], w[PER_VY] = 1.0 / max(abs(w[VX]), 1e-12), 1.0 / max(abs(w[VY]), 1e-12)
    w[H0], w[H2] = h0, 2.0 * (h0 - 2.0 * h1 + h2) / (length * length)
    w[H1] = (h2 - h0) / length - w[H2] * length
    mu = (rise + middle) / (radius + h1)
    w[PER_COSINE] = 1.0 / max(abs(mu), 1e-9)
    w[ACROSS] = across / math.sqrt(max(1.0 - mu * mu, 1e-12))


@part(FINITE)
def _meet_terrain(w, s, step, radius_m, ground_m, volume):
    """The part of a step that ends below ground after which the ray meets it."""
    least, most = 0.0, step
    for _ in range(24):
        m = s + 0.5 * (least + most)
        if above_ground_m(
            w[OX] + m * w[DX], w[OY] + m * w[DY], w[OZ] + m * w[DZ], radius_m, ground_m, volume
        ) < 0.0:
            most = m - s
        else:
            least = m - s
        if most - least < 0.05:
            break
    return max(least, 1e-3)


@part(FINITE, inlined=True)
def _air_step_m(above_m, per_cosine, shells):
    """A step in air: part of its scale height, at most part of its depth; in vacuum as far as may be."""
    reach_m = flat(shells.reach_table, min(int(above_m * SHELL_TABLE_PER_M), shells.reach_table.shape[0] - 1))
    # level rays bend out of their layer in 50 km or so
    return min((200.0 + 0.1 * above_m) * min(per_cosine, 67.0), reach_m) if reach_m < FAR_M else FAR_M


@part(FINITE, inlined=True)
def _expect(node, up, above, fields):
    """Have the memory send what `sample_grid` will read about a node, a batch of places later."""
    channels = fields.shape[3]
    for corner in (0, up, above, above + up):  # asking beyond the array does no harm
        expect(fields, (node + corner) * channels)
        expect(fields, (node + corner + 1) * channels)


@part(FINITE, inlined=True)
def _cells_free(cubes, node, octant):
    """Edge of the largest free cube ahead of the cell at flat element ``node`` of `free_cubes`, 0 where it is full."""
    found = (int(flat(cubes, node)) >> octant) & 0x01010101
    return (1 << ((found * 0x01010101 >> 24) & 7)) >> 1


@part(FINITE, inlined=True)
def walk_on(w, places, shells, volume, highest_m, scale):
    """Take the step that is due, note the place, and say how far the next step goes."""
    s = w[S]
    t = s + w[STEP]
    if t >= w[SAFE]:
        t = _next_leg(w, shells, volume)
        if w[STATE] == GONE:
            return
    step = w[STEP]
    count = int(w[COUNT])
    inside, filled = False, False
    level, ix, iy = -1.0, 0.0, 0.0
    h, clearance = 0.0, FAR_M
    if w[GRIDDED] > 0.0:
        u = t - w[BEGIN]
        h = w[H0] + u * (w[H1] + u * w[H2])
        ix, iy = w[X0] + u * w[VX], w[Y0] + u * w[VY]
        inside = inside_grid(ix, iy, volume)
        ground = terrain_height_m(ix, iy, shells.ground_m, volume) if h < highest_m else highest_m
        clearance = max(h - ground, 0.0)
        if w[ENDED] > 0.0:
            # a valley that the grid does not have is filled with its lowest air
            filled = h < ground
            h = max(h, ground)
        elif h < ground and w[SAMPLES] > 0.0:
            w[STATE] = HIT
            step = _meet_terrain(w, s, step, shells.radius_m, shells.ground_m, volume)
            t = s + step
            u = t - w[BEGIN]
            h = w[H0] + u * (w[H1] + u * w[H2])
            ix, iy = w[X0] + u * w[VX], w[Y0] + u * w[VY]
            inside = inside_grid(ix, iy, volume)  # the step may have passed the side
    else:
        h = height_of_square_m(w[SQUARE] + t * (2.0 * w[RISE] + t), shells.radius_m)
    place = count * PLACE
    above = max(h - shells.ground_m, 0.0)
    if inside:
        ny, nx = volume.terrain_m.shape
        if volume.periodic:
            ix -= math.floor(ix / nx) * nx
            iy -= math.floor(iy / ny) * ny
        level = level_at((h - volume.level_origin_m) * volume.level_per_m, volume.level_table)
        k = min(int(level), volume.fields.shape[0] - 2)
        node = k * (ny * nx) + (min(int(iy), ny - 1) * nx + min(int(ix), nx - 1))
        _expect(node, nx, ny * nx, volume.fields)
        next_step = _air_step_m(above, w[PER_COSINE], shells)
        slope = w[H1] + 2.0 * (t - w[BEGIN]) * w[H2]
        rising = slope > 0.0
        ahead = int(level)
        if not rising and level == ahead and ahead > 0:
            ahead -= 1
        along = 1.0 * (flat(volume.levels_m, ahead + 1) - flat(volume.levels_m, ahead))
        cell = min(w[ACROSS], along * w[PER_COSINE])
        octant = (1 if w[VX] > 0.0 else 0) + (2 if w[VY] > 0.0 else 0) + (4 if rising else 0)
        free = _cells_free(volume.free, node + (min(ahead, volume.fields.shape[0] - 2) - k) * (ny * nx), octant)
        to_level = (ahead + 1 - level) if rising else (level - ahead)
        if free > 0:
            # to where the free cube ends
            i, j = int(ix), int(iy)
            rest_x = i + free - ix if w[VX] > 0.0 else ix - i + (free - 1)
            rest_y = j + free - iy if w[VY] > 0.0 else iy - j + (free - 1)
            last = min(ahead + free, volume.fields.shape[0]) if rising else max(ahead + 1 - free, 0)
            upright = abs(volume.level_origin_m + flat(volume.levels_m, last) - h)
            way = min(min(rest_x * w[PER_VX], rest_y * w[PER_VY]), upright * w[PER_COSINE])
            next_step = min(next_step, way + _PAST * cell)
            # the nodes by the ground are not like those above: they end their layer's steps
            layer = upright
            if rising and clearance < along:
                layer = to_level * along
            elif not rising and clearance > along:
                layer = clearance - along
            if layer < upright:
                next_step = min(next_step, max(layer * w[PER_COSINE], _LEAST_STEP * cell))
        else:
            # within cloud a step ends on a level, where the fields have their kinks
            if to_level < 2e-3 or filled:
                to_level += 1.0
            next_step = min(min(next_step, to_level * along * min(w[PER_COSINE], 1e3) / scale), _CLOUD_STEP * cell)
        if w[ENDED] == 0.0 and (h < highest_m or not rising):
            # no farther than to where there could be ground
            closing, reach = -slope, FAR_M
            if h < highest_m:
                sine = min(flat(volume.cell_m, 0), flat(volume.cell_m, 1)) / w[ACROSS]
                closing += flat(volume.steep, node - k * (ny * nx)) * sine
                reach = STEEP_CELLS * w[ACROSS]
            way = min(clearance / max(closing, 1e-9), reach)
            next_step = min(next_step, max(way, _LEAST_STEP * cell))
    else:
        mu = (w[RISE] + t) / (shells.radius_m + h)
        next_step = _air_step_m(above, 1.0 / max(abs(mu), 1e-9), shells)
        if w[GRIDDED] > 0.0:
            # beside the grid, but over it: no farther than the way to it
            ny, nx = volume.terrain_m.shape
            gx = max(max(-ix, ix - (nx - 1.0)), 0.0) * flat(volume.cell_m, 0)
            gy = max(max(-iy, iy - (ny - 1.0)), 0.0) * flat(volume.cell_m, 1)
            cell = min(w[ACROSS], flat(volume.levels_m, 1) * w[PER_COSINE])
            next_step = min(next_step, max(0.9 * max(gx, gy), cell))
        elif h >= shells.top_m and mu > 0.0 and w[TURNING] == 0.0 and w[STATE] == GOING:
            w[STATE] = GONE
        level, ix, iy = -1.0, h, mu
    put(places, place + PLACE_S, t)
    put(places, place + PLACE_STEP, step)
    put(places, place + PLACE_LEVEL, level)
    put(places, place + PLACE_X, ix)
    put(places, place + PLACE_Y, iy)
    w[S], w[STEP], w[HEIGHT] = t, min(scale * next_step, FAR_M), h
    w[COUNT] = count + 1.0
    w[SAMPLES] += 1.0
