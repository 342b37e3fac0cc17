"""What a job will take: one line before it starts, where it is large."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click
import numpy as np

from openswim.errors import UserError
from openswim.ground.surface import surface_of
from openswim.optics.matter import matter_of
from openswim.optics.species import REFERENCE_NM
from openswim.options import Options
from openswim.pictures.images import PIXEL_BYTES
from openswim.progress import PATIENCE_S
from openswim.system.machine import free_memory
from openswim.transport.engine.pack import PACK
from openswim.transport.medium.plan import LIGHT_OF_COLUMNS, MediumPlan, lit_in_parts
from openswim.transport.plan import plan_of

if TYPE_CHECKING:
    from openswim.cameras import Camera
    from openswim.scene import Scene

WAVELENGTHS = 3
LARGE_BYTES = 1_000_000_000

# Measured on two cores (benchmarks/): what the estimate stands on.
_VIEW_SAMPLES_PER_S = 1.8e7
_SPACE_M = 1e5  # from above rays go through the air steeply ...
_FROM_SPACE, _SPACE_PIXEL_BYTES = 3.0, 350  # ... in so many times fewer samples, and nearly all end on the ground
_SOLVE_S_PER_NODE = 0.7e-6  # `fast`, per node of the grid and wavelength, all sweeps
_COLUMN_NODE_S = 0.17e-6  # the same where every column is solved by itself
_QUALITY = {"preview": 0.84, "standard": 1.0, "high": 2.0}  # of that: 2.5, or 1.6 where "high" has halved the cells
_PATHS_PER_S = 8e3  # of `reference`, three wavelengths; thick cloud takes hundreds of scatterings a path,
_CLEAR_PATHS_PER_S = 0.5e6  # clear sky one or two
REFERENCE_PATHS = 256
_START_S = 2.0
_BYTES, _REFERENCE_BYTES = 3.5e8, 2e8  # of a process whatever it does: libraries, kernels, maps of the ground
_SURE = 0.8  # of the free memory, for pictures that are said to fit
_NODE_BYTES = 140  # optics, moments and scratch per node and wavelength
_COLUMN_NODE_BYTES = 55  # the same without sweeps
_COLUMN_S, _SEEN_PIXEL_S = 13e-6, 5e-6  # of large domains, whatever the solver
_LEVELS, _PART_BYTES, _SEEN_PIXEL_BYTES = 40, 0.9e9, 120


@dataclass(frozen=True)
class Estimate:
    """Wall-clock seconds and peak memory of a rendering, right within a factor of two or so."""

    seconds: float
    memory_bytes: float
    pixel_bytes: float = 0.0  # of that, what a pixel takes

    def __str__(self) -> str:
        time = f"{self.seconds:.0f} s" if self.seconds < 120 else f"{self.seconds / 60:.0f} min"
        return f"estimated: about {time}, {max(self.memory_bytes / 1e9, 0.1):.1f} GB of memory"

    @property
    def large(self) -> bool:
        return self.seconds > 2 * PATIENCE_S or self.memory_bytes > LARGE_BYTES


def estimate(
    scene: "Scene", camera: "Camera", solver: str = "fast", wavelengths: int = WAVELENGTHS, paths: int | None = None,
    quality: str = "standard",
) -> Estimate:
    """What solving the scene and viewing it once will take on two cores; nested grids are solved one after the other
    and kept."""
    if scene.wider is not None and solver != "reference":
        inner, wider = (
            estimate(one, camera, solver, wavelengths, paths, quality) for one in (scene.alone(), scene.wider)
        )
        of_pixels = math.prod(camera.shape) * inner.pixel_bytes
        return Estimate(
            inner.seconds + wider.seconds - _START_S, inner.memory_bytes + wider.memory_bytes - _BYTES - of_pixels,
            inner.pixel_bytes,
        )
    if solver != "reference" and _large(scene):
        return _estimate_large(scene, camera, wavelengths)
    plan = _plan(scene, solver, quality)
    nodes, wide = (0, False) if plan is None else (math.prod(plan.drawn_shape), solver == "fast" and plan.stands_alone)
    steps = 100 if scene.grid is None else sum(scene.grid.shape) / 3 + 100
    in_space = camera.height_m > _SPACE_M
    steps /= _FROM_SPACE if in_space else 1.0
    pixels, per_pixel = math.prod(camera.shape), wavelengths * (_SPACE_PIXEL_BYTES if in_space else PIXEL_BYTES)
    per_node = _COLUMN_NODE_S if wide else _SOLVE_S_PER_NODE * _QUALITY[quality]
    solve_s = (per_node if solver == "fast" else 0.1e-6) * nodes * wavelengths
    if solver == "reference":
        thick = _thick_share(scene)
        seconds = _START_S + pixels * (paths or REFERENCE_PATHS) * (
            thick / _PATHS_PER_S + (1 - thick) / _CLEAR_PATHS_PER_S
        )
        return Estimate(seconds, _REFERENCE_BYTES + nodes * _NODE_BYTES + pixels * per_pixel, per_pixel)
    seconds = _START_S + solve_s + pixels * steps * wavelengths / (3 * _VIEW_SAMPLES_PER_S)
    node_bytes = _COLUMN_NODE_BYTES if wide or solver == "swim" else _NODE_BYTES
    return Estimate(seconds, _BYTES + nodes * wavelengths * node_bytes + pixels * per_pixel, per_pixel)


def _plan(scene: "Scene", solver: str, quality: str) -> MediumPlan | None:
    """How a scene would be drawn under a high sun."""
    if scene.grid is None:
        return None
    options = Options(solver, quality) if solver == "fast" else Options(solver)
    matter, surface = matter_of(scene.alone(), REFERENCE_NM), surface_of(scene.alone(), REFERENCE_NM)
    return plan_of(options, matter, surface, np.array([0.0, 0.0, 1.0])).medium


def _thick_share(scene: "Scene") -> float:
    """Share of the columns in whose clouds and haze paths go astray: of optical depth over 1."""
    if scene.grid is None:
        return 0.0
    matter, height = matter_of(scene.alone(), REFERENCE_NM), scene.grid.height_m
    rise = np.gradient(height, axis=0).reshape(height.shape[0], *(height.shape[1:] or (1, 1)))
    depth = sum(((one.extinction_per_m * rise).sum(axis=0) for one in matter.species), np.zeros(1))
    return float((depth > 1.0).mean())


def _large(scene: "Scene") -> bool:
    return scene.grid is not None and lit_in_parts(scene.grid, "cloud_area_fraction" in scene.data)


def _estimate_large(scene: "Scene", camera: "Camera", wavelengths: int) -> Estimate:
    """Of a domain lit in parts: the scene's own fields, their extinction on levels, and a part."""
    assert scene.grid is not None
    columns = scene.grid.shape[1] * scene.grid.shape[2]
    pixels, per_pixel = math.prod(camera.shape), wavelengths * _SEEN_PIXEL_BYTES
    own = sum(values.nbytes for values in scene.data.data_vars.values()) + scene.grid.height_m.nbytes
    seconds = _START_S + (columns * _COLUMN_S + pixels * _SEEN_PIXEL_S) * -(-wavelengths // PACK)
    held = own + 4 * _LEVELS * columns * len(scene.species)
    return Estimate(seconds, held + _PART_BYTES + pixels * per_pixel, per_pixel)


def announce(
    scene: "Scene", camera: "Camera", solver: str, paths: int | None = None, quality: str = "standard",
    wavelengths: int = WAVELENGTHS,
) -> None:
    """Print the estimate of a large job to stderr."""
    if solver == "reference" and scene.wider is not None:
        click.echo("note: solver reference sees the innermost grid alone", err=True)
    if solver == "fast" and _large(scene):
        click.echo(f"note: {LIGHT_OF_COLUMNS}", err=True)
    expected = estimate(scene, camera, solver, wavelengths, paths, quality)
    if expected.memory_bytes > free_memory():
        raise UserError(_too_large(camera, expected))
    if expected.large:
        click.echo(str(expected), err=True)


def _too_large(camera: "Camera", expected: Estimate) -> str:
    """Why a picture is not begun, and the largest one like it that the machine has memory for."""
    free, of_pixels = free_memory(), expected.pixel_bytes * math.prod(camera.shape)
    says = f"takes about {expected.memory_bytes / 1e9:.1f} GB of memory, and {free / 1e9:.1f} GB are free"
    share = (_SURE * free - (expected.memory_bytes - of_pixels)) / max(of_pixels, 1.0)
    rows, columns = (int(pixels * math.sqrt(max(share, 0.0))) for pixels in camera.shape)
    if min(rows, columns) < 1:
        return f"this scene {says}: use a smaller domain, or --solver swim"
    size = str(columns) if rows == columns else f"{columns}x{rows}"
    return f"--size {camera.shape[1]}x{camera.shape[0]} {says}: use --size {size} or less"
