"""The user's own ground: maps of albedo, aerial pictures, and digital elevation models."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import paths
from openswim.errors import UserError
from openswim.ground import earth
from openswim.ground.footprints import LongFootprints
from openswim.ground.spectra import from_bands
from openswim.scene.ground import Ground, PathLike

if TYPE_CHECKING:
    from openswim.ground.raster import Raster

FloatArray = NDArray[np.float64]

TEXTURE_M = 100.0  # finer pictures are texture: they say where it is bright, not how bright in all
_MOST_CONTRAST = 4.0
_MONTH = re.compile(r"world\.[a-z.]*(\d{4})(\d{2})\.", re.IGNORECASE)


class Maps:
    """The opened files of a `Ground`, the coarsest first."""

    def __init__(self, ground: Ground) -> None:
        self.albedo = sorted((AlbedoMap(path) for path in paths("albedo", ground.albedo)), key=lambda m: -m.pixel_m)
        self.height = sorted((HeightMap(path) for path in paths("height", ground.height)), key=lambda m: -m.pixel_m)
        self.lights = [_raster(path, (1,)) for path in paths("lights", ground.lights)]

    def albedo_at(self, time: np.datetime64 | None, texture: bool) -> list[AlbedoMap]:
        """Albedo maps, or textures, that hold at a time."""
        chosen = [m for m in self.albedo if m.texture == texture]
        months = {m.month for m in chosen if m.month is not None}
        if not months:
            return chosen
        wanted = 7 if time is None else int(time.astype("datetime64[M]").astype(int)) % 12 + 1
        nearest = min(months, key=lambda m: (min((m - wanted) % 12, (wanted - m) % 12), m))
        return [m for m in chosen if m.month in (None, nearest)]


_OPENED: WeakKeyDictionary[Ground, Maps] = WeakKeyDictionary()


def maps_of(ground: Ground) -> Maps:
    """The maps of the user's own ground, opened once."""
    if ground not in _OPENED:
        _OPENED[ground] = Maps(ground)
    return _OPENED[ground]


def _raster(path: PathLike, bands: tuple[int, ...]) -> Raster:
    from openswim.ground.raster import Raster

    return Raster(path, bands)


