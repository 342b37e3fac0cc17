"""What `reference` has summed of the paths of rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


class Sums:
    """Sums over the paths of rays."""

    def __init__(self, rays: int, wavelengths: int) -> None:
        self.total, self.squares = np.zeros((rays, wavelengths)), np.zeros((rays, wavelengths))
        self.paths = 0
        self.interrupted = False

    def add(self, total: F64, squares: F64, paths: int) -> None:
        """The sums of some more paths: all or nothing, since no interrupt comes between plain assignments."""
        total, squares, paths = self.total + total, self.squares + squares, self.paths + paths
        self.total, self.squares, self.paths = total, squares, paths

    @property
    def mean(self) -> F64:
        return self.total / max(self.paths, 1)

    @property
    def sigma(self) -> F64:
        """Standard error of the mean."""
        if self.paths < 2:
            return np.full(self.total.shape, np.inf)
        spread = np.maximum(self.squares / self.paths - self.mean**2, 0.0)
        return np.sqrt(spread / (self.paths - 1))

    @property
    def error(self) -> float:
        """Mean standard error over mean radiance."""
        whole = self.total.sum()
        return float(self.sigma.sum() * self.paths / whole) if whole > 0 else 0.0
