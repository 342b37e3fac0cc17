"""The light of one grid: from matter and ground to a field that has no eye yet."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.lights.eclipses import MoonShadow
from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.progress import job
from openswim.transport.air.dimmed import Eclipse, eclipse_of
from openswim.transport.air.shells import build_shells, clear_radiance
from openswim.transport.beam.lit_volume import Sunlight, beams_and_shadows, sunlit_volume
from openswim.transport.beam.wider_shadow import DepthsAround, shade_from
from openswim.transport.columns.columns import (
    clear_beam,
    columns_of_grid,
    fluxes_of_columns,
    light_from_above,
)
from openswim.transport.columns.discrete_ordinates import solve_layers
from openswim.transport.diffuse import multigrid as two_grids
from openswim.transport.diffuse import spectral
from openswim.transport.diffuse import sweeper as diffuse
from openswim.transport.diffuse.absorbed_beam import beam_around
from openswim.transport.diffuse.earlier import EarlierLight, Start
from openswim.transport.diffuse.inflow import (
    Clear,
    GroundLight,
    SweptAround,
    clear_down_flux,
    light_through_sides,
    some_columns,
)
from openswim.transport.diffuse.moments import Moments
from openswim.transport.diffuse.optical_grid import at_another_wavelength, optical_grid
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.ordinates import LEVEL, Ordinates, level_zone, ordinates_for
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.scratch import Pool
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import Lighting, clear_sky_table
from openswim.transport.ground_light.landscape import landscape_of
from openswim.transport.lit.lit_grid import CLEAR_REACH_DEG, GridLight, LitGrid
from openswim.transport.march.volume import Shells, blank_fields
from openswim.transport.medium.coefficients import coefficients_of, forward_tables
from openswim.transport.medium.core import Core
from openswim.transport.medium.medium import Medium, build_medium
from openswim.transport.medium.open_sides import open_sides
from openswim.transport.medium.surface import Surface
from openswim.transport.plan import Plan
from openswim.transport.swim import light as swim

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_WITHIN_ZONE = 4  # directions in which a level ordinate looks out of the grid
_TWILIGHT_MU = 0.03  # cosine of the sun's zenith angle below which clear air is swept by itself: above it misses 1 %
_NARROWEST = 0.5  # of its height, a period's width without air: in less level light goes round too often


class Solved(NamedTuple):
    """A grid's light, and what grids within it ask for before they are solved."""

    lit: LitGrid
    depths: DepthsAround


