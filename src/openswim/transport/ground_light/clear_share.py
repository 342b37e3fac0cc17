"""How much of the clear sky's light comes past the clouds to the ground below each column.

Along ordinates q, of weight w_q and clear radiance I_q, it is the mean of e^-tau_q, tau_q the delta-scaled depth of all
cloud that the line of sight passes, by w_q q_z I_q: what the quadrature has of the clear sky.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import kernel, part
from openswim.transport.engine.ordinates import LEVEL, Ordinates
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def clear_share(medium: Medium, scaled: F32, ordinates: Ordinates, radiance: F32, ends: NDArray[np.bool_]) -> F32:
    """Shares (nw, ny, nx) of the clear ``radiance`` (ordinates, nw) at the ground; ``scaled`` (ns,): delta-scaled
    extinction of the species.

    Lines are straight and go by whole columns, from the mean height of the ground. Beyond the sides is what is at
    them, and nothing where they are ``ends`` (2, 2) of the grid.
    """
    _, ny, nx = medium.shape
    height, depth = _layers(medium, scaled)
    down = np.flatnonzero(ordinates.direction[:, 2] > LEVEL)
    way, weight = ordinates.direction[down], ordinates.weight[down, None] * radiance[down]
    weight = weight * way[:, 2:]
    weight = (weight / np.maximum(weight.sum(axis=0), 1e-30)).astype(FLOAT)
    depth = np.pad(depth, ((0, 0), (1, 1), (1, 1)), "edge")
    for axis, of_axis in ((2, ends[0]), (1, ends[1])):
        for end, beyond in zip(of_axis, (0, -1), strict=True):
            if end:
                np.moveaxis(depth, axis, 0)[beyond] = 0
    steps = np.rint(height * (way[:, :2] / way[:, 2:] / medium.cell_m[:2])[..., None])  # of columns: (n, 2, nk)
    out = np.zeros((len(down), ny, nx), FLOAT)
    in_threads(_add_depths, np.ascontiguousarray(depth), steps.astype(np.int64), medium.periodic, out)
    np.exp(out / -way[:, 2, None, None].astype(FLOAT), out=out)
    return np.einsum("nw,nji->wji", weight, out, optimize=True)


@kernel()
def _add_depths(t, threads, depth, steps, periodic, out):
    """Part t of the depths ``out`` (n, ny, nx) along lines that pass layers (nk, ny + 2, nx + 2) of ``depth`` so many
    ``steps`` (n, 2, nk) of columns along x and y away."""
    _, ny, nx = out.shape
    columns = np.empty(nx, np.int64)
    for n in range(t, out.shape[0], threads):
        for k in range(depth.shape[0]):
            for i in range(nx):
                columns[i] = _node(i + steps[n, 0, k], nx, periodic)
            for j in range(ny):
                row = _node(j + steps[n, 1, k], ny, periodic)
                for i in range(nx):
                    out[n, j, i] += depth[k, row, columns[i]]


@part(inlined=True)
def _node(at, count, periodic):
    """Where a column stands in a row with one more before and after it."""
    return 1 + (at % count if periodic else min(max(at, -1), count))


def _layers(medium: Medium, scaled: F32) -> tuple[F64, F32]:
    """Heights (nk,) over the mean ground, m, and delta-scaled depths (nk, ny, nx) upward, of the levels with cloud."""
    extinction, levels = medium.extinction_above_ground, medium.levels_m
    cloudy = np.flatnonzero(extinction.any(axis=(0, 2, 3)))
    thickness = np.gradient(levels) * np.where(np.isin(np.arange(len(levels)), (0, len(levels) - 1)), 0.5, 1.0)
    depth = np.einsum("s,skji,k->kji", scaled, extinction[:, cloudy], thickness[cloudy].astype(FLOAT))
    return np.maximum(levels[cloudy] - float(medium.terrain_m.mean()), 0.0), depth
