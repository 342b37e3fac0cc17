"""A frame made ready: linear light of averaged pixels, and which of them say something."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.pixels import Pixels
from openswim.comparison.response import decoded
from openswim.comparison.tiles import tile_of
from openswim.errors import UserError
from openswim.observations import SkyFrame

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
Mask = NDArray[np.bool_]
SIZE = 320  # columns: JPEG keeps chroma in half as many as its pixels, and clouds fill many
GROWN_DEG = 2.0  # around saturated pixels
ODD = 0.20  # by which one channel alone differs from the median of its neighbours: text, drops, hot pixels


@dataclass(frozen=True, eq=False)
class Prepared:
    """A frame in the pixels of `camera`: shares of full scale (ny, nx, channels) as stored, and as linear light."""

    camera: Camera
    pixels: "KnownPixels"
    stored: F32
    linear: F32
    saturated: Mask  # any of a pixel's counts, or one near by
    time: np.datetime64
    name: str
    encoding: str | float

    @property
    def channels(self) -> tuple[str, ...]:
        return ("red", "green", "blue") if self.linear.shape[-1] == 3 else ("grey",)

    @cached_property
    def odd(self) -> Mask:
        """(ny, nx): see `odd_pixels`."""
        return odd_pixels(self.linear, self.pixels.inside)


def prepared(frame: SkyFrame, camera: Camera, encoding: str | float | None = None, size: int = SIZE) -> Prepared:
    """Average a frame to at most `size` columns; the curve of its counts is undone first."""
    if frame.shape != camera.shape:
        own, others = (f"{shape[1]}x{shape[0]}" for shape in (frame.shape, camera.shape))
        raise UserError(f"{frame.path}: is {own} pixels, its camera {others}: give the camera of this frame")
    if encoding is None:
        encoding = "srgb" if frame.full_scale < 256 else "linear"
    counts = _colours(frame.counts)
    full = np.greater_equal(counts, frame.saturated).max(axis=-1, keepdims=True).astype(np.float32)
    smaller, pixels = _made_small(camera, size)
    shape = smaller.shape
    linear = _curve(counts, frame.full_scale, encoding)
    width_deg = float(np.nanmedian(pixels.half_width_deg)) * 2
    return Prepared(
        smaller, pixels, averaged(counts.astype(np.float32) / np.float32(frame.full_scale), shape),
        averaged(linear, shape), grown(averaged(full, shape)[..., 0] > 0, width_deg),
        frame.time, frame.path.name, encoding,
    )  # fmt: skip


class KnownPixels(Pixels):
    """Pixels of a series of frames: what follows from their directions is worked out once."""

    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        return self is other

    @cached_property
    def inside(self) -> Mask:
        return super().inside

    @cached_property
    def azimuth_deg(self) -> F64:
        return super().azimuth_deg

    @cached_property
    def altitude_deg(self) -> F64:
        return super().altitude_deg

    @cached_property
    def tile(self) -> NDArray[np.intp]:
        """(ny, nx): the sky's tile that each lies in; 0 outside."""
        tile = np.zeros(self.inside.shape, np.intp)
        tile[self.inside] = tile_of(self.direction[self.inside])
        return tile

    @lru_cache(maxsize=2)  # noqa: B019 - of the few cameras of a process
    def angle_to_deg(self, azimuth_deg: float, altitude_deg: float) -> NDArray[Any]:
        return super().angle_to_deg(azimuth_deg, altitude_deg)


@lru_cache(maxsize=4)
def pixels_of(camera: Camera) -> KnownPixels:
    """The same object for each frame of a camera."""
    pixels = camera.pixels()
    return KnownPixels(pixels.direction, pixels.solid_angle_sr)


@lru_cache(maxsize=4)
def _open_sky(camera: Camera) -> Mask:
    return camera.open_sky()


