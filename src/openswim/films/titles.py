"""What stands on each frame of a film: valid time, place and model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

NARROWEST = 200  # pixels: under it nobody could read a title
_SAME = np.timedelta64(300, "s")  # light is placed anew so often
_APART = "   "
_SHADE = 0.45  # of the picture's light that is left behind the title


def titled(picture: NDArray[np.uint8], facts: dict[str, Any]) -> NDArray[np.uint8]:
    """The picture (y, x, 3) with a line at its foot, on a darker strip of the picture itself, of what has room."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = picture.shape[:2]
    size = float(np.clip(width / 62, 9, 28))
    font = ImageFont.load_default(size)
    parts = title(facts)
    while parts and font.getlength(_APART.join(parts)) > width - 12:
        parts.pop()
    text = _APART.join(parts)
    if width < NARROWEST or not text:
        return picture
    rows = min(round(1.7 * size), height // 4)
    out = picture.copy()
    out[height - rows :] = (out[height - rows :] * _SHADE).astype(np.uint8)
    drawn = Image.fromarray(out)
    ImageDraw.Draw(drawn).text((6, height - rows + 0.2 * size), text, (235, 235, 230), font=font)
    return np.asarray(drawn)


def title(facts: dict[str, Any]) -> list[str]:
    """Valid time, where the light is of another time that too, place, model, height, what is ahead: what differs in
    length from frame to frame is last, so that the rest is in all or in none."""
    parts = []
    weather, light, own = (
        str(facts.get(name) or "")[:19].replace("T", " ") for name in ("valid_time", "light_time", "time")
    )
    if own and light and _together(own, light):  # along a path light is of some minutes, a frame of its moment
        light = own
    if weather:
        parts.append(f"{weather} UTC")
    if light and not _together(weather, light):
        parts.append(f"light of {light} UTC")
    if facts.get("latitude") is not None:
        lat, lon = float(facts["latitude"]), (float(facts["longitude"]) + 180) % 360 - 180
        parts.append(f"{abs(lat):.2f} {'N' if lat >= 0 else 'S'} {abs(lon):.2f} {'E' if lon >= 0 else 'W'}")
    source = str(facts.get("source", "")).split(":")[0]
    parts += [Path(source).name] if source else []
    if facts.get("height_m") is not None:
        above = " above sea level" if facts.get("height_above") == "sea level" else ""
        parts.append(f"{float(facts['height_m']):,.0f} m{above}")
    if facts.get("ahead"):
        parts.append(f"{facts['ahead']} {_length(float(facts['ahead_m']))} ahead")
    return parts


def _together(weather: str, light: str) -> bool:
    """Whether two times are as good as the same for the sun."""
    return bool(weather and abs(np.datetime64(light) - np.datetime64(weather)) <= _SAME)


def _length(metres: float) -> str:
    """In m or km, to two digits."""
    if metres < 1000:
        return f"{float(f'{metres:.2g}'):.0f} m"
    return f"{metres / 1000:.1f} km" if metres < 10_000 else f"{metres / 1000:.0f} km"
