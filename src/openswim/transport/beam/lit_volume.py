"""The sun's beam at every node of a grid, and the volume that rays march through, all but its sources filled in."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.air.dimmed import Dimmed
from openswim.transport.beam.depth_basis import factors_of, mixtures
from openswim.transport.beam.direct import direct_beam, ground_beam, shadow_rows
from openswim.transport.beam.sun_sweep import inside, sun_sweep, weighted
from openswim.transport.beam.within_cells import bent
from openswim.transport.engine.compiled import kernel
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import Lighting, forward_depth
from openswim.transport.march.empty_space import beside, free_cubes, occupied, steepness
from openswim.transport.march.forward_peak import forward_share
from openswim.transport.march.volume import (
    DEGREE,
    LINE,
    PEAK_COSINES,
    SHELL_TABLE_PER_M,
    Shells,
    Volume,
    blank_fields,
    tidy,
)
from openswim.transport.medium.coefficients import on_levels
from openswim.transport.medium.delta_scaled import Coefficients
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SHADOW_STEP_M = 3000.0  # between places where the moon's shadow is looked at
_LEAST_DEPTH = 0.01  # cosine of the angle from the scene's origin at which its grid ends


class Channels(NamedTuple):
    """What `Volume.fields` are to hold of a grid but its species and its sources toward an eye, on the nodes (nz, ny,
    nx).

    beam (..., PACK): root of the delta-scaled beam, air included; forward_depth (n, ...): depths to the sun, as
    `Volume.forward_factors` sums them; source (..., PACK): where it is alike to all eyes, as with "swim".
    """

    beam: F32
    forward_depth: F32
    source: F32 | None = None


def with_fields(volume: Volume, medium: Medium, channels: Channels) -> Volume:
    """The volume with its nodes' channels filled in, without sources but those that are alike to all eyes."""
    nz = medium.shape[0]
    fields = blank_fields(medium.shape, volume.cloud_channel + 1)
    matter = np.require(medium.extinction, FLOAT, ["C", "W"])  # as kernels are compiled for it

    def fill(t: int, threads: int) -> None:
        for k in range(t, nz, threads):  # a level at a time stays in a cache
            fields[k, ..., :PACK] = channels.beam[k]
            if channels.source is not None:
                fields[k, ..., PACK : 2 * PACK] = channels.source[k]
            forward = np.ascontiguousarray(channels.forward_depth[:, k])
            _fill_level(k, matter, forward, volume.cloud_channel, fields)

    in_threads(fill)
    return volume._replace(fields=fields)


@kernel()
def _fill_level(k, extinction, forward_depth, cloud_channel, fields):
    """Species (ns, nz, ny, nx), forward depths (n, ny, nx) and the species' sum of level k into its nodes' channels:
    node after node, since whoever goes channel by channel goes through all of the memory for each."""
    ns, _, ny, nx = extinction.shape
    for j in range(ny):
        for i in range(nx):
            total = FLOAT(0.0)
            for s in range(ns):
                fields[k, j, i, 2 * PACK + s] = extinction[s, k, j, i]
                total += extinction[s, k, j, i]
            for n in range(forward_depth.shape[0]):
                fields[k, j, i, 2 * PACK + ns + n] = forward_depth[n, j, i]
            fields[k, j, i, cloud_channel] = total


class SunDepth(NamedTuple):
    """Optical depths to the sun of few mixtures of the species, of which those at all wavelengths are sums.

    The latter are delta-scaled ones, then those of `Volume.forward`; the first mixture is that of the first of them.
    """

    depth: F32  # of the mixtures, see `sun_sweep`
    factors: F32  # (mixtures, 2 PACK)
    stands_for: NDArray[np.int64]  # which of the depths each mixture has
    told: NDArray[np.int64]  # wavelengths of which `Volume` knows the forward depth

    @property
    def scaled(self) -> F32:
        """``factors`` (mixtures, PACK) of the delta-scaled depths."""
        return np.ascontiguousarray(self.factors[:, :PACK])

    def forward(self, k: int) -> F32:
        """The forward depths (n, ny, nx) that a volume is to know on level ``k``."""
        return np.einsum("mn,mji->nji", self.factors[:, PACK + self.told], inside(self.depth[:, k]))


