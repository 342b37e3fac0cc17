"""Field: solved light, and what rays see of it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.optics.matter import Air
from openswim.options import Options
from openswim.progress import job
from openswim.scene.frame import Frame
from openswim.scene.rays import Rays
from openswim.transport.air.shells import build_shells
from openswim.transport.beam.lit_volume import SunDepth
from openswim.transport.engine.pack import PACK
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.march.cloud_detail import NO_DETAIL, Detail, detail_of, first_wavelength_m
from openswim.transport.march.detail_step import widest_m
from openswim.transport.march.forward_peak import blunted
from openswim.transport.march.march import march_rays
from openswim.transport.march.volume import DEGREE, FAR_M, Shells, Volume
from openswim.transport.medium.medium import Medium, air_of
from openswim.transport.medium.surface import Surface
from openswim.transport.plan import Plan
from openswim.transport.swim import view as swim_view
from openswim.transport.view import nested
from openswim.transport.view.nested import Core, Seen
from openswim.transport.view.shading import shade
from openswim.transport.view.toward_eye import GridLight

if TYPE_CHECKING:
    from openswim.transport.ground_light.landscape import Landscape
    from openswim.transport.ground_light.relief import Relief
    from openswim.transport.view.beyond_sides import Beyond
    from openswim.transport.view.mirror import Mirrored

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

CLEAR_REACH_DEG = 14.0  # from the ground to the horizon of an eye 14 km up, and through the air beyond
CLEAR_STEP = 0.5  # where there is but air, views are cheap and haze may be stepped finely
_TILE_RAYS = 1_200_000
_AUREOLE_DEG = 10.0  # as far as one facet of a wave is from the next, or a little farther


@dataclass
class View:
    """What rays see: solar-relative ``radiance`` (n, nw); ``transmittance`` e^-tau along the ray (n, nw); where they
    ``hit`` the ground (n,) and at which ``position`` (n, 3); optical depth (n, ns) of the finest grid's species."""

    radiance: F32
    transmittance: F32
    hit: NDArray[np.bool_]
    position: F64
    distance_m: F64
    species_depth: F32
    samples: int


@dataclass
class Field:
    """The solved light of a scene; `view` turns it into radiance along rays. Wavelengths are held in packs."""

    packs: list[PackField]
    plan: Plan | None = None  # what was decided: another scene solved by it gives light that differs by values alone

    @property
    def _first(self) -> PackField:
        return self.packs[0]

    @property
    def solver(self) -> Options:
        return self._first.solver

    @property
    def quality(self) -> str:
        return self._first.quality

    @property
    def frame(self) -> Frame:
        return self._first.frame

    @property
    def medium(self) -> Medium | None:
        return self._first.medium

    @property
    def media(self) -> list[Medium]:
        """The media of the grid and of the wider ones around it."""
        return [level.medium for level in self._first.levels if level.medium is not None]

    @property
    def ground_m(self) -> float:
        """Height of the ground outside the grid."""
        return self._first.lighting.ground_m

    @property
    def landscape(self) -> Landscape | None:
        """The shape of the ground around the grid's nodes and beyond them, where it is known."""
        return self._first.landscape

    @property
    def wavelengths_nm(self) -> F64:
        return np.concatenate([p.wavelengths_nm[: p.count] for p in self.packs])

    @property
    def timings(self) -> dict[str, float]:
        """Seconds of each stage, summed over packs and nested grids: air, sun, diffuse, view (the last one)."""
        out: dict[str, float] = {}
        for pack in (level for each in self.packs for level in each.levels):
            for name, seconds in pack.timings.items():
                out[name] = out.get(name, 0.0) + seconds
        return out

    def view(self, rays: Rays, more: bool = False) -> View:
        """Radiance along rays; memory is bounded by tiling over them. ``more`` of the last ones: what water mirrors to
        their eye is not looked at again."""
        views = [pack.view(rays, more) for pack in self.packs]
        first = views[0]
        return replace(
            first,
            radiance=np.concatenate([v.radiance for v in views], axis=1),
            transmittance=np.concatenate([v.transmittance for v in views], axis=1),
            samples=sum(v.samples for v in views),
        )

    def fluxes(self) -> dict[str, F64]:
        """Domain means for E_TOA = 1: up_top, down_bottom (diffuse), direct_bottom, up_bottom, each (nw,)."""
        parts = [{k: v[: p.count] for k, v in p.lighting.mean_fluxes().items()} for p in self.packs]
        return {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}


