"""A fixed point by Anderson's mixing of the last steps, and where to begin it.

A search goes from state to state in short steps. Light changes nearly as extinction does, so that earlier states tell
what it will be. What an adjoint finds is linear in its residual: its residuals are nearly sums of those before, and so
is what they find, as far as the sweeps are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import CONTRACTED, REORDERED, kernel

F64 = NDArray[np.float64]

_FALL = 0.3  # of changes from one step to the next, before that is known, and the strongest that is counted on
MOST = 6  # of earlier solutions that are gone on from
_ALIKE = 1e-6  # of the square of a row: some may be nearly alike
_LEAST = 1e-14  # of the mean square of changes, added to each: some may be nearly parallel


@kernel(REORDERED)
def _dot(a, b):
    """Sum of products, in one order whatever the threads."""
    total = 0.0
    for n in range(a.shape[0]):
        total += a[n] * b[n]
    return total


@kernel(CONTRACTED)
def _away(image, x):
    """In place of x how far the image is from it."""
    for n in range(x.shape[0]):
        x[n] = image[n] - x[n]


@kernel(CONTRACTED)
def _add(x, share, more):
    for n in range(x.shape[0]):
        x[n] += share * more[n]


def norm(x: F64) -> float:
    return float(_dot(x.ravel(), x.ravel()) ** 0.5)


def added(x: F64, more: F64) -> F64:
    """x + more, in place."""
    _add(x.reshape(-1), 1.0, more.reshape(-1))
    return x


def fixed_point(
    apply: Callable[[F64, float], F64], start: F64, wanted: float, most: int, memory: int = 3
) -> tuple[F64, F64]:
    """x = apply(x), until a step changes it by less than ``wanted``; the last image, and of what it is the image.

    apply is linear, or nearly, and something more; it is told by how much it is expected to change x, 0 where it is the
    last time in any case. Of the last ``memory`` steps that combination is gone on with whose changes would cancel best
    (Walker & Ni 2011).
    """
    x = start.copy()
    images: list[F64] = []
    residuals: list[F64] = []
    products = np.zeros((0, 0))  # of the residuals with each other
    left, fall = np.inf, _FALL
    for n in range(1, most + 1):
        image = apply(x, left * fall if n < most else 0.0)
        _away(image.reshape(-1), x.reshape(-1))
        residuals = [*residuals[-memory:], x.ravel()] if memory else [x.ravel()]
        own = np.array([_dot(one, residuals[-1]) for one in residuals])
        fall, left = max(own[-1] ** 0.5 / left, _FALL), own[-1] ** 0.5
        if left <= wanted or n == most:
            return image, image - x
        if memory == 0:
            x = image
            continue
        kept = len(residuals) - 1
        products = np.block([[products[-kept:, -kept:] if kept else np.zeros((0, 0)), own[:-1, None]], [own[None]]])
        images = [*images[-memory:], image]
        if not kept:
            x = image.copy()
            continue
        gram = products[:kept, :kept] - own[:-1, None] - own[None, :-1] + own[-1]
        c = np.linalg.solve(gram + _LEAST * np.trace(gram) * np.eye(kept), own[-1] - own[:-1])
        x = (1 - float(c.sum())) * image
        for share, earlier in zip(c, images[:-1], strict=True):
            _add(x.reshape(-1), share, earlier.reshape(-1))
    raise AssertionError("there is at least one sweep")


class Solved(NamedTuple):
    """A solved fixed point: the scaled extinction (nodes,) for which it is, and its moments (K, nodes)."""

    ext: F64
    moments: F64


class Asked(NamedTuple):
    """A residual, in one row; size: how large is what eyes and ground ask of the moments, before it is scattered
    (``asked``) and after it is scattered once (``size``); found (K, nodes): what is asked of them in all."""

    residual: F64
    asked: float
    size: float
    found: F64


def begun(earlier: Sequence[Asked], residual: F64) -> F64:
    """That sum (K, nodes) of what was found whose residuals come nearest."""
    shares = _shares([one.residual for one in earlier], residual)
    return _sum(shares, [one.found for one in earlier], np.zeros_like(earlier[0].found))


def ahead(earlier: Sequence[Solved], ext: F64) -> F64:
    """Moments (K, nodes) of an extinction, as far as those before tell how they change with it."""
    *before, last = earlier
    shares = _shares([one.ext - last.ext for one in before], ext - last.ext)
    start = last.moments * last.moments.dtype.type(1.0 - shares.sum())
    return _sum(shares, [one.moments for one in before], start)


def _shares(known: Sequence[F64], wanted: F64) -> F64:
    """Of rows those whose sum comes nearest to another; what is alike counts once."""
    gram = np.array([[_dot(a, b) for b in known] for a in known]).reshape(len(known), len(known))
    size = np.maximum(np.sqrt(np.diag(gram)), 1e-300)
    told = np.array([_dot(a, wanted) for a in known]) / size
    gram = gram / size[:, None] / size + _ALIKE * np.eye(len(known))
    return np.linalg.solve(gram, told) / size


def _sum(shares: F64, fields: Sequence[F64], out: F64) -> F64:
    for share, one in zip(shares, fields, strict=True):
        _add(out.reshape(-1), out.dtype.type(share), one.reshape(-1))
    return out
