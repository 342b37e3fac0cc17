"""The light of a grid before it is seen: coefficients, the sun's beam, and the volume that rays march through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from openswim.transport.air.shells import rows_between, shell_levels
from openswim.transport.beam.direct import direct_beam, ground_beam, shadow_rows
from openswim.transport.beam.sun_sweep import depths_to_sun, inside
from openswim.transport.beam.within_cells import bend_cells
from openswim.transport.columns.columns import Columns
from openswim.transport.columns.discrete_ordinates import Layers
from openswim.transport.diffuse.moments import Coarser, Moments
from openswim.transport.diffuse.optical_grid import Coefficients
from openswim.transport.engine.eye_ways import columns_of, wide
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.ordinates import harmonic_matrix, lebedev
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.threads import in_threads
from openswim.transport.ground_light.fluxes import Lighting, forward_depth
from openswim.transport.march.empty_space import beside, free_cubes, occupied, steepness
from openswim.transport.march.forward_peak import forward_share, peak_tables
from openswim.transport.march.volume import (
    DEGREE,
    PEAK_COSINES,
    SHELL_TABLE_PER_M,
    Shells,
    Volume,
    blank_fields,
    reach,
    tidy,
)
from openswim.transport.medium.medium import Medium
from openswim.transport.swim import light as swim
from openswim.transport.view.source_function import field_at, thickest_around, view_source

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TOLD = 4096  # nodes whose harmonics are told together
_AROUND, _BESIDE = 6, 3  # cells from an eye at which nodes have it in their rays' direction; at which cloud matters
_LEAST_DEPTH = 0.01  # cosine of the angle from the scene's origin at which its grid ends


class SunDepth(NamedTuple):
    """Optical depths to the sun, see `sun_sweep`, and which of them each wavelength reads (PACK,)."""

    depth: F32
    lanes: NDArray[np.int64]


@dataclass
class GridLight:
    """What the grid knows of the light: per wavelength the beam, the moments and the coefficients."""

    medium: Medium
    beams: list[F32]
    moments: list[Moments] | None  # of the light at the nodes
    coefficients: list[Coefficients]
    local_sun: F64  # (ny, nx, 3)
    sun: F64
    count: int
    shadow_m: F64
    ridge_m: F64
    coarser: list[Coarser] = field(default_factory=list)
    ratios: list[F32 | None] = field(default_factory=list)  # of the light scattered around the nodes to `moments`
    layers: list[Layers] | None = None  # instead of moments, in `Medium.layered` scenes
    columns: Columns | None = None  # instead of moments, in very large domains
    _aimed: tuple[bytes, bool] | None = None
    _around: bytes | None = None  # the eye of the last `turning_around`
    _stands_for: NDArray[np.int32] | None = None  # `thickest_around`

    @property
    def sun_harmonics(self) -> F32:
        """Harmonics (M^2, ny, nx) of the direction to the sun in every column's axes."""
        harmonics = harmonic_matrix(self.local_sun.reshape(-1, 3), DEGREE).T
        return np.ascontiguousarray(harmonics.reshape(-1, *self.local_sun.shape[:2]), np.float32)

    def aim(self, volume: Volume, eye: F64, parallel: bool) -> None:
        """Fill the source channels for one eye."""
        key = (np.asarray(eye, float).tobytes(), parallel)
        if key == self._aimed:
            return
        if self.layers is not None:
            for w, layers in enumerate(self.layers):
                volume.fields[:, 0, 0, PACK + w] = layers.source(eye)
        if self.columns is not None or self.moments is not None:
            self._aim_part(volume, np.array(eye, float), parallel, [(0, n) for n in self.medium.shape])
        self._aimed = key

    def _aim_part(self, volume: Volume, eye: F64, parallel: bool, part: Sequence[tuple[int, int]]) -> None:
        """See `view_source` and `column_light`."""
        self._aimed = None
        if self.columns is not None:
            self.columns.aim(volume.fields, eye, parallel, part[1:])
        if self.moments is None:
            return
        m = self.medium
        extinction = wide(m.extinction)
        if self._stands_for is None:
            self._stands_for = thickest_around(extinction, m.periodic)
        in_threads(
            view_source, extinction, self._stands_for, *(
                np.stack([getattr(c, name) for c in self.coefficients])
                for name in ("scaled", "scattering", "air_extinction", "air_scattering")
            ), *field_at(self.moments, self.coarser),
            columns_of(m.axes, m.place, eye, parallel), m.levels_m, eye,
            parallel, self.count, np.array(part, np.int64), volume.fields,
        )  # fmt: skip

    def turning(self, volume: Volume) -> Volume:
        """The volume with sources that rays read in their own direction: in a period a node is seen at many places."""
        near = beside(volume.fields[..., volume.cloud_channel] > 0, volume.periodic)
        near |= volume.air[:, 0, None, None] > 0
        return self._turning(volume, [(0, n) for n in near.shape], near)

    def turning_around(self, volume: Volume, eye: F64) -> Volume:
        """The volume with such sources at the nodes around an eye that is in or beside cloud: they have it in other
        directions than its rays come from."""
        key = np.asarray(eye, float).tobytes()
        if key != self._around:
            self._around = key
            part = self._part_around(volume, np.asarray(eye, float))
            if part is None:
                return volume._replace(turning=np.zeros((0, DEGREE * DEGREE, PACK), np.float32))
            return self._turning(volume, part, np.ones([end - first for first, end in part], bool))
        return volume

    def _part_around(self, volume: Volume, eye: F64) -> list[tuple[int, int]] | None:
        """Levels, rows and columns within `_AROUND` cells of an eye, if there is cloud within `_BESIDE` of it."""
        m = self.medium
        up = m.axes[..., 2, :].astype(float)
        height = np.sum((eye - m.place) * up, axis=-1)
        away = np.linalg.norm(eye - m.place - height[..., None] * up, axis=-1)
        row, column = np.unravel_index(np.argmin(away), away.shape)
        cell_m = max(m.cell_m)
        parts = []
        for cells in (_BESIDE, _AROUND):
            near = np.flatnonzero(np.abs(m.levels_m - height[row, column]) <= cells * cell_m)
            if away[row, column] > cells * cell_m or not near.size or height[row, column] < m.levels_m[0] - cell_m:
                return None  # far away, or what water mirrors
            parts.append(
                [(int(near[0]), int(near[-1]) + 1)]
                + [(max(int(n) - cells, 0), min(int(n) + cells + 1, size))
                   for n, size in zip((row, column), m.shape[1:], strict=True)]
            )  # fmt: skip
        levels, rows, columns = (slice(*bounds) for bounds in parts[0])
        cloud = volume.fields[levels, rows, columns, volume.cloud_channel]
        return parts[1] if (cloud > 0).any() else None

    def _turning(self, volume: Volume, part: Sequence[tuple[int, int]], near: NDArray[np.bool_]) -> Volume:
        """Sources at the nodes that are ``near``, in a part of the grid, as rays read them in their own direction.

        Sources toward one direction are harmonics of it, below DEGREE: as many directions tell them.
        """
        where = tuple(slice(*bounds) for bounds in part)
        count = np.count_nonzero(near)
        row = np.zeros(self.medium.shape, np.int32)
        row[where][near] = np.arange(1, count + 1)
        directions = lebedev(50).direction
        told = np.linalg.pinv(harmonic_matrix(directions, DEGREE)).astype(np.float32)
        rows = np.zeros((count + 1, DEGREE * DEGREE, PACK), np.float32)
        for some in np.split(np.arange(len(directions)), 10):
            sources = np.empty((len(some), count, PACK), np.float32)
            for source, n in zip(sources, some, strict=True):
                self._aim_part(volume, directions[n], True, part)
                source[:] = volume.fields[where][..., PACK : 2 * PACK][near]
            for a in range(1, len(rows), _TOLD):
                of_part = sources[:, a - 1 : a - 1 + _TOLD].reshape(len(some), -1)
                harmonics = (told[:, some] @ of_part).reshape(DEGREE * DEGREE, -1, PACK)
                rows[a : a + _TOLD] += np.moveaxis(harmonics, 0, 1)
        return volume._replace(turning=rows, turning_row=row)


