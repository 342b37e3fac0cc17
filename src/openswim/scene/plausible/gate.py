"""Whether a scene can be: air that weighs what air weighs, clouds and particles of their sizes, places on Earth.

Every scene passes here, whatever reader or program has made it. What no atmosphere has is refused, with the factor by
which it is off; what is odd is told in a note. `checks.py` looks at single values, field by field; here fields are
compared with each other and with heights.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.grid import Grid
from openswim.scene.plausible.air import check_pressure, check_temperature, warmth
from openswim.scene.plausible.clouds import cover, water
from openswim.scene.plausible.samples import sampled

_EARTHS_M = (6.2e6, 6.6e6)  # radii of planets that have the Earth's air
_BURIED_M = 500.0  # lowest levels higher than this above the ground are told
_WIDE = 4.0  # times as wide as tall


def check_plausible(data: xr.Dataset, grid: Grid | None) -> list[str]:
    """Notes on what is odd in a scene's fields (z, y, x); UserError where they cannot be."""
    if grid is None:
        return []
    notes = _places(grid)
    heights = sampled(grid.height_m) if grid.height_m.ndim == 3 else grid.height_m[:, None, None]
    if _EARTHS_M[0] < grid.earth_radius_m < _EARTHS_M[1]:
        if "air_temperature" in data:
            check_temperature(data["air_temperature"].values, grid.height_m)
        if "air_pressure" in data:
            pressure = data["air_pressure"].values
            check_pressure(pressure, grid.height_m, heights)
            if "air_temperature" in data:
                notes += warmth(pressure, data["air_temperature"].values, heights)
    terrain = data["surface_altitude"].values if "surface_altitude" in data else None
    return notes + water(data, heights) + cover(data) + high_bottom(grid.height_m[0], terrain)



def _places(grid: Grid) -> list[str]:
    """Cells of a shape that models have."""
    if not grid.curved:
        return []
    dx, dy = grid.step  # in degrees too: a model's cells are narrow only near the poles
    if not np.isfinite(grid.lonlat(*grid.centre_index)).all():
        raise UserError("grid: its centre is no place on Earth: correct the coordinates, or the projection")
    if max(dx / dy, dy / dx) <= _WIDE:
        return []
    units = "degrees" if grid.in_degrees else "m"
    return [f"cells of {dx:.3g} x {dy:.3g} {units}: are both coordinates in the same unit?"]



def high_bottom(lowest_m: NDArray[Any], terrain_m: NDArray[Any] | None) -> list[str]:
    """A note on ground (ny, nx) far below the lowest level: what is between is missing."""
    where = "sea level" if terrain_m is None else "the ground"
    gap_m = float(np.median(lowest_m if terrain_m is None else lowest_m - terrain_m))
    told = f"the lowest level is {gap_m:.0f} m above {where}: nothing is known of what is between"
    return [told] if gap_m > _BURIED_M else []
