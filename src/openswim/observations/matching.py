"""Which peak is which star: one to one."""

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.optics import Optics
from openswim.observations.lens_fit import Freedom, fit

F64 = NDArray[np.float64]
Pairs = tuple[NDArray[np.int_], NDArray[np.int_]]

TOLERANCES_PX = (60.0, 40.0, 25.0, 15.0, 10.0, 8.0)
LEAST_PAIRS = 8


def pairs(optics: Optics, direction: F64, peaks: F64, tolerance_px: float) -> Pairs:
    """Indices of stars and of peaks that are each other's nearest, within a tolerance.

    A peak serves one star only: giving each star its nearest peak makes any fit look good.
    """
    from scipy.spatial import cKDTree

    expected = np.stack(optics.project(direction), axis=-1)
    seen = np.flatnonzero(np.isfinite(expected[:, 0]))
    if not seen.size or not len(peaks):
        return np.empty(0, int), np.empty(0, int)
    away, peak = cKDTree(peaks).query(expected[seen])
    _, star = cKDTree(expected[seen]).query(peaks)
    mutual = (star[peak] == np.arange(seen.size)) & (away <= tolerance_px)
    return seen[mutual], peak[mutual]


def refined(
    start: Optics, direction: F64, peaks: F64, freedom: Freedom, size: float,
    tolerances_px: tuple[float, ...] = TOLERANCES_PX,
) -> tuple[Optics, Pairs]:
    """Match, fit, and again with a smaller tolerance; `size`: of the frame's pixels, relative to those of 1040 rows."""
    optics = start
    for tolerance in tolerances_px:
        star, peak = pairs(optics, direction, peaks, tolerance * size)
        if star.size < LEAST_PAIRS:
            break
        # tilt and lens only once the match is close: before, they follow the wrong pairs
        free = freedom if tolerance < 30 else Freedom(centre=True, tilt=False)
        optics = fit(optics, direction[star], peaks[peak], free, scale_px=max(tolerance / 8, 1.0) * size)
    return optics, pairs(optics, direction, peaks, tolerances_px[-1] * size)


def expected_by_chance(direction: F64, optics: Optics, peaks: F64, tolerance_px: float) -> float:
    """Pairs that as many peaks, strewn over the disc, would make with the stars: n (1 - exp(-m pi e^2 / A))."""
    row, column = optics.project(direction)
    seen = np.isfinite(row)
    if not seen.any():
        return 0.0
    radius = np.nanmax(np.hypot(row - optics.centre_row, column - optics.centre_column))
    share = len(peaks) * tolerance_px**2 / max(radius, 1.0) ** 2
    return float(seen.sum() * (1 - np.exp(-share)))
