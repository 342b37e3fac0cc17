"""Detail: what clouds of liquid water are like below a grid, for eyes that come near (docs/decisions/0017).

A node holds a mean. Where a fractal noise exceeds the quantile that the mean asks for, there is cloud, elsewhere clear
air. What rays are too wide to see of the noise blurs the edge between the two: as normal distributions add up, the mean
stays what it is at any distance, and far away nothing is left to change.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import (
    PACK,
    choose_above,
    flat,
    floored,
    high,
    lane,
    low,
    put,
    read,
    read_double,
    read_double_bytes,
    spread,
    sum_of,
    whole_lane,
    write,
)
from openswim.transport.engine.scalar import transmission
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ZERO, _ONE = FLOAT(0.0), FLOAT(1.0)

# The noise: nodes of its period, a power of two; domes in it, each way; its integers per standard deviation
TILE, _DOMES, _STEPS = 64, 11, 32
_OCTAVES, _RATIO, _SHORTEST_M = 5, 2.17, 5.0
_LONGEST_M = 2000.0  # cells of shallow convection are no larger, however wide those of the grid
_PER_CELL = 1.4  # wavelength of the first octave: a grid tells what is two cells long, vaguely
_EDGE = 0.2  # standard deviation of the octaves that are left out
# Extinction within cloud over the greatest mean around, less one, so that no cloud is quite even; the less, the longer
# waves are: holes as wide as a deck is thick would go through it
_SURPLUS, _SURPLUS_M = 0.1, 500.0
_THINNING = 0.7  # power of mean over greatest extinction that is the share of cloud: thin edges are wide, and thin
_QUANTILES = 256
_SHADING = FLOAT(0.9)  # greatest change of the beam by the slope of thick lumps toward the sun
OCTAVES, _SIDE = 2 * PACK, TILE + 1
# Scratch: the octaves' weights; extinction, forward peaks and source where a detailed step ended, whether the next
# begins there, and `Detail.in_cloud` there; of every octave, where in the tile a step begins and how far it goes
HERE, FRESH, DENSE, PLACES = OCTAVES, OCTAVES + 3 * PACK, OCTAVES + 3 * PACK + 1, OCTAVES + 4 * PACK
SCRATCH = PLACES + 2 * OCTAVES * PACK


class Detail(NamedTuple):
    """How clouds are refined below a grid; without octaves not at all."""

    # (TILE + 1, TILE + 1, TILE + 1, PACK), the last nodes as the first: noise N(0, 1), slopes along the axes, as large
    tile: NDArray[np.int8]
    turn: F64  # (octaves, 3, 3) from metres along the grid's axes to nodes of the tile
    sun: F32  # (octaves, PACK) 1, then the direction to the sun in the tile's axes
    wavelength_m: F32  # (OCTAVES,), 0 of those that there are not
    weight: F32  # (OCTAVES,) standard deviation
    quantile: F32  # of the normal distribution, by share of the mean in `in_cloud`
    refined: F32  # (species,) 1 for those that are
    in_cloud: F32  # (nz, ny, nx) greatest extinction around each node, 1/m
    drift_m: F64  # (2,) along x and y, that it has come with its clouds


NO_DETAIL = Detail(
    np.zeros((1, 1, 1, PACK), np.int8), np.zeros((0, 3, 3)), np.zeros((0, PACK), FLOAT), np.zeros(0, FLOAT),
    np.zeros(0, FLOAT), np.zeros(2, FLOAT), np.zeros(1, FLOAT), np.zeros((1, 1, 1), FLOAT), np.zeros(2),
)  # fmt: skip


@cache
def _tile() -> NDArray[np.int8]:
    """Noise of domes with creases between them, as cauliflower has: distance to the nearest of scattered points, one
    for each dome (Worley 1996), made normal by rank."""
    from scipy.ndimage import map_coordinates
    from scipy.spatial import cKDTree
    from scipy.special import ndtri

    rng = np.random.default_rng(17)
    cells, nodes = (np.argwhere(np.ones((n, n, n))).astype(float) for n in (_DOMES, TILE))
    points = (cells + rng.random(cells.shape)) * (TILE / _DOMES)
    distance, _ = cKDTree(points % TILE, boxsize=TILE).query(nodes, workers=-1)
    rank = np.empty(distance.size)
    rank[np.argsort(-distance, kind="stable")] = (np.arange(distance.size) + 0.5) / distance.size
    value = ndtri(rank).reshape(TILE, TILE, TILE)
    # between nodes it varies less
    value /= map_coordinates(value, rng.random((3, 100_000)) * TILE, order=1, mode="grid-wrap").std()
    slopes = [np.roll(value, -1, axis) - np.roll(value, 1, axis) for axis in range(3)]
    every = np.stack([value, *(s / s.std() for s in slopes)], axis=-1)
    whole = np.pad(np.clip(np.round(_STEPS * every), -127, 127), [(0, 1)] * 3 + [(0, 0)], mode="wrap")
    return np.ascontiguousarray(whole, np.int8)


def first_wavelength_m(cell_m: float) -> float:
    """Of the noise below a grid."""
    return min(_PER_CELL * cell_m, _LONGEST_M)


def detail_of(
    extinction: F32, refined: F32, cell_m: float, sun: F64, drift_m: tuple[float, float] = (0.0, 0.0)
) -> Detail:
    """Detail of a grid of cells ``cell_m`` wide: extinction (nz, ny, nx) of all species (ns,) that are ``refined``, and
    the direction to the sun along the grid's axes; ``drift_m``: how far clouds have brought it along x and y."""
    from scipy.ndimage import maximum_filter
    from scipy.special import ndtri

    wavelength = first_wavelength_m(cell_m) / _RATIO ** np.arange(_OCTAVES)
    wavelength = wavelength[(wavelength >= _SHORTEST_M) | (np.arange(_OCTAVES) == 0)]
    rng = np.random.default_rng(71)
    turns = np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in wavelength])
    weight = wavelength ** (1 / 3)  # k^-5/3
    weight *= np.sqrt((1 - _EDGE**2) / (weight**2).sum())
    most = 1.0 + _SURPLUS * min(1.0, _SURPLUS_M / wavelength[0])
    share = np.linspace(0, 1, _QUANTILES) ** _THINNING
    least = 0.5 / _QUANTILES
    return Detail(
        _tile(), np.ascontiguousarray(turns * (TILE / _DOMES / wavelength)[:, None, None]),
        np.concatenate([np.ones((len(turns), 1)), turns @ sun], axis=1).astype(FLOAT),
        _eight(wavelength), _eight(weight), ndtri(np.clip(share, least, 1 - least)).astype(FLOAT), refined,
        np.asarray(FLOAT(most) * maximum_filter(extinction, 3, mode="nearest"), FLOAT),
        np.array(drift_m, float),
    )  # fmt: skip


