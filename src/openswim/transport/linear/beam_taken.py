"""What cells take of the beam, and so how strong a beam lights what is around a node.

Along its way v the beam obeys v . grad T = beta T, so that a cell takes, per volume, what enters by its faces and does
not leave: the sum over axes of v_a (mean T of the upper face - of the lower one)/size, T the square of what is bilinear
between its roots at the corners. The products beta T of its corners tell x times less of it, and each corner gets

    T' = (1 - g) T + u told/mean beta,   x = taken/told,   g u = e x,   u - g = x - 1,

of which T_lit is the mean over the cells around a node: all cells together scatter what the sun loses. Where they take
more than is told, g is next to none and the rest comes to all corners alike; where they take less, as where the sun
shines on thick cloud, u is next to none, and all corners give up the same share: none is left with less than nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Corner = tuple[int, ...]

SOFT = 0.01  # depth of a cell below which its corners are trusted
_EVEN = 0.003  # e; .01 and .001 serve as well on cuts of RICO
_DARK = 1e-200  # of what is told: next to none
_CORNERS = list(product((0, 1), repeat=3))
_OVERLAP = (1 / 9, 1 / 18, 1 / 36)  # of two corners' bilinear functions on a face, 0, 1 or 2 edges apart


def _at(a: F64, corner: Corner) -> F64:
    return a[tuple(slice(c, n - 1 + c) for c, n in zip(corner, a.shape, strict=True))]


def _taken(beam: F64, speed: tuple[F64, F64, F64], slopes: bool = True) -> tuple[Any, dict[Corner, Any]]:
    """What cells take, and its slope by T at each corner."""
    roots = {c: np.sqrt(_at(beam, c)) for c in _CORNERS}
    taken: Any = 0.0
    slope: dict[Corner, Any] = dict.fromkeys(_CORNERS, 0.0)
    for axis, side in product(range(3), (0, 1)):
        rate = speed[axis] * (1.0 if side else -1.0)
        own = [c for c in _CORNERS if c[axis] == side]
        for c in own:
            mass = sum(_OVERLAP[sum(a != b for a, b in zip(c, d, strict=True))] * roots[d] for d in own)
            taken = taken + rate * mass * roots[c]
            if slopes:  # d(r M r)/dT = M r/r
                slope[c] = slope[c] + rate * mass / np.maximum(roots[c], 1e-150)
    return taken, slope


def _mean(of_corners: Iterable[F64]) -> F64:
    return np.asarray(sum(of_corners) / len(_CORNERS))


class _Shared(NamedTuple):
    """g and u told/mean beta of cells, their slopes by what is taken and told, and that of the latter by the mean."""

    less: F64
    more: F64
    less_by_taken: F64
    less_by_told: F64
    more_by_taken: F64
    more_by_told: F64
    more_by_mean: F64


def _shared(beam: F64, ext: F64, taken: F64, soft: F64) -> _Shared:
    told = _mean((_at(ext, c) + soft) * _at(beam, c) for c in _CORNERS) + _DARK
    taken = taken + soft * _mean(_at(beam, c) for c in _CORNERS)
    mean = _mean(_at(ext, c) for c in _CORNERS) + soft
    x = taken / told
    root = np.sqrt((1.0 - x) ** 2 + 4.0 * _EVEN * x)
    greater = 0.5 * (np.abs(1.0 - x) + root)
    lesser = _EVEN * x / greater  # nothing cancels
    g, u = np.where(x < 1.0, (greater, lesser), (lesser, greater))
    slope = (_EVEN - g) / root  # of g by x; that of u is one more
    return _Shared(
        g, u * told / mean, slope / told, -slope * x / told,
        (1.0 + slope) / mean, (u - x * (1.0 + slope)) / mean, -u * told / mean**2,
    )  # fmt: skip


def lit(beam: F64, ext: F64, speed: tuple[F64, F64, F64], soft: F64) -> F64:
    """T_lit of a beam and scaled extinction; soft: extinction of all cells that takes what is told, 1/m, by cell."""
    one = _shared(beam, ext, _taken(beam, speed, slopes=False)[0], soft)
    out = beam.copy()
    for c in _CORNERS:
        _at(out, c)[...] += (one.more - one.less * _at(beam, c)) / 8
    return out


def lit_tangent(beam: F64, ext: F64, speed: tuple[F64, F64, F64], soft: F64, d_beam: F64, d_ext: F64) -> F64:
    """Change of `lit`."""
    taken, slope = _taken(beam, speed)
    one = _shared(beam, ext, taken, soft)
    d_taken = sum((slope[c] + soft / 8) * _at(d_beam, c) for c in _CORNERS)
    d_told = _mean(_at(d_ext, c) * _at(beam, c) + (_at(ext, c) + soft) * _at(d_beam, c) for c in _CORNERS)
    d_mean = _mean(_at(d_ext, c) for c in _CORNERS)
    d_less = one.less_by_taken * d_taken + one.less_by_told * d_told
    d_more = one.more_by_taken * d_taken + one.more_by_told * d_told + one.more_by_mean * d_mean
    out = d_beam.copy()
    for c in _CORNERS:
        _at(out, c)[...] += (d_more - d_less * _at(beam, c) - one.less * _at(d_beam, c)) / 8
    return out


def lit_transposed(
    beam: F64, ext: F64, speed: tuple[F64, F64, F64], soft: F64, bar: F64
) -> tuple[F64, F64]:  # fmt: skip
    """Bars of the beam and of the extinction."""
    taken, slope = _taken(beam, speed)
    one = _shared(beam, ext, taken, soft)
    more_bar, less_bar = _mean(_at(bar, c) for c in _CORNERS), -_mean(_at(bar, c) * _at(beam, c) for c in _CORNERS)
    taken_bar = one.more_by_taken * more_bar + one.less_by_taken * less_bar
    told_bar = one.more_by_told * more_bar + one.less_by_told * less_bar
    beam_bar, ext_bar = bar.copy(), np.zeros_like(bar)
    for c in _CORNERS:
        by_told = (_at(ext, c) + soft) * told_bar - one.less * _at(bar, c)
        _at(beam_bar, c)[...] += (slope[c] + soft / 8) * taken_bar + by_told / 8
        _at(ext_bar, c)[...] += (_at(beam, c) * told_bar + one.more_by_mean * more_bar) / 8
    return beam_bar, ext_bar
