"""Bright points in a frame: candidates for stars."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
MOST_PEAKS = 150
_SIGMAS = 8.0  # above the noise around it
_BLUR_PX = 1.5
_BACKGROUND = 4  # the background is looked for in blocks of so many pixels
_MEDIAN_BLOCKS = 15
_NEAREST_PX = 5


@dataclass(frozen=True)
class Peaks:
    """Places (n, 2: row, column) and heights (n,) in robust sigmas, highest first."""

    place: F64
    height: F64

    def __len__(self) -> int:
        return len(self.height)


def find_peaks(green: NDArray[np.float32], hidden: NDArray[np.bool_] | None = None) -> Peaks:
    """The brightest points of a channel (ny, nx), where it is not `hidden`.

    The background, a median around each place, is taken away; local maxima of what is left, smoothed, count where they
    stand out of the noise around them; their places are centroids.
    """
    from scipy import ndimage

    rows, columns = (n - n % _BACKGROUND for n in green.shape)
    blocks = green[:rows, :columns].reshape(rows // _BACKGROUND, _BACKGROUND, columns // _BACKGROUND, _BACKGROUND)
    coarse = _medians(blocks.mean(axis=(1, 3)))
    at = [((np.arange(n) + 0.5) / _BACKGROUND - 0.5).astype(np.float32) for n in green.shape]
    background = _between(coarse, *at)
    excess = green - background
    smooth = ndimage.gaussian_filter(excess, _BLUR_PX)
    # the noise differs over the frame: vignetting, moonlight, the lit horizon
    spread = np.abs(smooth[:rows, :columns]).reshape(blocks.shape).mean(axis=(1, 3))
    noise = 1.25 * _between(_medians(spread), *at)
    significance = smooth / np.maximum(noise, 1e-3 * max(float(np.std(green)), 1e-6))
    highest = ndimage.maximum_filter(significance, 2 * _NEAREST_PX + 1)
    found = (significance == highest) & (significance > _SIGMAS)
    edge = _NEAREST_PX
    found[:edge] = found[-edge:] = found[:, :edge] = found[:, -edge:] = False
    if hidden is not None:
        found &= ~hidden
    order = np.argsort(-smooth[found])[:MOST_PEAKS]
    place = [_centroid(excess, row, column) for row, column in np.argwhere(found)[order]]
    return Peaks(np.array(place, float).reshape(-1, 2), significance[found][order])


def _medians(blocks: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of the blocks around each, as scipy.ndimage.median_filter has them, in a fifth of its time."""
    size, middle = _MEDIAN_BLOCKS, _MEDIAN_BLOCKS**2 // 2
    around = np.lib.stride_tricks.sliding_window_view(np.pad(blocks, size // 2, mode="edge"), (size, size))
    out = np.empty_like(blocks)
    for row, windows in enumerate(around):
        out[row] = np.partition(windows.reshape(blocks.shape[1], -1), middle, axis=1)[:, middle]
    return out


def _between(coarse: NDArray[Any], row: NDArray[np.float32], column: NDArray[np.float32]) -> NDArray[np.float32]:
    """Blocks' values at the rows and columns (in blocks) of pixels, bilinear."""
    i, j = (np.clip(np.floor(v).astype(int), 0, n - 2) for v, n in zip((row, column), coarse.shape, strict=True))
    v, u = np.clip(row - i, 0, 1)[:, None], np.clip(column - j, 0, 1)
    left = coarse[:, j] * (1 - u) + coarse[:, j + 1] * u
    return np.asarray(left[i] * (1 - v) + left[i + 1] * v, np.float32)


def _centroid(excess: NDArray[np.float32], row: int, column: int) -> tuple[float, float]:
    """Of what is above half of the peak, within three pixels."""
    part = excess[row - 3 : row + 4, column - 3 : column + 4]
    weight = np.clip(part - 0.3 * part.max(), 0, None)
    total = weight.sum()
    if not total > 0:
        return float(row), float(column)
    step = np.arange(-3, 4)
    return float(row + (weight.sum(1) * step).sum() / total), float(column + (weight.sum(0) * step).sum() / total)
