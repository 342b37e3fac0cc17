"""Solver: from a scene and a sun to a field of light, and from the field to what any camera sees.

One solve serves every camera; only the view pass repeats.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.cameras.rays import Rays
from openswim.errors import UserError
from openswim.progress import job
from openswim.scene.frame import Frame, scene_frame
from openswim.scene.scene import Scene
from openswim.transport import diffuse, swim
from openswim.transport.march import PACK, Shells, Volume, view_kernel
from openswim.transport.medium import Medium, air_of, build_medium
from openswim.transport.ordinates import Ordinates, harmonic_matrix, ordinates_for
from openswim.transport.peak import peak_tables
from openswim.transport.shells import build_shells, clear_radiance, no_volume
from openswim.transport.surface import Lighting, shade
from openswim.transport.sweep import direct_beam, sun_sweep, terrain_shadow, view_source

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NAMES = ("swim", "fast")
_TRUNCATION = 5  # M: order of the smooth field (transport.md section 2)
_CLEAR_REACH_DEG = 12.0
_TILE_RAYS = 400_000
_CLEAR_CELLS = 8


@dataclass(frozen=True)
class Solver:
    """How light is solved for.

    name: "fast" (sweeps, the default) or "swim" (Albers et al. 2020). tolerance: change of the field at which sweeps
    end. step: eye-ray step in cells. shadows, ground: whether terrain shades and rays reflect off the ground.
    """

    name: str = "fast"
    tolerance: float = 1e-2
    step: float = 1.0
    most_sweeps: int = 60
    fine_sweeps: int = 3

    def __post_init__(self) -> None:
        if self.name == "reference":
            raise UserError("solver 'reference' (Monte Carlo) is not available in this version: use 'fast' or 'swim'")
        if self.name not in NAMES:
            raise UserError(f"unknown solver {self.name!r}: choose one of {', '.join(NAMES)}")

    def solve(
        self,
        scene: Scene,
        sun_direction: ArrayLike,
        wavelengths_nm: ArrayLike = (615.0, 546.0, 450.0),
    ) -> Field:
        """Solve the field of light of ``scene`` lit from ``sun_direction`` (unit vector in the scene frame)."""
        sun = np.asarray(sun_direction, float)
        sun = sun / np.linalg.norm(sun)
        wl = np.atleast_1d(np.asarray(wavelengths_nm, float))
        if wl.size == 0 or not np.isfinite(wl).all() or (wl < 280).any() or (wl > 2500).any():
            raise UserError("wavelengths must lie between 280 and 2500 nm")
        parts = [wl[a : a + PACK] for a in range(0, wl.size, PACK)]
        solve = _clear_field if scene.grid is None else _grid_field
        return Field(
            [solve(self, scene, sun, np.pad(part, (0, PACK - part.size), "edge"), part.size) for part in parts]
        )


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
    reach_deg: float = _CLEAR_REACH_DEG  # how far round the Earth the shells' diffuse field is solved
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
                s.ground_albedo, _TRUNCATION, s.top_m, scale=1.5,
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
        air, _sun_range(sun, _CLEAR_REACH_DEG), frame.radius_m, lighting.ground_m, lighting.mean_albedo, _TRUNCATION,
        lighting.ground_m + 1e5,
    )  # fmt: skip
    table = peak_tables([air.aerosol_phase], _TRUNCATION) if air else np.zeros((1, 2, 2, PACK), np.float32)
    lighting.light_clear(shells, sun)
    return PackField(
        solver, scene, frame, sun, wl, count, shells, no_volume(), table, lighting,
        timings={"sun": 0.0, "diffuse": time.perf_counter() - started},
    )  # fmt: skip


@dataclass
class GridLight:
    """What the grid knows of the light: per wavelength the beam, the moments and the coefficients."""

    medium: Medium
    beams: list[F32]
    moments: list[F32] | None
    coefficients: list[diffuse.Coefficients]
    sun_harmonics: F32
    sun: F64
    haze: F32  # (1, angle, depth, PACK) forward peak of the background aerosol
    count: int
    shadow_m: F64
    ridge_m: F64
    _aimed: tuple[bytes, bool] | None = None

    def aim(self, volume: Volume, eye: F64, parallel: bool) -> None:
        """Fill the source channels for one eye."""
        key = (np.asarray(eye, float).tobytes(), parallel)
        if self.moments is None or key == self._aimed:
            return
        m = self.medium
        for w, c in enumerate(self.coefficients):
            if w >= self.count:
                volume.fields[..., PACK + w] = volume.fields[..., PACK + w - 1]
                continue
            view_source(
                m.extinction, c.scattering, c.air_scattering, c.air_forward, self.beams[w], self.sun_harmonics,
                self.moments[w], m.axes, m.place, m.levels_m, np.asarray(eye, float), parallel, self.sun, self.haze, w,
                int(volume.forward_channel[w]), PACK + w, volume.fields,
            )  # fmt: skip
        self._aimed = key


def _grid_field(solver: Solver, scene: Scene, sun: F64, wl: F64, count: int) -> PackField:
    """Field of a scene with a grid: sun sweep, then the diffuse sweeps (`fast`) or Eqs 4-8 (`swim`)."""
    started = time.perf_counter()
    fast = solver.name == "fast"
    medium = build_medium(scene, wl, float(sun[2]), refine=fast)
    frame = medium.frame
    lighting = Lighting.of_grid(scene, medium)
    lighting.place_sun(sun)
    reach = _CLEAR_REACH_DEG + np.degrees(np.abs(medium.place[..., :2]).max() / frame.radius_m)
    top = float(medium.levels_m[-1]) if medium.air is None else medium.ground_m + 1e5
    shells = build_shells(
        medium.air, _sun_range(sun, reach), frame.radius_m, medium.ground_m, lighting.mean_albedo, _TRUNCATION, top
    )
    timings = {"air": time.perf_counter() - started}
    started = time.perf_counter()
    local_sun = np.einsum("jiab,b->jia", medium.axes.astype(float), sun)
    coefficients = [_coefficients(medium, shells, w, fast) for w in range(PACK)]
    volume, depths = _volume(medium, coefficients, local_sun, fast)
    timings["sun"] = time.perf_counter() - started
    started = time.perf_counter()
    table = _tables(medium, fast)
    light = _light(solver, medium, lighting, shells, volume, depths, coefficients, local_sun, sun, table[-1:], count)
    result = PackField(solver, scene, frame, sun, wl, count, shells, volume, table, lighting, medium, timings)
    result.light = light
    result.reach_deg = float(reach)
    if fast:
        result.sweeps = _diffuse(solver, light, lighting, shells, sun, count)
    else:
        swim.light_grid(light, volume, lighting, shells, local_sun, sun)
    timings["diffuse"] = time.perf_counter() - started
    return result


def _tables(medium: Medium, fast: bool) -> F32:
    """Forward-peak tables of the species, then of the background aerosol; `swim` reads none in clouds."""
    rows = [s.phase for s in medium.species]
    if medium.air is not None:
        last = peak_tables([medium.air.aerosol_phase], _TRUNCATION)
        clouds = peak_tables(rows, _TRUNCATION) if rows and fast else np.zeros((len(rows), *last.shape[1:]), np.float32)
        return np.concatenate([clouds, last])
    if not rows or not fast:
        return np.zeros((len(rows) + 1, 2, 2, PACK), np.float32)
    clouds = peak_tables(rows, _TRUNCATION)
    return np.concatenate([clouds, np.zeros_like(clouds[:1])])


def _coefficients(medium: Medium, shells: Shells, w: int, fast: bool) -> diffuse.Coefficients:
    """Delta-scaled coefficients of species and air at one wavelength; `swim` keeps the full extinction."""
    scaled, scattering = [], []
    for s in medium.species:
        chi = s.phase[w].moments(_TRUNCATION + 1)
        f = chi[-1] if fast else 0.0
        k, omega = s.relative_extinction[w], s.single_scattering_albedo[w]
        scaled.append(k * (1 - omega * f))
        scattering.append(k * omega * (chi[:-1] - f))
    above = medium.levels_m - shells.ground_m
    if medium.air is None:
        air_e, air_f, air_s = np.zeros(len(above)), np.zeros(len(above)), np.zeros((len(above), _TRUNCATION))
    else:
        z = medium.air.height_m - shells.ground_m
        air_e = np.interp(above, z, shells.extinction[:, w])
        air_f = np.interp(above, z, shells.forward[:, w])
        air_s = np.stack([np.interp(above, z, column) for column in shells.scattering[:, :, w].T], axis=-1)
    f32 = np.float32
    return diffuse.Coefficients(
        np.array(scaled, f32),
        np.array(scattering, f32).reshape(-1, _TRUNCATION),
        air_e.astype(f32),
        air_s.astype(f32),
        air_f.astype(f32),
    )


def _forward(medium: Medium, nw: int) -> F32:
    """omega f per reference extinction (ns, nw): what delta scaling leaves in the beam."""
    rows = [
        [k * omega * phase.moments(_TRUNCATION + 1)[-1]
         for k, omega, phase in zip(s.relative_extinction, s.single_scattering_albedo, s.phase, strict=True)]
        for s in medium.species
    ]  # fmt: skip
    return np.array(rows, np.float32).reshape(len(medium.species), nw)


def _volume(
    medium: Medium, coefficients: list[diffuse.Coefficients], local_sun: F64, fast: bool
) -> tuple[Volume, list[F32]]:
    """Sun sweeps, and the volume with all but its sources filled in."""
    ns, nw = len(medium.species), PACK
    scaled = np.stack([c.scaled for c in coefficients], axis=-1).reshape(ns, nw)
    forward = _forward(medium, nw) if fast else np.zeros((ns, nw), np.float32)
    second = forward if fast else swim.backscatter_weights(medium)
    nz, ny, nx = medium.shape
    origin, per_m, lookup = medium.level_lookup
    # coefficients that agree within 2 % share a sweep
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
    free_channel = 2 * PACK + ns + len(kept)
    fields = np.zeros((nz, ny, nx, -(-(free_channel + 1) // PACK) * PACK), np.float32)
    for s in range(ns):
        fields[..., 2 * PACK + s] = medium.extinction[s]
    spacing = np.diff(medium.levels_m, append=2 * medium.levels_m[-1] - medium.levels_m[-2])
    height = medium.levels_m[:, None, None]
    occupied = medium.extinction.any(axis=0) if ns else np.zeros((nz, ny, nx), bool)
    free = _free_cells(occupied | (height < medium.terrain_m + 1.5 * spacing[:, None, None]), medium.periodic)
    fields[..., free_channel] = free
    # where light is scattered or meets the ground, the way to the sun is followed exactly
    exact = (free <= 1) & (height > medium.terrain_m - 2 * spacing[:, None, None])
    cell = np.array(medium.cell_m, float)
    depths: list[F32] = []
    for n, row in enumerate(rows):
        total = np.tensordot(row, medium.extinction, axes=1).astype(np.float32)
        depth = np.zeros((nz, ny, nx), np.float32)
        if total.any():
            sun_sweep(
                total, exact, local_sun, medium.levels_m, origin, per_m, lookup, cell, medium.frame.radius_m,
                medium.periodic, depth,
            )  # fmt: skip
        if n in forward_channel:
            fields[..., forward_channel[n]] = depth
        depths.append(depth)
    air = np.stack([[c.air_extinction for c in coefficients], [c.air_forward for c in coefficients]]).transpose(2, 0, 1)
    volume = Volume(
        medium.chart_origin_m, medium.chart_per_m, medium.chart, origin, per_m, lookup, float(medium.levels_m[-1]),
        np.array(medium.cell_m, np.float32), spacing.astype(np.float32), medium.periodic, ns, free_channel, fields,
        scaled,
        forward,
        np.array([forward_channel[n] for n in index["second"]]), np.ascontiguousarray(air, np.float32),
        medium.terrain_m, _CLEAR_CELLS,
    )  # fmt: skip
    return volume, [depths[n] for n in index["scaled"]]


def _free_cells(occupied: NDArray[np.bool_], periodic: bool) -> F32:
    """Cells to the nearest occupied node in the largest-axis metric, up to `_CLEAR_CELLS` + 1."""
    free = np.full(occupied.shape, _CLEAR_CELLS + 1, np.float32)
    reached = occupied
    free[reached] = 0
    for n in range(1, _CLEAR_CELLS + 1):
        grown = reached.copy()
        for axis in range(3):
            source = grown.copy()
            for shift in (1, -1):
                moved = np.roll(source, shift, axis)
                if axis == 0 or not periodic:
                    edge = [slice(None)] * 3
                    edge[axis] = slice(0, 1) if shift == 1 else slice(-1, None)
                    moved[tuple(edge)] = False
                grown |= moved
        free[grown & ~reached] = n
        reached = grown
    return free


def _light(
    solver: Solver, medium: Medium, lighting: Lighting, shells: Shells, volume: Volume, depths: list[F32],
    coefficients: list[diffuse.Coefficients], local_sun: F64, sun: F64, haze: F32, count: int,
) -> GridLight:  # fmt: skip
    """Direct beam at the nodes and at the ground, terrain shadows included."""
    nz, ny, nx = medium.shape
    shadow, ridge = np.full((ny, nx), -1e9), np.zeros((ny, nx))
    terrain_shadow(
        medium.terrain_m,
        local_sun,
        np.array(medium.cell_m, float),
        medium.frame.radius_m,
        medium.periodic,
        shadow,
        ridge,
    )
    beams: list[F32] = []
    surface = np.zeros((ny, nx), np.float32)
    for w in range(PACK):
        if w >= count:  # padding
            beams.append(beams[-1])
            lighting.direct[w] = lighting.direct[w - 1]
            volume.fields[..., w] = volume.fields[..., w - 1]
            continue
        beam = np.empty((nz, ny, nx), np.float32)
        direct_beam(
            depths[w], local_sun, medium.levels_m, medium.terrain_m, shadow, ridge, w, shells, beam, surface,
            volume.fields, w,
        )  # fmt: skip
        beams.append(beam)
        lighting.direct[w] = surface
    lighting.forward_depth = _forward_at_ground(medium, lighting, shells, volume)
    harmonics = harmonic_matrix(local_sun.reshape(-1, 3), _TRUNCATION).T.reshape(-1, ny, nx).astype(np.float32)
    return GridLight(
        medium, beams, None, coefficients, np.ascontiguousarray(harmonics), sun, haze, count, shadow, ridge
    )


def _forward_at_ground(medium: Medium, lighting: Lighting, shells: Shells, volume: Volume) -> F32:
    """Forward depth from the ground of every column to the sun (PACK, ny, nx)."""
    node = (medium.levels_m[:, None, None] < medium.terrain_m - 0.01).sum(axis=0)
    node = np.minimum(node, len(medium.levels_m) - 1)[None]
    count = shells.sun_forward.shape[1]
    horizon = float(shells.horizon[0])
    t = np.sqrt(np.clip((lighting.mu_sun - horizon) / (1 - horizon), 0, 1)) * (count - 1)
    out = np.zeros((PACK, *medium.shape[1:]), np.float32)
    for w in range(PACK):
        air = np.interp(t, np.arange(count), shells.sun_forward[0, :, w])
        cloud = np.take_along_axis(volume.fields[..., volume.forward_channel[w]], node, 0)[0]
        out[w] = air + (cloud if volume.forward.any() else 0.0)
    return out


def _inflow(medium: Medium, shells: Shells, sun: F64, ordinates: Ordinates) -> F32:
    """Radiance (ordinate, nz, nw) of the clear atmosphere entering the grid along each ordinate at each level."""
    q = ordinates.direction
    nz, ny, nx = medium.shape
    axes = medium.axes[ny // 2, nx // 2].astype(float)
    direction = np.repeat(q @ axes, nz, axis=0)
    height = np.tile(np.maximum(medium.levels_m, shells.ground_m + 0.5), len(q))
    origin = np.stack([0 * height, 0 * height, height], axis=-1)
    return clear_radiance(origin, direction, sun, shells, 1.0).reshape(len(q), nz, PACK)


def _diffuse(
    solver: Solver, light: GridLight, lighting: Lighting, shells: Shells, sun: F64, count: int
) -> dict[str, list[int]]:
    """Coarse-to-fine sweeps of every wavelength; each starts from the field of the one before."""
    medium = light.medium
    nz, ny, nx = medium.shape
    ordinates = ordinates_for(medium.cell_m, medium.levels_m)
    inflow = _inflow(medium, shells, sun, ordinates)
    ground_node = (medium.levels_m[:, None, None] < medium.terrain_m - 0.01).sum(axis=0)
    ground_node = np.minimum(ground_node, nz - 1).astype(np.int64)
    coarse_first = ny > 8 and nx > 8 and not medium.periodic
    solution: diffuse.Solution | None = None
    counts: dict[str, list[int]] = {"coarse": [], "fine": []}
    light.moments = []
    if coarse_first:
        coarse_extinction = diffuse.coarsen(medium.extinction)
        coarse_sun = diffuse.coarsen(light.sun_harmonics)
        coarse_node = np.ascontiguousarray(ground_node[::2, ::2])
    cell = np.array(medium.cell_m, float)
    moments = np.zeros((nz, ny, _TRUNCATION**2, nx) if not coarse_first else 0, np.float32)
    with job("diffuse light", count) as meter:
        for w in range(PACK):
            if w >= count:
                light.moments.append(light.moments[-1])
                lighting.diffuse[w], lighting.up_top[w] = lighting.diffuse[w - 1], lighting.up_top[w - 1]
                continue
            albedo, direct = lighting.albedo[w], lighting.direct_horizontal(w)
            fine = diffuse.Sweeper(
                medium.extinction, light.coefficients[w], light.beams[w], light.sun_harmonics, medium.levels_m, cell,
                medium.periodic, np.ascontiguousarray(inflow[..., w]), ground_node, albedo, direct, ordinates,
                _TRUNCATION,
            )  # fmt: skip
            if coarse_first:
                coarse = replace(
                    fine, extinction=coarse_extinction, beam=diffuse.coarsen(light.beams[w]), sun_harmonics=coarse_sun,
                    cell_m=2 * cell, ground_node=coarse_node, ground_albedo=diffuse.coarsen(albedo),
                    direct_flux=diffuse.coarsen(direct),
                )  # fmt: skip
                solution = diffuse.coarse_to_fine(
                    coarse, fine, solution, solver.tolerance, solver.most_sweeps, solver.fine_sweeps
                )
                moments = solution.fine
                counts["coarse"].append(solution.coarse_sweeps)
                counts["fine"].append(solution.fine_sweeps)
            else:
                plane_parallel = (ny, nx) == (1, 1)
                moments, n = fine.solve(
                    moments, (2e-4 if plane_parallel else 0.02) * solver.tolerance, 400, 12 if plane_parallel else 3
                )
                counts["fine"].append(n)
            light.moments.append(moments)
            lighting.diffuse[w] = fine.down_flux
            lighting.up_top[w] = fine.up_flux
            meter.advance()
    lighting.correct_quadrature(ordinates, inflow, shells, sun)
    return counts
