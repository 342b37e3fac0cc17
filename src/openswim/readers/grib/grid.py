"""Where the columns of a GRIB field lie: its grid definition as a `Mesh`, and its values turned to fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.readers.common.projections import crs_of
from openswim.readers.domain.mesh import Mesh
from openswim.readers.grib.file import MAX_POINTS, Field, GRIBFile
from openswim.readers.grib.scanning import check_scanning
from openswim.scene.grid import EARTH_RADIUS_M

if TYPE_CHECKING:
    from pyproj import CRS

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NAMES = {
    "regular_ll": "latitude-longitude",
    "rotated_ll": "rotated latitude-longitude",
    "regular_gg": "Gaussian",
    "reduced_gg": "reduced Gaussian",
    "lambert": "Lambert conformal",
    "lambert_lam": "Lambert conformal",
    "polar_stereographic": "polar stereographic",
    "mercator": "Mercator",
    "lambert_azimuthal_equal_area": "Lambert azimuthal equal-area",
}
_KEYS = (
    "gridType", "Ni", "Nj", "Nx", "Ny", "numberOfDataPoints", "iScansNegatively", "jScansPositively",
    "jPointsAreConsecutive", "alternativeRowScanning", "resolutionAndComponentFlags", "radius", "earthIsOblate",
    "earthMajorAxisInMetres", "earthMinorAxisInMetres", "latitudeOfFirstGridPointInDegrees",
    "longitudeOfFirstGridPointInDegrees", "latitudeOfLastGridPointInDegrees", "longitudeOfLastGridPointInDegrees",
    "iDirectionIncrementInDegrees", "jDirectionIncrementInDegrees", "latitudeOfSouthernPoleInDegrees",
    "longitudeOfSouthernPoleInDegrees", "angleOfRotationInDegrees", "LaDInDegrees", "LoVInDegrees", "DxInMetres",
    "DyInMetres", "DiInMetres", "DjInMetres", "Latin1InDegrees", "Latin2InDegrees", "southPoleOnProjectionPlane",
    "orientationOfTheGridInDegrees", "standardParallelInDegrees", "centralLongitudeInDegrees",
    "xDirectionGridLengthInMetres", "yDirectionGridLengthInMetres",
)  # fmt: skip


@dataclass(frozen=True)
class GribGrid:
    """A grid definition: its mesh, how values lie in the message, and whether winds are along the grid."""

    mesh: Mesh
    kind: str
    flip_x: bool
    flip_y: bool
    columns_first: bool
    alternating: bool
    wind_along_grid: bool
    counts: NDArray[np.int64]  # of points in each row of a reduced grid, from the south; else empty
    repeated: bool  # the first meridian comes again at the end

    def window(self, values: F32, rows: slice, columns: slice) -> F32:
        """Some rows and columns of a field as it lies in the message."""
        if self.counts.size:
            return self._expanded(values, rows)[:, columns]
        ny, nx = self.mesh.shape[0], self.mesh.shape[1] + self.repeated
        field = values.reshape(nx, ny).T if self.columns_first else values.reshape(ny, nx)
        if self.alternating:
            field = field.copy()
            field[1::2] = field[1::2, ::-1]
        field = field[:: -1 if self.flip_y else 1, :: -1 if self.flip_x else 1]
        return np.asarray(field[rows, columns])

    def _expanded(self, values: F32, rows: slice) -> F32:
        """Rows of a reduced grid on the longitudes of its longest row, linearly."""
        nx = self.mesh.shape[1]
        ends = np.cumsum(self.counts[::-1])[::-1]  # the message begins in the north
        out = np.empty((rows.stop - rows.start, nx), np.float32)
        for row, j in zip(out, range(rows.start, rows.stop), strict=True):
            count = int(self.counts[j])
            own = values[ends[j] - count : ends[j]]
            row[:] = np.interp(np.arange(nx) * (count / nx), np.arange(count + 1), np.append(own, own[0]))
        return out


def grid_of(file: GRIBFile, one: Field, notes: list[str]) -> GribGrid:
    """The grid of a field; a UserError names kinds that are not known."""
    keys = file.keys(one, _KEYS)
    kind = str(keys["gridType"])
    if kind not in NAMES:
        raise UserError(
            f"{file.path}: grid of kind {shown(kind)} is not read: regrid it to latitude and longitude "
            "(cdo, wgrib2 or the archive's own interpolation)"
        )
    counts = np.empty(0, np.int64)
    if kind == "reduced_gg":
        counts = file.array(one, "pl").astype(np.int64)[::-1]
    nx, ny = (int(keys[a] or keys[b] or 0) for a, b in (("Ni", "Nx"), ("Nj", "Ny")))
    points = int(keys["numberOfDataPoints"] or 0)
    if counts.size:
        nx, ny = int(counts.max()), counts.size
    expected = int(counts.sum()) if counts.size else nx * ny
    if nx < 2 or ny < 2 or nx * ny > MAX_POINTS or expected != points:
        raise UserError(f"{file.path}: {one.name} has {points} points on a grid of {nx} x {ny}: damaged, or one column")
    try:
        if kind.endswith(("_ll", "_gg")):
            check_scanning(f"{file.path}: {one.name}", keys, nx)
        crs, radius = _crs(keys, kind, notes)
        x, y = _axes(file, one, keys, kind, crs, nx, ny, notes)
    except (TypeError, ValueError) as error:
        raise UserError(f"{file.path}: the grid definition of {one.name} is incomplete: damaged") from error
    repeated = bool(crs.is_geographic and not counts.size and abs(x[-1] - x[0] - 360.0) < 1e-3)
    if repeated:
        x = x[:-1]
    return GribGrid(
        mesh=Mesh(x, y, crs, radius),
        kind=kind,
        flip_x=bool(keys["iScansNegatively"]),
        flip_y=not keys["jScansPositively"],
        columns_first=bool(keys["jPointsAreConsecutive"]),
        alternating=bool(keys["alternativeRowScanning"]),
        wind_along_grid=bool(int(keys["resolutionAndComponentFlags"] or 0) & 8),
        counts=counts,
        repeated=repeated,
    )


def _crs(keys: dict[str, Any], kind: str, notes: list[str]) -> tuple[CRS, float]:
    """The projection, and the radius of the sphere that stands for the Earth [m]."""
    from pyproj import CRS

    radius = float(keys["radius"] or 0.0)
    figure = f"+R={radius}"
    if not 6.0e6 < radius < 6.8e6:
        major, minor = keys["earthMajorAxisInMetres"], keys["earthMinorAxisInMetres"]
        radius, figure = EARTH_RADIUS_M, f"+R={EARTH_RADIUS_M}"
        if major and minor and 6.3e6 < minor <= major < 6.4e6:
            figure = f"+a={major} +b={minor}"
            if not kind.endswith(("_ll", "_gg")):
                notes.append("the projection is on an ellipsoid: its latitudes are used on a sphere of 6371 km")
    if kind in ("regular_ll", "regular_gg", "reduced_gg"):
        return CRS.from_proj4(f"+proj=longlat +R={radius} +no_defs"), radius
    if kind == "rotated_ll":
        south, lon = keys["latitudeOfSouthernPoleInDegrees"], keys["longitudeOfSouthernPoleInDegrees"]
        return crs_of(
            {
                "grid_mapping_name": "rotated_latitude_longitude",
                "grid_north_pole_latitude": -south,
                "grid_north_pole_longitude": (lon + 180.0 + 180.0) % 360.0 - 180.0,
                "north_pole_grid_longitude": float(keys["angleOfRotationInDegrees"] or 0.0),
                "earth_radius": radius,
            }
        ), radius
    if kind in ("lambert", "lambert_lam"):
        described = (
            f"+proj=lcc +lat_1={keys['Latin1InDegrees']} +lat_2={keys['Latin2InDegrees']} "
            f"+lat_0={keys['LaDInDegrees'] or keys['Latin1InDegrees']} +lon_0={keys['LoVInDegrees']}"
        )
    elif kind == "polar_stereographic":
        pole = -90.0 if keys["southPoleOnProjectionPlane"] else 90.0
        true_lat = keys["LaDInDegrees"]
        true_lat = 60.0 if true_lat is None else abs(true_lat)
        described = (
            f"+proj=stere +lat_0={pole} +lat_ts={np.copysign(true_lat, pole)} "
            f"+lon_0={keys['orientationOfTheGridInDegrees']}"
        )
    elif kind == "mercator":
        middle = _middle_lon(keys)
        described = f"+proj=merc +lat_ts={keys['LaDInDegrees']} +lon_0={middle}"
    else:
        described = (
            f"+proj=laea +lat_0={keys['standardParallelInDegrees']} +lon_0={keys['centralLongitudeInDegrees']}"
        )
    return CRS.from_proj4(f"{described} {figure} +no_defs"), radius


def _middle_lon(keys: dict[str, Any]) -> float:
    first, last = (keys[f"longitudeOf{end}GridPointInDegrees"] for end in ("First", "Last"))
    return float(first + 0.5 * ((last - first) % 360.0))


def _axes(
    file: GRIBFile, one: Field, keys: dict[str, Any], kind: str, crs: CRS, nx: int, ny: int, notes: list[str]
) -> tuple[F64, F64]:
    """Ascending node coordinates in the projection."""
    lon, lat = (float(keys[f"{name}OfFirstGridPointInDegrees"]) for name in ("longitude", "latitude"))
    if kind in ("regular_gg", "reduced_gg"):
        y = np.sort(file.array(one, "distinctLatitudes"))
        if y.size != ny:
            raise UserError(f"{file.path}: a Gaussian grid of {ny} rows with {y.size} latitudes: damaged")
        span = 360.0 * (1 - 1 / nx) if kind == "reduced_gg" else _span(keys, nx, notes)
        if kind == "reduced_gg" and abs((keys["longitudeOfLastGridPointInDegrees"] - lon) % 360.0 - span) > 1.0:
            raise UserError(f"{file.path}: a reduced Gaussian grid that is not global: regrid it to even longitudes")
        return lon + np.linspace(0.0, span, nx), y
    if kind in ("regular_ll", "rotated_ll"):
        last, step = float(keys["latitudeOfLastGridPointInDegrees"]), keys["jDirectionIncrementInDegrees"]
        told = bool(step) and 0 < step < 90.0
        off = abs((ny - 1) - abs(last - lat) / step) if told else 0.0  # rows
        if off > 1.5:
            raise UserError(
                f"{file.path}: {ny} rows from latitude {lat:g} to {last:g} are not {step:g} degrees apart: damaged"
            )
        if off > 0.5:  # a part that was cut out of a larger grid, GEFS-Aerosols for one
            last = lat + math.copysign(step * (ny - 1), last - lat)
            notes.append(f"{ny} rows of {step:g} degrees end a row beside where the file says: at latitude {last:g}")
        span = _span(keys, nx, notes)
        west = lon - span if keys["iScansNegatively"] else lon
        return west + np.linspace(0.0, span, nx), np.linspace(min(lat, last), max(lat, last), ny)
    from pyproj import Transformer

    x0, y0 = Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True).transform(lon, lat)
    dx = keys["DxInMetres"] or keys["DiInMetres"] or keys["xDirectionGridLengthInMetres"]
    dy = keys["DyInMetres"] or keys["DjInMetres"] or keys["yDirectionGridLengthInMetres"]
    if not (dx and dy and dx > 0 and dy > 0):
        raise UserError(f"{file.path}: the grid of {one.name} has no spacing: damaged")
    x, y = x0 + dx * np.arange(nx), y0 + dy * np.arange(ny)
    if keys["iScansNegatively"]:
        x = x - (x[-1] - x[0])
    if not keys["jScansPositively"]:
        y = y - (y[-1] - y[0])
    return x, y


def _span(keys: dict[str, Any], nx: int, notes: list[str]) -> float:
    """Longitudes from the first to the last column, from these and the increment (either may be rounded); a note where
    they differ by a column or more."""
    first, last = (float(keys[f"longitudeOf{end}GridPointInDegrees"]) for end in ("First", "Last"))
    if keys["iScansNegatively"]:
        first, last = last, first
    step = keys["iDirectionIncrementInDegrees"]
    span = (last - first) % 360.0 or 360.0
    if step and 0 < step < 360.0 and abs(step * (nx - 1) - span) > 0.5 * step:
        beside = abs(((step * (nx - 1) - span) + 180.0) % 360.0 - 180.0)
        if beside > step:
            notes.append(f"{nx} columns of {step:g} degrees do not end where the file says, at longitude {last:g}")
        span = float(step) * (nx - 1)
    return span
