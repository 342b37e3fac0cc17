"""Noise that belongs to places of the Earth, for what maps do not know: the same there in every picture.

`transport.noise` is its like for clouds, without a period; this one reads a small tile.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground.noise.kernels import FINER, LUMPS, LUMPY, NODES, RIDGED, SMOOTH, STEP, add_octaves, read
from openswim.scene.grid import EARTH_RADIUS_M

FloatArray = NDArray[np.float64]

_EDGE = 0.2  # softness of the edges of shares


def fractal_noise(
    lat: FloatArray, lon: FloatArray, longest_m: ArrayLike, shortest_m: ArrayLike, octaves: int = 7,
    power: float = 1.0, series: int = 0,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Smooth random numbers (n,) at places in degrees, the same in every picture: what is seen of a sum of normal
    distribution, mean 0 and variance 1, and the variance (n,) of what is not.

    Octaves from ``longest_m`` (n,) down, of variances as their scales to a ``power``; what is shorter than
    ``shortest_m`` (n,) is not seen: it would only flicker. What has nothing to do with each other is of different
    ``series``.
    """
    return _fractal(lat, lon, SMOOTH, longest_m, shortest_m, octaves, power, series)


def fractal_lumps(
    lat: FloatArray, lon: FloatArray, longest_m: ArrayLike, shortest_m: ArrayLike, octaves: int, power: float,
    series: int,
) -> FloatArray:  # fmt: skip
    """As `fractal_noise`, of what is seen of lumps between narrow gaps: -1.3 in the gaps, mean 0, variance 1."""
    return _fractal(lat, lon, LUMPY, longest_m, shortest_m, octaves, power, series)[0]


def fractal_slope(
    lat: FloatArray, lon: FloatArray, along: FloatArray, longest_m: ArrayLike, shortest_m: ArrayLike, octaves: int,
    power: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """As `fractal_noise`, of slopes: rise of sharp ridges between round valleys, ``along`` unit vectors (n, 3) in
    Earth-centred axes."""
    return _fractal(lat, lon, RIDGED, longest_m, shortest_m, octaves, power, along=along)


def _fractal(
    lat: FloatArray, lon: FloatArray, kind: int, longest_m: ArrayLike, shortest_m: ArrayLike, octaves: int,
    power: float, series: int = 0, along: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    longest, shortest = (np.array(np.broadcast_to(np.asarray(v, float), lat.shape)) for v in (longest_m, shortest_m))
    value, unseen = np.zeros(lat.size), np.ones(lat.size)
    if lat.size == 0:
        return value, unseen
    # three coordinates of the sphere: no seam at the date line, none at the poles
    la, lo = np.radians(lat), np.radians(lon)
    place = np.stack([np.cos(la) * np.cos(lo), np.cos(la) * np.sin(lo), np.sin(la)], axis=-1) * EARTH_RADIUS_M
    top = np.log2(np.maximum(longest, 1e-3))
    least = math.floor(top.min()) - octaves
    every = range(least, math.ceil(top.max()) + 1)
    axes = np.array([_turned(octave, series) for octave in every])
    scale = 2.0 ** np.array(every, float)
    ways = np.zeros((1, 3)) if along is None else np.ascontiguousarray(along)
    steep = _slope_deviation() if kind == RIDGED else 1.0
    add_octaves(
        place, ways, top, shortest, axes, scale, scale**power, least, octaves, kind, steep, _tile(), value, unseen
    )
    return value, unseen


def resolved_share(share: FloatArray, favour: FloatArray, unseen: FloatArray) -> FloatArray:
    """Where a share (n,) of a neighbourhood lies: 0 to 1 (n,), mostly either.

    favour (n,): how much likelier it is there than elsewhere, standard normal but for the variance (n,) of what is
    ``unseen`` of it. Phi((sqrt(1 - e^2) favour + probit(share)) / s), s^2 = e^2 + (1 - e^2) unseen, e = .2 for soft
    edges: its mean is the share, whatever is unseen; where nothing is seen it is that. Shares within .02 of none or all
    are even: no lone specks.
    """
    from scipy.special import ndtr, ndtri

    seen = 1.0 - _EDGE**2
    softness = np.sqrt(_EDGE**2 + seen * unseen)
    lies = ndtr((np.sqrt(seen) * favour + ndtri(np.clip(share, 0.0, 1.0))) / softness)
    return np.where(np.minimum(share, 1 - share) < 0.02, share, lies)


@cache
def _turned(octave: int, series: int) -> FloatArray:
    """Axes that no other octave has."""
    rng = np.random.default_rng(1000 + octave + 100 * series)
    return np.asarray(np.linalg.qr(rng.standard_normal((3, 3)))[0])


@cache
def _tile() -> NDArray[np.float32]:
    """Quadratic B-splines over random numbers, periodic, of mean 0 and variance 1 between nodes, too."""
    values = np.random.default_rng(5).standard_normal((LUMPS,) * 3)
    at = np.arange(NODES) / FINER
    first = np.floor(at - 0.5).astype(int)
    t = at - first - 0.5
    weights = (0.5 * (1.0 - t) ** 2, 0.5 + t * (1.0 - t), 0.5 * t * t)
    for axis in range(3):
        shape = tuple(-1 if a == axis else 1 for a in range(3))
        values = sum(w.reshape(shape) * values.take((first + k) % LUMPS, axis) for k, w in enumerate(weights))
    sample = _smooth(np.asarray(values, np.float32), np.random.default_rng(6).uniform(0, LUMPS, (3, 100_000)))
    return np.asarray((values - sample.mean()) / sample.std(), np.float32)


def _smooth(tile: NDArray[np.float32], place: FloatArray) -> FloatArray:
    """The noise (n,) at points (3, n), one lump to the unit."""
    out = np.empty(place.shape[1])
    read(tile, place, out)
    return out


@cache
def _slope_deviation() -> float:
    rng = np.random.default_rng(7)
    place, along = rng.uniform(0, LUMPS, (3, 100_000)), rng.standard_normal((3, 100_000))
    step = STEP * along / np.linalg.norm(along, axis=0)
    return float((np.abs(_smooth(_tile(), place + step)) - np.abs(_smooth(_tile(), place - step))).std())
