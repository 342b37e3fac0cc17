"""What a job will take: one line before it starts, where it is large."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click
import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.ground.surface import surface_of
from openswim.lighting import WAVELENGTHS_NM
from openswim.optics.matter import matter_of, terms_in
from openswim.optics.species import REFERENCE_NM
from openswim.options import Options
from openswim.pictures.images import PIXEL_BYTES
from openswim.progress import PATIENCE_S
from openswim.system.machine import free_memory
from openswim.transport.engine.pack import PACK
from openswim.transport.medium.plan import LIGHT_OF_COLUMNS, MediumPlan, lit_in_parts
from openswim.transport.montecarlo.reference import PASS_PATHS
from openswim.transport.plan import plan_of

if TYPE_CHECKING:
    from openswim.scene import Scene

Array = NDArray[np.float64]
LARGE_BYTES = 1_000_000_000

# Measured on two cores (docs/running.md has a table): what the estimate stands on.
_START_S, _EARTH_START_S = 0.6, 1.6  # compiled kernels, and maps of the ground
_VIEW_SAMPLES_PER_S, _FLAT_SAMPLES_PER_S = 1.6e7, 3.6e7
_STEPS = 100  # that all that is done for a pixel takes as long as, in clear air and in cloud
_SEEN_DEPTH, _BROKEN = 0.01, 0.25  # columns that count as cloudy; so many are as dear to sweeps as if all were
_SPACE_M = 1e5  # from above rays go through the air steeply ...
_FROM_SPACE, _SPACE_PIXEL_BYTES = 2.0, 350  # ... in so many times fewer samples, and nearly all end on the ground
_SOLVE_S_PER_NODE = 2.1e-6  # `fast`, per node of the grid and pack of wavelengths, full or not, all sweeps
_COLUMN_NODE_S = 1.2e-6  # the same where every column is solved by itself
_SWIM_NODE_S = 1.3e-6
_SUNWARD_S, _HIGH_SUN_CELLS = 2.9e-8, 15  # per cloudy node and cell on its way to a low sun; those that all solves have
_CLOUD_TOP_M, _RADIUS_M, _NIGHT_DEG = 12e3, 6.37e6, -4.0
_QUALITY = {"preview": 0.84, "standard": 1.0, "high": 2.0}  # of that, where there is cloud: 2.5, or 1.6 where
# "high" has halved the cells; in clear air as many sweeps do
REFERENCE_PATHS = 256
_LOOK_S = 53e-6  # of `reference`, per ray and pass: air and cloud along it
_PATH_S, _SCATTERING_S = 1e-6, 0.5e-6  # per path in clear air, and for each of its scatterings in cloud
_SKY_RAYS, _SKY_PATHS = 4096, 1 / 16  # of the sky's irradiance, and how many of the picture's paths each has
_BYTES, _EARTH_BYTES, _REFERENCE_BYTES = 2.8e8, 4.5e8, 3e8  # of a process whatever it does: libraries, kernels, maps
_SURE = 0.8  # of the free memory, for pictures that are said to fit
_NODE_BYTES, _CLOUD_NODE_BYTES = 85, 300  # optics and scratch per node and wavelength, and moments where there is cloud
_OF_A_PACK, _KEPT_PACK = 3, 0.48  # as many times that, and what is left of a pack while others are solved for
_COLUMN_NODE_BYTES, _KEPT_NODE_BYTES = 55, 30  # the same without sweeps; of a light while the next one is solved for
_COLUMN_S, _SEEN_PIXEL_S = 13e-6, 5e-6  # of large domains, whatever the solver
_LEVELS, _PART_BYTES, _SEEN_PIXEL_BYTES = 40, 0.9e9, 120


@dataclass(frozen=True)
class Pictured:
    """What an estimate needs to know of a picture that no `Camera` takes: its pixels, and from how high it is taken."""

    shape: tuple[int, int]
    height_m: float


View = Camera | Pictured


@dataclass(frozen=True)
class Estimate:
    """Wall-clock seconds and peak memory of a rendering, mostly right within a factor of 1.5 (docs/running.md)."""

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
    scene: "Scene", camera: View, solver: str = "fast", wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    paths: int | None = None, quality: str = "standard", lights: int = 1, sun_deg: float = 90.0,
) -> Estimate:
    """What solving the scene and viewing it once will take on two cores; nested grids and ``lights`` (sun, moon, night
    sky) are solved one after the other and kept. ``sun_deg``: the sun's altitude."""
    terms = terms_in(scene, np.array(wavelengths_nm, float)).nm.size
    return _of_terms(scene, camera, solver, int(terms), paths, quality, lights, sun_deg)


