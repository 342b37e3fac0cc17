"""Nodes on the ground, around which there is half a layer (docs/decisions/0024-cloud-on-the-ground.md)."""

from __future__ import annotations

from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.engine.compiled import REORDERED, part
from openswim.transport.engine.types import FLOAT

_LEAST_ASIDE = 1e-3
_ONE, _TWO = FLOAT(1.0), FLOAT(2.0)


@part(REORDERED)
def share_of_ground(k, q, downward, levels_m, cell_m):
    """What a node on the ground, at level k, is to emit and take, of what it would, along an ordinate.

    There is half a layer around it. Steps through the layer above make it 1 - c/2 of one along ordinates downward, and
    c/2 along those upward, c their part from the plane above; or a half for both, if they cross no cell sideways.
    """
    if k + 1 >= levels_m.shape[0]:
        return _ONE
    aside = min(cell_m[0] / max(abs(q[0]), 1e-12), cell_m[1] / max(abs(q[1]), 1e-12))
    c = aside * abs(q[2]) / (levels_m[k + 1] - levels_m[k])
    if c >= 1.0:
        return _ONE
    return FLOAT(1.0 / (2.0 - c) if downward else 1.0 / max(c, _LEAST_ASIDE))


@part(REORDERED)
def share_ground(k, rows, share, grid, extinction, out, emitted):
    """A strip's rows of ``extinction`` into ``out``, a ``share`` of it where cloud is on the ground; ``emitted``, which
    is of the strip alone, likewise."""
    for j in range(rows[0], rows[1] + 2):
        for i in range(extinction.shape[1]):
            out[j, i] = extinction[j, i]
    ny, nx = grid.ground_node.shape
    for j in range(rows[0], rows[1]):
        for i in range(nx):
            if grid.ground_node[j, i] == k and grid.cloudy[k, j, i // BLOCK]:
                out[j + 1, i + 1] *= share
                emitted[j - rows[0] + 1, i + 1] *= share
    for j in range(rows[0], rows[1] + 2):  # ghosts
        one, other = (nx, 1) if grid.periodic else (1, nx)
        out[j, 0], out[j, nx + 1] = out[j, one], out[j, other]
    if rows[0] == 0:
        _copy(out, ny if grid.periodic and rows[1] == ny else 1, 0)
    if rows[1] == ny:
        _copy(out, 1 if grid.periodic and rows[0] == 0 else ny, ny + 1)


@part(REORDERED)
def _copy(plane, source, target):
    for i in range(plane.shape[1]):
        plane[target, i] = plane[source, i]


@part(REORDERED)
def all_of_ground(k, rows, q, downward, grid, amended):
    """What steps amend the light of nodes on the ground by, which they share with none below, in a strip's plane."""
    levels_m = grid.levels_m
    share = share_of_ground(k, q, downward, levels_m, grid.cell_m)
    if share != _ONE:
        share *= _TWO
    elif 0 < k < levels_m.shape[0] - 1:
        share = FLOAT((levels_m[k + 1] - levels_m[k - 1]) / (levels_m[k + 1] - levels_m[k]))
    for j in range(rows[0], rows[1]):
        for i in range(grid.ground_node.shape[1]):
            if grid.ground_node[j, i] == k:
                amended[j - rows[0] + 1, i + 1] *= share
