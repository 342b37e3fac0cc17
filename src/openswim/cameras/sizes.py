"""Sizes of pictures, and how wide the Earth is in them."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from openswim.arguments import number, shown
from openswim.cameras.checks import MAX_HEIGHT_M, check_altitude_range, check_shape, require

Size = int | str | Sequence[int]  # columns; "COLUMNSxROWS" as the command line has it; an array's (rows, columns)
WIDEST_SATELLITE_FOV_DEG = 140.0  # below about 300 km the whole Earth no longer fits a flat picture


def shape_of(size: Size, rows: Callable[[int], int] = int) -> tuple[int, int]:
    """(rows, columns) of a size; `rows` of so many columns where these alone are given."""
    given: Any = size
    if isinstance(given, str):
        match = re.fullmatch(r"\s*(\d{1,6})(?:\s*[xX]\s*(\d{1,6}))?\s*", given)
        require(match is not None, f"image size {shown(given)}: write COLUMNS or COLUMNSxROWS, such as 1440x720")
        assert match is not None
        given = int(match[1]) if match[2] is None else (int(match[2]), int(match[1]))
    given = given.tolist() if isinstance(given, np.ndarray) else given
    alone = isinstance(given, (int, np.integer))
    if alone:
        check_shape((given, given))
    shape: Any = tuple(given) if isinstance(given, Iterable) else (rows(int(given)) if alone else given, given)
    check_shape(shape)
    return int(shape[0]), int(shape[1])


def rows_of(columns: int, altitude_range_deg: tuple[float, float]) -> int:
    bottom, top = check_altitude_range(altitude_range_deg)
    return max(1, round(columns * (top - bottom) / 360))


def whole_disc_fov_deg(height_m: float, earth_radius_m: float, shape: tuple[int, int]) -> float:
    """Width in degrees of a pinhole view in which the Earth's disc fills 97 % of the shorter side."""
    height_m, earth_radius_m = number("satellite height", height_m), number("earth_radius_m", earth_radius_m)
    require(0 < height_m <= MAX_HEIGHT_M, f"satellite height {height_m:g} m is not above 0 up to {MAX_HEIGHT_M:g} m")
    require(1 <= earth_radius_m <= MAX_HEIGHT_M, f"earth_radius_m {earth_radius_m:g} is no radius of an Earth")
    tangent = earth_radius_m / np.sqrt((earth_radius_m + height_m) ** 2 - earth_radius_m**2)
    widest = np.tan(np.radians(WIDEST_SATELLITE_FOV_DEG) / 2)
    return float(2 * np.degrees(np.arctan(min(tangent / 0.97 * shape[1] / min(shape), widest))))
