"""Clouds smaller than a model's cells: arranged where the grid can show them, thinned where it cannot.

docs/decisions/0011-cloud-fraction.md says why it is done so.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.optics import OpticalSpecies
from openswim.optics.cover import CLOUD, LEAST_COVER
from openswim.transport.engine.types import FLOAT
from openswim.transport.medium.noise import Octave
from openswim.transport.medium.subdivision import around_nodes, finer_cloud, subdivided

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

PRECIPITATION = ("rain", "snow", "graupel")
SMALLEST_M = 500.0  # lattice of the finest octave of cloud
_SHOWN_NODES = 1.75  # nodes of the grid to a lattice spacing from which on it shows an octave: 3.5 to its least lumps
_TALL_M = 4000.0
_EXPONENT = 2 / 3  # of an octave's variance with its size: spectra of k^-5/3
_WIDEST = 0.5  # cells: lumps of such octaves are about two cells wide, the least that a model's own fields show
_MOST_RATIO = 6.0
_G = np.linspace(-4.0, 4.0, 161)
_COVERS = np.geomspace(LEAST_COVER, 1.0, 65)


def octaves(cell_m: float, node_m: float) -> tuple[list[float], float]:
    """Lattice spacings of a cell's clouds that a grid of ``node_m`` shows, and their share of all the variance."""
    every = [SMALLEST_M * 2.0**n for n in range(20) if SMALLEST_M * 2.0**n <= _WIDEST * cell_m]
    shown = [size for size in every if size >= _SHOWN_NODES * node_m]
    total = sum(size**_EXPONENT for size in every)
    return shown, sum(size**_EXPONENT for size in shown) / total if shown else 0.0


def spread_in_cloud(cover: F64, cell_m: float) -> F64:
    """Standard deviation over mean of the water within the clouds of a cell (Boutle et al. 2014, QJRMS 140, Eq. 5).

    (.45 - .25 c) s, of overcast cells .11 s; s = (c x)^1/3 ((.06 c x)^1.5 + 1)^-.17, x the cell's width in km.
    """
    x = cover * cell_m / 1e3
    factor = np.interp(cover, [0.0, 0.9, 1.0], [0.45, 0.225, 0.11])
    return np.asarray(factor * np.cbrt(x) * ((0.06 * x) ** 1.5 + 1) ** -0.17)


def _gamma_quantiles(spread: float, at: F64) -> F64:
    """Quantiles, highest first (``at`` 0: the densest), of a gamma distribution of mean 1 and a standard deviation."""
    shape = 1 / max(spread, 0.02) ** 2
    x = np.linspace(0.0, 1.0 + 12 * spread, 4001)[1:] - 0.5 * (1.0 + 12 * spread) / 4000
    log_density = (shape - 1) * np.log(x) - shape * x
    cumulative = np.cumsum(np.exp(log_density - log_density.max()))
    return np.interp(1 - at, cumulative / cumulative[-1], x)


@lru_cache(maxsize=8)
def _tables(cell_m: float, shown: float) -> tuple[F32, F32]:
    """Given the shown part g of a cell's noise (rows of `_G`) and its cover (columns of `_COVERS`): content over the
    cell's mean, and cover, expected at a node.

    A place is cloud where the whole noise, shown and not, is beyond the quantile of the cover; the farther, the denser.
    """
    chance = (np.arange(200) + 0.5) / 200
    unknown = np.array([NormalDist().inv_cdf(p) for p in chance])
    normal = NormalDist()
    whole = np.sqrt(shown) * _G[:, None] + np.sqrt(1 - shown) * unknown
    grid = np.linspace(-6, 6, 2401)
    beyond = 1 - np.interp(whole, grid, [normal.cdf(v) for v in grid])  # 0 at a cloud's core, `cover` at its edge
    content, cover = np.empty((2, _G.size, _COVERS.size))
    weight = np.exp(-0.5 * _G**2)
    s = np.linspace(0, 1, 2001)
    for n, share in enumerate(_COVERS):
        inside = beyond < share
        density = np.interp(beyond / share, s, _gamma_quantiles(float(spread_in_cloud(share, cell_m)), s))
        content[:, n] = (density * inside).mean(axis=1)
        content[:, n] *= weight.sum() / (weight * content[:, n]).sum()
        cover[:, n] = inside.mean(axis=1)
    return content.astype(FLOAT), cover.astype(FLOAT)


