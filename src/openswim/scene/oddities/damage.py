"""Where damage to a file shows in one field: a level that is like neither of its neighbours, rougher than all around it
or empty between full ones, many nodes at the highest or lowest value, ground that jumps up and down.

Damaged bytes of a packed field (GRIB) are read as any other values within its range, so ranges cannot tell them.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.scene.oddities.ground import loose_ground, rough_ground
from openswim.scene.oddities.roughness import rough_levels

F32 = NDArray[np.float32]

_ENDS = ("_content", "_effective_radius", "_number", "_area_fraction")
_SAMPLES = 256  # columns each way
_FEW_NODES, _FEW_HELD = 100, 30  # of a level, and with something in them: fewer correlate by chance
# Correlation of the levels below and above, less that of the one between with either: by weather up to 0.24, since what
# is between is like what is around
_UNLIKE = 0.35
_FULL = 0.5  # of the nodes hold something; between two decks of cloud there are several levels without, as a rule
_FALLING = ("rain", "snow", "graupel")
_FEW_COPIES, _VARIED = 0.05, 0.1  # of all levels, and of a level's nodes that values are to be as many as
_HIGHEST, _HIGHEST_SHARE = 16, 0.01  # nodes of one level that share its highest value ...
_VALUES = 16  # ... beside at least so many others ...
_OFTEN = 4.0  # ... and so many times as often as those are, in the mean
_NEXT_TO_NOTHING = 0.01  # of the highest value
_WITHOUT_A_FLOOR = ("_content", "height", "pressure", "temperature")  # sizes and numbers have one in many models


def damaged_fields(data: xr.Dataset, cell_m: float, height_m: NDArray[Any]) -> list[str]:
    """Notes on contents, sizes, fractions and extinctions on levels (z, y, x), and on the ground's height (y, x).

    height_m: of the levels, (z, y, x) or (z,).
    """
    notes = rough_levels("the height", height_m) if height_m.ndim == 3 else []
    for name, field in data.data_vars.items():
        on_levels = field.dims[:1] == ("z",) and field.ndim == 3
        if on_levels and ("extinction" in str(name) or str(name).endswith(_ENDS)):
            every = tuple(slice(None, None, max(1, size // _SAMPLES)) for size in field.shape[1:])
            columns = field.values[(slice(None), *every)].reshape(field.shape[0], -1)
            if columns.shape[1] >= _FEW_NODES:
                notes += _unlike(str(name), columns)
            notes += rough_levels(str(name), field.values, roots=True)
            notes += _lost(str(name), columns)
        elif on_levels and name in ("air_pressure", "air_temperature"):
            notes += rough_levels(str(name), field.values)
    if "surface_altitude" in data:
        terrain = data["surface_altitude"].values
        notes += rough_ground(terrain, cell_m) + (loose_ground(terrain, height_m[0]) if height_m.ndim == 3 else [])
    return notes


def _unlike(name: str, columns: F32) -> list[str]:
    """Levels (z, n) between two that are alike; by square roots, since few nodes hold most of the water."""
    held = np.sqrt(np.maximum(columns, 0.0, dtype=np.float32))
    away = held - held.mean(axis=1, keepdims=True)
    spread = np.sqrt((away**2).mean(axis=1))
    known = ((columns > 0).sum(axis=1) > _FEW_HELD) & (spread > 0)
    away /= np.where(known, spread, 1.0)[:, None]
    for k in range(1, len(away) - 1):
        if not known[k - 1 : k + 2].all():
            continue
        below, across, above = ((away[i] * away[j]).mean() for i, j in ((k - 1, k), (k - 1, k + 1), (k, k + 1)))
        if across - max(abs(below), abs(above)) > _UNLIKE:
            return [f"{name} of level {k + 1} is unlike those below and above, which are alike: a damaged field?"]
    return []


def _lost(name: str, columns: F32) -> list[str]:
    """Levels (z, n) that hold nothing, between two that are full of it; the lowest one, of what falls to the ground."""
    if columns.shape[1] < _FEW_HELD:
        return []
    full = (columns > 0).mean(axis=1)
    around = np.concatenate([full[1:2] if name.startswith(_FALLING) else [0.0], full, [0.0]])
    lost = np.flatnonzero((full == 0) & (np.minimum(around[:-2], around[2:]) > _FULL)) + 1
    if not lost.size:
        return []
    levels = f"level{'s' * (lost.size > 1)} {', '.join(map(str, lost[:12]))}"
    return [f"{name} holds nothing on {levels}, though what is next to it is full of it: lost?"]


def copied_levels(name: str, levels: F32) -> list[str]:
    """A note on a level (z, y, x) that holds, as read, the many values of another to the last bit. Where more than a
    few do, the field was made so."""
    rows: dict[bytes, list[int]] = {}  # a row tells most levels from each other
    for k, level in enumerate(levels):
        rows.setdefault(level[len(level) // 2].tobytes(), []).append(k)
    copied = [
        f"{j + 1} and {k + 1}"
        for alike in rows.values()
        for j, k in pairwise(alike)
        if np.array_equal(levels[j], levels[k])
        and np.unique(levels[k]).size > max(_VALUES, _VARIED * np.count_nonzero(levels[k]))
    ]
    if not 0 < len(copied) <= max(1, _FEW_COPIES * len(levels)):
        return []
    return [f"{name} of levels {', '.join(copied)} is the same to the last bit: copied?"]


def held_values(name: str, levels: F32) -> list[str]:
    """A note on a level (z, y, x) many of whose nodes hold the highest, or the lowest, of many values, as read: bits
    that are all set, or none, or a cut. NaN is no value; zero is no lowest one, nor what is next to it."""
    for k, level in enumerate(levels):
        high, low = np.fmax.reduce(level, axis=None), np.fmin.reduce(level, axis=None)
        ends = [("highest", high)] if high > 0 else []
        if name.endswith(_WITHOUT_A_FLOOR) and low > _NEXT_TO_NOTHING * high:
            ends.append(("lowest", low))
        for end, value in ends:
            count = int((level == value).sum())
            if count > max(_HIGHEST, _HIGHEST_SHARE * level.size):
                values = np.unique(level[level > 0]).size
                if values > _VALUES and count > _OFTEN * level.size / values:
                    held = f"its {end} value, {value:.3g}, {count} times"
                    where = f" of level {k + 1}" if len(levels) > 1 else ""
                    return [f"{name}{where} holds {held}: cut, or damaged?"]
    return []
