"""Finer grids over a model's own: smooth fields between its nodes, with the means that it gives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]


def subdivided(field: F32, fineness: int) -> F32:
    """Cubic B-spline subdivision of the last two axes, ``fineness`` (a power of two) nodes per node: smooth edges."""
    while fineness > 1:
        for axis in (-2, -1):
            f = field.swapaxes(axis, -1)
            out = np.empty((*f.shape[:-1], 2 * f.shape[-1] - 1), FLOAT)
            out[..., ::2] = f
            out[..., 2:-1:2] = (f[..., :-2] + 6 * f[..., 1:-1] + f[..., 2:]) / 8
            out[..., 1::2] = (f[..., :-1] + f[..., 1:]) / 2
            field = out.swapaxes(-1, axis)
        fineness //= 2
    return np.ascontiguousarray(field)


def halved(field: NDArray, axis: int, periodic: bool = False) -> NDArray:
    """The field with the mean of every two neighbours between them; ``periodic``: the last's neighbour is the first."""
    f = np.moveaxis(field, axis, -1)
    if periodic:
        f = np.concatenate([f, f[..., :1]], axis=-1)
    out = np.empty((*f.shape[:-1], 2 * f.shape[-1] - 1), f.dtype)
    out[..., ::2] = f
    out[..., 1::2] = (f[..., :-1] + f[..., 1:]) / 2
    return np.ascontiguousarray(np.moveaxis(out[..., :-1] if periodic else out, -1, axis))


def finer_cloud(field: F32, fineness: int) -> F32:
    """Extinction between the nodes of a coarse model, so that its cells do not show.

    The fourth root is interpolated: between a clear node and a thick one the cloud then ends about midway and its
    outline is smooth, where linear interpolation would draw the cells' own staircase. The mean of every cell is kept.
    """
    return with_means_of(subdivided(np.sqrt(np.sqrt(field)), fineness) ** 4, field, fineness)


def with_means_of(fine: F32, field: F32, fineness: int, most: float = 6.0) -> F32:
    """``fine`` scaled, by at most a factor ``most``, so that its mean around each node is that of ``field``."""
    mean = around_nodes(fine, fineness)
    ratio = np.where(mean > 0, np.clip(field / np.maximum(mean, 1e-12), 0, most), 1).astype(FLOAT)
    return np.asarray(fine * subdivided(ratio, fineness), FLOAT)


def around_nodes(fine: F32, fineness: int) -> F32:
    """The mean around each ``fineness``-th node of the last two axes, with the weights of linear interpolation."""
    mean = fine
    while fineness > 1:
        for axis in (-2, -1):
            m = mean.swapaxes(axis, -1)
            padded = np.concatenate([m[..., 1:2], m, m[..., -2:-1]], axis=-1)
            mean = ((padded[..., :-2:2] + 2 * padded[..., 1:-1:2] + padded[..., 2::2]) / 4).swapaxes(-1, axis)
        fineness //= 2
    return np.ascontiguousarray(mean)
