"""A frame with what a camera says lies over it: rings of altitude, compass, matched and expected places."""

import io
from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.observations.frames import SkyFrame

F64 = NDArray[np.float64]
WIDEST_PX = 1400
_LETTERS_PX = 22
_RINGS_DEG = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
_GRID, _SEEN, _MATCHED, _EXPECTED = (70, 140, 220), (255, 210, 60), (90, 230, 120), (255, 120, 120)


def drawn(
    frame: SkyFrame, camera: Camera, seen: F64, expected: F64, pairs: Iterable[tuple[F64, F64]], magnify: float
) -> Any:
    """A PIL picture, at most 1400 pixels wide, stretched so that faint things show.

    Yellow crosses: points that were `seen` (n, 2); red circles: where unmatched things are `expected` (m, 2); green
    circles: matched ones, with the miss drawn `magnify` times as long.
    """
    from PIL import Image, ImageDraw

    factor = min(WIDEST_PX / frame.shape[1], 1.0)
    picture = Image.fromarray(_stretched(frame.counts))
    picture = picture.resize((round(frame.shape[1] * factor), round(frame.shape[0] * factor)), Image.Resampling.LANCZOS)
    pen = ImageDraw.Draw(picture)

    def at(place: Any) -> tuple[float, float]:
        return (float(place[1]) + 0.5) * factor, (float(place[0]) + 0.5) * factor

    _draw_grid(pen, camera, at)
    for place in seen:
        x, y = at(place)
        pen.line([(x - 4, y), (x + 4, y)], _SEEN)
        pen.line([(x, y - 4), (x, y + 4)], _SEEN)
    for place in expected:
        _circle(pen, at(place), 7, _EXPECTED)
    for there, fitted in pairs:
        (x, y), (u, v) = at(there), at(fitted)
        _circle(pen, (u, v), 9, _MATCHED)
        pen.line([(u, v), (u + (x - u) * magnify, v + (y - v) * magnify)], _MATCHED, 2)
    return picture


def jpeg(picture: Any) -> bytes:
    """Of a PIL picture."""
    stream = io.BytesIO()
    picture.save(stream, "JPEG", quality=88)
    return stream.getvalue()


def _draw_grid(pen: Any, camera: Camera, at: Any) -> None:
    turn = np.linspace(0, 360, 241)
    for altitude in _RINGS_DEG:
        row, column = camera.pixel_of(turn, altitude)
        _polyline(pen, [at(p) if np.isfinite(p[0]) else None for p in zip(row, column, strict=True)])
        if np.isfinite(row[20]):
            pen.text(at((row[20], column[20])), f"{altitude:.0f}°", (150, 200, 255), font_size=_LETTERS_PX)
    for azimuth, letter in zip(range(0, 360, 45), ("N", "NE", "E", "SE", "S", "SW", "W", "NW"), strict=True):
        row, column = camera.pixel_of(float(azimuth), np.linspace(0, 80, 41))
        _polyline(pen, [at(p) if np.isfinite(p[0]) else None for p in zip(row, column, strict=True)])
        place = np.array(camera.pixel_of(float(azimuth), 4.0))
        if np.isfinite(place).all():
            pen.text(at(place), letter, (235, 235, 235), anchor="mm", font_size=_LETTERS_PX)


def _polyline(pen: Any, points: list[tuple[float, float] | None]) -> None:
    for one, other in pairwise(points):
        if one is not None and other is not None:
            pen.line([one, other], _GRID)


def _circle(pen: Any, centre: tuple[float, float], radius: float, colour: tuple[int, int, int]) -> None:
    x, y = centre
    pen.ellipse([x - radius, y - radius, x + radius, y + radius], outline=colour, width=2)


def _stretched(counts: NDArray[Any]) -> NDArray[np.uint8]:
    """Three channels of 8 bits; dark frames are lifted (asinh), bright ones left as they are."""
    values = counts.astype(np.float32)
    low, middle, high = np.percentile(values[::4, ::4], (1, 50, 99.7))
    shown = np.clip((values - low) / max(high - low, 1e-6), 0, 1)
    if middle - low < 0.3 * (high - low):
        shown = np.arcsinh(8 * shown) / np.arcsinh(8.0)
    bytes_ = np.round(255 * shown).astype(np.uint8)
    return bytes_ if bytes_.ndim == 3 else np.repeat(bytes_[..., None], 3, axis=-1)
