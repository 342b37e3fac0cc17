"""Where an observer stands: which of nested grids covers the place, how high the ground is, which way is up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.optics.aerosol_depth import aerosol_depth
from openswim.scene import Grid, Scene
from openswim.scene.frame import scene_frame
from openswim.scene.grid import EDGE, extent_text
from openswim.transport import Field, ReferenceField
from openswim.transport.engine.interpolation import bilinear

F64 = NDArray[np.float64]

SPACE_M = 1e5
_ROUGH_M = 50.0  # by which the ground that is seen may lie below a model's terrain


def check_observer(scene: Scene, camera: Camera, solver: str) -> None:
    """Complain where the observer is outside the domain or buried; needs no light."""
    height = camera.height_m
    if not np.isfinite(height) or height < 0:
        raise UserError(f"the observer is {-height:g} m under the ground: give --height of 0 m or more")
    camera.check_frame(scene_frame(scene).curved)
    if scene.grid is None or scene.grid.periodic or camera.height_m >= SPACE_M:
        return
    levels = scene.levels[:1] if solver == "reference" else scene.levels
    if camera.above == "sea level" and (terrain_m := terrain_below(levels, *place_of(camera))) is not None:
        check_above_ground(camera, terrain_m - _ROUGH_M)
    if grid_place(levels, *place_of(camera)) is None and not _aloft(camera):
        assert levels[-1].grid is not None
        raise UserError(f"the observer is outside the domain: {extent_of(levels[-1].grid)}")


def _aloft(camera: Camera) -> bool:
    """Whether no ground need be looked for below the camera."""
    return camera.height_m >= SPACE_M or camera.above == "sea level"


def check_above_ground(camera: Camera, ground_m: float) -> None:
    """Complain where a camera whose height counts from sea level is in the ground."""
    if camera.above == "sea level" and camera.height_m < ground_m:
        raise UserError(
            f"the camera at {camera.height_m:g} m above sea level is in the ground, which lies at {ground_m:.0f} m "
            "there: give a --height above it"
        )


def ground_below(scene: Scene, field: Field | ReferenceField, camera: Camera) -> float:
    """Height of the ground under the camera (m); 0 under one that is in space, or not over the domain."""
    grid = scene.grid
    if grid is None or field.medium is None:
        return field.ground_m
    if grid.periodic or camera.height_m >= SPACE_M:
        return 0.0
    x, y = place_of(camera)
    if field.landscape is not None:
        return field.landscape.ground_m(y, x)
    media = field.media
    found = grid_place(scene.levels[: len(media)], x, y)
    if found is None:  # above sea level, or `check_observer` would have complained
        return 0.0
    level, ix, iy = found
    fineness = media[level].fineness
    return float(bilinear(media[level].terrain_m, np.array([ix * fineness]), np.array([iy * fineness]))[0])


def grid_place(levels: Sequence[Scene], x: float, y: float) -> tuple[int, float, float] | None:
    """The finest of nested scenes that covers a place, and the place's fractional indices in it."""
    for level, scene in enumerate(levels):
        grid = scene.grid
        assert grid is not None
        ix, iy = (float(v) for v in grid.place(x, y))
        _, ny, nx = grid.shape
        inner = min(max(ix, 0.0), nx - 1.0), min(max(iy, 0.0), ny - 1.0)
        if max(abs(ix - inner[0]), abs(iy - inner[1])) < EDGE:
            return level, *inner
    return None


def terrain_below(levels: Sequence[Scene], x: float, y: float) -> float | None:
    """Height (m above sea level) of nested scenes' terrain at a place; None where their files have none."""
    found = grid_place(levels, x, y)
    if found is None or "surface_altitude" not in levels[found[0]].data:
        return None
    level, ix, iy = found
    terrain = np.ascontiguousarray(levels[level].data["surface_altitude"].values)
    return float(bilinear(terrain, np.array([ix]), np.array([iy]))[0])


def aerosol_above(levels: Sequence[Scene], camera: Camera, ground_m: float) -> float:
    """Vertical optical depth at 550 nm of all aerosol of nested scenes above the ground at a camera."""
    found = None if levels[0].grid is None else grid_place(levels, *place_of(camera))
    if found is None:
        return aerosol_depth(levels[-1], ground_m)
    return aerosol_depth(levels[found[0]], ground_m, found[1:])


def place_of(camera: Camera) -> tuple[float, float]:
    """Longitude and latitude (degrees) of a camera, or x and y (m) in a flat scene."""
    x, y = (camera.lon, camera.lat) if camera.x_m is None else (camera.x_m, camera.y_m)
    assert x is not None  # Camera has checked
    assert y is not None
    return x, y


def extent_of(grid: Grid) -> str:
    """What a domain covers, for an error message."""
    if not grid.curved:
        return f"choose x in {grid.x[0]:g} to {grid.x[-1]:g} m and y in {grid.y[0]:g} to {grid.y[-1]:g} m"
    return extent_text(grid)
