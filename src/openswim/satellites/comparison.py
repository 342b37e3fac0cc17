"""A simulated picture beside an observed one: distribution, bias, correlation, and how far features are displaced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError

F64 = NDArray[np.float64]

PERCENTILES = (5, 25, 50, 75, 95)
_SHARE_KNOWN = 0.5  # of a window, that displacement needs
_SURE = 0.3  # correlation of a displaced window below which none is told


@dataclass(frozen=True)
class Agreement:
    """Of reflectance factors at the pixels that both know: percentiles (5, 25, 50, 75, 95) of the simulated and of the
    observed picture, bias and root mean square of simulated minus observed, Pearson's correlation (NaN where one does
    not vary) and the number of pixels."""

    simulated: F64
    observed: F64
    bias: float
    rmse: float
    correlation: float
    n: int


def agreement(simulated: F64, observed: F64) -> Agreement:
    """Compare two pictures (ny, nx); NaN is left out."""
    both = _checked(simulated, observed)
    one, other = simulated[both].astype(float), observed[both].astype(float)
    if not one.size:
        raise UserError("no pixel is known in both pictures: nothing to compare")
    off = one - other
    varies = one.std() > 0 and other.std() > 0
    return Agreement(
        np.percentile(one, PERCENTILES), np.percentile(other, PERCENTILES), float(off.mean()),
        float(np.sqrt((off**2).mean())), float(np.corrcoef(one, other)[0, 1]) if varies else float("nan"), one.size,
    )  # fmt: skip


def displacement(simulated: F64, observed: F64, window: int = 64, most: int = 16) -> tuple[F64, F64, F64]:
    """How far features of the simulated picture lie from the observed ones, window by window.

    Returns, per window (rows, columns of windows), the shift down and to the right in pixels that the simulated window
    needs to correlate best with the observed picture, up to `most`, and that correlation; NaN where it stays below .3,
    where the best shift is the largest allowed, or where less than half of a window is known.
    """
    _checked(simulated, observed)
    rows, columns = ((n - 2 * most) // window for n in simulated.shape)
    down, right, best = (np.full((max(rows, 0), max(columns, 0)), np.nan) for _ in range(3))
    for i, j in np.ndindex(*down.shape):
        top, left = most + i * window, most + j * window
        part = simulated[top : top + window, left : left + window]
        around = observed[top - most : top + window + most, left - most : left + window + most]
        score = _correlations(part, around)
        if not np.isfinite(score).any():
            continue
        place = np.unravel_index(np.nanargmax(score), score.shape)
        best[i, j] = score[place]
        inside = all(0 < one < 2 * most for one in place)
        if score[place] >= _SURE and inside:
            down[i, j], right[i, j] = place[0] - most, place[1] - most
    return down, right, best


def _correlations(part: F64, around: F64) -> F64:
    """Pearson's correlation of a window with all places of it in its surroundings."""
    from scipy.signal import fftconvolve

    known = np.isfinite(part)
    if known.mean() < _SHARE_KNOWN or not np.isfinite(around).all():
        return np.full((1, 1), np.nan)
    mask = known.astype(float)
    values = np.where(known, part - np.nanmean(part), 0.0)
    count, spread = mask.sum(), float((values**2).sum())
    level = around - around.mean()
    flipped = np.s_[::-1, ::-1]
    total = fftconvolve(level, mask[flipped], "valid")
    squares = fftconvolve(level**2, mask[flipped], "valid") - total**2 / count
    with np.errstate(all="ignore"):
        return np.asarray(fftconvolve(level, values[flipped], "valid") / np.sqrt(spread * np.maximum(squares, 1e-12)))


def _checked(simulated: F64, observed: F64) -> NDArray[np.bool_]:
    if simulated.shape != observed.shape or simulated.ndim != 2:
        raise UserError(f"pictures of {simulated.shape} and {observed.shape} pixels: bring both to one grid")
    return np.isfinite(simulated) & np.isfinite(observed)
