"""The diffuse light of wide cells: every column on its own, under the sun's beam that all of them share.

Cells of kilometres are so much wider than the way light diffuses in cloud that little passes between columns. What
does not is solved without sweeps (`column_solve.py`), and the eye sees of each cell what its thin parts send up
(`column_light.py`). docs/decisions/0013-large-domains.md, 0016-wide-cells.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.air.shells import clear_radiance, rows_between
from openswim.transport.beam.direct import direct_beam
from openswim.transport.beam.sun_sweep import beyond_sides
from openswim.transport.columns.column_light import Bounds, Found, Wanted, column_light
from openswim.transport.columns.spherical_harmonics import harmonics_of_mode, mode_tables
from openswim.transport.engine.eye_ways import Eye
from openswim.transport.engine.pack import LANES, PACK
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import Lighting, sky_flux
from openswim.transport.march.sample import SOURCE_AZIMUTHS, SOURCE_ZENITHS
from openswim.transport.march.volume import DEGREE, SHELL_TABLE_PER_M, Shells, blank_fields
from openswim.transport.medium.delta_scaled import Coefficients
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.open_sides import open_sides
from openswim.transport.medium.scatterers import Scatterers

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_DIFFUSIVITY = 1.66  # of diffuse light's way through a layer, over its thickness
_AZIMUTHS = np.cos((np.arange(4) + 0.5) * np.pi / 4)


class FromAbove(NamedTuple):
    """Light that columns have of the air above, and of clear air that which they do not find by themselves, under the
    shells' suns."""

    inflow: F32  # (count, suns, 2) see `top_light`
    lacking: F32  # (count, nz, suns, ways) see `what_clear_air_lacks`
    sun_table: F64  # fractional index into these suns, see `Shells.moment_sun_table`
    missed: F32  # (count, suns) of a clear sky's diffuse flux at the ground: in twilight it comes in nearly level

    def missed_at(self, mu_sun: F64) -> F32:
        """``missed`` (count, ...) by cosines of the sun's zenith angle (...)."""
        place = np.interp(mu_sun.ravel(), np.linspace(-1, 1, self.sun_table.size), self.sun_table)
        return rows_between(self.missed.T, place).T.reshape(-1, *mu_sun.shape).astype(FLOAT)


@dataclass
class Columns:
    """The light of a grid's columns: all that `column_light` asks for but the eye, and where it writes fluxes."""

    medium: Medium
    coefficients: list[Coefficients]
    ground_node: NDArray[np.int64]
    local_sun: F64
    mu_sun: F64
    albedo: F32
    direct: F32
    above: FromAbove
    count: int
    half_m: F64 = field(default_factory=lambda: np.zeros((2, 2)))  # of cells at open sides, beyond their nodes
    once: bool = True  # whether the nodes' sources hold what is scattered once; else the march adds it

    def aim(
        self, fields: F32, eye: F64 | None, parallel: bool, part: Sequence[tuple[int, int]], down: F32 | None = None,
        up: F32 | None = None,
    ) -> None:  # fmt: skip
        """Fill the source channels for one eye in ``part``; where there is none, ``fields`` need no channels but the
        beam's. Fluxes, which are alike to all eyes, go into ``down`` and ``up`` (PACK or count, ny, nx): see
        `column_light`."""
        down = np.empty_like(self.direct) if down is None else down
        up = np.empty_like(self.direct) if up is None else up
        m = self.medium
        bounds = Bounds(
            self.ground_node, np.ascontiguousarray(np.moveaxis(self.local_sun, -1, 1), FLOAT), self.mu_sun,
            self.albedo, self.direct, *self.above[:3], self.half_m,
        )  # fmt: skip
        in_threads(
            column_light, Scatterers.of(m, self.coefficients[: self.count]), bounds, mode_tables(),
            Eye.of(m.axes, m.place, np.zeros(3) if eye is None else eye, parallel),
            Wanted(self.count, eye is not None, self.once, np.array(part, np.int64)),
            Found(fields, down, up),
        )  # fmt: skip


