"""Noise at places, octave by octave, read from a small periodic tile."""

import math

from numba import njit

LUMPS, FINER = 32, 3  # of the random numbers that noise is smooth between; its nodes between two of them
NODES = LUMPS * FINER
STEP = 0.2  # of a lump, to either side, over which its slope is taken
SMOOTH, LUMPY, RIDGED = range(3)
_MEAN = math.sqrt(2 / math.pi)  # and deviation, of |noise|
_DEVIATION = math.sqrt(1 - 2 / math.pi)


@njit(cache=True, nogil=True, error_model="numpy")
def _value(tile, x, y, z):
    """Of a periodic tile between its nodes, of which there are FINER to the unit."""
    i, p, a = _cell(x * FINER)
    j, q, b = _cell(y * FINER)
    k, r, c = _cell(z * FINER)
    low = (tile[i, j, k] * (1 - a) + tile[p, j, k] * a) * (1 - b) + (tile[i, q, k] * (1 - a) + tile[p, q, k] * a) * b
    high = (tile[i, j, r] * (1 - a) + tile[p, j, r] * a) * (1 - b) + (tile[i, q, r] * (1 - a) + tile[p, q, r] * a) * b
    return low * (1 - c) + high * c


@njit(cache=True, nogil=True, error_model="numpy")
def _cell(x):
    """The nodes on both sides of a place in a row of the tile's, and how far it is from the first to the second."""
    x -= NODES * math.floor(x * (1.0 / NODES))
    i = min(int(x), NODES - 1)
    return i, i + 1 if i < NODES - 1 else 0, x - i


@njit(cache=True, nogil=True, error_model="numpy")
def read(tile, place, out):
    """Values (n,) of the tile at points (3, n)."""
    for n in range(out.size):
        out[n] = _value(tile, place[0, n], place[1, n], place[2, n])


@njit(cache=True, nogil=True, error_model="numpy")
def _pattern(kind, tile, x, y, z, dx, dy, dz, steep):
    """Smooth noise; lumps between narrow gaps; or the slope of -|noise| along a direction: each of variance 1."""
    if kind == SMOOTH:
        return _value(tile, x, y, z)
    if kind == LUMPY:
        return (abs(_value(tile, x, y, z)) - _MEAN) / _DEVIATION
    dx, dy, dz = STEP * dx, STEP * dy, STEP * dz
    return (abs(_value(tile, x - dx, y - dy, z - dz)) - abs(_value(tile, x + dx, y + dy, z + dz))) / steep


@njit(cache=True, nogil=True, error_model="numpy")
def _in_axes(axes, v):
    return (
        axes[0, 0] * v[0] + axes[0, 1] * v[1] + axes[0, 2] * v[2],
        axes[1, 0] * v[0] + axes[1, 1] * v[1] + axes[1, 2] * v[2],
        axes[2, 0] * v[0] + axes[2, 1] * v[1] + axes[2, 2] * v[2],
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def add_octaves(
    place, along, top, shortest, axes, scales, variances, least, octaves, kind, steep, tile, value, unseen
):  # fmt: skip
    """Noise (n,), and the variance of what is not seen of it, at points (n, 3) [m] whose longest waves are 2^top (n,)
    m, by axes (no, 3, 3), scales [m] and variances (no,) of the octaves from ``least`` on."""
    for n in range(place.shape[0]):
        total, seen_variance, found = 0.0, 0.0, 0.0
        for octave in range(math.floor(top[n]) - octaves, math.ceil(top[n]) + 1):
            within = min(max(top[n] + 1.0 - octave, 0.0), 1.0) * min(max(octave - top[n] + octaves, 0.0), 1.0)
            scale = scales[octave - least]
            per_m = 1.0 / scale
            variance = within * within * variances[octave - least]
            total += variance
            seen = min(max(2.0 - 2.0 * shortest[n] / scale, 0.0), 1.0)
            if within * seen == 0.0:
                continue
            weight = math.sqrt(variance) * seen
            x, y, z = _in_axes(axes[octave - least], place[n])
            dx, dy, dz = _in_axes(axes[octave - least], along[n % along.shape[0]])
            found += weight * _pattern(kind, tile, x * per_m, y * per_m, z * per_m, dx, dy, dz, steep)
            seen_variance += weight * weight
        total = max(total, 1e-30)
        value[n], unseen[n] = found / math.sqrt(total), 1.0 - seen_variance / total
