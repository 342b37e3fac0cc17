"""Memory that is needed again and again: a page that was never touched costs more than all that is reckoned in it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]


class Pool:
    """Named scratch arrays, one user of a name at a time."""

    def __init__(self) -> None:
        self._buffers: dict[str, F32] = {}

    def take(self, name: str, *shape: int) -> F32:
        """An array of the shape with whatever (finite) its last user left in it."""
        size = math.prod(shape)
        if name not in self._buffers or self._buffers[name].size < size:
            self._buffers[name] = np.zeros(size, FLOAT)
        return self._buffers[name][:size].reshape(shape)
