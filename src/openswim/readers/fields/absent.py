"""What files lack and what stands in for it, in one line each."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.scene.variables import HYDROMETEORS

SNOW_COVERS_KG_M2 = 15.0  # from which on snow hides the ground: ECMWF's TESSEL
_LOW_TOP_M = 10_000.0
INSTEAD = {
    "surface_altitude": "terrain height from the ground map",
    "land_area_fraction": "land and water from the ground map",
    "snow_area_fraction": "no snow on the ground assumed",
    "sea_ice_area_fraction": "no sea ice assumed",
    "surface_albedo": "surface albedo from the ground map",
    "wind_east_10m": "default wind over water",
}
FLAT_INSTEAD = {"surface_altitude": "sea level", "surface_albedo": "a grey ground of albedo .15"}


def no_species(found: Container[Any]) -> list[str]:
    """Which hydrometeors there are none of among the scene's variables found in a file."""
    absent = [species for species in HYDROMETEORS if f"{species}_content" not in found]
    return [f"no {', '.join(absent)} in the file: none assumed"] if absent else []


def no_sizes(found: Container[Any]) -> list[str]:
    """Which hydrometeors come without a number or an effective radius among the variables found in a file."""
    unsized = [
        species
        for species in HYDROMETEORS
        if f"{species}_content" in found
        and not any(f"{species}_{what}" in found for what in ("number", "effective_radius"))
    ]
    return [f"no sizes of {', '.join(unsized)}: those of their content (docs/optics.md)"] if unsized else []


def no_ground(
    found: Container[Any], instead: Mapping[str, str] = INSTEAD, called: Mapping[str, str] | None = None
) -> list[str]:
    """What of the ground is not among the variables found; `called`: what the file's model calls it."""
    names = {} if called is None else called
    return [f"no {names.get(name, name)} in the file: {text}" for name, text in instead.items() if name not in found]


def low_top(height_m: NDArray[Any]) -> list[str]:
    """Where levels (nz, ...) end below where clouds end."""
    top_m = float(np.max(height_m[-1]))
    return [f"levels end at {top_m / 1e3:.1f} km: no cloud above"] if top_m < _LOW_TOP_M else []
