"""A linear core of a scene: the air, gases, aerosol and phase functions that `fast` computes with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.scene.rays import Rays
from openswim.transport.air.shells import no_volume
from openswim.transport.engine.ordinates import Ordinates, ordinates_for
from openswim.transport.engine.pack import PACK
from openswim.transport.ground_light.fluxes import Lighting, sky_flux
from openswim.transport.linear.air import OfAir, air_at, air_kinds
from openswim.transport.linear.drawn import Drawn, ground_under, locate_in
from openswim.transport.linear.operator import TOLERANCE, LinearCore, State
from openswim.transport.linear.optics import Scatterer, optics_of
from openswim.transport.linear.rays import View, view_of, ways_of
from openswim.transport.linear.sun_depth import depths
from openswim.transport.linear.world import World
from openswim.transport.march.march import ground_radiance_rows, march_rays
from openswim.transport.march.volume import DEGREE, Shells
from openswim.transport.medium.coefficients import aerosol_peaks
from openswim.transport.medium.medium import Medium, build_medium
from openswim.transport.medium.plan import Fineness, MediumPlan, plan_medium
from openswim.transport.medium.surface import Surface
from openswim.transport.solve_grid import clear_inflow, shells_around

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

LEAN = 26  # ordinates, which are exact to degree 7: with products of harmonics of degrees below 4
_LOWEST_SUN = 0.02  # cosine of its zenith angle
_TILE_RAYS = 20_000  # whose places are known at once
_INSTEAD = "take solver fast; analyses need a single grid of cells of up to 1.2 km, without cloud cover"


class SceneCore(LinearCore):
    """`LinearCore` of a scene. extinction and albedo: the scene's own; ``species``: how many of the classes are on the
    scene's grid, before molecules and the background aerosol; ``drawn``: from that grid to the nodes."""

    extinction: F64
    albedo: F64
    medium: Medium
    drawn: Drawn
    species: int
    step: float
    packs: Sequence[_Pack]

    def seen(self, state: State, rays: Rays) -> F64:
        """Radiance (w, n) along other rays, which share their origin or their direction."""
        parts = [np.zeros((len(self.wavelengths_nm), 0))]
        for first in range(0, len(rays), _TILE_RAYS):
            view = _view(self.world, self.packs, rays[first : first + _TILE_RAYS], self.step)
            found = [self.observe(term, one, [view])[0][0] for term, one in enumerate(state.terms)]
            parts.append(self.terms.T @ np.stack(found))
        return np.concatenate(parts, axis=1)


@dataclass(frozen=True, eq=False)
class _Pack:
    """The clear sky around a medium at up to PACK terms; slopes (ny, nx): cosine of the sun's angle to the ground's
    normal, None where it is level."""

    medium: Medium
    shells: Shells
    table: F32
    albedo: F32
    slopes: F64 | None
    count: int

    @classmethod
    def of(cls, medium: Medium, surface: Surface, sun: F64, count: int) -> _Pack:
        lighting = Lighting.of_grid(surface, medium)
        shells, _ = shells_around(medium, medium.place, lighting, sun)
        slopes = None if lighting.terrain is None or lighting.normal is None else lighting.normal @ sun
        return cls(medium, shells, aerosol_peaks(medium.air), lighting.albedo[:count], slopes, count)

    def clear(self, origin: F64, direction: F64, sun: F64, ends: F64 | None = None) -> tuple[F64, F64]:
        """Radiance and transmission (count, n) of the clear sky along rays, as far as ``ends`` (n,) or all of the way,
        what ground there is included."""
        stops = None if ends is None else -np.maximum(ends, 1e-3)
        seen = march_rays(origin, direction, sun, self.table, self.shells, no_volume(), 1.0, ends=stops)
        radiance = seen.radiance.astype(float)
        if ends is None:
            hit = np.flatnonzero(seen.distance_m >= 0)
            place = origin[hit] + direction[hit] * seen.distance_m[hit, None]
            radiance[hit] += seen.scaled[hit] * ground_radiance_rows(place, sun, self.shells)
        return radiance.T[: self.count], seen.scaled.astype(float).T[: self.count]


