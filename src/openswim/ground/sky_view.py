"""How much of an even sky slopes and hollows see, and what of the ground around them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.ground.fields import blurred

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TOWARD = [(1, 0), (2, 1), (1, 1), (1, 2)]  # and all that a quarter turn and a reflection make of them: 16 azimuths
_REACH_M = 30e3
_FURTHER = 1.4  # than the last, each look
_LEVEL = 0.005  # slopes that are not worth it
_LEAST = 0.02  # of the sky, that the narrowest gorge sees


class Terrain(NamedTuple):
    """Heights (ny, nx) of the ground, m, on columns and rows ``cell_m`` apart; beyond the sides all is as high as they
    are, unless it is ``periodic``."""

    height_m: F32
    cell_m: tuple[float, float]
    periodic: bool

    @property
    def level(self) -> bool:
        """Whether no slope reaches .5 %."""
        if min(self.height_m.shape) < 2:
            return True
        return all(
            np.abs(np.diff(self.height_m, axis=axis)).max() < _LEVEL * length
            for axis, length in enumerate(self.cell_m[::-1])
        )

    def slopes(self) -> tuple[F64, F64]:
        """Rise over run (ny, nx) along y and along x; 0 where there is one node."""
        height, (dx, dy) = self.height_m.astype(float), self.cell_m
        if self.periodic:
            wide = np.pad(height, 1, mode="wrap")
        else:  # one-sided
            wide = np.pad(height, 1, mode="reflect", reflect_type="odd")
        return (wide[2:, 1:-1] - wide[:-2, 1:-1]) / (2 * dy), (wide[1:-1, 2:] - wide[1:-1, :-2]) / (2 * dx)

    def seen(self, light: F32, sun: F64) -> tuple[F32, F32]:
        """Irradiance of the ground along its own slope (ny, nx) by an even sky of irradiance one on a plain, and
        that by sunlit ground around, whose radiosity is ``light`` (ny, nx) where it faces the ``sun`` (3,), a direction
        along columns, rows and up.

        The integral over azimuth of Dozier and Frew (1990, IEEE Trans. Geosci. Remote Sens. 28, 963, Eq. 7b), by 16 of
        them. Along each the horizon rises over nodes ever farther apart, up to 30 km; by as much as it does the ground
        there is seen, lit by the slope that it rises or falls with. What is farther is as bright as ground around.
        """
        height, (dx, dy) = self.height_m.astype(np.float32), self.cell_m
        east, north, up = (float(v) for v in sun)
        slope_y, slope_x = (slope.astype(np.float32) for slope in self.slopes())
        facing = 1 / np.sqrt(1 + slope_x**2 + slope_y**2)
        turned = {(x * i, y * j) for a, b in _TOWARD for x, y in ((a, b), (b, a)) for i in (1, -1) for j in (1, -1)}
        azimuths = sorted((np.arctan2(y * dy, x * dx), x, y) for x, y in turned)
        angles = np.array([angle for angle, _, _ in azimuths])
        shares = (np.roll(angles, -1) - np.roll(angles, 1)) % (2 * np.pi) / (4 * np.pi)
        view, around, bands = np.zeros_like(height), np.zeros_like(light), np.zeros_like(height)
        for (angle, x, y), share in zip(azimuths, shares.tolist(), strict=True):
            cosine, sine = math.cos(angle), math.sin(angle)
            toward: F32 = np.asarray(-(slope_x * cosine + slope_y * sine))
            step = math.hypot(x * dx, y * dy)
            tangent = -toward  # where the slope's own plane ends
            above = _above(tangent, toward)
            along = cosine * east + sine * north
            last, far, before = height, 1.0, 0
            while (count := int(far)) * step < _REACH_M and count < max(height.shape):
                there = _away(height.shape, count * x, count * y, self.periodic)
                here = height[there]
                risen = (here - height) / (count * step)
                if (risen > tangent).any():
                    tangent = np.maximum(tangent, risen)
                    lower, above = above, _above(tangent, toward)
                    band = share * facing * (lower - above)
                    bands += band
                    rise = (here - last) / ((count - before) * step)
                    facet = np.maximum(up - rise * along, 0) / np.sqrt(1 + rise * rise)
                    around += band * facet * light[there]
                last, far, before = here, max(far + 1, _FURTHER * far), count
            view += share * facing * _above(np.maximum(tangent, 0), toward)
        rest = np.maximum(1 - view - bands, 0)
        below = np.maximum(up - slope_x * east - slope_y * north, 0) * facing
        return np.clip(view, _LEAST, 1.0), around + rest * blurred(below * light)


def _above(tangent: F32, toward: F32) -> F32:
    """The integral over what is above a horizon, of a slope whose normal leans ``toward`` it."""
    share = 1 / (1 + tangent * tangent)
    return np.asarray(share + toward * (np.float32(np.pi / 2) - np.arctan(tangent) - tangent * share))


def _away(shape: tuple[int, ...], x: int, y: int, periodic: bool) -> tuple[NDArray, NDArray]:
    """Rows and columns of the nodes so many away; beyond the sides the nearest."""
    ny, nx = shape
    j, i = np.arange(ny) + y, np.arange(nx) + x
    j, i = (j % ny, i % nx) if periodic else (np.clip(j, 0, ny - 1), np.clip(i, 0, nx - 1))
    return j[:, None], i
