"""Whether a field lies in its message in the order that the scanning mode says: nodes beside their neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.grib.grid import GribGrid

_SMOOTHER = 1.5  # times, in another order: ground and temperature of GFS and HRRR 0.1 to 0.5, noise 1.0
_FEW, _MOST_NODES = 8, 8_000_000  # along an axis, and in all


def check_order(what: str, layout: GribGrid, values: NDArray[np.float32]) -> None:
    """UserError where a field, as it lies in its message, is much smoother from node to node in another order."""
    if layout.counts.size or values.size > _MOST_NODES or min(layout.mesh.shape) < _FEW:
        return
    known = np.nan_to_num(values)
    others = [
        replace(layout, columns_first=columns_first, alternating=alternating)
        for columns_first in (False, True)
        for alternating in (False, True)
    ]
    best = min(others, key=lambda other: _roughness(other, known))
    if _roughness(layout, known) > _SMOOTHER * _roughness(best, known):
        raise UserError(
            f"{what}: nodes are torn from their neighbours as the scanning mode lists them, but not with "
            f"jPointsAreConsecutive={best.columns_first:d} and alternativeRowScanning={best.alternating:d}: damaged: "
            "download the file again, or set these (grib_set)"
        )


def _roughness(layout: GribGrid, values: NDArray[np.float32]) -> float:
    """How far nodes are from the mean of their neighbours, along both axes; slopes count nothing."""
    field = layout.window(values, slice(None), slice(None))
    return float(sum(np.abs(np.diff(field, n=2, axis=axis)).mean(dtype=np.float64) for axis in (0, 1)))
