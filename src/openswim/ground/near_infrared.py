"""Land, snow and ice beyond 700 nm, from what they look like in the visible."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.ground import snow
from openswim.ground.sample import SurfaceSample
from openswim.scene.interpolation import at_wavelengths

FloatArray = NDArray[np.float64]

VISIBLE_NM = np.array([469.0, 555.0, 645.0])  # what is looked at: MODIS bands 3, 4 and 1
LAST_VISIBLE_NM = 700.0
_BARE_RATIO, _GREEN_RATIO = 0.85, 1.05  # of green over red, of ground without leaves and of leaves without ground

# Green leaves between red and the plateau (to 860 nm), and over the plateau beyond: what USGS spectra of grass,
# deciduous trees and conifers (Clark et al. 2007) have in common.
_LEAF_NM = np.array([700, 710, 720, 740, 760, 780, 860, 970, 1080, 1200, 1240, 1280, 1370, 1450, 1550, 1640, 1700.0])
_LEAF = np.array([0, 0.18, 0.38, 0.75, 0.91, 0.96, 1, 0.96, 1.02, 0.91, 0.93, 0.93, 0.65, 0.25, 0.43, 0.57, 0.59])
_DARK_PLATEAU, _PLATEAU_RISE, _MOST_PLATEAU = 0.24, 2.5, 0.45  # conifers .3, fields .4 at 860 nm (MODIS)
# Bare ground over its red: deserts in MODIS bands 2, 5 and 6
_SOIL_NM = np.array([645, 700, 860, 1240, 1380, 1430, 1500, 1640, 1700.0])
_SOIL = np.array([1.0, 1.1, 1.18, 1.33, 1.34, 1.25, 1.33, 1.40, 1.40])
_BRIGHTEST = 0.75
_BETWEEN_SNOW = 0.08  # visible albedo of what is taken to lie between patches of snow


def beyond_visible(seen: SurfaceSample, wavelengths_nm: FloatArray) -> FloatArray:
    """Albedo (n, nwl) beyond 700 nm of all that is not open water, from what it is at `VISIBLE_NM`.

    Leaves are told by green over red, and what is white by the sample's share of snow: snow of its usual age, or sea
    ice, as bright as it is in the visible.
    """
    white = seen.snow[:, None]
    patchy = np.clip((seen.albedo - (1 - white) * _BETWEEN_SNOW) / np.maximum(white, 1e-3), 0.0, 0.98)
    land = np.clip((seen.albedo - white * patchy) / np.maximum(1 - white, 1e-3), 0.005, 0.98)
    out = land_beyond_visible(land, wavelengths_nm)
    some = np.flatnonzero(seen.snow > 0)
    if some.size:
        ice = np.clip(seen.sea_ice[some] / np.maximum(1 - seen.water[some], 1e-3), 0.0, 1.0)[:, None]

        def pure(nm: FloatArray) -> FloatArray:
            of_sea = snow.sea_ice_albedo(nm, seen.sea_ice[some])
            return snow.snow_albedo(nm) + ice * (of_sea - snow.snow_albedo(nm))

        level = patchy[some].mean(axis=1)[:, None]
        share = np.clip((level - _BETWEEN_SNOW) / (pure(VISIBLE_NM).mean(axis=1)[:, None] - _BETWEEN_SNOW), 0.0, 1.05)
        bright = out[some] + share * (pure(wavelengths_nm) - out[some])
        out[some] += white[some] * (bright - out[some])
    return np.clip(out, 0.0, 0.98)


def land_beyond_visible(visible: FloatArray, wavelengths_nm: FloatArray) -> FloatArray:
    """Albedo (n, nwl) of snow-free land whose albedo at `VISIBLE_NM` is (n, 3); at 700 nm 1.1 of the red."""
    _, green, red = visible.T
    bare = np.clip((_GREEN_RATIO - green / np.maximum(red, 1e-3)) / (_GREEN_RATIO - _BARE_RATIO), 0.0, 1.0)[:, None]
    plateau = np.minimum(_DARK_PLATEAU + _PLATEAU_RISE * visible.mean(axis=1), _MOST_PLATEAU)[:, None]
    edge = np.minimum(1.1 * red[:, None], _BRIGHTEST)
    shape = at_wavelengths(_LEAF_NM, _LEAF, wavelengths_nm)
    rising = edge + np.maximum(plateau - edge, 0.0) * shape
    leaves = np.where(wavelengths_nm <= 860.0, rising, np.maximum(plateau, edge) * shape)
    soil = np.minimum(red[:, None] * at_wavelengths(_SOIL_NM, _SOIL, wavelengths_nm), _BRIGHTEST)
    return leaves + bare * (soil - leaves)
