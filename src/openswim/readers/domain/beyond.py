"""What may still be seen beyond the part of a domain that is near: far clouds, in a wider and coarser grid."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from openswim.readers.domain.cutting import is_large, part_of
from openswim.readers.domain.mesh import mesh_of
from openswim.readers.domain.neighbourhood import FARTHER, Neighbourhood
from openswim.scene import Scene

LEAST_SHARE = 0.5  # of its radius that a part must reach on all sides, to lie in a wider one


def seen_part(scene: Scene, around: Neighbourhood) -> Scene:
    """The part of a scene of very many columns, or of a large part of the Earth, that matters around a place, lying in
    what is seen beyond; any other scene as it is."""
    if scene.wider is not None or scene.grid is None or scene.grid.crs is None or not is_large(mesh_of(scene)):
        return scene
    return with_beyond(part_of(scene, around), around, lambda beyond: part_of(scene, beyond))


def with_beyond(scene: Scene, around: Neighbourhood | None, read: Callable[[Neighbourhood], Scene]) -> Scene:
    """The part of a domain around a place, lying in what ``read`` finds beyond, where that is wanted and reaches.

    Near a domain's end the part stays alone: the border between the two grids, whose invented details differ, would
    stand above the eye as a wall."""
    far = None if around is None else around.beyond
    if around is None or far is None or scene.grid is None or not scene.cut or _ends_near(scene, around):
        return scene
    wider = read(far)
    assert wider.grid is not None
    if math.prod(wider.grid.size_m()) >= FARTHER**2 * math.prod(scene.grid.size_m()):
        scene.wider = wider
        if scene.atmosphere is not None and wider.atmosphere is not None:  # one background for both
            scene.atmosphere = replace(scene.atmosphere, aerosol=wider.atmosphere.aerosol)
        scene.notes = [*scene.notes, f"beyond, cells of {max(wider.grid.spacing_m()) / 1e3:.3g} km"]
    return scene


def _ends_near(scene: Scene, around: Neighbourhood) -> bool:
    """Whether a part ends much nearer to its place than it would, did not the domain end there."""
    assert scene.grid is not None
    _, ny, nx = scene.grid.shape
    (dx, dy), (ix, iy) = scene.grid.spacing_m(), mesh_of(scene).index(around.lon, around.lat)
    return bool(min(dx * min(ix, nx - 1 - ix), dy * min(iy, ny - 1 - iy)) < LEAST_SHARE * around.radius_m)
