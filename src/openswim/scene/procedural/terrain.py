"""Procedural foothills with valleys and a lake, and the reflectance of what grows on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.scene.procedural.noise import FloatArray, blur, fractal_noise, lattice_noise, sample, smoothstep

WAVELENGTH_NM = np.array([450.0, 546.0, 615.0])

# Visible reflectance at WAVELENGTH_NM, green vegetation with its maximum near 550 nm (after Bowker,
# Davis, Myrick, Stacy and Jones 1985, NASA Reference Publication 1139).
_FOREST = (0.018, 0.038, 0.026)
_MEADOW = (0.032, 0.085, 0.058)
_ROCK = (0.130, 0.170, 0.190)
_WATER = (0.030, 0.035, 0.020)
_FIELDS = (
    (0.030, 0.090, 0.050),  # young green crop
    (0.045, 0.100, 0.090),  # ripening
    (0.060, 0.110, 0.145),  # ripe grain
    (0.065, 0.100, 0.125),  # bare soil
    (0.033, 0.075, 0.048),  # grass
)
_GROUP = 4  # fields to what a grid tells apart


def terrain_field(
    x_m: NDArray,
    y_m: NDArray,
    *,
    seed: int = 0,
    low_m: float = 500.0,
    high_m: float = 1100.0,
    lake_m: float = 560.0,
) -> tuple[FloatArray, FloatArray]:
    """Surface altitude (m) and land area fraction, both (ny, nx), of hills with a lake in the south-west.

    Hills are fractal noise; valleys run along the zero lines of smooth fields, where rivers would have cut
    them, and the small scales fade toward the valley floors. The lake is flat at `lake_m` and land rises
    gently from its shore.
    """
    rng = np.random.default_rng(seed)
    axes = (np.asarray(y_m, float), np.asarray(x_m, float))
    step = float(axes[1][1] - axes[1][0])
    smallest = 1.5 * step
    row, column = np.indices((len(axes[0]), len(axes[1])), dtype=np.float32)
    bend = [lattice_noise(rng, axes, max(1600.0, smallest)) * np.float32(300.0 / step) for _ in range(2)]
    bent = (row + bend[0], column + bend[1])
    main, side, gully = (
        _valley_sides(sample(lattice_noise(rng, axes, max(scale, smallest)), bent))
        for scale in (2300.0, 1050.0, 480.0)
    )
    rough = fractal_noise(rng, axes, max(800.0, smallest), smallest, gain=0.42)
    broad = smoothstep(lattice_noise(rng, axes, 5000.0), -1.8, 1.8)
    south = np.linspace(0.5, -0.5, len(axes[0]))[:, None]  # foothills: the mountains are southward
    hills = main * (0.55 + 0.5 * side * (0.6 + 0.5 * gully))
    relief = hills + 0.05 * rough * main + 0.35 * broad + 0.35 * south
    lowest, highest = np.quantile(relief, [0.002, 0.998])
    height = low_m + (high_m - low_m) * np.clip((relief - lowest) / (highest - lowest), 0, 1)

    shore_m = _shore_distance(rng, axes, smallest)
    blend = smoothstep(shore_m, 0.0, 3000.0)
    shelf = 6.0 * smoothstep(shore_m, 0.0, 2 * step) + 0.008 * np.maximum(shore_m, 0)
    height = lake_m + shelf * (1 - blend) + np.maximum(height - lake_m, -0.5 * (lake_m - low_m)) * blend
    land = np.clip(0.5 + shore_m / (1.5 * step), 0, 1)
    return np.where(shore_m <= 0, lake_m, height).astype(np.float32), land.astype(np.float32)


def _valley_sides(field: FloatArray) -> FloatArray:
    """Height above a valley floor that follows the zero lines of `field`: round below, level above."""
    return np.tanh(0.75 * (np.sqrt(field**2 + 0.04) - 0.2))


def _shore_distance(rng: np.random.Generator, axes: tuple[NDArray, ...], smallest_m: float) -> FloatArray:
    """About the distance to the shore in m, negative on the lake, (ny, nx): a bent ellipse with bays."""
    y, x = axes
    extent = min(np.ptp(x), np.ptp(y))
    long, short = 0.19 * extent, 0.072 * extent
    east, north = np.meshgrid(x - x.mean() + 0.15 * extent, y - y.mean() + 0.14 * extent)
    along, across = north * 0.94 + east * 0.34, east * 0.94 - north * 0.34
    across = across - 0.35 * short * np.sin(2.6 * along / long)
    bays = fractal_noise(rng, axes, max(0.05 * extent, smallest_m), smallest_m, gain=0.5)
    return ((np.hypot(along / long, across / short) - 1 + 0.12 * bays) * short).astype(np.float32)


def land_albedo(
    x_m: NDArray, y_m: NDArray, altitude_m: NDArray, land: NDArray, *, seed: int = 0
) -> FloatArray:
    """Spectral surface albedo (ny, nx, 3) at `WAVELENGTH_NM`: forest on slopes and heights, meadow, fields.

    Plausible summer values in the visible: forest 0.02-0.04, meadow 0.03-0.085, fields up to 0.15, rock up to
    0.19.
    """
    rng = np.random.default_rng(seed)
    axes = (np.asarray(y_m, float), np.asarray(x_m, float))
    step = float(axes[1][1] - axes[1][0])
    gradient_y, gradient_x = np.gradient(np.asarray(altitude_m, float), step)
    slope = np.hypot(gradient_x, gradient_y)
    woods = fractal_noise(rng, axes, max(800.0, 1.5 * step), 1.5 * step, gain=0.7)
    wooded = smoothstep(woods + 5 * (slope - 0.12) + (altitude_m - 800.0) / 250.0, 0.1, 0.5)
    level = lattice_noise(rng, axes, 1500.0) - 8 * (slope - 0.06) - (altitude_m - 680.0) / 150.0
    tilled = smoothstep(level, -0.2, 0.4)
    bare = smoothstep(slope + 0.05 * woods + (altitude_m - 1000.0) / 800.0, 0.42, 0.6)

    albedo = np.broadcast_to(np.asarray(_MEADOW), (*slope.shape, 3)) * (1 + 0.10 * woods[..., None])
    for cover, colour in ((tilled, _parcels(rng, axes)), (wooded, _FOREST), (bare, _ROCK)):
        albedo = albedo + cover[..., None] * (np.asarray(colour) - albedo)
    albedo = albedo * np.clip(1 + 0.08 * fractal_noise(rng, axes, 3 * step, 1.2 * step), 0.7, 1.3)[..., None]
    albedo = blur(albedo, (0.6, 0.6))  # a cell is a mixture, not a tile
    return (np.asarray(_WATER) + land[..., None] * (albedo - np.asarray(_WATER))).astype(np.float32)


def _parcels(rng: np.random.Generator, axes: tuple[NDArray, ...]) -> NDArray:
    """Reflectance (ny, nx, 3) of a patchwork of groups of fields, each about 250 by 400 m.

    A group is what is nearest to one seed; seeds are scattered one to a square of a skewed grid.
    """
    y, x = axes
    size = max(350.0, 3.0 * float(x[1] - x[0]))
    east, north = (grid + 200.0 * lattice_noise(rng, axes, 1500.0) for grid in np.meshgrid(x, y))
    along, across = (0.9 * east + 0.44 * north) / size, 1.6 * (0.9 * north - 0.44 * east) / size
    row, column = (np.floor(v - v.min()).astype(int) + 1 for v in (across, along))
    seeds = rng.random((row.max() + 2, column.max() + 2, 2))
    nearest = np.full(row.shape, np.inf)
    owner = np.zeros(row.shape, int)
    for down, right in np.ndindex(3, 3):
        r, c = row + down - 1, column + right - 1
        distance = (across - across.min() + 1 - r - seeds[r, c, 0]) ** 2
        distance += (along - along.min() + 1 - c - seeds[r, c, 1]) ** 2
        owner = np.where(distance < nearest, r * seeds.shape[1] + c, owner)
        nearest = np.minimum(distance, nearest)
    count = seeds.shape[0] * seeds.shape[1]
    fields = rng.choice(len(_FIELDS), (count, _GROUP), p=[0.25, 0.2, 0.2, 0.1, 0.25])
    colours = np.asarray(_FIELDS)[fields].mean(axis=1)
    return (colours * rng.normal(1.0, 0.12, (count, 1)).clip(0.7, 1.3))[owner]
