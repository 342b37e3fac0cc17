"""Correlation and differences of two pictures, from sums over tiles of the sky (Albers et al. 2020, Eq. 37)."""

import numpy as np
from numpy.typing import NDArray

from openswim.comparison.tiles import Interval, Tiles

F64 = NDArray[np.float64]
_FLAT = "a picture has no contrast"


def moments(weight: F64, x: F64, y: F64) -> list[F64]:
    """w, w x, w y, w x^2, w y^2, w x y of pairs (n, channels), of weights (n, 1)."""
    wx, wy = weight * x, weight * y
    return [np.broadcast_to(weight, x.shape), wx, wy, wx * x, wy * y, wx * y]


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
    share = weight / weight.sum()
    means = share @ x, share @ y
    # about the means, so that nothing is lost to rounding
    pairs = moments(weight[:, None], x - means[0], y - means[1])
    sums = np.stack([tiles.sums(part) for part in pairs], axis=-1)
    for mean, squares in zip(means, (3, 4), strict=True):
        sums[:, sums[..., squares].sum(axis=0) <= 1e-24 * weight.sum() * mean**2, 1:] = 0.0  # what is left of rounding

    def each(sums: F64) -> F64:
        found = [pearson(part) for part in np.split(sums, channels, axis=-1)]
        return np.stack([*found, np.mean(found, axis=0)])

    return tiles.intervals_of_sums(sums.reshape(len(sums), -1), each, (-1.0, 1.0), _FLAT)


def root_mean_square(x: F64, y: F64, weight: F64, tiles: Tiles) -> Interval:
    """Root of the mean square of x - y, of pairs (n,)."""
    pairs = np.stack([weight, weight * (x - y) ** 2], axis=-1)
    return tiles.interval(pairs, lambda sums: np.sqrt(sums[:, 1] / sums[:, 0]), (0.0, np.inf))


def bias(x: F64, y: F64, weight: F64, tiles: Tiles) -> Interval:
    """Mean of x - y, of pairs (n,)."""
    pairs = np.stack([weight, weight * (x - y)], axis=-1)
    return tiles.interval(pairs, lambda sums: sums[:, 1] / sums[:, 0])
