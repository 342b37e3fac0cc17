"""Streets and their lamps, which no map of towns shows: invented, the same at every call, with the map's light.

Land is divided into quarters, the cells of scattered middles. A quarter has its lamps or none, the more often the
brighter the map is there; its streets run two ways, and main roads run along its bounds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erf

F64 = NDArray[np.float64]

DEGREE_M = 111_195.0  # of latitude
QUARTER_M = 700.0
_TOWN_NW, _LEAST_LIT = 6.0, 0.02  # radiance from which on all quarters are lit; share of them that is, at least
_APART_M, _MAIN_APART_M = 32.0, 38.0  # lamps along a street, along a main road
_SPOT_M, _MAIN_SPOT_M = 4.5, 6.5  # what a lamp lights, to 1/sqrt(e)
_STREETS_M = (70.0, 130.0), (110.0, 220.0)  # from street to street, one way and the other
_BENT_M, _BEND_M = 18.0, 90.0  # how far streets swing to both sides, over 2 pi times how long
_ASTRAY_M, _BENDS_M = 55.0, (290.0, 330.0)  # the same of bounds
_YARD_M, _YARD_SPOT_M = 24.0, 2.5  # cells of one light at most between streets; what it lights
_OF_STREETS, _OF_ROADS = 0.62, 0.13  # of a quarter's light; the rest comes from its yards
_ROADS_PER_M = 1.92 / QUARTER_M  # length of bounds over area, measured on 1e6 places
_ROADS_MERGE_M = 60.0  # width of spots from which on roads show less and less
_OF_WIDTH = 0.4  # of a pixel's width, by which spots are blurred
_MERGED_M = 0.6 * QUARTER_M  # width of pixels that see little but the mean
WIDEST_M = 4 * _MERGED_M  # from which on they see nothing else
_LEAST_BRIGHT, _MOST_BRIGHT = 0.4, 1.6  # of quarters, over their mean
_SODIUM = 0.9  # from the quarter with least of it to that with most, what differs of its share
_NEXT = 8191  # apart in the numbers of quarters, so that streets and lamps of two quarters have not the same


class _Quarter(NamedTuple):
    """The quarters of places (n,): which, and where from their middles places lie, m to the east and north."""

    i: F64
    j: F64
    east_m: F64
    north_m: F64

    def chance(self, which: int) -> F64:
        return chance(self.i, self.j, which)


def lamps_seen(lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike, radiance_nw: ArrayLike) -> tuple[F64, F64]:
    """What an eye sees of towns' light over its mean (n,), 1 in the mean over many quarters, and the share (n,) of it
    that is sodium's, half in the mean; pixels of `WIDEST_M` see the mean alone."""
    given = (np.asarray(v, float) for v in (lat, lon, footprint_m, radiance_nw))
    lat, lon, width, bright = (each.ravel() for each in np.broadcast_arrays(*given))
    lit = np.clip(bright / _TOWN_NW, _LEAST_LIT, 1.0)
    own, other, away_m = _quarters(*_bent(lat, lon))
    blur_m = _OF_WIDTH * width
    here, beyond = own.chance(0) < lit, other.chance(0) < lit  # the quarters on both sides of a road
    streets, yards = _streets(own, np.hypot(_SPOT_M, blur_m))
    quarter = _OF_STREETS * streets + (1 - _OF_STREETS - _OF_ROADS) * yards
    quarter *= _LEAST_BRIGHT + (_MOST_BRIGHT - _LEAST_BRIGHT) * own.chance(1)
    shown = np.where(here, quarter / lit, 0.0)
    along = _main_road(own, other, away_m, np.hypot(_MAIN_SPOT_M, blur_m))
    shown += _OF_ROADS * np.where(here | beyond, along / (1 - (1 - lit) ** 2), 0.0)
    near = np.exp(-((width / _MERGED_M) ** 2))
    return near * shown + (1 - near), 0.5 + near * _SODIUM * (own.chance(2) - 0.5)


def _bent(lat: F64, lon: F64) -> tuple[F64, F64]:
    """Places (n,) by which bounds are told, so that they are no straight lines; areas are kept."""
    here_m = DEGREE_M * np.maximum(np.cos(np.radians(lat)), 1e-6)
    east, north = _BENDS_M
    lon = lon + _ASTRAY_M * np.sin(lat * DEGREE_M / north) / here_m
    return lat + _ASTRAY_M * np.sin(lon * DEGREE_M / east) / DEGREE_M, lon


def _quarters(lat: F64, lon: F64) -> tuple[_Quarter, _Quarter, F64]:
    """The nearest and the second nearest of the middles, and how far places (n,) are from the line between the two."""
    north = lat * DEGREE_M
    row = np.floor(north / QUARTER_M)
    here_m = DEGREE_M * np.cos(np.radians(lat))
    best = np.full((2, lat.size), np.inf)
    found = np.zeros((2, 4, lat.size))
    for dj in (-1, 0, 1):
        j = row + dj
        degree_m = DEGREE_M * np.maximum(np.cos(np.radians((j + 0.5) * QUARTER_M / DEGREE_M)), 1e-6)
        column = np.floor(lon * degree_m / QUARTER_M)
        for di in (-1, 0, 1):
            i = column + di
            x = (lon - (i + 0.2 + 0.6 * chance(i, j, 3)) * QUARTER_M / degree_m) * here_m
            y = north - (j + 0.2 + 0.6 * chance(i, j, 4)) * QUARTER_M
            square = x * x + y * y
            one = np.stack([i, j, x, y])
            first, second = square < best[0], square < best[1]
            second &= ~first
            best[1] = np.where(first, best[0], np.where(second, square, best[1]))
            found[1] = np.where(first, found[0], np.where(second, one, found[1]))
            best[0] = np.where(first, square, best[0])
            found[0] = np.where(first, one, found[0])
    own, other = (_Quarter(*each) for each in found)
    between = np.hypot(own.east_m - other.east_m, own.north_m - other.north_m)
    return own, other, 0.5 * (best[1] - best[0]) / np.maximum(between, 1.0)


