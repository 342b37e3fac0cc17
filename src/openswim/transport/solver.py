"""Solver: from a scene and a sun to a field of light, which serves every camera.

`Field.view` turns it into what rays see; only that repeats from camera to camera.
"""

from __future__ import annotations

import math
import os
import time
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, shown, whole
from openswim.errors import UserError
from openswim.optics.species import for_wavelengths
from openswim.progress import job
from openswim.scene.frame import Frame, scene_frame
from openswim.scene.scene import Scene
from openswim.transport.air.shells import build_shells, clear_radiance, no_volume
from openswim.transport.columns.columns import clear_beam, columns_of_grid, light_from_above, stand_alone
from openswim.transport.columns.discrete_ordinates import solve_layers
from openswim.transport.diffuse import multigrid as two_grids
from openswim.transport.diffuse import spectral
from openswim.transport.diffuse import sweeper as diffuse
from openswim.transport.diffuse.absorbed_beam import beam_around
from openswim.transport.diffuse.inflow import Clear, light_through_sides
from openswim.transport.diffuse.moments import Moments
from openswim.transport.diffuse.optical_grid import at_another_wavelength, optical_grid
from openswim.transport.engine.ordinates import LEVEL, Ordinates, level_zone, ordinates_for
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.scratch import Pool
from openswim.transport.field import CLEAR_REACH_DEG, CLEAR_STEP, Field, PackField
from openswim.transport.ground_light.fluxes import Lighting, clear_sky_table
from openswim.transport.ground_light.landscape import landscape_of
from openswim.transport.march.forward_peak import peak_tables
from openswim.transport.march.volume import DEGREE, Shells, Volume, blank_fields
from openswim.transport.medium.medium import Medium, air_of, build_medium, halved_medium, with_air_above, with_soft_top
from openswim.transport.montecarlo.reference import ReferenceField, solve_reference
from openswim.transport.options import SETTINGS, Quality
from openswim.transport.swim import light as swim
from openswim.transport.view.beyond_sides import Beyond
from openswim.transport.view.nested import Core, shade_from
from openswim.transport.view.tiled import lit_in_parts, solve_large
from openswim.transport.view.toward_eye import (
    GridLight,
    beams_and_shadows,
    coefficients_of,
    forward_tables,
    sunlit_volume,
)

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NAMES = ("swim", "fast", "reference")
_WITHIN_ZONE = 4  # directions in which a level ordinate looks out of the grid
_NARROWEST = 0.5  # of its height, a period's width without air: in less level light goes round too often