def fluxes_of_columns(columns: Columns, beam: F32, lighting: Lighting) -> None:
    """The fluxes of columns into ``lighting``; beam: of `Channels`."""
    count, (_, ny, nx) = columns.count, columns.medium.shape
    columns.aim(beam, None, True, [(0, ny), (0, nx)], lighting.diffuse, lighting.up_top)
    sky_seen = np.exp(-_DIFFUSIVITY * _cloud_depth(columns.medium, columns.coefficients[0].scaled))
    lighting.diffuse[:count] += sky_seen * columns.above.missed_at(columns.mu_sun)
    lighting.diffuse[count:], lighting.up_top[count:] = lighting.diffuse[count - 1], lighting.up_top[count - 1]


def _cloud_depth(medium: Medium, scaled: F32) -> F32:
    """Delta-scaled optical depth (ny, nx) of all species."""
    steps = np.diff(medium.levels_m)
    share = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    weights = (scaled[:, None] * share).astype(FLOAT)
    return np.tensordot(weights, medium.extinction, 2)


def columns_of_grid(
    medium: Medium, coefficients: list[Coefficients], lighting: Lighting, local_sun: F64, above: FromAbove, count: int,
    once: bool, wider: Medium | None = None,
) -> Columns:  # fmt: skip
    """`Columns` of a medium, which may lie in that of a ``wider`` grid."""
    direct = np.stack([lighting.flux_for_sweeps(w) for w in range(count)])
    albedo = np.stack([lighting.albedo_for_sweeps(w) for w in range(count)])
    return Columns(
        medium, coefficients, np.minimum(medium.ground_node, len(medium.levels_m) - 2), local_sun, lighting.mu_sun,
        albedo, direct, above, count,
        0.5 * open_sides(medium, wider) * np.array(medium.cell_m, float)[:, None], once,
    )  # fmt: skip


def light_from_above(medium: Medium, coefficients: list[Coefficients], shells: Shells, count: int) -> FromAbove:
    """Of a medium below shells."""
    mu_sun = _sun_cosines(shells)
    inflow = top_light(shells, float(medium.levels_m[-1]), mu_sun, count)
    nothing = FromAbove(
        inflow, np.zeros((count, len(medium.levels_m), mu_sun.size, 2), FLOAT), shells.moment_sun_table,
        np.zeros((count, mu_sun.size), FLOAT),
    )  # fmt: skip
    if medium.air is None:
        return nothing
    lacking, missed = what_clear_air_lacks(medium, coefficients, shells, nothing, mu_sun)
    return nothing._replace(lacking=lacking, missed=missed)


def _sun_cosines(shells: Shells) -> F64:
    """Of the shells' suns (suns,), ascending."""
    table = shells.moment_sun_table
    return np.interp(np.arange(len(shells.ground_flux)), table, np.linspace(-1, 1, table.size))


