"""Where a WRF grid lies: its projection on WRF's sphere, checked against XLAT and XLONG."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.base import cells_off
from openswim.readers.common.projections import crs_of
from openswim.readers.wrf.file import FULL_LEVELS, SURFACE, WRFFile
from openswim.scene import Grid

if TYPE_CHECKING:
    from pyproj import CRS

WRF_EARTH_RADIUS_M = 6_370_000.0
WRF_GRAVITY = 9.81  # m s-2, as in WRF's own constants
_TOLERANCE_CELLS = 0.1
CARTESIAN, LAMBERT, POLAR, MERCATOR, LATLON = 0, 1, 2, 3, 6
PROJECTIONS = {
    CARTESIAN: "none (idealised run)",
    LAMBERT: "Lambert conformal",
    POLAR: "polar stereographic",
    MERCATOR: "Mercator",
    LATLON: "latitude-longitude",
}


def wrf_grid(file: WRFFile, notes: list[str]) -> Grid:
    """The grid of mass points at the chosen time; what was assumed is added to `notes`.

    Heights are geopotential/9.81, averaged from full to mass levels. The projection comes from the global
    attributes; its origin from XLAT/XLONG at that time, since files are cropped and nests move.
    """
    height_m = mass_heights_m(file)
    kind = projection_kind(file)
    if kind == CARTESIAN:
        notes.append("idealised run without map projection: flat Earth, open sides")
        return Grid(*_flat_axes(file), height_m)
    lonlat = _lonlat(file)
    if lonlat is None:
        crs = projection(file, kind, file.number("CEN_LON"))
        x, y = _axes_from_centre(file, crs)
        notes.append("no XLAT/XLONG in the file: placed by CEN_LAT/CEN_LON")
        return Grid(x, y, height_m, crs, WRF_EARTH_RADIUS_M)
    lon, lat = lonlat
    crs = projection(file, kind, float(lon[lon.shape[0] // 2, lon.shape[1] // 2]))
    x, y = _axes_from_lonlat(file, crs, lon, lat, notes)
    grid = Grid(x, y, height_m, crs, WRF_EARTH_RADIUS_M)
    _check_against(file, grid, lon, lat)
    return grid


def mass_heights_m(file: WRFFile) -> NDArray[np.float32]:
    """(nz, ny, nx) heights of mass levels above sea level [m]: (PH + PHB)/9.81 between full levels."""
    full = _full_heights_m(file)
    return (0.5 * (full[1:] + full[:-1])).astype(np.float32)


def lowest_height_m(file: WRFFile) -> NDArray[np.float32]:
    """(ny, nx) height of the lowest full level, which lies on the terrain [m]."""
    return _full_heights_m(file)[0].astype(np.float32)


def _full_heights_m(file: WRFFile) -> NDArray[Any]:
    return (file.field("PH", FULL_LEVELS, "m2 s-2") + file.field("PHB", FULL_LEVELS, "m2 s-2")) / WRF_GRAVITY


def projection_kind(file: WRFFile) -> int:
    """MAP_PROJ: 0 Cartesian, 1 Lambert, 2 polar stereographic, 3 Mercator, 6 latitude-longitude."""
    kind = file.number("MAP_PROJ")
    if kind not in PROJECTIONS:
        raise UserError(f"{file.path}: global attribute MAP_PROJ is {kind:g}; known are 0, 1, 2, 3 and 6")
    return int(kind)


def projection(file: WRFFile, kind: int, centre_lon: float) -> CRS:
    """The projection on WRF's sphere from the global attributes (meanings: WRF share/module_llxy.F)."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    if kind == LAMBERT:
        first, second = file.number("TRUELAT1"), file.number("TRUELAT2")
        if abs(second) > 90.0:  # WPS leaves 1e20 where only one true latitude was set
            second = first
        origin = f"+lat_0={file.number('MOAD_CEN_LAT')} +lon_0={file.number('STAND_LON')}"
        described = f"+proj=lcc +lat_1={first} +lat_2={second} {origin}"
    elif kind == POLAR:
        true_lat = file.number("TRUELAT1")
        pole = np.copysign(90.0, true_lat)
        described = f"+proj=stere +lat_0={pole} +lat_ts={true_lat} +lon_0={file.number('STAND_LON')}"
    elif kind == MERCATOR:
        # the central meridian only shifts x: the domain's own keeps it clear of the 180-degree seam
        described = f"+proj=merc +lat_ts={file.number('TRUELAT1')} +lon_0={centre_lon}"
    elif abs(file.number("POLE_LAT", 90.0)) > 89.999:
        described = "+proj=longlat"
    else:
        return crs_of(
            {
                "grid_mapping_name": "rotated_latitude_longitude",
                "grid_north_pole_latitude": file.number("POLE_LAT"),
                "grid_north_pole_longitude": 180.0 - file.number("STAND_LON"),
                "north_pole_grid_longitude": file.number("POLE_LON"),
                "earth_radius": WRF_EARTH_RADIUS_M,
            }
        )
    try:
        return CRS.from_proj4(f"{described} +R={WRF_EARTH_RADIUS_M} +no_defs")
    except CRSError as error:
        raise UserError(
            f"{file.path}: global attributes MAP_PROJ, TRUELAT1, TRUELAT2, MOAD_CEN_LAT and STAND_LON make no map "
            f"({described.removeprefix('+')}): correct these, or take the original file"
        ) from error


