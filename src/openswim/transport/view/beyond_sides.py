"""Light that a grid's clouds send to the ground beyond its sides, and that of the clear sky which they hide from it.

Light is solved within the grid. What leaves its sides downward differs from the clear sky's light there, and lights
ground at a distance u from a side and at v along it by

    E(u, v) = 1/(4 pi) int int [L(v + u tan p, z; a, p) - L_clear(z; a, p)] e^-tau  sin a cos a da dp,

over the altitudes a and bearings p (from the side's normal) at which it is seen; z = u tan a / cos p is the height
where a line of sight meets the side, tau the depth of the air in between. At u = 0 all of it comes from the foot.

L is carried to the sides once more, through the solved field, along ordinates that are more and lower than those of the
sweeps, which leave half of all distances to level ones; and through the coarsest columns that tell all that scatters
(four to one, usually): beyond a side light soon is even. It comes in straight lines, as the sides are taken to be on
the Earth and the Earth to be flat, as far as it matters. What the air outside scatters of it is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray
from scipy.sparse import csr_array

from openswim.transport.air.shells import clear_radiance
from openswim.transport.diffuse.absorbed_beam import beam_around
from openswim.transport.diffuse.moments import places
from openswim.transport.diffuse.optical_grid import OpticalGrid, optical_grid
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.diffuse.sweep import share_ordinates, share_rows
from openswim.transport.diffuse.sweeper import Sweeper
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.ordinates import Ordinates
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.scratch import Pool
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.lit.lit_grid import GridLight
from openswim.transport.march.volume import Shells
from openswim.transport.medium.delta_scaled import Coefficients

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ALTITUDES = np.radians([3.0, 10.0, 20.0, 35.0, 58.0])
_AZIMUTHS = 12  # a multiple of four: every side has the same bearings
_SEEN = 8  # of them, those up to a quarter of a circle and half a step from a side's normal
_REACH = 16.0  # heights of the highest cloud: there a wall's light is 1/500 of that at its foot
_DISTANCES = 24
_BEARINGS = 36
_SLICES = 48  # of a side's height


class _Table(NamedTuple):
    """Flux (PACK, u, v) beyond a side, at distances from it and at places along it, m."""

    distance_m: F64
    along_m: F64
    flux: F64


@dataclass(eq=False)
class Beyond:
    """What clouds of a grid with an end do to the diffuse light on the ground around it, tabled when it is needed."""

    light: GridLight
    shells: Shells
    ends: NDArray[np.bool_]  # see `OpticalGrid`

    def flux(self, ix: F64, iy: F64, clear: F64, inside: F32) -> F64:
        """Diffuse flux (n, PACK) at fractional indices (n,) outside the grid, where the clear sky's is ``clear``.

        On the sides it is that ``inside`` (PACK, ny, nx). The tables, of coarser columns and other ordinates, differ a
        little; that is spread over a few columns.
        """
        if self._highest_m <= 0:
            return clear
        (dx, dy), (_, ny, nx) = self.light.medium.cell_m, self.light.medium.shape
        jx, jy = np.clip(ix, 0, nx - 1), np.clip(iy, 0, ny - 1)
        apart = np.hypot(dx * (ix - jx), dy * (iy - jy))
        out = clear.copy()
        near = np.flatnonzero(apart < self._reach_m)
        share = np.clip(2 - 2 * apart[near] / self._reach_m, 0, 1)[:, None]
        out[near] += share * self._excess(ix[near], iy[near])
        fade_m = self._factor * max(dx, dy)
        near = np.flatnonzero(apart < 10 * fade_m)
        lacking = bilinear(inside, jx[near], jy[near]) - clear[near] - self._excess(jx[near], jy[near])
        out[near] += lacking * np.exp(-apart[near] / fade_m)[:, None]
        return np.maximum(out, 0)

    def _excess(self, ix: F64, iy: F64) -> F64:
        """What the sides add (n, PACK) to the clear sky's flux."""
        (dx, dy), (_, ny, nx) = self.light.medium.cell_m, self.light.medium.shape
        x, y = dx * ix, dy * iy
        ways = ((-x, y), (x - dx * (nx - 1), y), (-y, x), (y - dy * (ny - 1), x))
        out = np.zeros((len(ix), PACK))
        for table, (distance, along) in zip(self._tables, ways, strict=True):
            front = np.flatnonzero(distance >= 0)
            u = np.interp(distance[front], table.distance_m, np.arange(len(table.distance_m)))
            v = np.interp(along[front], table.along_m, np.arange(len(table.along_m)))
            out[front] += bilinear(table.flux, v, u)
        return out

    def prepare(self) -> None:
        """Reckon now what is reckoned once."""
        if self._highest_m > 0:
            _ = self._tables

    @cached_property
    def _levels(self) -> int:
        """How many hold all clouds."""
        cloudy = np.flatnonzero(self.light.medium.extinction.any(axis=(0, 2, 3)))
        return min(int(cloudy[-1]) + 3, len(self.light.medium.levels_m)) if cloudy.size else 0

    @cached_property
    def _highest_m(self) -> float:
        medium = self.light.medium
        return float(medium.levels_m[self._levels - 1] - medium.ground_m) if self._levels else 0.0

    @property
    def _reach_m(self) -> float:
        return _REACH * self._highest_m

    @property
    def _factor(self) -> int:
        """Columns of the grid, each way, to one that light is carried through."""
        return max(self.light.coarser[0].factor, 1)

    @cached_property
    def _tables(self) -> list[_Table]:
        """Of the sides west, east, south and north."""
        medium, count = self.light.medium, self.light.count
        least = min(0.25 * min(medium.cell_m), 0.01 * self._reach_m)
        distance = np.concatenate([[0.0], np.geomspace(least, self._reach_m, _DISTANCES)])
        height = medium.levels_m[: self._levels] - medium.ground_m
        views = _views(*(np.ascontiguousarray(part, float).tobytes() for part in (distance, height)),
                       self._air_depth(height).tobytes())  # fmt: skip
        leaving = [self._through_sides(w) for w in range(count)]
        tables = []
        for side in range(4):
            radiance = np.stack([own[side] for own in leaving])
            cell, nodes = (medium.cell_m[1], medium.shape[1]) if side < 2 else (medium.cell_m[0], medium.shape[2])
            length = cell * (nodes - 1)
            edges = np.clip(cell * (self._factor * np.arange(radiance.shape[-1] + 1) - 0.5), 0, length)
            edges[-1] = length
            middle = 0.5 * (edges[1:] + edges[:-1])
            along = np.concatenate([-distance[:0:-1], [0.0], middle, [length], length + distance[1:]])
            flux = np.stack([view.flux(radiance, edges, along) for view in views], axis=1)
            tables.append(_Table(distance, along, np.pad(flux, ((0, PACK - count), (0, 0), (0, 0)), "edge")))
        return tables

    @cached_property
    def _clear(self) -> F32:
        """Radiance (altitudes, azimuths, nz, PACK) of the clear sky along the ordinates."""
        medium = self.light.medium
        axes = medium.axes[medium.shape[1] // 2, medium.shape[2] // 2].astype(float)
        height = np.maximum(medium.levels_m[: self._levels], self.shells.ground_m + 0.5)
        way = np.repeat(_ordinates().reshape(-1, 3) @ axes, len(height), axis=0)
        place = np.stack([0 * height, 0 * height, height], axis=-1)
        place = np.tile(place, (len(way) // len(height), 1))
        radiance = clear_radiance(place, way, self.light.sun, self.shells, 1.0)
        return radiance.reshape(len(_ALTITUDES), _AZIMUTHS, -1, PACK)

    def _through_sides(self, w: int) -> list[F32]:
        """Radiance (levels x altitudes x `_SEEN` bearings, columns) less that of the clear sky, through each side."""
        grid, moments = _on_columns(self.light, w, self._levels, self.ends)
        node, pool, level = grid.ground_node, Pool(), np.arange(self._levels)[:, None]
        blank = np.zeros(node.shape, FLOAT)
        out: list[list[F32]] = [[], [], [], []]
        for down, clear in zip(_ordinates(), self._clear[..., w], strict=True):
            # a sweeper has ordinates of both hemispheres, though but one is carried
            ordinates = Ordinates(np.concatenate([down, down * [1, 1, -1]]), np.ones(2 * _AZIMUTHS))
            sweeper = Sweeper.of(grid, np.tile(clear, (2, 1)), blank, blank, ordinates, pool)
            radiance, order = _carried_down(sweeper, moments)
            sides = (radiance[..., 0], radiance[..., -1], radiance[:, 0].swapaxes(1, 2), radiance[:, -1].swapaxes(1, 2))
            for n, (side, ground) in enumerate(zip(sides, (node[:, 0], node[:, -1], node[0], node[-1]), strict=True)):
                excess = np.moveaxis(side, 2, 0)[order] - clear[:, :, None]  # (azimuth, level, column)
                excess[:, level < ground] = 0
                out[n].append(excess[_bearings(n)])
        return [np.moveaxis(np.stack(side), 2, 0).reshape(-1, side[0].shape[-1]) for side in out]

    def _air_depth(self, height: F64) -> F64:
        """Delta-scaled vertical depth (nw, nz) of the air between the ground and heights above it."""
        extinction = np.stack([c.air_extinction[: len(height)] for c in self.light.coefficients[: self.light.count]])
        steps = 0.5 * (extinction[:, 1:] + extinction[:, :-1]) * np.diff(height)
        depth = np.cumsum(np.pad(steps, ((0, 0), (1, 0))), axis=1)
        return np.stack([own - np.interp(0.0, height, own) for own in depth])


@lru_cache(maxsize=2)  # all lights of a scene, and all times of a series, look at sides alike
def _views(distance: bytes, height: bytes, depth: bytes) -> list[_View]:
    """From each distance, see `_View.of`."""
    ways, levels = np.frombuffer(distance), np.frombuffer(height)
    return [_View.of(float(u), levels, np.frombuffer(depth).reshape(-1, len(levels))) for u in ways]


class _View(NamedTuple):
    """How ground at a distance sees a side: per wavelength the weights (bearings, levels x ordinates) of the light that
    leaves it, and where along the side a bearing begins and ends, m."""

    weights: list[csr_array]
    first_m: F64
    last_m: F64

    @classmethod
    def of(cls, u: float, height: F64, depth: F64) -> _View:
        """From a distance, of a side up to the last of its levels' heights (nz,) above the ground; see `_air_depth`."""
        ends = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _BEARINGS + 1)
        bearing = 0.5 * (ends[1:] + ends[:-1])
        # in slices of sin^2 a, of which 2 sin a cos a da is the measure
        rise = height[-1] * np.cos(bearing)
        most = rise**2 / (rise**2 + u**2)
        square = most[:, None] * (np.arange(_SLICES) + 0.5) / _SLICES
        tangent = np.sqrt(square / (1 - square))
        z = u * tangent / np.cos(bearing)[:, None]
        weight = np.broadcast_to(0.5 * most[:, None] / _SLICES * (ends[1] - ends[0]) / (4 * np.pi), z.shape)
        at_height = _between(np.interp(z, height, np.arange(len(height))), len(height))
        at_altitude = _between(np.interp(np.arctan(tangent), _ALTITUDES, np.arange(len(_ALTITUDES))), len(_ALTITUDES))
        turn = bearing / (2 * np.pi / _AZIMUTHS) + 0.5 * (_SEEN - 1)
        at_bearing = _between(np.broadcast_to(turn[:, None], z.shape), _SEEN)
        shares, columns = [], []
        for k, of_height in _both(*at_height):
            for a, of_altitude in _both(*at_altitude):
                for b, of_bearing in _both(*at_bearing):
                    shares.append(weight * of_height * of_altitude * of_bearing)
                    columns.append((k * len(_ALTITUDES) + a) * _SEEN + b)
        rows = np.broadcast_to(np.arange(_BEARINGS)[:, None], (len(shares), *z.shape))
        place = rows.ravel(), np.ravel(columns)
        shape = _BEARINGS, len(height) * len(_ALTITUDES) * _SEEN
        left = [np.exp(-np.interp(z, height, own) / np.sqrt(square)) for own in depth]
        weights = [csr_array(((own * np.array(shares)).ravel(), place), shape=shape) for own in left]
        across = u * np.tan(np.clip(ends, -1.57, 1.57))
        return cls(weights, across[:-1] - 0.5, across[1:] + 0.5)

    def flux(self, radiance: F32, edges: F64, along: F64) -> F64:
        """Flux (nw, n) at places along a side, of which columns between ``edges`` send ``radiance`` (nw, levels x
        ordinates, m)."""
        light = np.stack([weights @ own for weights, own in zip(self.weights, radiance, strict=True)])
        sums = np.cumsum(np.pad(light * np.diff(edges), ((0, 0), (0, 0), (1, 0))), axis=-1)
        wide = self.last_m - self.first_m
        between = _at(sums, edges, along + self.last_m[:, None]) - _at(sums, edges, along + self.first_m[:, None])
        return np.asarray((between / wide[:, None]).sum(axis=1))


def _at(values: F64, nodes: F64, places: F64) -> F64:
    """Rows of values (nw, rows, m) at nodes (m,), linearly, at each row's own places (rows, n)."""
    before, share = _between(np.interp(places, nodes, np.arange(len(nodes))), len(nodes))
    row = np.arange(len(places))[:, None]
    return np.asarray(values[:, row, before] * (1 - share) + values[:, row, before + 1] * share)


def _between(at: F64, count: int) -> tuple[NDArray[np.int64], F64]:
    """The node before a fractional index, and the share of the next."""
    before = np.clip(at.astype(int), 0, max(count - 2, 0))
    return before, at - before


def _both(before: NDArray[np.int64], share: F64) -> tuple[tuple[NDArray[np.int64], F64], ...]:
    """Two nodes and what counts of each."""
    return (before, 1 - share), (before + 1, share)


def _ordinates() -> F64:
    """Directions (altitudes, azimuths, 3) to where light comes from."""
    azimuth = (np.arange(_AZIMUTHS) + 0.5) * 2 * np.pi / _AZIMUTHS
    a, p = np.meshgrid(_ALTITUDES, azimuth, indexing="ij")
    return np.stack([np.cos(a) * np.cos(p), np.cos(a) * np.sin(p), np.sin(a)], axis=-1)


def _on_columns(light: GridLight, w: int, levels: int, ends: NDArray[np.bool_]) -> tuple[OpticalGrid, F32]:
    """The medium, and the diffuse light around the nodes of all its blocks, on the columns of the coarser grid that
    tells all that scatters, or on the grid's own."""
    assert light.moments is not None
    medium, c, coarser = light.medium, light.coefficients[w], light.coarser[w]
    factor = coarser.factor
    ratio: F32 | None
    ground_node = np.minimum(medium.ground_node, levels - 1)
    if factor:
        nx = coarser.columns
        extinction, beam, harmonics = (f[..., :nx] for f in (coarser.extinction, coarser.beam, coarser.sun_harmonics))
        place, values, ratio = coarser.place, coarser.values, coarser.ratio
        ground_node = np.ascontiguousarray(ground_node[::factor, ::factor])
    else:
        extinction, beam = medium.extinction_above_ground, light.beams[w]
        harmonics = np.moveaxis(light.sun_harmonics, 0, 1)
        (place, values), ratio = light.moments[w], light.ratios[w]
    own = Coefficients(c.scaled, c.scattering, c.air_extinction[:levels], c.air_scattering[:levels])
    grid = optical_grid(
        extinction[:, :levels], harmonics, medium.levels_m[:levels], max(factor, 1) * np.array(medium.cell_m, float),
        False, ends, ground_node, own, beam[:levels],
    )  # fmt: skip
    kept = place[:levels]
    moments = np.zeros((kept.size, values.shape[1], BLOCK), FLOAT)
    some = kept[kept >= 0]
    moments[kept.ravel() >= 0] = values[some] if ratio is None else values[some] * ratio[some, None]
    return grid if factor else grid._replace(beam=beam_around(grid)), moments


def _carried_down(sweeper: Sweeper, moments: F32) -> tuple[F32, NDArray[np.int64]]:
    """Radiance (nz, ny, ordinates, nx) along the downward ordinates, if they are one group, from the light around the
    nodes of all blocks; and where in it each of them is, in the order of the sweeper's."""
    grid = sweeper.grid
    nz, (ny, nx) = len(grid.levels_m), grid.ground_node.shape
    whole = replace(sweeper, place=places(np.ones(sweeper.place.shape, bool)), amends=False)
    room, (half, group) = whole.room(get_num_threads()), whole.halves[0]
    hemisphere = whole.hemisphere(True, np.zeros((ny, nx), FLOAT), room)
    # a sweep but for its moments, which nobody needs
    in_threads(share_rows, 0, group, moments, moments, hemisphere)
    in_threads(share_ordinates, 0, group.first, hemisphere)
    down = whole.ordinates.direction[: len(half.direction)]
    order = np.array([np.abs(half.direction - q).sum(axis=-1).argmin() for q in down])
    return room.emission.reshape(nz, ny, len(down), -1)[..., :nx], order


def _bearings(side: int) -> NDArray[np.int64]:
    """Which of the azimuths are the bearings seen through a side, from its normal inward toward where it runs."""
    step = 2 * np.pi / _AZIMUTHS
    inward = np.array([1, -1, 1j, -1j])[side]
    bearing = (np.arange(_SEEN) - 0.5 * (_SEEN - 1)) * step
    runs = 1j if side < 2 else 1.0
    azimuth = np.angle(inward * np.cos(bearing) + runs * np.sin(bearing))
    return np.round(azimuth / step - 0.5).astype(int) % _AZIMUTHS
