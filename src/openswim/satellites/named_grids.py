"""The fixed grids of geostationary imagers, and the part of one that shows a model's domain.

ABI: GOES-R Product Definition and User's Guide, Vol. 3; AHI: Himawari Standard Data User's Guide; SEVIRI: MSG Level 1.5
Image Data Format Description (as it is since December 2017); FCI: MTG FCI Level 1c Data Guide.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from openswim.errors import UserError
from openswim.satellites.fixed_grid import FixedGrid
from openswim.scene import Grid

FULL, CONUS = "full", "conus"
NAMES = (FULL, CONUS)
MOST = 1000  # columns or rows, unless it is said
_EAST, _WEST = ("goes-16", "goes-19"), ("goes-17", "goes-18")
# columns, rows, scan angle (rad) of the middle of the first column and row, step (rad)
_SCANS = {
    "abi": (5424, 5424, -0.151844, 0.151844, 5.6e-5),
    "ahi": (5500, 5500, -2749.5 * 5.588799e-5, 2749.5 * 5.588799e-5, 5.588799e-5),
    "seviri": (3712, 3712, -1855.5 * 8.384333e-5, 1855.5 * 8.384333e-5, 8.384333e-5),
    "fci": (5568, 5568, -2783.5 * 5.588715e-5, 2783.5 * 5.588715e-5, 5.588715e-5),
}
_CONUS = {_EAST: (2500, 1500, -0.101332, 0.128212, 5.6e-5), _WEST: (2500, 1500, -0.069972, 0.128212, 5.6e-5)}
# height and half axes of the ellipsoid (m)
_EARTHS = {
    "abi": (35_786_023.0, 6_378_137.0, 6_356_752.31414),
    "ahi": (35_785_863.0, 6_378_137.0, 6_356_752.3),
    "seviri": (35_785_831.0, 6_378_169.0, 6_356_583.8),
    "fci": (35_786_400.0, 6_378_137.0, 6_356_752.31424518),
}
_PLACES = {"ahi": 140.7, "seviri": 0.0, "fci": 0.0}  # degrees east; of ABI by satellite


def named_grid(imager: str, name: str = FULL, lon_0: float | None = None) -> FixedGrid:
    """All pixels of an imager's full disc, or of ABI's "conus" (from GOES West: "pacus"), 2 km wide (SEVIRI: 3 km).

    imager : as `openswim.satellites.imagers` names it. lon_0 : in place of the longitude at which it is on duty.
    """
    satellite, _, sensor = imager.rpartition(" ")
    if sensor not in _SCANS:
        raise UserError(
            f"--grid: {imager} has no fixed grid; imagers that have one are {', '.join(_SCANS)}: give --disc, or make "
            "openswim.satellites.Pixels of places that you know"
        )
    if name not in NAMES or (name == CONUS and sensor != "abi"):
        raise UserError(f"--grid {name}: {imager} has {' and '.join(NAMES if sensor == 'abi' else NAMES[:1])}")
    own = _WEST if satellite in _WEST else _EAST
    columns, rows, west, north, step = _SCANS[sensor] if name == FULL else _CONUS[own]
    if lon_0 is None:
        lon_0 = _PLACES.get(sensor, -137.0 if own is _WEST else -75.0)
    if not -180 <= lon_0 <= 360:
        raise UserError(f"--lon-0 {lon_0:g}: give degrees east of the point below the satellite")
    x, y = west + step * np.arange(columns), north - step * np.arange(rows)
    sweep: Literal["x", "y"] = "x" if sensor == "abi" else "y"
    return FixedGrid(np.asarray(x, float), np.asarray(y, float), float(lon_0), *_EARTHS[sensor], sweep)


def shown_part(grid: FixedGrid, domain: Grid | None, every: int | None = None) -> tuple[FixedGrid, int]:
    """The rows and columns that show a model's domain, and of these each so many; as many as make a picture of 1000 at
    the most where it is not said. Returns it, and how many."""
    rows, columns = slice(0, grid.y.size), slice(0, grid.x.size)
    if domain is not None and not domain.curved:
        raise UserError("a flat scene has no place on Earth for a satellite to look at: give it a crs (grid_mapping)")
    if domain is not None:
        _, ny, nx = domain.shape
        ix, iy = np.meshgrid(np.linspace(0, nx - 1, min(nx, 300)), np.linspace(0, ny - 1, min(ny, 300)))
        lon, lat = domain.lonlat(ix, iy)
        there = np.isfinite(lon) & np.isfinite(lat)
        row, column = grid.index(lat[there], lon[there])
        if not np.isfinite(row).any():
            raise UserError(f"the model's domain is not seen from {grid.lon_0:g} degrees east: choose another imager")
        rows, columns = (_span(at, size) for at, size in ((row, grid.y.size), (column, grid.x.size)))
        if rows.stop - rows.start < 2 or columns.stop - columns.start < 2:
            raise UserError("the model's domain is not on this grid: choose another, such as --grid full")
    sides = rows.stop - rows.start, columns.stop - columns.start
    most = min(sides) - 1
    if every is None:
        every = min(-(-max(sides) // MOST), most)
    if every < 1:
        raise UserError(f"--every {every}: give 1 for all pixels, 2 for each second, and so on")
    if every > most:
        raise UserError(
            f"--every {every}: leaves less than two of the {most + 1} rows or columns that show the model's domain: "
            f"give {most} at most"
        )
    chosen = (slice(part.start, part.stop, every) for part in (rows, columns))
    return grid.part(*chosen), every


def _span(at: np.ndarray, size: int) -> slice:
    low, high = np.nanmin(at), np.nanmax(at)
    return slice(int(np.clip(np.floor(low), 0, size)), int(np.clip(np.ceil(high) + 1, 0, size)))
