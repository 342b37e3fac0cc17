"""Tiles of the sky, and intervals of scores by weighing tiles anew: neighbouring pixels are no independent pairs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]
Statistic = Callable[[F64], F64]
Bounds = tuple[float, float]
TILE_DEG = 15.0
RESAMPLES = 1000
ALIKE_DEG = 20.0  # tiles so far apart have weights correlated by exp(-1/2)
FEWEST_TILES = 6  # fewer say nothing of an interval
ANY = (-np.inf, np.inf)
NO_PIXEL = "no pixel is left"


@dataclass(frozen=True)
class Interval:
    """A score with its 95 % interval; NaN with the reason where there is none."""

    value: float
    low: float = np.nan
    high: float = np.nan
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Tiles:
    """The tile that each of n directions lies in: `number` (n,) among those that there are, `which` of the sky's these
    are (m,), and their shares of the solid angle (m,).

    Bands of altitude of 15 degrees from nadir to zenith are cut into parts as wide as they are high.
    """

    number: NDArray[np.intp]
    which: NDArray[np.intp]
    share: F64

    @classmethod
    def of(cls, direction: F64, weight: F64 | None = None) -> "Tiles":
        """Of unit vectors (n, 3) east, north, up, and the solid angle (n,) of each."""
        return cls.numbered(tile_of(direction), weight)

    @classmethod
    def numbered(cls, tile: NDArray[np.intp], weight: F64 | None = None) -> "Tiles":
        """Of the sky's tiles (n,) that directions lie in: `tile_of`."""
        count = np.bincount(tile, minlength=len(_likeness()))
        which = np.flatnonzero(count)
        number = (np.cumsum(count > 0) - 1)[tile]
        share = np.bincount(number, weight, len(which)).astype(float)
        return cls(number, which, share / max(share.sum(), 1e-300))

    def sums(self, values: F64) -> F64:
        """(m, k): sums of values (n, k) over each tile."""
        return self.sums_of_sorted(self.sorted(values)).T

    def sorted(self, values: NDArray[np.floating]) -> F64:
        """Values (n,) or (n, k) in the order of the tiles, which is that of memory: (n,) or (k, n)."""
        return np.take(np.asarray(values.T, float), self._order, axis=-1)

    def sums_of_sorted(self, values: F64) -> F64:
        """(m,) or (k, m): sums of sorted values (n,) or (k, n) over each tile; a sixth of the cost of unsorted ones."""
        return np.asarray(np.add.reduceat(values, self._first, axis=-1))

    @cached_property
    def _order(self) -> NDArray[np.intp]:
        return np.argsort(self.number.astype(np.uint16), kind="stable")  # few bits are sorted by counting

    @cached_property
    def _first(self) -> NDArray[np.intp]:
        """(m,): where each tile begins among what is sorted; none is empty."""
        return np.concatenate([[0], np.cumsum(np.bincount(self.number))[:-1]]).astype(np.intp)

    @cached_property
    def _enough(self) -> bool:
        """Whether there are tiles enough for an interval."""
        return len(self.which) >= FEWEST_TILES and bool(np.isfinite(self.widening))

    @cached_property
    def _drawn(self) -> F64:
        """(RESAMPLES, m): random weights of the tiles."""
        return _weights()[:, self.which]

    @cached_property
    def widening(self) -> float:
        """By what the spread of resampled scores falls short of the scores' own, few as independent tiles are: their
        number m* lowers the spread by sqrt(1 - 1/m*), and Student's t with m* - 1 degrees of freedom is the law."""
        from scipy.special import stdtrit

        likeness = _likeness()[np.ix_(self.which, self.which)]
        independent = 1 / float(self.share @ likeness @ self.share)
        if independent < 2:
            return np.inf
        return float(stdtrit(independent - 1, 0.975) / 1.959964 / np.sqrt(1 - 1 / independent))

    def interval(
        self, values: F64, statistic: Statistic, bounds: Bounds = ANY, reason: str = ""
    ) -> Interval:
        """A statistic ((r, k) -> (r,)) of the sums over n directions of values (n, k), with a 95 % interval."""
        return self.intervals(values, lambda sums: statistic(sums)[None], bounds, reason)[0]

    def intervals(
        self, values: F64, statistics: Statistic, bounds: Bounds = ANY, reason: str = ""
    ) -> list[Interval]:
        """Several statistics ((r, k) -> (s, r)) of the same sums.

        A block bootstrap: tiles are weighed at random, neighbours alike (Rubin 1981; Shao 2010), 1000 times; the
        interval's ends are the percentiles' distances from the score, widened. `reason`: why the score may be NaN.
        """
        if not len(values):
            return [Interval(np.nan, reason=NO_PIXEL)]
        return self.intervals_of_sums(self.sums(values), statistics, bounds, reason)

    def intervals_of_sums(
        self, sums: F64, statistics: Statistic, bounds: Bounds | Sequence[Bounds] = ANY,
        reason: str | Sequence[str] = "",
    ) -> list[Interval]:  # fmt: skip
        """The same of sums (m, k) over each tile; bounds and reason: of all, or of each statistic."""
        with np.errstate(invalid="ignore", divide="ignore"):
            whole = statistics(sums.sum(axis=0, keepdims=True))[:, 0]
            drawn = statistics(self._drawn @ sums) if self._enough else np.full((len(whole), 0), np.nan)
        within = np.broadcast_to(bounds, (len(whole), 2))
        reasons = [reason] * len(whole) if isinstance(reason, str) else reason
        rows = zip(whole, *_ends(drawn), within, reasons, strict=True)
        return [self._interval(float(value), ends, int(count), *others) for value, ends, count, *others in rows]

    def _interval(self, value: float, ends: F64, count: int, bounds: F64, reason: str) -> Interval:
        """Of a score and the percentiles of what it is for so many drawings of weights."""
        if not np.isfinite(value):
            return Interval(np.nan, reason=reason or "not defined here")
        if not self._enough:
            return Interval(value, reason="too few tiles of the sky for an interval")
        if count < RESAMPLES / 2:
            return Interval(value, reason="most draws of tiles have no score")
        low, high = value + (ends - value) * self.widening
        return Interval(value, float(max(low, bounds[0])), float(min(high, bounds[1])))


