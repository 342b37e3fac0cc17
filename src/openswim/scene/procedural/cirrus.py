"""Procedural cirrus: ice that falls out of generating cells and is drawn into streaks by wind shear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.scene.procedural.noise import FloatArray, blur, fractal_noise, lattice_noise, sample, smoothstep

_ICE_DENSITY = 917.0


def cirrus_field(
    x_m: NDArray,
    y_m: NDArray,
    height_m: NDArray,
    *,
    seed: int = 0,
    base_m: float = 9500.0,
    top_m: float = 10_800.0,
    optical_depth: float = 0.15,
    wind_from_deg: float = 250.0,
) -> tuple[FloatArray, FloatArray]:
    """Ice water content (kg m-3) and effective radius (m) of cirrus over part of the domain, (nz, ny, nx).

    Ice falls out of generating cells at the top and trails behind them where the wind is weaker, so every
    level shows the cells moved along the wind and a little more diffuse (Heymsfield 1975, J. Atmos. Sci. 32,
    799). `optical_depth` is the mean over cloudy columns (tau > 0.03), that of thin cirrus (.03 to .3, Sassen
    and Comstock 2001, J. Atmos. Sci. 58, 2113); no column has more than 2.5 times as much. In a deep layer
    fibres hide each other from all but those who look along them. Radii grow from 25 um at the top to 40 um.
    """
    rng = np.random.default_rng(seed)
    z, x, y = (np.asarray(axis, float) for axis in (height_m, x_m, y_m))
    step, middle_x, middle_y = x[1] - x[0], x.mean(), y.mean()
    toward = np.radians(wind_from_deg + 180.0)
    east, north = np.meshgrid(x - middle_x, y - middle_y)
    along = east * np.sin(toward) + north * np.cos(toward)
    across = east * np.cos(toward) - north * np.sin(toward)

    trail_m = 8000.0
    half = 0.5 * np.hypot(np.ptp(x), np.ptp(y)) + trail_m + 2 * step
    # finer across than the grid: resampling between nodes dims, and at the grid's own spacing that shows as ripples
    finer = 0.4 * step
    rulers = np.arange(-half, half + step, finer), np.arange(-half, half + step, step)
    cells = _generating_cells(rng, rulers, float(step))
    content = np.zeros((len(z), len(y), len(x)), np.float32)
    fall = (top_m - z) / (top_m - base_m)
    across = across + 2.2e-5 * along**2
    for width_m, wavelength_m in ((300.0, 3500.0), (80.0, 1200.0)):
        across += width_m * lattice_noise(rng, (y, x), wavelength_m)
    for level in np.flatnonzero((fall > 0) & (fall < 1)):
        t = float(fall[level])
        # about a cell, for nodes draw finer fibres as beads
        across_cells = max(0.8, (0.2 + 0.6 * t) * 100.0 / step)
        blurred = blur(cells, (across_cells * step / finer, (2.0 + 8.0 * t) * 100.0 / step))
        there = sample(blurred, ((across + half) / finer, (along + trail_m * t**1.5 + half) / step))
        content[level] = there * min(t / 0.2, 1.0) * (1 - t) ** 0.7

    content *= _cirrus_sheet(rng, x, y)
    radius = np.interp(fall, [0.0, 1.0], [25.0e-6, 40.0e-6]).astype(np.float32)
    per_content = (1.5 * np.gradient(z) / (radius * _ICE_DENSITY)).astype(np.float32)
    depth = np.tensordot(per_content, content, axes=1)
    wanted = _rescaled(depth, optical_depth, 2.5 * optical_depth)
    content *= wanted / np.maximum(depth, 1e-30)
    return content, np.broadcast_to(radius[:, None, None], content.shape).copy()


def _rescaled(depth: FloatArray, mean: float, limit: float) -> FloatArray:
    """Relative optical depth (ny, nx) bent to stay below `limit`, with the `mean` over tau > 0.03."""
    scale = limit / max(float(depth.max()), 1e-30)
    for _ in range(30):
        wanted = limit * -np.expm1(-scale * depth / limit)
        cloudy = wanted[wanted > 0.03]
        scale *= mean / float(cloudy.mean()) if cloudy.size else 2.0
    return wanted


def _generating_cells(rng: np.random.Generator, rulers_m: tuple[NDArray, NDArray], step_m: float) -> FloatArray:
    """Relative ice source at cirrus top on (across, along) the wind: fibres gathered into tufts."""
    # a fibre is about two lattice widths across: four nodes
    fine = lattice_noise(rng, rulers_m, (max(150.0, 2.0 * step_m), 4000.0))
    medium = lattice_noise(rng, rulers_m, (max(420.0, 5.0 * step_m), 3000.0))
    tufts = lattice_noise(rng, rulers_m, (1300.0, 2500.0))
    return np.exp(1.2 * fine + 0.6 * medium) * smoothstep(tufts + 0.35 * medium, -0.3, 1.8)


def _cirrus_sheet(rng: np.random.Generator, x_m: NDArray, y_m: NDArray) -> FloatArray:
    """Where cirrus is at all, 0..1 (ny, nx): a broad soft patch that ends inside the domain."""
    extent_x, extent_y = np.ptp(x_m), np.ptp(y_m)
    broad = lattice_noise(rng, (y_m, x_m), 0.22 * min(extent_x, extent_y))
    ragged = fractal_noise(rng, (y_m, x_m), 0.12 * min(extent_x, extent_y), 400.0)
    across, along = np.abs(y_m - y_m.mean())[:, None] / extent_y, np.abs(x_m - x_m.mean())[None, :] / extent_x
    to_edge = 0.5 - (across**4 + along**4) ** 0.25  # a square without corners
    inside = smoothstep(to_edge - 0.05 * np.abs(ragged), 0.005, 0.3)
    return (inside * smoothstep(broad + 0.12 * ragged, -1.2, 1.8)) ** 1.5
