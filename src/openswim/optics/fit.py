"""Fitting the paper's double Henyey-Greenstein function to any phase function (Albers et al. 2020, Appendix A)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.optics.aerosol import double_hg
from openswim.scene.phase import HenyeyGreenstein, PhaseFunction

FloatArray = NDArray[np.float64]

# Scattering angles at which the fit is judged: even steps, and closer in the aureole.
ANGLE_DEG = np.unique(np.concatenate([np.geomspace(1.0, 10.0, 12), np.arange(10.0, 181.0, 2.5)]))
_ASYMMETRY_WEIGHT = 5.0  # .01 of asymmetry weighs as much as 5 % at every angle

# Each parameter's range, mapped on the whole line for the search.
_LOW = np.array([0.0, -0.6, 0.0, 0.0])
_HIGH = np.array([0.997, 0.95, 1.0, 1.7])
_STARTS = ((0.9, 0.5, 0.3, 0.4), (0.75, 0.2, 0.7, 0.2), (0.95, 0.6, 0.1, 0.6), (0.6, 0.0, 0.8, 0.1))


@dataclass(frozen=True)
class DoubleHGFit:
    """Parameters of Albers et al. 2020, Eq. 28 (corrected) and how well they fit.

    sharp_g, broad_g: g of the two lobes (`g_1`, `g_2`); sharp_fraction: f_c; f_b: strength of the quadratic term.
    error: root mean square of ln(fit / phase function) over scattering angles of 1-180 degrees, .1 being about 10 %;
    asymmetry, asymmetry_error: mean cosine of the phase function, and what the fit adds to it.
    """

    sharp_g: float
    broad_g: float
    sharp_fraction: float
    f_b: float
    error: float
    asymmetry: float
    asymmetry_error: float

    @property
    def phase(self) -> PhaseFunction:
        return double_hg(self.sharp_g, self.broad_g, self.sharp_fraction, self.f_b)


def fit_double_hg(phase: PhaseFunction) -> DoubleHGFit:
    """The four parameters of the paper's aerosol phase function that come closest to `phase`.

    Least squares of the logarithm at `ANGLE_DEG`, with a weight on the asymmetry factor, which decides fluxes. The
    diffraction peak within 1 degree is left to the asymmetry factor: two lobes cannot follow it.
    """
    mu = np.cos(np.radians(ANGLE_DEG))
    log_target, asymmetry = np.log(phase.value(mu)), phase.asymmetry

    def residual(position: FloatArray) -> FloatArray:
        parameters = _from_line(position)
        model = np.maximum(_value(mu, parameters), 1e-6)
        g = parameters[2] * parameters[0] + (1 - parameters[2]) * parameters[1]
        off = np.log(model) - log_target
        return np.append(off / np.sqrt(off.size), _ASYMMETRY_WEIGHT * (g - asymmetry))

    found = [_least_squares(residual, _to_line(np.array(start))) for start in _STARTS]
    best = _from_line(min(found, key=lambda position: float((residual(position) ** 2).sum())))
    if best[0] < best[1]:
        best = np.array([best[1], best[0], 1 - best[2], best[3]])
    off = np.log(_value(mu, best)) - log_target
    g = best[2] * best[0] + (1 - best[2]) * best[1]
    sharp_g, broad_g, sharp_fraction, f_b = best.tolist()
    error = float(np.sqrt(np.mean(off**2)))
    return DoubleHGFit(sharp_g, broad_g, sharp_fraction, f_b, error, float(asymmetry), float(g - asymmetry))


def _value(mu: FloatArray, parameters: FloatArray) -> FloatArray:
    """Eq. 28 without the checks that its parts be positive, for the search."""
    sharp_g, broad_g, sharp_fraction, f_b = parameters
    total = np.zeros_like(mu)
    for share, g in ((sharp_fraction, sharp_g), (1 - sharp_fraction, broad_g)):
        quadratic = f_b * (1 - g**2) / (1 + g**2) ** 1.5 * (1.5 * mu**2 - 0.5)
        total += share * (HenyeyGreenstein(g).value(mu) + quadratic)
    return total


def _least_squares(residual: Callable[[FloatArray], FloatArray], start: FloatArray, steps: int = 200) -> FloatArray:
    """Levenberg-Marquardt with differences for derivatives."""
    position, damping = start, 1e-2
    off = residual(position)
    for _ in range(steps):
        jacobian = np.stack([(residual(position + h) - residual(position - h)) / 2e-5 for h in 1e-5 * np.eye(4)], -1)
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal + damping * (np.diag(np.diag(normal)) + 1e-9 * np.eye(4)), -jacobian.T @ off)
        trial = np.clip(position + np.clip(step, -1, 1), -12, 12)
        trial_off = residual(trial)
        gain = (off**2).sum() - (trial_off**2).sum()
        if gain > 0:
            position, off, damping = trial, trial_off, damping / 3
            if gain < 1e-12 * (off**2).sum() or np.abs(step).max() < 1e-8:
                break
        else:
            damping *= 4
            if damping > 1e12:
                break
    return position


def _from_line(position: FloatArray) -> FloatArray:
    return _LOW + (_HIGH - _LOW) / (1 + np.exp(-position))


def _to_line(parameters: FloatArray) -> FloatArray:
    share = np.clip((parameters - _LOW) / (_HIGH - _LOW), 1e-4, 1 - 1e-4)
    return np.log(share / (1 - share))
