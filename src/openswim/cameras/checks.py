"""What a camera can be asked for."""

from typing import TYPE_CHECKING, Any

import numpy as np

from openswim.arguments import number, numbers, shown
from openswim.errors import UserError

if TYPE_CHECKING:
    from openswim.cameras.camera import Camera

MAX_HEIGHT_M = 2.0e9
LOWEST_ABOVE_SEA_M = -500.0
ABOVE = ("ground", "sea level")
_PLACE = ("lat", "lon", "x_m", "y_m")
_NUMBERS = ("height_m", "azimuth_deg", "altitude_deg", "fov_deg", "roll_deg")
MAX_SIZE = 20_000
WIDEST_FOV_DEG = {
    "allsky": 360.0, "panorama": 360.0, "perspective": 175.0, "fisheye": 360.0, "pinhole": 360.0, "map": 360.0,
    "rays": 360.0,
}  # fmt: skip


def require(condition: bool, message: str) -> None:
    """Raise UserError with the message unless the condition holds."""
    if not condition:
        raise UserError(message)


def make_numbers(camera: "Camera") -> None:
    """Make floats of what must be numbers."""
    given = [name for name in _PLACE if getattr(camera, name) is not None]
    for name in (*given, *_NUMBERS):
        object.__setattr__(camera, name, number(f"camera: {name}", getattr(camera, name)))


def check_place(camera: "Camera") -> None:
    """Latitude and longitude, or x and y, and the height."""
    geographic = camera.lat is not None and camera.lon is not None
    flat = camera.x_m is not None and camera.y_m is not None
    require(geographic != flat, "camera: give either lat and lon (degrees) or x_m and y_m (flat scenes)")
    if camera.lat is not None and camera.lon is not None:
        require(-90 <= camera.lat <= 90, f"camera latitude {camera.lat} is not within -90..90")
        require(-360 <= camera.lon <= 360, f"camera longitude {camera.lon} is not within -360..360")
    if camera.x_m is not None and camera.y_m is not None:
        require(bool(np.isfinite([camera.x_m, camera.y_m]).all()), "camera x_m and y_m must be finite metres")
    require(camera.above in ABOVE, f"camera height above {shown(camera.above)}: give one of {', '.join(ABOVE)}")
    lowest = LOWEST_ABOVE_SEA_M if camera.above == "sea level" else 0.0
    require(
        lowest <= camera.height_m <= MAX_HEIGHT_M,
        f"camera height {camera.height_m} m above {camera.above} is not in {lowest:g}..{MAX_HEIGHT_M:g} m",
    )


def check_shape(shape: tuple[Any, ...]) -> None:
    """Image size: rows and columns."""
    whole = len(shape) == 2 and all(isinstance(n, (int, np.integer)) for n in shape)
    require(
        whole and all(1 <= n <= MAX_SIZE for n in shape),
        f"image size {shape} must be columns, or (rows, columns): whole numbers of pixels from 1 to {MAX_SIZE}",
    )


def check_view(camera: "Camera") -> None:
    """Image size, field of view and pointing."""
    check_shape(camera.shape)
    views = ", ".join(WIDEST_FOV_DEG)
    require(camera.view in tuple(WIDEST_FOV_DEG), f"camera view {shown(camera.view)} is unknown: choose one of {views}")
    lens = camera.view in ("fisheye", "pinhole")
    require(lens == (camera.lens_optics is not None), f"view {camera.view}: use Camera.fisheye or Camera.pinhole")
    listed = camera.view in ("map", "rays")
    require(listed == (camera.given is not None), f"view {camera.view}: use Camera.from_map or Camera.from_rays")
    widest = WIDEST_FOV_DEG[camera.view]
    require(
        0 < camera.fov_deg <= widest,
        f"field of view {camera.fov_deg} degrees is not above 0 and up to {widest:g} for view {camera.view}",
    )
    check_altitude_range(camera.altitude_range_deg)
    require(
        -90 <= camera.altitude_deg <= 90,
        f"altitude {camera.altitude_deg} is not within -90..90 degrees",
    )
    pointing = [camera.azimuth_deg, camera.roll_deg]
    require(bool(np.isfinite(pointing).all()), f"camera azimuth and roll {pointing} must be finite degrees")


def check_altitude_range(given: Any) -> tuple[float, float]:
    """(bottom, top) in degrees."""
    pair = numbers("altitude range", given)
    require(pair.shape == (2,), f"altitude range {shown(given)} must be two numbers of degrees: bottom and top")
    bottom, top = (float(each) for each in pair)
    require(-90 <= bottom < top <= 90, f"altitude range {bottom}..{top} must ascend within -90..90 degrees")
    return bottom, top
