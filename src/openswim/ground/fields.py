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
        fits = np.clip((1 << n) - 0.5 * away[left], 0.0, 1.0) if n < levels else 1.0
        share = (1 - known[left]) * fits * np.clip(4 * w, 0.0, 1.0)
        out[left] += share.reshape(share.shape + trailing) * v
        known[left] += share
        if min(weight.shape) < 4 or left.size == 0:
            break
        weight, total = _halved(weight), _halved(total)
    return out / np.maximum(known, 1e-9).reshape(known.shape + trailing), known


def _halved(values: FloatArray) -> FloatArray:
    """Means of 2 x 2 nodes; an odd last row or column counts twice."""
    ny, nx = values.shape[:2]
    even = np.pad(values, ((0, ny % 2), (0, nx % 2)) + ((0, 0),) * (values.ndim - 2), mode="edge")
    return 0.25 * (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2])


def normal_noise(lat: FloatArray, lon: FloatArray, largest_m: float, smallest_m: FloatArray) -> FloatArray:
    """Smooth random numbers (n,), mean 0 and standard deviation about 1, the same at a place in every picture.

    Octaves from `largest_m` down to `smallest_m` (n,), amplitude in proportion to scale^.5.
    """
    metres = 111_195.0
    # three coordinates of the sphere: no seam at the date line, none at the poles
    la, lo = np.radians(lat), np.radians(lon)
    place = np.stack([np.cos(la) * np.cos(lo), np.cos(la) * np.sin(lo), np.sin(la)]) * np.degrees(1.0) * metres
    out, variance = np.zeros(lat.size), 0.0
    for octave in range(7):
        scale = largest_m / 2**octave
        amplitude = 2.0 ** (-0.5 * octave)
        # what is too fine for the picture would only flicker
        seen = np.clip(2.0 - 2.0 * np.asarray(smallest_m) / scale, 0.0, 1.0)
        if not seen.any():
            break
        out += amplitude * seen * _value_noise(place / scale, octave)
        variance += amplitude**2
    return out / np.sqrt(max(variance, 1e-9)) / _NOISE_DEVIATION


_NOISE_DEVIATION = 0.183  # of trilinear value noise of uniform numbers, smoothstep weights, on a plane through it


def _value_noise(p: FloatArray, seed: int) -> FloatArray:
    """Value noise (n,) between -.5 and .5 at points (3, n), one lattice cell to the unit."""
    cell = np.floor(p).astype(np.int64)
    f = p - cell
    f = f * f * (3 - 2 * f)
    out = np.zeros(p.shape[1])
    for corner in range(8):
        d = np.array([corner & 1, corner >> 1 & 1, corner >> 2])[:, None]
        out += np.prod(np.where(d == 1, f, 1 - f), axis=0) * _hashed(cell + d, seed)
    return out


def _hashed(cell: NDArray[np.int64], seed: int) -> FloatArray:
    """Uniform numbers (n,) from -.5 to .5 out of integers (3, n)."""
    keys = (73856093, 19349663, 83492791)
    h = np.full(cell.shape[1], seed * 2654435761 + 1, np.uint64)
    with np.errstate(over="ignore"):
        for part, key in zip(cell.astype(np.uint64), keys, strict=True):
            h = (h ^ part * np.uint64(key)) * np.uint64(0x9E3779B97F4A7C15)
            h ^= h >> np.uint64(29)
        h = h * np.uint64(0xBF58476D1CE4E5B9)
        h ^= h >> np.uint64(32)
    return (h >> np.uint64(11)).astype(float) / 2.0**53 - 0.5
