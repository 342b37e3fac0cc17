"""Pictures to a video file: H.264 in .mp4, AV1 in .webm, in the colours of ITU-R BT.709."""

from __future__ import annotations

import os
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.films.components import components

CODECS = {".mp4": "libx264", ".webm": "libsvtav1"}
_BT709 = 1  # matrix, primaries and transfer function of ITU-R BT.709 in ISO/IEC 23091-2
# Range of the brightness, 16 to 235. The full one is shown more exactly, and burns out clouds in players that overlook
# its flag: docs/film.md
_LIMITED = 1
_OPTIONS = {".mp4": {"crf": "16", "preset": "medium"}, ".webm": {"crf": "20", "preset": "8"}}


def check_video(suffix: str) -> None:
    """Raise UserError unless videos with this suffix can be written here."""
    _library()
    if suffix not in CODECS:
        raise UserError(f"{suffix}: no video; use one of {', '.join(CODECS)}")


def write_video(
    path: Path, pictures: Iterable[NDArray[np.uint8]], frames_per_second: float, title: str = "", comment: str = ""
) -> int:
    """Write pictures (y, x, 3) uint8, sRGB, all of one size, to ``path``; returns how many.

    Sizes are made even, as 4:2:0 needs them, by repeating the last row or column. A player that takes BT.709 for sRGB,
    as all do, shows the colours of a sky to within 4 of 255 (`components`).
    """
    av = _library()
    suffix = path.suffix.lower()
    os.environ.setdefault("SVT_LOG", "1")  # the AV1 encoder's own page of notes
    count = 0
    options = {"movflags": "+faststart"} if suffix == ".mp4" else {}
    with av.open(str(path), "w", options=options) as container:
        if title:
            container.metadata["title"] = title
        if comment:
            container.metadata["comment"] = comment
        stream: Any = None
        for picture in pictures:
            even = np.pad(picture, ((0, picture.shape[0] % 2), (0, picture.shape[1] % 2), (0, 0)), mode="edge")
            if stream is None:
                stream = _stream(container, suffix, even.shape, frames_per_second)
            planes = components(even).reshape(-1, even.shape[1])
            frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
            frame.pts = count
            for packet in stream.encode(frame):
                container.mux(packet)
            count += 1
        if stream is not None:
            for packet in stream.encode():
                container.mux(packet)
    return count


def _stream(container: Any, suffix: str, shape: tuple[int, ...], frames_per_second: float) -> Any:
    rate = Fraction(frames_per_second).limit_denominator(1001)
    stream = container.add_stream(CODECS[suffix], rate=rate, options=dict(_OPTIONS[suffix]))
    stream.height, stream.width = shape[:2]
    stream.pix_fmt = "yuv420p"
    stream.codec_context.time_base = 1 / rate
    for name in ("colorspace", "color_primaries", "color_trc"):
        setattr(stream.codec_context, name, _BT709)
    stream.codec_context.color_range = _LIMITED
    return stream


def _library() -> Any:
    try:
        import av
    except ImportError as error:
        raise UserError(
            "videos need the package av: pip install 'openswim[film]', or write a folder of frames (-o FOLDER/)"
        ) from error
    return av
