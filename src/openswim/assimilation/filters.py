"""Smoothing along axes: the square root of a background's correlations, and its transpose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d

F64 = NDArray[np.float64]

_UNEVEN = 1e-3  # of a step, by which places on an even axis may be off
_FARTHEST = 100.0  # times an axis: from there on all of it is alike, and a Gaussian only has more nodes to go through
_STEPS = 2  # of implicit diffusion in the square root, four in all


@dataclass(frozen=True, eq=False)
class Axis:
    """The filter along one axis: a Gaussian of ``width`` nodes on an even one, else a matrix (n, n).

    norm (n,): root of the sum of squares of each row, by which one divides for a variance of one.
    """

    width: float
    matrix: F64 | None
    norm: F64

    def apply(self, field: F64, axis: int) -> F64:
        return self._along(field, axis, self.matrix)

    def transpose(self, field: F64, axis: int) -> F64:
        return self._along(field, axis, None if self.matrix is None else self.matrix.T)

    def _along(self, field: F64, axis: int, matrix: F64 | None) -> F64:
        if matrix is not None:
            return np.moveaxis(np.tensordot(matrix, field, axes=(1, axis)), 0, axis)
        return gaussian_filter1d(field, self.width, axis=axis, mode="constant")


def axis_filter(place_m: ArrayLike, length_m: float, kind: str) -> Axis:
    """The filter along nodes at places (n,), m, whose square has correlations of a length: exp(-d^2/2 L^2) of
    "gaussian", and of "diffusion" implicit steps of it, with the same curvature at 0 and longer tails."""
    place = np.asarray(place_m, float)
    step = np.diff(place)
    length_m = min(length_m, _FARTHEST * float(np.ptp(place)) if place.size > 1 else length_m)
    if place.size == 1 or length_m < 0.1 * step.min():
        return Axis(0.0, np.eye(place.size), np.ones(place.size))
    if kind == "gaussian" and np.abs(step - step.mean()).max() <= _UNEVEN * step.mean():
        width = length_m / np.sqrt(2) / float(step.mean())
        rows = gaussian_filter1d(np.eye(place.size), width, axis=0, mode="constant")
        return Axis(width, None, np.sqrt((rows**2).sum(axis=1)))
    weight = np.empty(place.size)
    weight[[0, -1]] = 0.5 * step[[0, -1]]
    weight[1:-1] = 0.5 * (step[1:] + step[:-1])
    if kind == "gaussian":
        matrix = np.exp(-((place[:, None] - place) ** 2) / length_m**2) * np.sqrt(weight)
    else:
        matrix = _diffusion(step, weight, length_m)
    return Axis(0.0, matrix, np.sqrt((matrix**2).sum(axis=1)))


def _diffusion(step: F64, weight: F64, length_m: float) -> F64:
    """Implicit steps of diffusion between nodes, by finite volumes, no flux at the ends."""
    n = weight.size
    flux = np.zeros((n, n))
    # so that the curvature at 0 is the Gaussian's (Weaver & Mirouze 2013)
    conductance = length_m**2 / (4 * _STEPS - 3) / step
    between = np.arange(n - 1)
    np.add.at(flux, (between, between), conductance)
    np.add.at(flux, (between + 1, between + 1), conductance)
    flux[between, between + 1] -= conductance
    flux[between + 1, between] -= conductance
    once = np.linalg.inv(np.diag(weight) + flux) * weight
    return np.linalg.matrix_power(once, _STEPS) / np.sqrt(weight)


@dataclass(frozen=True, eq=False)
class Filter:
    """S, of unit variance everywhere: S S^T is the correlation of a field. axes: of its last dimensions."""

    axes: tuple[Axis, ...]

    @classmethod
    def of(cls, places_m: Sequence[ArrayLike], lengths_m: Sequence[float], kind: str) -> Filter:
        return cls(tuple(axis_filter(p, length, kind) for p, length in zip(places_m, lengths_m, strict=True)))

    @cached_property
    def norm(self) -> F64:
        out = np.ones(())
        for axis in self.axes:
            out = np.multiply.outer(out, axis.norm)
        return out

    def apply(self, field: F64) -> F64:
        for n, axis in enumerate(self.axes):
            field = axis.apply(field, field.ndim - len(self.axes) + n)
        return field / self.norm

    def transpose(self, field: F64) -> F64:
        field = field / self.norm
        for n, axis in enumerate(self.axes):
            field = axis.transpose(field, field.ndim - len(self.axes) + n)
        return field
