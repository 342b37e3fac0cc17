"""Anderson's mixing of the last steps of the sweeps (Walker & Ni 2011), in single precision and in place."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from openswim.transport.diffuse.moments import add_scaled, inner_product
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class Anderson:
    """The last images of an iteration, to be mixed so that their residual is least."""

    def __init__(self, memory: int):
        self.memory = memory
        self.images: list[F32] = []
        self.residuals: list[F32] = []
        self.weights: list[F64] = []  # of their levels
        self.rounds: list[list[F32]] = []  # light on its way round a period

    def spare(self) -> F32 | None:
        """Room for the next image: that of the one to be forgotten."""
        if len(self.images) < self.memory:
            return None
        self.residuals.pop(0)
        self.weights.pop(0)
        self.rounds.pop(0)
        return self.images.pop(0)

    def reweigh(self, weight: F64, level: NDArray[np.int64]) -> None:
        """Give the levels' ``weight`` to the earlier residuals, whose blocks (n,) are on each ``level``."""
        for n, residual in enumerate(self.residuals):
            residual *= (weight / self.weights[n]).astype(FLOAT)[level, None, None]
            self.weights[n] = weight

    def mix(self, image: F32, residual: F32, weight: F64, out: F32, going_round: list[F32]) -> None:
        """The best combination, into ``out``; ``weight`` of levels is in the residual. Of ``going_round``, what goes
        round a period after the last sweep, the same combination in its place: it is as much a part of the light."""
        self.images.append(image)
        self.residuals.append(residual)
        self.weights.append(weight)
        self.rounds.append([light.copy() for light in going_round])
        # inner products of the residuals' differences from the last, from those of the residuals
        count = len(self.residuals)
        inner = np.empty((count, count))
        for a, b in combinations_with_replacement(range(count), 2):
            inner[a, b] = inner[b, a] = _inner(self.residuals[a], self.residuals[b])
        beside = inner[:-1, -1] - inner[-1, -1]
        gram = inner[:-1, :-1] - inner[:-1, -1:] - beside[None, :]
        gram += 1e-9 * np.trace(gram) * np.eye(len(gram))
        weights = np.linalg.solve(gram, -beside)
        np.multiply(image, FLOAT(1 - weights.sum()), out=out)
        for w, earlier in zip(weights, self.images[:-1], strict=True):
            in_threads(add_scaled, out.reshape(-1), FLOAT(w), earlier.reshape(-1))
        for n, light in enumerate(going_round):
            light *= FLOAT(1 - weights.sum())
            for w, before in zip(weights, self.rounds[:-1], strict=True):
                light += FLOAT(w) * before[n]


def _inner(a: F32, b: F32) -> float:
    """Inner product."""
    out = np.empty(get_num_threads())
    in_threads(inner_product, a.reshape(-1), b.reshape(-1), out)
    return float(out.sum())