def core_of(
    options: Options, matter: Matter, surface: Surface, sun: F64, views: Sequence[Rays] = (),
    points: ArrayLike | None = None, tolerance: float | None = None, memory: int = 3,
    ordinates: Ordinates | None = None, lean: bool = False, element: type[np.floating] = np.float64,
) -> SceneCore:  # fmt: skip
    """The core of matter over ground, lit from ``sun`` (3,). views: rays of an eye each; points (n, 2): latitude and
    longitude of pyranometers, in flat scenes y and x, m. ordinates: others than `fast` takes; lean: `LEAN` of them,
    and 16 moments in place of 25. element: of what numbers sweeps reckon with."""
    sun = np.asarray(sun, float) / np.linalg.norm(sun)
    plan = _plan(options, matter, surface, sun)
    count, packs = matter.wavelengths_nm.size, []
    for first in range(0, count, PACK):
        which = np.minimum(np.arange(first, first + PACK), count - 1)
        ground = surface.at_wavelengths(which)
        packs.append(_Pack.of(build_medium(plan, matter.at(which), ground), ground, sun, min(PACK, count - first)))
    medium, terms = packs[0].medium, matter.terms
    wanted = LEAN if lean else options.setting.ordinates
    ordinates = ordinates or ordinates_for(medium.cell_m, medium.levels_m, wanted)
    inflow = np.concatenate(
        [np.moveaxis(clear_inflow(p.medium, p.shells, sun, ordinates), -1, 0)[: p.count] for p in packs]
    ).astype(float)
    world = World(
        medium.levels_m.astype(float), medium.cell_m, medium.axes.astype(float), medium.place, sun, medium.ground_node,
        ordinates, DEGREE - 1 if lean else DEGREE, inflow, np.zeros((count, medium.shape[0])),
    )  # fmt: skip
    world = replace(world, inflow=np.ascontiguousarray(inflow[:, world.order]))
    if float(world.local_sun[..., 2].min()) < _LOWEST_SUN:
        raise UserError("solver linear: the sun is below 1.2 degrees in the grid; take another time or solver fast")
    if packs[0].slopes is not None:
        world = replace(world, slope_sun=np.maximum(packs[0].slopes.ravel(), 0.0))
    species, airs = list(matter.species), []
    for p in packs:
        if p.medium.air is not None:
            airs += [air_at(p.medium, p.medium.air, p.shells, world.local_sun[..., 2], w) for w in range(p.count)]
    kinds = [Scatterer(s.name, s.single_scattering_albedo, s.phase) for s in species]
    if airs:
        kinds += air_kinds(airs)
        world = _with_air(world, airs, kinds[-2:], packs)
    if not kinds:
        raise UserError("solver linear: the scene has neither cloud nor air; take solver fast")
    share = np.zeros((count, terms.wavelengths_nm.size))
    share[np.arange(count), terms.which] = terms.weight
    eyes = [_view(world, packs, rays, options.step) for rays in views]
    at = None if points is None else _on_the_ground(medium, points)
    core = SceneCore(
        world, kinds, eyes, at, terms.wavelengths_nm, share, tolerance or TOLERANCE, memory, element=element
    )  # fmt: skip
    core.medium, core.drawn, core.species = medium, Drawn.of(medium, plan), len(species)
    core.step, core.packs = options.step, packs
    firsts = [int(np.flatnonzero(terms.which == w)[0]) for w in range(terms.wavelengths_nm.size)]
    core.albedo = np.concatenate([pack.albedo for pack in packs])[firsts].astype(float)
    core.extinction = np.zeros((len(firsts), len(kinds), *medium.shape))
    for n, one in enumerate(species):
        relative = one.relative_extinction[firsts][:, None, None, None]
        core.extinction[:, n] = relative * core.drawn.to_nodes(one.extinction_per_m.astype(float))
    for w, term in enumerate(firsts):
        if airs:
            core.extinction[w, len(species) :] = airs[term].extinction[:, :, None, None]
    return core