def forward_tables(medium: Medium, fast: bool) -> F32:
    """Forward-peak tables of the species, each by what it scatters per reference extinction, then of the background
    aerosol; `swim` reads none in clouds."""
    rows = [s.phase for s in medium.species]
    if medium.air is not None:
        last = peak_tables([medium.air.aerosol_phase], DEGREE)
        clouds = peak_tables(rows, DEGREE) if rows and fast else np.zeros((len(rows), *last.shape[1:]), np.float32)
        return np.concatenate([clouds * _scattering(medium), last])
    if not rows or not fast:
        return np.zeros((len(rows) + 1, 2, 2, PACK), np.float32)
    clouds = peak_tables(rows, medium.degree) * _scattering(medium)
    return np.concatenate([clouds, np.zeros_like(clouds[:1])])


def _scattering(medium: Medium) -> F32:
    """omega per reference extinction, (ns, 1, 1, nw)."""
    rows = [s.relative_extinction * s.single_scattering_albedo for s in medium.species]
    return np.array(rows, np.float32).reshape(len(rows), 1, 1, PACK)


def coefficients_of(medium: Medium, shells: Shells, w: int, fast: bool) -> Coefficients:
    """Delta-scaled coefficients of species and air at one wavelength; `swim` keeps the full extinction."""
    scaled, scattering = [], []
    for s in medium.species:
        chi = s.phase[w].moments(medium.degree + 1)
        f = forward_share(chi, medium.degree) if fast else 0.0
        k, omega = s.relative_extinction[w], s.single_scattering_albedo[w]
        scaled.append(k * (1 - omega * f))
        scattering.append(k * omega * (chi[:-1] - f))
    air = np.zeros((len(medium.levels_m), 1 + DEGREE))
    if medium.air is not None:
        air = _on_levels(medium, shells, np.column_stack([shells.extinction[:, w], shells.scattering[:, :, w]]))
    f32 = np.float32
    return Coefficients(
        np.array(scaled, f32),
        np.array(scattering, f32).reshape(-1, medium.degree),
        air[:, 0].astype(f32),
        air[:, 1:].astype(f32),
    )


