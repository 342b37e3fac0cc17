"""Columns beside each other: where a value of the air stands out of what is above, below and beside it.

Damage to a file (a flipped bit, a block of noise) leaves means as they were, so means cannot tell it.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.scene.grid import Grid
from openswim.scene.plausibility.air import GAS_CONSTANT, GRAVITY, sampled

F64 = NDArray[np.float64]
_SAMPLES = 256  # columns each way
_THICK, _THICK_SHARE = 0.004, 0.04  # of ln p of a layer, beside its neighbours': vapour 2 %, inversions within it 2 %
_SPIKE = 0.004  # of ln p, to its neighbours on both sides: 4 hPa, where no balance with the wind is known
_SPIKE_PER_M = 6e-8  # f V/(R T): half the slope that a wind of 100 m/s keeps up
_OF_A_SLOPE = 0.1  # air between a valley and a peak is not that of either
_SPIKES, _SPIKES_SHARE = 4, 0.002  # of a level's nodes: the eye of a cyclone is one or two
_FAR_M = 1e5
_LOW_PA = 5000.0


def uneven_air(data: xr.Dataset, grid: Grid) -> list[str]:
    """Notes on layers that are thicker or thinner than their temperature makes them, and on pressure (z, y, x) that
    jumps up and down from node to node."""
    if "air_pressure" not in data or "air_temperature" not in data:
        return []
    shape = data["air_pressure"].shape
    height = grid.height_m if grid.height_m.ndim == 3 else np.broadcast_to(grid.height_m[:, None, None], shape)
    thick, warm, high = (sampled(each, _SAMPLES) for each in (
        np.maximum(data["air_pressure"].values, 1e-3), data["air_temperature"].values, height,
    ))  # fmt: skip
    notes = _layers(thick, warm, high)
    cell_m = max(grid.spacing_m())
    near = thick.shape == shape and cell_m < _FAR_M  # what is far from each other tells nothing of noise
    return notes + (_spikes(thick, warm, high, cell_m) if near else [])


def _layers(pressure: NDArray[np.float32], warm: NDArray[np.float32], height: NDArray[np.float32]) -> list[str]:
    odd, where = 0, 0
    for k in range(len(pressure) - 1):
        known = np.minimum(pressure[k + 1], pressure[k]) > _LOW_PA
        if not known.any():
            break
        fall = np.log(pressure[k].astype(np.float64) / pressure[k + 1])
        expected = GRAVITY * (height[k + 1] - height[k]) / (GAS_CONSTANT * 0.5 * (warm[k] + warm[k + 1]))
        apart = np.where(known, fall - expected, np.nan)
        off = np.abs(apart - np.nanmedian(apart)) > _THICK + _THICK_SHARE * np.abs(fall)
        if off.sum() > 0:
            where = where if odd else k
            odd += int(off.sum())
    if not odd:
        return []
    return [
        f"pressure, temperature and heights disagree between some levels (first {where + 1} and {where + 2}) in {odd} "
        "places, beside the others of these levels: a damaged field?"
    ]


def _spikes(pressure: NDArray[np.float32], warm: NDArray[np.float32], height: NDArray[np.float32], cell_m: float
            ) -> list[str]:  # fmt: skip
    """Pressure is compared at the same height."""
    allowed = _SPIKE + _SPIKE_PER_M * cell_m
    for k in range(len(pressure)):
        if float(pressure[k].min()) < _LOW_PA:
            break
        logarithm, found = np.log(pressure[k].astype(np.float64)), np.zeros(pressure[k].shape, bool)
        for axis in (0, 1):
            if logarithm.shape[axis] < 3:
                continue
            between = 0.5 * (np.delete(warm[k], 0, axis) + np.delete(warm[k], -1, axis))
            rise = GRAVITY * np.diff(height[k], axis=axis) / (GAS_CONSTANT * between)
            step = np.diff(logarithm, axis=axis) + rise
            excess = np.sign(step) * np.maximum(np.abs(step) - _OF_A_SLOPE * np.abs(rise) - allowed, 0.0)
            inner = (slice(None),) * axis + (slice(1, -1),)
            found[inner] |= np.delete(excess, -1, axis) * np.delete(excess, 0, axis) < 0
        if found.sum() > max(_SPIKES, _SPIKES_SHARE * found.size):
            return [f"air_pressure of level {k + 1} jumps up and down at {int(found.sum())} nodes: a damaged field?"]
    return []
