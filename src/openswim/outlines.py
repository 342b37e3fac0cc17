"""Outlines: pixels in which a ridge ends are seen by several rays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Rays

if TYPE_CHECKING:
    from openswim.cameras.pixels import Pixels
    from openswim.transport import Field
    from openswim.transport.field import View

F64 = NDArray[np.float64]

_LEAP = 1.2  # ratio of the distances in neighbouring pixels that makes an outline
_PARTS = ((0.125, 0.375), (0.375, -0.125), (-0.125, -0.375), (-0.375, 0.125))  # of a pixel: each in a row, a column


def soften(radiance: NDArray[np.float32], view: View, field: Field, rays: Rays, pixels: Pixels) -> None:
    """Give the pixels on outlines, of ``radiance`` (n, nw), the mean of what four rays through each of them see."""
    edge = np.flatnonzero(outlines(view.distance_m, np.asarray(pixels.inside)))
    if not edge.size:
        return
    direction = rays.directions()[edge]
    across = np.cross(direction, _upward(rays.origins()[edge], field.frame.radius_m))
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    above = np.cross(across, direction)
    width = np.broadcast_to(np.asarray(rays.width_rad, float), len(rays))[edge]
    parts = np.concatenate([direction + width[:, None] * (a * across + b * above) for a, b in _PARTS])
    parts /= np.linalg.norm(parts, axis=-1, keepdims=True)
    seen = field.view(Rays(rays.origins()[0], parts, np.tile(0.5 * width, len(_PARTS))))
    radiance[edge] = seen.radiance.reshape(len(_PARTS), edge.size, -1).mean(axis=0)


def outlines(distance_m: F64, inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether the ground in a pixel (n,) of those ``inside`` (ny, nx) ends beside that of a neighbour; negative
    distances: no ground."""
    far = np.where(distance_m > 0, distance_m, np.inf)
    image = np.full(inside.shape, np.nan)
    image[inside] = np.log(far)
    edge = np.zeros(inside.shape, bool)
    for axis in (0, 1):
        a, b = (np.moveaxis(v, axis, 0) for v in (image, edge))
        with np.errstate(invalid="ignore"):
            leap = np.abs(a[1:] - a[:-1]) > np.log(_LEAP)  # inf - inf is no leap
        b[1:] |= leap
        b[:-1] |= leap
    return np.asarray(edge[inside])


def _upward(place: F64, radius_m: float) -> F64:
    return place + np.array([0.0, 0.0, radius_m])
