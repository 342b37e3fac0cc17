"""The pixels of a camera in its local horizon frame (east, north, up)."""

from dataclasses import dataclass

import numpy as np

from openswim.scene.frame import horizon_vector


@dataclass(frozen=True)
class Pixels:
    """Directions and solid angles of an image (ny, nx), row 0 on top; NaN outside the image.

    `direction` (ny, nx, 3): unit vectors east, north, up at the camera's place.  `solid_angle_sr` (ny, nx).
    """

    direction: np.ndarray
    solid_angle_sr: np.ndarray

    @property
    def inside(self) -> np.ndarray:
        """(ny, nx) bool: the pixel belongs to the image."""
        return np.isfinite(self.solid_angle_sr)

    @property
    def azimuth_deg(self) -> np.ndarray:
        """(ny, nx), from 0 to below 360, clockwise from north."""
        azimuth = np.degrees(np.arctan2(self.direction[..., 0], self.direction[..., 1])) % 360.0
        return np.where(azimuth == 360.0, 0.0, azimuth)  # -1e-15 % 360 is 360

    @property
    def altitude_deg(self) -> np.ndarray:
        """(ny, nx), -90 to 90, above the horizon; float64, so that a distant Earth is resolved."""
        horizontal = np.hypot(self.direction[..., 0], self.direction[..., 1])
        return np.degrees(np.arctan2(self.direction[..., 2], horizontal))

    @property
    def half_width_deg(self) -> np.ndarray:
        """(ny, nx): half the side of a square of the pixel's solid angle."""
        return np.degrees(np.sqrt(self.solid_angle_sr)) / 2

    def angle_to_deg(self, azimuth_deg: float, altitude_deg: float) -> np.ndarray:
        """(ny, nx): angle between the pixel and a direction, exact for small angles too."""
        difference = self.direction - horizon_vector(azimuth_deg, altitude_deg)
        return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(difference, axis=-1) / 2, 0, 1)))

    def image(self, values: np.ndarray) -> np.ndarray:
        """Values (n, ...) of the inside pixels, row by row as in `Camera.rays`, as an image with NaN."""
        inside = self.inside
        result = np.full(inside.shape + values.shape[1:], np.nan, dtype=values.dtype)
        result[inside] = values
        return result
