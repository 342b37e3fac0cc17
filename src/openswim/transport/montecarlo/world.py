"""A scene as the Monte Carlo kernels see it: extinction at nodes, majorants of blocks, air in layers, ground."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.lights.eclipses import MoonShadow
from openswim.optics.matter import Matter
from openswim.optics.species import background
from openswim.transport.engine.compiled import kernel
from openswim.transport.engine.scalar import height_of_square_m
from openswim.transport.engine.threads import in_threads
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.ice.level import beyond_means
from openswim.transport.march.level_ice import axes_at
from openswim.transport.medium.medium import Medium, build_medium
from openswim.transport.medium.plan import MediumPlan
from openswim.transport.medium.surface import Surface
from openswim.transport.montecarlo.covered import Covered, covered_by
from openswim.transport.montecarlo.phase import Phases, phases_of

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

BLOCK = 2  # cells of a block along each axis: its extinction is nowhere above the block's majorant
AIR_STEP_M = 100.0  # of the air's table, linear in between
AIR_NODES = 1001
_MOST_SKIP = 40
_LAYER_EDGES_M = np.concatenate(
    [np.arange(0, 2000, 200), np.arange(2000, 6000, 500), np.arange(6000, 30000, 2000), np.arange(30000, 100001, 5000)]
)
SUN_HEIGHTS = 256  # of the table of slant depths, even in the square root of the height, as the dip of the horizon is
SUN_COSINES = 384
_SUN_STEPS = 160


class World(NamedTuple):
    """What light meets. Heights and lengths in metres, extinctions in 1/m, nw wavelengths, ns species."""

    radius_m: float
    top_m: float  # nothing is higher
    low_m: float  # no ground is lower,
    high_m: float  # none is higher
    ground_m: float  # of the ground outside the grid
    gridded: bool
    airy: bool
    curved: bool
    index_x0: float  # flat scenes: ix = index_x0 + x index_per_x
    index_y0: float
    index_per_x: float
    index_per_y: float
    chart_origin_m: float
    chart_per_m: float
    chart: F64
    level_origin_m: float
    level_per_m: float
    level_table: NDArray[np.int16]  # level below the lower end of even steps in height
    levels_m: F64  # (nz,)
    cell_m: F64  # (2,) least distance of columns
    periodic: bool
    extinction: F32  # (nz, ny, nx, ns) at the reference wavelength
    relative: F64  # (ns, nw) extinction,
    scattering: F64  # (ns, nw) scattering over the reference extinction
    majorant: F32  # (blocks z, y, x), of empty ones minus how many blocks around are empty, too, in all directions
    cloud_low_m: float  # there is cloud between these heights only, and hills are not above
    cloud_high_m: float
    terrain_m: F32  # (ny, nx)
    normal: F64  # (ny, nx, 3)
    albedo: F64  # (ny, nx, nw)
    mean_albedo: F64  # (nw,)
    air: F64  # (AIR_NODES, 3, nw) extinction, scattering of molecules and of haze, above ground_m
    layer_edge_m: F64  # (layers + 1,) above ground_m
    layer_of: NDArray[np.int64]  # by AIR_STEP_M
    layer_majorant: F64  # (layers,)
    sun: F64  # (3,) unit vector
    sun_depth: F32  # (heights, cosines, nw) logarithm of the air's slant optical depth to the sun
    plates: int  # which species is ice that floats level, or -1; with axes and map as `march.level_ice` has them, but
    plate_axes: F64  # upright as at the origin of the frame,
    plate_map: F64  # and of P alone, (altitude, azimuth, nw)
    moon: Covered


def build_world(
    plan: MediumPlan | None, matter: Matter, surface: Surface, sun: F64, shadow: MoonShadow | None = None
) -> tuple[World, Phases, Medium | None, Lighting]:
    """Everything the kernels need to know; phase functions of the species, then molecules, then haze."""
    frame = matter.frame
    nw = len(matter.wavelengths_nm)
    medium = None
    if plan is None:
        lighting = Lighting.of_clear_sky(surface, frame)
    else:
        medium = build_medium(plan, matter, surface)
        lighting = Lighting.of_grid(surface, medium)
    ground_m = lighting.ground_m
    air, haze_phase, gas_phase = _air_table(matter, ground_m)
    airy = bool(air.any())
    edges = _LAYER_EDGES_M.astype(float)
    layer_of = np.searchsorted(edges, AIR_STEP_M * np.arange(AIR_NODES), "right") - 1
    layer_of = np.minimum(layer_of, len(edges) - 2)
    node = np.rint(edges / AIR_STEP_M).astype(int)
    layer_majorant = np.array([1.0001 * air[a : b + 1, 0].max() for a, b in pairwise(node)])
    rows = [s.phase for s in medium.species] if medium is not None else []
    particles = [*rows, haze_phase] if air[:, 2].any() else rows
    phases = phases_of([*(rows or [[gas_phase] * nw]), [gas_phase] * nw, haze_phase], particles)
    sun_depth = np.zeros((SUN_HEIGHTS, SUN_COSINES, nw), np.float32)
    if airy:
        in_threads(_slant_depths, air[:, 0].copy(), frame.radius_m + ground_m, sun_depth)
    common = {
        "radius_m": frame.radius_m, "ground_m": ground_m, "airy": airy, "curved": frame.curved, "air": air,
        "layer_edge_m": edges, "layer_of": layer_of, "layer_majorant": layer_majorant, "sun": np.array(sun, float),
        "sun_depth": sun_depth, "mean_albedo": np.array(lighting.mean_albedo, float),
        **_level_plates(medium, frame.radius_m, np.array(sun, float), matter.wavelengths_nm),
        "moon": covered_by(shadow, matter.wavelengths_nm),
    }  # fmt: skip
    if medium is None:
        return World(**common, **_no_grid(ground_m, nw)), phases, None, lighting
    return World(**common, **_grid(medium, lighting, airy)), phases, medium, lighting


def _level_plates(medium: Medium | None, radius_m: float, sun: F64, wavelengths_nm: F64) -> dict:
    axes = axes_at(np.zeros(3), sun, radius_m)
    species = [] if medium is None else medium.species
    which = next((n for n, one in enumerate(species) if one.level), -1)
    table = np.zeros((2, 2, len(wavelengths_nm)))
    if which >= 0:
        altitude_deg = float(np.degrees(np.arcsin(np.clip(sun @ axes[2], -1, 1))))
        table = beyond_means(wavelengths_nm, altitude_deg, species[which].level)
    return {"plates": which, "plate_axes": axes, "plate_map": table}


def _no_grid(ground_m: float, nw: int) -> dict:
    f32 = np.float32
    return {
        "top_m": ground_m + 1e5, "low_m": ground_m, "high_m": ground_m, "gridded": False,
        "index_x0": 0.0, "index_y0": 0.0, "index_per_x": 0.0, "index_per_y": 0.0, "chart_origin_m": 0.0,
        "chart_per_m": 1.0, "chart": np.full((2, 2, 2), -1e9), "level_origin_m": 0.0, "level_per_m": 1.0,
        "level_table": np.zeros(2, np.int16), "levels_m": np.array([-1e9, -1e9 + 1]), "cell_m": np.full(2, 1e9),
        "periodic": False, "extinction": np.zeros((1, 1, 1, 1), f32), "relative": np.zeros((1, nw)),
        "scattering": np.zeros((1, nw)), "majorant": np.zeros((1, 1, 1), f32),
        "cloud_low_m": ground_m, "cloud_high_m": ground_m,
        "terrain_m": np.zeros((1, 1), f32), "normal": np.zeros((1, 1, 3)), "albedo": np.zeros((1, 1, nw)),
    }  # fmt: skip


def _grid(medium: Medium, lighting: Lighting, airy: bool) -> dict:
    ns, nw = len(medium.species), len(medium.wavelengths_nm)
    relative = np.array([s.relative_extinction for s in medium.species], float).reshape(ns, nw)
    omega = np.array([s.single_scattering_albedo for s in medium.species], float).reshape(ns, nw)
    extinction = np.ascontiguousarray(np.moveaxis(medium.extinction, 0, -1))
    if ns == 0:
        extinction, relative, omega = np.zeros((*medium.shape, 1), np.float32), np.zeros((1, nw)), np.zeros((1, nw))
    most = np.max([extinction @ row.astype(np.float32) for row in relative.T], axis=0)
    majorant = block_majorants(most, medium.periodic, 1 if medium.frame.curved else 0)
    levels = np.asarray(medium.levels_m, float)
    origin, per_m, table = _level_table(levels)
    top = float(levels[-1])
    terrain = medium.terrain_m
    flat = bool((terrain == terrain.flat[0]).all())
    ground = [medium.ground_m, float(terrain.min()), float(terrain.max())]
    if medium.periodic and not medium.frame.curved:
        ground = ground[:1]  # periodic scenes stand on sea level, as in the march
    elif flat and not medium.frame.curved:
        ground = ground[1:]
    normal = lighting.normal
    assert normal is not None
    x0, y0, per_x, per_y = 0.0, 0.0, 0.0, 0.0
    if terrain.size > 1 and not medium.frame.curved:
        per_x, per_y = 1.0 / medium.cell_m[0], 1.0 / medium.cell_m[1]
        x0, y0 = (-medium.place[0, 0, :2] * [per_x, per_y]).tolist()
    return {
        "index_x0": x0, "index_y0": y0, "index_per_x": per_x, "index_per_y": per_y,
        "top_m": max(top, medium.ground_m + 1e5) if airy else top, "low_m": min(ground), "high_m": max(ground),
        "gridded": bool(majorant.any()) or min(ground) < max(ground) or medium.terrain_m.size > 1,
        "chart_origin_m": medium.chart_origin_m, "chart_per_m": medium.chart_per_m, "chart": medium.chart,
        "level_origin_m": origin, "level_per_m": per_m, "level_table": table,
        "levels_m": levels, "cell_m": _least_cells(medium), "periodic": medium.periodic,
        "extinction": extinction, "relative": relative, "scattering": relative * omega,
        "majorant": majorant - empty_blocks(majorant, medium.periodic),
        **_cloud_between(most, levels, min(ground), max(ground)),
        "terrain_m": np.ascontiguousarray(terrain),
        "normal": np.ascontiguousarray(normal, float),
        "albedo": np.ascontiguousarray(np.moveaxis(lighting.albedo, 0, -1), float),
    }  # fmt: skip


def _cloud_between(most: F32, levels_m: F64, low_m: float, high_m: float) -> dict[str, float]:
    """Heights that have all cloud between them, and all hills: these are looked for only there."""
    full = np.flatnonzero(most.any(axis=(1, 2)))
    if not full.size:
        return {"cloud_low_m": low_m, "cloud_high_m": high_m}
    low, high = float(levels_m[max(full[0] - 1, 0)]), float(levels_m[min(full[-1] + 1, len(levels_m) - 1)])
    return {"cloud_low_m": min(low, low_m) if low_m < high_m else low, "cloud_high_m": max(high, high_m)}


def _level_table(levels_m: F64) -> tuple[float, float, NDArray[np.int16]]:
    """Origin and entries per metre of a table small enough for a core's nearest cache: steps up to a level are few."""
    count = 8 * len(levels_m)
    per_m = count / float(levels_m[-1] - levels_m[0])
    edges = levels_m[0] + (np.arange(count) - 1e-6) / per_m
    below = np.clip(np.searchsorted(levels_m, edges, "right") - 1, 0, len(levels_m) - 2)
    return float(levels_m[0]), per_m, below.astype(np.int16)


