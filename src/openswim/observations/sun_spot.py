"""Where the sun, or a bright moon, is in a frame: the middle of the round spot in which every channel is full."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.observations.frames import SkyFrame

SMALLEST = 0.008  # radius of the spot over half of the frame's shorter side; a cloud's brightest part is smaller
_OPENED = 0.6  # what is narrower than so much of the spot is a ray or a lit cloud beside it
_ROUND = 0.35  # share of the spot that must be left then


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

    darkest = frame.counts if frame.counts.ndim == 2 else frame.counts.min(axis=-1)
    full = darkest >= frame.saturated
    if hidden is not None:
        full &= ~hidden
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