def _eight(values: F64) -> F32:
    return np.pad(values, (0, OCTAVES - len(values))).astype(FLOAT)


@part(FINITE, inlined=True)
def normal_share(x):
    """Share of a normal distribution below x, within 2e-4 (Page 1977, Appl. Stat. 26, 75)."""
    y = x * (FLOAT(1.5957691) + FLOAT(0.0713548) * x * x)
    e = transmission(abs(y))
    return (_ONE if y >= _ZERO else e) / (_ONE + e)


@part(FINITE, inlined=True)
def _quantile(share, table):
    n = table.shape[0] - 1
    t = min(max(share, _ZERO), _ONE) * FLOAT(n)
    i = min(int(t), n - 1)
    low = flat(table, i)
    return low + (t - FLOAT(i)) * (flat(table, i + 1) - low)


@part(FINITE, inlined=True)
def thickened(noise, edge, share, table):
    """Extinction over its mean where the noise is what it is. Its mean is 1 for normal noise of variance 1 - edge^2,
    for that of Phi((noise + q)/edge) is Phi(q). ``share``: the mean over `Detail.in_cloud`."""
    q = _quantile(share, table)
    return normal_share((noise + q) / edge) / normal_share(q)


@part(FINITE, inlined=True)
def sunward(slope, depth):
    """Factor on the beam: more where cloud thins toward the sun, the more, the thicker (``depth``) lumps are. Its mean
    is 1 at any noise, of which the slope is independent, and as often positive as negative."""
    return _ONE - _SHADING * depth / (_ONE + depth) * slope / math.sqrt(_ONE + slope * slope)