def _least_cells(medium: Medium) -> F64:
    """Least distance of neighbouring columns along x and y."""
    if not medium.frame.curved or medium.shape[1:] == (1, 1):
        return np.array(medium.cell_m, float)
    across = np.linalg.norm(np.diff(medium.place, axis=1), axis=-1).min()
    along = np.linalg.norm(np.diff(medium.place, axis=0), axis=-1).min()
    return np.array([across, along])


def block_majorants(extinction: F32, periodic: bool, beyond: int) -> F32:
    """Greatest extinction (blocks z, y, x) of nodes (nz, ny, nx) in blocks of cells and some cells beyond each face."""
    out = extinction
    for axis in range(3):
        wrap = periodic and axis > 0 and out.shape[axis] > 1
        n = out.shape[axis]
        cells = n if wrap else max(n - 1, 1)
        first = np.arange(0, cells, BLOCK)
        parts = []
        for a in first:
            index = np.arange(a - beyond, min(a + BLOCK, cells) + 1 + beyond)
            index = index % n if wrap else np.clip(index, 0, n - 1)
            parts.append(out.take(index, axis).max(axis, keepdims=True))
        out = np.concatenate(parts, axis)
    return np.ascontiguousarray(out * np.float32(1.00001), np.float32)


def empty_blocks(majorant: F32, periodic: bool) -> F32:
    """How many blocks around each empty one are empty too, in the largest-axis metric."""
    from scipy.ndimage import distance_transform_cdt

    empty = majorant == 0
    if empty.all():
        return np.full(empty.shape, _MOST_SKIP, np.float32)
    around = _MOST_SKIP if periodic else 0
    padded = np.pad(empty, [(0, 0), (around, around), (around, around)], mode="wrap")
    ny, nx = empty.shape[1:]
    away = distance_transform_cdt(padded, "chessboard")[:, around : around + ny, around : around + nx]
    return np.clip(away - 1, 0, _MOST_SKIP).astype(np.float32)


