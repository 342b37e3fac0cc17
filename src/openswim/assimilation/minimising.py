"""Minimising the cost: L-BFGS, and Gauss-Newton by conjugate gradients with what earlier loops learnt."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from openswim.assimilation.cost import Cost, dot
from openswim.assimilation.preconditioning import Cosines, cosines_of

F64 = NDArray[np.float64]

EVERY = 50  # steps, after which what is observed of each pattern is told anew
MEMORY = 60  # steps that L-BFGS remembers: with 15 of them 100 steps come as far as 75 of these
_GOAL = 0.1  # of the gradient, to which conjugate gradients solve each Gauss-Newton step
_SMALLEST_STEP = 0.05
_FLAT = 1e-5  # greatest slope of a J at its least
_ALIKE = 2e-9  # of J, by which it falls at least while there is more to come
_FALLS, _FLATTENS = 1e-3, 0.9  # of the slope, see `_along`
_TRIES = 20

Told = Callable[[F64, float], None]  # v and J after each iteration; may raise to stop


def lbfgs(cost: Cost, v: F64, iterations: int, told: Told) -> F64:
    """By L-BFGS in scaled cosines, which are told anew every `EVERY` steps.

    It is written out since sums of long rows by a library take several threads, which wait busily for each other, and
    other bits with other numbers of them.
    """
    while iterations > 0:
        steps = iterations if iterations < 1.5 * EVERY else EVERY
        v, done = _cycle(cost, cosines_of(cost, v), steps, told)
        if done < steps:  # it has converged
            break
        iterations -= steps
    return v


def _cycle(cost: Cost, cosines: Cosines, steps: int, told: Told) -> tuple[F64, int]:
    def scaled(u: F64) -> tuple[float, F64]:
        value, gradient = cost(cosines.v(u))
        return value, cosines.gradient(gradient)

    u = np.zeros(cosines.origin.size)
    value, gradient = scaled(u)
    pairs: deque[tuple[F64, F64]] = deque(maxlen=min(MEMORY, steps))
    done = 0
    while done < steps and np.abs(gradient).max() > _FLAT:
        way = -_unbent(pairs, gradient)
        step = 1.0 if pairs else min(1.0, 1.0 / dot(gradient, gradient) ** 0.5)
        found = _along(scaled, u, value, gradient, way, step)
        if found is None:
            if not pairs:
                break
            pairs.clear()  # perhaps what was learnt leads astray
            continue
        step, after, bar = found
        if dot(bar - gradient, way) > 0:
            pairs.append((step * way, bar - gradient))
        fall, u, value, gradient, done = value - after, u + step * way, after, bar, done + 1
        told(cosines.v(u), value)
        if fall <= _ALIKE * max(abs(value), 1.0):
            break
    return cosines.v(u), done


def _unbent(pairs: deque[tuple[F64, F64]], gradient: F64) -> F64:
    """The inverse Hessian that steps and changes of the gradient tell, times a gradient (Nocedal 1980)."""
    out, shares = gradient.copy(), []
    for step, change in reversed(pairs):
        shares.append(dot(step, out) / dot(step, change))
        out -= shares[-1] * change
    if pairs:
        step, change = pairs[-1]
        out *= dot(step, change) / dot(change, change)
    for (step, change), share in zip(pairs, reversed(shares), strict=True):
        out += (share - dot(change, out) / dot(step, change)) * step
    return out


def _along(
    scaled: Callable[[F64], tuple[float, F64]], u: F64, value: float, gradient: F64, way: F64, step: float
) -> tuple[float, float, F64] | None:
    """A step along a way by which J falls and flattens enough (Wolfe), J there and its gradient; None: no such."""
    slope, low, high = dot(gradient, way), 0.0, np.inf
    for _ in range(_TRIES if slope < 0 else 0):
        after, bar = scaled(u + step * way)
        if not after <= value + _FALLS * step * slope:
            high = step
            best = -slope * step * step / (2 * (after - value - slope * step))  # of a parabola
            step = min(max(best, low + 0.1 * (high - low)), low + 0.5 * (high - low))
        elif dot(bar, way) < _FLATTENS * slope:
            low = step
            step = 2.0 * step if high == np.inf else 0.5 * (low + high)
        else:
            return step, after, bar
    return None


@dataclass
class Spectrum:
    """A limited-memory preconditioner: the largest eigenvalues of the Hessian and their vectors (n, size), as conjugate
    gradients of earlier loops came upon them (Tshimanga et al. 2008, spectral)."""

    values: list[float] = field(default_factory=list)
    vectors: list[F64] = field(default_factory=list)
    most: int = 30
    cosines: Cosines | None = None  # in which they are told

    def apply(self, r: F64) -> F64:
        out = r.copy()
        for value, vector in zip(self.values, self.vectors, strict=True):
            out += (1 / value - 1) * float(vector @ r) * vector
        return out

    def learn(self, residuals: list[F64], steps: list[float], ratios: list[float]) -> None:
        """From normalised residuals of a run, which are Lanczos vectors, and its two kinds of coefficients."""
        n = len(steps)
        if n < 2:
            return
        diagonal = np.array([1 / steps[k] + (ratios[k - 1] / steps[k - 1] if k else 0.0) for k in range(n)])
        beside = np.array([np.sqrt(ratios[k]) / steps[k] for k in range(n - 1)])
        value, vector = np.linalg.eigh(np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1))
        basis = [(-1) ** k * r for k, r in enumerate(residuals[:n])]
        self.values, self.vectors = [], []
        for k in np.argsort(value)[::-1][: self.most]:
            if value[k] > 1.5 and abs(vector[-1, k]) < 0.2:  # converged, and worth it
                found = sum(c * b for c, b in zip(vector[:, k], basis, strict=True))
                self.values.append(float(value[k]))
                self.vectors.append(found / np.linalg.norm(found))


def gauss_newton(cost: Cost, v: F64, inner: int, spectrum: Spectrum, told: Told) -> F64:
    """One outer loop: a linearisation, conjugate gradients on its quadratic cost, and halvings of the step until J
    falls. inner: most products with the Hessian."""
    if spectrum.cosines is None:
        spectrum.cosines = cosines_of(cost, v)
    cosines = replace(spectrum.cosines, origin=v)
    value, by_v = cost(v)
    step, residual = np.zeros_like(v), -cosines.gradient(by_v)
    if not residual.any():
        told(v, value)
        return v
    z = spectrum.apply(residual)
    p, rz = z.copy(), float(residual @ z)
    goal, kept, steps, ratios = _GOAL**2 * rz, [residual / np.linalg.norm(residual)], [], []
    plain = not spectrum.values  # Lanczos vectors of the Hessian itself, not of the preconditioned one
    for _ in range(inner):
        hp = cosines.gradient(cost.hessian(v, cosines.change(p)))
        a = rz / float(p @ hp)
        step, residual = step + a * p, residual - a * hp
        z = spectrum.apply(residual)
        new = float(residual @ z)
        steps.append(a)
        ratios.append(new / rz)
        p, rz = z + new / rz * p, new
        if new < goal:
            break
        kept.append(residual / np.linalg.norm(residual))
    if plain:
        spectrum.learn(kept, steps, ratios)
    scale = 1.0
    while scale > _SMALLEST_STEP:
        there = cosines.v(scale * step)
        after, _ = cost(there)
        if after < value:
            told(there, after)
            return there
        scale *= 0.5
    told(v, value)
    return v
