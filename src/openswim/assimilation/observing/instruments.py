"""What is observed with: cameras' pixels that tell something, and places of pyranometers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import check_kind, number, shown
from openswim.assimilation.observing.quantities import Quantity
from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.scene.frame import Frame, azimuth_altitude

F64 = NDArray[np.float64]
Bool = NDArray[np.bool_]

NEAR_SUN_DEG = 10.0  # within which a lens has glare
LOWEST_DEG = 5.0  # above the horizon, of pixels that look up


@dataclass(frozen=True, eq=False)
class Instrument:
    """A camera whose pixels are observations.

    sun: (azimuth, altitude), degrees, where it stands. usable (n,): of its pixels inside the image, row by row, those
    that may be used: neither near the sun, nor close to the horizon, nor hidden by the camera's own horizon and mask.
    """

    camera: Camera
    quantity: Quantity
    sun: tuple[float, float]
    near_sun_deg: float = NEAR_SUN_DEG
    lowest_deg: float = LOWEST_DEG

    @cached_property
    def inside(self) -> Bool:
        """(ny, nx)"""
        return self.camera.pixels().inside

    @property
    def rays(self) -> int:
        return int(self.inside.sum())

    @cached_property
    def usable(self) -> Bool:
        pixels = self.camera.pixels()
        altitude = pixels.altitude_deg
        up = self.camera.above == "ground"
        with np.errstate(invalid="ignore"):
            keep = pixels.angle_to_deg(*self.sun) >= self.near_sun_deg
            if up:
                keep &= (altitude >= self.lowest_deg) & self.camera.open_sky()
        return np.asarray(keep[self.inside])

    def image(self, values: F64) -> F64:
        """Values (c, n) of pixels as a picture (ny, nx, c), NaN outside."""
        return self.camera.pixels().image(np.ascontiguousarray(values.T))


def sun_at(frame: Frame, direction: F64, lat: float, lon: float) -> tuple[float, float]:
    """Azimuth and altitude (degrees) of the sun at a place; in flat scenes its y and x."""
    return azimuth_altitude(frame.enu(lat, lon) @ direction)


def checked_cameras(cameras: Any, frame: Frame) -> tuple[Camera, ...]:
    """One camera or several, that stand in the scene; raises UserError."""
    check_kind("cameras", cameras, (Camera, Iterable), "give one, or a list of them")
    listed = [cameras] if isinstance(cameras, Camera) else list(cameras)
    for each in listed:
        check_kind("camera", each, Camera, "give one, such as Camera.allsky(lat, lon)")
        each.check_frame(frame.curved)
    return tuple(listed)


def checked_points(irradiance: Sequence[Any]) -> F64:
    """(n, 2) latitudes and longitudes, in flat scenes y and x in metres; raises UserError."""
    try:
        points = np.asarray(list(irradiance), float).reshape(-1, 2)
    except (TypeError, ValueError):
        raise UserError(f"irradiance = {shown(irradiance)}: give a list of (latitude, longitude)") from None
    if not np.isfinite(points).all():
        raise UserError("irradiance: places must be numbers")
    return points


def checked_angle(what: str, value: float) -> float:
    if not 0 <= number(f"observe: {what}", value) <= 90:
        raise UserError(f"observe: {what} = {value:g} is not within 0 to 90 degrees")
    return float(value)
