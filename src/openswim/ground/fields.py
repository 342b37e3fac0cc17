"""A model's surface fields at any place: between its nodes, across gaps, and a little beyond its edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def bilinear(values: FloatArray, ix: FloatArray, iy: FloatArray, valid: BoolArray | None = None) -> FloatArray:
    """(ny, nx[, k]) at fractional indices, the edge holding beyond; only among `valid` nodes where there are any."""
    ny, nx = values.shape[:2]
    x, y = np.clip(ix, 0, nx - 1), np.clip(iy, 0, ny - 1)
    i, j = np.minimum(x.astype(int), nx - 2), np.minimum(y.astype(int), ny - 2)
    fx, fy = x - i, y - j
    nodes = np.stack([j * nx + i, j * nx + i + 1, (j + 1) * nx + i, (j + 1) * nx + i + 1])
    weights = np.stack([(1 - fy) * (1 - fx), (1 - fy) * fx, fy * (1 - fx), fy * fx])
    if valid is not None:
        kept = weights * valid.ravel()[nodes]
        weights = np.where(kept.sum(axis=0) > 1e-6, kept, weights)
        weights = weights / weights.sum(axis=0)
    trailing = values.shape[2:]
    rows = values.reshape(ny * nx, *trailing)
    out = np.zeros(x.shape + trailing)
    for node, weight in zip(nodes, weights, strict=True):
        out += rows.take(node, axis=0) * weight.reshape(weight.shape + (1,) * len(trailing))
    return out


def blurred(values: FloatArray) -> FloatArray:
    """(ny, nx) smoothed by a binomial of 2 cells' standard deviation; the edge holds beyond."""
    out = values
    for axis in (0, 1):
        for _ in range(4):
            f = np.moveaxis(out, axis, -1)
            padded = np.concatenate([f[..., :1], f[..., :1], f, f[..., -1:], f[..., -1:]], axis=-1)
            n = f.shape[-1]
            shifted = np.stack([padded[..., k : k + n] for k in range(5)], axis=-1)
            out = np.moveaxis(shifted @ (np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16), -1, axis)
    return out


def filled(
    values: FloatArray, valid: BoolArray, ix: FloatArray, iy: FloatArray, away: FloatArray, levels: int = 4
) -> tuple[FloatArray, FloatArray]:
    """(ny, nx[, k]) among `valid` nodes at fractional indices: values (n[, k]) and whether any were near (n,), 0 to 1.

    Where no valid node is next to a place, and `away` (cells) from the grid, means over 2, 4, 8, ... cells stand in,
    so that nothing of a single cell is drawn out into a streak.
    """
    trailing = (1,) * (values.ndim - 2)
    weight = valid.astype(float)
    total = values * weight.reshape(weight.shape + trailing)
    out = np.zeros(ix.shape + values.shape[2:])
    known = np.zeros(ix.shape)
    for n in range(levels + 1):
        left = np.flatnonzero(known < 1)
        x, y = (ix[left] + 0.5) / (1 << n) - 0.5, (iy[left] + 0.5) / (1 << n) - 0.5
        w = bilinear(weight, x, y)
        v = bilinear(total, x, y) / np.maximum(w, 1e-9).reshape(w.shape + trailing)
        last = n == levels or min(weight.shape) < 4
        fits = 1.0 if last else np.clip(1.5 - away[left] / (1 << n), 0.0, 1.0)
        share = (1 - known[left]) * fits * np.clip(4 * w, 0.0, 1.0)
        out[left] += share.reshape(share.shape + trailing) * v
        known[left] += share
        if last or left.size == 0:
            break
        weight, total = _halved(weight), _halved(total)
    return out / np.maximum(known, 1e-9).reshape(known.shape + trailing), known


def _halved(values: FloatArray) -> FloatArray:
    """Means of 2 x 2 nodes; an odd last row or column counts twice."""
    ny, nx = values.shape[:2]
    even = np.pad(values, ((0, ny % 2), (0, nx % 2)) + ((0, 0),) * (values.ndim - 2), mode="edge")
    return 0.25 * (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2])