def light_of_grid(
    options: Options, plan: Plan, pack: int, matter: Matter, surface: Surface, sun: F64, count: int,
    around: Solved | None, shadow: MoonShadow | None = None, earlier: EarlierLight | None = None, name: str = "",
) -> Solved:  # fmt: skip
    """Light of one grid at a ``pack`` of wavelengths: sun sweep, then the diffuse sweeps (`fast`) or Eqs 4-8 (`swim`);
    ``around``: a wider grid. earlier: what the last solve of this ``name`` has left."""
    started = time.perf_counter()
    fast = options.name == "fast"
    frame, wl = matter.frame, matter.wavelengths_nm
    wider = None if around is None else around.lit
    drawn = plan.medium
    assert drawn is not None
    medium = build_medium(drawn, matter, surface)
    landscape = landscape_of(surface, medium, None if wider is None else wider.landscape)
    lighting = Lighting.of_grid(surface, medium)
    lighting.place_sun(sun)
    shells, reach = shells_around(medium, medium.place, lighting, sun)
    eclipse = eclipse_of(shadow, sun, wl, shells, medium.air)
    sunlit, dimmed = shells, None
    if eclipse is not None:
        dimmed = eclipse.dimmed
        shells = dimmed.of(sunlit)
    timings = {"air": time.perf_counter() - started}
    started = time.perf_counter()
    local_sun = np.einsum("jiab,b->jia", medium.axes.astype(float), sun)
    coefficients = [coefficients_of(medium, shells, w, fast) for w in range(PACK)]
    volume, channels, depths = sunlit_volume(
        medium, coefficients, local_sun, plan.of_all_packs(), plan.decisions(pack),
        None if fast else swim.backscatter_weights(medium),
    )  # fmt: skip
    if around is not None:
        shade_from(around.depths, medium, channels, depths, local_sun)
    timings["sun"] = time.perf_counter() - started
    started = time.perf_counter()
    table = forward_tables(medium, fast)
    sunlight = Sunlight(coefficients, local_sun, sun)
    beams = beams_and_shadows(
        medium, lighting, sunlit, volume, channels, depths, sunlight, count, landscape is not None, dimmed
    )
    light = GridLight(medium, *beams, coefficients, local_sun, sun, count)
    if fast and not drawn.layered:
        volume = volume._replace(single=np.stack([c.scattering for c in coefficients], axis=-1))
    ends = np.full((2, 2), not matter.cut and not medium.periodic)
    if wider is not None:  # where that ends, too
        ends &= open_sides(medium, wider.medium) & wider.ends
    sweeps: list[list[int]] = []
    if fast and drawn.layered:
        light = _with_layers(light, lighting)
    elif fast and drawn.stands_alone:
        beyond = None if around is None else around.depths.medium
        light = _with_columns(light, channels.beam, lighting, shells, sun, beyond)
    elif fast:
        volume = volume._replace(per_extinction=True)
        start = None if earlier is None else earlier.begin(name, medium.shape[1:])
        light, sweeps = _with_moments(
            options, plan.decisions(pack), light, lighting, shells, wl, ends, _swept(wider), eclipse, start
        )
        if earlier is not None and start is not None:
            earlier.keep(name, start)
    else:
        volume = swim.light_grid(light, volume, channels, lighting, shells, local_sun, sun)
    timings["diffuse"] = time.perf_counter() - started
    lit = LitGrid(
        options, surface, matter.air, frame, sun, wl, count, shells, volume, table, lighting, medium, light, channels,
        float(reach), landscape, wider, None if wider is None else Core.of(medium), ends, sweeps, timings,
        eclipse, decide=plan.decisions(pack).within("view"),
    )  # fmt: skip
    return Solved(lit, DepthsAround(medium, depths))


def _swept(wider: LitGrid | None) -> SweptAround | None:
    """The wider grid around one, if its light is known at its nodes."""
    if wider is None or wider.light is None or not wider.light.moments:
        return None
    assert wider.medium is not None
    return SweptAround(wider.medium, wider.light.moments, wider.light.coarser)


def _with_columns(
    light: GridLight, beam: F32, lighting: Lighting, shells: Shells, sun: F64, wider: Medium | None
) -> GridLight:
    """The light of wide cells, every column by itself."""
    count = light.count
    above = light_from_above(light.medium, light.coefficients, shells, count)
    columns = columns_of_grid(
        light.medium, light.coefficients, lighting, light.local_sun, above, count, False, wider
    )
    fluxes_of_columns(columns, beam, lighting)
    lighting.clear_sky = clear_sky_table(shells, sun)
    return replace(light, columns=columns)


def _with_layers(light: GridLight, lighting: Lighting) -> GridLight:
    """The light of a scene without sides, at every wavelength."""
    count = light.count
    extinction = light.medium.extinction[:, :, 0, 0].astype(float)
    every = []
    for w in range(count):
        c = light.coefficients[w]
        layers = solve_layers(
            light.medium.levels_m, c.scaled @ extinction, (c.scattering.T @ extinction).T,
            light.beams[w][:, 0, 0].astype(float), light.sun, float(lighting.albedo[w, 0, 0]),
            float(lighting.flux_for_sweeps(w)[0, 0]),
        )  # fmt: skip
        every.append(layers)
        lighting.diffuse[w], lighting.up_top[w] = layers.down, layers.up
    lighting.diffuse[count:], lighting.up_top[count:] = lighting.diffuse[count - 1], lighting.up_top[count - 1]
    return replace(light, layers=every)


