"""Precipitable water: that of a scene at a place, and what temperature and humidity at the ground tell of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.scene.interpolation import corners

if TYPE_CHECKING:
    from openswim.scene.scene import Scene

FIELD = "precipitable_water"
KG_M2_PER_CM = 10.0


def scene_vapour_cm(scene: Scene, x: float, y: float) -> float | None:
    """Precipitable water above the ground (cm) that a scene has at a place: x and y are longitude and latitude, or
    metres in a flat scene. None where the scene does not say."""
    for level in scene.levels:
        if FIELD not in level.data:
            continue
        values = np.asarray(level.data[FIELD].values, float)
        if values.ndim == 0:
            return float(values) / KG_M2_PER_CM
        grid = level.grid
        assert grid is not None
        ix, iy = grid.place(x, y)
        ny, nx = values.shape
        if not (-0.5 <= ix <= nx - 0.5 and -0.5 <= iy <= ny - 0.5) and level.wider is not None:
            continue
        row, column, weight = corners(ix, iy, (ny, nx))
        return float((weight * values[row, column]).sum()) / KG_M2_PER_CM
    return None


def vapour_by_humidity_cm(temperature_k: ArrayLike, relative_humidity: ArrayLike) -> NDArray[np.float64]:
    """Precipitable water (cm) by temperature and relative humidity (0 to 1) at the ground: Gueymard (1994).

    Single days are off by some 20 per cent; .1 cm is the least that is returned.
    """
    kelvin = np.asarray(temperature_k, float)
    theta = kelvin / 273.15
    scale_km = 0.4976 + 1.5265 * theta + np.exp(13.6897 * theta - 14.9188 * theta**3)
    saturation_hpa = np.exp(22.330 - 49.140 * 100 / kelvin - 10.922 * (100 / kelvin) ** 2 - 0.39015 * kelvin / 100)
    vapour_g_m3 = 216.7 * np.asarray(relative_humidity, float) / kelvin * saturation_hpa
    return np.maximum(0.1 * scale_km * vapour_g_m3, 0.1)
