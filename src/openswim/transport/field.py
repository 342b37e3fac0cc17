"""Field: solved light, and what rays see of it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.rays import Rays
from openswim.errors import UserError
from openswim.progress import job
from openswim.scene.frame import Frame
from openswim.scene.scene import Scene
from openswim.transport import swim
from openswim.transport.grid_light import GridLight
from openswim.transport.march import DEGREE, PACK, Shells, Volume, view_kernel
from openswim.transport.medium import Medium, air_of
from openswim.transport.shells import build_shells
from openswim.transport.surface import Lighting, shade

if TYPE_CHECKING:
    from openswim.transport.solver import Solver

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

CLEAR_REACH_DEG = 12.0
_TILE_RAYS = 400_000


@dataclass
class View:
    """What rays see: solar-relative ``radiance`` (n, nw); ``transmittance`` e^-tau along the ray (n, nw); where they
    ``hit`` the ground (n,) and at which ``position`` (n, 3); optical depth of each species (n, ns)."""

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

    @property
    def _first(self) -> PackField:
        return self.packs[0]

    @property
    def solver(self) -> Solver:
        return self._first.solver

    @property
    def frame(self) -> Frame:
        return self._first.frame

    @property
    def medium(self) -> Medium | None:
        return self._first.medium

    @property
    def ground_m(self) -> float:
        """Height of the ground outside the grid."""
        return self._first.lighting.ground_m

    @property
    def wavelengths_nm(self) -> F64:
        return np.concatenate([p.wavelengths_nm[: p.count] for p in self.packs])

    @property
    def timings(self) -> dict[str, float]:
        """Seconds of each stage, summed over packs: air, sun, diffuse, view (the last one)."""
        out: dict[str, float] = {}
        for pack in self.packs:
            for name, seconds in pack.timings.items():
                out[name] = out.get(name, 0.0) + seconds
        return out

    def view(self, rays: Rays) -> View:
        """Radiance along rays; memory is bounded by tiling over them."""
        views = [pack.view(rays) for pack in self.packs]
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

    solver: Solver
    scene: Scene
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
    sweeps: dict[str, list[int]] = field(default_factory=dict)
    light: GridLight | None = None
    reach_deg: float = CLEAR_REACH_DEG  # how far round the Earth the shells' diffuse field is solved
    space_shells: Shells | None = None

    def view(self, rays: Rays) -> View:
        """See `Field.view`."""
        started = time.perf_counter()
        shells = self._shells_for(rays)
        n = len(rays)
        out = View(
            np.zeros((n, PACK), np.float32), np.zeros((n, PACK), np.float32), np.zeros(n, bool),
            np.full((n, 3), np.nan), np.zeros(n), np.zeros((n, max(self.volume.species, 1)), np.float32), 0,
        )  # fmt: skip
        with job("view", n) as meter:
            for part in self._tiles(rays):
                tile = rays[part]
                if self.light is not None:
                    self.light.aim(self.volume, *_eye_of(tile))
                out.samples += self._view_tile(tile, part, shells, out)
                meter.advance(len(tile))
        self.timings["view"] = time.perf_counter() - started
        return replace(out, radiance=out.radiance[:, : self.count], transmittance=out.transmittance[:, : self.count])

    def _tiles(self, rays: Rays) -> Iterator[Any]:
        """Parts of the rays to march together; in plane-parallel scenes, where a node is everywhere, one a view."""
        plane_parallel = self.medium is not None and self.medium.shape[1:] == (1, 1)
        if plane_parallel and self.light is not None:
            _, which = np.unique(rays.directions().round(9), axis=0, return_inverse=True)
            order = np.argsort(which.ravel(), kind="stable")
            yield from np.split(order, np.flatnonzero(np.diff(which.ravel()[order])) + 1)
        else:
            yield from (slice(a, min(len(rays), a + _TILE_RAYS)) for a in range(0, len(rays), _TILE_RAYS))

    def _view_tile(self, rays: Rays, part: Any, shells: Shells, out: View) -> int:
        origin, direction = np.array(rays.origins(), float), np.array(rays.directions(), float)  # own, writable
        n, nw = len(rays), PACK
        scaled, front = np.zeros((n, nw), np.float32), np.zeros((n, nw), np.float32)
        samples = np.zeros(n, np.int64)
        swim_mode = self.solver.name == "swim" and self.medium is not None
        depth_limit = 2.0 if swim_mode else 1e30
        radiance, full = np.zeros((n, nw), np.float32), np.zeros((n, nw), np.float32)
        distance, depth = np.zeros(n), np.zeros((n, out.species_depth.shape[1]), np.float32)
        seen_shells = swim.cloud_only(shells) if swim_mode else shells
        view_kernel(
            origin, direction, self.sun, self.table, seen_shells, self.volume, depth_limit, self.solver.step, radiance,
            scaled,
            full, depth, front, distance, samples,
        )  # fmt: skip
        np.maximum(radiance, 0, out=radiance)  # the truncated source may dip below zero where next to nothing is
        if swim_mode:
            clear = self._clear_view(origin, direction, shells)
            swim.merge(self, direction, origin, radiance, full, depth, front, clear)
        hit = np.flatnonzero(distance >= 0)
        position = np.full((n, 3), np.nan)
        if hit.size:
            position[hit] = origin[hit] + direction[hit] * distance[hit, None]
            through = full[hit] if swim_mode else scaled[hit]
            radiance[hit] += through * shade(self, shells, position[hit], direction[hit])
        out.radiance[part], out.transmittance[part], out.distance_m[part] = radiance, full, distance
        out.species_depth[part], out.hit[part], out.position[part] = depth, distance >= 0, position
        return int(samples.sum())

    def _clear_view(self, origin: F64, direction: F64, shells: Shells) -> F32:
        """Radiance of the clear air alone along rays that end where the terrain does (Eq. 3 and all higher orders)."""
        n = len(direction)
        volume = self.volume._replace(fields=np.zeros((1, 1, 1, PACK), np.float32))
        radiance, scaled, full, front = (np.zeros((n, PACK), np.float32) for _ in range(4))
        view_kernel(
            origin, direction, self.sun, self.table, shells, volume, 1e30, self.solver.step, radiance, scaled, full,
            np.zeros((n, max(1, volume.species)), np.float32), front, np.zeros(n), np.zeros(n, np.int64),
        )  # fmt: skip
        return radiance

    def beam(self, place: F64) -> F32:
        """Delta-scaled direct transmission (n, nw) from the sun to places, by rays; for ground beyond the grid."""
        n, nw = len(place), PACK
        work = [np.zeros((n, nw), np.float32) for _ in range(4)]
        distance = np.zeros(n)
        dark = np.zeros_like(self.table)
        lifted = place + np.array([0.0, 0.0, 1.0])
        view_kernel(
            lifted, np.tile(self.sun, (n, 1)), self.sun, dark, self.shells, self.volume, 1e30, 2.0, work[0], work[1],
            work[2], np.zeros((n, max(1, self.volume.species)), np.float32), work[3], distance, np.zeros(n, np.int64),
        )  # fmt: skip
        return work[1] * (distance < 0)[:, None]

    def _shells_for(self, rays: Rays) -> Shells:
        """The shells solved for the suns over the scene, or where rays reach farther round the Earth, for every sun."""
        if self.scene.atmosphere is None or _reach_deg(rays, self.shells) < self.reach_deg:
            return self.shells
        if self.space_shells is None:
            s = self.shells
            self.space_shells = build_shells(
                air_of(self.scene, self.wavelengths_nm, s.ground_m), (0.0, 110.0), s.radius_m, s.ground_m,
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
