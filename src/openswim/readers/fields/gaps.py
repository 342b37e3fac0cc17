"""What a file leaves out at the bottom of its columns: below the ground, or else it is a loss.

Models on levels of pressure or height leave out what lies below the terrain. Such gaps are filled; the same gap above
the ground is refused, since no cloud there would be a wrong picture.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.fields.air import filled_from_above

F32 = NDArray[np.float32]
_SLACK_M = 20.0  # and half a layer: terrain of another resolution


class Gaps:
    """The gaps that were filled, by variable, until the ground is known that must explain them."""

    def __init__(self) -> None:
        self._state: dict[str, NDArray[np.bool_] | None] = {}
        self._cloud: dict[str, NDArray[np.bool_] | None] = {}

    def state(self, name: str, values: F32) -> F32:
        """Levels (nz, ny, nx) upward; gaps at the bottom of columns take the value above them, others stay NaN."""
        self._state[name] = low = _at_the_bottom(values)
        return values if low is None else np.where(low, filled_from_above(values), values)

    def cloud(self, name: str, values: F32) -> F32:
        """The same, of what clouds are made of: none in the gaps."""
        self._cloud[name] = low = _at_the_bottom(values)
        return values if low is None else np.where(low, np.float32(0), values)

    def check(self, path: Path, height_m: NDArray[Any], terrain_m: F32 | None, notes: list[str]) -> None:
        """One note where all gaps lie below the ground; UserError where some do not.

        Without terrain, ground is what all variables leave out: one that is alone in it has lost values.
        """
        every = self._state | self._cloud
        if all(gap is None for gap in every.values()):
            return
        height = height_m if height_m.ndim == 3 else height_m[:, None, None]
        below = self._in_common(every) if terrain_m is None else _below(height, terrain_m)
        for name, gap in every.items():
            if gap is None:
                continue
            lost = int((gap & ~below).sum())
            if lost:
                where = "above the ground" if terrain_m is not None else "where other variables have values"
                raise UserError(
                    f"{path}: {name} has {lost} missing values (NaN or fill) of {gap.size} {where}: fill them, or "
                    "crop the file to where it has data"
                )
        most = max(int(gap.sum()) for gap in every.values() if gap is not None)
        said = "" if terrain_m is not None else ", which the file has no height of: taken for ground"
        notes.append(f"up to {most} values of {height.shape[0]} levels are missing below the terrain{said}")

    def _in_common(self, every: dict[str, NDArray[np.bool_] | None]) -> NDArray[np.bool_]:
        """Gaps of all that clouds are made of; of one variable alone only where the state of the air has them too."""
        clouds = list(self._cloud.values())
        shared: list[NDArray[np.bool_] | None] = [gap for gap in self._state.values() if gap is not None]
        if len(clouds) < 2:
            clouds += shared or [None]
        size = next(gap.shape for gap in every.values() if gap is not None)
        common = np.ones(size, bool)
        for gap in clouds:
            common &= False if gap is None else gap
        return common


def _at_the_bottom(values: F32) -> NDArray[np.bool_] | None:
    """Gaps (NaN) that reach down to the lowest level, but not those of whole columns; None where there are none."""
    gaps = np.isnan(values)
    if not gaps.any():
        return None
    low = np.logical_and.accumulate(gaps, axis=0)
    low &= ~low[-1]
    return low if low.any() else None


def _below(height_m: NDArray[Any], terrain_m: F32) -> NDArray[np.bool_]:
    thick = np.diff(height_m, axis=0, append=height_m[-1:])
    return np.asarray(height_m - 0.5 * thick - _SLACK_M < terrain_m)
