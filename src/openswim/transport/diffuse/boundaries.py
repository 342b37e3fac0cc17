"""Where the planes of a sweep end: light that enters by open sides, and light that goes round a period."""

from __future__ import annotations

import math

from openswim.transport.diffuse.step import step_weights
from openswim.transport.engine.compiled import REORDERED, part
from openswim.transport.engine.pack import flat, put
from openswim.transport.engine.types import FLOAT

_LEFT = 0.02  # of the light upstream, that the last sweep's stands in for
_MOST_ROUNDS = 100


@part(REORDERED, inlined=True)
def enter(light, node, inward, extinction, node_e, length, inflow):
    """Light at a ``node`` on a side through which it enters: what makes the mean of this node and the next one
    ``inward`` that of the cell between them, of a length along the ordinate, if all of it emits alike."""
    tau = 0.5 * (flat(extinction, node_e) + flat(extinction, node_e + inward)) * length
    share = 0.0
    if tau > 0.1:
        lost = -math.expm1(-tau)
        share = 2.0 * (1.0 / lost - 1.0 / tau) - 1.0
    elif tau > 0.0:
        share = tau / 6.0
    put(light, node, FLOAT(inflow + share * (flat(light, node + inward) - inflow)))


@part(REORDERED)
def set_sides(plane, first, nx, periodic, inflow, known, side):
    """Ghost nodes before a plane (rows and ghosts, nodes and ghosts), from row ``first`` on, is swept.

    known: what the sides (4, m) bring, else ``inflow`` everywhere. Periodic: those of the last sweep stand in for what
    this one has not reached yet.
    """
    ny = plane.shape[0] - 2
    if known:
        for j in range(ny):
            plane[j + 1, 0], plane[j + 1, nx + 1] = side[0, first + j], side[1, first + j]
        for i in range(nx):
            plane[0, i + 1], plane[ny + 1, i + 1] = side[2, i], side[3, i]
        if not periodic:
            for j in (0, ny + 1):
                plane[j, 0], plane[j, nx + 1] = plane[j, 1], plane[j, nx]
        return
    for j in range(1, ny + 1):
        plane[j, 0] = plane[j, nx + 1] = inflow
    plane[0, :] = inflow
    plane[ny + 1, :] = inflow


@part(REORDERED)
def wrap_sides(plane, nx, side):
    """Ghost nodes of a swept periodic plane: the other side; the next sweep begins from them."""
    ny = plane.shape[0] - 2
    for j in range(1, ny + 1):
        plane[j, 0] = side[0, j - 1] = plane[j, nx]
        plane[j, nx + 1] = side[1, j - 1] = plane[j, 1]
    for i in range(nx):
        side[2, i], side[3, i] = plane[ny, i + 1], plane[1, i + 1]
    end_rows(plane, True)


@part(REORDERED)
def end_rows(plane, periodic):
    """Ghost rows: the other side where periodic, else the edge itself."""
    ny = plane.shape[0] - 2
    first, last = (ny, 1) if periodic else (1, ny)
    for i in range(plane.shape[1]):
        plane[0, i] = plane[first, i]
        plane[ny + 1, i] = plane[last, i]


@part(REORDERED)
def rounds_of(q, dz, cell_m, columns):
    """How often a plane is swept until light that goes round a period of ``columns`` (y, x) on its way through a layer
    has come in from the plane before, but for `_LEFT`. Once where a period is wide, and along level ordinates, whose
    light comes from nowhere else."""
    if q[2] == 0.0:
        return 1
    round_x = columns[1] * cell_m[0] / max(abs(q[0]), 1e-12)
    round_y = columns[0] * cell_m[1] / max(abs(q[1]), 1e-12)
    often = abs(dz / q[2]) / min(round_x, round_y)
    return int(min(max(math.ceil(-math.log(_LEFT) * often), 1), _MOST_ROUNDS))


@part(REORDERED)
def cross_clear(k, before, q, grid, light, light_before, emitted, emitted_before):
    """A plane of a period in one step from the plane before, with clear air between: level light goes round many times
    on its way there, which sweeps of cells would follow one round each."""
    ny, nx = grid.ground_node.shape
    length = abs(grid.levels_m[k] - grid.levels_m[before]) / abs(q[2])
    aside_x, aside_y = length * q[0] / grid.cell_m[0], length * q[1] / grid.cell_m[1]
    cells_x, cells_y = math.floor(aside_x), math.floor(aside_y)
    a, c = FLOAT(aside_x - cells_x), FLOAT(aside_y - cells_y)
    trans, near, far = step_weights(grid.air_extinction[k], grid.air_extinction[before], FLOAT(length))
    for j in range(ny):
        one = (j + cells_y) % ny + 1
        two = (j + cells_y + 1) % ny + 1
        for i in range(nx):
            here = (i + cells_x) % nx + 1
            after = (i + cells_x + 1) % nx + 1
            up = light_before[one, here] + a * (light_before[one, after] - light_before[one, here])
            beside = light_before[two, here] + a * (light_before[two, after] - light_before[two, here])
            up += c * (beside - up)
            source = emitted_before[one, here] + a * (emitted_before[one, after] - emitted_before[one, here])
            beside = emitted_before[two, here] + a * (emitted_before[two, after] - emitted_before[two, here])
            source += c * (beside - source)
            light[j + 1, i + 1] = trans * up + near * emitted[j + 1, i + 1] + far * source
