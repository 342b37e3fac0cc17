"""Pixels whose directions are given one by one: maps of azimuth and zenith distance, and free rays."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers
from openswim.cameras.pixels import Pixels
from openswim.errors import UserError
from openswim.scene.frame import FLAT_RADIUS_M, Frame, horizon_vector
from openswim.scene.grid import EARTH_RADIUS_M

F64 = NDArray[np.float64]
_NEAR_PX = 3.0  # a direction this far from every pixel's lies outside of the picture
_ROUNDING_SR = 1e-16  # what pixels seem to span that all look at the zenith


@dataclass(frozen=True, eq=False)
class Given:
    """The pixels, and what they look at where that is a place: `towards` (n, 3) latitude, longitude, height of each
    (y, x, height in a flat scene)."""

    pixels: Pixels
    towards: F64 | None = None

    @cached_property
    def _tree(self) -> tuple[Any, F64]:
        from scipy.spatial import cKDTree

        inside = self.pixels.inside
        return cKDTree(self.pixels.direction[inside]), np.argwhere(inside).astype(float)

    def project(self, direction: F64) -> tuple[F64, F64]:
        """Row and column of directions (..., 3): of the nearest pixel, and between it and its neighbours."""
        d = np.asarray(direction, float)
        tree, place = self._tree
        apart, nearest = tree.query(d.reshape(-1, 3))
        row, column = place[nearest].T
        step_row, step_column = self._between(d.reshape(-1, 3), row.astype(int), column.astype(int))
        width = np.sqrt(self.pixels.solid_angle_sr[row.astype(int), column.astype(int)])
        outside = apart > _NEAR_PX * width
        row, column = np.where(outside, np.nan, row + step_row), np.where(outside, np.nan, column + step_column)
        return row.reshape(d.shape[:-1]), column.reshape(d.shape[:-1])

    def direction(self, row: ArrayLike, column: ArrayLike) -> F64:
        """Unit vectors at places between the pixels, bilinear; NaN outside."""
        y, x = np.broadcast_arrays(np.asarray(row, float), np.asarray(column, float))
        d = self.pixels.direction
        ny, nx = d.shape[:2]
        outside = ~((y >= -0.5) & (y <= ny - 0.5) & (x >= -0.5) & (x <= nx - 0.5))
        y0, x0 = (
            np.clip(np.floor(np.nan_to_num(v)), 0, max(n - 2, 0)).astype(int) for v, n in ((y, ny), (x, nx))
        )
        y1, x1 = np.minimum(y0 + 1, ny - 1), np.minimum(x0 + 1, nx - 1)
        v, u = (y - y0)[..., None], (x - x0)[..., None]
        mixed = (1 - v) * ((1 - u) * d[y0, x0] + u * d[y0, x1]) + v * ((1 - u) * d[y1, x0] + u * d[y1, x1])
        mixed /= np.linalg.norm(mixed, axis=-1, keepdims=True)
        return np.where(outside[..., None], np.nan, mixed)

    def _between(self, direction: F64, row: NDArray[np.int_], column: NDArray[np.int_]) -> tuple[F64, F64]:
        """Fractions of a pixel from the nearest one, by the steps of direction to its neighbours; 0 where unknown."""
        d = self.pixels.direction
        here = d[row, column]
        around = [
            d[np.clip(row + i, 0, len(d) - 1), np.clip(column + j, 0, d.shape[1] - 1)] - here
            for i, j in ((-1, 0), (1, 0), (0, -1), (0, 1))
        ]
        a, b = (self._step_by(around[i], around[i + 1]) for i in (0, 2))
        off = direction - here
        aa, bb, ab = (a * a).sum(-1), (b * b).sum(-1), (a * b).sum(-1)
        ao, bo = (a * off).sum(-1), (b * off).sum(-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            found = [(bb * ao - ab * bo) / (aa * bb - ab**2), (aa * bo - ab * ao) / (aa * bb - ab**2)]
        return tuple(np.nan_to_num(np.clip(f, -_NEAR_PX, _NEAR_PX)) for f in found)

    @staticmethod
    def _step_by(back: F64, ahead: F64) -> F64:
        """Step of direction by the differences to two neighbours, of which one may be missing or the pixel itself."""
        known = [np.isfinite(d[..., 0]) & (d != 0).any(-1) for d in (back, ahead)]
        total = np.where(known[1][..., None], ahead, 0) - np.where(known[0][..., None], back, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(total / (known[0].astype(float) + known[1])[..., None])

    def resized(self, shape: tuple[int, int]) -> "Given":
        """Fewer or more pixels, each the nearest of these."""
        ny, nx = self.pixels.inside.shape
        y, x = (
            np.minimum(((np.arange(new) + 0.5) * old / new).astype(int), old - 1)
            for new, old in zip(shape, (ny, nx), strict=True)
        )
        area = ny / shape[0] * nx / shape[1]
        some = np.ix_(y, x)
        return Given(Pixels(self.pixels.direction[some], self.pixels.solid_angle_sr[some] * area))


def from_map(azimuth_deg: ArrayLike, zenith_deg: ArrayLike) -> Given:
    """Pixels of maps (ny, nx) of azimuth, clockwise from north, and distance from the zenith; NaN outside."""
    azimuth, zenith = numbers("map: azimuth", azimuth_deg), numbers("map: zenith", zenith_deg)
    if azimuth.ndim != 2 or azimuth.shape != zenith.shape or min(azimuth.shape) < 2:
        raise UserError(
            f"map: azimuth {azimuth.shape} and zenith {zenith.shape} must be pictures of one size, 2 x 2 or more"
        )
    known = np.isfinite(azimuth) & np.isfinite(zenith)
    if not known.any() or zenith[known].min() < 0 or zenith[known].max() > 180 or np.abs(azimuth[known]).max() > 360:
        raise UserError("map: needs azimuths of -360 to 360 and zenith distances of 0 to 180 degrees, NaN outside")
    direction = horizon_vector(np.where(known, azimuth, np.nan), 90.0 - np.where(known, zenith, np.nan))
    return Given(_pictured(direction, "map"))


def from_directions(direction: ArrayLike, width_deg: float | None) -> Given:
    """Pixels of directions (n, 3) or (ny, nx, 3): east, north, up, of any length."""
    given = numbers("rays: direction", direction).astype(float)
    if given.ndim not in (2, 3) or given.shape[-1] != 3 or not given.size:
        raise UserError(f"rays: directions {given.shape} must be (n, 3) or (rows, columns, 3): east, north, up")
    with np.errstate(invalid="ignore"):
        unit = given / np.linalg.norm(given, axis=-1, keepdims=True)
    if not np.isfinite(unit).any():
        raise UserError("rays: no direction is a finite vector")
    unit = unit[None] if unit.ndim == 2 else unit
    if width_deg is None and min(unit.shape[:2]) > 1:
        return Given(_pictured(unit, "rays"))
    width = np.radians(0.1 if width_deg is None else number("rays: width_deg", width_deg))
    if not 0 < width < np.pi:
        raise UserError(f"rays: width_deg {width_deg} is not between 0 and 180")
    return Given(Pixels(unit, np.where(np.isnan(unit[..., 0]), np.nan, width**2)))


def from_places(
    towards: Any, place: tuple[Any, Any], height_m: float, curved: bool, width_deg: float | None
) -> Given:
    """Pixels that look from a place (latitude, longitude; y, x where flat) at others; the ground taken at sea level.

    `towards`: latitude, longitude and height; x, y and height where flat.
    """
    try:
        north, east, height = np.broadcast_arrays(*(numbers("rays: towards", part).astype(float) for part in towards))
    except (TypeError, ValueError):
        raise UserError("rays: towards must be three arrays of one shape: latitude, longitude, height (m)") from None
    if not curved:
        north, east = east, north
    if north.ndim not in (1, 2) or not (np.isfinite(north) & np.isfinite(east) & np.isfinite(height)).all():
        raise UserError(f"rays: towards of shape {north.shape} must be (n,) or (rows, columns), and finite")
    y, x = (number("camera: place", value) for value in place)
    frame = Frame(EARTH_RADIUS_M, y, x) if curved else Frame(FLAT_RADIUS_M, 0.0, 0.0, curved=False)
    away = (frame.position(north, east, height) - frame.position(y, x, height_m)) @ frame.enu(y, x).T
    pixels = from_directions(away, width_deg).pixels
    return Given(pixels, np.stack([north, east, height], axis=-1).reshape(pixels.direction.shape)[pixels.inside])


def _step(direction: F64, axis: int) -> F64:
    """(ny, nx, 3): change of direction from one pixel to the next; by both neighbours, or by the one there is."""
    d = np.moveaxis(direction, axis, 0)
    step = np.full_like(d, np.nan)
    if len(d) > 1:
        ahead = np.diff(d, axis=0)
        step[1:-1] = (ahead[1:] + ahead[:-1]) / 2
        for part, one in ((step[:-1], ahead), (step[1:], ahead)):
            unknown = np.isnan(part[..., 0]) & ~np.isnan(one[..., 0])
            part[unknown] = one[unknown]
    return np.moveaxis(step, 0, axis)


def _pictured(direction: F64, what: str) -> Pixels:
    """Pixels as wide as their neighbours are apart; UserError where they span nothing."""
    pixels = Pixels(direction, _solid_angle(direction))
    if not pixels.inside.any():
        raise UserError(f"{what}: its pixels look all one way: give directions that span a picture")
    return pixels


def _solid_angle(direction: F64) -> F64:
    """(ny, nx), of the parallelogram between the neighbours; NaN for pixels without any."""
    down, across = (np.moveaxis(_step(direction, axis), -1, 0) for axis in (0, 1))
    normal = (down[j] * across[k] - down[k] * across[j] for j, k in ((1, 2), (2, 0), (0, 1)))
    area = np.sqrt(sum(part**2 for part in normal))
    return np.where(np.isnan(direction[..., 0]) | (area < _ROUNDING_SR), np.nan, area)
