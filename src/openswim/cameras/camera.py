"""Cameras on the ground, in the air and in space."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from openswim.arguments import check_kind, number, numbers, shown, takes
from openswim.cameras import panorama
from openswim.cameras.checks import (
    check_altitude_range,
    check_finest,
    check_height,
    check_place,
    check_pointing,
    check_shape,
    check_view,
    require,
)
from openswim.cameras.given import Given
from openswim.cameras.lenses import Lens
from openswim.cameras.obstacles import Mask, checked_horizon, open_sky
from openswim.cameras.optics import Optics
from openswim.cameras.pixels import Pixels
from openswim.cameras.real import RealCameras
from openswim.cameras.sizes import Size, rows_of, shape_of, whole_disc_fov_deg
from openswim.errors import UserError
from openswim.scene.frame import horizon_vector
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.rays import Rays

GEOSTATIONARY_HEIGHT_M = 35_786_000.0
FLAT_NEEDS_XY = "camera: this scene is flat: give x_m and y_m in metres (--x, --y) in place of lat and lon"
CURVED_NEEDS_LATLON = "camera: this scene is on the curved Earth: give lat and lon in degrees (--lat, --lon)"
View = Literal["allsky", "panorama", "perspective", "fisheye", "pinhole", "map", "rays"]
_PLACE = ("lat", "lon", "x_m", "y_m")
EYE_ABOVE_GROUND_M = 0.01  # at least
_NUMBERS = ("height_m", "azimuth_deg", "altitude_deg", "fov_deg", "roll_deg")

_KINDS = (
    ("lens_optics", Optics, "use Camera.fisheye or Camera.pinhole"),
    ("given", Given, "use Camera.from_map or Camera.from_rays"),
    ("mask", Mask, "give an openswim.cameras.obstacles.Mask"),
)


@dataclass(frozen=True)
class Camera(RealCameras):
    """Where the camera stands and how its pixels look out.

    Place: `lat`, `lon` in degrees on a curved Earth, or `x_m`, `y_m` in a flat scene.  `height_m` counts from
    the ground or from sea level (`above`).  `view` names the projection, whose settings are the remaining
    fields; use the constructors (`allsky`, `panorama`, `sphere`, `perspective`, `satellite`,
    `geostationary`; `fisheye`, `pinhole`, `from_map` and `from_rays` for real cameras), or read a file by
    `openswim.load_camera`.

    Row 0, column 0 is the centre of the first pixel, on the top left.  A `size` is a number of columns, or as on the
    command line "1440x720", columns x rows, or the shape of the image's array, (rows, columns).
    """

    view: View
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
    lens_optics: Optics | None = None  # of fisheye and pinhole
    given: Given | None = field(default=None, repr=False)  # of map and rays
    horizon_deg: tuple[tuple[float, float], ...] = ()  # azimuth, altitude of what hides the sky
    mask: Mask | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        given = [name for name in _PLACE if getattr(self, name) is not None]
        for name in (*given, *_NUMBERS):
            object.__setattr__(self, name, number(f"camera: {name}", getattr(self, name)))
        check_place(self.lat, self.lon, self.x_m, self.y_m)
        check_height(self.height_m, self.above)
        check_kind("camera: shape", self.shape, (tuple, list), "give (rows, columns)")
        for name, kind, remedy in _KINDS:
            check_kind(f"camera: {name}", getattr(self, name), (kind, type(None)), remedy)
        check_shape(self.shape)
        check_view(self.view, self.fov_deg, self.lens_optics is not None, self.given is not None)
        check_altitude_range(self.altitude_range_deg)
        check_pointing(self.azimuth_deg, self.altitude_deg, self.roll_deg)
        if self.view in ("allsky", "perspective"):
            check_finest(self.fov_deg, self.shape[1])
        object.__setattr__(self, "horizon_deg", checked_horizon(self.horizon_deg))
        if self.lens_optics is not None and not self.lens_optics.draws_in(self.shape):
            raise UserError(
                f"camera: its lens draws nothing on any of {self.shape[1]}x{self.shape[0]} pixels: mend focal_px, "
                "centre or fov_deg"
            )

    @classmethod
    @takes
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
            raise UserError(f"allsky camera: centre {shown(centre)} is unknown; use 'zenith' or 'nadir'")
        altitude = 90.0 if centre == "zenith" else -90.0
        shape = shape_of(size)
        if len(set(shape)) > 1:
            raise UserError(f"allsky camera: size {size} is not square; give one number")
        return cls("allsky", shape, lat, lon, x_m, y_m, height_m, altitude_deg=altitude, fov_deg=fov_deg)

    @classmethod
    @takes
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
        shape = shape_of(size, lambda columns: rows_of(columns, altitude_range_deg))
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
    @takes
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
    @takes
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
        shape = shape_of(size, lambda columns: max(1, round(columns / 1.5)))
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
    @takes
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
        shape = shape_of(size)
        if fov_deg is None:
            fov_deg = whole_disc_fov_deg(height_m, earth_radius_m, shape)
        return cls("perspective", shape, lat, lon, None, None, height_m, "sea level", 0.0, -90.0, fov_deg)

    @classmethod
    @takes
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

    @property
    def optics(self) -> Optics | None:
        """The lens that draws this picture; None of a panorama, a map, and rays."""
        if self.view not in ("allsky", "perspective"):
            return self.lens_optics
        centre = (self.shape[0] - 1) / 2, (self.shape[1] - 1) / 2
        if self.view == "allsky":
            lens = Lens("equidistant", self.shape[1] / np.radians(self.fov_deg))
            if self.altitude_deg > 0:
                return Optics(lens, *centre, fov_deg=self.fov_deg)
            return Optics.pointing(lens, centre, 0.0, -90.0, fov_deg=self.fov_deg)
        lens = Lens("pinhole", self.shape[1] / (2 * np.tan(np.radians(self.fov_deg) / 2)))
        return Optics.pointing(lens, centre, self.azimuth_deg, self.altitude_deg, self.roll_deg)

    def pixels(self) -> Pixels:
        """Direction and solid angle of every pixel in the horizon frame at the camera's place."""
        if self.given is not None:
            return self.given.pixels
        if (optics := self.optics) is not None:
            return optics.pixels(self.shape)
        return panorama.pixels(self.shape, self.azimuth_deg, self.altitude_range_deg)

    def pixel_of(self, azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Row and column, fractional, at which a direction is seen, also beyond the frame; NaN where the lens ends."""
        direction = horizon_vector(*_paired(azimuth_deg=azimuth_deg, altitude_deg=altitude_deg))
        if self.given is not None:
            return self.given.project(direction)
        if (optics := self.optics) is not None:
            return optics.project(direction)
        return panorama.project(direction, self.shape, self.azimuth_deg, self.altitude_range_deg)

    def direction_of(self, row: ArrayLike, column: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Azimuth and altitude (degrees) of places in the picture, which may be fractional; NaN outside."""
        row, column = _paired(row=row, column=column)
        if self.given is not None:
            direction = self.given.direction(row, column)
        elif (optics := self.optics) is not None:
            direction = optics.direction(row, column)
        else:
            direction = panorama.direction(row, column, self.shape, self.azimuth_deg, self.altitude_range_deg)
        at = Pixels(direction, np.empty(direction.shape[:-1]))
        return at.azimuth_deg, at.altitude_deg

    @property
    def nothing_hides(self) -> bool:
        """Neither a horizon line nor a mask is known."""
        return self.mask is None and not self.horizon_deg

    def open_sky(self) -> np.ndarray:
        """(ny, nx) bool: the pixels that look above the camera's horizon line and past its mask."""
        return open_sky(self.pixels(), self.horizon_deg, self.mask)

    def resized(self, size: Size) -> "Camera":
        """The same view in coarser or finer pixels: `size` columns, or (rows, columns) of the same shape."""
        ny, nx = self.shape
        shape = shape_of(size, lambda columns: max(1, round(columns * ny / nx)))
        require(
            abs(shape[0] / ny - shape[1] / nx) <= 1 / ny,
            f"size {shape[1]}x{shape[0]} has not the shape of this camera's {nx}x{ny}; give the columns alone",
        )
        factor = shape[1] / nx
        mask = None
        if self.mask is not None:
            rows, columns = (np.minimum(((np.arange(n) + 0.5) * m / n).astype(int), m - 1)
                             for n, m in zip(shape, self.shape, strict=True))  # fmt: skip
            mask = Mask(self.mask.hidden[np.ix_(rows, columns)], self.mask.source)
        return replace(
            self,
            shape=shape,
            lens_optics=None if self.lens_optics is None else self.lens_optics.scaled(factor),
            given=None if self.given is None else self.given.resized(shape),
            mask=mask,
        )

    @takes
    def rays(self, frame: Any, ground_height_m: float = 0.0, pixels: Pixels | None = None) -> Rays:
        """Rays of the inside pixels, row by row, in the frame of a scene (`openswim.scene.frame.Frame`).

        `ground_height_m`: the ground's height above sea level under the camera.  `Pixels.image` puts what the
        rays bring home back into the picture.
        """
        if not all(hasattr(frame, each) for each in ("curved", "position", "enu")):
            raise UserError(f"camera: frame is {shown(frame)}: give openswim.scene.frame.scene_frame(scene)")
        pixels = self.pixels() if pixels is None else pixels
        north, east = (self.lat, self.lon) if self.x_m is None else (self.y_m, self.x_m)
        self.check_frame(frame.curved)
        origin = frame.position(north, east, self.height_above_sea_m(ground_height_m))
        width = 2 * np.radians(np.broadcast_to(pixels.half_width_deg, pixels.inside.shape)[pixels.inside])
        if self.given is not None and self.given.towards is not None:  # at these places, wherever the ground puts us
            direction = frame.position(*self.given.towards.T) - origin
            return Rays(origin, direction / np.linalg.norm(direction, axis=-1, keepdims=True), width)
        return Rays(origin, pixels.direction[pixels.inside] @ frame.enu(north, east), width)

    @takes
    def check_frame(self, curved: bool) -> None:
        """Raise UserError unless the camera's place is one of a curved, or a flat, scene."""
        require(curved == (self.x_m is None), CURVED_NEEDS_LATLON if curved else FLAT_NEEDS_XY)

    @takes
    def height_above_sea_m(self, ground_height_m: float = 0.0) -> float:
        """Height of the camera above sea level, metres; an eye on the ground lies on it, not in it."""
        height = self.height_m + (ground_height_m if self.above == "ground" else 0.0)
        return max(height, ground_height_m + EYE_ABOVE_GROUND_M) if height >= ground_height_m else height


def _paired(**given: ArrayLike) -> tuple[np.ndarray, ...]:
    """Numbers, each with its partner; UserError where their shapes do not go together."""
    found = [numbers(name, value) for name, value in given.items()]
    try:
        return tuple(np.broadcast_arrays(*found))
    except ValueError:
        told = " and ".join(f"{name} {shown(value)}" for name, value in given.items())
        raise UserError(f"{told}: give one number, or as many of the one as of the other") from None