@dataclass(frozen=True)
class Solver:
    """How light is solved for.

    name: "fast" (sweeps, the default), "swim" (Albers et al. 2020) or "reference" (Monte Carlo).
    step: eye-ray step in cells.
    detail: whether near eyes see more than is known: with "fast" in clouds of a model's liquid water below its grid
    (docs/decisions/0017; what a scene has as extinction never is refined), with "fast" and "swim" on land below its
    maps (docs/decisions/0020).

    Of "fast" alone: quality, "preview", "standard" or "high" (docs/solvers.md); tolerance: in place of the quality's,
    change of the field, relative, at which sweeps end, or 1.6 times what seems to follow; .02, the standard's, leaves
    about 1 % of fluxes and, where cells are thick (optical depth 3), up to 5 % of an image (RMSE).

    Of "reference" alone: paths per ray (default 256); target_error: mean standard error over mean radiance, and
    seconds of CPU time per view, at which to stop sooner; seed of all chances; checkpoint: file to stop and go on with.
    """

    name: str = "fast"
    quality: str = "standard"
    tolerance: float | None = None
    step: float = 1.0
    most_sweeps: int = 60
    detail: bool = True
    paper_phases: bool = False
    paths: int | None = None
    seed: int = 0
    target_error: float | None = None
    seconds: float | None = None
    checkpoint: str | os.PathLike[str] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or self.name not in NAMES:
            raise UserError(f"unknown solver {shown(self.name)}: choose one of {', '.join(NAMES)}")
        for check, options in ((number, ("step", "tolerance", "target_error", "seconds")),
                               (whole, ("most_sweeps", "seed", "paths"))):  # fmt: skip
            for option in options:
                if getattr(self, option) is not None or getattr(type(self), option) is not None:
                    check(option, getattr(self, option))
        given = [self.paths, self.target_error, self.seconds, self.checkpoint]
        if self.name != "reference" and (self.seed or any(option is not None for option in given)):
            raise UserError("paths, seed, target_error, seconds and checkpoint belong to solver 'reference'")
        if not isinstance(self.quality, str) or self.quality not in SETTINGS:
            raise UserError(f"unknown quality {shown(self.quality)}: choose one of {', '.join(SETTINGS)}")
        if self.quality != "standard" and self.name != "fast":
            raise UserError(f"quality belongs to solver 'fast'; leave it out with {self.name!r}")
        if not 0 < self.step < np.inf:
            raise UserError(f"step = {self.step:g}: give a positive number of cells, such as 1")
        if self.tolerance is not None and not 0 < self.tolerance < np.inf:
            raise UserError(f"tolerance = {self.tolerance:g}: give a positive share of the light, such as 0.02")
        if self.most_sweeps < 1:
            raise UserError(f"most_sweeps = {self.most_sweeps}: give at least 1")
        if self.seconds is not None and not self.seconds > 0:
            raise UserError(f"seconds = {self.seconds:g}: give a positive time")
        if self.paths is not None and self.paths < 2:
            raise UserError(f"paths = {self.paths}: give at least 2 per pixel, or there is no error to tell")
        if self.target_error is not None and not 0 < self.target_error < 1:
            raise UserError(f"target_error = {self.target_error:g}: give a share of the radiance, such as 0.01")
        if not 0 <= self.seed < 2**31:
            raise UserError(f"seed = {self.seed}: give a whole number from 0 to 2147483647")

    @property
    def setting(self) -> Quality:
        """What the quality stands for, with the tolerance that was asked for."""
        setting = SETTINGS[self.quality]
        return setting if self.tolerance is None else setting._replace(tolerance=self.tolerance)

    def solve(
        self,
        scene: Scene,
        sun_direction: ArrayLike,
        wavelengths_nm: ArrayLike = (615.0, 546.0, 450.0),
    ) -> Field | ReferenceField:
        """Solve the field of light of ``scene`` lit from ``sun_direction`` (unit vector in the scene frame)."""
        sun = np.asarray(sun_direction, float)
        sun = sun / np.linalg.norm(sun)
        wl = np.atleast_1d(np.asarray(wavelengths_nm, float))
        if wl.size == 0 or not np.isfinite(wl).all() or (wl < 280).any() or (wl > 2500).any():
            raise UserError("wavelengths must lie between 280 and 2500 nm")
        scene = for_wavelengths(scene, wl)
        if self.name == "reference":
            if scene.wider is not None:
                warnings.warn("solver reference sees the innermost of nested grids alone", stacklevel=2)
            return solve_reference(self, scene, sun, wl)
        parts = [wl[a : a + PACK] for a in range(0, wl.size, PACK)]
        solve = _clear_field if scene.grid is None else solve_large if lit_in_parts(scene) else _nested_field
        packs = [solve(self, scene, sun, np.pad(part, (0, PACK - part.size), "edge"), part.size) for part in parts]
        for pack in packs[1:]:
            pack.landscape = packs[0].landscape  # which keeps what it has built
        return Field(packs)


def _sun_range(sun: F64, reach_deg: float) -> tuple[float, float]:
    zenith = float(np.degrees(np.arccos(np.clip(sun[2], -1, 1))))
    return max(0.0, zenith - reach_deg), min(110.0, zenith + reach_deg)


