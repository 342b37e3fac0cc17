"""The grid of a scene: regular in a map projection, in longitude and latitude, or in flat metres."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import check_kind, number, numbers
from openswim.errors import UserError

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

EARTH_RADIUS_M = 6_371_000.0
EDGE = 1e-6  # of a cell, by which rounding puts a domain's corner outside
THINNEST_M = 0.01  # less is no layer
_UNIFORM_TOLERANCE = 0.02  # of a cell: float32 coordinates of fine lat/lon grids are no better


@dataclass(frozen=True, eq=False)
class Grid:
    """Node coordinates of a scene.

    Parameters
    ----------
    x, y : (nx,), (ny,) node coordinates in `crs`, ascending and evenly spaced: metres, or degrees where the
        axes of `crs` are angles (plain or rotated longitude and latitude).
    height_m : (nz,) or (nz, ny, nx) node heights above sea level [m], ascending along the first axis.
    crs : the projection on the *model's* sphere, or None for flat Cartesian metres.
    earth_radius_m : radius of that sphere [m] (WRF: 6370000).
    periodic : the sides are periodic (flat grids only); the period is nx dx by ny dy.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    height_m: NDArray[Any]
    crs: CRS | None = None
    earth_radius_m: float = EARTH_RADIUS_M
    periodic: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", _axis(self.x, "x"))
        object.__setattr__(self, "y", _axis(self.y, "y"))
        object.__setattr__(self, "height_m", _heights(self.height_m, self.y.size, self.x.size))
        check_kind("grid: periodic", self.periodic, (bool, np.bool_), "give True or False")
        object.__setattr__(self, "earth_radius_m", number("grid: earth_radius_m", self.earth_radius_m))
        check_places(self.x, self.y, self.crs)
        if self.periodic and self.crs is not None:
            raise UserError("grid: periodic sides need a flat grid: leave out crs, or set periodic=False")
        if not 1e3 < self.earth_radius_m < 1e9:
            raise UserError(f"grid: earth_radius_m = {self.earth_radius_m} is no planet's radius in metres")

    def __repr__(self) -> str:
        """One line: how large, and where."""
        where = "on the Earth" if self.curved else "flat"
        levels = f"{self.height_m.min():g} to {self.height_m.max():g} m"
        size = "{2} x {1} x {0} nodes".format(*self.shape)
        return f"<Grid: {size}; {levels}; {where}{', periodic' * self.periodic}>"

    @property
    def curved(self) -> bool:
        """True on a sphere (a projection is known), False in flat Cartesian metres."""
        return self.crs is not None

    @property
    def shape(self) -> tuple[int, int, int]:
        """(nz, ny, nx)."""
        return self.height_m.shape[0], self.y.size, self.x.size

    @property
    def in_degrees(self) -> bool:
        """True where x and y are angles: plain or rotated longitude and latitude."""
        return self.crs is not None and bool(self.crs.is_geographic)

    @property
    def step(self) -> tuple[float, float]:
        """Node spacing (dx, dy) in the units of x and y."""
        return (
            float((self.x[-1] - self.x[0]) / (self.x.size - 1)),
            float((self.y[-1] - self.y[0]) / (self.y.size - 1)),
        )

    @cached_property
    def _to_lonlat(self) -> Transformer | None:
        """Transformer from (x, y) to (lon, lat); None where they are the same thing."""
        if self.crs is None:
            raise UserError("a flat grid has no latitude and longitude: place the observer in metres")
        if self.crs.is_geographic and not self.crs.is_derived:
            return None
        from pyproj import Transformer

        # geodetic_crs of a rotated system is the rotated system itself
        base = self.crs.source_crs if self.crs.is_geographic else self.crs.geodetic_crs
        return Transformer.from_crs(self.crs, base, always_xy=True)

    def lonlat(self, ix: ArrayLike, iy: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Longitude and latitude [degrees] of fractional node indices (any broadcastable shapes).

        Latitude is the model's, geocentric on its sphere; longitude lies in [-180, 180).
        """
        ix, iy = np.broadcast_arrays(np.asarray(ix, float), np.asarray(iy, float))
        dx, dy = self.step
        x, y = self.x[0] + dx * ix, self.y[0] + dy * iy
        lon, lat = (x, y) if self._to_lonlat is None else self._to_lonlat.transform(x, y)
        with np.errstate(invalid="ignore"):  # places that the map does not have are infinite
            return (np.asarray(lon) + 180.0) % 360.0 - 180.0, np.asarray(lat, float)

    def index(self, lon: ArrayLike, lat: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Fractional node indices (ix, iy) of longitude and latitude [degrees]; the inverse of `lonlat`.

        Points outside the domain get indices below 0 or above n - 1; points the projection cannot show, inf.
        """
        lon, lat = np.broadcast_arrays(np.asarray(lon, float), np.asarray(lat, float))
        x, y = (lon, lat) if self._to_lonlat is None else self._to_lonlat.transform(lon, lat, direction="INVERSE")
        x, y = np.asarray(x, float), np.asarray(y, float)
        if self.in_degrees:
            middle = 0.5 * (self.x[0] + self.x[-1])
            x = np.where(np.isfinite(x), (x - middle + 180.0) % 360.0 - 180.0 + middle, x)
        dx, dy = self.step
        return (x - self.x[0]) / dx, (y - self.y[0]) / dy

    def place(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Fractional node indices (ix, iy) of longitude and latitude [degrees], or of metres in a flat grid, periodic
        or not."""
        if self.curved:
            return self.index(x, y)
        dx, dy = self.step
        return (np.asarray(x, float) - self.x[0]) / dx, (np.asarray(y, float) - self.y[0]) / dy

    @property
    def centre_index(self) -> tuple[float, float]:
        """Fractional node index of the middle of the domain."""
        return 0.5 * (self.x.size - 1), 0.5 * (self.y.size - 1)

    def spacing_m(self) -> tuple[float, float]:
        """True ground distance (dx, dy) [m] of one cell at the centre of the domain."""
        if self.crs is None:
            return self.step
        ix, iy = self.centre_index
        half = 0.5
        across = self.lonlat([ix - half, ix + half], [iy, iy])
        along = self.lonlat([ix, ix], [iy - half, iy + half])
        return (great_circle_m(*across, self.earth_radius_m), great_circle_m(*along, self.earth_radius_m))

    def size_m(self) -> tuple[float, float]:
        """Width and height [m] of the domain, whole cells at its edges."""
        dx, dy = self.spacing_m()
        return self.x.size * dx, self.y.size * dy

    def axis_angle(self, ix: ArrayLike, iy: ArrayLike) -> NDArray[np.float64]:
        """Angle [radians] from local east to the +x axis, counter-clockwise, at fractional node indices."""
        if self.crs is None:
            return np.zeros(np.broadcast_shapes(np.shape(ix), np.shape(iy)))
        ix, iy = np.broadcast_arrays(np.asarray(ix, float), np.asarray(iy, float))
        step = 0.05
        along = _unit_vector(*self.lonlat(ix + step, iy)) - _unit_vector(*self.lonlat(ix - step, iy))
        lon, lat = (np.radians(angle) for angle in self.lonlat(ix, iy))
        east = np.stack([-np.sin(lon), np.cos(lon), np.zeros_like(lon)])
        north = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
        return np.asarray(np.arctan2((along * north).sum(axis=0), (along * east).sum(axis=0)))

    @property
    def axis_angles(self) -> NDArray[np.float64]:
        """Those (ny, nx) at all columns."""
        return self.axis_angle(np.arange(self.x.size), np.arange(self.y.size)[:, None])


def _unit_vector(lon: ArrayLike, lat: ArrayLike) -> NDArray[np.float64]:
    lon, lat = np.radians(lon), np.radians(lat)
    return np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def great_circle_m(lon: ArrayLike, lat: ArrayLike, radius_m: float) -> float:
    """Distance [m] on a sphere between two points; lon and lat [degrees] hold one value for each."""
    (lon0, lon1), (lat0, lat1) = np.radians(np.asarray(lon)), np.radians(np.asarray(lat))
    haversine = np.sin(0.5 * (lat1 - lat0)) ** 2 + np.cos(lat0) * np.cos(lat1) * np.sin(0.5 * (lon1 - lon0)) ** 2
    return float(2.0 * radius_m * np.arcsin(np.sqrt(haversine)))


def extent_deg(grid: Grid) -> tuple[float, float, float, float]:
    """South, north, west and east end of a domain; over the date line east is beyond 180, and around a pole it goes
    from -180 to 180."""
    _, ny, nx = grid.shape
    i = np.concatenate([np.arange(nx), np.arange(nx), np.zeros(ny), np.full(ny, nx - 1.0)])
    j = np.concatenate([np.zeros(nx), np.full(nx, ny - 1.0), np.arange(ny), np.arange(ny)])
    lon, lat = grid.lonlat(i, j)
    middle = float(grid.lonlat(*grid.centre_index)[0])
    lon = middle + (lon - middle + 180.0) % 360.0 - 180.0
    if lon.min() < -180.0:
        lon = lon + 360.0
    south, north, west, east = float(lat.min()), float(lat.max()), float(lon.min()), float(lon.max())
    for pole in (-90.0, 90.0):
        ix, iy = grid.index(0.0, pole)
        if 0 < ix < nx - 1 and 0 < iy < ny - 1:
            south, north, west, east = min(south, pole), max(north, pole), -180.0, 180.0
    return south, north, west, east


def extent_text(grid: Grid) -> str:
    """ "it covers about latitude ... to ..., longitude ... to ..."."""
    south, north, west, east = extent_deg(grid)
    return f"it covers about latitude {south:.2f} to {north:.2f}, longitude {west:.2f} to {east:.2f}"


def check_places(x: NDArray[np.float64], y: NDArray[np.float64], crs: CRS | None) -> None:
    """UserError for ascending angles (degrees) that are no longitudes and latitudes; metres are not looked at."""
    if crs is None or not crs.is_geographic:
        return
    rounding = 0.01 * (y[-1] - y[0]) / (y.size - 1)
    if y[0] < -90.0 - rounding or y[-1] > 90.0 + rounding:
        raise UserError(f"grid: latitudes run from {y[0]:g} to {y[-1]:g}; they must lie within -90 to 90 degrees")
    if x[0] < -540.0 or x[-1] > 720.0:
        raise UserError(f"grid: longitudes run from {x[0]:g} to {x[-1]:g}; give degrees within -180 to 360")


def _axis(values: ArrayLike, name: str) -> NDArray[np.float64]:
    axis = np.array(numbers(f"grid: {name}", values), dtype=np.float64)
    if axis.ndim != 1 or axis.size < 2:
        raise UserError(f"grid: {name} must be one-dimensional with at least 2 nodes, got shape {axis.shape}")
    if not np.isfinite(axis).all():
        raise UserError(f"grid: {name} contains values that are not finite numbers")
    step = (axis[-1] - axis[0]) / (axis.size - 1)
    if step <= 0 or np.abs(axis - np.linspace(axis[0], axis[-1], axis.size)).max() > _UNIFORM_TOLERANCE * step:
        raise UserError(f"grid: {name} must ascend in even steps: resample the fields to a regular grid")
    return axis


def _heights(values: ArrayLike, ny: int, nx: int) -> NDArray[Any]:
    # float32 resolves 8 mm at 100 km; one-dimensional axes cost nothing, so they keep full precision
    height = numbers("grid: height_m", values)
    height = np.array(height, dtype=np.float64) if height.ndim == 1 else np.ascontiguousarray(height, np.float32)
    if height.ndim not in (1, 3) or height.shape[0] < 2 or (height.ndim == 3 and height.shape[1:] != (ny, nx)):
        raise UserError(f"grid: height_m has shape {height.shape}; it must be (nz,) or (nz, {ny}, {nx}) with nz >= 2")
    if not np.isfinite(height).all() or np.abs(height).max() > 1e6:
        raise UserError("grid: height_m holds missing or absurd values (above 1000 km): give metres above sea level")
    if not (np.diff(height, axis=0) > 0).all():
        raise UserError("grid: height_m must ascend along its first axis: turn the levels (and all fields) over")
    thinnest = float(np.diff(height, axis=0).min())
    if thinnest < THINNEST_M:
        raise UserError(
            f"grid: height_m has levels {thinnest:.2g} m apart, closer than any model's: give metres, leave some out"
        )
    return height
