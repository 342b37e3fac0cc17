"""The shape of the ground: the model's, refined by the user's elevation models, and the default Earth's beyond."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.ground.maps import HeightMap, maps_of

if TYPE_CHECKING:
    from openswim.scene.frame import Frame
    from openswim.scene.scene import Scene

FloatArray = NDArray[np.float64]


def height_maps(scene: Scene) -> list[HeightMap]:
    """The user's elevation models of a scene, the coarsest first."""
    curved = scene.grid is not None and scene.grid.curved
    return maps_of(scene.ground).height if scene.ground is not None and curved else []


def refined_terrain(scene: Scene, terrain_m: NDArray[np.float32], fineness: int = 1) -> NDArray[np.float32]:
    """Terrain (ny, nx) at the grid's nodes, each divided by ``fineness``, with the user's elevation models put in."""
    maps, grid = height_maps(scene), scene.grid
    if not maps or grid is None:
        return terrain_m
    ny, nx = terrain_m.shape
    iy, ix = np.mgrid[0:ny, 0:nx] / fineness
    lon, lat = grid.lonlat(ix.ravel(), iy.ravel())
    height, known = mapped_height(maps, lat, lon, np.full(lat.size, min(grid.spacing_m()) / fineness))
    own = terrain_m.ravel()
    return (own + known * (height - own)).reshape(ny, nx).astype(np.float32)


def mapped_height(
    maps: list[HeightMap],
    lat: FloatArray,
    lon: FloatArray,
    footprint_m: FloatArray,
    between: Callable[[FloatArray], FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Height (n,) by the finest map that shows each place, and the share (n,) that is known.

    between: gives the places (n,) where ``lat`` and ``lon`` are but knots among them.
    """
    height, total = np.zeros(footprint_m.size), np.zeros(footprint_m.size)
    for one in maps:
        row, column = one.raster.pixel(lat, lon)
        if between is not None:
            row, column = between(row), between(column)
        h, known = one.height_at(row, column, footprint_m)
        total_after = known + (1 - known) * total
        height = np.where(
            total_after > 0, (known * h + (1 - known) * total * height) / np.maximum(total_after, 1e-9), 0.0
        )
        total = total_after
    return height, total


def mapped_normals(
    maps: list[HeightMap], frame: Frame, place: FloatArray, up: FloatArray, footprint_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Normals (n, 3) of the mapped ground at places (n, 3) in the scene frame, smoothed over what a pixel covers, and
    the share (n,) that is known."""
    first = np.cross(np.where(np.abs(up[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]]), up)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    second = np.cross(up, first)
    reach = np.maximum(footprint_m, maps[-1].pixel_m)
    normal, known = up.copy(), np.ones(len(place))
    for axis in (first, second):
        ahead, behind = (
            mapped_height(maps, *frame.latlon(place + sign * reach[:, None] * axis)[:2], footprint_m)
            for sign in (1.0, -1.0)
        )
        normal -= ((ahead[0] - behind[0]) / (2 * reach))[:, None] * axis
        known = np.minimum(known, np.minimum(ahead[1], behind[1]))
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True), (known > 0.5).astype(float)
