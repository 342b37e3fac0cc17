"""A linear fixed point by Anderson's mixing of the last steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def fixed_point(
    apply: Callable[[F64], F64], given: F64, tolerance: float, most: int, memory: int = 3, start: F64 | None = None
) -> tuple[F64, int]:
    """x = apply(x) + given, until a step changes it by less than ``tolerance`` of what is given; x and the sweeps.

    Of the last ``memory`` steps that combination is gone on with whose changes would cancel best (Walker & Ni 2011).
    """
    x = given.copy() if start is None else start.copy()
    images: list[F64] = []
    residuals: list[F64] = []
    size = _dot(given, given) ** 0.5 + 1e-300
    for n in range(1, most + 1):
        image = apply(x)
        image += given
        residual = image - x
        if _dot(residual, residual) ** 0.5 <= tolerance * size or n == most:
            return image, n
        images, residuals = [*images[-memory:], image], [*residuals[-memory:], residual]
        if memory == 0 or len(images) == 1:
            x = image
            continue
        size_of = len(residuals) - 1
        changes = [(one - residual).ravel() for one in residuals[:-1]]
        gram = np.array([[_dot(a, b) for b in changes] for a in changes])
        right = -np.array([_dot(a, residual.ravel()) for a in changes])
        c = np.linalg.solve(gram + 1e-14 * np.trace(gram) * np.eye(size_of), right)
        x = (1 - c.sum()) * image
        for share, earlier in zip(c, images[:-1], strict=True):
            x += share * earlier
    raise AssertionError("there is at least one sweep")


def _dot(a: F64, b: F64) -> float:
    """Sum of products in one order whatever the threads of a linear algebra library."""
    return float(np.add.reduce(np.ravel(a) * np.ravel(b)))
