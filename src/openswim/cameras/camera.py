"""Cameras on the ground, in the air and in space."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from openswim.arguments import number
from openswim.cameras import projections
from openswim.cameras.checks import (
    check_altitude_range,
    check_height,
    check_place,
    check_pointing,
    check_shape,
    check_view,
    require,
)
from openswim.cameras.pixels import Pixels
from openswim.errors import UserError
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.rays import Rays

Size = int | Sequence[int]  # columns, or (rows, columns)
GEOSTATIONARY_HEIGHT_M = 35_786_000.0
FLAT_NEEDS_XY = "camera: this scene is flat: give x_m and y_m in metres (--x, --y) in place of lat and lon"
CURVED_NEEDS_LATLON = "camera: this scene is on the curved Earth: give lat and lon in degrees (--lat, --lon)"
_PLACE = ("lat", "lon", "x_m", "y_m")
_NUMBERS = ("height_m", "azimuth_deg", "altitude_deg", "fov_deg", "roll_deg")
WIDEST_SATELLITE_FOV_DEG = 140.0  # below about 300 km the whole Earth no longer fits a flat picture


@dataclass(frozen=True)
class Camera:
    """Where the camera stands and how its pixels look out.

    Place: `lat`, `lon` in degrees on a curved Earth, or `x_m`, `y_m` in a flat scene.  `height_m` counts from
    the ground or from sea level (`above`).  `view` names the projection, whose settings are the remaining
    fields; use the constructors (`allsky`, `panorama`, `sphere`, `perspective`, `satellite`,
    `geostationary`).
    """

    view: Literal["allsky", "panorama", "perspective"]
    shape: tuple[int, int]  # rows, columns
    lat: float | None = None
    lon: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    height_m: float = 2.0
    above: Literal["ground", "sea level"] = "ground"
    azimuth_deg: float = 180.0  # of the image's centre
    altitude_deg: float = 0.0
    fov_deg: float = 180.0
    roll_deg: float = 0.0
    altitude_range_deg: tuple[float, float] = (-90.0, 90.0)

    def __post_init__(self) -> None:
        given = [name for name in _PLACE if getattr(self, name) is not None]
        for name in (*given, *_NUMBERS):
            object.__setattr__(self, name, number(f"camera: {name}", getattr(self, name)))
        check_place(self.lat, self.lon, self.x_m, self.y_m)
        check_height(self.height_m, self.above)
        check_shape(self.shape)
        check_view(self.view, self.fov_deg)
        check_altitude_range(self.altitude_range_deg)
        check_pointing(self.azimuth_deg, self.altitude_deg, self.roll_deg)

    @classmethod
    def allsky(
        cls,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        size: Size = 800,
        centre: Literal["zenith", "nadir"] = "zenith",
        fov_deg: float = 180.0,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> "Camera":
        """Polar equidistant disc of `size` pixels across (one number, or twice the same), north up.

        Centred on the zenith, east is on the LEFT, as in every photograph of the sky taken with north on top;
        centred on the nadir, east is on the right, as on a map.
        """
        if centre not in ("zenith", "nadir"):
            raise UserError(f"allsky camera: centre {centre!r} is unknown; use 'zenith' or 'nadir'")
        altitude = 90.0 if centre == "zenith" else -90.0
        shape = _shape(size)
        if len(set(shape)) > 1:
            raise UserError(f"allsky camera: size {size} is not square; give one number")
        return cls("allsky", shape, lat, lon, x_m, y_m, height_m, altitude_deg=altitude, fov_deg=fov_deg)

    @classmethod
    def panorama(
        cls,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        size: Size = 1440,
        altitude_range_deg: tuple[float, float] = (-30.0, 90.0),
        azimuth_deg: float = 180.0,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> "Camera":
        """360 degrees on an equidistant cylinder, `azimuth_deg` in the middle (south: north is at both ends).

        `size`: (rows, columns), or columns, the rows then following from square pixels at the horizon.
        """
        shape = _shape(size, lambda columns: _rows(columns, altitude_range_deg))
        return cls(
            "panorama",
            shape,
            lat,
            lon,
            x_m,
            y_m,
            height_m,
            azimuth_deg=azimuth_deg,
            altitude_range_deg=altitude_range_deg,
        )

    @classmethod
    def sphere(
        cls,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        size: Size = 1440,
        azimuth_deg: float = 180.0,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> "Camera":
        """A panorama from nadir to zenith: every direction there is."""
        return cls.panorama(lat, lon, height_m, size, (-90.0, 90.0), azimuth_deg, x_m=x_m, y_m=y_m)

    @classmethod
    def perspective(
        cls,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        azimuth_deg: float = 180.0,
        altitude_deg: float = 10.0,
        fov_deg: float = 60.0,
        size: Size = (600, 900),
        roll_deg: float = 0.0,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> "Camera":
        """A photographer's camera; `fov_deg` spans the width, `roll_deg` turns the camera clockwise.

        `size`: (rows, columns), or columns of a picture 3 : 2.
        """
        shape = _shape(size, lambda columns: max(1, round(columns / 1.5)))
        return cls(
            "perspective",
            shape,
            lat,
            lon,
            x_m,
            y_m,
            height_m,
            "ground",
            azimuth_deg,
            altitude_deg,
            fov_deg,
            roll_deg,
        )

    @classmethod
    def satellite(
        cls,
        lat: float,
        lon: float,
        height_m: float = 8.0e5,
        fov_deg: float | None = None,
        size: Size = 800,
        earth_radius_m: float = EARTH_RADIUS_M,
    ) -> "Camera":
        """Looking straight down from `height_m` above sea level (up to 2e9 m), north up.

        Without `fov_deg` the whole disc of the Earth fits with a margin of 3 % (at most 140 degrees wide).
        """
        shape = _shape(size)
        if fov_deg is None:
            fov_deg = _whole_disc_fov(height_m, earth_radius_m, shape)
        return cls("perspective", shape, lat, lon, None, None, height_m, "sea level", 0.0, -90.0, fov_deg)

    @classmethod
    def geostationary(
        cls, lon: float, fov_deg: float | None = None, size: Size = 800, lat: float = 0.0
    ) -> "Camera":
        """A satellite over the equator at 35,786 km."""
        return cls.satellite(lat, lon, GEOSTATIONARY_HEIGHT_M, fov_deg, size)

    @property
    def name(self) -> str:
        """The view by the constructor that makes it: a panorama may be a sphere, a perspective a satellite's."""
        if self.view == "panorama" and tuple(self.altitude_range_deg) == (-90.0, 90.0):
            return "sphere"
        return "satellite" if self.view == "perspective" and self.above == "sea level" else self.view

    def pixels(self) -> Pixels:
        """Direction and solid angle of every pixel in the horizon frame at the camera's place."""
        if self.view == "allsky":
            return projections.polar(self.shape[0], self.fov_deg, zenith=self.altitude_deg > 0)
        if self.view == "panorama":
            return projections.cylinder(self.shape, self.azimuth_deg, self.altitude_range_deg)
        return projections.pinhole(
            self.shape, self.azimuth_deg, self.altitude_deg, self.fov_deg, self.roll_deg
        )

    def rays(self, frame: Any, ground_height_m: float = 0.0, pixels: Pixels | None = None) -> Rays:
        """Rays of the inside pixels, row by row, in the frame of a scene (`openswim.scene.frame.Frame`).

        `ground_height_m`: the ground's height above sea level under the camera.  `Pixels.image` puts what the
        rays bring home back into the picture.
        """
        pixels = self.pixels() if pixels is None else pixels
        north, east = (self.lat, self.lon) if self.x_m is None else (self.y_m, self.x_m)
        self.check_frame(frame.curved)
        origin = frame.position(north, east, self.height_above_sea_m(ground_height_m))
        width = 2 * np.radians(np.broadcast_to(pixels.half_width_deg, pixels.inside.shape)[pixels.inside])
        return Rays(origin, pixels.direction[pixels.inside] @ frame.enu(north, east), width)

    def check_frame(self, curved: bool) -> None:
        """Raise UserError unless the camera's place is one of a curved, or a flat, scene."""
        require(curved == (self.x_m is None), CURVED_NEEDS_LATLON if curved else FLAT_NEEDS_XY)

    def height_above_sea_m(self, ground_height_m: float = 0.0) -> float:
        """Height of the camera above sea level, metres."""
        return self.height_m + (ground_height_m if self.above == "ground" else 0.0)


