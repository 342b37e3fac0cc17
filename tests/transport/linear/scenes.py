"""Small worlds for the linear core: a lumpy cloud, a thin haze, an all-sky camera, a satellite and two pyranometers."""

from typing import Any

import numpy as np
from tests.transport.linear.plain import plain_core

from openswim.scene.phase import HenyeyGreenstein
from openswim.scene.rays import Rays
from openswim.transport.linear.operator import LinearCore
from openswim.transport.linear.optics import Scatterer

CELL_M = 40.0


def eyes(columns: tuple[int, int], size: int = 8) -> list[Rays]:
    """An all-sky camera on the ground and slanting parallel rays from above."""
    ny, nx = columns
    u, v = np.meshgrid(*(2 * [(np.arange(size) + 0.5) / size * 2 - 1]))
    r = np.hypot(u, v)
    zenith, azimuth = np.radians(75) * r[r <= 1], np.arctan2(v, u)[r <= 1]
    up = np.column_stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])
    z, a = np.radians([25, 70])
    down = -np.array([np.sin(z) * np.cos(a), np.sin(z) * np.sin(a), np.cos(z)])
    share = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(share * CELL_M * (nx - 1), share * CELL_M * (ny - 1))
    end = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    return [Rays(np.array([0.47 * CELL_M * nx, 0.43 * CELL_M * ny, 1e-3]), up), Rays(end - 2000 * down, down)]


def lumpy(
    shape: tuple[int, int, int] = (7, 8, 9), omega: tuple[float, ...] = (1.0, 0.97), depth: float = 1.0,
    albedo: float = 0.3, **settings: Any,
) -> tuple[LinearCore, np.ndarray, np.ndarray]:  # fmt: skip
    """A core, extinction (w, 2, nz, ny, nx) with clear nodes, of depth about ``depth`` in a cell, and albedo."""
    rng, waves = np.random.default_rng(2), len(omega)
    nz, ny, nx = shape
    kinds = [
        Scatterer("cloud", np.array(omega), [HenyeyGreenstein(0.85)] * waves),
        Scatterer("haze", 0.9 * np.array(omega), [HenyeyGreenstein(0.6)] * waves),
    ]
    levels = np.concatenate([CELL_M * np.arange(nz - 1), [CELL_M * (nz - 0.4)]])
    settings = {"sky": 0.12, "below": 0.1, "tolerance": 1e-14, "memory": 5} | settings
    core = plain_core(
        levels, (CELL_M, CELL_M), (ny, nx), (0.6, 0.3, 0.7), kinds, eyes((ny, nx)), [[0.42 * ny, 0.4 * nx], [5, 6]],
        **settings,
    )  # fmt: skip
    z, y, x = np.meshgrid(*(np.arange(n) / n for n in shape), indexing="ij")
    lump = np.exp(-(((z - 0.5) / 0.22) ** 2 + ((y - 0.5) / 0.25) ** 2 + ((x - 0.5) / 0.25) ** 2))
    extinction = np.empty((waves, 2, *shape))
    for w in range(waves):
        cloud = depth / CELL_M * lump * (0.5 + rng.random(shape))
        extinction[w, 0] = np.where(cloud < 0.05 * depth / CELL_M, 0.0, cloud)
        extinction[w, 1] = 2e-4 * np.exp(-2 * z)
    return core, extinction, albedo * (0.7 + 0.3 * rng.random((waves, ny, nx)))
