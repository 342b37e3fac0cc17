"""What was rendered, in words: the caption of a picture."""

from typing import Any

import numpy as np
import xarray as xr
from PIL import Image, ImageDraw, ImageFont

BACKGROUND, INK = (16, 16, 18), (205, 205, 200)
NARROWEST = 160  # pixels


def facts(image: xr.Dataset | xr.DataArray, exposure: float | None = None) -> dict[str, str]:
    """What is known of a rendered image, by name: view, place, time, sun, irradiance and so on.

    Read from the attributes view, view_azimuth_deg, view_altitude_deg, field_of_view_deg; latitude, longitude or
    x_m, y_m; height_m, height_above; valid_time of the weather, light_time of the sun; sun_altitude_deg,
    sun_azimuth_deg; global_, direct_ and diffuse_horizontal_irradiance_w_m2; source; solver.  What the image lacks is
    left out.
    """
    attrs = image.attrs
    found = {
        "View": _view(attrs),
        "Place": _place(attrs),
        **_times(attrs),
        "Sun": _sun(attrs),
        "Irradiance": _irradiance(attrs),
        "Source": str(attrs.get("source", "")),
        "Solver": str(attrs.get("solver", "")),
        "Exposure": f"{exposure:.3g}" if exposure is not None else "",
    }
    return {key: value for key, value in found.items() if value}


def _view(attrs: dict[Any, Any]) -> str:
    text = str(attrs.get("view", ""))
    if attrs.get("view_azimuth_deg") is None:
        return text
    azimuth, altitude, wide = (
        float(attrs[name]) for name in ("view_azimuth_deg", "view_altitude_deg", "field_of_view_deg")
    )
    where = "straight down" if altitude == -90.0 else f"azimuth {azimuth:g}, altitude {altitude:g}"
    return f"{text}, {where}, {wide:.3g} degrees wide"


def _place(attrs: dict[Any, Any]) -> str:
    height = _height(attrs)
    if attrs.get("latitude") is not None and attrs.get("longitude") is not None:
        lat, lon = float(attrs["latitude"]), (float(attrs["longitude"]) + 180) % 360 - 180
        return f"{abs(lat):.3f} {'N' if lat >= 0 else 'S'} {abs(lon):.3f} {'E' if lon >= 0 else 'W'}{height}"
    if attrs.get("x_m") is not None and attrs.get("y_m") is not None:
        return f"x {float(attrs['x_m']):.0f} m, y {float(attrs['y_m']):.0f} m{height}"
    return ""


def _height(attrs: dict[Any, Any]) -> str:
    if attrs.get("height_m") is None:
        return ""
    height, above = float(attrs["height_m"]), attrs.get("height_above", "ground")
    return (
        f", {height / 1000:,.0f} km above {above}" if height >= 20_000 else f", {height:.0f} m above {above}"
    )


def _times(attrs: dict[Any, Any]) -> dict[str, str]:
    """When it was: one time, or that of the weather and that of the light where the sun is another time's."""
    weather, light = (str(attrs.get(name) or "")[:19].replace("T", " ") for name in ("valid_time", "light_time"))
    if weather == light or not weather:
        return {"Time": f"{light} UTC" if light else ""}
    if not light:
        return {"Weather": f"{weather} UTC", "Light": "sun placed by hand"}
    hours = (np.datetime64(light) - np.datetime64(weather)) / np.timedelta64(1, "h")
    apart = f"{abs(hours):.3g} h" if abs(hours) < 48 else f"{abs(hours) / 24:.3g} days"
    return {"Weather": f"{weather} UTC", "Light": f"{light} UTC, {apart} {'later' if hours > 0 else 'earlier'}"}


def _sun(attrs: dict[Any, Any]) -> str:
    if attrs.get("sun_altitude_deg") is None:
        return ""
    text = f"altitude {float(attrs['sun_altitude_deg']):.1f}"
    if attrs.get("sun_azimuth_deg") is not None:
        text += f", azimuth {float(attrs['sun_azimuth_deg']):.1f}"
    return text + " degrees"


def _irradiance(attrs: dict[Any, Any]) -> str:
    values = {
        name: attrs.get(f"{name}_horizontal_irradiance_w_m2") for name in ("global", "direct", "diffuse")
    }
    known = [f"{name} {float(value):.0f}" for name, value in values.items() if value is not None]
    return ", ".join(known) + " W/m2" if known else ""


def with_strip(picture: np.ndarray, entries: dict[str, str], inside: bool = False) -> np.ndarray:
    """The picture (y, x, 3), uint8 or uint16, with the entries on a strip wrapped to its width: below it, or `inside`
    over its lowest rows, of which a third shines through. Without it where nobody could read it, or where it would
    take more than a quarter of the picture."""
    rows, width = picture.shape[:2]
    if width < NARROWEST:
        return picture
    size = float(np.clip(width / (100 if inside else 70), 9, 24))
    font = ImageFont.load_default(size)
    space, step = round(size * 0.6), round(size * 1.4)
    parts = [value if key == "Place" else f"{key}: {value}" for key, value in entries.items()]
    lines = _wrapped(parts, font, width - 2 * space)
    strip = Image.new("RGB", (width, len(lines) * step + space), BACKGROUND)
    draw = ImageDraw.Draw(strip)
    for row, line in enumerate(lines):
        draw.text((space, row * step + space // 2), line, INK, font=font)
    drawn = np.asarray(strip).astype(picture.dtype) * (257 if picture.dtype == np.uint16 else 1)
    if not inside:
        return np.concatenate([picture, drawn])
    if 4 * len(drawn) > rows:
        return picture
    below = picture[rows - len(drawn) :].astype(int) // 3
    seen = np.maximum(drawn, below.astype(picture.dtype))
    return np.concatenate([picture[: rows - len(drawn)], seen])


def _wrapped(parts: list[str], font: Any, width: float) -> list[str]:
    """The parts joined into as few lines as fit, a part too long for a line at its spaces; longer words are cut."""
    lines: list[str] = []
    for part in parts:
        alone = font.getlength(part) <= width
        for n, piece in enumerate([part] if alone else part.split()):
            joined = f"{lines[-1]}{' ' if n else '  |  '}{piece}" if lines else piece
            if lines and (n or alone) and font.getlength(joined) <= width:
                lines[-1] = joined
            else:
                lines.append(_shortened(piece, font, width))
    return lines


def _shortened(text: str, font: Any, width: float) -> str:
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "...") > width:
        text = text[:-1]
    return text + "..."
