"""What may still be seen beyond the part of a domain that is near: far clouds, in a wider and coarser grid."""

from __future__ import annotations

import math
from collections.abc import Callable

from openswim.readers.neighbourhood import FARTHER, MOST_RADIUS_M, Neighbourhood
from openswim.scene import Grid, Scene
from openswim.scene.grid import EARTH_RADIUS_M

_HIGHEST_CLOUD_M = 16_000.0


def far_m(height_m: float) -> float:
    """How far the highest clouds may be that stand above the horizon of an eye `height_m` up [m]."""
    dip = sum(math.acos(EARTH_RADIUS_M / (EARTH_RADIUS_M + max(h, 0.0))) for h in (height_m, _HIGHEST_CLOUD_M))
    return min(EARTH_RADIUS_M * dip, MOST_RADIUS_M)


def with_beyond(scene: Scene, around: Neighbourhood | None, read: Callable[[Neighbourhood], Scene]) -> Scene:
    """The part of a domain around a place, lying in what ``read`` finds beyond, where that is wanted and reaches."""
    far = None if around is None else around.beyond
    if far is None or scene.grid is None or not scene.cut:
        return scene
    wider = read(far)
    assert wider.grid is not None
    if _area(wider.grid) >= FARTHER**2 * _area(scene.grid):
        scene.wider = wider
        scene.notes = [*scene.notes, f"beyond, cells of {max(wider.grid.spacing_m()) / 1e3:.3g} km"]
    return scene


def _area(grid: Grid) -> float:
    _, ny, nx = grid.shape
    dx, dy = grid.spacing_m()
    return nx * dx * ny * dy
