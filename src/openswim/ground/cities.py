"""Light of towns, as seen from straight above: the user's map, or a coarse one of all the Earth."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground.maps import maps_of
from openswim.scene.ground import Ground

F64 = NDArray[np.float64]

# The picture of the Earth at night (NASA) was toned for the eye; its grey is turned back so that middles of large towns
# have some 30 nW cm-2 sr-1 over cells of 20 km, villages some tenths, and dark land next to nothing
_SCALE_NW, _GROWTH, _GREY_PER_INDEX = 0.3, 0.06, 2.0
W_M2_SR = 1e-5  # of 1 nW cm-2 sr-1
BAND_NM = (500.0, 900.0)  # in which such radiance is measured
# Lamps, half of them sodium and half of them white diodes of 3000 K; any unit
_LAMP_NM = np.array([380.0, 430.0, 450.0, 480.0, 510.0, 546.0, 570.0, 590.0, 615.0, 650.0, 700.0, 760.0, 820.0, 900.0])
_LAMP = np.array([0.02, 0.2, 0.55, 0.3, 0.5, 0.85, 1.25, 2.0, 1.5, 0.8, 0.4, 0.2, 0.35, 0.1])
_SODIUM = np.array([0.02, 0.06, 0.2, 0.15, 0.25, 0.62, 1.35, 2.6, 1.7, 0.6, 0.25, 0.3, 0.6, 0.1])


def lamp_spectrum(wavelengths_nm: ArrayLike) -> F64:
    """W m-2 sr-1 nm-1 (nw,) of 1 nW cm-2 sr-1 in the band of 500 to 900 nm."""
    fine = np.arange(*BAND_NM, 2.0)
    whole = np.interp(fine, _LAMP_NM, _LAMP).sum() * 2.0
    return np.asarray(W_M2_SR * np.interp(np.asarray(wavelengths_nm, float), _LAMP_NM, _LAMP) / whole)


def city_radiance(lat: ArrayLike, lon: ArrayLike, ground: Ground | None = None, footprint_m: ArrayLike = 0.0) -> F64:
    """Upward radiance (n,) in nW cm-2 sr-1 at places (degrees): of the user's maps where they have it, else the coarse
    one's."""
    lat, lon = np.broadcast_arrays(np.asarray(lat, float), np.asarray(lon, float))
    found = _coarse(lat, lon)
    for raster in [] if ground is None else maps_of(ground).lights:
        width = np.broadcast_to(np.asarray(footprint_m, float), lat.shape).ravel()
        values, known = (each.reshape(*lat.shape, *each.shape[1:]) for each in raster.sample(lat.ravel(), lon.ravel(),
                         width))  # fmt: skip
        own = np.maximum(np.nan_to_num(values[..., 0]), 0)
        found = found + np.clip(known, 0, 1) * (own - found)
    return np.asarray(found)


def sodium_tint(wavelengths_nm: ArrayLike) -> F64:
    """How much more (nw,) of sodium's light there is than of diodes' in the mean of both, over that."""
    sodium, both = (np.interp(np.asarray(wavelengths_nm, float), _LAMP_NM, lamp) for lamp in (_SODIUM, _LAMP))
    return np.asarray(sodium / both - 1)


@cache
def _grey() -> NDArray[np.uint8]:
    """Grey (1024, 2048) of the picture: rows from the north pole, columns from longitude -180."""
    from PIL import Image

    with (files("openswim.ground") / "data" / "city_lights.png").open("rb") as stream:
        return np.asarray(Image.open(stream).convert("L"))


def _coarse(lat: F64, lon: F64) -> F64:
    grid = _grey()
    ny, nx = grid.shape
    row = np.clip((90 - lat) * ny / 180 - 0.5, 0, ny - 1.001)
    column = (lon + 180) % 360 * nx / 360 - 0.5
    j, i = row.astype(int), np.floor(column).astype(int)
    u, v = row - j, column - i
    left, right = i % nx, (i + 1) % nx
    index = (1 - u) * ((1 - v) * grid[j, left] + v * grid[j, right])
    index += u * ((1 - v) * grid[j + 1, left] + v * grid[j + 1, right])
    return np.asarray(_SCALE_NW * np.expm1(_GROWTH * index / _GREY_PER_INDEX))
