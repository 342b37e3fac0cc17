"""From pixel to direction: the projections.  Each returns `Pixels` for an image of ny rows and nx columns."""

import numpy as np

from openswim.cameras.pixels import Pixels
from openswim.scene.frame import horizon_vector


def polar(size: int, fov_deg: float, zenith: bool) -> Pixels:
    """Polar equidistant: the angle from the centre grows with the radius, north is up.

    Looking up (`zenith`), east is on the left, as in a photograph of the sky with north on top; looking down
    it is on the right.  Pixels beyond fov / 2 from the centre are outside.
    """
    centred = np.arange(size) - (size - 1) / 2
    x, y = np.meshgrid(centred, -centred)
    step = np.radians(fov_deg) / size
    angle = np.hypot(x, y) * step
    solid_angle = step**2 * np.sinc(angle / np.pi)  # sin(angle) / angle
    horizontal = step * np.sinc(angle / np.pi)
    up = np.cos(angle) if zenith else -np.cos(angle)
    direction = np.stack([horizontal * (-x if zenith else x), horizontal * y, up], axis=-1)
    outside = angle > np.radians(fov_deg) / 2
    solid_angle[outside], direction[outside] = np.nan, np.nan
    return Pixels(direction, solid_angle)


def cylinder(shape: tuple[int, int], azimuth_deg: float, altitude_range_deg: tuple[float, float]) -> Pixels:
    """Equidistant cylinder: 360 degrees of azimuth about `azimuth_deg`, clockwise from left to right.

    Azimuths are those of the pixels' centres, so the right edge meets the left without a seam.
    """
    ny, nx = shape
    bottom, top = altitude_range_deg
    azimuth = azimuth_deg + ((np.arange(nx) + 0.5) / nx - 0.5) * 360
    edges = np.linspace(top, bottom, ny + 1)
    direction = horizon_vector(azimuth[None, :], ((edges[1:] + edges[:-1]) / 2)[:, None])
    row = -np.diff(np.sin(np.radians(edges))) * 2 * np.pi / nx
    return Pixels(direction, np.repeat(row[:, None], nx, axis=1))


def pinhole(
    shape: tuple[int, int], azimuth_deg: float, altitude_deg: float, fov_deg: float, roll_deg: float = 0.0
) -> Pixels:
    """Perspective: straight lines stay straight; `fov_deg` spans the width; the camera rolls clockwise."""
    ny, nx = shape
    step = 2 * np.tan(np.radians(fov_deg) / 2) / nx
    x, y = np.meshgrid((np.arange(nx) - (nx - 1) / 2) * step, ((ny - 1) / 2 - np.arange(ny)) * step)
    forward = horizon_vector(azimuth_deg, altitude_deg)
    right = horizon_vector(azimuth_deg + 90, 0.0)
    up = np.cross(right, forward)
    cosine, sine = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    right, up = cosine * right - sine * up, cosine * up + sine * right
    direction = forward + x[..., None] * right + y[..., None] * up
    length = np.sqrt(1 + x**2 + y**2)
    return Pixels(direction / length[..., None], step**2 / length**3)
