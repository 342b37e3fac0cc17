"""What an operator asks of the transport below it (`openswim.transport.linear`); a test may give a plainer one."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from openswim.transport.linear.images import Images

__all__ = ["Core", "Images"]

F64 = NDArray[np.float64]


class Drawn(Protocol):
    """From the scene's grid to the core's nodes, a linear map."""

    def to_nodes(self, field: F64) -> F64:
        """Fields (..., nz, ny, nx) of the scene at the nodes (..., nz', ny, nx)."""
        ...

    def from_nodes(self, bar: F64) -> F64:
        """The transpose."""
        ...


@runtime_checkable
class Core(Protocol):
    """Linear light of one scene; all but extinction and albedo is held fixed.

    names: of the classes (k,) of what scatters. extinction (w, k, nz, ny, nx), 1/m, and albedo (w, ny, nx): of the
    scene that it was made from. tolerance: to which its light is solved, where nothing else is asked for.
    """

    @property
    def tolerance(self) -> float: ...

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def shape(self) -> tuple[int, int, int]: ...

    @property
    def drawn(self) -> Drawn: ...

    @property
    def extinction(self) -> NDArray[Any]: ...

    @property
    def albedo(self) -> NDArray[Any]: ...

    def forward(self, extinction: F64, albedo: F64, start: Any = None) -> tuple[Images, Any]:
        """What is seen, and a state for the two below, each by itself; start: a state that is near."""
        ...

    def tangent(self, state: Any, d_extinction: F64, d_albedo: F64 | None, tolerance: float | None = None) -> Images:
        """J v."""
        ...

    def adjoint(self, state: Any, residual: Images, tolerance: float | None = None) -> tuple[F64, F64]:
        """J^T r: bars of extinction and albedo."""
        ...
