"""Georeferenced images on disk, read in small pieces at the resolution that places ask for."""

from __future__ import annotations

import os
import re
from collections import OrderedDict
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.interpolation import corners
from openswim.system.rasters import open_raster

if TYPE_CHECKING:
    from pyproj import Transformer

FloatArray = NDArray[np.float64]
Affine = tuple[float, ...]  # x = a column + b row + c, y = d column + e row + f

_TILE = 256
_CACHE_BYTES = 256 << 20
# NASA's Blue Marble tiles carry their place in their name: columns A to D from 180 W, rows 1 and 2 from 90 N.
_BLUE_MARBLE_TILE = re.compile(r"world\..*21600x21600\.([A-D])([12])\b", re.IGNORECASE)


class Raster:
    """A GeoTIFF, or any image GDAL knows that lies in its own folder, in any projection.

    `sample` reads tiles of 256 x 256 pixels, decimated by a power of two (from the file's overviews where it has
    some), and keeps the last 256 MB of them. A picture without georeference is taken to be a Blue Marble tile where
    its name says so, and the whole Earth in longitude and latitude where it is twice as wide as high.
    """

    def __init__(self, path: str | os.PathLike[str], bands: tuple[int, ...] | None = None) -> None:
        self.path = Path(path)
        self._file = _opened(self.path)
        self.shape: tuple[int, int] = (int(self._file.height), int(self._file.width))
        if not self._file.count:
            raise UserError(f"{self.path}: no image in it, but several sets of data: give a GeoTIFF")
        self.bands = tuple(range(1, self._file.count + 1)) if bands is None else bands
        self.dtype = np.dtype(self._file.dtypes[0])
        self.crs, self._transform = _georeference(self.path, self._file)
        self._one_reader = Lock()  # places are looked up by several threads
        self._tiles: OrderedDict[tuple[int, int, int], tuple[NDArray[Any], NDArray[np.bool_]]] = OrderedDict()
        self._bytes = 0

    @property
    def colours(self) -> list[str]:
        """What each band of the file holds, as GDAL tells: "red", "gray", "palette", ..."""
        return [c.name for c in self._file.colorinterp]

    @property
    def scale_offset(self) -> tuple[float, float]:
        """Scale and offset of the values, as the file states them."""
        return float(self._file.scales[0]), float(self._file.offsets[0])

    @cached_property
    def _to_map(self) -> Transformer:
        from pyproj import Transformer

        return Transformer.from_crs("EPSG:4326", self.crs, always_xy=True)

    @cached_property
    def pixel_m(self) -> float:
        """Side of a pixel on the ground at the middle of the image [m]."""
        height, width = self.shape
        x, y = _applied(self._transform, np.array([0.0, 1.0, 0.0]) + width / 2, np.array([0.0, 0.0, 1.0]) + height / 2)
        lon, lat = (np.radians(v) for v in self._to_map.transform(x, y, direction="INVERSE"))
        east, north = _turned(lon[1:] - lon[0], np.pi) * np.cos(lat[0]), lat[1:] - lat[0]
        return float(EARTH_RADIUS_M * np.sqrt(np.abs(east[0] * north[1] - east[1] * north[0])))

    def outline(self) -> tuple[FloatArray, FloatArray]:
        """Latitude and longitude (degrees) along the image's border."""
        height, width = self.shape
        s = np.linspace(0.0, 1.0, 17)
        column = np.concatenate([s, s, 0 * s, 0 * s + 1]) * width
        row = np.concatenate([0 * s, 0 * s + 1, s, s]) * height
        lon, lat = self._to_map.transform(*_applied(self._transform, column, row), direction="INVERSE")
        finite = np.isfinite(lon) & np.isfinite(lat)
        return np.asarray(lat, float)[finite], np.asarray(lon, float)[finite]

    def pixel(self, lat: ArrayLike, lon: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Fractional row and column of places (n,), degrees; pixel centres are whole numbers; not finite where there
        is none. Columns of an image around the Earth go on beyond its seam."""
        x, y = self._to_map.transform(np.asarray(lon, float), np.asarray(lat, float))
        x, y = np.asarray(x, float), np.asarray(y, float)
        if self._around_the_earth:
            first = x[np.isfinite(x)][:1]
            x = np.where(np.isfinite(x), first + _turned(x - first), x) if first.size else x
        elif self.crs.is_geographic:
            middle, half = self._longitudes
            away = _turned(np.where(np.isfinite(x), x, np.nan) - middle)
            # nothing where longitudes jump, between which columns may be interpolated
            x = np.where(np.abs(away) < 0.5 * (half + 180.0), middle + away, np.nan)
        with np.errstate(invalid="ignore"):
            column, row = _applied(_inverse(self._transform), x, y)
        return row - 0.5, column - 0.5

    @cached_property
    def _longitudes(self) -> tuple[float, float]:
        """Longitude of the image's middle, and from there to its sides."""
        height, width = self.shape
        x, _ = _applied(self._transform, np.array([0.0, width]), np.full(2, 0.5 * height))
        return float(x.mean()), 0.5 * float(np.ptp(x))

    @cached_property
    def _around_the_earth(self) -> bool:
        step = self._transform[0]
        return bool(self.crs.is_geographic) and abs(step * self.shape[1] - 360.0) < abs(step)

    def sample(self, lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike = 0.0) -> tuple[FloatArray, FloatArray]:
        """Values (n, bands) averaged over about `footprint_m` around places (n,), and the share (n,) of them known.

        Bilinear in the decimated image, linear between two decimations (a mip map); where nothing is known, zero.
        """
        return self.sample_pixels(*self.pixel(lat, lon), footprint_m)

    def sample_pixels(
        self, row: FloatArray, column: FloatArray, footprint_m: ArrayLike = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """`sample` at fractional rows and columns (n,)."""
        if self._around_the_earth:
            column = (column + 0.5) % self.shape[1] - 0.5
        footprint = np.broadcast_to(np.asarray(footprint_m, float), row.shape)
        last = max(0, int(np.log2(min(self.shape) / 4)))
        level = np.clip(np.log2(np.maximum(footprint, 1e-3) / self.pixel_m), 0, last)
        values, known = np.zeros((row.size, len(self.bands))), np.zeros(row.size)
        inside = np.isfinite(row) & np.isfinite(column) & self._near(row, column)
        for n in range(last + 1):
            weight = np.maximum(0.0, 1.0 - np.abs(level - n)) * inside
            some = np.flatnonzero(weight > 0)
            if some.size:
                v, k = self._bilinear(n, row[some], column[some])
                values[some] += (weight[some] * k)[:, None] * v
                known[some] += weight[some] * k
        return values / np.maximum(known, 1e-9)[:, None], known

    def _near(self, row: FloatArray, column: FloatArray) -> NDArray[np.bool_]:
        height, width = self.shape
        return (row >= -0.5) & (row <= height - 0.5) & (column >= -0.5) & (column <= width - 0.5)

    def _bilinear(self, level: int, row: FloatArray, column: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values (n, bands) and known share (n,) at full-resolution pixel coordinates, from one decimation."""
        height, width = (n >> level for n in self.shape)
        y, x = (row + 0.5) / (1 << level) - 0.5, (column + 0.5) / (1 << level) - 0.5
        values, known = np.zeros((row.size, len(self.bands))), np.zeros(row.size)
        for r, c, weight in zip(*corners(x, y, (height, width), self._around_the_earth), strict=True):
            v, k = self._pixels(level, r, c)
            values += (weight * k)[:, None] * v
            known += weight * k
        return values / np.maximum(known, 1e-9)[:, None], known

    def _pixels(
        self, level: int, row: NDArray[np.int64], column: NDArray[np.int64]
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Values (n, bands) and whether they are known, of whole pixels of a decimated image."""
        across = -(-(self.shape[1] >> level) // _TILE)
        tile = (row // _TILE) * across + column // _TILE
        order = np.argsort(tile, kind="stable")
        ends = np.flatnonzero(np.diff(tile[order], append=-1)) + 1
        values, known = np.empty((row.size, len(self.bands))), np.empty(row.size, bool)
        start = 0
        for end in ends.tolist():
            some = order[start:end]
            with self._one_reader:
                v, k = self._tile(level, *divmod(int(tile[some[0]]), across))
            values[some], known[some] = v[:, row[some] % _TILE, column[some] % _TILE].T, k[
                row[some] % _TILE, column[some] % _TILE
            ]
            start = end
        return values, known

    def _tile(self, level: int, down: int, right: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Values (bands, <=256, <=256) and mask of one tile of a decimation."""
        key = (level, down, right)
        if key in self._tiles:
            self._tiles.move_to_end(key)
            return self._tiles[key]
        tile = self._read(level, down, right)
        self._tiles[key] = tile
        self._bytes += tile[0].nbytes + tile[1].nbytes
        while self._bytes > _CACHE_BYTES and len(self._tiles) > 1:
            _, old = self._tiles.popitem(last=False)
            self._bytes -= old[0].nbytes + old[1].nbytes
        return tile

    def _read(self, level: int, down: int, right: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        import rasterio
        from rasterio.enums import Resampling
        from rasterio.windows import Window

        side = _TILE << level
        # what is left over of the last row and column of a decimated image is dropped
        height, width = (min(_TILE, (n >> level) - m * _TILE) for n, m in zip(self.shape, (down, right), strict=True))
        window = Window(right * side, down * side, width << level, height << level)
        shape = (height, width)
        try:
            data = self._file.read(
                self.bands, window=window, out_shape=(len(self.bands), *shape), masked=True,
                resampling=Resampling.average if level else Resampling.nearest,
            )  # fmt: skip
        except rasterio.errors.RasterioError as error:
            raise UserError(f"{self.path}: cannot be read ({_first_line(error)}): a damaged file?") from None
        known = ~np.ma.getmaskarray(data).any(axis=0)
        if np.issubdtype(data.dtype, np.floating):
            known &= np.isfinite(data.data).all(axis=0)
        return np.where(known, data.data, 0), np.asarray(known, bool)


def _opened(path: Path) -> Any:
    file = open_raster(path)
    if not file.count:
        raise UserError(f"{path}: no image, but several or none within: give a GeoTIFF (gdal_translate)")
    return file


def _georeference(path: Path, file: Any) -> tuple[Any, Affine]:
    """Coordinate system and affine transform (pixel corner to map) of a file."""
    from pyproj import CRS

    transform = tuple(float(v) for v in file.transform)[:6]
    height, width = file.height, file.width
    if file.crs is not None:
        try:
            return CRS.from_wkt(file.crs.to_wkt()), transform
        except Exception as error:
            raise UserError(f"{path}: its projection is not understood ({_first_line(error)})") from None
    tile = _BLUE_MARBLE_TILE.search(path.name)
    if tile:
        west = -180.0 + 90.0 * "ABCD".index(tile.group(1).upper())
        north = 90.0 * (2 - int(tile.group(2)))
        return CRS.from_epsg(4326), (90.0 / width, 0.0, west, 0.0, -90.0 / height, north)
    if abs(transform[4]) < 1 and abs(transform[2]) <= 360:
        return CRS.from_epsg(4326), transform  # a world file in degrees
    if width == 2 * height:
        return CRS.from_epsg(4326), (360.0 / width, 0.0, -180.0, 0.0, -180.0 / height, 90.0)
    raise UserError(f"{path}: has no georeference: give a GeoTIFF (gdal_translate -a_srs ... -a_ullr ...)")


def _applied(t: Affine, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    return t[0] * x + t[1] * y + t[2], t[3] * x + t[4] * y + t[5]


def _turned(angle: FloatArray, half: float = 180.0) -> FloatArray:
    """The same angles within half a turn of 0."""
    return (angle + half) % (2 * half) - half


def _inverse(t: Affine) -> Affine:
    a, b, c, d, e, f = t
    det = a * e - b * d
    return e / det, -b / det, (b * f - c * e) / det, -d / det, a / det, (c * d - a * f) / det


def _first_line(error: BaseException) -> str:
    return str(error).strip().split("\n")[0]