def _air_table(matter: Matter, ground_m: float):
    """Table (AIR_NODES, 3, nw) of the air above ``ground_m``, and the phase functions of haze and gas."""
    height = ground_m + AIR_STEP_M * np.arange(AIR_NODES)
    air = background(None, matter.wavelengths_nm, height) if matter.air is None else matter.air.at(height)
    extinction = air.rayleigh_per_m + air.absorption_per_m + air.aerosol_per_m
    rows = np.stack([extinction, air.rayleigh_per_m, air.aerosol_scattering_per_m])
    table = np.ascontiguousarray(rows.transpose(2, 0, 1))
    return table, air.aerosol_phase, air.rayleigh_phase


@kernel()
def _slant_depths(t, threads, extinction, ground_radius_m, out):
    """log of the slant depth to space of a profile (AIR_NODES, nw); axis sqrt of the cosine above the horizon.

    Gauss-Legendre with two points a step, steps even in the cube root of the distance from the lowest point.
    """
    nw = extinction.shape[1]
    top = (AIR_NODES - 1) * AIR_STEP_M
    for k in range(t, SUN_HEIGHTS, threads):
        above = top * (k / (SUN_HEIGHTS - 1.0)) ** 2
        r = ground_radius_m + above
        horizon = -math.sqrt(max(0.0, 1.0 - (ground_radius_m / r) ** 2))
        q = above * (2.0 * ground_radius_m + above)
        depth = np.zeros(nw)
        for m in range(SUN_COSINES):
            t = m / (SUN_COSINES - 1.0)
            s0 = (horizon + t * t * (1.0 - horizon)) * r
            s1 = math.sqrt(max(s0 * s0 + top * (2.0 * ground_radius_m + top) - q, 0.0))
            a, b = math.copysign(abs(s0) ** (1 / 3), s0), s1 ** (1 / 3)
            depth[:] = 0.0
            for n in range(2 * _SUN_STEPS):
                v = a + (b - a) * ((n // 2) + (0.21132486540518708 if n % 2 == 0 else 0.7886751345948129)) / _SUN_STEPS
                s = v * v * v
                h = height_of_square_m(q + s * s - s0 * s0, ground_radius_m)
                x = min(max(h / AIR_STEP_M, 0.0), AIR_NODES - 1.000001)
                i = int(x)
                f = x - i
                weight = 1.5 * v * v * (b - a) / _SUN_STEPS
                for w in range(nw):
                    depth[w] += weight * (extinction[i, w] * (1.0 - f) + extinction[i + 1, w] * f)
            for w in range(nw):
                out[k, m, w] = math.log(max(depth[w], 1e-30))