class AlbedoMap:
    """An image as spectral albedo."""

    def __init__(self, path: PathLike) -> None:
        from openswim.ground.raster import Raster

        whole = Raster(path)
        self.raster: Raster = Raster(path, _colour_bands(whole))
        self.pixel_m = self.raster.pixel_m
        self.picture = self.raster.dtype == np.uint8
        self.texture = self.picture and self.pixel_m < TEXTURE_M
        month = _MONTH.search(self.raster.path.name)
        self.month = int(month.group(2)) if month and 1 <= int(month.group(2)) <= 12 else None

    def colours(
        self, lat: FloatArray, lon: FloatArray, footprint_m: FloatArray, long: LongFootprints | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Red, green, blue (n, 3) in proportion to reflectance (reflectance itself unless a `texture`), and the known
        share (n,)."""
        sample = self.raster.sample
        if long is None or long.length_m.max(initial=0.0) < self.pixel_m:
            values, known = sample(lat, lon, footprint_m)
        else:
            values, known = long.mean(sample, lat, lon, footprint_m)
        if self.picture:
            # decimated means are of code values; the error is small next to the picture's own tone curve
            values = earth.linear_light(values)
            if not self.texture:
                values = earth.from_blue_marble(values)
        else:
            values = self._reflectance(values)
        return np.broadcast_to(values, (len(values), 3)), known

    def _reflectance(self, values: FloatArray) -> FloatArray:
        scale, offset = self.raster.scale_offset
        if np.issubdtype(self.raster.dtype, np.integer) and (scale, offset) == (1.0, 0.0):
            scale = 1e-4
        out = values * scale + offset
        if out.size and out.max() > 2.0:
            raise UserError(
                f"{self.raster.path}: reflectance of {out.max():.4g}: give 0 to 1, or a scale in the file "
                "(gdal_translate -a_scale)"
            )
        return np.clip(out, 0.0, 1.0)


class HeightMap:
    """A digital elevation model."""

    def __init__(self, path: PathLike) -> None:
        from openswim.ground.raster import Raster

        self.raster: Raster = Raster(path, (1,))
        if self.raster.dtype == np.uint8:
            raise UserError(f"{self.raster.path}: an 8-bit image is no elevation model: give metres above sea level")
        self.pixel_m = self.raster.pixel_m

    def height(self, lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike = 0.0) -> tuple[FloatArray, FloatArray]:
        """Metres above sea level (n,) and the known share (n,)."""
        return self.height_at(*self.raster.pixel(lat, lon), footprint_m)

    def height_at(
        self, row: FloatArray, column: FloatArray, footprint_m: ArrayLike = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """`height` at fractional rows and columns (n,) of the file."""
        values, known = self.raster.sample_pixels(row, column, footprint_m)
        scale, offset = self.raster.scale_offset
        height = values[:, 0] * scale + offset
        # nodata that the file does not declare
        sane = (height > -500.0) & (height < 9000.0)
        return np.where(sane, height, 0.0), known * sane


def mapped_albedo(
    maps: list[AlbedoMap], lat: FloatArray, lon: FloatArray, wavelengths_nm: FloatArray, footprint_m: FloatArray,
    long: LongFootprints | None = None,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Albedo (n, nwl) by the finest map that shows each place, and the share (n,) that is known."""
    albedo, total = np.zeros((lat.size, wavelengths_nm.size)), np.zeros(lat.size)
    for one in maps:
        rgb, known = one.colours(lat, lon, footprint_m, long)
        some = known > 0
        share = known[some, None]
        albedo[some] += share * (from_bands(rgb[some], wavelengths_nm) - albedo[some])
        total = np.maximum(total, known)
    return albedo / np.maximum(total, 1e-9)[:, None], total


def textured(
    albedo: FloatArray,
    maps: list[AlbedoMap],
    lat: FloatArray,
    lon: FloatArray,
    wavelengths_nm: FloatArray,
    footprint_m: FloatArray,
    base_m: FloatArray,
    long: LongFootprints | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Albedo (n, nwl) known over `base_m` (n,), with the finer contrast and colour of aerial pictures, its mean kept,
    and the share (n,) that they show.

    "Only roughly controlled for spectral albedo" (section 3.7), so only their ratio to their own mean over `base_m`
    counts, at most 4.
    """
    out, shown = albedo, np.zeros(lat.size)
    for one in maps:
        fine, known = one.colours(lat, lon, footprint_m, long)
        mean, around = one.colours(lat, lon, np.maximum(footprint_m, np.maximum(base_m, one.pixel_m)))
        share = (known * (around > 0))[:, None]
        if not share.any():
            continue
        ratio = from_bands(np.maximum(fine, 1e-3), wavelengths_nm) / from_bands(np.maximum(mean, 1e-3), wavelengths_nm)
        out = out * (1 + share * (np.clip(ratio, 1 / _MOST_CONTRAST, _MOST_CONTRAST) - 1))
        shown = np.maximum(shown, share[:, 0])
    return np.clip(out, 0.0, 0.98), shown


def _colour_bands(raster: Raster) -> tuple[int, ...]:
    colours = raster.colours
    if "palette" in colours:
        raise UserError(f"{raster.path}: has a colour table: give colours (gdal_translate -expand rgb)")
    if {"red", "green", "blue"} <= set(colours):
        return tuple(colours.index(c) + 1 for c in ("red", "green", "blue"))
    solid = [n + 1 for n, c in enumerate(colours) if c != "alpha"]
    return tuple(solid[:3]) if len(solid) >= 3 else (1,)
