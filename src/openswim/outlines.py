"""Outlines: pixels in which a ridge ends, or the ground changes its brightness, are seen by several rays."""

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

_LEAP = 1.2  # ratio of the distances in neighbouring pixels that makes an outline,
_SEEN = 1.05  # if their radiances are in such a ratio
_CONTRAST = 1.3  # of the ground's radiances, that makes one at any distance,
_NEAR_M, _TUFTED = 100.0, 2.0  # or, nearer than this, where tufts of grass differ as much, a greater one
_HIDDEN = 1e-3  # transmittance
_PARTS = ((0.125, 0.375), (0.375, -0.125), (-0.125, -0.375), (-0.375, 0.125))  # of a pixel: each in a row, a column


def soften(radiance: NDArray[np.float32], view: View, field: Field, rays: Rays, pixels: Pixels) -> None:
    """Give the pixels on outlines, of ``radiance`` (n, nw), the mean of what four rays through each of them see."""
    up = rays.origin_m + np.array([0.0, 0.0, field.frame.radius_m])
    inside = np.asarray(pixels.inside)
    # what is hidden by a cloud, whose edges are soft, has no outline
    distance = np.where(view.transmittance.max(axis=1) > _HIDDEN, view.distance_m, np.nan)
    edge = np.flatnonzero(outlines(distance, radiance.mean(axis=1), inside))
    if not edge.size:
        return
    direction = rays.directions()[edge]
    across = np.cross(direction, up)
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    above = np.cross(across, direction)
    width = np.broadcast_to(np.asarray(rays.width_rad, float), len(rays))[edge]
    parts = np.concatenate([direction + width[:, None] * (a * across + b * above) for a, b in _PARTS])
    parts /= np.linalg.norm(parts, axis=-1, keepdims=True)
    seen = field.view(Rays(rays.origins()[0], parts, np.tile(0.5 * width, len(_PARTS))), more=True)
    radiance[edge] = seen.radiance.reshape(len(_PARTS), edge.size, -1).mean(axis=0)


def outlines(distance_m: F64, brightness: NDArray[np.floating], inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether the ground in a pixel (n,) of those ``inside`` (ny, nx) ends beside that of a neighbour, or is another;
    negative distances: no ground; NaN: not seen."""
    image = np.full((3, *inside.shape), np.nan)
    edge = np.zeros(inside.shape, bool)
    with np.errstate(invalid="ignore", divide="ignore"):  # inf - inf is no leap
        image[:2, inside] = np.log([np.where(distance_m < 0, np.inf, distance_m), brightness])
        image[2, inside] = np.log(np.where(distance_m < _NEAR_M, _TUFTED, _CONTRAST))
        for axis in (0, 1):
            far, bright, least = np.moveaxis(image, axis + 1, 1)
            leap, contrast = np.abs(np.diff(far, axis=0)), np.abs(np.diff(bright, axis=0))
            found = (leap > np.log(_LEAP)) & (contrast > np.log(_SEEN))
            found |= np.isfinite(leap) & (contrast > np.maximum(least[1:], least[:-1]))
            b = np.moveaxis(edge, axis, 0)
            b[1:] |= found
            b[:-1] |= found
    return np.asarray(edge[inside])