def _on_levels(medium: Medium, shells: Shells, rows: NDArray) -> F64:
    """The piecewise linear profile (nz, c) on a medium's levels that is nearest to one of the shells (nl, c).

    Its values at the levels would not do: what is linear between levels far apart has more air than there is.
    """
    node, weight = np.polynomial.legendre.leggauss(4)
    share = (0.5 + 0.5 * node)[:, None, None]
    levels, dz = medium.levels_m, np.diff(medium.levels_m)
    height = levels[:-1] + share[..., 0] * dz
    own = np.interp(np.maximum(height - shells.ground_m, 0.0), shell_levels(), np.arange(len(rows)))
    within = 0.5 * (weight[:, None] * dz)[..., None] * rows_between(np.asarray(rows, np.float32), own)
    given = np.zeros((len(levels), rows.shape[1]))
    given[:-1] += (within * (1 - share)).sum(axis=0)
    given[1:] += (within * share).sum(axis=0)
    # overlaps of the levels' hat functions
    overlap = np.zeros((2, len(levels)))
    overlap[0, 1:] = dz / 6
    overlap[1, :-1] += dz / 3
    overlap[1, 1:] += dz / 3
    nearest = np.ascontiguousarray(solveh_banded(overlap, given))
    return np.where((rows >= 0).all(axis=0), np.maximum(nearest, 0), nearest)  # also beside a haze's edge


def _forward(medium: Medium, nw: int) -> F32:
    """omega f per reference extinction (ns, nw): what delta scaling leaves in the beam."""
    rows = [
        [k * omega * forward_share(phase.moments(medium.degree + 1), medium.degree)
         for k, omega, phase in zip(s.relative_extinction, s.single_scattering_albedo, s.phase, strict=True)]
        for s in medium.species
    ]  # fmt: skip
    return np.array(rows, np.float32).reshape(len(medium.species), nw)


