"""Which way round is the sky: starts for a fit, from nothing but bright points and directions."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.lenses import Lens
from openswim.cameras.optics import Optics

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]

SCALES = np.geomspace(0.6, 1.5, 31)  # radius of the horizon over half of the frame's shorter side
ROTATIONS_DEG = np.arange(0.0, 360.0, 1.5)
# off the middle of the frame, in the same unit: a frame may have been cut on one side, or padded
CENTRES: F64 = np.arange(-9, 10) * np.float64(0.05)
USUAL = 0.16  # within which most frames have it
REACH = 0.06  # how far a peak may lie from where a guess has its star, likewise
STARTS = 25
BRIGHTEST = 40
_TABLE = 400  # rows or columns of the table of distances
_APART_ROTATION_DEG, _APART_SCALE, _APART_CENTRE = 3.0, 0.05, 0.08


@dataclass(frozen=True)
class Start:
    """A guess and how well it fits: the sum over stars of 1 - distance / reach of the nearest peak, where positive."""

    optics: Optics
    score: float


def starts(direction: F64, peaks: F64, shape: tuple[int, int]) -> tuple[list[Start], list[Start]]:
    """The best distinct guesses, best first, of an equidistant lens with its axis in the zenith: those whose centre is
    near the middle of the frame, and those where it is farther away.

    `direction` (n, 3): east, north, up of stars, brightest first; `peaks` (m, 2): rows and columns.
    """
    half = min(shape) / 2
    focals = half * SCALES / (np.pi / 2)
    table, step = _nearness(peaks, shape, REACH * half)
    # centres lie on whole cells of the table, so that another one is but another place to count from
    rows, columns = (np.rint(((n - 1) / 2 + CENTRES * half) / step).astype(int) for n in shape)
    score, turn = _scores(table, direction[:BRIGHTEST], focals / step, rows, columns)
    usual = np.abs(CENTRES) < USUAL
    near = np.broadcast_to(usual[:, None] & usual, score.shape)

    def best(there: NDArray[np.bool_]) -> list[Start]:
        kept: list[Start] = []
        for number in np.argsort(np.where(there, -score, 1.0), axis=None, kind="stable"):
            i, mirrored, j, k = at = np.unravel_index(number, score.shape)
            lens, rotation = Lens("equidistant", float(focals[i])), float(ROTATIONS_DEG[turn[at]])
            optics = Optics(lens, float(rows[j] * step), float(columns[k] * step), rotation, mirrored=bool(mirrored))
            if all(not _alike(optics, other.optics, half) for other in kept):
                kept.append(Start(optics, float(score[at])))
            if len(kept) == STARTS:
                break
        return kept

    return best(near), best(~near)


def _scores(
    table: F32, stars: F64, focals: F64, rows: NDArray[np.int_], columns: NDArray[np.int_]
) -> tuple[F32, NDArray[np.int_]]:
    """Of focal lengths (cells per radian), handedness and the centres' rows and columns: the sums of the table where a
    guess has its stars, at the rotation where they are largest, and that rotation's number."""
    zenith = np.arccos(np.clip(stars[:, 2], -1, 1))[:, None]
    turned = np.arctan2(stars[:, 0], stars[:, 1])[:, None] + np.radians(ROTATIONS_DEG)
    down, left = -np.cos(turned) * zenith, -np.sin(turned) * zenith
    middle = max(abs(centres - (n - 1) / 2).max() for centres, n in zip((rows, columns), table.shape, strict=True))
    rim = math.ceil(focals[-1] * float(zenith.max()) + float(middle)) + 1  # beyond it no guess has a star
    padded = np.pad(table, rim)
    width, cells = padded.shape[1], padded.ravel()
    score = np.empty((focals.size, 2, rows.size, columns.size), np.float32)
    turn = np.empty(score.shape, int)
    near = np.empty(turned.shape, np.float32)
    for i, focal in enumerate(focals):
        row = np.rint(focal * down).astype(int) + rim
        for mirrored, across in enumerate((focal, -focal)):
            at = row * width + np.rint(across * left).astype(int) + rim
            for j, k in np.ndindex(rows.size, columns.size):
                cells[rows[j] * width + columns[k] :].take(at, out=near, mode="clip")
                sums = near.sum(axis=0)
                turn[i, mirrored, j, k] = best = sums.argmax()
                score[i, mirrored, j, k] = sums[best]
    return score, turn


def _nearness(peaks: F64, shape: tuple[int, int], reach: float) -> tuple[F32, float]:
    """1 - distance / reach of the nearest peak on a coarse grid, and the grid's step in pixels."""
    from scipy.spatial import cKDTree

    step = max(max(shape) / _TABLE, 1.0)
    rows, columns = (int(np.ceil(n / step)) for n in shape)
    place = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1) * step
    away, _ = cKDTree(peaks).query(place, distance_upper_bound=reach)
    return np.clip(1 - away / reach, 0, 1).astype(np.float32), step


def _alike(one: Optics, other: Optics, half: float) -> bool:
    turn = (one.rotation_deg - other.rotation_deg + 180) % 360 - 180
    scale = one.lens.focal_px / other.lens.focal_px - 1
    apart = np.hypot(one.centre_row - other.centre_row, one.centre_column - other.centre_column) / half
    near = abs(turn) < _APART_ROTATION_DEG and abs(scale) < _APART_SCALE and apart < _APART_CENTRE
    return one.mirrored == other.mirrored and near
