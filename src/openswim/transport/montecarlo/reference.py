"""Solver `reference`: unbiased backward Monte Carlo with an error for every pixel (docs/decisions/0007)."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.ground.sample import SurfaceSample
from openswim.lights.eclipses import MoonShadow
from openswim.optics.gas_bands import Terms
from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.progress import job, relabel
from openswim.scene.frame import Frame
from openswim.scene.rays import Rays
from openswim.system.interrupts import claim
from openswim.transport.engine.threads import in_threads
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.plan import MediumPlan
from openswim.transport.medium.surface import Surface
from openswim.transport.montecarlo.checkpoint import Checkpoint
from openswim.transport.montecarlo.ground import Seen, seen_ground
from openswim.transport.montecarlo.kernels import flux_kernel, path_kernel, scout_kernel
from openswim.transport.montecarlo.phase import Phases
from openswim.transport.montecarlo.sums import Sums
from openswim.transport.montecarlo.world import World, build_world
from openswim.transport.view.eye import Transmission
from openswim.transport.view.seen import View
from openswim.transport.view.sight import Sight

F64 = NDArray[np.float64]

PATHS = 256  # per ray, unless told otherwise
NO_LAYERS = "layers: the solver reference has none: use fast or swim for them"
_SPREAD = 16  # so many times fewer paths a ray has where the rays' sum alone is asked for
_PASS_S = 0.7  # of paths between looks at the clock
PASS_PATHS = 64  # a pass has at least, once there are as many: it looks along each ray first, as long as 50 paths take
_PART_RAYS = 32  # of large pictures, between looks at an interrupt: half a second of such a pass in thick cloud
_SAVE_S = 30.0
_FLUX_PLACES = 1024
_SHARP = 20.0  # phase functions with a higher peak are aimed with
_AIMING = 0.2


@dataclass
class ReferenceView(View):
    """`View` with the standard error ``sigma`` (n, nw) of its radiance after ``paths`` paths a ray."""

    sigma: NDArray[np.float32]
    paths: int
    interrupted: bool

    @property
    def mean_error(self) -> float:
        """Mean standard error over mean radiance."""
        mean = float(self.radiance.mean())
        return float(self.sigma.mean()) / mean if mean > 0 else 0.0


def solve_reference(
    options: Options, plan: MediumPlan | None, matter: Matter, surface: Surface, sun: F64,
    shadow: MoonShadow | None = None,
) -> ReferenceField:  # fmt: skip
    """Make ready what paths need; they are followed when rays are known."""
    started = time.perf_counter()
    world, phases, medium, lighting = build_world(plan, matter, surface, sun, shadow)
    return ReferenceField(
        options, surface, matter.frame, sun, matter.terms, world, phases, medium, lighting,
        timings={"solve": time.perf_counter() - started},
    )  # fmt: skip


@dataclass
class ReferenceField:
    """The light of a scene by Monte Carlo, with the methods of `Field`; it is every eye in it too, since paths need
    nothing made ready."""

    solver: Options
    surface: Surface
    frame: Frame
    sun: F64
    terms: Terms
    world: World
    phases: Phases
    medium: Medium | None
    lighting: Lighting
    timings: dict[str, float] = field(default_factory=dict)
    found: tuple[dict[str, F64], dict[str, F64]] | None = None  # fluxes and their errors, once asked for
    sees_outlines: ClassVar[bool] = False
    landscape: ClassVar[None] = None

    @property
    def quality(self) -> str:
        return self.solver.quality

    @property
    def media(self) -> list[Medium]:
        return [] if self.medium is None else [self.medium]

    @property
    def wavelengths_nm(self) -> F64:
        return self.terms.wavelengths_nm

    @property
    def ground_m(self) -> float:
        return self.lighting.ground_m

    @property
    def aiming(self) -> float:
        return _AIMING if self.phases.aim.max() > _SHARP else 0.0

    def view(self, rays: Rays, across_m: F64 | None = None, along_m: F64 | None = None) -> ReferenceView:
        """Radiance along rays; with ``across_m`` and ``along_m`` (3,), its mean over origins spread that far."""
        started = time.perf_counter()
        n, (origin, direction) = len(rays), _lines(rays)
        transmittance, hit, ground_m, species = self._scouted(rays)
        position = np.where(hit[:, None], origin + direction * ground_m[:, None], np.nan)
        sides = [np.zeros(3) if side is None else np.asarray(side, float) for side in (across_m, along_m)]
        sums = self._sums(origin, direction, sides, self._seen(position, hit))
        self.timings["view"] = time.perf_counter() - started
        mean = self.terms.mean  # of errors too: terms share their paths
        return ReferenceView(
            mean(sums.mean.astype(np.float32)), transmittance, hit, position,
            np.where(hit, ground_m, -1.0), species.astype(np.float32), sums.paths * n,
            sigma=mean(sums.sigma.astype(np.float32)), paths=sums.paths, interrupted=sums.interrupted,
        )  # fmt: skip

    def viewpoint(self, rays: Rays) -> ReferenceField:
        return self

    def of_others(self, rays: Rays) -> ReferenceField:
        return self

    def summed(self, rays: Rays) -> ReferenceView:
        """Radiance along rays of which the sum counts: paths are spread over them."""
        solver = self.solver
        paths = solver.paths or (PATHS if solver.target_error is None and solver.seconds is None else None)
        fewer = replace(
            solver,
            paths=None if paths is None else max(2, paths // _SPREAD),
            target_error=None if solver.target_error is None else min(solver.target_error * _SPREAD**0.5, 0.5),
        )
        return replace(self, solver=fewer).view(rays)

    def sight(self, rays: Rays) -> Sight:
        raise UserError(NO_LAYERS)

    def through(self, rays: Rays) -> Transmission:
        return self._scouted(rays)[:2]

    def _scouted(self, rays: Rays) -> tuple[NDArray[np.float32], NDArray[np.bool_], F64, F64]:
        """Transmittance (n, nw) along rays, whether they end on the ground and how far away (n,), and the optical depth
        (n, ns) of each species."""
        n, (origin, direction) = len(rays), _lines(rays)
        depth, ground_m = np.zeros((n, len(self.terms.nm))), np.zeros(n)
        species = np.zeros((n, self.world.extinction.shape[3]))
        in_threads(scout_kernel, origin, direction, self.world, depth, species, ground_m, parts=n // _PART_RAYS)
        return self.terms.mean(np.exp(-depth).astype(np.float32)), ground_m >= 0, ground_m, species

    def _seen(self, position: F64, hit: NDArray[np.bool_]) -> Seen:
        """The ground at the end of each ray's straight way."""
        n, nw = len(hit), len(self.terms.nm)
        full = _black(n, nw)
        where = hit if hit.any() else np.arange(n) == 0
        places = np.where(hit[:, None], position, 0.0)[where]
        lat, lon, _ = self.frame.latlon(places)
        sample = self.surface.sample(lat, lon)
        full.lambertian = sample.lambertian
        for name in ("albedo", "water", "snow", "sea_ice", "wind_speed", "chlorophyll"):
            getattr(full, name)[where] = getattr(sample, name)
        if sample.mean_square_slope is not None:
            full.mean_square_slope = np.ones(n)
            full.mean_square_slope[where] = sample.mean_square_slope
        return seen_ground(full, self.terms.nm)

    def _sums(self, origin: F64, direction: F64, sides: list[F64], seen: Seen) -> Sums:
        """Paths of all rays, pass by pass, until there are enough or the error is small."""
        solver = self.solver
        sums = Sums(len(direction), len(self.terms.nm))
        checkpoint = Checkpoint.of(
            solver, origin, direction, sides, seen, self.terms.nm, solver.seed, self.aiming, self.world,
            self.phases,
        )  # fmt: skip
        if checkpoint is not None:
            checkpoint.load(sums)
        most = solver.paths or (PATHS if solver.target_error is None and solver.seconds is None else 1 << 40)
        numbers, n = np.arange(len(direction), dtype=np.int64), len(direction)
        began, saved = time.process_time(), time.monotonic()
        size = 1
        with job("reference", most if most < 1 << 40 else None) as meter:
            meter.advance(sums.paths)
            try:
                while sums.paths < most:
                    left = most - sums.paths
                    size = left if left <= 1.5 * size else size  # a pass for the last few alone is not worth its looks
                    start = time.perf_counter()
                    # in arrays of their own: of an interrupted pass some rays' paths would be there, but not counted
                    total, squares = np.zeros_like(sums.total), np.zeros_like(sums.squares)
                    in_threads(
                        path_kernel, origin, direction, sides[0], sides[1], solver.seed, numbers, sums.paths, size,
                        seen, self.aiming, self.world, self.phases, total, squares, parts=n // _PART_RAYS,
                    )  # fmt: skip
                    took = time.perf_counter() - start
                    sums.add(total, squares, size)
                    meter.advance(size)
                    relabel(meter, f"reference, error {100 * sums.error:.2g} %")
                    if checkpoint is not None and time.monotonic() - saved > _SAVE_S:
                        checkpoint.save(sums)
                        saved = time.monotonic()
                    if solver.target_error is not None and sums.paths >= 16 and sums.error <= solver.target_error:
                        break
                    spent = time.process_time() - began
                    if solver.seconds is not None and sums.paths >= 4 and spent > solver.seconds:
                        break
                    size = min(2 * size, max(PASS_PATHS, int(size * _PASS_S / max(took, 1e-6))))
                    if solver.seconds is not None:
                        in_time = sums.paths * max(solver.seconds - spent, 0.0) / max(spent, 1e-6)
                        size = max(1, min(size, int(in_time)))
            except KeyboardInterrupt:
                claim()
                if checkpoint is not None:
                    checkpoint.save(sums)
                    raise
                if sums.paths < 2:
                    raise
                sums.interrupted = True
        if checkpoint is not None:
            checkpoint.save(sums)
        return sums

    def fluxes(self) -> dict[str, F64]:
        """Domain means for E_TOA = 1: up_top, down_bottom (diffuse), direct_bottom, up_bottom, each (nw,).

        `flux_errors` has their standard errors.
        """
        return self._fluxes()[0]

    def flux_errors(self) -> dict[str, F64]:
        return self._fluxes()[1]

    def _fluxes(self) -> tuple[dict[str, F64], dict[str, F64]]:
        if self.found is None:
            means, errors = ({k: self.terms.mean(v) for k, v in each.items()} for each in self._flux_sums())
            self.found = means, errors
        return self.found

    def _flux_sums(self) -> tuple[dict[str, F64], dict[str, F64]]:
        bottom, up, albedo = self._columns()
        top = bottom + up * (self.world.top_m - self._heights(bottom) + 1e-3)[:, None]
        down_sums = self._half_space(bottom + 0.02 * up, up, 1)
        up_sums = self._half_space(top, -up, 2)
        out, error = {}, {}
        for name, (mean, sigma) in {
            "up_top": up_sums[0], "down_bottom": down_sums[0], "direct_bottom": down_sums[1]
        }.items():  # fmt: skip
            out[name], error[name] = mean.mean(axis=0), np.sqrt((sigma**2).sum(axis=0)) / len(bottom)
        total = down_sums[0][0] + down_sums[1][0]
        out["up_bottom"] = (albedo * total).mean(axis=0)
        error["up_bottom"] = np.sqrt(
            (albedo**2 * (down_sums[0][1] ** 2 + down_sums[1][1] ** 2)).sum(axis=0)
        ) / len(bottom)
        return out, error

    def _heights(self, place: F64) -> F64:
        up = place + np.array([0.0, 0.0, self.world.radius_m])
        if not self.world.curved:
            return place[:, 2]
        return np.linalg.norm(up, axis=-1) - self.world.radius_m

    def _columns(self) -> tuple[F64, F64, F64]:
        """Places on the ground all over the domain (n, 3), up there, and albedo (n, nw)."""
        lighting, medium = self.lighting, self.medium
        albedo = np.moveaxis(lighting.albedo, 0, -1).astype(float)
        if medium is None or medium.shape[1:] == (1, 1):
            place = np.tile([0.0, 0.0, self.world.ground_m], (_FLUX_PLACES, 1))
            return place, np.tile([0.0, 0.0, 1.0], (_FLUX_PLACES, 1)), np.tile(albedo[0, 0], (_FLUX_PLACES, 1))
        _, ny, nx = medium.shape
        # a Kronecker sequence over the columns, each with the area around its node
        n = np.arange(1, _FLUX_PLACES + 1)[:, None]
        share = (n * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0
        iy, ix = (share * [ny, nx]).astype(int).T
        axes = medium.axes[iy, ix].astype(float)
        terrain = medium.terrain_m[iy, ix].astype(float)
        if medium.periodic:
            terrain = np.full_like(terrain, self.world.ground_m)
        return medium.place[iy, ix] + terrain[:, None] * axes[:, 2], axes[:, 2], albedo[iy, ix]

    def _half_space(self, place: F64, up: F64, stream: int) -> list[tuple[F64, F64]]:
        """Mean and standard error (n, nw) of the diffuse and of the sun's flux from about ``up``."""
        n, nw = len(place), len(self.terms.nm)
        total, squares = np.zeros((n, nw, 2)), np.zeros((n, nw, 2))
        seen = seen_ground(
            _black(1, nw), self.terms.nm
        )
        seed = self.solver.seed + (stream << 32)
        began, most = time.process_time(), self.solver.paths or PATHS
        paths, size = 0, 4
        while paths < most:
            size = min(size, most - paths)
            in_threads(
                flux_kernel, np.ascontiguousarray(place), np.ascontiguousarray(up), seed, paths, size, seen,
                self.aiming, self.world, self.phases, total, squares,
            )  # fmt: skip
            paths += size
            size *= 2
            if self.solver.seconds is not None and 3 * (time.process_time() - began) > self.solver.seconds:
                break
        mean = total / paths
        sigma = np.sqrt(np.maximum(squares / paths - mean**2, 0) / max(paths - 1, 1))
        return [(mean[..., k], sigma[..., k]) for k in range(2)]


def _lines(rays: Rays) -> list[F64]:
    """Origins and directions (n, 3) of rays."""
    return [np.array(a, float, order="C") for a in (rays.origins(), rays.directions())]


def _black(n: int, nw: int) -> SurfaceSample:
    """Ground that reflects nothing at n places."""
    water, snow, sea_ice, wind_speed, chlorophyll = np.zeros((5, n))  # each is filled in by itself
    return SurfaceSample(np.zeros((n, nw)), water, snow, sea_ice, wind_speed, chlorophyll, lambertian=True)