def _clear_field(solver: Solver, scene: Scene, sun: F64, wl: F64, count: int) -> PackField:
    """Field of a scene without a grid: the shells are all."""
    started = time.perf_counter()
    frame = scene_frame(scene)
    lighting = Lighting.of_clear_scene(scene, frame, wl)
    air = air_of(scene, wl, lighting.ground_m)
    shells = build_shells(
        air, _sun_range(sun, CLEAR_REACH_DEG), frame.radius_m, lighting.ground_m, lighting.mean_albedo, DEGREE,
        lighting.ground_m + 1e5, 1.5 * CLEAR_STEP,
    )  # fmt: skip
    table = peak_tables([air.aerosol_phase], DEGREE) if air else np.zeros((1, 2, 2, PACK), np.float32)
    lighting.light_clear(shells, sun)
    return PackField(
        solver, scene, frame, sun, wl, count, shells, no_volume(), table, lighting,
        timings={"sun": 0.0, "diffuse": time.perf_counter() - started},
    )  # fmt: skip


def _nested_field(solver: Solver, scene: Scene, sun: F64, wl: F64, count: int) -> PackField:
    """Field of a scene with a grid, and of the wider scenes around it, the widest first."""
    frame = scene_frame(scene)
    found = None
    for level in reversed(scene.levels):
        found = _grid_field(solver, level, frame, sun, wl, count, found, level is scene.levels[0])
    assert found is not None
    for field in found.levels:
        field.depths = None
    return found


def _grid_field(
    solver: Solver, scene: Scene, frame: Frame, sun: F64, wl: F64, count: int, wider: PackField | None, innermost: bool
) -> PackField:
    """Field of one grid: sun sweep, then the diffuse sweeps (`fast`) or Eqs 4-8 (`swim`)."""
    started = time.perf_counter()
    fast = solver.name == "fast"
    setting = solver.setting
    medium = build_medium(scene, wl, float(sun[2]), refine=fast, divide=setting.divide, frame=frame)
    if fast and setting.halved and not medium.divided and not stand_alone(medium):
        medium = halved_medium(scene, medium)
    if fast:
        medium = with_air_above(with_soft_top(medium))
    landscape = landscape_of(scene, medium)
    lighting = Lighting.of_grid(scene, medium)
    lighting.place_sun(sun)
    reach = CLEAR_REACH_DEG + float(np.degrees(np.arccos(1 + medium.place[..., 2].min() / frame.radius_m)))
    top = float(medium.levels_m[-1]) if medium.air is None else medium.ground_m + 1e5
    shells = build_shells(
        medium.air, _sun_range(sun, reach), frame.radius_m, medium.ground_m, lighting.mean_albedo, DEGREE, top
    )
    timings = {"air": time.perf_counter() - started}
    started = time.perf_counter()
    local_sun = np.einsum("jiab,b->jia", medium.axes.astype(float), sun)
    coefficients = [coefficients_of(medium, shells, w, fast) for w in range(PACK)]
    volume, depths = sunlit_volume(medium, coefficients, local_sun, fast)
    if wider is not None:
        shade_from(wider, medium, volume, depths, local_sun)
    timings["sun"] = time.perf_counter() - started
    started = time.perf_counter()
    table = forward_tables(medium, fast)
    light = beams_and_shadows(
        medium, lighting, shells, volume, depths, coefficients, local_sun, sun, count,
        landscape is not None,
    )  # fmt: skip
    result = PackField(solver, scene, frame, sun, wl, count, shells, volume, table, lighting, medium, timings)
    result.landscape = landscape
    result.light = light
    result.reach_deg = float(reach)
    result.depths = None if innermost else depths
    del depths  # large, and nothing to the sweeps
    if wider is not None:
        result.wider, result.core = wider, Core.of(medium)
        if landscape is not None:
            landscape.wider = wider.landscape
    if fast and not medium.layered:
        result.volume = volume._replace(single=np.stack([c.scattering for c in coefficients], axis=-1))
    if fast and medium.layered:
        _light_layers(light, lighting, sun, count)
    elif fast and stand_alone(medium):
        _light_columns(light, volume, lighting, shells, local_sun, sun, wider is None)
    elif fast:
        ends = wider is None and not scene.cut and not medium.periodic
        result.volume = result.volume._replace(per_extinction=True)
        result.sweeps = _diffuse(solver, light, lighting, shells, sun, wl, count, ends, wider)
        if wider is None and not medium.periodic:
            result.beyond = Beyond(light, shells, ends)
    else:
        swim.light_grid(light, volume, lighting, shells, local_sun, sun)
    timings["diffuse"] = time.perf_counter() - started
    return result


