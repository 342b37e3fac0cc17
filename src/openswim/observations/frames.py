"""A camera's frame: its counts, and when it was taken."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import check_kind, shown
from openswim.cameras.files import FrameSettings
from openswim.cameras.picture_files import read_picture
from openswim.errors import UserError
from openswim.observations.frame_times import FrameTime, frame_time
from openswim.scene.times import Time, parse_time
from openswim.system.inputs import check_name

_LEAST_CUT, _FEWEST_CUT = 1e-5, 12  # share of a picture that the sun's disc fills, and pixels that are no chance
_PILED = 3.0  # times as many pixels at the end as in the two per cent below it
# of 8 bits: higher ends are full anyway, and of lower ones two per cent are less than three counts
_ENDS = range(249, 149, -1)
_MOST_CUT = 0.1  # likewise: a flat sky is no sun
# of those at the end, that JPEG's ripples and captions may lift above it; ripples were .18 at quality 75
_BEYOND = 0.25


@dataclass(frozen=True)
class FrameInfo:
    """Which frame it is, without its counts."""

    path: Path
    time: np.datetime64
    time_source: str
    shape: tuple[int, int]
    doubt: str = ""  # what speaks against its time, half a sentence


@dataclass(frozen=True)
class SkyFrame:
    """Counts (ny, nx) or (ny, nx, 3: red, green, blue) as stored, row 0 on top, and the time (UTC)."""

    path: Path
    counts: NDArray[Any]
    time: np.datetime64
    time_source: str
    full_scale: float
    saturated: float  # from this count on a pixel says nothing
    doubt: str = ""  # what speaks against its time, half a sentence

    @property
    def shape(self) -> tuple[int, int]:
        return self.counts.shape[0], self.counts.shape[1]

    @property
    def info(self) -> FrameInfo:
        """All but the counts."""
        return FrameInfo(self.path, self.time, self.time_source, self.shape, self.doubt)

    @property
    def green(self) -> NDArray[np.float32]:
        """(ny, nx): the channel in the middle, or the only one."""
        return np.asarray(self.counts if self.counts.ndim == 2 else self.counts[..., 1], np.float32)


def read_frame(
    path: str | os.PathLike[str], time: Time = None, settings: FrameSettings | None = None, alone: bool = True
) -> SkyFrame:
    """Read a frame: JPEG, PNG, JPEG 2000, TIFF, FITS (also packed), or a camera's raw file.

    `time`: UTC, where file and name do not tell; `settings`: how the name tells it, and the zone of its clock;
    `alone`: whether it is a frame whose time could be given, which is then said where nothing tells it.
    """
    check_kind("frame", path, (str, os.PathLike), "give a file's name")
    check_kind("settings", settings, (FrameSettings, type(None)), "give FrameSettings, or None")
    path, settings = Path(path), settings or FrameSettings()
    check_name(path)  # it will be written into pages and files
    picture = read_picture(path)
    if time is not None:
        stamp = parse_time(time)
        if stamp is None or np.isnat(stamp):
            raise UserError(f"time {shown(time)} is none: write it as 2020-12-11T20:09:33 (UTC)")
        when = FrameTime(stamp, "given")
    else:
        when = frame_time(path, picture.header, picture.exif, settings, alone)
    full_scale = picture.full_scale if picture.full_scale > 0 else 1.0  # of floats the brightest: 0 in a black frame
    # JPEG and the like blur what is cut off: a few counts below the end are full too
    end = full_scale * (0.98 if full_scale < 256 else 0.999)
    saturated = settings.saturated_count or min(end, _cut_off(picture.counts))
    return SkyFrame(path, picture.counts, when.time, when.source, full_scale, saturated, when.doubt)


def _cut_off(counts: NDArray[Any]) -> float:
    """The largest count where many pixels have it and few come near it: sensors of 12 or 14 bits end long before their
    files of 16 do, and frames of videos at 235. Infinite where it is not so."""
    if counts.dtype == np.uint8:
        return _cut_off_of_bytes(counts)
    most = counts.max(initial=0)
    if most <= 0:
        return float("inf")
    many = np.count_nonzero(counts == most)
    near = np.count_nonzero(counts >= 0.98 * most) - many
    return float(most) if many >= max(_LEAST_CUT * counts.size, _FEWEST_CUT) and many > _PILED * near else float("inf")


def _cut_off_of_bytes(counts: NDArray[Any]) -> float:
    """Of 8 bits two per cent below that count, as JPEG blurs it."""
    number = np.sum([np.bincount(row.ravel(), minlength=256) for row in counts], axis=0)  # bincount takes 8 bytes each
    for end in _ENDS:
        near, at, beyond = (int(part.sum()) for part in np.split(number[end - 6 :], (5, 8)))
        enough = max(_LEAST_CUT * counts.size, _FEWEST_CUT) <= at <= _MOST_CUT * counts.size
        if enough and at > _PILED * near and beyond < _BEYOND * at:
            return 0.98 * end
    return float("inf")
