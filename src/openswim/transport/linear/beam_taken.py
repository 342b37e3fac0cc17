"""What cells take of the beam, and so by how much more than the beam at a node lights what is around it.

Along its way v the beam obeys v . grad T = beta T, so that a cell takes, per volume, what enters by its faces and does
not leave: the sum over axes of v_a (mean T of the upper face - of the lower one)/size, T the square of what is bilinear
between its roots at the corners. Over what the corners' products say, per the cell's extinction, that is

    A = (taken - told)/(mean beta + soft),   T_lit = T + mean of A of the cells around,

so that all cells together scatter what the sun loses. It is smooth in beta and T and has no bounds. Fields are (nz, ny,
nx); speed is v over the cells' sizes, three arrays that fit cells.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Corner = tuple[int, ...]

SOFT = 0.01  # depth of a cell below which its corners are trusted
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


def _means(beam: F64, ext: F64) -> tuple[Any, Any]:
    told = sum(_at(ext, c) * _at(beam, c) for c in _CORNERS) / 8
    return told, sum(_at(ext, c) for c in _CORNERS) / 8


def lit(beam: F64, ext: F64, speed: tuple[F64, F64, F64], soft: F64) -> F64:
    """T_lit of a beam and scaled extinction; soft: the extinction that is next to none, by cell."""
    taken, _ = _taken(beam, speed, slopes=False)
    told, mean = _means(beam, ext)
    more = (taken - told) / (mean + soft) / 8
    out = beam.copy()
    for c in _CORNERS:
        _at(out, c)[...] += more
    return out


def lit_tangent(beam: F64, ext: F64, speed: tuple[F64, F64, F64], soft: F64, d_beam: F64, d_ext: F64) -> F64:
    """Change of `lit`."""
    taken, slope = _taken(beam, speed)
    told, mean = _means(beam, ext)
    d_taken = sum(slope[c] * _at(d_beam, c) for c in _CORNERS)
    d_told = sum(_at(d_ext, c) * _at(beam, c) + _at(ext, c) * _at(d_beam, c) for c in _CORNERS) / 8
    d_mean = sum(_at(d_ext, c) for c in _CORNERS) / 8
    more = (d_taken - d_told - (taken - told) / (mean + soft) * d_mean) / (mean + soft) / 8
    out = d_beam.copy()
    for c in _CORNERS:
        _at(out, c)[...] += more
    return out


def lit_transposed(
    beam: F64, ext: F64, speed: tuple[F64, F64, F64], soft: F64, bar: F64
) -> tuple[F64, F64]:  # fmt: skip
    """Bars of the beam and of the extinction."""
    taken, slope = _taken(beam, speed)
    told, mean = _means(beam, ext)
    more_bar = sum(_at(bar, c) for c in _CORNERS) / (mean + soft) / 8
    mean_bar = -(taken - told) / (mean + soft) * more_bar / 8
    beam_bar, ext_bar = bar.copy(), np.zeros_like(bar)
    for c in _CORNERS:
        _at(beam_bar, c)[...] += (slope[c] - _at(ext, c) / 8) * more_bar
        _at(ext_bar, c)[...] += mean_bar - _at(beam, c) * more_bar / 8
    return beam_bar, ext_bar