class Sunlight(NamedTuple):
    """The sun over a grid: what dims it at every wavelength, and the direction to it (3,), in the columns' axes
    local_sun (ny, nx, 3)."""

    coefficients: list[Coefficients]
    local_sun: F64
    sun: F64


class Beams(NamedTuple):
    """The sun's beam (nz, ny, nx) at every wavelength, and on the columns (ny, nx) where the terrain ends its way:
    height below which there is shadow, and distance of the ridge that casts it, m."""

    beams: list[F32]
    shadow_m: F64
    ridge_m: F64


def depths_to_sun(medium: Medium, weights: F32, exact: NDArray[np.bool_], local_sun: F64) -> F32:
    """`sun_sweep` of a medium, a field for each row of ``weights`` (n, ns) of its species."""
    extinction = weighted(medium.extinction, weights, medium.periodic)
    return sun_sweep(
        extinction, exact, local_sun, medium.levels_m, medium.level_lookup, np.array(medium.cell_m, float),
        medium.frame.radius_m, medium.periodic,
    )  # fmt: skip


def _forward(medium: Medium, nw: int) -> F32:
    """omega f per reference extinction (ns, nw): what delta scaling leaves in the beam."""
    rows = [
        [k * omega * forward_share(phase.moments(medium.degree + 1), medium.degree)
         for k, omega, phase in zip(s.relative_extinction, s.single_scattering_albedo, s.phase, strict=True)]
        for s in medium.species
    ]  # fmt: skip
    return np.array(rows, FLOAT).reshape(len(medium.species), nw)


def sunlit_volume(
    medium: Medium, coefficients: list[Coefficients], local_sun: F64, decide: Decisions, decide_for_pack: Decisions,
    backscatter: F32 | None = None,
) -> tuple[Volume, Channels, SunDepth]:  # fmt: skip
    """Sun sweep, the volume without what stands at its nodes, and channels for that, with depths of what delta scaling
    leaves in the beam, or, where ``backscatter`` (ns, nw) is given, of that per reference extinction in its place.

    ``decide`` what no wavelength changes, ``decide_for_pack`` the rest.
    """
    fast = backscatter is None
    ns, nw = len(medium.species), PACK
    scaled = np.stack([c.scaled for c in coefficients], axis=-1).reshape(ns, nw)
    forward = _forward(medium, nw) if fast else np.zeros((ns, nw), FLOAT)
    second = forward if backscatter is None else backscatter
    nz, ny, nx = medium.shape
    origin, per_m, lookup = medium.level_lookup
    extinction = np.concatenate([scaled, second], axis=1)
    mixed = decide_for_pack("mixtures", lambda: mixtures(extinction))
    most = 1 + -(2 * PACK + ns + 2) % LINE  # as many as have room beside the rest
    told = decide_for_pack("forward depths", lambda: mixtures(second, most))
    cloud_channel = 2 * PACK + ns + len(told)
    free = decide("free", lambda: free_cubes(np.asarray(medium.extinction.any(axis=0)), medium.periodic))
    levels = np.append(medium.levels_m, 2 * medium.levels_m[-1] - medium.levels_m[-2])
    exact = np.unpackbits(decide("exact", lambda: np.packbits(_exact(medium, levels))), count=nz * ny * nx)
    weights = np.ascontiguousarray(extinction[:, mixed].T)
    depth = depths_to_sun(medium, weights, exact.view(bool).reshape(nz, ny, nx), local_sun)
    depths = SunDepth(depth, factors_of(extinction, mixed), mixed, told)
    del exact
    nodes = (nz, ny, nx, PACK)
    channels = Channels(
        np.empty(nodes, FLOAT), np.empty((len(told), nz, ny, nx), FLOAT), None if fast else np.empty(nodes, FLOAT)
    )

    def fill(t: int, threads: int) -> None:
        for k in range(t, nz, threads):
            channels.forward_depth[:, k] = depths.forward(k)

    in_threads(fill)
    volume = Volume(
        medium.chart_origin_m, medium.chart_per_m, medium.chart, _sides(medium), origin, per_m, lookup,
        float(medium.levels_m[-1]), np.array(medium.cell_m, FLOAT), (levels - levels[0]).astype(FLOAT),
        medium.periodic, fast and medium.air is not None, *_peak_cosines(medium), ns, cloud_channel,
        free, blank_fields((1, 1, 1), 1), scaled, forward, np.zeros((ns, DEGREE, PACK), FLOAT),
        factors_of(second, told), np.zeros((nz if fast and ns else 0, ny, nx, PACK), FLOAT), False,
        np.zeros((0, DEGREE * DEGREE, PACK), FLOAT), np.zeros((1, 1, 1), np.int32),
        np.zeros((nz, 4 * PACK), FLOAT),
        np.zeros((nz, PACK), FLOAT), medium.terrain_m,
        steepness(medium.terrain_m, medium.cell_m, medium.periodic),
    )  # fmt: skip
    return tidy(volume), channels, depths


