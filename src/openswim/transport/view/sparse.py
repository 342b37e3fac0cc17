"""Fewer rays for a picture: those between neighbours whose light goes on straight are not marched.

Rays of every so-manieth row and column are marched first. Along a row or column of these, light and transmission of
three neighbours tell how much they bend: the middle one less the mean of the others. Where they bend by less than a
share of the light (``alike``) at all four corners of a block of pixels, what is between is told by the corners, to
within a quarter of that where it is smooth; else the block is halved, and in the end all its rays are marched. Rays
that end on the ground go different ways to it: of these the light, and the depth, per metre is told, and each keeps its
own ground.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from openswim.transport.march.march import DARK
from openswim.transport.march.volume import FAR_M
from openswim.transport.view.seen import Seen

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]
March = Callable[[F64, F64, F64 | None, F64 | None], Seen]  # `AimedGrid.march`

BLOCKS = (4, 2)  # pixels along a side
_WHITE = 4.0  # radiance L' of the brightest ground: Eq. 2 of Albers et al. (2020)
_BRIGHTER = 100.0  # times as bright as the brightest of the light along rays the ground may be, whose sun may be down
_LONGER = 1.5  # times as far as the nearest ground of a block the farthest may be
_DEEPEST, _NEAREST_M = 80.0, 1e-3


def march(
    every: March, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None, image: Numbers, alike: float,
    beside: F64 | float = 0.0,
) -> Seen:  # fmt: skip
    """What rays (n, 3) see; ``image`` (ny, nx): which of them is a pixel's, -1 where there is none. ``beside`` (n,):
    light of other sources that counts with their own where that is compared."""
    n = len(direction)

    def marched(some: Numbers) -> Seen:
        own = None if ends is None else ends[some]
        return every(origin[some], direction[some], own, None if cone is None else cone[some])

    first = image[:: BLOCKS[0], :: BLOCKS[0]]
    seen = marched(first[first >= 0])
    out, samples, known = Seen.nothing(n, seen.depth.shape[1]), seen.samples, np.zeros(n, bool)
    _put(out, known, first[first >= 0], seen)
    for side, half in pairwise((*BLOCKS, 1)):
        _tell(out, known, ends, image, side, alike, np.broadcast_to(beside, n))
        nodes = image[::half, ::half]
        new = nodes[(nodes >= 0) & ~known[nodes]] if half > 1 else np.flatnonzero(~known)
        if new.size:
            seen = marched(new)
            samples += seen.samples
            _put(out, known, new, seen)
    return out._replace(samples=samples)


def _put(out: Seen, known: Mask, where: Numbers, seen: Seen) -> None:
    for name in ("radiance", "through", "full", "depth", "distance", "level"):
        getattr(out, name)[where] = getattr(seen, name)
    known[where] = True


def _tell(
    out: Seen, known: Mask, ends: F64 | None, image: Numbers, side: int, alike: float, beside: F64
) -> None:  # fmt: skip
    """Fill in the rays within the blocks of a side that their corners tell, of those to the ground per metre."""
    nodes = image[::side, ::side]
    distance = out.distance[nodes]
    kind = np.where(nodes >= 0, 2 * out.level[nodes] + (distance >= 0), -1)
    way = np.where(distance >= 0, np.maximum(distance, _NEAREST_M), 1.0).astype(np.float32)[..., None]
    parts = {"radiance": out.radiance[nodes] / way, "through": _depth(out.through[nodes]) / way,
             "full": _depth(out.full[nodes]) / way, "depth": out.depth[nodes] / way}  # fmt: skip
    whole = out.radiance[nodes] + beside[nodes].astype(np.float32)[..., None]
    told = _goes_on(whole, out.through[nodes], parts["radiance"], parts["through"], way, kind, alike)
    told &= np.logical_and.reduce(_within(image >= 0, side)) & _same_ends(out, ends, image, nodes, side)
    rows, columns = np.nonzero(told)
    for j, i in product(range(side), range(side)):
        number = image[side * rows + j, side * columns + i]
        new = np.flatnonzero(~known[number])
        number = number[new]
        shares = product((1 - j / side, j / side), (1 - i / side, i / side))
        places = ((rows[new] + down, columns[new] + right) for down, right in product((0, 1), (0, 1)))
        corners = [(np.float32(a * b), place) for (a, b), place in zip(shares, places, strict=True) if a * b > 0]
        first = kind[rows[new], columns[new]]
        out.level[number] = first // 2
        far = np.ones(number.size)
        if ends is not None:
            hit = first % 2 == 1
            far[hit] = out.distance[number[hit]] = ends[number[hit]]
        for name, of in parts.items():
            value = far.astype(np.float32)[:, None] * sum(share * of[place] for share, place in corners)
            getattr(out, name)[number] = np.exp(-value) if name in ("through", "full") else value
    for j, i in product(range(side), range(side)):
        known[image[side * rows + j, side * columns + i]] = True


def _depth(transmission: F32) -> F32:
    return -np.log(np.maximum(transmission, np.float32(np.exp(-_DEEPEST))))


def _goes_on(
    light: F32, through: F32, light_per_m: F32, depth_per_m: F32, way_m: F32, kind: NDArray[np.int8], alike: float
) -> Mask:
    """Whether what the corners of blocks have seen goes on straight along their sides."""
    mean = _over_corners(np.add, light) / 4
    white = min(_WHITE, _BRIGHTER * float((light_per_m * way_m).max(initial=0.0)))
    least = np.maximum(_over_corners(np.add, through) / 4, mean / max(white, 1e-30))
    good = np.logical_and.reduce([kind[:-1, :-1] == part for part in (kind[1:, :-1], kind[:-1, 1:], kind[1:, 1:])])
    good &= kind[:-1, :-1] >= 0
    for axis in (0, 1):
        off = _bend(light_per_m, kind, axis) * way_m, _bend(depth_per_m, kind, axis) * way_m * through
        for bend, most in zip(off, (mean, least), strict=True):
            good &= (_worst_along(bend, axis) <= alike * most).all(axis=-1)
    return good


def _over_corners(how: np.ufunc, values: NDArray) -> NDArray:
    return how(how(values[:-1, :-1], values[1:, :-1]), how(values[:-1, 1:], values[1:, 1:]))


def _bend(values: F32, kind: NDArray[np.int8], axis: int) -> F32:
    """By how much values are off the mean of their neighbours along an axis; NaN where these are of another kind."""
    v, k = np.swapaxes(values, 0, axis), np.swapaxes(kind, 0, axis)
    out = np.full(v.shape, np.nan, np.float32)
    out[1:-1] = np.abs(v[1:-1] - (v[:-2] + v[2:]) / 2)
    out[1:-1][(k[:-2] != k[1:-1]) | (k[2:] != k[1:-1])] = np.nan
    return np.swapaxes(out, 0, axis)


def _worst_along(bend: F32, axis: int) -> F32:
    """The most at the corners of blocks of those that are known at the two ends of each side along an axis; NaN where
    a side has none."""
    b = np.swapaxes(bend, 0, axis)
    side = np.fmax(b[:-1], b[1:])
    return np.swapaxes(np.maximum(side[:, :-1], side[:, 1:]), 0, axis)


def _within(values: NDArray, side: int) -> list[NDArray]:
    """Of every block the pixel at each place in it, those at its far sides too."""
    rows, columns = ((n - 1) // side * side for n in values.shape)
    return [values[j:, i:][:rows:side, :columns:side] for j, i in product(range(side + 1), repeat=2)]


def _same_ends(out: Seen, ends: F64 | None, image: Numbers, nodes: Numbers, side: int) -> Mask:
    """Whether all rays of blocks end on ground about as far, or none does; in the dark no ground is met. Where nobody
    knows where those between end (``ends`` None), none may."""
    none = _over_corners(np.maximum, out.distance[nodes]) < 0
    if ends is None:
        return none
    far = np.abs(ends[image])
    nearest, farthest = (least_or_most.reduce(_within(far, side)) for least_or_most in (np.minimum, np.maximum))
    distance, own = out.distance[nodes], far[::side, ::side]
    dark = _over_corners(np.maximum, out.through[nodes].max(axis=-1)) < DARK
    met = _over_corners(np.logical_and, (distance >= 0) & (np.abs(distance - own) <= 1e-3 * own))
    return np.where(none, (nearest >= FAR_M) | dark, met & (farthest <= _LONGER * nearest))
