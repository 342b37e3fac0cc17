"""Keogram: one line of every picture of a film, side by side in time."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

WIDEST = 4000  # columns



def keogram(lines: Iterable[NDArray[np.uint8]], width: int | None = None) -> NDArray[np.uint8]:
    """Lines (y, 3) of consecutive pictures as a picture (y, width, 3); each is repeated to fill the width."""
    stacked = np.stack(list(lines), axis=1)
    count = stacked.shape[1]
    columns = min(max(count, stacked.shape[0]) if width is None else width, WIDEST)
    at = np.minimum((np.arange(columns) + 0.5) * count / columns, count - 1).astype(int)
    return stacked[:, at]