def clear_inflow(
    medium: Medium, shells: Shells, sun: F64, ordinates: Ordinates, eclipse: Eclipse | None = None
) -> F32:
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
    radiance = clear_radiance(origin, direction, sun, shells, 1.0)
    if eclipse is not None:
        radiance = np.maximum(radiance + eclipse.dimmed.from_around(origin, direction, eclipse.lit), 0).astype(FLOAT)
    radiance = radiance.reshape(len(way), nz, PACK)
    of_level = radiance[count:].reshape(len(nodes), len(level), nz, PACK)
    radiance[level] = np.tensordot(0.5 * shares, of_level, 1)
    return radiance[:count]


def _with_moments(
    options: Options, decide: Decisions, light: GridLight, lighting: Lighting, shells: Shells, wl: F64,
    ends: NDArray[np.bool_], wider: SweptAround | None, eclipse: Eclipse | None, start: Start | None,
) -> tuple[GridLight, list[list[int]]]:
    """Coarse-to-fine sweeps of every wavelength; with their counts, from the coarsest grid on. ``ends``:
    `OpticalGrid`."""
    medium, sun, count = light.medium, light.sun, light.count
    nz, ny, nx = medium.shape
    setting = options.setting
    width_m, height_m = min(ny * medium.cell_m[1], nx * medium.cell_m[0]), float(np.ptp(medium.levels_m))
    airy = medium.air is not None
    if medium.periodic and not airy and width_m < _NARROWEST * height_m:
        raise UserError(
            f"a period of {width_m:.0f} m without air is narrow for its height of {height_m:.0f} m: repeat it until it "
            f"is {math.ceil(_NARROWEST * height_m)} m wide, or use solver 'reference'"
        )
    ordinates = ordinates_for(medium.cell_m, medium.levels_m, setting.ordinates, medium.periodic and airy)
    inflow = clear_inflow(medium, shells, sun, ordinates, eclipse)
    traces: list[two_grids.Trace] | None = None
    found: dict[int, spectral.Known] = {}
    first = optical_grid(
        medium.extinction_above_ground, np.moveaxis(light.sun_harmonics, 0, 1), medium.levels_m,
        np.array(medium.cell_m, float), medium.periodic, ends, medium.ground_node, light.coefficients[0],
        light.beams[0],
    )  # fmt: skip
    first = first.decided(decide)
    pool = Pool()
    plane_parallel = (ny, nx) == (1, 1)
    twilight = airy and not medium.periodic and min(ny, nx) > 1 and wider is None and float(sun[2]) < _TWILIGHT_MU
    found_clear: dict[int, F32] = {}
    if twilight:
        there = _clear_beam_over(light, shells, count)
    beams, on_ground = clear_beam(medium.levels_m, sun[None, None], shells, count, blank_fields((nz, 1, 1), 2 * PACK))
    with job("diffuse light", count) as meter:
        for w in spectral.in_order(wl[:count]):
            c = light.coefficients[w]
            grid = at_another_wavelength(first, c, light.beams[w])
            grid = grid._replace(beam=beam_around(grid))
            enters = np.ascontiguousarray(inflow[..., w])
            ground = GroundLight(lighting.albedo_for_sweeps(w), lighting.flux_for_sweeps(w))
            sides = None
            on_clear = float(on_ground[w, 0, 0]) * max(float(sun[2]), 0.0)
            clear = Clear(enters, beams[w, :, 0, 0], float(lighting.mean_albedo[w]), on_clear)
            if twilight:
                found_clear[w] = clear_down_flux(
                    grid, clear, there[0][w], there[1][w], ordinates, setting.tolerance, decide.within("clear")
                )
            if not ends.all() and not medium.periodic:
                sides = light_through_sides(
                    wider, medium, grid, clear, ground, ordinates, setting.tolerance, w, decide.within("sides")
                )
            of_this = decide.within("wavelength")
            sweeper = diffuse.Sweeper.of(grid, enters, *ground, ordinates, pool, sides, of_this)
            properties = spectral.properties_of(sweeper)
            if start is not None and not found:
                start.compare(sweeper)
            others = spectral.on_both_sides(float(wl[w]), properties, list(found.values()), of_this)
            if plane_parallel:
                values, _, n = sweeper.solve(sweeper.nothing(), 0.002 * setting.tolerance, 400, 12)
                solution = two_grids.Solution(
                    Moments(sweeper.place, values), sweeper.coarser, [n], [], sweeper.fluxes(), sweeper.ratio
                )
            elif others:
                solution = spectral.between(sweeper, setting.tolerance, options.most_sweeps, traces, others, start, w)
            else:
                solution = two_grids.coarse_to_fine(
                    sweeper, setting.tolerance, options.most_sweeps, traces,
                    # in periods coarse grids leave too much undone for what lies between to be told
                    tell=count > 2 and not medium.periodic, start=start, wavelength=w,
                )
            traces = traces or solution.traces
            if not others:
                diffuse.of_nodes(solution.moments.values, solution.ratio)
            found[w] = spectral.Known(float(wl[w]), properties, solution)
            meter.advance()
    solutions = [found[min(w, count - 1)].solution for w in range(PACK)]
    for w, solution in enumerate(solutions):
        lighting.diffuse[w], lighting.up_top[w] = solution.fluxes
    missing = [found_clear[min(w, count - 1)] for w in range(PACK)] if twilight else []
    lighting.correct_quadrature(ordinates, inflow, shells, sun, medium, light.coefficients[0].scaled, ends, missing)
    solved = replace(
        light, moments=[solution.moments for solution in solutions],
        coarser=[solution.coarser for solution in solutions], ratios=[solution.ratio for solution in solutions],
    )  # fmt: skip
    return solved, [solution.sweeps for solution in solutions[:count]]


