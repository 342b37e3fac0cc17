"""Shores, ice at sea and snow of files that have none; and whether a file's land lies where the Earth has land, which
tells rows that run the wrong way, and a wrong place."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.ground import earth
from openswim.readers.fields.absent import INSTEAD
from openswim.scene import Grid, Scene
from openswim.scene.variables import SURFACE_DIMS

_NODES = 128  # each way
_NARROWEST_M = 5e4  # of domains: shores are known to 5 km
# Of nodes that are land in one and sea in the other, and of agreement beyond chance (Cohen's kappa): real files have up
# to 12 % (UM, two cells wide), from .3 on where there are shores
_ASTRAY, _BY_CHANCE = 0.25, 0.3
# Broadband albedo of open water, of ice in it; no land is as dark as the one, no water as bright as the other
_WATER, _ICE, _LEAST_LAND, _LEAST_ICE = 0.06, 0.6, 0.08, 0.3
# No desert is as bright so far from the equator; under snow land is in the mean
_LEAST_SNOW, _SNOW_DEG, _BARE, _SNOW = 0.4, 40.0, 0.15, 0.8
_ICE_BY_ALBEDO = f"sea ice by the surface albedo, where that of water is above {_LEAST_ICE:g}"
_SNOW_BY_ALBEDO = f"snow by the surface albedo, where land beyond {_SNOW_DEG:.0f} degrees has more than {_LEAST_SNOW:g}"


def complete_ground(scene: Scene) -> None:
    """Land and water from the map, where the notes of a scene with an albedo say so: without them the albedo would be
    that of a ground which is the same in all directions, at sea too. And sea ice and snow by the albedo, where nothing
    else tells of them."""
    grid, data = scene.grid, scene.data
    if grid is None or not grid.curved or "surface_albedo" not in data or "wavelength" in data["surface_albedo"].dims:
        return
    albedo = data["surface_albedo"].transpose(*SURFACE_DIMS).values
    fields: dict[str, NDArray[np.float32] | None] = {}
    if "land_area_fraction" in data:
        land = data["land_area_fraction"].transpose(*SURFACE_DIMS).values
    elif _lacks(scene, "land_area_fraction"):
        try:
            land = _land_of_the_map(grid)
        except UserError:  # without the maps the albedo is all there is
            return
        fields |= {"land_area_fraction": land, "surface_albedo": _of_land(albedo, land)}
    else:
        return
    if _lacks(scene, "sea_ice_area_fraction"):
        icy, share = (land < 0.5) & (albedo > _LEAST_ICE), (albedo - _WATER) / (_ICE - _WATER)
        fields |= _by_albedo(scene, "sea_ice_area_fraction", icy, share, _ICE_BY_ALBEDO)
    white = (land >= 0.5) & (albedo > _LEAST_SNOW)
    if _lacks(scene, "snow_area_fraction") and "snow_depth" not in data and white.any():
        white &= np.abs(_places(grid)[1]) > _SNOW_DEG
        share = (albedo - _BARE) / (_SNOW - _BARE)
        fields |= _by_albedo(scene, "snow_area_fraction", white, share, _SNOW_BY_ALBEDO)
    if fields:
        found = {name: (SURFACE_DIMS, values) for name, values in fields.items() if values is not None}
        scene.data = data.drop_vars(list(fields), errors="ignore").assign(found)


def _lacks(scene: Scene, name: str) -> bool:
    """Whether a model's file has none of it; a scene that was made by hand is meant to have none."""
    return name not in scene.data and any(note.endswith(f": {INSTEAD[name]}") for note in scene.notes)


def _by_albedo(
    scene: Scene, name: str, where: NDArray[np.bool_], share: NDArray[np.floating], told: str
) -> dict[str, NDArray[np.float32]]:
    """A cover that the albedo tells, ``told`` in its note; nothing if there is none."""
    if not where.any():
        return {}
    scene.notes = [note.replace(INSTEAD[name], told) for note in scene.notes]
    return {name: np.where(where, np.clip(share, 0.0, 1.0), 0.0).astype(np.float32)}


def _of_land(albedo: NDArray[np.float32], land: NDArray[np.float32]) -> NDArray[np.float32] | None:
    """The albedo (ny, nx), where there is water in the file and land on the map that of the nearest node of land; None
    where all is water."""
    from scipy.ndimage import distance_transform_edt

    known = (land >= 0.5) & (albedo >= _LEAST_LAND)
    if not known.any():
        return None
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.where((land >= 0.5) & ~known, albedo[tuple(nearest)], albedo)


def _land_of_the_map(grid: Grid) -> NDArray[np.float32]:
    """Share of land (ny, nx) around each node."""
    lon, lat = (each.ravel() for each in _places(grid))
    cell_m = min(grid.spacing_m())
    if cell_m > earth.MASK_M:
        land = earth.mean_land(lat, lon, cell_m)
    else:
        land = 1 - earth.sharpened(earth.water_fraction(lat, lon))
    return land.reshape(grid.shape[1:]).astype(np.float32)


def _places(grid: Grid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Longitude and latitude (ny, nx) of the nodes."""
    row, column = np.indices(grid.shape[1:], dtype=float)
    return grid.lonlat(column, row)


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
        own, there = own[known], earth.water_at_nearest(lat[known], lon[known]) == 0
        differ, chance = float((own != there).mean()), float(own.mean() + there.mean() - 2 * own.mean() * there.mean())
        if differ > _ASTRAY and chance - differ < _BY_CHANCE * chance:
            return [
                f"{100 * differ:.0f} % of the file's nodes are land where the Earth has sea, or sea where it has land: "
                "do rows and columns run the right way, and is the file's place right?"
            ]
    return []
