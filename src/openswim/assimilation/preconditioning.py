"""A change of variables that makes a cost rounder: cosines, each scaled by how much the observations say of it.

The Hessian of the cost is 1 + S^T J^T R^-1 J S. In cosines along the axes of a field it is nearly diagonal, large for
wide patterns and 1 for those that S smooths away. Its diagonal follows from a few adjoints: for z of random signs,
E (C S^T J^T R^-1/2 z)^2 (Hutchinson). The quarter power goes half of the way, in logarithms, from the background's own
scaling to one in which all curvatures are alike. On nine cameras over cumulus 50 steps then come as far as 110 without
it (docs/assimilation.md); all of the way fits noise first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn
from scipy.ndimage import gaussian_filter

from openswim.assimilation.background import Piece
from openswim.assimilation.cost import Cost

F64 = NDArray[np.float64]

PROBES = 6
POWER = 0.25
_LOOSELY = 30.0  # times the light's tolerance: probes of random signs tell their mean square roughly anyway


@dataclass(frozen=True, eq=False)
class Cosines:
    """v = origin + C^T (scale u)."""

    origin: F64
    pieces: list[Piece]
    scales: list[F64]

    def v(self, u: F64) -> F64:
        return self.origin + self.change(u)

    def change(self, u: F64) -> F64:
        out = np.empty(u.size)
        for p, scale in zip(self.pieces, self.scales, strict=True):
            out[p.here] = _back(scale * u[p.here].reshape(scale.shape)).ravel()
        return out

    def gradient(self, bar: F64) -> F64:
        """By u, of one by v."""
        out = np.empty(bar.size)
        for p, scale in zip(self.pieces, self.scales, strict=True):
            out[p.here] = (scale * in_cosines(bar[p.here].reshape(scale.shape))).ravel()
        return out


def cosines_of(cost: Cost, v: F64, probes: int = PROBES, seed: int = 0) -> Cosines:
    """About a v; without probes nothing is scaled."""
    pieces = cost.space.pieces
    squares = [np.zeros(p.mask.shape) for p in pieces]
    if probes:
        rng, lin = np.random.default_rng(seed), cost.linearized(v)
        for _ in range(probes):
            signs = rng.choice([-1.0, 1.0], cost.weight.size)
            row = cost.space.adjoint(v, lin.vjp(cost.weight * signs, _LOOSELY))
            for square, p in zip(squares, pieces, strict=True):
                square += in_cosines(row[p.here].reshape(square.shape)) ** 2 / probes
    smooth = [gaussian_filter(each, 1.0, mode="nearest") if each.ndim else each for each in squares]
    return Cosines(v, pieces, [(1 + each) ** -POWER for each in smooth])


def in_cosines(field: F64) -> F64:
    """A field by its cosines along all axes."""
    return np.asarray(dctn(field, norm="ortho")) if field.ndim else field


def _back(field: F64) -> F64:
    return np.asarray(idctn(field, norm="ortho")) if field.ndim else field