def _clear_beam_over(light: GridLight, shells: Shells, count: int) -> tuple[F32, F32]:
    """The beam (count, nz, rows, columns) in clear air over `some_columns`, each under its own sun, and its flux on the
    ground there."""
    nz, *shape = light.medium.shape
    suns = light.local_sun[some_columns((shape[0], shape[1]))]
    every = suns.reshape(1, -1, 3)
    beams, on_ground = clear_beam(
        light.medium.levels_m, every, shells, count, blank_fields((nz, 1, every.shape[1]), 2 * PACK)
    )
    flux = on_ground.reshape(count, *suns.shape[:2]) * np.maximum(suns[..., 2], 0)
    return beams.reshape(count, nz, *suns.shape[:2]), flux.astype(FLOAT)


def shells_around(medium: Medium, place: F32 | F64, lighting: Lighting, sun: F64) -> tuple[Shells, float]:
    """The air around a medium whose columns stand at ``place`` (..., 3), for all suns over it; and the angle at the
    Earth's centre, degrees, to which these reach."""
    radius_m = medium.frame.radius_m
    reach = CLEAR_REACH_DEG + float(np.degrees(np.arccos(1 + place[..., 2].min() / radius_m)))
    top = float(medium.levels_m[-1]) if medium.air is None else medium.ground_m + 1e5
    suns = sun_range(sun, reach)
    return build_shells(medium.air, suns, radius_m, medium.ground_m, lighting.mean_albedo, top), reach


def sun_range(sun: F64, reach_deg: float) -> tuple[float, float]:
    """Zenith angles, degrees, of the suns over what lies within an angle at the Earth's centre."""
    zenith = float(np.degrees(np.arccos(np.clip(sun[2], -1, 1))))
    return max(0.0, zenith - reach_deg), min(110.0, zenith + reach_deg)