def _streets(own: _Quarter, spot_m: F64) -> tuple[F64, F64]:
    """Light of the lamps of both ways' streets, and of what lies between streets, over their means (n,)."""
    turned = np.pi * own.chance(5)
    c, s = np.cos(turned), np.sin(turned)
    u, v = own.east_m * c + own.north_m * s, own.north_m * c - own.east_m * s
    phase = 2 * np.pi * own.chance(6)
    u, v = u + _BENT_M * np.sin(v / _BEND_M / 2 + phase), v + _BENT_M * np.sin(u / _BEND_M / 2 + phase)
    (least, most), (least_other, most_other) = _STREETS_M
    wide = least + (most - least) * own.chance(7)
    tall = least_other + (most_other - least_other) * own.chance(8)
    one = _row_of_lamps(own, u, v, wide, spot_m, 10)
    two = _row_of_lamps(own, v, u, tall, spot_m, 20)
    yards = _yards(own, u, v, np.hypot(_YARD_SPOT_M, spot_m - _SPOT_M))
    return (one * tall + two * wide) / (wide + tall), yards


def _row_of_lamps(own: _Quarter, across: F64, along: F64, apart_m: F64, spot_m: F64, salt: int) -> F64:
    """Light (n,) of lamps along streets ``apart_m``, each of its own strength, over the mean."""
    street = np.round(across / apart_m)
    shifted = along + _APART_M * chance(own.i * _NEXT + street, own.j, salt)
    lamp = np.round(shifted / _APART_M)
    strength = chance(own.i * _NEXT + street, own.j * _NEXT + lamp, salt + 1)
    single = np.exp(-4 * (spot_m / _APART_M) ** 2)
    light = _spot(across - street * apart_m, apart_m, spot_m) * _spot(shifted - lamp * _APART_M, _APART_M, spot_m)
    return light * (1 + single * 1.6 * (strength - 0.5))


def _yards(own: _Quarter, u: F64, v: F64, spot_m: F64) -> F64:
    """Light (n,) of lamps and windows here and there, few of them bright, over the mean."""
    column, row = np.round(u / _YARD_M), np.round(v / _YARD_M)
    which = own.i * _NEXT + column, own.j * _NEXT + row
    shift = [0.6 * _YARD_M * (chance(*which, n) - 0.5) for n in (30, 31)]
    light = _spot(u - column * _YARD_M, _YARD_M, spot_m, shift[0]) * _spot(v - row * _YARD_M, _YARD_M, spot_m, shift[1])
    return light * (1 + np.exp(-4 * (spot_m / _YARD_M) ** 2) * (5 * chance(*which, 32) ** 4 - 1))


def _main_road(own: _Quarter, other: _Quarter, away_m: F64, spot_m: F64) -> F64:
    """Light (n,) of lamps along the line half-way between two middles, over the mean."""
    x, y = other.east_m - own.east_m, other.north_m - own.north_m
    long = np.maximum(np.hypot(x, y), 1.0)
    # from half-way between the middles along the line, the same seen from either quarter
    sign = np.where((own.i > other.i) | ((own.i == other.i) & (own.j > other.j)), 1.0, -1.0)
    along = sign * (y * (own.east_m + 0.5 * x) - x * (own.north_m + 0.5 * y)) / long
    lamp = np.round(along / _MAIN_APART_M)
    light = _spot(along - lamp * _MAIN_APART_M, _MAIN_APART_M, spot_m)
    across = np.exp(-0.5 * (away_m / spot_m) ** 2) / (np.sqrt(2 * np.pi) * spot_m)
    busy = 3 * chance(own.i + other.i, own.j + other.j, 40) ** 2
    single = np.exp(-((spot_m / _ROADS_MERGE_M) ** 2))  # of other bounds near by nothing is known
    return 1 + single * (busy * light * across / _ROADS_PER_M - 1)


def _spot(away_m: F64, apart_m: F64 | float, spot_m: F64, shift_m: F64 | float = 0.0) -> F64:
    """Brightness (n,) of the nearest of spots in a row, which lies ``shift_m`` from the middle of its part of the row,
    over the mean: that is 1 however wide they are."""
    wide = np.sqrt(2) * spot_m
    inside = 0.5 * (erf((0.5 * apart_m - shift_m) / wide) + erf((0.5 * apart_m + shift_m) / wide))
    return np.asarray(np.exp(-(((away_m - shift_m) / wide) ** 2)) * apart_m / (np.sqrt(np.pi) * wide * inside))


def chance(i: F64, j: F64, which: int) -> F64:
    """Evenly spread numbers of [0, 1), the same at every call (the mixer of SplitMix64)."""
    with np.errstate(over="ignore"):
        z = i.astype(np.int64).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z ^= j.astype(np.int64).astype(np.uint64) * np.uint64(0xC2B2AE3D27D4EB4F)
        z += np.uint64(which + 1) * np.uint64(0x165667B19E3779F9)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return np.asarray((z >> np.uint64(11)).astype(float) / 2.0**53)
