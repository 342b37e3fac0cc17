"""Correlation and differences of two pictures, from sums over tiles of the sky (Albers et al. 2020, Eq. 37)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.comparison.tiles import NO_PIXEL, Interval, Tiles

F64 = NDArray[np.float64]
_FLAT = "a picture has no contrast"


@dataclass(frozen=True, eq=False)
class Truth:
    """A picture that others are correlated with, and what all of them share: for each channel its light less the mean
    (n,), and sums (m,) over the tiles of w, w y and w y^2; `level`: w times the mean squared."""

    weight: F64
    tiles: Tiles
    light: tuple[F64, ...]
    sums: tuple[tuple[F64, F64, F64], ...]
    level: tuple[float, ...]

    @classmethod
    def of(cls, y: F64, weight: F64, tiles: Tiles) -> "Truth":
        """Of light (n, channels), weights (n,) and the tiles of these pixels."""
        if not weight.size:
            return cls(weight, tiles, tuple(y.T), (), ())
        whole = tiles.sum(weight)
        light, sums, level = [], [], []
        for part in y.T:
            centred, mean = _centred(part, weight)
            light.append(centred)
            weighted = weight * centred
            sums.append((whole, tiles.sum(weighted), tiles.sum(weighted * centred)))
            level.append(float(whole.sum() * mean**2))
        return cls(weight, tiles, tuple(light), tuple(sums), tuple(level))

    def correlations(self, x: F64) -> list[Interval]:
        """r of each channel of another picture (n, channels) with this one, and last their mean."""
        channels = len(self.light)
        if not self.weight.size:
            return [Interval(np.nan, reason=NO_PIXEL)] * (channels + 1)
        parts = []
        for part, y, (w, wy, wyy), level in zip(x.T, self.light, self.sums, self.level, strict=True):
            centred, mean = _centred(part, self.weight)
            weighted = self.weight * centred
            wx, wxx, wxy = (self.tiles.sum(each) for each in (weighted, weighted * centred, weighted * y))
            if wxx.sum() <= 1e-24 * w.sum() * mean**2 or wyy.sum() <= 1e-24 * level:  # what is left of rounding
                wx, wxx, wxy, wy, wyy = (np.zeros_like(w),) * 5
            parts.append(np.stack([w, wx, wy, wxx, wyy, wxy], axis=-1))

        def each(sums: F64) -> F64:
            found = [pearson(part) for part in np.split(sums, channels, axis=-1)]
            return np.stack([*found, np.mean(found, axis=0)])

        return self.tiles.intervals_of_sums(np.concatenate(parts, axis=-1), each, (-1.0, 1.0), _FLAT)


def _centred(light: F64, weight: F64) -> tuple[F64, float]:
    """Light (n,) about its mean, so that nothing is lost to rounding, and the mean."""
    light = np.ascontiguousarray(light)
    mean = float((weight * light).sum() / weight.sum())  # the bits of @ depend on threads
    return light - mean, mean


def pearson(sums: F64) -> F64:
    """r of sums (n, 6) of w, w x, w y, w x^2, w y^2, w x y: Eq. 37, weighted; NaN where a picture has no contrast."""
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
    return Truth.of(y, weight, tiles).correlations(x)


def root_mean_square(x: F64, y: F64, weight: F64, tiles: Tiles) -> Interval:
    """Root of the mean square of x - y, of pairs (n,)."""
    pairs = np.stack([weight, weight * (x - y) ** 2], axis=-1)
    return tiles.interval(pairs, lambda sums: np.sqrt(sums[:, 1] / sums[:, 0]), (0.0, np.inf))


def bias(x: F64, y: F64, weight: F64, tiles: Tiles) -> Interval:
    """Mean of x - y, of pairs (n,)."""
    pairs = np.stack([weight, weight * (x - y)], axis=-1)
    return tiles.interval(pairs, lambda sums: sums[:, 1] / sums[:, 0])
