"""Levels of a field that are far rougher than those around them: noise, and single values that stand out.

Weather is rough in cloud and smooth in clear air, but much the same from one level to the next. So what one level has
is compared with what four others have, and no roughness is too much by itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Of the highest spike of a level, in standard deviations of the level, beside the second highest of the four levels
# around it. Real files (ERA5, GFS, IFS, UM, WRF, LES; contents, temperature, pressure, heights) have up to 7 times as
# much: ice of ERA5 at its upper end. One damaged node among a thousand of a smooth level has 70.
_TIMES = 12.0
_SMOOTH = 0.02  # spikes under which a level is as smooth as any
_AROUND = (-2, -1, 1, 2)
_FILLED = 0.9  # of a level's nodes: where most hold nothing, every small cloud stands out
_EVEN = 1e-6  # of the mean, a spread that is rounding
_OF_ALL = 1e-4  # of the highest value of all levels, under which a spike may be the rounding of 16 bits
_NODES = 65_536  # of a level, of which as many rows are looked at; and of levels that are looked at together


def rough_levels(name: str, levels: NDArray[Any], roots: bool = False) -> list[str]:
    """A note on levels of a field (z, y, x) with nodes that stand out of their neighbours on all four sides.

    roots: of contents, few nodes of which hold most, square roots are compared.
    """
    if min(levels.shape[1:]) < 4:
        return []
    rows = np.arange(1, levels.shape[1] - 1, -(-levels[0].size // _NODES))
    least = _OF_ALL * max(float(levels.max()), -float(levels.min()))
    together = max(1, _NODES // (rows.size * levels.shape[2]))
    parts = (levels[k : k + together] for k in range(0, len(levels), together))
    spikes = np.concatenate([_spikes(part, rows, roots, least) for part in parts])
    known = np.isfinite(spikes)
    found = []
    for k in np.flatnonzero(known):
        around = sorted(spikes[k + n] for n in _AROUND if 0 <= k + n < len(levels) and known[k + n])
        if len(around) > 1 and spikes[k] > _TIMES * max(around[-2], _SMOOTH):
            found.append(k + 1)
    if not found:
        return []
    which = f"level {found[0]}" if len(found) == 1 else f"levels {', '.join(map(str, found[:6]))}"
    return [f"{name} of {which} has values that stand out of all around them, as no other level has: damaged?"]


def _spikes(levels: NDArray[Any], rows: NDArray[np.int64], roots: bool, least: float) -> NDArray[np.float64]:
    """How far a node of these inner rows of each level lies above, or below, the mean of its two neighbours both ways,
    at most, in the level's standard deviations; zero where that is less than `least`, NaN where many nodes hold
    nothing, or all the same."""
    below, value, above = (levels[:, rows + n].astype(np.float64) for n in (-1, 0, 1))
    filled = np.count_nonzero(value, axis=(1, 2)) >= _FILLED * value[0].size
    if roots:
        below, value, above = (np.sqrt(np.maximum(each, 0.0)) for each in (below, value, above))
    mean, spread = value.mean(axis=(1, 2)), value.std(axis=(1, 2))
    known = filled & (spread > _EVEN * np.abs(mean))
    inner = value[..., 1:-1]
    across = inner - 0.5 * (value[..., :-2] + value[..., 2:])
    along = inner - 0.5 * (below + above)[..., 1:-1]
    most = np.where(across * along > 0, np.minimum(np.abs(across), np.abs(along)), 0.0).max(axis=(1, 2))
    as_given = most * (most + 2 * mean) if roots else most
    spikes = np.where(as_given > least, most, 0.0) / np.where(known, spread, 1.0)
    return np.where(known, spikes, np.nan)