def what_clear_air_lacks(
    medium: Medium, coefficients: list[Coefficients], shells: Shells, above: FromAbove, mu_sun: F64
) -> tuple[F32, F32]:
    """What the clear air of the shells scatters toward an eye, by the zenith cosine from -1 to 1 of the eye's way, less
    what its columns are found to (count, nz, suns, ways), 1/m; and the diffuse flux at its ground, likewise (count,
    suns).

    Four harmonics do not hold the light that runs level through thin air: over dark water 2-5 % of all that is seen
    from above, 3-9 % of a clear sky from the ground. Means over azimuth.
    """
    levels = medium.levels_m
    nz, suns, count = len(levels), mu_sun.size, len(above.inflow)
    mu = np.pad(mu_sun, (0, max(LANES - suns, 0)), "edge")  # as many columns as are solved at once
    sun = np.stack([np.sqrt(1 - mu**2), 0 * mu, mu], axis=-1)[None]
    fields = blank_fields((nz, 1, mu.size), 2 * PACK)
    _, surface = clear_beam(levels, sun, shells, count, fields)
    node = np.full((1, mu.size), min(int((levels < shells.ground_m - 0.01).sum()), nz - 2), np.int64)
    albedo = np.broadcast_to(shells.ground_albedo[:count, None, None], surface.shape).astype(FLOAT)
    alone = replace(
        medium, extinction=np.zeros((1, nz, 1, mu.size), FLOAT), place=np.zeros((1, mu.size, 3)),
        axes=np.tile(np.eye(3, dtype=FLOAT), (1, mu.size, 1, 1)),
    )  # fmt: skip
    column = Columns(
        alone, [_air_alone(c) for c in coefficients], node, sun, mu[None], albedo,
        (surface * np.maximum(mu, 0)).astype(FLOAT), above, count,
    )  # fmt: skip
    height_m = np.maximum(levels - shells.ground_m, 0.0)
    level = np.interp(height_m, np.arange(len(shells.level_table)) / SHELL_TABLE_PER_M, shells.level_table)
    cosines, down = np.linspace(-1, 1, SOURCE_AZIMUTHS), np.empty_like(column.direct)
    out = np.empty((count, nz, suns, SOURCE_ZENITHS), FLOAT)
    for n, z in enumerate(np.linspace(-1, 1, SOURCE_ZENITHS)):
        table = shells.source[:, :, n, :, :count]  # (nl, suns, azimuths, count)
        known = rows_between(table.reshape(len(table), -1), level).reshape(nz, suns, SOURCE_AZIMUTHS, count)
        found, meant = np.zeros((nz, suns, count)), np.zeros((nz, suns, count))
        for x in _AZIMUTHS if abs(z) < 1 else _AZIMUTHS[:1]:
            at = np.interp(x, cosines, np.arange(SOURCE_AZIMUTHS))
            low = min(int(at), SOURCE_AZIMUTHS - 2)
            meant += known[:, :, low] + (at - low) * (known[:, :, low + 1] - known[:, :, low])
            side = np.sqrt(1 - z * z)
            way = np.array([side * x, side * np.sqrt(1 - x * x), z])
            column.aim(fields, way, True, [(0, n) for n in fields.shape[1:3]], down)
            found += fields[:, 0, :suns, PACK : PACK + count]
        ways = len(_AZIMUTHS) if abs(z) < 1 else 1
        out[..., n] = np.moveaxis((meant - found) / ways, -1, 0)
    return out, (sky_flux(shells, mu_sun)[:, :count].T - down[:, 0, :suns]).astype(FLOAT)


def clear_beam(levels_m: F64, sun: F64, shells: Shells, count: int, fields: F32) -> tuple[F32, F32]:
    """The beam in columns of clear air under suns (1, n, 3): at the levels (count, nz, 1, n) and on the ground
    (count, 1, n); its root into ``fields``, as `direct_beam` has it."""
    nz, n = len(levels_m), sun.shape[1]
    beams, surface = np.empty((count, nz, 1, n), FLOAT), np.empty((count, 1, n), FLOAT)
    in_threads(
        direct_beam, beyond_sides(1, (nz, 1, n)), np.zeros((1, PACK), FLOAT), sun, levels_m,
        np.full((1, n), shells.ground_m, FLOAT), np.full((1, n), -1e9), np.zeros((1, n)), count, shells, beams,
        surface, fields,
    )  # fmt: skip
    return beams, surface


def _air_alone(one: Coefficients) -> Coefficients:
    """Without any species, but for one of which there is nothing."""
    return replace(one, scaled=np.zeros(1, FLOAT), scattering=np.zeros((1, DEGREE), FLOAT))


def top_light(shells: Shells, top_m: float, mu_sun: F64, count: int) -> F32:
    """What the clear air above ``top_m`` sends down, for cosines (suns,) of the sun's zenith angle (count, suns, 2):
    its half-range integrals with P1 and P3."""
    x, weight = np.polynomial.legendre.leggauss(6)
    mu, weight = (x + 1) / 2, weight / 2
    azimuth = (np.arange(8) + 0.5) * np.pi / 8
    z, phi = (a.ravel() for a in np.meshgrid(mu, azimuth, indexing="ij"))
    direction = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=-1)
    origin = np.tile([0.0, 0.0, max(top_m, shells.ground_m + 1.0)], (len(z), 1))
    tests = harmonics_of_mode(mu, 0)[[1, 3]] * weight
    out = np.zeros((count, mu_sun.size, 2), FLOAT)
    for n, cosine in enumerate(mu_sun):
        sun = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
        radiance = clear_radiance(origin, direction, sun, shells, 1.0)[:, :count].reshape(mu.size, azimuth.size, count)
        out[:, n] = (tests @ radiance.mean(axis=1)).T
    return out
