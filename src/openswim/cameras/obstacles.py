"""What stands in a camera's way: trees and masts, by a horizon line or a picture."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import numbers, shown
from openswim.cameras.pixels import Pixels
from openswim.errors import UserError

_MOST_POINTS = 10_000


@dataclass(frozen=True, eq=False)
class Mask:
    """(ny, nx) of a frame: True where the sky is hidden (a mast, a drop, burnt-in text), and where it came from."""

    hidden: NDArray[np.bool_]
    source: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.hidden, np.ndarray) or self.hidden.dtype != bool or self.hidden.ndim != 2:
            raise UserError(f"mask is {shown(self.hidden)}: give an array (rows, columns) of bool, True where hidden")


def checked_horizon(given: Any) -> tuple[tuple[float, float], ...]:
    """Azimuth and altitude (degrees) of the corners of a horizon, by azimuth."""
    corners = numbers("camera: horizon", given).astype(float)
    if not corners.size:
        return ()
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) > _MOST_POINTS or not np.isfinite(corners).all():
        raise UserError(
            f"camera: horizon must be up to {_MOST_POINTS} pairs [azimuth, altitude] in degrees, got {corners.shape}"
        )
    if np.abs(corners[:, 0]).max() > 360 or np.abs(corners[:, 1]).max() > 90:
        raise UserError("camera: horizon has azimuths beyond -360..360 or altitudes beyond -90..90 degrees")
    corners[:, 0] %= 360
    return tuple((float(a), float(h)) for a, h in corners[np.argsort(corners[:, 0], kind="stable")])


def open_sky(pixels: Pixels, horizon: tuple[tuple[float, float], ...], mask: Mask | None) -> NDArray[np.bool_]:
    """(ny, nx): pixels of the image that look above the horizon and past the mask."""
    clear = pixels.inside.copy()
    if horizon:
        azimuth, altitude = np.array(horizon).T
        clear[clear] = pixels.altitude_deg[clear] > np.interp(pixels.azimuth_deg[clear], azimuth, altitude, period=360)
    if mask is not None:
        if mask.hidden.shape != clear.shape:
            raise UserError(
                f"camera: the mask is {mask.hidden.shape[1]}x{mask.hidden.shape[0]} pixels, "
                f"the frame {clear.shape[1]}x{clear.shape[0]}"
            )
        clear &= ~mask.hidden
    return clear