@dataclass
class PackField:
    """`Field` at up to PACK wavelengths (``count`` of them asked for, the rest padding)."""

    solver: Options
    surface: Surface
    air: Air | None
    frame: Frame
    sun: F64
    wavelengths_nm: F64
    count: int
    shells: Shells
    volume: Volume
    table: F32
    lighting: Lighting
    medium: Medium | None = None
    timings: dict[str, float] = field(default_factory=dict)
    sweeps: list[list[int]] = field(default_factory=list)  # of each wavelength, from the coarsest grid on
    light: GridLight | None = None
    reach_deg: float = CLEAR_REACH_DEG  # how far round the Earth the shells' diffuse field is solved
    space_shells: Shells | None = None
    landscape: Landscape | None = None
    relief: Relief | None = None  # what the landscape is from the last eye
    own_sky: Shells | None = None  # and the shells that its rays go through
    mirrored: Mirrored | None = None  # what water mirrors to it
    wider: PackField | None = None  # the field of a wider grid, seen beyond the core of this
    core: Core | None = None
    detail: Detail | None = None  # below the grid, once an eye was near
    depths: SunDepth | None = None  # until the grids within it are solved
    beyond: Beyond | None = None  # where a grid ends and its sides' light is known

    @property
    def quality(self) -> str:
        """How finely the diffuse light is solved; "columns" where each is by itself."""
        return "columns" if self.light is not None and self.light.columns is not None else self.solver.quality

    @property
    def levels(self) -> list[PackField]:
        """This field and the wider ones around it."""
        return [self] if self.wider is None else [self, *self.wider.levels]

    @property
    def sky(self) -> Shells:
        """The shells that the last eye's rays go through."""
        return self.shells if self.own_sky is None else self.own_sky

    def view(self, rays: Rays, more: bool = False) -> View:
        """See `Field.view`."""
        started = time.perf_counter()
        relief = None if self.landscape is None else self.landscape.seen_from(rays)
        for level in self.levels:
            level.relief, level.own_sky = relief, level._shells_for(rays)
            level.mirrored = level.mirrored if more else None
        n = len(rays)
        out = View(
            np.zeros((n, PACK), np.float32), np.zeros((n, PACK), np.float32), np.zeros(n, bool),
            np.full((n, 3), np.nan), np.zeros(n), np.zeros((n, max(self.volume.species, 1)), np.float32), 0,
        )  # fmt: skip
        with job("view", n) as meter:
            for part in self._tiles(rays):
                tile = rays[part]
                if self.light is not None:
                    layered = self.light.layers is not None
                    self._aim(*((tile.directions()[0], True) if layered else _eye_of(tile)))
                out.samples += self._view_tile(tile, part, out)
                meter.advance(len(tile))
        self.timings["view"] = time.perf_counter() - started
        return replace(out, radiance=out.radiance[:, : self.count], transmittance=out.transmittance[:, : self.count])

    def _tiles(self, rays: Rays) -> Iterator[Any]:
        """Parts of the rays to march together; in scenes without sides, where a node is everywhere, one a direction."""
        if self.light is not None and self.light.layers is not None:
            _, which = np.unique(rays.directions().round(9), axis=0, return_inverse=True)
            order = np.argsort(which.ravel(), kind="stable")
            yield from np.split(order, np.flatnonzero(np.diff(which.ravel()[order])) + 1)
        else:
            yield from (slice(a, min(len(rays), a + _TILE_RAYS)) for a in range(0, len(rays), _TILE_RAYS))

    def _aim(self, eye: F64, parallel: bool) -> None:
        """Have all grids shine toward an eye, or along a direction; a period shines every way, for who looks around."""
        for level in self.levels:
            light = level.light
            assert light is not None
            if (light.moments or light.columns) and not parallel:
                if not level.volume.periodic:
                    level.volume = light.turning_around(level.volume, eye)
                elif not level.volume.turning.size:
                    level.volume = light.turning(level.volume)
            if not (level.volume.periodic and level.volume.turning.size):
                light.aim(level.volume, eye, parallel)

    def _view_tile(self, rays: Rays, part: Any, out: View) -> int:
        origin, direction = rays.origins(), rays.directions()
        n = len(rays)
        width_rad = np.broadcast_to(np.asarray(rays.width_rad, float), n)
        seen = self._seen(origin, direction, np.stack([np.zeros(n), width_rad], axis=-1))
        hit = seen.distance >= 0
        position = np.full((n, 3), np.nan)
        position[hit] = origin[hit] + direction[hit] * seen.distance[hit, None]
        width = width_rad * seen.distance
        eye = origin[0] if np.ptp(origin, axis=0).max() < 1e-3 else None
        self._add_ground(seen, position, direction, width, eye)
        out.radiance[part], out.transmittance[part], out.distance_m[part] = seen.radiance, seen.full, seen.distance
        out.species_depth[part], out.hit[part], out.position[part] = seen.depth, hit, position
        return seen.samples

    def _add_ground(self, seen: Seen, place: F64, direction: F64, width_m: F64, eye: F64 | None = None) -> None:
        """Add the light of the ground where rays end on it, as the grid has it in which they do."""
        for number, level in enumerate(self.levels):
            hit = np.flatnonzero((seen.distance >= 0) & (seen.level == number))
            if hit.size:
                ground = shade(level, level.sky, place[hit], direction[hit], width_m[hit], eye)
                seen.radiance[hit] += seen.through[hit] * ground

    def _seen(self, origin: F64, direction: F64, cone: F64 | None = None) -> Seen:
        """What rays see, but for the ground's own light."""
        ends = None if self.relief is None else self.relief.meet(origin, direction)
        return self.march(origin, direction, ends, cone)

    def march(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """`_seen` by rays that end, and widen, as `march_rays` has it."""
        if self.wider is not None:
            return nested.march(self, origin, direction, ends, cone)
        return self.march_alone(origin, direction, ends, cone)

    def _detail_for(self, origin: F64, cone: F64 | None) -> Detail:
        """What clouds are like between the nodes, where any ray is narrow enough to see it."""
        m = self.medium
        if cone is None or not (self.solver.detail and cone[:, 1].any()) or m is None or self.light is None:
            return NO_DETAIL
        if m.periodic or min(m.shape) < 2:
            return NO_DETAIL
        up = np.array([0.0, 0.0, self.frame.radius_m])
        above_m = np.linalg.norm(origin + up, axis=-1) - self.frame.radius_m - m.cloud_top_m
        width_m = cone[:, 0] + cone[:, 1] * np.maximum(above_m, 0.0)
        if width_m.min() >= widest_m(first_wavelength_m(m.drawn_cell_m)):
            return NO_DETAIL
        if self.detail is None:
            refined = [s.fine for s in m.species]
            _, ny, nx = m.shape
            self.detail = NO_DETAIL if not any(refined) else detail_of(
                m.extinction[refined].sum(axis=0), np.array(refined, np.float32), m.drawn_cell_m,
                self.light.local_sun[ny // 2, nx // 2],
            )  # fmt: skip
        return self.detail

    def march_alone(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """`march` in this grid and the air beside it."""
        level = np.zeros(len(direction), np.int8)
        if self.solver.name == "swim" and self.medium is not None:
            radiance, full, depth, distance, samples = swim_view.view(self, origin, direction, self.sky, ends)
            return Seen(radiance, full, full, distance, depth, int(samples.sum()), level)
        step = self.solver.step * (CLEAR_STEP if self.medium is None else 1.0)
        seen = march_rays(
            origin, direction, self.sun, self.table, self.sky, self.volume, step, ends=ends, cone=cone,
            detail=self._detail_for(origin, cone),
        )  # fmt: skip
        radiance = np.maximum(seen.radiance, 0)  # the truncated source may dip below zero where next to nothing is
        return Seen(
            radiance, seen.scaled, seen.full, seen.distance_m, seen.species_depth, int(seen.samples.sum()), level
        )

    def look(self, origin: F64, direction: F64, eye: F64) -> tuple[F32, F64]:
        """Radiance (n, PACK), lit ground included, of rays that seem to come from an eye (3,), and the distance (n,) to
        the ground or -1; what water mirrors. Peaks are cut: they are in the beam, which glitters by itself."""
        if self.light is not None and self.light.layers is not None:
            if len(direction) > 1:
                each = [self.look(o[None], d[None], eye) for o, d in zip(origin, direction, strict=True)]
                return np.concatenate([e[0] for e in each]), np.concatenate([e[1] for e in each])
            self._aim(direction[0], True)
        elif self.light is not None:
            self._aim(eye, False)
        seen = self._with_blunt_peaks()._seen(origin, direction)
        place = origin + direction * seen.distance[:, None]
        self._add_ground(seen, place, direction, 0.01 * seen.distance)
        return seen.radiance, seen.distance

    def _with_blunt_peaks(self) -> PackField:
        """This field, and those around it, without the narrow aureole that the delta-scaled beam has kept."""
        wider = None if self.wider is None else self.wider._with_blunt_peaks()
        return replace(self, table=self._blunt_table, wider=wider)

    @cached_property
    def _blunt_table(self) -> F32:
        return blunted(self.table, _AUREOLE_DEG)

    def through_clouds(self, place: F64) -> F64:
        """Delta-scaled transmission (n, nw) of the grid's species from the sun to places, by rays: ground beyond it.
        A relief casts its own shadow; the grid's terrain, which ends there like a wall, casts none."""
        lifted = place + np.array([0.0, 0.0, 1.0])
        dark, ends = np.zeros_like(self.table), np.full(len(place), FAR_M)
        met = march_rays(lifted, self.sun, self.sun, dark, self.shells, self.volume, 1.0, ends=ends)
        return np.asarray(np.exp(-met.species_depth[:, : self.volume.species].astype(float) @ self.volume.scaled))

    def _shells_for(self, rays: Rays) -> Shells:
        """The shells solved for the suns over the scene, or where rays reach farther round the Earth, for every sun."""
        if self.wider is not None or self.air is None or _reach_deg(rays, self.shells) < self.reach_deg:
            return self.shells
        if self.space_shells is None:
            s = self.shells
            self.space_shells = build_shells(
                air_of(self.air, s.ground_m), (0.0, 110.0), s.radius_m, s.ground_m,
                s.ground_albedo, DEGREE, s.top_m, scale=1.5,
            )  # fmt: skip
        return self.space_shells


def _reach_deg(rays: Rays, shells: Shells) -> float:
    """Largest angle at the Earth's centre between the scene's origin and what rays pass of the atmosphere."""
    some = rays[:: max(1, len(rays) // 2000)]
    up = np.array([0.0, 0.0, shells.radius_m])
    p, d = some.origins() + up, some.directions()
    along = (p * d).sum(-1)
    nearest = np.maximum((p * p).sum(-1) - along**2, 0.0)  # squared distance of the line from the centre
    half = np.sqrt(np.maximum((shells.radius_m + shells.top_m) ** 2 - nearest, 0.0))
    ground = (shells.radius_m + shells.ground_m) ** 2 - nearest
    last = np.where((ground > 0) & (along < 0), -along - np.sqrt(np.maximum(ground, 0)), -along + half)
    seen = (half > 0) & (last > 0)
    if not seen.any():
        return 0.0
    ends = np.concatenate([p + np.maximum(-along - half, 0)[:, None] * d, p + last[:, None] * d])[np.tile(seen, 2)]
    return float(np.degrees(np.arccos(np.clip(ends[:, 2] / np.linalg.norm(ends, axis=-1), -1, 1))).max())


def _eye_of(rays: Rays) -> tuple[F64, bool]:
    """Common point of the rays, or their common direction."""
    if len(rays) == 1:
        return rays.directions()[0], True
    if rays.origin_m.ndim == 1:
        return rays.origin_m, False
    if rays.direction.ndim == 1:
        return rays.direction, True
    if np.allclose(rays.direction, rays.direction[:1], atol=1e-6):
        return rays.direction[0], True
    if np.allclose(rays.origin_m, rays.origin_m[:1], atol=1e-3):
        return rays.origin_m[0], False
    raise UserError("rays must share their origin or their direction: split them into groups that do")
