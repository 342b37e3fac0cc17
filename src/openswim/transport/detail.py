"""Detail: what clouds are like between the nodes of a grid, for eyes that come near (docs/decisions/0017).

A cell holds a mean. Where cloud ends within it, part of it is cloud as dense as that beside it and the rest is clear: of
the extinction ``in_cloud`` the share that the mean asks for, where a fractal noise exceeds that share's quantile. What
rays are too wide to see of the noise, or steps too long, blurs the edge between the two: by the convolution of normal
distributions, so that the mean stays, and nothing is left to change far away.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.transport.pack import PACK, flat, put, read, read_bytes, spread, write
from openswim.transport.scalar import smoothstep, transmission

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)

TILE = 64  # nodes of the noise's period, each way: a power of two
_LUMP = 6.0  # nodes from lump to lump
MOST_OCTAVES = 6
NOISE = 2 * PACK  # where, behind the octaves' weights, `noise_at` leaves what it finds
_STEPS = 32  # of the noise's integers per standard deviation
_RATIO = 2.17  # of the octaves' wavelengths
_QUANTILES = 256


class Detail(NamedTuple):
    """How clouds are refined below a grid; no octaves: not at all."""

    tile: NDArray[np.int8]  # (TILE, TILE, TILE, PACK) _STEPS times noise N(0, 1), and its slopes along the tile's axes, of unit variance
    turn: F64  # (octaves, 3, 3) from metres along the grid's axes to nodes of the tile
    sun: F32  # (octaves, PACK) 1, then the direction to the sun in the tile's axes
    wavelength_m: F64  # (octaves,)
    weight: F32  # (octaves,) standard deviation
    quantile: F32  # of the normal distribution, by share
    liquid: F32  # (species,) 1 for those that are refined
    in_cloud: F32  # (nz, ny, nx) extinction within cloud around each node, 1/m
    shading: float
    diffuse: float
    fineness: float  # least step, of the first wavelength


NO_DETAIL = Detail(
    np.zeros((1, 1, 1, PACK), np.int8), np.zeros((0, 3, 3)), np.zeros((0, PACK), np.float32), np.zeros(0),
    np.zeros(0, np.float32), np.zeros(2, np.float32), np.zeros(1, np.float32), np.zeros((1, 1, 1), np.float32), 0.0, 0.0, 1.0,
)  # fmt: skip


@cache
def _tile() -> NDArray[np.int8]:
    """Noise of domes, as cauliflower has them: distance to the nearest of scattered points, made normal by rank."""
    from scipy.spatial import cKDTree
    from scipy.special import ndtri

    rng = np.random.default_rng(17)
    points = rng.random((round((TILE / _LUMP) ** 3), 3)) * TILE
    nodes = np.stack(np.meshgrid(*[np.arange(TILE, dtype=float)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    distance, _ = cKDTree(points, boxsize=TILE).query(nodes)
    rank = np.empty(distance.size)
    rank[np.argsort(-distance, kind="stable")] = (np.arange(distance.size) + 0.5) / distance.size
    value = ndtri(rank).reshape(TILE, TILE, TILE)
    slopes = [np.roll(value, -1, axis) - np.roll(value, 1, axis) for axis in range(3)]
    slopes = [s / s.std() for s in slopes]
    whole = np.round(_STEPS * np.stack([value, *slopes], axis=-1))
    return np.ascontiguousarray(np.clip(whole, -127, 127), np.int8)


def _turns(wavelength_m: F64) -> F64:
    """A rotation for each octave, from metres to nodes."""
    rng = np.random.default_rng(71)
    turns = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(MOST_OCTAVES)]
    return np.array([t * (_LUMP / w) for t, w in zip(turns, wavelength_m, strict=False)]).reshape(-1, 3, 3)


def in_cloud(extinction: F32, reach: int = 1, surplus: float = 1.1) -> F32:
    """Extinction within cloud around each node: the most of its neighbourhood, and a little more."""
    from scipy.ndimage import maximum_filter

    return np.asarray(np.float32(surplus) * maximum_filter(extinction, 2 * reach + 1, mode="nearest"), np.float32)


def detail_of(extinction: F32, liquid: F32, cell_m: float, sun: F64, options: dict | None = None) -> Detail:
    """Detail of a grid: extinction (nz, ny, nx) of what is refined, which species ``liquid`` (ns,) that is, the width of
    cells, and the direction to the sun along the grid's axes."""
    from scipy.special import ndtri

    o = {"octaves": 5, "first": 1.4, "longest": 1500.0, "shortest": 5.0, "crisp": 0.25, "shading": 0.9, "diffuse": 0.8, "gamma": 0.6, "reach": 1,
         "surplus": 1.1, "slope": 1 / 3, "fineness": 0.07} | (options or {})
    first = min(o["first"] * cell_m, o["longest"])
    wavelength = first / _RATIO ** np.arange(o["octaves"])
    wavelength = wavelength[wavelength >= o["shortest"]]
    turn = _turns(wavelength)
    weight = wavelength ** o["slope"]
    weight *= np.sqrt((1 - o["crisp"] ** 2) / (weight**2).sum())
    along = np.array([t @ sun / np.linalg.norm(t[0]) for t in turn])
    shares = np.linspace(0, 1, _QUANTILES) ** o["gamma"]
    return Detail(
        _tile(), turn, np.concatenate([np.ones((len(turn), 1)), along], axis=1).astype(np.float32), wavelength,
        weight.astype(np.float32), ndtri(np.clip(shares, 0.5 / _QUANTILES, 1 - 0.5 / _QUANTILES)).astype(np.float32),
        liquid, in_cloud(extinction, o["reach"], o["surplus"]), float(o["shading"]), float(o["diffuse"]), float(o["fineness"]),
    )  # fmt: skip


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def normal_share(x):
    """Share of a normal distribution below x, within 2e-4 (Page 1977, Appl. Stat. 26, 75)."""
    y = x * (np.float32(1.5957691) + np.float32(0.0713548) * x * x)
    e = transmission(abs(y))
    return (_ONE if y >= _ZERO else e) / (_ONE + e)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def share_quantile(share, table):
    """The x below which lies a share of a normal distribution."""
    n = table.shape[0] - 1
    t = min(max(share, _ZERO), _ONE) * np.float32(n)
    i = min(int(t), n - 1)
    low = flat(table, i)
    return low + (t - np.float32(i)) * (flat(table, i + 1) - low)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def scalar_at(field, ix, iy, level):
    """A field (nz, ny, nx) at fractional indices."""
    nz, ny, nx = field.shape
    k, j, i = min(int(level), nz - 2), min(int(iy), ny - 2), min(int(ix), nx - 2)
    a, b, c = np.float32(ix - i), np.float32(iy - j), np.float32(level - k)
    n = (k * ny + j) * nx + i
    m = n + ny * nx
    low = (_ONE - b) * (flat(field, n) + a * (flat(field, n + 1) - flat(field, n)))
    low += b * (flat(field, n + nx) + a * (flat(field, n + nx + 1) - flat(field, n + nx)))
    up = (_ONE - b) * (flat(field, m) + a * (flat(field, m + 1) - flat(field, m)))
    up += b * (flat(field, m + nx) + a * (flat(field, m + nx + 1) - flat(field, m + nx)))
    return low + c * (up - low)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def seen_octaves(detail, blur_m, weights):
    """Fill in the weight of every octave that a blur leaves. Returns how many, and what is left of the standard
    deviation: the edge's own."""
    count = 0
    left = _ONE
    for n in range(detail.wavelength_m.shape[0]):
        seen = np.float32(smoothstep(flat(detail.wavelength_m, n) / blur_m - 1.0)) * flat(detail.weight, n)
        put(weights, n, seen)
        left -= seen * seen
        if seen > _ZERO:
            count = n + 1
    return count, np.float32(math.sqrt(left))


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _lerp(a, b, share):
    return a + share * (b - a)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def noise_at(detail, count, weights, x, y, z, out):
    """Noise at a place (metres along the grid's axes), and parts of its slope toward the sun, into out (PACK,)."""
    total = spread(_ZERO)
    tile = detail.tile
    mask = TILE - 1
    for n in range(count):
        m = 9 * n
        u = flat(detail.turn, m) * x + flat(detail.turn, m + 1) * y + flat(detail.turn, m + 2) * z
        v = flat(detail.turn, m + 3) * x + flat(detail.turn, m + 4) * y + flat(detail.turn, m + 5) * z
        w = flat(detail.turn, m + 6) * x + flat(detail.turn, m + 7) * y + flat(detail.turn, m + 8) * z
        fu, fv, fw = math.floor(u), math.floor(v), math.floor(w)
        a, b, c = np.float32(u - fu), np.float32(v - fv), np.float32(w - fw)
        i0, j0, k0 = int(fu) & mask, int(fv) & mask, int(fw) & mask
        i1, j1, k1 = (i0 + 1) & mask, (j0 + 1) & mask, (k0 + 1) & mask
        i0, i1 = i0 * (TILE * TILE * PACK), i1 * (TILE * TILE * PACK)
        j0, j1 = j0 * (TILE * PACK), j1 * (TILE * PACK)
        k0, k1 = k0 * PACK, k1 * PACK
        low = _lerp(
            _lerp(read_bytes(tile, i0 + j0 + k0), read_bytes(tile, i0 + j0 + k1), c),
            _lerp(read_bytes(tile, i0 + j1 + k0), read_bytes(tile, i0 + j1 + k1), c), b,
        )  # fmt: skip
        up = _lerp(
            _lerp(read_bytes(tile, i1 + j0 + k0), read_bytes(tile, i1 + j0 + k1), c),
            _lerp(read_bytes(tile, i1 + j1 + k0), read_bytes(tile, i1 + j1 + k1), c), b,
        )  # fmt: skip
        total += np.float32(1 / _STEPS) * flat(weights, n) * read(detail.sun, n * PACK) * _lerp(low, up, a)
    write(out, NOISE, total)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def thickened(noise, share, edge, table):
    """Factor on the mean extinction where the noise is what it is, of mean 1: (share of cloud by noise)/(share)."""
    q = share_quantile(share, table)
    return normal_share((noise + q) / edge) / normal_share(q)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def sunward(slope, depth, shading):
    """Factor on the beam, of mean 1: more where the cloud thins toward the sun, as far as lumps are thick."""
    return _ONE - np.float32(shading) * depth / (_ONE + depth) * slope / math.sqrt(_ONE + slope * slope)
