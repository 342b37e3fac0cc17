"""Where the sun, or a bright moon, is in a frame: the middle of the round spot in which every channel is full."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.observations.frames import SkyFrame
from openswim.scene.frame import horizon_vector

OVEREXPOSED = 0.25  # share of a frame that is full; of made-up ones .16 gave a camera, of real ones .03, and .37 none
SMALLEST = 0.008  # radius of the spot over half of the frame's shorter side; a cloud's brightest part is smaller
_OPENED = 0.6  # what is narrower than so much of the spot is a ray or a lit cloud beside it
_ROUND = 0.35  # share of the spot that must be left then
_UP_DEG = 3.0  # lower suns are cut by the horizon
_NEAR_DEG = 4.0  # of the sun's place, within which a full pixel may be the sun's


@dataclass(frozen=True)
class Spot:
    """Row and column of the middle, and the radius of a disc of the same area, pixels."""

    row: float
    column: float
    radius_px: float


def find_spot(frame: SkyFrame, hidden: NDArray[np.bool_] | None = None) -> Spot | None:
    """The largest round spot in which all channels are saturated; None where there is none.

    Spots are lopsided where cloud or trees cut them, and have rays: the middle is that of what is left after opening
    (eroding, and growing again) by .6 of the spot's radius; on real frames 2 pixels (.2 degrees) from where people
    put it, the middle of the whole 3, and up to 16.
    """
    from scipy import ndimage

    full = _full(frame, hidden)
    labels, count = ndimage.label(full)
    if not count:
        return None
    sizes = np.bincount(labels.ravel())[1:]
    largest = int(np.argmax(sizes))
    window = ndimage.find_objects(labels)[largest]
    spot = np.pad(ndimage.binary_fill_holes(labels[window] == largest + 1), 1)
    radius = float(np.sqrt(spot.sum() / np.pi))
    if radius < SMALLEST * min(frame.shape) / 2:
        return None
    inner = ndimage.distance_transform_edt(spot) > _OPENED * radius  # eroded by a disc
    if not inner.any():
        return None
    opened = ndimage.distance_transform_edt(~inner) <= _OPENED * radius
    if opened.sum() < _ROUND * spot.sum():
        return None
    row, column = ndimage.center_of_mass(opened)
    return Spot(window[0].start - 1 + row, window[1].start - 1 + column, radius)


def full_share(frame: SkyFrame, hidden: NDArray[np.bool_] | None = None) -> float:
    """Share of a frame in which all channels are saturated."""
    return float(_full(frame, hidden).mean())


def _full(frame: SkyFrame, hidden: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    darkest = frame.counts if frame.counts.ndim == 2 else frame.counts.min(axis=-1)
    full = darkest >= frame.saturated
    return np.asarray(full if hidden is None else full & ~hidden)


def stray_deg(frame: SkyFrame, camera: Camera, azimuth_deg: float, altitude_deg: float) -> float:
    """How far the spot of a frame lies from where its camera has the sun, if nothing is full there; 0 where something
    is, NaN where there is no spot, the sun is low or hidden, or it is outside the picture."""
    row, column = (float(at) for at in camera.pixel_of(azimuth_deg, altitude_deg))
    inside = all(0 <= at <= n - 1 for at, n in zip((row, column), frame.shape, strict=True))
    if altitude_deg < _UP_DEG or not inside or (spot := find_spot(frame)) is None:
        return float("nan")
    if camera.mask is not None and camera.mask.hidden[round(row), round(column)]:
        return float("nan")
    beside = camera.pixel_of(azimuth_deg, altitude_deg - _NEAR_DEG)
    reach = float(np.hypot(*np.subtract(beside, (row, column))))
    if not np.isfinite(reach):
        return float("nan")
    top, left = (max(int(at - reach), 0) for at in (row, column))
    part = frame.counts[top : int(row + reach) + 1, left : int(column + reach) + 1]
    if ((part if part.ndim == 2 else part.min(axis=-1)) >= frame.saturated).any():
        return 0.0
    there = horizon_vector(*camera.direction_of(spot.row, spot.column))
    sun = horizon_vector(azimuth_deg, altitude_deg)
    return float(np.degrees(np.arccos(np.clip(there @ sun, -1, 1))))
