"""A model's surface fields at any place: between its nodes, across gaps, and a little beyond its edge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.scene.interpolation import at_wavelengths, corners

if TYPE_CHECKING:
    import xarray as xr

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def bilinear(values: FloatArray, ix: FloatArray, iy: FloatArray, valid: BoolArray | None = None) -> FloatArray:
    """(ny, nx[, k]) at fractional indices, the edge holding beyond; only among `valid` nodes where there are any."""
    ny, nx = values.shape[:2]
    row, column, weights = corners(ix, iy, (ny, nx))
    nodes = row * nx + column
    if valid is not None:
        kept = weights * valid.ravel()[nodes]
        weights = np.where(kept.sum(axis=0) > 1e-6, kept, weights)
        weights = weights / weights.sum(axis=0)
    trailing = values.shape[2:]
    rows = values.reshape(ny * nx, *trailing)
    out = np.zeros(np.shape(ix) + trailing)
    for node, weight in zip(nodes, weights, strict=True):
        out += rows.take(node, axis=0) * weight.reshape(weight.shape + (1,) * len(trailing))
    return out


def blurred(values: FloatArray) -> FloatArray:
    """(ny, nx) smoothed by a binomial of 2 cells' standard deviation; the edge holds beyond."""
    from scipy.ndimage import correlate1d

    for axis in (0, 1):
        for _ in range(4):
            values = correlate1d(values, np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16, axis, mode="nearest")
    return values


class Filled:
    """A field (ny, nx[, k]) known at `valid` nodes, for any place.

    Where no valid node is next to it, and away from the grid, means over 2, 4, 8, ... cells stand in, so that nothing
    of a single cell is drawn out into a streak.
    """

    def __init__(self, values: FloatArray, valid: BoolArray, levels: int = 4) -> None:
        weight = valid.astype(float)
        total = values * _spread(weight, values.ndim)
        self.levels = [(weight, total)]
        while len(self.levels) <= levels and min(weight.shape) >= 4:
            weight, total = _halved(weight), _halved(total)
            self.levels.append((weight, total))

    @classmethod
    def among(cls, values: FloatArray, valid: BoolArray) -> Filled | None:
        """None where no node is valid."""
        return cls(values, valid) if valid.any() else None

    @property
    def mean(self) -> FloatArray:
        """Over all valid nodes (k)."""
        weight, total = self.levels[0]
        return np.asarray(total.sum(axis=(0, 1)) / weight.sum())

    def at(self, ix: FloatArray, iy: FloatArray, away: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values (n[, k]) at fractional indices `away` cells from the grid, and whether any were near (n,), 0 to 1."""
        out = np.zeros(ix.shape + self.levels[0][1].shape[2:])
        known = np.zeros(ix.shape)
        for n, (weight, total) in enumerate(self.levels):
            left = np.flatnonzero(known < 1)
            if left.size == 0:
                break
            x, y = (ix[left] + 0.5) / (1 << n) - 0.5, (iy[left] + 0.5) / (1 << n) - 0.5
            w = bilinear(weight, x, y)
            v = bilinear(total, x, y) / _spread(np.maximum(w, 1e-9), out.ndim)
            last = n == len(self.levels) - 1
            fits = 1.0 if last else np.clip(1.5 - away[left] / (1 << n), 0.0, 1.0)
            share = (1 - known[left]) * fits * np.clip(4 * w, 0.0, 1.0)
            out[left] += _spread(share, out.ndim) * v
            known[left] += share
        return out / _spread(np.maximum(known, 1e-9), out.ndim), known


def spectral(field: xr.DataArray, wavelengths_nm: FloatArray) -> FloatArray:
    """(..., nwl): interpolated where the field has wavelengths, repeated where it has not."""
    if "wavelength" not in field.dims:
        return np.repeat(np.asarray(field.values, float)[..., None], wavelengths_nm.size, axis=-1)
    field = field.transpose(..., "wavelength")
    known = np.asarray(field["wavelength"].values, float)
    return at_wavelengths(known, np.asarray(field.values, float), wavelengths_nm)


def _spread(values: FloatArray, ndim: int) -> FloatArray:
    """With as many axes as `ndim`, the new ones last."""
    return values.reshape(values.shape + (1,) * (ndim - values.ndim))


def _halved(values: FloatArray) -> FloatArray:
    """Means of 2 x 2 nodes; an odd last row or column counts twice."""
    ny, nx = values.shape[:2]
    even = np.pad(values, ((0, ny % 2), (0, nx % 2)) + ((0, 0),) * (values.ndim - 2), mode="edge")
    return 0.25 * (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2])
