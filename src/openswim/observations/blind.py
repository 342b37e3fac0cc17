"""Which way round is the sky: starts for a fit, from nothing but bright points and directions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.lenses import Lens
from openswim.cameras.optics import Optics

F64 = NDArray[np.float64]

SCALES = np.geomspace(0.6, 1.5, 31)  # radius of the horizon over half of the frame's shorter side
ROTATIONS_DEG = np.arange(0.0, 360.0, 1.5)
CENTRES: F64 = np.arange(-3, 4) * np.float64(0.05)  # off the middle of the frame, in the same unit
WIDE_CENTRES: F64 = np.arange(-9, 10) * np.float64(0.05)  # of a frame that was cut on one side, or padded
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


def starts(direction: F64, peaks: F64, shape: tuple[int, int], centres: F64 = CENTRES) -> list[Start]:
    """The best distinct guesses, best first, of an equidistant lens with its axis in the zenith.

    `direction` (n, 3): east, north, up of stars, brightest first; `peaks` (m, 2): rows and columns; `centres`: how far
    off the middle of the frame the axis is looked for, over half of the frame's shorter side.
    """
    half = min(shape) / 2
    table, step = _nearness(peaks, shape, REACH * half)
    stars = direction[:BRIGHTEST]
    zenith = np.arccos(np.clip(stars[:, 2], -1, 1))
    turned = np.arctan2(stars[:, 0], stars[:, 1]) + np.radians(ROTATIONS_DEG)[:, None]
    down, left = -np.cos(turned) * zenith, -np.sin(turned) * zenith
    found: list[Start] = []
    for centre_row in (shape[0] - 1) / 2 + centres * half:
        for centre_column in (shape[1] - 1) / 2 + centres * half:
            for focal in half * SCALES / (np.pi / 2):
                row = _index(centre_row + focal * down, step, table.shape[0])
                for mirrored in (False, True):
                    across = -focal * left if mirrored else focal * left
                    scores = table[row, _index(centre_column + across, step, table.shape[1])].sum(axis=1)
                    best = int(np.argmax(scores))
                    lens = Lens("equidistant", float(focal))
                    turn = float(ROTATIONS_DEG[best])
                    optics = Optics(lens, float(centre_row), float(centre_column), turn, mirrored=mirrored)
                    found.append(Start(optics, float(scores[best])))
    found.sort(key=lambda start: -start.score)
    kept: list[Start] = []
    for start in found:
        if all(not _alike(start.optics, other.optics, half) for other in kept):
            kept.append(start)
        if len(kept) == STARTS:
            break
    return kept


def _nearness(peaks: F64, shape: tuple[int, int], reach: float) -> tuple[NDArray[np.float32], float]:
    """1 - distance / reach of the nearest peak on a coarse grid, rimmed by zeros, and the grid's step in pixels."""
    from scipy.spatial import cKDTree

    step = max(max(shape) / _TABLE, 1.0)
    rows, columns = (int(np.ceil(n / step)) for n in shape)
    place = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1) * step
    away, _ = cKDTree(peaks).query(place, distance_upper_bound=reach)
    return np.pad(np.clip(1 - away / reach, 0, 1).astype(np.float32), 1), step


def _index(place: F64, step: float, length: int) -> NDArray[np.int_]:
    return np.clip(np.rint(place / step).astype(int) + 1, 0, length - 1)


def _alike(one: Optics, other: Optics, half: float) -> bool:
    turn = (one.rotation_deg - other.rotation_deg + 180) % 360 - 180
    scale = one.lens.focal_px / other.lens.focal_px - 1
    apart = np.hypot(one.centre_row - other.centre_row, one.centre_column - other.centre_column) / half
    near = abs(turn) < _APART_ROTATION_DEG and abs(scale) < _APART_SCALE and apart < _APART_CENTRE
    return one.mirrored == other.mirrored and near