def _of_terms(
    scene: "Scene", camera: View, solver: str, wavelengths: int, paths: int | None, quality: str, lights: int,
    sun_deg: float,
) -> Estimate:  # fmt: skip
    """wavelengths: how many terms are solved for, several of each wavelength at which gases absorb in lines."""
    start_s, start_bytes = (_EARTH_START_S, _EARTH_BYTES) if _on_earth(scene) else (_START_S, _BYTES)
    packs = -(-wavelengths // PACK)  # solved for one after the other, and kept
    if solver == "reference":
        return _estimate_reference(scene, camera, wavelengths, paths or REFERENCE_PATHS, start_s)
    if scene.wider is not None:
        inner, wider = (
            _of_terms(one, camera, solver, wavelengths, paths, quality, lights, sun_deg)
            for one in (scene.alone(), scene.wider)
        )
        of_pixels = math.prod(camera.shape) * inner.pixel_bytes
        return Estimate(
            inner.seconds + wider.seconds - start_s, inner.memory_bytes + wider.memory_bytes - start_bytes - of_pixels,
            inner.pixel_bytes,
        )
    if _large(scene):
        return _estimate_large(scene, camera, wavelengths, packs)
    plan = _plan(scene, solver, quality)
    drawn = (0, 0, 0) if plan is None else plan.drawn_shape
    nodes, wide = math.prod(drawn), solver == "fast" and plan is not None and plan.stands_alone
    in_space = camera.height_m > _SPACE_M
    of_nodes, of_columns = _cloudy_shares(scene)
    broken = min(1.0, of_columns / _BROKEN)
    steps = _STEPS / (_FROM_SPACE if in_space else 1.0)
    per_s = _VIEW_SAMPLES_PER_S if _on_earth(scene) else _FLAT_SAMPLES_PER_S
    pixels, per_pixel = math.prod(camera.shape), wavelengths * (_SPACE_PIXEL_BYTES if in_space else PIXEL_BYTES)
    fast_s = _COLUMN_NODE_S if wide else _SOLVE_S_PER_NODE * (1 + (_QUALITY[quality] - 1) * broken)
    solve_s = (fast_s if solver == "fast" else _SWIM_NODE_S) * nodes
    sunward_s = 0.0 if plan is None or solver != "fast" else _sunward_s(plan, of_nodes, sun_deg)
    seconds = start_s + packs * (lights * (solve_s + pixels * steps / per_s) + sunward_s)
    swept = 0.0 if wide or solver == "swim" else _NODE_BYTES + _CLOUD_NODE_BYTES * of_nodes
    node_bytes = (swept or _COLUMN_NODE_BYTES) + (lights - 1) * _KEPT_NODE_BYTES
    kept = 1.0 + _KEPT_PACK * (packs - 1)
    return Estimate(seconds, start_bytes + nodes * _OF_A_PACK * kept * node_bytes + pixels * per_pixel, per_pixel)


def _sunward_s(plan: MediumPlan, of_nodes: float, sun_deg: float) -> float:
    """More than a solve has of depths to a high sun: rays go by cells, until they are above clouds or have left."""
    if sun_deg < _NIGHT_DEG:
        return 0.0
    altitude = math.radians(sun_deg)
    rise_m = _RADIUS_M * math.sin(altitude)
    across_m = math.cos(altitude) * (math.sqrt(rise_m**2 + 2 * _RADIUS_M * _CLOUD_TOP_M) - rise_m)
    cells = min(across_m / min(plan.cell_m), sum(plan.columns) / 4)
    nodes = of_nodes * math.prod(plan.drawn_shape)
    return _SUNWARD_S * nodes * max(cells - _HIGH_SUN_CELLS, 0.0)


def mean_of(estimates: Sequence[Estimate]) -> Estimate:
    """Of pictures that are made one after the other: the mean of their times, and the most memory."""
    return Estimate(
        sum(each.seconds for each in estimates) / len(estimates), max(each.memory_bytes for each in estimates),
        max(each.pixel_bytes for each in estimates),
    )  # fmt: skip


def _estimate_reference(scene: "Scene", camera: View, wavelengths: int, paths: int, start_s: float) -> Estimate:
    """Of paths that scatter, on their mean, twice as often as the mean optical depth of the columns says.

    That holds whatever the clouds' shapes: where light is the same from all sides it is the same within, so that of S
    that comes in through a layer's two faces as much scatters as in 4 V/S = twice its depth (Blanco and Fournier 2003).
    """
    plan, pixels, per_pixel = _plan(scene, "reference", "standard"), math.prod(camera.shape), wavelengths * PIXEL_BYTES
    scatterings = 2.0 * _mean_depth(scene)
    path_s = _PATH_S + scatterings * _SCATTERING_S
    sky = 0 if camera.height_m > _SPACE_M else _SKY_RAYS
    seconds = start_s + sum(
        rays * ((passes_of(each) + 1) * _LOOK_S + each * path_s)
        for rays, each in ((pixels, paths), (sky, max(2, round(paths * _SKY_PATHS))))
    )
    nodes = 0 if plan is None else math.prod(plan.drawn_shape)
    return Estimate(seconds, _REFERENCE_BYTES + nodes * _NODE_BYTES + pixels * per_pixel, per_pixel)


def passes_of(paths: int) -> int:
    """In how many passes, of 1, 2, 4 ... `PASS_PATHS` paths, `reference` follows so many of each ray."""
    passes, size = 0, 1
    while paths > 0:
        size = paths if paths <= 1.5 * size else size
        passes, paths, size = passes + 1, paths - size, min(2 * size, PASS_PATHS)
    return passes


def _on_earth(scene: "Scene") -> bool:
    return scene.grid is None or scene.grid.curved


def _plan(scene: "Scene", solver: str, quality: str) -> MediumPlan | None:
    """How a scene would be drawn under a high sun."""
    if scene.grid is None:
        return None
    options = Options(solver, quality) if solver == "fast" else Options(solver)
    matter, surface = matter_of(scene.alone(), REFERENCE_NM), surface_of(scene.alone(), REFERENCE_NM)
    return plan_of(options, matter, surface, np.array([0.0, 0.0, 1.0])).medium


def _mean_depth(scene: "Scene") -> float:
    """Mean vertical optical depth of the columns' clouds and haze."""
    if scene.grid is None:
        return 0.0
    matter, rise = matter_of(scene.alone(), REFERENCE_NM), _layers_m(scene.grid.height_m)
    return float(sum((one.extinction_per_m * rise).sum(axis=0).mean() for one in matter.species))


def _layers_m(height_m: Array) -> Array:
    """What of the height belongs to each node, (nz, ny, nx) or (nz, 1, 1)."""
    return np.asarray(np.gradient(height_m, axis=0)).reshape(height_m.shape[0], *(height_m.shape[1:] or (1, 1)))


def _cloudy_shares(scene: "Scene") -> tuple[float, float]:
    """Shares of the nodes that have cloud or haze in them, and of the columns in which rays notice it."""
    species = () if scene.grid is None else matter_of(scene.alone(), REFERENCE_NM).species
    if not species or scene.grid is None:
        return 0.0, 0.0
    nodes = np.any([one.extinction_per_m > 0 for one in species], axis=0)
    layers_m = _layers_m(scene.grid.height_m)
    depth: Array = np.sum([(one.extinction_per_m * layers_m).sum(axis=0) for one in species], axis=0)
    return float(nodes.mean()), float((depth > _SEEN_DEPTH).mean())


def _large(scene: "Scene") -> bool:
    return scene.grid is not None and lit_in_parts(scene.grid, "cloud_area_fraction" in scene.data)


def _estimate_large(scene: "Scene", camera: View, wavelengths: int, packs: int) -> Estimate:
    """Of a domain lit in parts: the scene's own fields, their extinction on levels, and a part."""
    assert scene.grid is not None
    columns = scene.grid.shape[1] * scene.grid.shape[2]
    pixels, per_pixel = math.prod(camera.shape), wavelengths * _SEEN_PIXEL_BYTES
    own = sum(values.nbytes for values in scene.data.data_vars.values()) + scene.grid.height_m.nbytes
    seconds = _START_S + (columns * _COLUMN_S + pixels * _SEEN_PIXEL_S) * packs
    held = own + 4 * _LEVELS * columns * len(scene.species)
    return Estimate(seconds, held + _PART_BYTES + pixels * per_pixel, per_pixel)


def announce(
    scene: "Scene", camera: View, solver: str, paths: int | None = None, quality: str = "standard",
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM, lights: int = 1, sun_deg: float = 90.0,
) -> None:
    """Print the estimate of a large job to stderr; UserError where it does not fit into memory."""
    if solver == "reference" and scene.wider is not None:
        click.echo("note: solver reference sees the innermost grid alone", err=True)
    if solver == "fast" and _large(scene):
        click.echo(f"note: {LIGHT_OF_COLUMNS}", err=True)
    expected = estimate(scene, camera, solver, wavelengths_nm, paths, quality, lights, sun_deg)
    if expected.memory_bytes > free_memory():
        raise UserError(_too_large(camera, expected) if isinstance(camera, Camera) else _no_room(expected))
    if expected.large:
        click.echo(str(expected), err=True)


def _no_room(expected: Estimate) -> str:
    """Why an imager's picture is not begun."""
    return f"this picture {_takes(expected)}: give a smaller --size, a larger --every, one --band, or --solver swim"


def _takes(expected: Estimate) -> str:
    return f"takes about {expected.memory_bytes / 1e9:.1f} GB of memory, and {free_memory() / 1e9:.1f} GB are free"


def _too_large(camera: Camera, expected: Estimate) -> str:
    """Why a picture is not begun, and the largest one like it that the machine has memory for."""
    free, of_pixels, says = free_memory(), expected.pixel_bytes * math.prod(camera.shape), _takes(expected)
    share = (_SURE * free - (expected.memory_bytes - of_pixels)) / max(of_pixels, 1.0)
    rows, columns = (int(pixels * math.sqrt(max(share, 0.0))) for pixels in camera.shape)
    if min(rows, columns) < 1:
        return f"this scene {says}: use a smaller domain, or --solver swim"
    size = str(columns) if rows == columns else f"{columns}x{rows}"
    return f"--size {camera.shape[1]}x{camera.shape[0]} {says}: use --size {size} or less"
