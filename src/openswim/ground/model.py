"""What a model says of the ground, worked out once for all places that are looked at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.ground import earth, snow, spectra
from openswim.ground.fields import Filled, blurred, spectral

if TYPE_CHECKING:
    import xarray as xr

    from openswim.scene.scene import Scene

FloatArray = NDArray[np.float64]

_BARE = 0.05  # snow cover below which a model's albedo is that of the land
DARK_LAND = 0.08  # what is taken to lie between patches of snow
_SAME_EARTH = 0.98  # share of nodes in plain land and sea that are so on the default Earth; some lakes are missing
_LEAST_DEVIATION_M = 50.0  # of heights, below which land is flat to snow


@dataclass(frozen=True, eq=False)
class ModelGround:
    """Fields (ny, nx) of a curved scene's ground at wavelengths; None for what it does not have.

    land, sea_ice, snow_age, wind_speed: as the scene has them (fractions, days, m/s); wave_slope: mean square slope of
    waves at nodes that have one above zero; sharp_shores: whether nodes are either land or water; like_earth: whether
    land is the default Earth's seen more coarsely, so that its shores are used; snow_near: share of the neighbourhood
    under snow; standing_out: height above the neighbourhood in its standard deviations; land_albedo: of nodes without
    snow, (k) at wavelengths if it `has_spectrum`, else the visible level; snow_level: visible level of what is white.
    """

    has_spectrum: bool = False
    land: FloatArray | None = None
    sharp_shores: bool = False
    like_earth: bool = False
    sea_ice: FloatArray | None = None
    wind_speed: Filled | None = None
    wave_slope: Filled | None = None
    snow_near: Filled | None = None
    snow_age: FloatArray | None = None
    standing_out: FloatArray | None = None
    land_albedo: Filled | None = None
    snow_level: Filled | None = None

    @classmethod
    def of(cls, scene: Scene, wavelengths_nm: FloatArray) -> ModelGround:
        """What a scene on a curved grid has; others say nothing of the ground but its albedo."""
        if scene.grid is None or not scene.grid.curved:
            return cls()
        data = scene.data
        land, wind = _surface(data, "land_area_fraction"), None
        east, north = _surface(data, "wind_east_10m"), _surface(data, "wind_north_10m")
        if east is not None and north is not None:
            wind = Filled(np.hypot(east, north), np.ones(east.shape, bool))
        slope = _surface(data, "wave_mean_square_slope")
        waves = None if slope is None else Filled.among(slope, slope > 0)
        fraction, snow_near, above = _snow_fraction(data), None, None
        if fraction is not None:
            snow_near = Filled(blurred(fraction), np.ones(fraction.shape, bool))
            above = _standing_out(_surface(data, "surface_altitude"))
        has_spectrum = "surface_albedo" in data and "wavelength" in data["surface_albedo"].dims
        albedo, land_albedo, snow_level = _surface(data, "surface_albedo"), None, None
        if albedo is not None and land is not None:
            bare = land >= 0.5
            if has_spectrum:
                values = spectral(data["surface_albedo"], wavelengths_nm)
            else:
                values = spectra.visible_from_broadband(albedo)
                if fraction is not None:
                    # what the rest of the cell reflects is taken off
                    white = (values - (1 - fraction) * DARK_LAND) / np.maximum(fraction, 0.5)
                    snow_level = Filled.among(white, bare & (fraction > 0.5))
                    bare &= fraction < _BARE
            land_albedo = Filled.among(values, bare)
        return cls(
            has_spectrum, land, land is not None and bool(np.isin(land, (0.0, 1.0)).all()), _like_earth(scene, land),
            _surface(data, "sea_ice_area_fraction"), wind, waves, snow_near, _surface(data, "snow_age"), above,
            land_albedo, snow_level,
        )  # fmt: skip


def _surface(data: xr.Dataset, name: str) -> FloatArray | None:
    """A field (ny, nx), None where there is none."""
    return np.asarray(data[name].transpose("y", "x", ...).values, float) if name in data else None


def _like_earth(scene: Scene, land: FloatArray | None) -> bool:
    """Whether nodes (ny, nx), coarser than the default Earth's mask, are land and sea where that plainly is."""
    grid = scene.grid
    assert grid is not None
    cell_m = min(grid.spacing_m())
    if land is None or cell_m <= earth.MASK_M:
        return False
    row, column = np.indices(land.shape)
    lon, lat = grid.lonlat(column.ravel(), row.ravel())
    mapped = earth.mean_land(lat, lon, cell_m).reshape(land.shape)
    plain = np.abs(mapped - 0.5) > 0.4
    if not plain.any():
        return bool(np.abs(land - mapped).mean() < 0.5)
    return bool((np.abs(land - mapped)[plain] <= 0.5).mean() >= _SAME_EARTH)


def _snow_fraction(data: xr.Dataset) -> FloatArray | None:
    """Share of every node (ny, nx) under snow, by its fraction or its depth."""
    fraction, depth = _surface(data, "snow_area_fraction"), _surface(data, "snow_depth")
    return snow.fraction_from_depth(depth) if fraction is None and depth is not None else fraction


def _standing_out(height: FloatArray | None) -> FloatArray | None:
    """Height above the neighbourhood (ny, nx), in its standard deviations."""
    if height is None:
        return None
    mean = blurred(blurred(height))
    deviation = np.sqrt(np.maximum(blurred(blurred((height - mean) ** 2)), _LEAST_DEVIATION_M**2))
    return np.asarray((height - mean) / deviation)
