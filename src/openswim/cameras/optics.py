"""A lens on its mount: from pixel to direction in the horizon frame, and back."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers, shown
from openswim.cameras.lenses import Lens
from openswim.cameras.pixels import Pixels
from openswim.errors import UserError
from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]
_NUMBERS = ("centre_row", "centre_column", "rotation_deg", "tilt_deg", "tilt_azimuth_deg", "fov_deg")
_FARTHEST_PX = 1e6


@dataclass(frozen=True)
class Optics:
    """How a camera with a lens is set up.

    Row 0, column 0 is the centre of the first pixel, on the top left.  With the axis in the zenith and no rotation,
    north is up and east on the left.  `rotation_deg` turns north counter-clockwise in the picture; the axis leans
    `tilt_deg` from the zenith toward `tilt_azimuth_deg`, without a turn of its own (90: it looks along the horizon).
    `mirrored`: left and right changed over about the centre.  `affine` (c, d, e): down and right in the picture become
    c down + d right and e down + right (pixels that are not square, a chip askew).  What is farther from the axis
    than `fov_deg` / 2 is outside.
    """

    lens: Lens
    centre_row: float
    centre_column: float
    rotation_deg: float = 0.0
    tilt_deg: float = 0.0
    tilt_azimuth_deg: float = 0.0
    mirrored: bool = False
    affine: tuple[float, float, float] = (1.0, 0.0, 0.0)
    fov_deg: float = 180.0

    def __post_init__(self) -> None:
        for name in _NUMBERS:
            value = number(f"camera: {name}", getattr(self, name))
            if not math.isfinite(value):
                raise UserError(f"camera: {name} {value} must be a finite number")
            object.__setattr__(self, name, value)
        for name in ("centre_row", "centre_column"):
            if abs(getattr(self, name)) > _FARTHEST_PX:
                raise UserError(f"camera: {name} {getattr(self, name):g} lies more than {_FARTHEST_PX:g} pixels away")
        if not 0 <= self.tilt_deg <= 180:
            raise UserError(f"camera: tilt_deg {self.tilt_deg:g} is not within 0..180")
        if not 0 < self.fov_deg <= 360:
            raise UserError(f"camera: field of view {self.fov_deg:g} degrees is not above 0 and up to 360")
        if not isinstance(self.mirrored, (bool, np.bool_)):
            raise UserError(f"camera: mirrored is {shown(self.mirrored)}: give true or false")
        affine = np.atleast_1d(numbers("camera: affine", self.affine)).astype(float)
        if affine.shape != (3,) or not np.isfinite(affine).all() or not 0.01 < affine[0] - affine[1] * affine[2] < 100:
            raise UserError(f"camera: affine {shown(self.affine)} must be three numbers c, d, e with c - d e positive")
        object.__setattr__(self, "affine", tuple(float(a) for a in affine))

    @classmethod
    def pointing(
        cls, lens: Lens, centre: tuple[float, float], azimuth_deg: float, altitude_deg: float, roll_deg: float = 0.0,
        **options: object,
    ) -> "Optics":
        """By where the axis points; at no roll the sky is up in the picture, `roll_deg` turns the camera clockwise."""
        upright = cls(lens, *centre, tilt_deg=90.0 - altitude_deg, tilt_azimuth_deg=azimuth_deg)
        top = horizon_vector(azimuth_deg, altitude_deg + 90.0) @ upright._leaning()  # as it was before the tilt
        azimuth = np.degrees(np.arctan2(top[0], top[1]))
        return replace(upright, rotation_deg=float(roll_deg - azimuth), **options)  # type: ignore[arg-type]

    def axes(self) -> F64:
        """Rows right, up, forward of the camera in the horizon frame (east, north, up)."""
        north = -math.radians(self.rotation_deg)
        c, s = math.cos(north), math.sin(north)
        return np.array([[-c, s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ self._leaning().T

    def _leaning(self) -> F64:
        """Matrix that leans the zenith onto the axis: a turn about the horizontal across `tilt_azimuth_deg`."""
        tilt, toward = math.radians(self.tilt_deg), math.radians(self.tilt_azimuth_deg)
        c, s, east, north = math.cos(tilt), math.sin(tilt), math.sin(toward), math.cos(toward)
        return np.array([
            [north * north + c * east * east, (c - 1) * east * north, s * east],
            [(c - 1) * east * north, east * east + c * north * north, s * north],
            [-s * east, -s * north, c],
        ])  # fmt: skip

    def project(self, direction: ArrayLike) -> tuple[F64, F64]:
        """Row and column, fractional, of directions (..., 3) in the horizon frame; NaN where they are not seen."""
        d = np.asarray(direction, float) @ self.axes().T
        x, y = self.lens.project(d)
        # the sine where the angle is near a right one, whose cosine would round
        angle = np.arctan2(np.hypot(d[..., 0], d[..., 1]), d[..., 2])
        outside = angle > np.radians(self.fov_deg) / 2 * (1 + 1e-12)
        x, y = np.where(outside, np.nan, -x if self.mirrored else x), np.where(outside, np.nan, y)
        c, s, e = self.affine
        return self.centre_row - c * y + s * x, self.centre_column - e * y + x

    def direction(self, row: ArrayLike, column: ArrayLike) -> F64:
        """Unit vectors (..., 3) in the horizon frame; NaN outside of the lens."""
        x, y = self._plane(row, column)
        local = self.lens.direction(x, y)
        outside = local[..., 2] < np.cos(np.radians(min(self.fov_deg / 2, 180.0))) - 1e-12
        return np.where(outside[..., None], np.nan, local @ self.axes())

    def pixels(self, shape: tuple[int, int]) -> Pixels:
        """All pixels of a frame of (rows, columns)."""
        row, column = np.indices(shape, dtype=float)
        direction = self.direction(row, column)
        c, s, e = self.affine
        solid_angle = self.lens.solid_angle_sr(*self._plane(row, column)) / (c - s * e)
        return Pixels(direction, np.where(np.isnan(direction[..., 0]), np.nan, solid_angle))

    def draws_in(self, shape: tuple[int, int]) -> bool:
        """Whether light arrives on any pixel of a frame of (rows, columns)."""
        nearest = [np.clip(round(centre), 0, count - 1) for centre, count in
                   zip((self.centre_row, self.centre_column), shape, strict=True)]  # fmt: skip
        return bool(np.isfinite(self.direction(*nearest)).all()) or bool(self.pixels(shape).inside.any())

    def _plane(self, row: ArrayLike, column: ArrayLike) -> tuple[F64, F64]:
        """x and y before the lens."""
        down, right = np.asarray(row, float) - self.centre_row, np.asarray(column, float) - self.centre_column
        c, s, e = self.affine
        x, below = (c * right - e * down) / (c - s * e), (down - s * right) / (c - s * e)
        return -x if self.mirrored else x, -below

    def scaled(self, factor: float) -> "Optics":
        """For a frame with pixels `factor` times as fine."""
        centre = [(place + 0.5) * factor - 0.5 for place in (self.centre_row, self.centre_column)]
        return replace(self, lens=self.lens.scaled(factor), centre_row=centre[0], centre_column=centre[1])
