"""What may be drawn over a picture of the sky: sun, moon, planets, compass, rings of altitude; as SVG."""

from functools import lru_cache
from html import escape
from itertools import pairwise

import numpy as np

from openswim.cameras import Camera
from openswim.lights import PLANETS, Moon, Sun, moon_position, planet_position, sun_position

RINGS_DEG = (0, 15, 30, 45, 60, 75)
COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
_FAINTEST = 4.0  # planets that the eye sees
_BRIGHT = PLANETS[:5]  # the others are always fainter


Places = dict[str, tuple[float, float]]
Place = tuple[float, float, float, float]  # row, column, half the height, half the width


def bodies(
    place: tuple[float, float] | None, time: np.datetime64, sun: tuple[float, float] | None = None
) -> Places:
    """Azimuth and refracted altitude (degrees) of sun, moon and bright planets that are up; of the sun alone where the
    place (latitude, longitude) is not known."""
    if place is None:
        return {} if sun is None else {"sun": sun}
    found: dict[str, Sun | Moon] = {"sun": sun_position(time, *place), "moon": moon_position(time, *place)}
    places = {name: (body.azimuth_deg, body.refracted_altitude_deg) for name, body in found.items()}
    for name in _BRIGHT:
        planet = planet_position(name, time, *place)
        if planet.magnitude < _FAINTEST:
            places[name] = planet.azimuth_deg, planet.refracted_altitude_deg
    if sun is not None:
        places["sun"] = sun
    return {name: at for name, at in places.items() if at[1] > -0.5}


def overlay(camera: Camera, places: dict[str, tuple[float, float]]) -> str:
    """An SVG of the picture's size with groups of class rings, compass and bodies."""
    ny, nx = camera.shape
    size = min(ny, nx) / 28
    marked = []
    taken: list[Place] = []  # middles of names and circles, and half their height and width
    seen = {name: (float(row), float(column)) for name, at in places.items()
            for row, column in [camera.pixel_of(*at)] if np.isfinite(row)}  # fmt: skip
    for y, x in seen.values():
        marked.append(f'<circle cx="{x + 0.5:.1f}" cy="{y + 0.5:.1f}" r="{0.5 * size:.1f}"/>')
        taken.append((y, x, 0.5 * size, 0.5 * size))
    for name, (y, x) in seen.items():
        taken.append(_free((y, x, 0.5 * size, 0.3 * len(name) * size), size, taken, below=name in PLANETS))
        marked.append(_text(*taken[-1][:2], name, size, camera.shape))
    groups = f'{_fixed_marks(camera, size)}<g class="bodies">{"".join(marked)}</g>'
    return f'<svg class="marks" viewBox="0 0 {nx} {ny}" preserveAspectRatio="none">{groups}</svg>'


def _free(place: Place, size: float, taken: list[Place], below: bool) -> Place:
    """Where a name of some height and width stands beside a place so that it covers none of those that stand: below or
    above it, then beside it; below or above if there is no such place."""
    y, x, high, wide = place
    first = size if below else -size
    ways = ((first, 0.0), (-first, 0.0), (0.0, size + wide), (0.0, -size - wide), (2 * first, 0.0), (-2 * first, 0.0))
    for down, right in ways:
        if all(abs(y + down - v) >= high + h or abs(x + right - u) >= wide + w for v, u, h, w in taken):
            return y + down, x + right, high, wide
    return y + first, x, high, wide


@lru_cache(maxsize=4)
def _fixed_marks(camera: Camera, size: float) -> str:
    """Rings and compass, which are the same in all of a camera's pictures."""
    nx = camera.shape[1]
    rings = []
    turn = np.linspace(0, 360, 181)
    for altitude in RINGS_DEG:
        row, column = camera.pixel_of(turn, float(altitude))
        rings.append(_path(row, column, nx))
        rings.append(_text(row[18], column[18], str(altitude), size, camera.shape))
    compass = []
    for azimuth, letter in zip(range(0, 360, 45), COMPASS, strict=True):
        row, column = camera.pixel_of(float(azimuth), np.linspace(0, 85, 35))
        compass.append(_path(row, column, nx))
        compass.append(_text(row[2], column[2], letter, 1.3 * size, camera.shape))
    return f'<g class="rings">{"".join(rings)}</g><g class="compass">{"".join(compass)}</g>'


def _path(row: np.ndarray, column: np.ndarray, width: int) -> str:
    """Lines between places, but not where one is missing or the picture's edge lies between."""
    parts, apart = [], True
    places = list(zip(row, column, strict=True))
    for (y, x), (v, u) in pairwise(places):
        if not np.isfinite([y, x, v, u]).all() or abs(u - x) > width / 4:
            apart = True
            continue
        parts.append((f"M{x + 0.5:.1f} {y + 0.5:.1f}" if apart else "") + f"L{u + 0.5:.1f} {v + 0.5:.1f}")
        apart = False
    return f'<path d="{"".join(parts)}"/>' if parts else ""


def _text(row: float, column: float, text: str, size: float, shape: tuple[int, int]) -> str:
    if not (-1 <= row <= shape[0] and -1 <= column <= shape[1]):
        return ""
    row, column = (
        float(np.clip(at, 0.6 * across, whole - 0.6 * across))  # whole letters, at the edges too
        for at, across, whole in zip((row, column), (size, 0.6 * len(text) * size), shape, strict=True)
    )
    return f'<text x="{column:.1f}" y="{row:.1f}" font-size="{size:.1f}">{escape(text)}</text>'