def _light_columns(
    light: GridLight, volume: Volume, lighting: Lighting, shells: Shells, local_sun: F64, sun: F64, ends: bool
) -> None:  # fmt: skip
    """The light of wide cells, every column by itself; aimed once, for the fluxes."""
    count = light.count
    inflow, lacking = light_from_above(light.medium, light.coefficients, shells, count)
    light.columns = columns_of_grid(
        light.medium, light.coefficients, lighting, local_sun, inflow, lacking, count, False, ends
    )
    light.aim(volume, np.array([0.0, 0.0, -1.0]), True)
    lighting.diffuse[count:], lighting.up_top[count:] = lighting.diffuse[count - 1], lighting.up_top[count - 1]
    lighting.clear_sky = clear_sky_table(shells, sun)


def _light_layers(light: GridLight, lighting: Lighting, sun: F64, count: int) -> None:
    """The light of a scene without sides, at every wavelength."""
    extinction = light.medium.extinction[:, :, 0, 0].astype(float)
    light.layers = []
    for w in range(count):
        c = light.coefficients[w]
        layers = solve_layers(
            light.medium.levels_m, c.scaled @ extinction, (c.scattering.T @ extinction).T,
            light.beams[w][:, 0, 0].astype(float), sun, float(lighting.albedo[w, 0, 0]),
            float(lighting.direct_horizontal(w)[0, 0]),
        )  # fmt: skip
        light.layers.append(layers)
        lighting.diffuse[w], lighting.up_top[w] = layers.down, layers.up
    lighting.diffuse[count:], lighting.up_top[count:] = lighting.diffuse[count - 1], lighting.up_top[count - 1]


