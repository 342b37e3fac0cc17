"""How much aerosol is above a place: the optical depth of the background and of the scene's own fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.optics.layers import beside_background, ground_of_place_m
from openswim.scene.variables import DIRECT_PREFIX

if TYPE_CHECKING:
    from openswim.scene.scene import Scene

F32 = NDArray[np.float32]
AT_NM = 550.0


def aerosol_depth(scene: Scene, above_m: float, place: tuple[float, float] | None = None) -> float:
    """Vertical optical depth at 550 nm of all aerosol above a height over sea level.

    place: fractional (column, row) on the scene's grid; None beyond its sides, where only the background is.
    """
    depth = 0.0
    if scene.atmosphere is not None:
        for layer in scene.atmosphere.above_ground(ground_of_place_m(scene)).layers:
            depth += layer.depth_above(above_m, AT_NM)
    if place is None or scene.grid is None:
        return depth
    heights = scene.grid.height_m
    levels = heights if heights.ndim == 1 else _at(heights, place)
    nodes = np.unique(np.append(np.maximum(levels, above_m), above_m))
    for name, field in aerosol_fields(scene).items():
        column = _at(beside_background(scene, name, field), place)
        depth += float(np.trapezoid(np.interp(nodes, levels, column, right=0.0), nodes))
    return depth


def aerosol_fields(scene: Scene) -> dict[str, F32]:
    """Extinction (nz, ny, nx) at 550 nm of the scene's aerosol by name of species."""
    names = {"aerosol": "aerosol_extinction"} if "aerosol_extinction" in scene.data else {}
    names |= {name: DIRECT_PREFIX + name for name, own in scene.optics.items() if own.kind == "aerosol"}
    return {
        species: np.asarray(scene.data[name].transpose("z", "y", "x").values, np.float32)
        for species, name in names.items()
        if name in scene.data
    }


def _at(field: NDArray[np.floating], place: tuple[float, float]) -> NDArray[np.float64]:
    """The column (nz,) of a field at fractional indices, linear between its nodes."""
    (ix, iy), (_, ny, nx) = place, field.shape
    i, j = (min(max(int(p), 0), max(n - 2, 0)) for p, n in ((ix, nx), (iy, ny)))
    east, north = (min(max(p - k, 0.0), 1.0) if n > 1 else 0.0 for p, k, n in ((ix, i, nx), (iy, j, ny)))
    u, v = min(i + 1, nx - 1), min(j + 1, ny - 1)
    low = field[:, j, i] * (1 - east) + field[:, j, u] * east
    high = field[:, v, i] * (1 - east) + field[:, v, u] * east
    return np.asarray(low * (1 - north) + high * north, float)