def sunlit_volume(
    medium: Medium, coefficients: list[Coefficients], local_sun: F64, fast: bool
) -> tuple[Volume, SunDepth]:
    """Sun sweep, and the volume with all but its sources filled in."""
    ns, nw = len(medium.species), PACK
    scaled = np.stack([c.scaled for c in coefficients], axis=-1).reshape(ns, nw)
    forward = _forward(medium, nw) if fast else np.zeros((ns, nw), np.float32)
    second = forward if fast else swim.backscatter_weights(medium)
    nz, ny, nx = medium.shape
    origin, per_m, lookup = medium.level_lookup
    # coefficients that agree within 2 % share a depth
    rows: list[F32] = []
    index: dict[str, list[int]] = {"scaled": [], "second": []}
    for name, matrix in (("scaled", scaled), ("second", second)):
        for w in range(PACK):
            same = [n for n, r in enumerate(rows) if np.allclose(r, matrix[:, w], rtol=0.02, atol=1e-6)]
            if not same:
                rows.append(matrix[:, w])
            index[name].append(same[0] if same else len(rows) - 1)
    kept = sorted(set(index["second"]))
    forward_channel = {n: 2 * PACK + ns + i for i, n in enumerate(kept)}
    cloud_channel = 2 * PACK + ns + len(kept)
    fields = blank_fields((nz, ny, nx), cloud_channel + 1)
    full = occupied(medium.extinction, medium.levels_m, medium.terrain_m)
    free = free_cubes(np.asarray(medium.extinction.any(axis=0)), medium.periodic)
    levels = np.append(medium.levels_m, 2 * medium.levels_m[-1] - medium.levels_m[-2])
    # where light is scattered or meets the ground, the way to the sun is followed exactly
    above_ground = levels[:-1, None, None] > medium.terrain_m - 2 * np.diff(levels)[:, None, None]
    exact = beside(full, medium.periodic) & above_ground
    depth = depths_to_sun(medium, np.array(rows), exact, local_sun)

    def fill(t: int, threads: int) -> None:
        for k in range(t, nz, threads):  # a level at a time stays in a cache
            for s in range(ns):
                fields[k, ..., 2 * PACK + s] = medium.extinction[s, k]
            fields[k, ..., cloud_channel] = medium.extinction[:, k].sum(axis=0)
            for n, channel in forward_channel.items():
                fields[k, ..., channel] = inside(depth[n, k])

    in_threads(fill)
    air_extinction = np.stack([c.air_extinction for c in coefficients], axis=-1)
    volume = Volume(
        medium.chart_origin_m, medium.chart_per_m, medium.chart, _sides(medium), origin, per_m, lookup,
        float(medium.levels_m[-1]), np.array(medium.cell_m, np.float32), (levels - levels[0]).astype(np.float32),
        medium.periodic, fast and medium.air is not None, *_peak_cosines(medium), ns, cloud_channel,
        free, fields, scaled, forward, np.zeros((ns, DEGREE, PACK), np.float32),
        np.array([forward_channel[n] for n in index["second"]]),
        np.zeros((nz if fast and ns else 0, ny, nx, PACK), np.float32), _relative(scaled), False,
        np.zeros((0, DEGREE * DEGREE, PACK), np.float32), np.zeros((1, 1, 1), np.int32),
        np.zeros((nz, 4 * PACK), np.float32),
        np.zeros((nz, PACK), np.float32), reach(air_extinction).astype(np.float32), medium.terrain_m,
        steepness(medium.terrain_m, medium.cell_m, medium.periodic),
    )  # fmt: skip
    return tidy(volume), SunDepth(depth, np.array(index["scaled"]))


def _relative(scaled: F32) -> F32:
    """Delta-scaled extinction of the species (ns, PACK) relative to the first wavelength's."""
    mean = scaled.mean(axis=0) if scaled.size and scaled[:, 0].any() else np.ones(PACK)
    return np.asarray(mean / mean[0], np.float32)


def _peak_cosines(medium: Medium) -> tuple[float, float]:
    """Where forward peaks are read out: they are the narrower, the more moments the smooth field has."""
    inner, outer = (DEGREE / medium.degree * np.arccos(c) for c in PEAK_COSINES)
    return float(np.cos(inner)), float(np.cos(outer))


