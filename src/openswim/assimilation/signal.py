"""What observations tell, and what they do not: degrees of freedom for signal (Rodgers 2000, Eq. 2.80).

Of the Hessian 1 + A they are tr A (1 + A)^-1: how many independent numbers are told by the observations rather than by
the background. The trace is that of vectors z of random signs (Hutchinson), A (1 + A)^-1 z by Lanczos's steps. In
cosines along the axes a part of the trace is that of the patterns which are the same at all heights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.assimilation.cost import Cost
from openswim.assimilation.preconditioning import in_cosines

F64 = NDArray[np.float64]

STEPS = 24  # of Lanczos for each probe, a tangent linear and an adjoint each


@dataclass(frozen=True)
class Told:
    """Of one control, or of those of its patterns that are the same at all heights: how many numbers the observations
    tell, of so many that may change."""

    name: str
    told: float
    numbers: int

    def __str__(self) -> str:
        return f"{self.name} {max(self.told, 0.0):.1f} of {self.numbers}"


def signal(cost: Cost, v: F64, probes: int, seed: int = 0) -> list[Told]:
    """About a v. The numbers are rough: few probes have a noise, and where there are more observations than steps, too
    many are told (by a tenth after 16 steps of 20 pyranometers)."""
    pieces, rng = cost.space.pieces, np.random.default_rng(seed)
    shares = [np.zeros(p.mask.shape) for p in pieces]
    for _ in range(probes):
        z = rng.choice([-1.0, 1.0], v.size)
        y = _filtered(cost, v, z)
        for share, p in zip(shares, pieces, strict=True):
            one, other = (in_cosines(a[p.here].reshape(share.shape)) for a in (z, y))
            share += one * other / probes
    out = []
    for share, p in zip(shares, pieces, strict=True):
        if p.first.dims[:1] == ("z",):
            out += [Told(f"{p.name}, columns", float(share[0].sum()), share[0].size)]
            out += [Told(f"{p.name}, heights", float(share[1:].sum()), share[1:].size)]
        else:
            out += [Told(p.name, float(share.sum()), share.size)]
    return out


def _filtered(cost: Cost, v: F64, z: F64, steps: int = STEPS) -> F64:
    """A (1 + A)^-1 z, by the Krylov space of z."""
    size = float(np.linalg.norm(z))
    basis, diagonal, beside = [z / size], [], []
    for n in range(steps):
        w = cost.hessian(v, basis[n]) - basis[n]
        diagonal.append(float(w @ basis[n]))
        for _ in range(2):  # all again: rounding would bring back what is known
            for q in basis:
                w = w - float(w @ q) * q
        beside.append(float(np.linalg.norm(w)))
        if beside[-1] < 1e-10 * abs(diagonal[0]) or n == steps - 1:
            break
        basis.append(w / beside[-1])
    k = len(diagonal)
    value, vector = np.linalg.eigh(np.diag(diagonal) + np.diag(beside[: k - 1], 1) + np.diag(beside[: k - 1], -1))
    value = np.maximum(value, 0.0)
    weights = vector @ (value / (1 + value) * vector[0])
    return size * np.sum([c * q for c, q in zip(weights, basis, strict=False)], axis=0)