def _spacing(file: WRFFile) -> tuple[float, float]:
    dx, dy = file.number("DX"), file.number("DY")
    if dx <= 0 or dy <= 0:
        raise UserError(f"{file.path}: global attributes DX, DY are {dx}, {dy}; they must be positive")
    return dx, dy


def _flat_axes(file: WRFFile) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    dx, dy = _spacing(file)
    nx, ny = file.size("west_east"), file.size("south_north")
    half_x, half_y = 0.5 * dx * (nx - 1), 0.5 * dy * (ny - 1)
    return np.linspace(-half_x, half_x, nx), np.linspace(-half_y, half_y, ny)


def _lonlat(file: WRFFile) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    if "XLAT" not in file or "XLONG" not in file:
        return None
    lat, lon = (file.field(name, SURFACE).astype(np.float64) for name in ("XLAT", "XLONG"))
    if np.abs(lat).max() > 90.0 or np.abs(lon).max() > 361.0:
        raise UserError(f"{file.path}: XLAT/XLONG hold values beyond 90/360 degrees: damaged file")
    return None if np.ptp(lat) == 0.0 and np.ptp(lon) == 0.0 else (lon, lat)


def _axes_from_centre(file: WRFFile, crs: CRS) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = _flat_axes(file)
    whole = (file.attr("WEST-EAST_GRID_DIMENSION"), file.attr("SOUTH-NORTH_GRID_DIMENSION"))
    if crs.is_geographic or whole != (x.size + 1, y.size + 1):
        raise UserError(
            f"{file.path}: cannot be placed on Earth: XLAT and XLONG are missing and CEN_LAT, CEN_LON "
            "do not describe this grid: keep XLAT and XLONG in the file"
        )
    from pyproj import Transformer

    to_xy = Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True)
    x0, y0 = to_xy.transform(file.number("CEN_LON"), file.number("CEN_LAT"))
    return x + x0, y + y0


def _axes_from_lonlat(
    file: WRFFile, crs: CRS, lon: NDArray[np.float64], lat: NDArray[np.float64], notes: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Even axes through the file's own coordinates; averaging over all nodes beats their float32 rounding."""
    probe = Grid(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.array([0.0, 1.0]), crs)
    x, y = probe.index(lon, lat)
    ny, nx = x.shape
    if min(ny, nx) < 2:
        raise UserError(f"{file.path}: {nx} x {ny} columns: a scene takes two and more each way: cut a wider part")
    steps = np.diff(x, axis=1)
    if probe.in_degrees:  # longitude may wrap inside the domain
        steps = (steps + 180.0) % 360.0 - 180.0
        x = x[:, :1] + np.insert(np.cumsum(steps, axis=1), 0, 0.0, axis=1)
        x += 360.0 * np.round((x[ny // 2, 0] - x[:, :1]) / 360.0)
    dx, dy = float(steps.mean()), float(np.diff(y, axis=0).mean())
    declared = file.number("DX", dx)
    if not probe.in_degrees and abs(dx - declared) > 0.01 * abs(dx):
        notes.append(f"spacing {dx:.0f} m from XLAT/XLONG, not DX = {declared:.0f} m: the file was thinned")
    i, j = np.arange(nx, dtype=np.float64), np.arange(ny, dtype=np.float64)
    return dx * i + float((x - dx * i).mean()), dy * j + float((y - dy * j[:, None]).mean())


def _check_against(file: WRFFile, grid: Grid, lon: NDArray[np.float64], lat: NDArray[np.float64]) -> None:
    off = cells_off(grid, lon, lat)
    if not off < _TOLERANCE_CELLS:
        raise UserError(
            f"{file.path}: XLAT/XLONG lie up to {off:.3g} cells off any regular grid in the projection that "
            "MAP_PROJ, TRUELAT1, TRUELAT2 and STAND_LON describe: correct these, or take the original file"
        )
