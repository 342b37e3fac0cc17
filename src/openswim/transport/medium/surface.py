"""What transport asks of the ground: `openswim.ground.surface` answers for a scene, a test may for a plain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground.footprints import LongFootprints
from openswim.ground.sample import SurfaceSample
from openswim.scene.frame import Frame

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class Surface(Protocol):
    """The ground at wavelengths (nwl,). Places (n,) are in degrees, in flat scenes y and x in metres."""

    @property
    def wider(self) -> Surface | None:
        """That of the wider grid around this one's."""
        ...

    def at_wavelengths(self, which: NDArray[np.int64]) -> Surface:
        """The same at some of the wavelengths, each as often as it is named."""
        ...

    def window(self, rows: slice, columns: slice) -> Surface:
        """What is known in some rows and columns of the grid."""
        ...

    def sample(
        self, lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike = ..., detail: bool = ...,
        long: LongFootprints | None = ...,
    ) -> SurfaceSample:  # fmt: skip
        """What it is made of; ``footprint_m``: of a pixel; ``detail``: finer than is known (docs/decisions/0020);
        ``long``: what pixels cover of maps that they look along."""
        ...

    @property
    def pictured(self) -> bool:
        """Whether there are maps of its colour, finer than footprints may be long."""
        ...

    def albedo(self, lat: ArrayLike, lon: ArrayLike) -> F64:
        """Hemispherical albedo (n, nwl)."""
        ...

    def shining(
        self, lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike = ..., detail: bool = ...
    ) -> F64 | None:
        """What it shines with itself, L' (n, nwl) as seen from above; None where it is dark. detail: see `sample`."""
        ...

    @property
    def terrain_m(self) -> F32:
        """Height (ny, nx) at the grid's nodes; (1, 1) where there is no grid."""
        ...

    def finer_terrain_m(self, terrain_m: F32, fineness: int) -> F32:
        """Heights (ny', nx') on cells divided by ``fineness`` with what elevation models know put in."""
        ...

    @property
    def mapped(self) -> bool:
        """Whether there are elevation models, finer than the grid."""
        ...

    @property
    def map_outlines(self) -> list[tuple[float, F64, F64]]:
        """Of each elevation model its pixel (m), latitudes and longitudes around it; the coarsest first."""
        ...

    def mapped_m(
        self, lat: F64, lon: F64, footprint_m: F64, between: Callable[[F64], F64] | None = ...
    ) -> tuple[F64, F64]:
        """Heights (n,) by elevation models, and the share (n,) that they know; ``between``: see `Lattice`."""
        ...

    def mapped_normals(self, frame: Frame, place: F64, up: F64, footprint_m: F64) -> tuple[F64, F64]:
        """Their normals (n, 3) at places (n, 3) in the frame, and the share (n,) that is known."""
        ...

    @property
    def mountains(self) -> bool:
        """Whether the Earth's mountains are to stand beyond the grid's terrain."""
        ...

    @property
    def earth_known(self) -> bool:
        """Whether the height of all the Earth is known, and wanted."""
        ...

    def earth_m(self, lat: F64, lon: F64) -> F64:
        """That height (n,)."""
        ...

    def sea(self, lat: F64, lon: F64) -> NDArray[np.bool_]:
        """Whether the sea is there (n,)."""
        ...