def _shape(size: Size, rows: Callable[[int], int] = int) -> tuple[int, int]:
    """(rows, columns) of a size; `rows` of so many columns where these alone are given."""
    alone = isinstance(size, (int, np.integer))
    shape: Any = tuple(size) if isinstance(size, Iterable) else (rows(int(size)) if alone else size, size)
    check_shape(shape)
    return int(shape[0]), int(shape[1])


def _rows(columns: int, altitude_range_deg: tuple[float, float]) -> int:
    bottom, top = check_altitude_range(altitude_range_deg)
    return max(1, round(columns * (top - bottom) / 360))


def _whole_disc_fov(height_m: float, earth_radius_m: float, shape: tuple[int, int]) -> float:
    """Width in degrees of a pinhole view in which the Earth's disc fills 97 % of the shorter side."""
    height_m, earth_radius_m = number("satellite height", height_m), number("earth_radius_m", earth_radius_m)
    require(height_m > 0, f"satellite height {height_m:g} m is not above sea level")
    tangent = earth_radius_m / np.sqrt((earth_radius_m + height_m) ** 2 - earth_radius_m**2)
    widest = np.tan(np.radians(WIDEST_SATELLITE_FOV_DEG) / 2)
    return float(2 * np.degrees(np.arctan(min(tangent / 0.97 * shape[1] / min(shape), widest))))