def _inflow(medium: Medium, shells: Shells, sun: F64, ordinates: Ordinates) -> F32:
    """Radiance (ordinate, nz, nw) of the clear atmosphere entering the grid along each ordinate at each level.

    A level ordinate brings the mean of what it stands for, above and below the horizon, which is brightest
    (docs/decisions/0026-level-ordinates.md).
    """
    nz, ny, nx = medium.shape
    axes = medium.axes[ny // 2, nx // 2].astype(float)
    count = len(ordinates.direction)
    level = np.flatnonzero(np.abs(ordinates.direction[:, 2]) < LEVEL)
    # no node of the rule is level itself
    nodes, shares = np.polynomial.legendre.leggauss(_WITHIN_ZONE)
    z = np.repeat(level_zone(ordinates) * nodes, len(level))
    across = np.tile(ordinates.direction[level, :2], (len(nodes), 1)) * np.sqrt(1 - z * z)[:, None]
    way = np.concatenate([ordinates.direction, np.column_stack([across, z])])
    direction = np.repeat(way @ axes, nz, axis=0)
    height = np.tile(np.maximum(medium.levels_m, shells.ground_m + 0.5), len(way))
    origin = np.stack([0 * height, 0 * height, height], axis=-1)
    radiance = clear_radiance(origin, direction, sun, shells, 1.0).reshape(len(way), nz, PACK)
    of_level = radiance[count:].reshape(len(nodes), len(level), nz, PACK)
    radiance[level] = np.tensordot(0.5 * shares, of_level, 1)
    return radiance[:count]


def _diffuse(
    solver: Solver, light: GridLight, lighting: Lighting, shells: Shells, sun: F64, wl: F64, count: int, ends: bool,
    wider: PackField | None,
) -> list[list[int]]:
    """Coarse-to-fine sweeps of every wavelength; their counts, from the coarsest grid on. ``ends``: `OpticalGrid`."""
    medium = light.medium
    nz, ny, nx = medium.shape
    setting = solver.setting
    width_m, height_m = min(ny * medium.cell_m[1], nx * medium.cell_m[0]), float(np.ptp(medium.levels_m))
    if medium.periodic and medium.air is None and width_m < _NARROWEST * height_m:
        raise UserError(
            f"a period of {width_m:.0f} m without air is narrow for its height of {height_m:.0f} m: repeat it until it "
            f"is {math.ceil(_NARROWEST * height_m)} m wide, or use solver 'reference'"
        )
    ordinates = ordinates_for(
        medium.cell_m, medium.levels_m, setting.ordinates, medium.periodic and medium.air is not None
    )
    inflow = _inflow(medium, shells, sun, ordinates)
    traces: list[two_grids.Trace] | None = None
    found: dict[int, spectral.Known] = {}
    first = optical_grid(
        medium.extinction_above_ground, np.moveaxis(light.sun_harmonics, 0, 1), medium.levels_m,
        np.array(medium.cell_m, float), medium.periodic, ends, medium.ground_node, light.coefficients[0],
        light.beams[0],
    )  # fmt: skip
    pool = Pool()
    plane_parallel = (ny, nx) == (1, 1)
    beams, on_ground = clear_beam(medium.levels_m, sun[None, None], shells, count, blank_fields((nz, 1, 1), 2 * PACK))
    with job("diffuse light", count) as meter:
        for w in spectral.in_order(wl[:count]):
            c = light.coefficients[w]
            grid = at_another_wavelength(first, c, light.beams[w])
            grid = grid._replace(beam=beam_around(grid))
            enters, direct = np.ascontiguousarray(inflow[..., w]), lighting.direct_horizontal(w)
            albedo = lighting.albedo_for_sweeps(w)
            sides = None
            if not ends and not medium.periodic:
                on_clear = float(on_ground[w, 0, 0]) * max(float(sun[2]), 0.0)
                clear = Clear(enters, beams[w, :, 0, 0], float(lighting.mean_albedo[w]), on_clear)
                sides = light_through_sides(
                    wider, medium, grid, clear, albedo, direct, ordinates, setting.tolerance, w
                )
            sweeper = diffuse.Sweeper.of(grid, enters, albedo, direct, ordinates, pool, sides)
            properties = spectral.properties_of(sweeper)
            others = spectral.on_both_sides(float(wl[w]), properties, list(found.values()))
            if plane_parallel:
                values, _, n = sweeper.solve(sweeper.nothing(), 0.002 * setting.tolerance, 400, 12)
                solution = two_grids.Solution(
                    Moments(sweeper.place, values), sweeper.coarser, [n], [], sweeper.fluxes(), sweeper.ratio
                )
            elif others:
                solution = spectral.between(sweeper, setting.tolerance, solver.most_sweeps, traces, others)
            else:
                solution = two_grids.coarse_to_fine(
                    sweeper, setting.tolerance, solver.most_sweeps, traces,
                    # in periods coarse grids leave too much undone for what lies between to be told
                    tell=count > 2 and not medium.periodic,
                )
            traces = traces or solution.traces
            if not others:
                diffuse.of_nodes(solution.moments.values, solution.ratio)
            found[w] = spectral.Known(float(wl[w]), properties, solution)
            meter.advance()
    solutions = [found[min(w, count - 1)].solution for w in range(PACK)]
    light.moments = [solution.moments for solution in solutions]
    light.coarser = [solution.coarser for solution in solutions]
    light.ratios = [solution.ratio for solution in solutions]
    for w, solution in enumerate(solutions):
        lighting.diffuse[w], lighting.up_top[w] = solution.fluxes
    lighting.correct_quadrature(ordinates, inflow, shells, sun)
    return [solution.sweeps for solution in solutions[:count]]
