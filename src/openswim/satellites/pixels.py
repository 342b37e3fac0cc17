"""Pixels whose places are told one by one, seen from one point in space, as EPIC sees the sunlit Earth from L1."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers
from openswim.errors import UserError

F64 = NDArray[np.float64]

_EQUATOR_M, _POLE_M = 6_378_137.0, 6_356_752.31414  # WGS 84
_NEAREST_M, _FARTHEST_M = 6.6e6, 2e9


@dataclass(frozen=True, eq=False)
class Pixels:
    """Geodetic latitude and longitude (ny, nx), degrees, of pixels on the ellipsoid; NaN beside the Earth.

    satellite_lat, satellite_lon : the point below the satellite, on the line to the Earth's centre (geocentric
    latitude); distance_m : of the satellite from that centre, to 2e9.
    """

    latitude: F64
    longitude: F64
    satellite_lat: float
    satellite_lon: float
    distance_m: float

    def __post_init__(self) -> None:
        for name in ("latitude", "longitude"):
            object.__setattr__(self, name, numbers(f"pixels: {name}", getattr(self, name)).astype(float))
        if self.latitude.ndim != 2 or self.latitude.shape != self.longitude.shape:
            raise UserError("pixels: latitude and longitude must have one shape of rows and columns")
        for name in ("satellite_lat", "satellite_lon", "distance_m"):
            number(f"pixels: {name}", getattr(self, name))
        if not _NEAREST_M <= self.distance_m <= _FARTHEST_M:
            raise UserError(f"pixels: distance_m {self.distance_m:g} is from the Earth's centre, 6.6e6 to 2e9")

    @classmethod
    def disc(cls, satellite_lat: float, satellite_lon: float, distance_m: float, field_deg: float, size: int) -> Pixels:
        """A square picture of the whole disc, north up, `field_deg` wide, of an ideal lens pointed at its centre."""
        empty = np.full((2, 2), np.nan)
        view = cls(empty, empty, satellite_lat, satellite_lon, distance_m)  # checks them
        half = np.tan(np.radians(number("pixels: field_deg", field_deg) / 2))
        right, up = np.meshgrid(*(half * way * (2 * np.arange(size) + 1 - size) / size for way in (1, -1)))
        down, east, north = view._axes()
        direction = down + right[..., None] * east + up[..., None] * north
        scale = np.array([1.0, 1.0, _EQUATOR_M / _POLE_M])  # to where the ellipsoid is a sphere
        eye, way = view._satellite() * scale, direction * scale
        a, b, c = (way**2).sum(-1), way @ eye, float(eye @ eye) - _EQUATOR_M**2
        with np.errstate(invalid="ignore"):
            reach = (-b - np.sqrt(b**2 - a * c)) / a
        x, y, z = np.moveaxis(view._satellite() + reach[..., None] * direction, -1, 0)
        lat = np.degrees(np.arctan2((_EQUATOR_M / _POLE_M) ** 2 * z, np.hypot(x, y)))
        return replace(view, latitude=lat, longitude=np.degrees(np.arctan2(y, x)))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.latitude.shape
        return rows, columns

    def latlon(self) -> tuple[F64, F64]:
        """Geodetic latitude and longitude (ny, nx) of what pixels see at sea level; NaN beside the Earth."""
        return self.latitude, self.longitude

    def view(self, lat: ArrayLike, lon: ArrayLike) -> tuple[F64, F64]:
        """Zenith angle and azimuth (clockwise from north) of the satellite at places on the ellipsoid, degrees."""
        phi, away = np.radians(np.asarray(lat, float)), np.radians(np.asarray(lon, float))
        to = self._toward(phi, away)
        to /= np.linalg.norm(to, axis=-1, keepdims=True)
        outward = to[..., 0] * np.cos(away) + to[..., 1] * np.sin(away)  # from the Earth's axis
        e = to[..., 1] * np.cos(away) - to[..., 0] * np.sin(away)
        n = to[..., 2] * np.cos(phi) - outward * np.sin(phi)
        up = outward * np.cos(phi) + to[..., 2] * np.sin(phi)
        return np.degrees(np.arccos(np.clip(up, -1, 1))), np.degrees(np.arctan2(e, n)) % 360.0

    def reach_m(self, lat: ArrayLike, lon: ArrayLike) -> F64:
        """From places on the ellipsoid to the satellite."""
        to = self._toward(np.radians(np.asarray(lat, float)), np.radians(np.asarray(lon, float)))
        return np.asarray(np.linalg.norm(to, axis=-1))

    def _toward(self, lat_rad: F64, lon_rad: F64) -> F64:
        flat = (_POLE_M / _EQUATOR_M) ** 2
        normal = _EQUATOR_M / np.sqrt(np.cos(lat_rad) ** 2 + flat * np.sin(lat_rad) ** 2)
        out = normal * np.cos(lat_rad)
        place = np.stack([out * np.cos(lon_rad), out * np.sin(lon_rad), flat * normal * np.sin(lat_rad)], axis=-1)
        return np.asarray(self._satellite() - place)

    def _satellite(self) -> F64:
        """Its place (3,), m: toward 0 and 90 degrees east, and north."""
        return -self.distance_m * self._axes()[0]

    def _axes(self) -> F64:
        """Unit vectors (3, 3) from the satellite: to the Earth's centre, east, north."""
        la, lo = np.radians(self.satellite_lat), np.radians(self.satellite_lon)
        down = -np.array([np.cos(la) * np.cos(lo), np.cos(la) * np.sin(lo), np.sin(la)])
        east = np.array([-np.sin(lo), np.cos(lo), 0.0])
        return np.stack([down, east, np.cross(east, down)])
