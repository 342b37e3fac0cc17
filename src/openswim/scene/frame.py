"""The Cartesian frame in which light travels straight.

Origin: the sea-level point below the centre of the domain; x east, y north, z up there. Curved scenes
stand on a sphere; flat ones on a sphere so large that its sagitta over 100 km is 5 mm, so that no code
downstream needs to know the difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.scene.grid import EARTH_RADIUS_M

if TYPE_CHECKING:
    from openswim.scene.scene import Scene

FLAT_RADIUS_M = 1.0e12

Array = NDArray[np.float64]


def horizon_dip_deg(height_m: float) -> float:
    """How far below level the edge of a bare Earth lies for an eye so high above it (0 where it is lower)."""
    return float(np.degrees(np.arccos(EARTH_RADIUS_M / (EARTH_RADIUS_M + max(height_m, 0.0)))))


def horizon_vector(azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> Array:
    """Unit vectors (..., 3) east, north, up; azimuth clockwise from north."""
    azimuth, altitude = np.radians(np.asarray(azimuth_deg, float)), np.radians(np.asarray(altitude_deg, float))
    east, north = np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth)
    return np.stack(np.broadcast_arrays(east, north, np.sin(altitude)), axis=-1)


def _enu(lat_deg: float, lon_deg: float) -> Array:
    """Rows east, north, up in Earth-centred axes."""
    lat, lon = np.radians([lat_deg, lon_deg])
    return np.array(
        [
            [-np.sin(lon), np.cos(lon), 0.0],
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
        ]
    )


@dataclass(frozen=True)
class Frame:
    """Scene frame: ``radius_m`` of the Earth, and the latitude and longitude (degrees) of its origin.

    In flat scenes (``curved`` false) the "latitude" and "longitude" are y and x in metres.
    """

    radius_m: float
    lat: float
    lon: float
    curved: bool = True

    @property
    def _axes(self) -> Array:
        return _enu(self.lat, self.lon)

    def position(self, lat: ArrayLike, lon: ArrayLike, height_m: ArrayLike) -> Array:
        """Frame coordinates (..., 3) in metres of a place ``height_m`` above sea level."""
        lat_, lon_, height = np.broadcast_arrays(
            np.asarray(lat, float), np.asarray(lon, float), np.asarray(height_m, float)
        )
        if not self.curved:
            return np.stack([lon_ - self.lon, lat_ - self.lat, height], axis=-1)
        la, lo = np.radians(lat_), np.radians(lon_)
        up = np.stack([np.cos(la) * np.cos(lo), np.cos(la) * np.sin(lo), np.sin(la)], axis=-1) @ self._axes.T
        place = up * (self.radius_m + height)[..., None]
        place[..., 2] -= self.radius_m
        return place

    def latlon(self, position: ArrayLike) -> tuple[Array, Array, Array]:
        """Latitude, longitude (degrees) and height above sea level (m) of frame coordinates (..., 3)."""
        p = np.asarray(position, float)
        if not self.curved:
            return p[..., 1] + self.lat, p[..., 0] + self.lon, p[..., 2]
        x, y, z = p[..., 0], p[..., 1], p[..., 2] + self.radius_m
        r = np.sqrt(x * x + y * y + z * z)
        # component by component: rows of three are slow to go through
        ex, ey, ez = (x * a + y * b + z * c for a, b, c in self._axes.T)
        return np.degrees(np.arcsin(np.clip(ez / r, -1, 1))), np.degrees(np.arctan2(ey, ex)), r - self.radius_m

    def enu(self, lat: float, lon: float) -> Array:
        """Rows east, north, up (unit vectors in the frame) at a place."""
        if not self.curved:
            return np.eye(3)
        return _enu(lat, lon) @ self._axes.T

    def earth_centred(self, direction: Array) -> Array:
        """Vectors (..., 3) of the frame in Earth-centred axes: to 0 E on the equator, to 90 E, to the north pole."""
        return direction @ self._axes

    def direction(self, azimuth_deg: ArrayLike, altitude_deg: ArrayLike, lat: float, lon: float) -> Array:
        """Unit vectors (..., 3) of an azimuth (clockwise from north) and altitude seen from a place."""
        return horizon_vector(azimuth_deg, altitude_deg) @ self.enu(lat, lon)


def azimuth_altitude(toward: ArrayLike) -> tuple[float, float]:
    """Degrees, of a unit vector (3,) to east, north and up."""
    east, north, up = np.asarray(toward, float)
    return float(np.degrees(np.arctan2(east, north)) % 360), float(np.degrees(np.arcsin(np.clip(up, -1, 1))))


def scene_frame(scene: Scene) -> Frame:
    """The frame of a scene: at the centre of its grid, or at the place of a clear-sky scene."""
    grid = scene.grid
    if grid is None:
        lat, lon = scene.place
        return Frame(scene.earth_radius_m, lat, lon)
    if not grid.curved:
        return Frame(FLAT_RADIUS_M, 0.0, 0.0, curved=False)
    _, ny, nx = grid.shape
    centre_lon, centre_lat = grid.lonlat((nx - 1) / 2, (ny - 1) / 2)
    return Frame(grid.earth_radius_m, float(centre_lat), float(centre_lon))
