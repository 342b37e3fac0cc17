"""Random fields that belong to places on the Earth: the same there whatever grid, cut or view asks for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import kernel
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

# What is left of the variance of a uniform number, 1/12, by quadratic B-splines (mean of the sum of squares .55) in 3-D
_SCALE = np.sqrt(12.0 / 0.55**3)
_SLICES = 64
_CUMULUS_M, _MESOSCALE_M = 4000.0, 32_000.0
# Eddies that stir an octave: widths in its spacings, and how far they carry it, in steps, in their widths
_EDDIES, _CARRIED, _STEPS = (4.0, 8.0), 0.07, 2


@kernel()
def _uniform(i, j, k, salt):
    """A number within -.5 to .5 for a node of the lattice."""
    h = (i * 73856093) ^ (j * 19349663) ^ (k * 83492791) ^ (salt * 2654435761)
    h &= 0xFFFFFFFF
    for _ in range(2):
        h = ((h ^ (h >> 16)) * 0x45D9F3B) & 0xFFFFFFFF
    h ^= h >> 16
    return (h & 0xFFFFFF) / 16777216.0 - 0.5


@kernel()
def _splines(x, weight, slope):
    """Quadratic B-splines (3,) of the lattice around ``x``, and their slopes; returns the first of its nodes."""
    first = int(np.floor(x - 0.5))
    t = x - first - 0.5
    weight[0], weight[1], weight[2] = 0.5 * (1.0 - t) ** 2, 0.5 + t * (1.0 - t), 0.5 * t * t
    slope[0], slope[1], slope[2] = t - 1.0, 1.0 - 2.0 * t, t
    return first


@kernel()
def _lattice(t, threads, place, salt, out):
    """B-splines over numbers on the integer lattice, thread t's share; place (n, 3), out (n,)."""
    w, unused = np.empty((3, 3)), np.empty(3)
    count = place.shape[0]
    for n in range(t * count // threads, (t + 1) * count // threads):
        i, j, k = (
            _splines(place[n, 0], w[0], unused), _splines(place[n, 1], w[1], unused),
            _splines(place[n, 2], w[2], unused),
        )  # fmt: skip
        total = 0.0
        for a in range(3):
            for b in range(3):
                for c in range(3):
                    total += w[0, a] * w[1, b] * w[2, c] * _uniform(i + a, j + b, k + c, salt)
        out[n] = total


@kernel()
def _carry(t, threads, place, turns, widths, salts, way, out):
    """Places (n, 3) carried along the ground by eddies, whose stream functions are such lattices, by so much ``way``
    in their widths; each has axes of its own, ``turns`` (eddies, 3, 3)."""
    w, d = np.empty((3, 3)), np.empty((3, 3))
    at, first, slope = np.empty(3), np.empty(3, np.int64), np.empty(3)
    count = place.shape[0]
    for n in range(t * count // threads, (t + 1) * count // threads):
        x, y, z = place[n, 0], place[n, 1], place[n, 2]
        for e in range(widths.shape[0]):
            for axis in range(3):
                at[axis] = (x * turns[e, 0, axis] + y * turns[e, 1, axis] + z * turns[e, 2, axis]) / widths[e]
                first[axis] = _splines(at[axis], w[axis], d[axis])
            slope[:] = 0.0
            for a in range(3):
                for b in range(3):
                    for c in range(3):
                        u = _uniform(first[0] + a, first[1] + b, first[2] + c, salts[e])
                        slope[0] += d[0, a] * w[1, b] * w[2, c] * u
                        slope[1] += w[0, a] * d[1, b] * w[2, c] * u
                        slope[2] += w[0, a] * w[1, b] * d[2, c] * u
            gx = turns[e, 0, 0] * slope[0] + turns[e, 0, 1] * slope[1] + turns[e, 0, 2] * slope[2]
            gy = turns[e, 1, 0] * slope[0] + turns[e, 1, 1] * slope[1] + turns[e, 1, 2] * slope[2]
            gz = turns[e, 2, 0] * slope[0] + turns[e, 2, 1] * slope[1] + turns[e, 2, 2] * slope[2]
            far = way * widths[e] / np.sqrt(x * x + y * y + z * z)
            x, y, z = x + far * (y * gz - z * gy), y + far * (z * gx - x * gz), z + far * (x * gy - y * gx)
        out[n, 0], out[n, 1], out[n, 2] = x, y, z


def _axes(number: int) -> F64:
    """Axes that no other number has."""
    return np.asarray(np.linalg.qr(np.random.default_rng(number).standard_normal((3, 3)))[0])


def _stirred(place_m: F64, spacing_m: float) -> F64:
    """Places (n, 3) where a flow has taken them from: what is mesoscale has been drawn out by eddies wider than itself,
    small cumulus has not. They turn without crowding, along the ground."""
    share = float(np.clip(np.log2(spacing_m / _CUMULUS_M) / np.log2(_MESOSCALE_M / _CUMULUS_M), 0, 1))
    if share == 0:
        return place_m
    widths = spacing_m * np.array(_EDDIES)
    numbers = np.round(np.log2(widths)).astype(int)
    turns = np.array([_axes(n + 200) for n in numbers])
    out = place_m
    for _ in range(_STEPS):
        place, out = out, np.empty_like(place_m)
        in_threads(
            _carry, place, turns, widths, (numbers + 200) * _SLICES, share * _SCALE * _CARRIED / _STEPS, out
        )
    return out


class Octave:
    """A smooth field of zero mean and unit variance over places (n, 3) in Earth-fixed metres and heights.

    Its lumps are two to six `spacing_m` wide, wide ones drawn out to wisps. Over a height of `tall_m` it forgets.
    """

    def __init__(self, place_m: F64, spacing_m: float, tall_m: float) -> None:
        self._octave = round(np.log2(spacing_m))
        stirred = _stirred(np.ascontiguousarray(place_m, float), spacing_m)
        self._place = np.ascontiguousarray(stirred @ _axes(self._octave + 100) / spacing_m)
        self._tall_m = tall_m
        self._known: dict[int, F32] = {}

    def _slice(self, k: int) -> F32:
        if k not in self._known:
            out = np.empty(len(self._place))
            in_threads(_lattice, self._place, (self._octave + 100) * _SLICES + k % _SLICES, out)
            self._known = {n: field for n, field in self._known.items() if n == k - 1} | {
                k: (out * _SCALE).astype(FLOAT)
            }
        return self._known[k]

    def at(self, height_m: float) -> F32:
        """The field (n,) at a height; ask upward, or slices are made again."""
        k, part = divmod(height_m / self._tall_m + 8.0, 1.0)
        low = self._slice(int(k))
        angle = 0.5 * np.pi * part  # keeps the variance between slices that know nothing of each other
        return np.asarray(np.cos(angle) * low + np.sin(angle) * self._slice(int(k) + 1), FLOAT)
