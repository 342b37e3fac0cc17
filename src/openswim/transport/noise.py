"""Random fields that belong to places on the Earth: the same there whatever grid, cut or view asks for them."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

# What is left of the variance of a uniform number, 1/12, by quadratic B-splines (mean of the sum of squares .55) in 3-D
_SCALE = np.sqrt(12.0 / 0.55**3)
_SLICES = 64
_STIRRED, _CUMULUS_M, _MESOSCALE_M = 0.6, 4000.0, 32_000.0


@njit(cache=True, error_model="numpy")
def _uniform(i, j, k, salt):
    """A number within -.5 to .5 for a node of the lattice."""
    h = (i * 73856093) ^ (j * 19349663) ^ (k * 83492791) ^ (salt * 2654435761)
    h &= 0xFFFFFFFF
    for _ in range(2):
        h = ((h ^ (h >> 16)) * 0x45D9F3B) & 0xFFFFFFFF
    h ^= h >> 16
    return (h & 0xFFFFFF) / 16777216.0 - 0.5


@njit(cache=True, error_model="numpy")
def _lattice(place, salt, out):
    """Quadratic B-splines over numbers on the integer lattice; place (n, 3), out (n,)."""
    w = np.empty((3, 3))
    first = np.empty(3, np.int64)
    for n in range(place.shape[0]):
        for axis in range(3):
            first[axis] = int(np.floor(place[n, axis] - 0.5))
            t = place[n, axis] - first[axis] - 0.5
            w[axis, 0] = 0.5 * (1.0 - t) ** 2
            w[axis, 1] = 0.5 + t * (1.0 - t)
            w[axis, 2] = 0.5 * t * t
        total = 0.0
        for a in range(3):
            for b in range(3):
                for c in range(3):
                    weight = w[0, a] * w[1, b] * w[2, c]
                    total += weight * _uniform(first[0] + a, first[1] + b, first[2] + c, salt)
        out[n] = total


def _stirred(place: F64, octave: int, spacing_m: float) -> F64:
    """Places (n, 3) in spacings, moved by a smooth field of lumps twice as wide: what is mesoscale has been drawn out
    by the flow, small cumulus has not."""
    share = _STIRRED * np.clip(np.log2(spacing_m / _CUMULUS_M) / np.log2(_MESOSCALE_M / _CUMULUS_M), 0, 1)
    if share == 0:
        return place
    moved = place.copy()
    out = np.empty(len(place))
    for axis in range(3):
        _lattice(np.ascontiguousarray(0.5 * place), (octave + 200) * _SLICES + axis, out)
        moved[:, axis] += share * _SCALE * out
    return moved


class Octave:
    """A smooth field of zero mean and unit variance over places (n, 3) in Earth-fixed metres and heights.

    Its lumps are two to six `spacing_m` wide, wide ones drawn out to wisps. Over a height of `tall_m` it forgets.
    """

    def __init__(self, place_m: F64, spacing_m: float, tall_m: float) -> None:
        self._octave = round(np.log2(spacing_m))
        turn = np.linalg.qr(np.random.default_rng(self._octave + 100).standard_normal((3, 3)))[0]
        self._place = _stirred(np.ascontiguousarray(place_m @ turn / spacing_m), self._octave, spacing_m)
        self._tall_m = tall_m
        self._known: dict[int, F32] = {}

    def _slice(self, k: int) -> F32:
        if k not in self._known:
            out = np.empty(len(self._place))
            _lattice(self._place, (self._octave + 100) * _SLICES + k % _SLICES, out)
            self._known = {n: field for n, field in self._known.items() if n == k - 1} | {
                k: (out * _SCALE).astype(np.float32)
            }
        return self._known[k]

    def at(self, height_m: float) -> F32:
        """The field (n,) at a height; ask upward, or slices are made again."""
        k, part = divmod(height_m / self._tall_m + 8.0, 1.0)
        low = self._slice(int(k))
        angle = 0.5 * np.pi * part  # keeps the variance between slices that know nothing of each other
        return np.asarray(np.cos(angle) * low + np.sin(angle) * self._slice(int(k) + 1), np.float32)