@lru_cache(maxsize=4)
def _made_small(camera: Camera, size: int) -> tuple[Camera, KnownPixels]:
    """The camera of at most `size` columns and its pixels: the same objects for each frame of a series."""
    smaller = camera.resized(size) if size < camera.shape[1] else camera
    return smaller, pixels_of(smaller)


def averaged(values: F32, shape: tuple[int, int]) -> F32:
    """Means (ny, nx, channels) over the part of the picture that each pixel of another shape covers."""
    from PIL import Image

    if values.shape[:2] == shape:
        return values
    size = shape[::-1]
    parts = [Image.fromarray(np.ascontiguousarray(part)).resize(size, Image.Resampling.BOX)
             for part in np.moveaxis(values, -1, 0)]  # fmt: skip
    return np.stack([np.asarray(part, np.float32) for part in parts], axis=-1)


def grown(mask: Mask, width_deg: float, by_deg: float = GROWN_DEG) -> Mask:
    """A mask and all that lies within so many degrees of it, in pixels of a width."""
    from scipy import ndimage

    if not mask.any():
        return mask
    return np.asarray(ndimage.distance_transform_edt(~mask) * width_deg <= by_deg)


def odd_pixels(linear: F32, there: Mask) -> Mask:
    """(ny, nx): pixels of those `there` of which one channel alone is unlike its neighbours'."""
    from scipy import ndimage

    if linear.shape[-1] < 3:
        return np.zeros(linear.shape[:2], bool)
    count = np.zeros(linear.shape[:2], np.int8)
    for part in np.moveaxis(linear, -1, 0):
        part = np.ascontiguousarray(part)
        # a median lies between the ends, and most pixels are like both
        low, high = (end(part, 5) for end in (ndimage.minimum_filter, ndimage.maximum_filter))
        row, column = np.nonzero(there & ((part - low > ODD * np.maximum(low, 1e-6)) | (part < (1 - ODD) * high)))
        around = np.lib.stride_tricks.sliding_window_view(np.pad(part, 2, "symmetric"), (5, 5))[row, column]
        median = np.partition(around.reshape(-1, 25), 12, axis=-1)[:, 12]  # a fifth of np.median's cost
        count[row, column] += np.abs(part[row, column] - median) > ODD * np.maximum(median, 1e-6)
    return np.asarray(count == 1)


def _colours(counts: NDArray[Any]) -> NDArray[Any]:
    """Counts (ny, nx, channels): a grey picture that is stored in three colours, as by night, has one channel."""
    if counts.ndim == 2:
        return counts[..., None]
    grey = (counts == counts[..., :1]).all() and counts.min() < counts.max()
    return counts[..., :1] if grey else counts


def open_pixels(frame: Prepared, sun: tuple[float, float], sun_mask_deg: float, lowest_deg: float) -> Mask:
    """Pixels that look at open sky, above an altitude and not near the sun (azimuth, altitude)."""
    pixels = frame.pixels
    with np.errstate(invalid="ignore"):
        there = _open_sky(frame.camera) & (pixels.altitude_deg >= lowest_deg)
        return np.asarray(there & (pixels.angle_to_deg(*sun) > sun_mask_deg))


def valid_pixels(frame: Prepared, sun: tuple[float, float], sun_mask_deg: float, lowest_deg: float) -> Mask:
    """Pixels of open sky: not near the sun (azimuth, altitude), nor saturated, nor odd, nor black."""
    there = open_pixels(frame, sun, sun_mask_deg, lowest_deg)
    return there & ~frame.saturated & ~frame.odd & (frame.linear > 0).all(axis=-1)


def _curve(counts: NDArray[Any], full_scale: float, encoding: str | float) -> F32:
    """Linear light of counts; of 8 or 16 bits by a table."""
    if counts.dtype.kind == "u" and counts.dtype.itemsize <= 2:
        table = decoded(np.arange(np.iinfo(counts.dtype).max + 1) / full_scale, encoding).astype(np.float32)
        return np.asarray(table[counts])
    return decoded(counts / full_scale, encoding).astype(np.float32)
