"""Correlation and differences of two pictures, from sums over tiles of the sky (Albers et al. 2020, Eq. 37)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.comparison.tiles import NO_PIXEL, Interval, Tiles

F64 = NDArray[np.float64]
_NO_CONTRAST = "a picture has no contrast"
_NO_RESPONSE = "too few pixels are left to find the response"


@dataclass(frozen=True, eq=False)
class Truth:
    """A picture that others are correlated with, and what all of them share, in the order of the tiles: the weights
    (n,), for each channel its light less the mean (channels, n), and sums over the tiles (m,) of w and (channels, m) of
    w y and w y^2; `flat` (channels,): what has no contrast."""

    tiles: Tiles
    weight: F64
    light: F64
    w: F64
    wy: F64
    wyy: F64
    flat: NDArray[np.bool_]

    @classmethod
    def of(cls, y: F64, weight: F64, tiles: Tiles) -> "Truth":
        """Of light (n, channels), weights (n,) and the tiles of these pixels."""
        channels = y.shape[1]
        if not weight.size:
            none = np.empty((channels, 0))
            return cls(tiles, weight, none, np.empty(0), none, none, np.ones(channels, bool))
        weight = tiles.sorted(weight)
        light, mean = _centred(tiles.sorted(y), weight)
        weighted = weight * light
        w, wy, wyy = (tiles.sums_of_sorted(each) for each in (weight, weighted, weighted * light))
        return cls(tiles, weight, light, w, wy, wyy, _flat(wyy, w, mean))

    def correlations(self, x: F64) -> list[Interval]:
        """r of each channel of another picture (n, channels; NaN: of no known response) with this one, and last their
        mean."""
        channels = len(self.light)
        if not self.weight.size:
            return [Interval(np.nan, reason=NO_PIXEL)] * (channels + 1)
        light, mean = _centred(self.tiles.sorted(x), self.weight)
        weighted = self.weight * light
        products = (weighted, weighted * light, weighted * self.light)
        wx, wxx, wxy = (self.tiles.sums_of_sorted(each) for each in products)
        flat = (self.flat | _flat(wxx, self.w, mean))[:, None]
        wx, wxx, wxy, wy, wyy = (np.where(flat, 0.0, each) for each in (wx, wxx, wxy, self.wy, self.wyy))
        parts = np.stack([np.broadcast_to(self.w, wx.shape), wx, wy, wxx, wyy, wxy], axis=-1)

        def each(sums: F64) -> F64:
            found = [pearson(part) for part in np.split(sums, channels, axis=-1)]
            return np.stack([*found, np.mean(found, axis=0)])

        unknown = np.isnan(mean)
        reasons = [_NO_RESPONSE if nothing else _NO_CONTRAST for nothing in (*unknown, unknown.any())]
        return self.tiles.intervals_of_sums(np.concatenate(parts, axis=-1), each, (-1.0, 1.0), reasons)


def _centred(light: F64, weight: F64) -> tuple[F64, F64]:
    """Light (channels, n) about its means, so that nothing is lost to rounding, and the means (channels,)."""
    mean = (weight * light).sum(axis=-1) / weight.sum()  # the bits of @ depend on threads
    return light - mean[:, None], mean


def _flat(squares: F64, weight: F64, mean: F64) -> NDArray[np.bool_]:
    """(channels,): of sums (channels, m) of w y^2 about the mean, whether they are but what is left of rounding."""
    return np.asarray(squares.sum(axis=-1) <= 1e-24 * weight.sum() * mean**2)


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