class _Place(NamedTuple):
    """Where shown noise and covers lie in `_tables`: rows and columns, and shares of the next ones."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    down: F32
    right: F32

    @classmethod
    def of(cls, g: F32, cover: F32) -> _Place:
        a = np.clip((g + 4.0) * ((_G.size - 1) / 8.0), 0, _G.size - 1.001)
        b = np.clip(np.log(np.maximum(cover, LEAST_COVER) / LEAST_COVER) / np.log(_COVERS[1] / _COVERS[0]), 0, 63.999)
        row, column = a.astype(np.int64), b.astype(np.int64)
        return cls(row, column, (a - row).astype(FLOAT), (b - column).astype(FLOAT))

    def read(self, table: F32) -> F32:
        i, j, u, v = self
        low = table[i, j] * (1 - u) + table[i + 1, j] * u
        return np.asarray(low * (1 - v) + (table[i, j + 1] * (1 - u) + table[i + 1, j + 1] * u) * v, FLOAT)


def _nearby(field: F32) -> F32:
    """The mean (ny, nx) around each node of the model, over about three by three of its cells."""
    for axis in (0, 1, 0, 1):
        f = np.moveaxis(field, axis, 0)
        padded = np.concatenate([f[1:2], f, f[-2:-1]])
        field = np.moveaxis((padded[:-2] + 2 * padded[1:-1] + padded[2:]) / 4, 0, axis)
    return np.asarray(field, FLOAT)


def cloud_under_cover(
    fields: Sequence[F32], species: Sequence[OpticalSpecies], cover: F32, levels_m: F64, place_m: F64, cell_m: float,
    fineness: int,
) -> F32:  # fmt: skip
    """Extinction (ns, nz, ny, nx) of clouds that cover parts of cells (nz, ny', nx'): broken where the grid can show
    it (`broken_cloud`), thinned to what reflects as much where it cannot (`effective_share`)."""
    kinds = [one.kind for one in species]
    extinction, left, shown = broken_cloud(fields, kinds, cover, levels_m, place_m, cell_m, fineness)
    clouds = [n for n, kind in enumerate(kinds) if kind in CLOUD + PRECIPITATION]
    thickness = np.gradient(levels_m).astype(FLOAT)[:, None, None]
    scaled = np.zeros(extinction.shape[1:], FLOAT)
    for n in clouds:
        g = float(np.mean([phase.asymmetry for phase in species[n].phase]))
        scaled += FLOAT(0.866 * (1 - g)) * extinction[n] * thickness
    share = effective_share(scaled, left, cell_m, shown)
    for n in clouds:
        extinction[n] *= share
    return extinction


def under_cloud(cover: F32) -> F32:
    """Cover (nz, ...) of what falls out of cloud: the greatest above."""
    return np.maximum.accumulate(cover[::-1], axis=0)[::-1]


def broken_cloud(
    fields: Sequence[F32], kinds: Sequence[str], cover: F32, levels_m: F64, place_m: F64, cell_m: float, fineness: int
) -> tuple[F32, F32, float]:
    """Extinction (ns, nz, ny, nx) of cells (nz, ny', nx') on a grid ``fineness`` times as fine, cloud broken as
    ``cover`` says; the cover left within each node; and the share of variance that the grid shows.

    place_m (ny, nx, 3): the nodes, in axes that turn with the Earth, so that a place has its clouds whatever the cut.
    The mean around each node of the model is kept, over about three by three cells.
    """
    ny, nx = place_m.shape[:2]
    sizes, shown = octaves(cell_m, cell_m / fineness)
    if fineness == 1 or not sizes:
        sizes, shown = [], 0.0
    noise = [Octave(place_m.reshape(-1, 3), size, float(np.clip(2 * size, 1000.0, _TALL_M))) for size in sizes]
    content, left = _tables(float(round(cell_m, -2)), round(shown, 3))
    out = np.zeros((len(fields), len(levels_m), ny, nx), FLOAT)
    covers = np.zeros(out.shape[1:], FLOAT)
    falling = under_cloud(cover)
    for k, height in enumerate(levels_m):
        there = [n for n, field in enumerate(fields) if field[k].any()]
        if not there:
            continue
        if not noise:
            for n in there:
                out[n, k] = fields[n][k] if fineness == 1 else finer_cloud(fields[n][k], fineness)
            covers[k] = subdivided(cover[k], fineness)
            continue
        parts = [FLOAT(size ** (_EXPONENT / 2)) * one.at(height) for size, one in zip(sizes, noise, strict=True)]
        g = np.sum(parts, axis=0).reshape(ny, nx)
        # what the model resolves is its own: the noise is the same around each of its nodes in mean and spread
        g = g - subdivided(_nearby(around_nodes(g, fineness)), fineness)
        g /= np.sqrt(np.maximum(subdivided(_nearby(around_nodes(g * g, fineness)), fineness), 1e-6))
        here = subdivided(cover[k], fineness)
        at_cover = _Place.of(g, here)
        covers[k] = at_cover.read(left)
        falls = any(kinds[n] in PRECIPITATION for n in there)
        at_falling = _Place.of(g, subdivided(falling[k], fineness)) if falls else at_cover
        for n in there:
            if kinds[n] not in CLOUD + PRECIPITATION:
                out[n, k] = finer_cloud(fields[n][k], fineness)
                continue
            at = at_cover if kinds[n] in CLOUD else at_falling
            fine = subdivided(fields[n][k], fineness) * at.read(content)
            wanted = _nearby(fields[n][k])
            for _ in range(2):
                ratio = wanted / np.maximum(_nearby(around_nodes(fine, fineness)), 1e-12)
                fine *= subdivided(np.minimum(ratio, FLOAT(_MOST_RATIO)), fineness)
            kept = float(around_nodes(fine, fineness).sum())
            out[n, k] = fine * FLOAT(min(float(fields[n][k].sum()) / max(kept, 1e-20), 2.0))
    return out, covers, shown


def reflecting_share(depth: F32, cover: F32, spread2: F64 | float) -> F32:
    """Optical depth of the even layer that reflects as much as clouds of mean ``depth`` over ``cover``, over `depth`.

    depth: scaled as in the two-stream R = x/(1 + x), x = sqrt(3)/2 (1 - g) tau. Clouds hold x/cover each, less what
    their own spread (variance over mean squared) takes off; sky and clouds reflect by their areas.
    """
    within = depth / cover
    within = within / (1 + spread2 * within / (1 + within))
    reflected = np.minimum(cover * within / (1 + within), 0.999)
    return np.where(depth > 1e-6, reflected / (1 - reflected) / np.maximum(depth, 1e-6), 1.0).astype(FLOAT)


def effective_share(scaled: F32, cover: F32, cell_m: float, shown: float) -> F32:
    """Factor (ny, nx) on the extinction of columns whose clouds are broken within their nodes.

    scaled (nz, ny, nx): x of each layer; cover (nz, ny, nx) within the nodes. Clouds overlap maximally where they
    touch, at random elsewhere (Geleyn and Hollingsworth 1979). Layers count for the columns' cover by what they hold.
    """
    clear, below = np.ones(cover.shape[1:], FLOAT), np.zeros(cover.shape[1:], FLOAT)
    greatest = np.zeros(cover.shape[1:], FLOAT)
    depth, within = np.zeros_like(clear), np.zeros_like(clear)
    for x, c in zip(scaled, cover, strict=True):
        c = np.where(x > 1e-5, np.clip(c, LEAST_COVER, 1.0), 0.0).astype(FLOAT)
        clear *= (1 - np.maximum(c, below)) / np.maximum(1 - below, FLOAT(1e-6))
        greatest = np.maximum(greatest, c)
        depth += np.where(c > 0, x, 0)
        within += np.where(c > 0, x / np.maximum(c, FLOAT(LEAST_COVER)), 0)
        below = c
    overlap = np.clip(1 - clear, greatest, 1.0) / np.maximum(greatest, FLOAT(1e-6))
    share = np.clip(depth / np.maximum(within, 1e-9) * overlap, LEAST_COVER, 1.0)
    spread2 = spread_in_cloud(share.astype(float), cell_m) ** 2 * (1 - shown)
    return reflecting_share(depth, share.astype(FLOAT), spread2)