def _exact(medium: Medium, levels_m: F64) -> NDArray[np.bool_]:
    """Nodes (nz, ny, nx) where light is scattered or meets the ground, from which the way to the sun is followed
    exactly; ``levels_m`` (nz + 1,)."""
    full = occupied(medium.extinction, medium.levels_m, medium.terrain_m)
    above_ground = levels_m[:-1, None, None] > medium.terrain_m - 2 * np.diff(levels_m)[:, None, None]
    return np.asarray(beside(full, medium.periodic) & above_ground)


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
    medium: Medium, lighting: Lighting, shells: Shells, volume: Volume, channels: Channels, depths: SunDepth,
    sunlight: Sunlight, count: int, relief: bool = False, dimmed: Dimmed | None = None,
) -> Beams:  # fmt: skip
    """Direct beam at the nodes and at the ground, terrain shadows included; where there is to be a relief, which casts
    its own, without them too. Its roots go into ``channels``. dimmed: the moon's shadow, of which the shells know
    nothing."""
    coefficients, local_sun, sun = sunlight
    nz, ny, nx = medium.shape
    shadow, ridge = np.full((ny, nx), -1e9), np.zeros((ny, nx))
    if not medium.periodic:
        in_threads(
            shadow_rows, medium.terrain_m, local_sun, np.array(medium.cell_m, float), medium.frame.radius_m, shadow,
            ridge,
        )  # fmt: skip
    beams = np.empty((count, nz, ny, nx), FLOAT)
    surface = np.empty((count, ny, nx), FLOAT)
    in_threads(
        direct_beam, depths.depth, depths.scaled, local_sun, medium.levels_m, medium.terrain_m, shadow, ridge, count,
        shells, beams, surface, channels.beam,
    )  # fmt: skip
    lighting.direct[:count], lighting.direct[count:] = surface, surface[-1]
    if volume.bend.size:
        bent(volume, medium, depths.depth[0], coefficients[0].scaled, local_sun, rooted=True)
    if relief:
        in_threads(
            ground_beam, depths.depth, depths.scaled, local_sun, medium.levels_m, medium.terrain_m,
            np.full((ny, nx), -1e9), ridge, count, shells, surface,
        )  # fmt: skip
        lighting.unshadowed = np.concatenate([surface, np.repeat(surface[-1:], PACK - count, axis=0)])
    if dimmed is not None:
        _dim(dimmed, medium, channels, beams, [lighting.direct, lighting.unshadowed])
    _fill_air(volume, shells, medium, float(sun[2]))
    lighting.forward_depth = _forward_at_ground(medium, lighting, shells, volume, channels)
    return Beams([beams[min(w, count - 1)] for w in range(PACK)], shadow, ridge)


