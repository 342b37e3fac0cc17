"""Levels of a medium: a scene's own, more where sweeps need them, and on above it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST_RESOLVED_NODES = 4_000_000
_MOST_NODES = 6_000_000
_MOST_LEVELS, _MOST_LAYER_LEVELS = 160, 640
LAYERS_DEGREE = 32  # truncation order M of the light in layers without sides (`columns.discrete_ordinates`)
_CLOUDY_DEPTH = 0.05  # vertical optical depth of a layer that counts as cloud
_CELL_DEPTH = 0.7  # optical depth above which a cell is divided
_MOST_PARTS, _MOST_LONE_PARTS = 16, 8  # and into how many; in columns lit each by itself, which divide cells further
# Delta-scaled depth behind which layers are divided into so many: an overcast looks the same within 5e-5, one of cover
# .5 (as IFS has them) within .4 % rms from above and 1.2 % from below
_DEEP, _DEEP_PARTS = 8.0, 2
_FLATTEST = 0.05  # of a cell's depth across, that from below: flatter ones tell no more (decision 27, by Monte Carlo)
_SCALED = 0.4  # of the extinction, by delta scaling: 1 - f is .3 to .55
_AIR_TOP_M = 18_000.0  # of levels on which there is but air
_FAINT_DEPTH = 3e-4  # above which models leave traces of ice on dozens of levels (IFS 1e-24 per metre at 66 km)
_FINEST_M, _COARSEST_M, _FLATNESS = 100.0, 300.0, 0.1  # least distance of levels, and its share of a cell's width
_TALLER, _TALLEST, _TALLEST_M = 2.0, 0.3, 2000.0  # than the last, of its height (haze thins out fast), and at all


def own_levels(heights: NDArray, terrain: F32, extend: bool) -> F64:
    """Levels for a scene: its own where they are flat, else spaced like its layers at each height."""
    low = float(min(terrain.min(), heights.min()))
    if heights.ndim == 1:
        z = heights.astype(float)
        if extend and z[0] > low + 1.0:
            count = int(np.clip(np.ceil((z[0] - low) / (1.5 * (z[1] - z[0]))), 1, _MOST_LEVELS))
            z = np.concatenate([np.linspace(low, z[0], count, endpoint=False), z])
        elif not extend and z[0] > 0.5:
            z = np.concatenate([[0.0, z[0] - min(1.0, 0.1 * z[0])], z])
        return z
    columns = heights.reshape(heights.shape[0], -1).astype(float)
    columns = columns[:, :: max(1, columns.shape[1] // 2000)]
    top = float(columns[-1].max())
    thickness = np.diff(columns, axis=0)
    middle = 0.5 * (columns[1:] + columns[:-1])
    # the finer tenth of the layers near each height decides, but no layer under 30 m
    probe = np.linspace(low, top, 200)
    local = np.empty(200)
    for n, z in enumerate(probe):
        row = np.abs(middle - z).argmin(axis=0)
        local[n] = np.percentile(thickness[row, np.arange(columns.shape[1])], 10)
    local = np.maximum(local, 30.0)
    count_at = np.concatenate([[0.0], np.cumsum(0.5 * (1 / local[1:] + 1 / local[:-1]) * np.diff(probe))])
    count = int(np.clip(np.ceil(count_at[-1]), 8, _MOST_LEVELS))
    return np.interp(np.linspace(0, count_at[-1], count + 1), count_at, probe)


def without_traces(levels: F64, heights: NDArray, total: F32) -> F64:
    """The levels up to the first above which there is but air (`highest_cloud_m`), nor much of that is left."""
    top_m = max(_AIR_TOP_M, highest_cloud_m(heights, total))
    return levels[: max(2, int(np.searchsorted(levels, top_m)) + 1)]


def highest_cloud_m(heights: NDArray, total: F32) -> float:
    """Height above which no column has more than `_FAINT_DEPTH` of the extinction ``total`` (nz, ny, nx)."""
    own = heights[:, None, None] if heights.ndim == 1 else heights
    depth = np.zeros(total.shape[1:], total.dtype)
    for k in range(len(total) - 1, 0, -1):
        depth += 0.5 * (total[k] + total[k - 1]) * (own[k] - own[k - 1])
        if (there := depth > _FAINT_DEPTH).any():
            return float(np.broadcast_to(own[k], depth.shape)[there].max())
    return -np.inf


def refined_levels(
    levels: F64, heights: NDArray, total: F32 | None, cell_m: float, columns: int, share: float, sides: bool = False,
    alone: bool = False,
) -> F64:  # fmt: skip
    """Divide layers that are taller than a cell is wide, or optically too thick (docs/fast.md, F2).

    ``share`` of the usual depth that a layer may have where cloud covers most columns: broken cloud is lit
    from its sides. sides: columns share their light, and where cells stay thick across flat ones tell no more. alone:
    columns are lit each by itself.
    """
    if total is None:
        return levels
    dz = np.diff(levels)
    parts = np.clip(np.ceil(dz / cell_m - 0.01), 1, 3)
    flat = total.reshape(total.shape[0], -1)
    own = heights if heights.ndim == 1 else heights.reshape(heights.shape[0], -1).mean(axis=1)
    cloudy = _of_most(flat, flat)
    uneven = _of_most(_uneven(total).reshape(flat.shape), flat) if sides else np.zeros(len(flat))
    covered = np.clip(4 * (flat > 0).any(axis=0).mean() - 2, 0.0, 1.0)
    beyond = 0.0 if heights.ndim == 1 else None  # below a model's lowest nodes on the mean lie those of its valleys
    middle = 0.5 * (levels[1:] + levels[:-1])
    scaled = _SCALED / (1 + (share - 1) * covered)
    depth = scaled * np.interp(middle, own, cloudy, left=beyond, right=beyond) * dz
    across = scaled * np.interp(middle, own, uneven, left=beyond, right=beyond) * cell_m
    most = _MOST_LONE_PARTS if alone else _MOST_PARTS
    parts = np.maximum(parts, np.clip(np.ceil(depth / np.maximum(_CELL_DEPTH, _FLATTEST * across)), 1, most))
    # where spacing changes within cloud, sweeps make light or lose it: the layers beside are divided as finely
    in_cloud = depth > _CLOUDY_DEPTH
    beside = np.pad(np.where(in_cloud, dz / parts, np.inf), 1, constant_values=np.inf)
    beside = np.minimum(beside[:-2], beside[2:])
    parts = np.where(in_cloud, np.maximum(parts, np.ceil(dz / beside - 0.3)), parts)
    if alone:
        parts = np.where(_deep(levels, own, flat), np.minimum(parts, _DEEP_PARTS), parts)
    while parts.sum() > min(_MOST_LEVELS * 4, max(_MOST_NODES / columns, len(levels))) and parts.max() > 1:
        parts = np.maximum(1, np.ceil(parts * 0.75) - (parts > 1))
    pieces = [np.linspace(a, b, int(n), endpoint=False) for a, b, n in zip(levels[:-1], levels[1:], parts, strict=True)]
    return np.concatenate([*pieces, levels[-1:]])


def _deep(levels: F64, heights: F64, total: NDArray) -> NDArray[np.bool_]:
    """Which layers between levels have more than `_DEEP` above them and below, in nine columns (nz, n) of ten."""
    layers = 0.5 * _SCALED * (total[1:] + total[:-1]) * np.diff(heights)[:, None]
    below = np.percentile(np.cumsum(np.pad(layers, ((1, 0), (0, 0))), axis=0), 10, axis=1)
    above = np.percentile(np.cumsum(np.pad(layers, ((0, 1), (0, 0)))[::-1], axis=0), 10, axis=1)[::-1]
    return np.minimum(np.interp(levels[:-1], heights, below), np.interp(levels[1:], heights, above)) > _DEEP


def _of_most(field: NDArray, total: NDArray) -> F64:
    """(nz,): what nine cloudy cells in ten of each level (nz, n) have at most."""
    return np.array([np.percentile(row[own > 0], 90) if (own > 0).any() else 0.0
                     for row, own in zip(field, total, strict=True)])  # fmt: skip


def _uneven(total: F32) -> F32:
    """Extinction of each node that columns as wide do not tell: what is even need not be divided, however thick."""
    return np.minimum(total, 4 * _difference_across(total))


def halvings_for(levels: F64, heights: NDArray, total: F32 | None, cell_m: float, columns: int) -> int:
    """How often to halve columns until nine cloudy cells in ten are not too thick across, or nodes too many."""
    depth = 0.0
    if total is not None and (cloudy := total > 0).any():
        depth = _SCALED * float(np.percentile(_uneven(total)[cloudy], 90)) * cell_m
    halvings = 0
    while depth > _CELL_DEPTH * 2**halvings:
        parts, finer = 2 ** (halvings + 1), columns * 4 ** (halvings + 1)
        # with all levels that they want: these come first
        if len(refined_levels(levels, heights, total, cell_m / parts, 1, 1.0)) * finer > MOST_RESOLVED_NODES:
            break
        halvings += 1
    return halvings


def _difference_across(field: F32) -> F32:
    """The largest difference of each node (nz, ny, nx) from its neighbours along the last two axes."""
    out = np.zeros_like(field)
    for axis in (1, 2):
        there, other = np.moveaxis(out, axis, 0), np.abs(np.diff(np.moveaxis(field, axis, 0), axis=0))
        np.maximum(there[1:], other, out=there[1:])
        np.maximum(there[:-1], other, out=there[:-1])
    return out


def levels_above(levels: F64) -> F64:
    """Further levels, ever taller, up to where little air is left."""
    out, dz = [float(levels[-1])], float(levels[-1] - levels[-2])
    while out[-1] < _AIR_TOP_M:
        dz = max(dz, min(_TALLER * dz, _TALLEST * out[-1], _TALLEST_M))
        out.append(out[-1] + dz)
    return np.array(out[1:])


def layer_levels(levels_m: F64, extinction: F64, mu_sun: float) -> F64:
    """Levels (nz,) and more between them, close where the light changes fast: near the top, and near the bottom.

    Spaced by optical depth: a twentieth of the distance to the nearer end, at least a thirtieth of what the slanting
    sun meets in unit depth.
    """
    depth = 0.5 * (extinction[1:] + extinction[:-1]) * np.diff(levels_m)
    from_below = np.concatenate([[0.0], np.cumsum(depth)])
    total = from_below[-1]
    coarseness = 1.0
    while True:
        least = coarseness * max(mu_sun, 0.05) / 30
        out = [levels_m[0]]
        for k, here in enumerate(depth):
            part = 0.0
            while part < 1:
                x = from_below[k] + part * here
                step = min(coarseness * 0.5, max(0.05 * coarseness * x, 0.02 * coarseness),
                           max(0.05 * coarseness * (total - x), least))  # fmt: skip
                # what is left of a cell is shared evenly where two steps would do
                part = 1.0 if here * (1 - part) <= 1.3 * step else part + min(step / here, 0.6 * (1 - part))
                out.append(levels_m[k] + part * (levels_m[k + 1] - levels_m[k]))
        if len(out) <= max(_MOST_LAYER_LEVELS, len(levels_m)):
            return np.array(out)
        coarseness *= 1.3


def large_levels(heights: NDArray, terrain: F32, cell_m: float, top_m: float) -> F64:
    """Levels (n,) as close as the model's on the whole, where that is not needlessly close for cells so wide."""
    columns = heights.reshape(len(heights), -1)
    columns = columns[:, :: max(1, columns.shape[1] // 2000)].astype(float)
    middle, thickness = 0.5 * (columns[1:] + columns[:-1]), np.diff(columns, axis=0)
    low = float(min(terrain.min(), columns[0].min()))
    least = np.clip(_FLATNESS * cell_m, _FINEST_M, _COARSEST_M)
    probe = np.linspace(low, top_m, 400)
    rows = np.array([np.abs(middle - z).argmin(axis=0) for z in probe])
    local = np.maximum(np.median(np.take_along_axis(thickness, rows, 0), axis=1), least)
    count_at = np.concatenate([[0.0], np.cumsum(0.5 * (1 / local[1:] + 1 / local[:-1]) * np.diff(probe))])
    count = max(8, int(np.ceil(count_at[-1])))
    return np.interp(np.linspace(0, count_at[-1], count + 1), count_at, probe)
