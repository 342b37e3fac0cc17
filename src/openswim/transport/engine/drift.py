"""How the clouds of each level have moved between two states: phase correlation, level by level."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_LEAST_COVER = 1e-4  # of a level's nodes that must hold cloud, in both states, to tell a drift
_HOLD = 0.25  # height of the peak of correlation under which a level tells nothing


def drift_of(before: NDArray, after: NDArray, periodic: bool = False) -> F64:
    """Cells (nz, 2) along x and y by which levels (nz, ny, nx) have moved; levels without cloud as those around them.

    The peak of the normalised cross-correlation, to a fraction of a cell by a parabola through its neighbours.
    """
    nz = before.shape[0]
    found, weight = np.zeros((nz, 2)), np.zeros(nz)
    for k in range(nz):
        one, other = before[k].astype(float), after[k].astype(float)
        if min((one > 0).mean(), (other > 0).mean()) < _LEAST_COVER:
            continue
        found[k], height = _shift(one, other, periodic)
        weight[k] = height if height > _HOLD else 0.0
    known = np.flatnonzero(weight > 0)
    if known.size == 0:
        return np.zeros((nz, 2))
    levels = np.arange(nz)
    return np.stack([np.interp(levels, known, found[known, axis]) for axis in (0, 1)], axis=-1)


def _shift(one: F64, other: F64, periodic: bool) -> tuple[F64, float]:
    """Shift along x and y, and the correlation there."""
    shape = one.shape if periodic else tuple(2 * n for n in one.shape)
    one, other = one - one.mean(), other - other.mean()
    norm = float(np.sqrt((one**2).sum() * (other**2).sum()))
    if norm == 0.0:
        return np.zeros(2), 0.0
    both = np.fft.irfft2(np.fft.rfft2(other, shape) * np.conj(np.fft.rfft2(one, shape)), shape) / norm
    j, i = np.unravel_index(int(both.argmax()), both.shape)
    at = []
    for axis, n in ((1, int(i)), (0, int(j))):
        size = shape[axis]
        line = both[int(j)] if axis == 1 else both[:, int(i)]
        left, top, right = line[n - 1], line[n], line[(n + 1) % size]
        bend = left - 2 * top + right
        part = 0.5 * (left - right) / bend if bend < 0 else 0.0
        at.append((n if n <= size // 2 else n - size) + float(np.clip(part, -0.5, 0.5)))
    return np.array(at), float(both[j, i])
