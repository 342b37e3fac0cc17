"""Clouds at about the right place: fractions skill scores in windows of equal solid angle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.comparison.tiles import Interval, Tiles
from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
CELLS = 90  # across the sky
WINDOWS_DEG = (2.0, 5.0, 10.0, 20.0, 40.0)
_LEAST_VALID = 0.5  # of a window's cells


@dataclass(frozen=True)
class Neighbourhood:
    """FSS in windows so many degrees wide, what it is of the observed cells in random order, and where it is useful."""

    window_deg: float
    score: Interval
    random: float
    useful: float  # .5 and half of the observed cover (Roberts and Lean 2008)


def lambert_map(camera: Camera, cells: int = CELLS) -> tuple[NDArray[np.int64], NDArray[np.int64], Mask, F64]:
    """Row and column of the picture's pixel in each cell (cells, cells) of Lambert's map of the upper half of the sky,
    which cells the picture has, and their directions (cells, cells, 3).

    The zenith is in the middle, north on top, east on the left; all cells have the same solid angle.
    """
    at = (np.arange(cells) + 0.5) / cells * 2 - 1
    down, right = np.meshgrid(at, at, indexing="ij")
    radius = np.hypot(down, right)
    zenith = 2 * np.arcsin(np.minimum(radius, 1) / np.sqrt(2))
    azimuth = np.degrees(np.arctan2(-right, -down)) % 360
    row, column = camera.pixel_of(azimuth, 90 - np.degrees(zenith))
    ny, nx = camera.shape
    there = (radius <= 1) & (row > -0.5) & (row < ny - 0.5) & (column > -0.5) & (column < nx - 0.5)
    place = [np.where(there, np.round(np.nan_to_num(at_)), 0).astype(np.int64) for at_ in (row, column)]
    return place[0], place[1], there, horizon_vector(azimuth, 90 - np.degrees(zenith))


def fraction_sums(simulated: Mask, observed: Mask, window: int, valid: Mask | None = None) -> tuple[F64, Mask]:
    """Per window that lies within the map: (p_f - p_o)^2, p_f^2, p_o^2; and which windows count.

    Shares p are of the valid cells, of which there must be half of the window.
    """
    valid = np.ones(simulated.shape, bool) if valid is None else valid
    cells = _windows(valid, window)
    with np.errstate(invalid="ignore", divide="ignore"):
        forecast, seen = (_windows(mask & valid, window) / cells for mask in (simulated, observed))
    counts = cells >= _LEAST_VALID * window**2
    return np.stack([(forecast - seen) ** 2, forecast**2, seen**2], axis=-1), counts


def fss(sums: F64) -> F64:
    """1 - sum (p_f - p_o)^2 / (sum p_f^2 + sum p_o^2) of sums (n, 3); NaN where no window has cloud."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(sums[:, 1] + sums[:, 2] > 0, 1 - sums[:, 0] / (sums[:, 1] + sums[:, 2]), np.nan)


def neighbourhoods(
    simulated: Mask, observed: Mask, valid: Mask, direction: F64, windows_deg: tuple[float, ...] = WINDOWS_DEG
) -> list[Neighbourhood]:
    """Scores of masks (cells, cells) on Lambert's map, in windows of several widths; direction (cells, cells, 3)."""
    cells = simulated.shape[0]
    shuffled = observed.copy()
    shuffled[valid] = np.random.default_rng(0).permutation(observed[valid])
    useful = float(0.5 + observed[valid].mean() / 2) if valid.any() else np.nan
    found = []
    for degrees in windows_deg:
        window = max(1, round(np.radians(degrees) * cells / (2 * np.sqrt(2))))
        sums, counts = fraction_sums(simulated, observed, window, valid)
        middle = direction[window // 2 :, window // 2 :][: sums.shape[0], : sums.shape[1]][counts]
        if len(middle):
            score = Tiles.of(middle).interval(sums[counts], fss, (0.0, 1.0), "neither picture has cloud")
            random = fraction_sums(simulated, shuffled, window, valid)[0][counts].sum(axis=0, keepdims=True)
            found.append(Neighbourhood(degrees, score, float(fss(random)[0]), useful))
        else:
            reason = Interval(np.nan, reason="no window is half valid")
            found.append(Neighbourhood(degrees, reason, np.nan, useful))
    return found


def _windows(mask: Mask, window: int) -> F64:
    """Sums over all squares of `window` cells a side that lie within the map."""
    total = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1))
    total[1:, 1:] = mask.cumsum(axis=0).cumsum(axis=1)
    w = window
    return np.asarray(total[w:, w:] - total[:-w, w:] - total[w:, :-w] + total[:-w, :-w])