def _dim(dimmed: Dimmed, medium: Medium, channels: Channels, beams: F32, surfaces: list[F32 | None]) -> None:
    """Take from the beam at nodes (count, nz, ny, nx) and on surfaces (PACK, ny, nx) what the moon takes."""
    _, ny, nx = medium.shape
    up = medium.axes[..., 2, :].astype(float)
    rows, columns = (_lattice(n, cell) for n, cell in zip((ny, nx), medium.cell_m[::-1], strict=True))
    lowest, highest = min(float(medium.terrain_m.min()), medium.levels_m[0]), float(medium.levels_m[-1])
    heights = np.linspace(lowest, highest, 2 + int((highest - lowest) / _SHADOW_STEP_M))
    some = np.ix_(rows[0], columns[0])
    place = medium.place[some] + heights[:, None, None, None] * up[some]
    left = dimmed.left(place.reshape(-1, 3)).reshape(*place.shape[:3], PACK)
    left = _between(rows[1], columns[1], left)

    def at(height_m: Any) -> F64:
        """Share (PACK, ny, nx) at heights above sea level, one for all or (ny, nx)."""
        level = np.clip((height_m - lowest) / (heights[1] - heights[0]), 0, len(heights) - 1)
        k = np.minimum(np.asarray(level, int), len(heights) - 2)
        if np.ndim(k) == 0:
            return np.asarray(left[:, k] + (level - k) * (left[:, k + 1] - left[:, k]))
        low, high = (np.take_along_axis(left, np.broadcast_to(n, (PACK, 1, ny, nx)), 1)[:, 0] for n in (k, k + 1))
        return np.asarray(low + (level - k) * (high - low))

    for k, height in enumerate(medium.levels_m):
        share = at(float(height))
        channels.beam[k] *= np.moveaxis(np.sqrt(share), 0, -1)
        beams[:, k] *= share[: len(beams)]
    on_ground = at(medium.terrain_m.astype(float))
    for surface in surfaces:
        if surface is not None:
            surface *= on_ground


def _between(rows: F64, columns: F64, values: F64) -> F64:
    """Values (h, some, some, w) of `_lattice` at all nodes (w, h, ny, nx): along one axis, then along the other, since
    both at once are as many products as there are pairs of columns."""
    return np.asarray(rows @ (np.moveaxis(values, -1, 0) @ columns.T))


def _lattice(nodes: int, cell_m: float) -> tuple[NDArray[np.int64], F64]:
    """Some of so many nodes along an axis, the first and the last with them, and by how much (nodes, some) each lies
    between which."""
    some = np.unique(np.linspace(0, nodes - 1, 1 + math.ceil((nodes - 1) * cell_m / _SHADOW_STEP_M)).astype(int))
    hats = np.eye(len(some))
    return some, np.stack([np.interp(np.arange(nodes), some, hat) for hat in hats], axis=-1)


def _fill_air(volume: Volume, shells: Shells, medium: Medium, mu_sun: float) -> None:
    """The shells' rows on the levels, and their forward depth to the sun as above the scene's centre."""
    above = np.maximum(medium.levels_m - shells.ground_m, 0.0)
    level = np.interp(above, np.arange(len(shells.level_table)) / SHELL_TABLE_PER_M, shells.level_table)
    r_ground = shells.radius_m + shells.ground_m
    horizon = -np.sqrt(above * (2 * r_ground + above)) / (r_ground + above)
    count = shells.slant.shape[1]
    column = np.sqrt(np.clip((mu_sun - horizon) / (1 - horizon), 0, 1)) * (count - 1)
    if medium.air is not None:
        volume.air[:] = on_levels(medium, shells, shells.rows)
    for w in range(PACK):
        volume.haze_depth[:, w] = bilinear(shells.sun_forward[..., w], column, level)


def _forward_at_ground(
    medium: Medium, lighting: Lighting, shells: Shells, volume: Volume, channels: Channels
) -> F32:  # fmt: skip
    """Forward depth from the ground of every column to the sun (PACK, ny, nx)."""
    air = forward_depth(shells, lighting.mu_sun)
    out = np.zeros((PACK, *medium.shape[1:]), FLOAT)
    told = np.take_along_axis(channels.forward_depth, medium.ground_node[None, None], 1)[:, 0]
    cloud = np.tensordot(volume.forward_factors.T, told, 1)
    for w in range(PACK):
        out[w] = air[..., w] + (cloud[w] if volume.forward.any() else 0.0)
    return out