def _ends(drawn: F64) -> tuple[F64, NDArray[np.intp]]:
    """The 2.5th and 97.5th percentiles (s, 2) of the finite ones of drawn scores (s, r), and how many these are."""
    rising = np.sort(np.where(np.isfinite(drawn), drawn, np.nan), axis=-1)  # NaN comes last
    count = np.isfinite(rising).sum(axis=-1)
    if not rising.shape[-1]:
        return np.full((len(drawn), 2), np.nan), count
    place = np.array([0.025, 0.975]) * np.maximum(count - 1, 0)[:, None]
    below = place.astype(np.intp)
    low, high = (np.take_along_axis(rising, at, axis=-1) for at in (below, np.minimum(below + 1, rising.shape[-1] - 1)))
    return np.where(place > below, low + (place - below) * (high - low), low), count


def tile_of(direction: F64) -> NDArray[np.intp]:
    """(n,): the sky's tile that each of unit vectors (n, 3) east, north, up lies in."""
    altitude = np.degrees(np.arcsin(np.clip(direction[:, 2], -1, 1)))
    azimuth = np.degrees(np.arctan2(direction[:, 0], direction[:, 1])) % 360
    _, parts, first = _bands()
    band = np.minimum((altitude + 90) // TILE_DEG, len(parts) - 1).astype(np.intp)
    within = np.minimum((azimuth / 360 * parts[band]).astype(np.intp), parts[band] - 1)
    return np.asarray(first[band] + within)


@cache
def _bands() -> tuple[Any, Any, Any]:
    """Middle altitudes (degrees) of the bands, their numbers of parts, and the number of each one's first tile."""
    count = int(180 / TILE_DEG)
    middle = (np.arange(count) + 0.5) * TILE_DEG - 90
    parts = np.asarray(np.maximum(1, np.round(360 * np.cos(np.radians(middle)) / TILE_DEG)), np.intp)
    return middle, parts, np.concatenate([[0], np.cumsum(parts)[:-1]]).astype(np.intp)


@cache
def _likeness() -> F64:
    """(tiles of the sky, same): how much alike two tiles are weighed."""
    middle, parts, _ = _bands()
    azimuth = np.concatenate([(np.arange(n) + 0.5) / n * 360 for n in parts])
    direction = horizon_vector(azimuth, np.repeat(middle, parts))
    apart = np.degrees(np.arccos(np.clip(direction @ direction.T, -1, 1)))
    return np.asarray(np.exp(-0.5 * (apart / ALIKE_DEG) ** 2))


@cache
def _weights() -> F64:
    """(RESAMPLES, tiles of the sky): random weights, exponentially distributed with a mean of 1, neighbours' alike."""
    from scipy.special import ndtr

    variance, axes = np.linalg.eigh(_likeness())
    normal = np.random.default_rng(0).normal(size=(RESAMPLES, len(variance)))
    return np.asarray(-np.log1p(-ndtr(normal @ (axes * np.sqrt(np.clip(variance, 0, None))).T)))