@part(FINITE, inlined=True)
def lerp(a, b, share):
    """What lies between."""
    return a + share * (b - a)


@part(FINITE, inlined=True)
def _row(field, n, right, a):
    return lerp(flat(field, n), flat(field, n + right), a)


@part(FINITE, inlined=True)
def scalar_at(field, ix, iy, level):
    """A field (nz, ny, nx) at fractional indices within it."""
    nz, ny, nx = field.shape
    k, j, i = min(int(level), nz - 2), min(int(iy), ny - 2), min(int(ix), nx - 2)
    a, b, c = FLOAT(ix - i), FLOAT(iy - j), FLOAT(level - k)
    n = (k * ny + j) * nx + i
    m = n + ny * nx
    return lerp(
        lerp(_row(field, n, 1, a), _row(field, n + nx, 1, a), b),
        lerp(_row(field, m, 1, a), _row(field, m + nx, 1, a), b), c,
    )  # fmt: skip


@part(FINITE, inlined=True)
def place_octaves(detail, blur_m, x, y, z, dx, dy, dz, scratch):
    """Note where in the tile a place (metres along the grid's axes) is, and how far there it is to another, by the
    turn of every octave of which a blur leaves something."""
    turn = detail.turn
    for n in range(turn.shape[0]):
        if flat(detail.wavelength_m, n) <= FLOAT(blur_m):  # those that follow are shorter
            break
        for axis in range(3):
            m, at = 9 * n + 3 * axis, PLACES + 2 * n * PACK + axis
            u = flat(turn, m) * x + flat(turn, m + 1) * y + flat(turn, m + 2) * z
            put(scratch, at, u - TILE * math.floor(u * (1 / TILE)))
            put(scratch, at + PACK, flat(turn, m) * dx + flat(turn, m + 1) * dy + flat(turn, m + 2) * dz)


@part(FINITE, inlined=True)
def seen_octaves(detail, blur_m, scratch):
    """Note the weight that a blur leaves of every octave. Returns the standard deviation of what it does not."""
    blur = FLOAT(blur_m)
    x = (read_double(detail.wavelength_m, 0) - blur) * (_ONE / blur)
    x = choose_above(x, _ZERO, x, _ZERO)
    x = choose_above(x, _ONE, _ONE, x)
    seen = x * x * (FLOAT(3.0) - FLOAT(2.0) * x) * read_double(detail.weight, 0)
    write(scratch, 0, seen)
    return FLOAT(math.sqrt(_ONE - sum_of(seen * seen)))


@part(FINITE, inlined=True)
def noise_at(detail, share, scratch):
    """Noise, and the three parts of its slope toward the sun, at a share of the way between the places of
    `place_octaves`, by the weights of `seen_octaves`: a pack."""
    total = spread(_ZERO)
    tile, mask = detail.tile, TILE - 1
    for n in range(OCTAVES):
        seen = flat(scratch, n)
        if seen <= _ZERO:
            break
        place = read(scratch, PLACES + 2 * n * PACK) + share * read(scratch, PLACES + (2 * n + 1) * PACK)
        node = floored(place)
        part = place - node
        a, b, c = lane(part, 0), lane(part, 1), lane(part, 2)
        i, j, k = whole_lane(node, 0) & mask, whole_lane(node, 1) & mask, whole_lane(node, 2) & mask
        at, above, beyond = ((i * _SIDE + j) * _SIDE + k) * PACK, _SIDE * PACK, _SIDE * _SIDE * PACK
        near = lerp(read_double_bytes(tile, at), read_double_bytes(tile, at + above), b)
        far = lerp(read_double_bytes(tile, at + beyond), read_double_bytes(tile, at + beyond + above), b)
        both = lerp(near, far, a)
        total += FLOAT(1 / _STEPS) * seen * read(detail.sun, n * PACK) * lerp(low(both), high(both), c)
    return total
