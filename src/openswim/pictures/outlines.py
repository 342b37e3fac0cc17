"""Outlines: pixels in which a ridge ends, or the ground changes its brightness, are seen by several rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.scene.frame import Frame
from openswim.scene.rays import Rays
from openswim.transport.view.eye import Eye
from openswim.transport.view.seen import View

F64 = NDArray[np.float64]

_LEAP = 1.2  # ratio of the distances in neighbouring pixels that makes an outline,
_SEEN = 1.05  # if their radiances are in such a ratio
_CONTRAST = 1.3  # of the ground's radiances, that makes one at any distance,
_NEAR_M, _TUFTED = 100.0, 2.0  # or, nearer than this, where tufts of grass differ as much, a greater one
_HIDDEN = 1e-3  # transmittance
_PARTS = ((0.125, 0.375), (0.375, -0.125), (-0.125, -0.375), (-0.375, 0.125))  # of a pixel: each in a row, a column


def softened(eye: Eye, rays: Rays, frame: Frame) -> NDArray[np.float32]:
    """Mean radiance (n, nw) of what four rays through each of some pixels see, whose middle ``rays`` see."""
    if not len(rays):
        return eye.view(rays).radiance
    direction = rays.directions()
    across = np.cross(direction, rays.origin_m + np.array([0.0, 0.0, frame.radius_m]))
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    above = np.cross(across, direction)
    width = np.broadcast_to(np.asarray(rays.width_rad, float), len(rays))
    parts = np.concatenate([direction + width[:, None] * (a * across + b * above) for a, b in _PARTS])
    parts /= np.linalg.norm(parts, axis=-1, keepdims=True)
    seen = eye.view(Rays(rays.origins()[0], parts, np.tile(0.5 * width, len(_PARTS))))
    return np.asarray(seen.radiance.reshape(len(_PARTS), len(rays), -1).mean(axis=0), np.float32)


def outlines_of(view: View, inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether pixels (n,) of those ``inside`` an image (ny, nx) lie on outlines."""
    # ground that is hidden by a cloud, whose edges are soft, has no outline; ground in sight has one before cloud, too
    seen = (view.transmittance.max(axis=1) > _HIDDEN) | (view.distance_m < 0)
    distance = np.where(seen, view.distance_m, np.nan)
    return outlines(distance, view.radiance.astype(np.float32).mean(axis=1), inside)


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