def _sides(medium: Medium) -> F64:
    """Least and greatest x, then y, of the columns' places projected from the Earth's centre on the tangent plane."""
    radius = medium.frame.radius_m
    depth = np.maximum(radius + medium.place[..., 2:], _LEAST_DEPTH * radius)
    tangent = medium.place[..., :2] * (radius / depth)
    return np.array([end(tangent[..., axis]) for axis in range(2) for end in (np.min, np.max)])


def beams_and_shadows(
    medium: Medium, lighting: Lighting, shells: Shells, volume: Volume, depths: SunDepth,
    coefficients: list[Coefficients], local_sun: F64, sun: F64, count: int, relief: bool = False,
) -> GridLight:  # fmt: skip
    """Direct beam at the nodes and at the ground, terrain shadows included; where there is to be a relief, which casts
    its own, without them too."""
    nz, ny, nx = medium.shape
    shadow, ridge = np.full((ny, nx), -1e9), np.zeros((ny, nx))
    if not medium.periodic:
        in_threads(
            shadow_rows, medium.terrain_m, local_sun, np.array(medium.cell_m, float), medium.frame.radius_m, shadow,
            ridge,
        )  # fmt: skip
    beams = np.empty((count, nz, ny, nx), np.float32)
    surface = np.empty((count, ny, nx), np.float32)
    in_threads(
        direct_beam, *depths, local_sun, medium.levels_m, medium.terrain_m, shadow, ridge, count, shells, beams,
        surface, volume.fields,
    )  # fmt: skip
    lighting.direct[:count], lighting.direct[count:] = surface, surface[-1]
    if volume.bend.size:
        in_threads(
            bend_cells, depths.depth, int(depths.lanes[0]), coefficients[0].scaled, local_sun, medium.levels_m,
            np.array(medium.cell_m, float), volume,
        )  # fmt: skip
    if relief:
        in_threads(
            ground_beam, *depths, local_sun, medium.levels_m, medium.terrain_m, np.full((ny, nx), -1e9), ridge, count,
            shells, surface,
        )  # fmt: skip
        lighting.unshadowed = np.concatenate([surface, np.repeat(surface[-1:], PACK - count, axis=0)])
    _fill_air(volume, shells, medium, float(sun[2]))
    lighting.forward_depth = _forward_at_ground(medium, lighting, shells, volume)
    return GridLight(
        medium, [beams[min(w, count - 1)] for w in range(PACK)], None, coefficients, local_sun, sun, count,
        shadow, ridge,
    )  # fmt: skip


def _fill_air(volume: Volume, shells: Shells, medium: Medium, mu_sun: float) -> None:
    """The shells' rows on the levels, and their forward depth to the sun as above the scene's centre."""
    above = np.maximum(medium.levels_m - shells.ground_m, 0.0)
    level = np.interp(above, np.arange(len(shells.level_table)) / SHELL_TABLE_PER_M, shells.level_table)
    r_ground = shells.radius_m + shells.ground_m
    horizon = -np.sqrt(above * (2 * r_ground + above)) / (r_ground + above)
    count = shells.slant.shape[1]
    column = np.sqrt(np.clip((mu_sun - horizon) / (1 - horizon), 0, 1)) * (count - 1)
    if medium.air is not None:
        volume.air[:] = _on_levels(medium, shells, shells.rows)
    for w in range(PACK):
        volume.haze_depth[:, w] = bilinear(shells.sun_forward[..., w], column, level)


def _forward_at_ground(medium: Medium, lighting: Lighting, shells: Shells, volume: Volume) -> F32:
    """Forward depth from the ground of every column to the sun (PACK, ny, nx)."""
    node = medium.ground_node[None]
    air = forward_depth(shells, lighting.mu_sun)
    out = np.zeros((PACK, *medium.shape[1:]), np.float32)
    for w in range(PACK):
        cloud = np.take_along_axis(volume.fields[..., volume.forward_channel[w]], node, 0)[0]
        out[w] = air[..., w] + (cloud if volume.forward.any() else 0.0)
    return out
