"""Pixels that look along the ground: what they cover of a map is much longer than it is wide."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_PLACES = ((4, 2.0), (8, 6.0))  # looked at along footprints that are so many times as long as wide, or longer
LONGEST = 200.0  # times its width, that of a footprint is followed


@dataclass(frozen=True)
class LongFootprints:
    """Half the length of footprints (n,) as a step in latitude and longitude, degrees; their width and length (n,)."""

    lat: FloatArray
    lon: FloatArray
    width_m: FloatArray
    length_m: FloatArray

    def mean(
        self, of: Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]], lat: FloatArray,
        lon: FloatArray, footprint_m: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Values (n, k) and known share (n,) that a map has ``of`` places and round footprints, over these long ones;
        those that are short are ``footprint_m`` wide."""
        ratio = self.length_m / np.maximum(self.width_m, 1e-9)
        ends = [*(least for _, least in _PLACES[1:]), np.inf]
        short = ratio < _PLACES[0][1]
        parts = [(short, *of(lat[short], lon[short], footprint_m[short]))]
        for (count, least), most in zip(_PLACES, ends, strict=True):
            some = (ratio >= least) & (ratio < most)
            # between the places, but little wider than the pixel
            round_m = np.clip(self.length_m[some] / count, self.width_m[some], 2 * self.width_m[some])
            total, share = np.zeros(0), np.zeros(np.count_nonzero(some))
            for t in (2 * np.arange(count) + 1) / count - 1:
                values, known = of(lat[some] + t * self.lat[some], lon[some] + t * self.lon[some], round_m)
                total = total + known[:, None] * values if total.size else known[:, None] * values
                share += known
            parts.append((some, total / np.maximum(share, 1e-9)[:, None], share / count))
        values = np.zeros((lat.size, parts[0][1].shape[1]))
        known = np.zeros(lat.size)
        for some, value, share in parts:
            values[some], known[some] = value, share
        return values, known
