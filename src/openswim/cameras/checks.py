"""What a camera can be asked for."""

from typing import Any

import numpy as np

from openswim.arguments import check_choice, numbers, shown
from openswim.cameras.lenses import LARGEST_PX
from openswim.errors import UserError

MAX_HEIGHT_M = 2.0e9
LOWEST_ABOVE_SEA_M = -500.0
ABOVE = ("ground", "sea level")
MAX_SIZE = 20_000
MOST_TURNED_DEG = 1e6  # logs of yaw may go round and round; of larger numbers nothing is left below a degree
WIDEST_FOV_DEG = {
    "allsky": 360.0, "panorama": 360.0, "perspective": 175.0, "fisheye": 360.0, "pinhole": 360.0, "map": 360.0,
    "rays": 360.0,
}  # fmt: skip


def require(condition: bool, message: str) -> None:
    """Raise UserError with the message unless the condition holds."""
    if not condition:
        raise UserError(message)


def check_place(lat: float | None, lon: float | None, x_m: float | None, y_m: float | None) -> None:
    """Latitude and longitude, or x and y."""
    flat = x_m is not None and y_m is not None
    require((lat is not None and lon is not None) != flat,
            "camera: give either lat and lon (degrees) or x_m and y_m (flat scenes)")  # fmt: skip
    if lat is not None and lon is not None:
        require(-90 <= lat <= 90, f"camera latitude {lat} is not within -90..90")
        require(-360 <= lon <= 360, f"camera longitude {lon} is not within -360..360")
    if x_m is not None and y_m is not None:
        require(bool(np.isfinite([x_m, y_m]).all()), "camera x_m and y_m must be finite metres")


def check_height(height_m: float, above: Any) -> None:
    """The camera's height, and what it counts from."""
    check_choice("camera height above", above, ABOVE)
    lowest = LOWEST_ABOVE_SEA_M if above == "sea level" else 0.0
    require(
        lowest <= height_m <= MAX_HEIGHT_M,
        f"camera height {height_m} m above {above} is not in {lowest:g}..{MAX_HEIGHT_M:g} m",
    )


def check_shape(shape: tuple[Any, ...]) -> None:
    """Image size: rows and columns."""
    whole = len(shape) == 2 and all(isinstance(n, (int, np.integer)) and not isinstance(n, bool) for n in shape)
    require(
        whole and all(1 <= n <= MAX_SIZE for n in shape),
        f"image size {shown(shape)} must be columns, or (rows, columns): whole numbers of pixels from 1 to {MAX_SIZE}",
    )


def check_view(view: Any, fov_deg: float, lens: bool = False, listed: bool = False) -> None:
    """The projection, whether it has a lens or a list of directions, and its field of view."""
    check_choice("camera view", view, tuple(WIDEST_FOV_DEG))
    require((view in ("fisheye", "pinhole")) == lens, f"view {view}: use Camera.fisheye or Camera.pinhole")
    require((view in ("map", "rays")) == listed, f"view {view}: use Camera.from_map or Camera.from_rays")
    widest = WIDEST_FOV_DEG[view]
    require(
        0 < fov_deg <= widest,
        f"field of view {fov_deg} degrees is not above 0 and up to {widest:g} for view {view}",
    )


def check_finest(fov_deg: float, columns: int) -> None:
    """The field of view, of a picture so wide that no lens could draw it."""
    finest = float(np.degrees(columns / LARGEST_PX))
    require(fov_deg >= finest, f"field of view {fov_deg} degrees is too narrow for {columns} columns: "
                               f"give {finest:.2g} or more, or fewer columns")  # fmt: skip


def check_pointing(azimuth_deg: float, altitude_deg: float, roll_deg: float) -> None:
    """Where the camera looks."""
    require(-90 <= altitude_deg <= 90, f"altitude {altitude_deg} is not within -90..90 degrees")
    pointing = [azimuth_deg, roll_deg]
    fine = bool((np.abs(pointing) <= MOST_TURNED_DEG).all())
    require(fine, f"camera azimuth and roll {pointing} must be finite degrees, up to {MOST_TURNED_DEG:g} either way")


def check_altitude_range(given: Any) -> tuple[float, float]:
    """(bottom, top) in degrees."""
    pair = numbers("altitude range", given)
    require(pair.shape == (2,), f"altitude range {shown(given)} must be two numbers of degrees: bottom and top")
    bottom, top = (float(each) for each in pair)
    require(-90 <= bottom < top <= 90, f"altitude range {bottom}..{top} must ascend within -90..90 degrees")
    return bottom, top
