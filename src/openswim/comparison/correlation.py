"""Correlation and differences of two pictures, from sums over tiles of the sky (Albers et al. 2020, Eq. 37)."""

import numpy as np
from numpy.typing import NDArray

from openswim.comparison.tiles import Interval, Tiles

F64 = NDArray[np.float64]
_FLAT = "a picture has no contrast"


def moments(weight: F64, x: F64, y: F64) -> F64:
    """(n, 6): w, w x, w y, w x^2, w y^2, w x y of pairs (n,)."""
    return np.stack([weight, weight * x, weight * y, weight * x * x, weight * y * y, weight * x * y], axis=-1)


def pearson(sums: F64) -> F64:
    """r of sums (n, 6) of `moments`: Eq. 37, weighted; NaN where a picture has no contrast."""
    w, x, y, xx, yy, xy = sums.T
    spread_x, spread_y = w * xx - x * x, w * yy - y * y
    # what is left of rounding is no contrast
    flat = (spread_x <= 1e-12 * w * xx) | (spread_y <= 1e-12 * w * yy)
    return np.where(flat, np.nan, (w * xy - x * y) / np.sqrt(np.where(flat, np.nan, spread_x * spread_y)))


def correlation(x: F64, y: F64, weight: F64, tiles: Tiles) -> Interval:
    """Mean over channels of r of pairs (n, channels): the paper's mean r; of one channel its r."""
    return correlations_by_channel(x, y, weight, tiles)[-1]


def correlations_by_channel(x: F64, y: F64, weight: F64, tiles: Tiles) -> list[Interval]:
    """r of each channel of pairs (n, channels), and last their mean."""
    channels = x.shape[1]
    if not x.size:
        return [Interval(np.nan, reason="no pixel is left")] * (channels + 1)
    flat = [any(v.std() <= 1e-12 * abs(v).max() for v in pair) for pair in zip(x.T, y.T, strict=True)]
    # about the means, so that nothing is lost to rounding
    x, y = (np.where(flat, 0.0, values - np.average(values, axis=0, weights=weight)) for values in (x, y))
    pairs = np.concatenate([moments(weight, a, b) for a, b in zip(x.T, y.T, strict=True)], axis=-1)

    def each(sums: F64) -> F64:
        found = [pearson(part) for part in np.split(sums, channels, axis=-1)]
        return np.stack([*found, np.mean(found, axis=0)])

    return tiles.intervals(pairs, each, (-1.0, 1.0), _FLAT)


def root_mean_square(x: F64, y: F64, weight: F64, tiles: Tiles) -> Interval:
    """Root of the mean square of x - y, of pairs (n,)."""
    pairs = np.stack([weight, weight * (x - y) ** 2], axis=-1)
    return tiles.interval(pairs, lambda sums: np.sqrt(sums[:, 1] / sums[:, 0]), (0.0, np.inf))


def bias(x: F64, y: F64, weight: F64, tiles: Tiles) -> Interval:
    """Mean of x - y, of pairs (n,)."""
    pairs = np.stack([weight, weight * (x - y)], axis=-1)
    return tiles.interval(pairs, lambda sums: sums[:, 1] / sums[:, 0])
