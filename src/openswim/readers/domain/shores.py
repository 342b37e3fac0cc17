"""Whether a file's land lies where the Earth has land: what tells rows that run the wrong way, and a wrong place."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from openswim.errors import UserError
from openswim.ground.earth import water_at_nearest
from openswim.scene import Scene

_NODES = 128  # each way
_NARROWEST_M = 5e4  # of domains: shores are known to 5 km
# Of nodes that are land in one and sea in the other, and of agreement beyond chance (Cohen's kappa): real files have up
# to 12 % (UM, two cells wide), from .3 on where there are shores
_ASTRAY, _BY_CHANCE = 0.25, 0.3


def astray(scene: Scene) -> list[str]:
    """A note on land that agrees with the Earth's by chance only."""
    grid = scene.grid
    if grid is None or not grid.curved or "land_area_fraction" not in scene.data or min(grid.size_m()) < _NARROWEST_M:
        return []
    rows, columns = (np.arange(0, size, max(1, size // _NODES)) for size in grid.shape[1:])
    own = scene.data["land_area_fraction"].values[np.ix_(rows, columns)] > 0.5
    with suppress(UserError):  # without the maps there is nothing to compare with
        lon, lat = grid.lonlat(*(index.astype(float) for index in np.meshgrid(columns, rows)))
        known = np.isfinite(lon) & np.isfinite(lat)
        own, earth = own[known], water_at_nearest(lat[known], lon[known]) == 0
        differ, chance = float((own != earth).mean()), float(own.mean() + earth.mean() - 2 * own.mean() * earth.mean())
        if differ > _ASTRAY and chance - differ < _BY_CHANCE * chance:
            return [
                f"{100 * differ:.0f} % of the file's nodes are land where the Earth has sea, or sea where it has land: "
                "do rows and columns run the right way, and is the file's place right?"
            ]
    return []
