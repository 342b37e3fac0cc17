"""Solver: from a scene and a sun to a field of light, which serves every camera.

`Field.view` turns it into what rays see; only that repeats from camera to camera.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.progress import job
from openswim.scene.frame import scene_frame
from openswim.scene.scene import Scene
from openswim.transport import diffuse, swim
from openswim.transport.field import CLEAR_REACH_DEG, Field, PackField
from openswim.transport.grid_light import GridLight, beams_and_shadows, coefficients_of, forward_tables, sunlit_volume
from openswim.transport.march import DEGREE, PACK, Shells
from openswim.transport.medium import Medium, air_of, build_medium
from openswim.transport.ordinates import Ordinates, ordinates_for
from openswim.transport.peak import peak_tables
from openswim.transport.shells import build_shells, clear_radiance, no_volume
from openswim.transport.surface import Lighting

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NAMES = ("swim", "fast")


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
        lighting.ground_m + 1e5,
    )  # fmt: skip
    table = peak_tables([air.aerosol_phase], DEGREE) if air else np.zeros((1, 2, 2, PACK), np.float32)
    lighting.light_clear(shells, sun)
    return PackField(
        solver, scene, frame, sun, wl, count, shells, no_volume(), table, lighting,
        timings={"sun": 0.0, "diffuse": time.perf_counter() - started},
    )  # fmt: skip


def _grid_field(solver: Solver, scene: Scene, sun: F64, wl: F64, count: int) -> PackField:
    """Field of a scene with a grid: sun sweep, then the diffuse sweeps (`fast`) or Eqs 4-8 (`swim`)."""
    started = time.perf_counter()
    fast = solver.name == "fast"
    medium = build_medium(scene, wl, float(sun[2]), refine=fast)
    frame = medium.frame
    lighting = Lighting.of_grid(scene, medium)
    lighting.place_sun(sun)
    reach = CLEAR_REACH_DEG + np.degrees(np.abs(medium.place[..., :2]).max() / frame.radius_m)
    top = float(medium.levels_m[-1]) if medium.air is None else medium.ground_m + 1e5
    shells = build_shells(
        medium.air, _sun_range(sun, reach), frame.radius_m, medium.ground_m, lighting.mean_albedo, DEGREE, top
    )
    timings = {"air": time.perf_counter() - started}
    started = time.perf_counter()
    local_sun = np.einsum("jiab,b->jia", medium.axes.astype(float), sun)
    coefficients = [coefficients_of(medium, shells, w, fast) for w in range(PACK)]
    volume, depths = sunlit_volume(medium, coefficients, local_sun, fast)
    timings["sun"] = time.perf_counter() - started
    started = time.perf_counter()
    table = forward_tables(medium, fast)
    light = beams_and_shadows(medium, lighting, shells, volume, depths, coefficients, local_sun, sun, table[-1:], count)
    result = PackField(solver, scene, frame, sun, wl, count, shells, volume, table, lighting, medium, timings)
    result.light = light
    result.reach_deg = float(reach)
    if fast:
        result.sweeps = _diffuse(solver, light, lighting, shells, sun, count)
    else:
        swim.light_grid(light, volume, lighting, shells, local_sun, sun)
    timings["diffuse"] = time.perf_counter() - started
    return result


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
    moments = np.zeros((nz, ny, DEGREE**2, nx) if not coarse_first else 0, np.float32)
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
                DEGREE,
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
