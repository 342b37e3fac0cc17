"""The light of one grid, or of clear air, once it is solved: it has no eye, and nobody changes it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from openswim.optics.matter import Air
from openswim.options import Options
from openswim.scene.frame import Frame
from openswim.transport.air.dimmed import Eclipse
from openswim.transport.beam.lit_volume import Channels
from openswim.transport.columns.columns import Columns
from openswim.transport.columns.discrete_ordinates import Layers
from openswim.transport.diffuse.moments import Coarser, Moments
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.ordinates import harmonic_matrix
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.ground_light.landscape import Landscape
from openswim.transport.march.volume import DEGREE, Shells, Volume
from openswim.transport.medium.core import Core
from openswim.transport.medium.delta_scaled import Coefficients
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.surface import Surface

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_Made = TypeVar("_Made")

CLEAR_REACH_DEG = 14.0  # from the ground to the horizon of an eye 14 km up, and through the air beyond
CLEAR_STEP = 0.5  # where there is but air, views are cheap and haze may be stepped finely


class Once:
    """What follows from solved light and is worked out when it is first wanted, by the thread that is first."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}
        self._last: dict[str, tuple[Any, Any]] = {}
        self._lock = threading.RLock()

    def __reduce__(self) -> tuple[type[Once], tuple[()]]:
        """A copy, or what is sent to another process, works it out again: locks stay where they are."""
        return Once, ()

    def __call__(self, name: str, make: Callable[[], _Made]) -> _Made:
        with self._lock:
            if name not in self._made:
                self._made[name] = make()
            found: _Made = self._made[name]
            return found

    def last(self, name: str, key: Any, make: Callable[[], _Made]) -> _Made:
        """The same where it differs by ``key``: that of the last one is kept, as for eyes along a path."""
        with self._lock:
            if name not in self._last or self._last[name][0] != key:
                self._last[name] = key, make()
            found: _Made = self._last[name][1]
            return found


@dataclass(frozen=True, eq=False)
class GridLight:
    """What a grid's nodes know of the light: per wavelength (PACK) the coefficients, the beam and the moments.

    beams (nz, ny, nx): delta-scaled transmission from the sun; shadow_m, ridge_m (ny, nx): see `Beams`; local_sun
    (ny, nx, 3): direction to the sun in the columns' axes. moments and coarser, or columns, or layers: the diffuse
    light, however it was solved; none with "swim".
    """

    medium: Medium
    beams: list[F32]
    shadow_m: F64
    ridge_m: F64
    coefficients: list[Coefficients]
    local_sun: F64
    sun: F64
    count: int
    moments: list[Moments] | None = None
    coarser: list[Coarser] = field(default_factory=list)
    ratios: list[F32 | None] = field(default_factory=list)  # of the light scattered around the nodes to `moments`
    layers: list[Layers] | None = None
    columns: Columns | None = None

    @property
    def sun_harmonics(self) -> F32:
        """Harmonics (M^2, ny, nx) of the direction to the sun in every column's axes."""
        harmonics = harmonic_matrix(self.local_sun.reshape(-1, 3), DEGREE).T
        return np.ascontiguousarray(harmonics.reshape(-1, *self.local_sun.shape[:2]), FLOAT)


@dataclass(frozen=True, eq=False)
class LitGrid:
    """Solved light at up to PACK wavelengths (``count`` of them asked for, the rest padding).

    volume: that which rays march through, but for its ``channels`` and sources, which a viewer puts in. reach_deg: how
    far round the Earth the shells' diffuse field is solved. wider: the light of a wider grid, seen beyond the ``core``
    of this one. sweeps: of each wavelength, from the coarsest grid on. timings: seconds of each stage.
    """

    options: Options
    surface: Surface
    air: Air | None
    frame: Frame
    sun: F64
    wavelengths_nm: F64
    count: int
    shells: Shells
    volume: Volume
    table: F32
    lighting: Lighting
    medium: Medium | None = None
    light: GridLight | None = None
    channels: Channels | None = None
    reach_deg: float = CLEAR_REACH_DEG
    landscape: Landscape | None = None
    wider: LitGrid | None = None
    core: Core | None = None
    ends: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((2, 2), bool))  # see `OpticalGrid`
    sweeps: list[list[int]] = field(default_factory=list)
    timings: dict[str, float] = field(default_factory=dict)
    eclipse: Eclipse | None = None  # where the moon's shadow is on it
    once: Once = field(default_factory=Once, repr=False)
    decide: Decisions = field(default_factory=Decisions, repr=False)  # for all eyes

    @property
    def quality(self) -> str:
        """How finely the diffuse light is solved; "columns" where each is by itself."""
        return "columns" if self.light is not None and self.light.columns is not None else self.options.quality

    @property
    def levels(self) -> list[LitGrid]:
        """This light and that of the wider grids around it."""
        return [self] if self.wider is None else [self, *self.wider.levels]

    @property
    def swept(self) -> bool:
        """Whether its diffuse light was swept through the grid."""
        return self.light is not None and bool(self.light.moments)