def _plan(options: Options, matter: Matter, surface: Surface, sun: F64) -> MediumPlan:
    """How the grid is drawn: on the scene's own columns, with levels as fine as `fast` has them."""
    if matter.grid is None:
        raise UserError("solver linear: the scene has no grid; take solver fast")
    if matter.cover is not None:
        raise UserError(
            "solver linear: cloud cover within cells is not followed: take solver fast; for an analysis leave it out, "
            "so that clouds fill their cells, by cover = false in its file, or in Python by "
            'scene.data = scene.data.drop_vars("cloud_area_fraction")'
        )
    if matter.grid.periodic or matter.wider is not None:
        raise UserError(f"solver linear: periods and nested grids are not followed; {_INSTEAD}")
    plan = plan_medium(matter, surface.terrain_m, float(sun[2]), Fineness(divide=False, extend=True))
    if plan.fineness > 1 or plan.sideless or min(plan.columns) < 2:
        _, rows, columns = matter.grid.shape
        raise UserError(
            f"solver linear: {columns} x {rows} columns of {min(matter.grid.spacing_m()):.0f} m are too wide, or too "
            f"few; {_INSTEAD}"
        )
    return plan


def _with_air(world: World, airs: list[OfAir], kinds: list[Scatterer], packs: Sequence[_Pack]) -> World:
    """With the air's gas, the depths to the sun that the shells have besides those through the grid's own air, and the
    clear sky's flux that ordinates miss."""
    depth, forward = np.empty((2, len(airs), *world.shape))
    for term, air in enumerate(airs):
        optics = optics_of(kinds, term, world.degree)
        both = np.stack([optics.scaled @ air.extinction, optics.forward @ air.extinction], axis=-1)
        own = depths(world, np.repeat(both, world.columns, axis=0)).reshape(*world.shape, 2)
        depth[term], forward[term] = air.sun_depth - own[..., 0], air.sun_forward - own[..., 1]
    lowest, share = int(world.ground_node.min()), world.weight[: world.down] * world.direction[: world.down, 2]
    told = world.inflow[:, : world.down, lowest] @ share / (4 * np.pi)
    known = np.concatenate([sky_flux(p.shells, world.mu_sun)[:, : p.count].T for p in packs])  # at every column
    beam = np.exp(-np.stack([air.sun_depth.reshape(-1)[world.ground_nodes] for air in airs]))
    return replace(
        world, gas=np.stack([one.gas for one in airs]), more_depth=depth, more_forward=forward,
        more_per_beam=(known - told[:, None]) / np.maximum(beam, 1e-6),
    )  # fmt: skip


def _view(world: World, packs: Sequence[_Pack], rays: Rays, step: float) -> View:
    """Rays through the grid, with the clear sky before it and behind it."""
    medium = packs[0].medium
    finest = max(medium.cloud_top_m, float(medium.terrain_m.max()))
    ways = ways_of(world, rays, locate_in(medium), ground_under(medium), finest, step)
    origin, direction = np.array(rays.origins(), float), np.array(rays.directions(), float)
    front, dim, back = (np.zeros((0, len(rays))) for _ in range(3))
    far, within = ways.leave[:, None] * direction + origin, ways.leave > ways.enter
    for pack in packs:
        one, two, three = np.zeros((pack.count, len(rays))), np.ones((pack.count, len(rays))), None
        before = np.flatnonzero(within & (ways.enter > 1e-2))
        if before.size:
            one[:, before], two[:, before] = pack.clear(
                origin[before], direction[before], world.sun, ways.enter[before]
            )  # fmt: skip
        three = pack.clear(np.where(within[:, None], far, origin), direction, world.sun)[0]
        front, dim, back = np.concatenate([front, one]), np.concatenate([dim, two]), np.concatenate([back, three])
    return view_of(world, rays, ways, front, dim, back)


def _on_the_ground(medium: Medium, points: ArrayLike) -> F64:
    """Rows and columns (n, 2) of latitudes and longitudes, in flat scenes of y and x; raises UserError outside."""
    given = np.asarray(points, float)
    if given.size and (given.ndim != 2 or given.shape[1] != 2):
        kinds = "latitude and longitude" if medium.frame.curved else "y and x"
        raise UserError(f"points have shape {given.shape}: give (n, 2), {kinds} of each pyranometer")
    given = given.reshape(-1, 2)
    if medium.frame.curved:
        places = medium.frame.position(given[:, 0], given[:, 1], 0.0)
    else:
        places = np.stack([given[:, 1], given[:, 0], 0 * given[:, 0]], axis=-1)
    at = np.stack(medium.indices(places)[::-1], axis=-1)
    inside = ((at >= -0.5) & (at <= np.array(medium.shape[1:]) - 0.5)).all(axis=1)
    if not inside.all():
        north, east = given[~inside][0]
        raise UserError(f"points: the pyranometer at {north:g}, {east:g} is outside of the grid")
    return at
