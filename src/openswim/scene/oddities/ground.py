"""Ground that cannot be: it jumps up and down, or leaves the levels that follow it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

_STEP_M, _STEP_PER_M = 1200.0, 0.05  # of ground to both neighbours, and of that per metre between them
_FAR_M = 1e5  # between nodes, over which any ground may lie
_STEPS, _STEPS_SHARE = 4, 0.002
_FOLLOWED, _HILLS_M = 0.1, 20.0  # spread of the lowest level's height above ground, of the ground's; and that at least
# From the median height of the lowest level above ground, also in median deviations from it. Where levels follow the
# ground (IFS, RAMS, UM, WRF) no node is over 2 m off
_LOOSE_M, _LOOSE_TIMES = 15.0, 20.0
_LOOSE_SHARE = 0.3  # of nodes: where more are, levels do not follow


def rough_ground(height_m: F32, cell_m: float) -> list[str]:
    """Ground (y, x) that is far above, or far below, both of its neighbours in a row."""
    if cell_m >= _FAR_M:
        return []
    allowed = _STEP_M + _STEP_PER_M * cell_m
    found = np.zeros(height_m.shape, bool)
    for axis in (0, 1):
        if height_m.shape[axis] < 3:
            continue
        step = np.diff(height_m.astype(np.float64), axis=axis)
        excess = np.sign(step) * np.maximum(np.abs(step) - allowed, 0.0)
        inner = (slice(None),) * axis + (slice(1, -1),)
        found[inner] |= np.delete(excess, -1, axis) * np.delete(excess, 0, axis) < 0
    count = int(found.sum())
    if count <= max(_STEPS, _STEPS_SHARE * found.size):
        return []
    return [f"surface_altitude jumps up and down by over {allowed:.0f} m at {count} nodes: a damaged field?"]


def loose_ground(height_m: F32, lowest_m: NDArray[Any]) -> list[str]:
    """Ground (y, x) that is not where the lowest level (y, x) says, which follows it elsewhere."""
    above = lowest_m.astype(np.float64) - height_m
    off = np.abs(above - np.median(above))
    loose = off > _LOOSE_M + _LOOSE_TIMES * np.median(off)
    count = int(loose.sum())
    if not 0 < count < _LOOSE_SHARE * loose.size:
        return []
    hills_m = float(height_m[~loose].std())
    if hills_m < _HILLS_M or above[~loose].std() > _FOLLOWED * hills_m:
        return []
    return [
        f"surface_altitude is up to {off.max():.0f} m off at {count} nodes, by the levels that follow it elsewhere: "
        "damaged?"
    ]
