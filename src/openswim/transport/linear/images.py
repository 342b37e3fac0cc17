"""What the linear core observes, in the order of its eyes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Images:
    """radiance: of every view L' = 4 pi L/E_TOA, (w, rays) each; ghi: global irradiance over E_TOA, (w, points).

    Changes of both and residuals of an adjoint have the same form.
    """

    radiance: list[F64]
    ghi: F64

    def flat(self) -> F64:
        """All numbers in one row: view by view, then the irradiance."""
        return np.concatenate([*(np.ravel(one) for one in self.radiance), np.ravel(self.ghi)])

    def like(self, row: F64) -> Images:
        """The same form filled with the numbers of a row."""
        sizes = np.cumsum([one.size for one in self.radiance])
        *views, ghi = np.split(np.asarray(row, float), sizes)
        radiance = [part.reshape(one.shape) for part, one in zip(views, self.radiance, strict=True)]
        return Images(radiance, ghi.reshape(self.ghi.shape))
