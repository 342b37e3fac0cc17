"""Smooth random fields from B-spline lattices, the raw material of the procedural demo scene.

A lattice of independent normal numbers is interpolated with cubic B-splines. The result is a smooth,
band-limited random field: its energy lies at wavelengths of about two to six lattice spacings, so the caller
decides which scales a grid can carry. Interpolation is separable, so a field costs a few small matrix
products, on any levels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]

# Integral of the squared cubic B-spline: the mean variance that interpolation leaves, per dimension.
_SPLINE_VARIANCE = 151.0 / 315.0
_BAND = 32  # rows of a band matrix multiplied together


def spline_weights(coordinate_m: NDArray, spacing_m: float, shift: float) -> FloatArray:
    """Weights (n, nodes) of the uniform cubic B-spline for `coordinate_m` (n,) on a lattice of `spacing_m`.

    `shift` (0..1) moves the lattice by a part of its spacing, so that octaves do not share their nodes.
    """
    position = (np.asarray(coordinate_m, float) - np.min(coordinate_m)) / spacing_m + shift
    cell = np.floor(position).astype(int)
    t = position - cell
    basis = (
        np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6
    )
    weights = np.zeros((len(t), int(cell.max()) + 4), np.float32)
    weights[np.arange(len(t))[:, None], cell[:, None] + np.arange(4)] = basis
    return weights


def _blocks(weights: FloatArray) -> list[tuple[slice, FloatArray]]:
    """Blocks of rows of `spline_weights`, without the nodes that none of them uses."""
    blocks = []
    for start in range(0, len(weights), _BAND):
        rows = weights[start : start + _BAND]
        used = np.flatnonzero(rows.any(axis=0))
        some = slice(int(used[0]), int(used[-1]) + 1)
        blocks.append((some, rows[:, some]))
    return blocks


def lattice_noise(
    rng: np.random.Generator, axes: Sequence[NDArray], spacing_m: float | Sequence[float]
) -> FloatArray:
    """Smooth random field on the product of `axes` (each (n,) in m): zero mean, unit variance, float32.

    `spacing_m` is the distance of the lattice nodes, one for all axes or one per axis.
    """
    spacings = np.broadcast_to(np.asarray(spacing_m, float), (len(axes),))
    matrices = [
        spline_weights(axis, float(step), rng.random()) for axis, step in zip(axes, spacings, strict=True)
    ]
    field = rng.standard_normal([m.shape[1] for m in matrices], dtype=np.float32)
    for number, matrix in enumerate(matrices):
        field = _banded(_blocks(matrix), field, number)
    return np.ascontiguousarray(field / np.float32(_SPLINE_VARIANCE ** (len(axes) / 2)))


def fractal_noise(
    rng: np.random.Generator,
    axes: Sequence[NDArray],
    spacing_m: float,
    smallest_m: float,
    gain: float = 0.5,
    billow: bool = False,
) -> FloatArray:
    """Sum of octaves of `lattice_noise` from `spacing_m` down to `smallest_m`, each `gain` times the last.

    The first octave has unit variance. With `billow` each octave is folded to |n| and centred: round knobs
    outward with sharp creases between them, the outline of convective cloud.
    """
    total = np.zeros([len(axis) for axis in axes], np.float32)
    amplitude = 1.0
    while amplitude == 1.0 or spacing_m >= smallest_m:
        octave = lattice_noise(rng, axes, spacing_m)
        if billow:
            octave = (np.abs(octave) - np.float32(0.798)) / np.float32(0.603)  # as of |normal|
        total += np.float32(amplitude) * octave
        amplitude *= gain
        spacing_m /= 2
    return total


def smoothstep(value: NDArray, low: float, high: float | NDArray) -> FloatArray:
    """Cubic step from 0 at `low` to 1 at `high`."""
    t = np.clip((np.asarray(value, np.float32) - low) / (high - low), 0, 1).astype(np.float32)
    return t * t * (3 - 2 * t)


def sample(field: FloatArray, index: Sequence[NDArray]) -> FloatArray:
    """Multilinear interpolation of `field` at fractional node indices, one broadcastable array per dimension.

    Outside, the nearest edge holds.
    """
    nodes, parts = [], []
    for position, size in zip(index, field.shape, strict=True):
        inside = np.clip(np.asarray(position, np.float32), 0, size - 1)
        node = np.minimum(inside.astype(np.intp), size - 2)
        nodes.append(node)
        parts.append(inside - node)
    strides = np.cumprod([1, *field.shape[:0:-1]])[::-1]
    first, flat = sum(node * int(stride) for node, stride in zip(nodes, strides, strict=True)), field.ravel()
    total = np.zeros(np.broadcast_shapes(*(node.shape for node in nodes)), np.float32)
    for corner in np.ndindex(*(2,) * field.ndim):
        weight = np.float32(1.0)
        for side, part in zip(corner, parts, strict=True):
            weight = weight * (part if side else 1 - part)
        total += weight * flat[first + int(np.dot(corner, strides))]
    return total


def blur(field: NDArray, deviation: Sequence[float]) -> FloatArray:
    """Gaussian mean of `field` along its leading axes, deviations in nodes, complete at the edges."""
    for axis, sigma in enumerate(deviation):
        node = np.arange(field.shape[axis], dtype=np.float32)
        reach = 5.3 * max(sigma, 1e-3)  # beyond, a Gaussian is below 1e-6
        rows = []
        for start in range(0, node.size, _BAND):
            at = node[start : start + _BAND]
            some = slice(max(0, int(at[0] - reach)), int(at[-1] + reach) + 1)
            kernel = np.exp(-0.5 * ((at[:, None] - node[some]) / max(sigma, 1e-3)) ** 2)
            rows.append((some, kernel / kernel.sum(axis=1, keepdims=True)))
        field = _banded(rows, np.asarray(field, np.float32), axis)
    return np.ascontiguousarray(field, np.float32)


def _banded(rows: list[tuple[slice, FloatArray]], field: FloatArray, axis: int) -> FloatArray:
    """A matrix, by blocks of rows and the columns (slice) that they use, applied along an axis of `field`."""
    if axis == field.ndim - 1:
        return np.concatenate([field[..., some] @ block.T for some, block in rows], axis=-1)
    flat = field.reshape(*field.shape[: axis + 1], -1)
    after = np.concatenate([block @ flat[..., some, :] for some, block in rows], axis=axis)
    return after.reshape(*after.shape[: axis + 1], *field.shape[axis + 1 :])
