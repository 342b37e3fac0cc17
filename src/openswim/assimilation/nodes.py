"""From a scene's grid to the nodes of the linear core, linear between them, and back for gradients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Nodes:
    """Which levels of a scene each node lies between, and how finely its columns are divided.

    below (nz', ny, nx) or (nz', 1, 1): the scene's level under each of the core's; part: of the way to the next one;
    known: 0 where the core reaches beyond the scene's levels, else 1. fineness: nodes a column, along each axis.
    """

    shape: tuple[int, int, int]
    below: NDArray[np.int64]
    part: F64
    known: F64
    fineness: int

    @classmethod
    def between(cls, height_m: ArrayLike, shape: tuple[int, int, int], levels_m: ArrayLike,
                core_shape: tuple[int, int, int]) -> Nodes:  # fmt: skip
        """height_m (nz,) or (nz, ny, nx) of a scene of ``shape``; levels_m (nz',) of a core of ``core_shape``."""
        levels, heights = np.asarray(levels_m, float), np.asarray(height_m, float)
        fineness = max(1, (core_shape[2] - 1) // max(shape[2] - 1, 1))
        if (core_shape[0], core_shape[1], core_shape[2]) != (
            levels.size, fineness * (shape[1] - 1) + 1, fineness * (shape[2] - 1) + 1,
        ):  # fmt: skip
            raise UserError(f"a linear core of {core_shape} nodes fits no scene of {shape} (periodic, or nested?)")
        flat = heights.reshape(heights.shape[0], -1)
        each = [np.interp(levels, column, np.arange(column.size)) for column in flat.T]
        place = np.stack(each, axis=-1).reshape(levels.size, *(heights.shape[1:] or (1, 1)))
        below = np.clip(np.floor(place).astype(np.int64), 0, shape[0] - 2)
        edge = 1e-6 * (flat[-1] - flat[0])
        inside = (levels[:, None] >= flat[0] - edge) & (levels[:, None] <= flat[-1] + edge)
        return cls(shape, below, place - below, inside.reshape(place.shape).astype(float), fineness)

    def filled(self, field: F64) -> F64:
        """A field (nz, ny, nx) at the nodes."""
        low, high = (np.take_along_axis(field, self._whole(self.below + n), axis=0) for n in (0, 1))
        out = self.known * ((1 - self.part) * low + self.part * high)
        for axis in (1, 2):
            out = _divided(out, axis, self.fineness)
        return out

    def gathered(self, bar: F64) -> F64:
        """The transpose of `filled`."""
        for axis in (2, 1):
            bar = _undivided(bar, axis, self.fineness)
        out = np.zeros(self.shape)
        y, x = np.ogrid[: self.shape[1], : self.shape[2]]
        for n, weight in ((0, self.known * (1 - self.part)), (1, self.known * self.part)):
            np.add.at(out, (self._whole(self.below + n), y, x), weight * bar)
        return out

    def filled_ground(self, field: F64) -> F64:
        """A field (..., ny, nx) of the ground at the nodes' columns."""
        for axis in (-2, -1):
            field = _divided(field, axis, self.fineness)
        return field

    def gathered_ground(self, bar: F64) -> F64:
        """The transpose of `filled_ground`."""
        for axis in (-1, -2):
            bar = _undivided(bar, axis, self.fineness)
        return bar

    def _whole(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.broadcast_to(index, (index.shape[0], *self.shape[1:]))


def _divided(field: F64, axis: int, fineness: int) -> F64:
    """Linear between columns: ``fineness`` nodes each."""
    if fineness == 1:
        return field
    f = np.moveaxis(field, axis, -1)
    out = np.empty((*f.shape[:-1], fineness * (f.shape[-1] - 1) + 1))
    out[..., ::fineness] = f
    for n in range(1, fineness):
        part = n / fineness
        out[..., n::fineness] = (1 - part) * f[..., :-1] + part * f[..., 1:]
    return np.moveaxis(out, -1, axis)


def _undivided(bar: F64, axis: int, fineness: int) -> F64:
    """The transpose of `_divided`."""
    if fineness == 1:
        return bar
    b = np.moveaxis(bar, axis, -1)
    out = b[..., ::fineness].copy()
    for n in range(1, fineness):
        part, each = n / fineness, b[..., n::fineness]
        out[..., :-1] += (1 - part) * each
        out[..., 1:] += part * each
    return np.moveaxis(out, -1, axis)
