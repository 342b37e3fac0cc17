"""Light of towns, as seen from straight above: the user's map, or a coarse one of all the Earth."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import paths
from openswim.scene.ground import Ground

F64 = NDArray[np.float64]

# The picture of the Earth at night (NASA) was toned for the eye; its grey is turned back so that middles of large towns
# have some 30 nW cm-2 sr-1 over cells of 20 km, villages some tenths, and dark land next to nothing
_SCALE_NW, _GROWTH, _GREY_PER_INDEX = 0.3, 0.06, 2.0
_DEGREE_M = 111_195.0  # of latitude
_LATTICE_M, _SPOT_M = 150.0, 15.0  # cells of one lamp at most; the spot that it lights, to 1/sqrt(e)
_TOWN_NW, _LIT_CELLS = 20.0, (0.02, 0.7)  # radiance over which every cell would have its lamp; least and most that have
W_M2_SR = 1e-5  # of 1 nW cm-2 sr-1
BAND_NM = (500.0, 900.0)  # in which such radiance is measured
# Lamps, half of them sodium and half of them white diodes of 3000 K; any unit
_LAMP_NM = np.array([380.0, 430.0, 450.0, 480.0, 510.0, 546.0, 570.0, 590.0, 615.0, 650.0, 700.0, 760.0, 820.0, 900.0])
_LAMP = np.array([0.02, 0.2, 0.55, 0.3, 0.5, 0.85, 1.25, 2.0, 1.5, 0.8, 0.4, 0.2, 0.35, 0.1])

_MAPS: WeakKeyDictionary[Ground, list] = WeakKeyDictionary()


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
    for raster in [] if ground is None else _rasters(ground):
        width = np.broadcast_to(np.asarray(footprint_m, float), lat.shape).ravel()
        values, known = (each.reshape(*lat.shape, *each.shape[1:]) for each in raster.sample(lat.ravel(), lon.ravel(),
                         width))  # fmt: skip
        own = np.maximum(np.nan_to_num(values[..., 0]), 0)
        found = found + np.clip(known, 0, 1) * (own - found)
    return np.asarray(found)


def lamps_seen(lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike, radiance_nw: ArrayLike) -> F64:
    """What a near eye sees of towns' light over its mean (n,): lamps on dark land, where pixels are smaller than the
    way from lamp to lamp; 1 where they are larger, and in the mean over a cell of `_LATTICE_M`.

    Invented: one lamp or none in each cell, the more often the brighter the map is, lighting a spot of `_SPOT_M`.
    """
    lat, lon, width, bright = np.broadcast_arrays(
        *(np.asarray(v, float) for v in (lat, lon, footprint_m, radiance_nw))
    )
    north = lat * _DEGREE_M
    j = np.floor(north / _LATTICE_M)
    east = lon * _DEGREE_M * np.cos(np.radians((j + 0.5) * _LATTICE_M / _DEGREE_M))
    east = east + _LATTICE_M * _chance(0 * j, j, 3)  # no row stands in line with the next
    i = np.floor(east / _LATTICE_M)
    across, along, chance = (_chance(i, j, n) for n in range(3))
    share = np.clip(bright / _TOWN_NW, *_LIT_CELLS)
    away_x = east / _LATTICE_M - i - (0.25 + 0.5 * across)
    away_y = north / _LATTICE_M - j - (0.25 + 0.5 * along)
    spot = np.hypot(_SPOT_M, 0.4 * np.minimum(width, _LATTICE_M)) / _LATTICE_M
    seen = np.exp(-0.5 * (away_x**2 + away_y**2) / spot**2) / (2 * np.pi * spot**2)
    seen = np.where(chance < share, seen / share, 0.0)
    near = np.exp(-((width / (0.6 * _LATTICE_M)) ** 2))
    return np.asarray(near * seen + (1 - near))


def _chance(i: F64, j: F64, which: int) -> F64:
    """Evenly spread numbers of [0, 1), the same at every call (the mixer of SplitMix64)."""
    with np.errstate(over="ignore"):
        z = i.astype(np.int64).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z ^= j.astype(np.int64).astype(np.uint64) * np.uint64(0xC2B2AE3D27D4EB4F)
        z += np.uint64(which + 1) * np.uint64(0x165667B19E3779F9)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return np.asarray((z >> np.uint64(11)).astype(float) / 2.0**53)


def _rasters(ground: Ground) -> list:
    from openswim.ground.raster import Raster

    if ground not in _MAPS:
        _MAPS[ground] = [Raster(path, (1,)) for path in paths("lights", ground.lights)]
    return _MAPS[ground]


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
