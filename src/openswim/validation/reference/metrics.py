"""How far a model is from a reference, with the reference's own Monte Carlo noise taken out."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

LIT = 0.02  # mean solar-relative radiance above which a block of pixels counts
BLOCK = 4  # pixels on a side

Array = NDArray[np.float64]


class Score(NamedTuple):
    """Errors relative to the mean of the reference; `n` values took part."""

    relative_rmse: float
    bias: float
    correlation: float
    n: int


class Agreement(NamedTuple):
    """A solver's own standard error over the reference's mean, and the share of values within three combined ones."""

    sigma: float
    within_3_sigma: float


UNKNOWN = Agreement(np.nan, np.nan)


def agreement(model: ArrayLike, reference: ArrayLike, own_sigma: ArrayLike, sigma: ArrayLike = 0.0) -> Agreement:
    """`Agreement` of values of any shape; unknown for solvers without an error (``own_sigma`` all zero)."""
    r, m, own, s = _compared(reference, model, own_sigma, sigma)
    if not (own > 0).any() or r.mean() == 0:
        return UNKNOWN
    near = np.abs(m - r) <= 3 * np.hypot(own, s)
    return Agreement(float(own.mean() / abs(r.mean())), float(near.mean()))


def image_agreement(
    model: ArrayLike, reference: ArrayLike, own_sigma: ArrayLike, sigma: ArrayLike = 0.0
) -> Agreement:
    """`agreement` of two images (ni, nj) by the lit 4x4-pixel means of `image_score`."""
    r, m, own, s = _lit_blocks(reference, model, own_sigma, sigma)
    return agreement(m, r, own, s)


def score(model: ArrayLike, reference: ArrayLike, sigma: ArrayLike = 0.0) -> Score:
    """Compare values of one quantity, any shape; values the reference leaves out (NaN) are not compared.

    relative_rmse = sqrt(max(0, mean((m - r)^2) - mean(sigma^2))) / |mean(r)|: the reference's noise, with a
    standard deviation `sigma` per value, adds its variance to the mean square difference and is taken off.
    bias = mean(m - r) / |mean(r)|. correlation is Pearson's, NaN where one side does not vary.
    A NaN of the model is a failure of the model: it makes the score NaN.
    """
    r, m, s = _compared(reference, model, sigma)
    scale = abs(r.mean()) if r.size else 0.0
    if scale == 0:
        return Score(np.nan, np.nan, np.nan, int(r.size))
    excess = np.mean((m - r) ** 2) - np.mean(s**2)
    rmse = np.sqrt(np.maximum(excess, 0.0))
    return Score(float(rmse / scale), float((m - r).mean() / scale), _correlation(m, r), int(r.size))


def in_marks(error: ArrayLike, mark: float) -> Score:
    """Errors over what is asked for: 1 is as good as was asked.

    NaN: of what the reference does not know; infinite: of what we do not find.
    """
    e = np.asarray(error, float)
    e = e[~np.isnan(e)] / mark
    if e.size == 0:
        return Score(np.nan, np.nan, np.nan, 0)
    return Score(float(np.sqrt(np.mean(e**2))), float(e.mean()), np.nan, e.size)


def image_score(model: ArrayLike, reference: ArrayLike, sigma: ArrayLike = 0.0) -> Score:
    """Compare two images (ni, nj) by their 4x4-pixel means, where that of the reference exceeds L' = 0.02."""
    r, m = _alike(reference, model)
    known = np.isfinite(r)
    if np.isnan(m[known]).any():
        return Score(np.nan, np.nan, np.nan, int(known.sum()))
    r, m, s = _lit_blocks(reference, model, sigma)
    return score(m, r, s)


def _alike(reference: ArrayLike, *others: ArrayLike) -> list[Array]:
    """All as float64 of the reference's shape."""
    r = np.asarray(reference, np.float64)
    return [r, *(np.broadcast_to(np.asarray(other, np.float64), r.shape) for other in others)]


def _compared(reference: ArrayLike, model: ArrayLike, *sigmas: ArrayLike) -> list[Array]:
    """Where the reference and its own standard error, the last, are known."""
    arrays = _alike(reference, model, *sigmas)
    known = np.isfinite(arrays[0]) & np.isfinite(arrays[-1])
    return [one[known] for one in arrays]


def _lit_blocks(reference: ArrayLike, model: ArrayLike, *sigmas: ArrayLike) -> list[Array]:
    """Means over blocks of pixels that are lit in the reference, and the standard errors of these means."""
    r, m, *errors = _alike(reference, model, *sigmas)
    means, counts = block_means(r)
    lit, known = means > LIT, np.isfinite(r)
    of_means = [block_means(np.where(known, s**2, np.nan))[0] for s in errors]
    return [means[lit], block_means(np.where(known, m, np.nan))[0][lit],
            *(np.sqrt(variance[lit] / counts[lit]) for variance in of_means)]  # fmt: skip


def block_means(image: Array) -> tuple[Array, Array]:
    """Means over 4x4 pixels (an incomplete last row or column is left out) and how many pixels each has.

    Pixels that are NaN are left out; a block with fewer than half its pixels is NaN.
    """
    ni, nj = (n // BLOCK for n in image.shape)
    blocks = image[: ni * BLOCK, : nj * BLOCK].reshape(ni, BLOCK, nj, BLOCK)
    known = np.isfinite(blocks)
    counts = known.sum(axis=(1, 3)).astype(np.float64)
    sums = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    means = np.full((ni, nj), np.nan)
    np.divide(sums, counts, out=means, where=counts >= BLOCK * BLOCK / 2)
    return means, counts


def _correlation(a: Array, b: Array) -> float:
    if a.size < 2 or not (np.ptp(a) > 0 and np.ptp(b) > 0):
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])
