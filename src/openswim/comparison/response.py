"""What a camera makes of light: the curves by which counts are written, and one for each channel that is fitted to a
simulated sky and rises; both undone.

One frame cannot tell the curve from the aerosol: more haze flattens both. So a curve belongs to the aerosol that was
taken, and aerosol is never fitted by r.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.srgb import from_srgb, to_srgb

F64 = NDArray[np.float64]
FEWEST_PIXELS = 50
_BINS, _RUNGS = 128, 4096  # of a curve that is fitted; steps of the root of light that bins are made of
SMOOTH, STEP = 0.15, 0.01  # of ln light, over which a curve that is drawn is averaged
_PIXELS = 5000  # spread over a picture, say of a power law what all say
AEROSOL_NOTE = (
    "The response belongs to the aerosol that was taken: a hazier sky with a flatter response fits a frame as well. "
    "r never says which aerosol is right."
)


def decoded(share: ArrayLike, encoding: str | float) -> F64:
    """Linear light of counts, both as shares of full scale: "linear", "srgb" (IEC 61966-2-1), or share ** exponent."""
    value = np.asarray(share, float)
    if encoding == "linear":
        return value
    if encoding == "srgb":
        return from_srgb(value)
    return np.maximum(value, 0.0) ** float(encoding)


def encoded(light: ArrayLike, encoding: str | float) -> F64:
    """The inverse of `decoded`."""
    value = np.asarray(light, float)
    if encoding == "linear":
        return value
    if encoding == "srgb":
        return np.asarray(to_srgb(value))
    return np.maximum(value, 0.0) ** (1 / float(encoding))


@dataclass(frozen=True, eq=False)
class Curve:
    """Radiance at linear light `light` (k,), rising; beyond its ends a power law of `slope` goes on."""

    light: F64
    radiance: F64
    slope: float
    rms: float  # of what the curve leaves, in linear light as a share of full scale

    def __call__(self, light: NDArray[np.floating]) -> F64:
        value = np.asarray(light, float)
        found = np.asarray(np.interp(value, self.light, self.radiance))
        for end, outside in ((0, value < self.light[0]), (-1, value > self.light[-1])):
            ratio = np.maximum(value[outside], 1e-6) / max(float(self.light[end]), 1e-6)
            found[outside] = self.radiance[end] * ratio**self.slope
        return found

    def smooth(self, light: NDArray[np.floating]) -> F64:
        """The same averaged over `SMOOTH` of ln light: a picture would show the steps and level parts of a fit. Power
        laws stay what they are."""
        from scipy.ndimage import gaussian_filter1d

        ends = np.log(np.maximum(self.light[[0, -1]], 1e-9))
        at = np.arange(ends[0] - 8 * SMOOTH, ends[1] + 8 * SMOOTH, STEP)
        smoothed = gaussian_filter1d(np.log(np.maximum(self(np.exp(at)), 1e-9)), SMOOTH / STEP)
        value = np.asarray(light, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.log(value)
        inside = (x > at[0] + 4 * SMOOTH) & (x < at[-1] - 4 * SMOOTH)  # beyond, the curve is a power law itself
        return np.where(inside, np.exp(np.interp(x, at, smoothed)), self(value))


def fit_curve(light: F64, radiance: F64, weight: F64) -> Curve | None:
    """The rising curve nearest to simulated radiance (n,) at observed linear light (n,); None of too few pixels.

    With the two swapped it is the light to be expected at a radiance: flatter than the other curve turned round, as
    pixels lie beside both.
    """
    from scipy.optimize import isotonic_regression

    if light.size < FEWEST_PIXELS or light.max() <= light.min():
        return None
    # bins of as many pixels each, but for those of one rung
    rung = (np.sqrt((light - light.min()) / (light.max() - light.min())) * _RUNGS).astype(np.intp)
    pixels = np.bincount(rung)
    bin_of_rung = ((np.cumsum(pixels) - 0.5 * pixels) * (_BINS / light.size)).astype(np.intp)
    number = bin_of_rung[rung]
    total, of_light, of_radiance = (np.bincount(number, weight * v, _BINS) for v in (1.0, light, radiance))
    there = total > 0
    at, mean = (each[there] / total[there] for each in (of_light, of_radiance))
    rising = isotonic_regression(mean, weights=total[there]).x
    left = radiance - np.interp(light, at, rising)
    steepness = max((rising[-1] - rising[0]) / max(at[-1] - at[0], 1e-12), 1e-12)
    rms = float(np.sqrt(np.average(left**2, weights=weight)) / steepness)
    return Curve(at, rising, _slope(*_spread(light, radiance, weight)), rms)


def _spread(*values: F64) -> tuple[F64, ...]:
    """So many of a picture's pixels (n, ...), spread over it."""
    return tuple(each[:: max(1, len(each) // _PIXELS)] for each in values)


def _slope(light: F64, radiance: F64, weight: F64) -> float:
    """Of ln radiance over ln light, by the principal axis; within .3 to 4."""
    x, y = (np.log(np.maximum(v, 1e-9)) for v in (light, radiance))
    x, y = (v - np.average(v, weights=weight) for v in (x, y))
    xx, yy, xy = (np.average(p, weights=weight) for p in (x * x, y * y, x * y))
    slope = (yy - xx + np.hypot(yy - xx, 2 * xy)) / (2 * xy) if xy > 0 else 1.0
    return float(np.clip(slope, 0.3, 4.0))


@dataclass(frozen=True)
class PowerLaw:
    """counts / full scale = (exposure * radiance) ** (1 / gamma), gamma and exposure (channels,) of each channel."""

    gamma: F64
    exposure: F64

    @property
    def white_balance(self) -> F64:
        """Exposure of each channel over green's; NaN where the fit came upon none."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.exposure / self.exposure[len(self.exposure) // 2])


def fit_power_law(stored: F64, radiance: F64, weight: F64) -> PowerLaw:
    """Of shares of full scale (n, channels) as stored and radiance alike; robust against what is no clear sky. NaN of
    skies with hardly any light, as without air."""
    from scipy.optimize import least_squares

    lit = (stored > 0).all(axis=-1) & (radiance > 0).all(axis=-1)
    if lit.sum() < FEWEST_PIXELS:
        return PowerLaw(*np.full((2, stored.shape[-1]), np.nan))
    stored, radiance, weight = _spread(stored[lit], radiance[lit], weight[lit])
    found = []
    for share, light, start in zip(stored.T, radiance.T, _starts(stored, radiance), strict=True):

        def miss(p: F64, share: F64 = share, light: F64 = light) -> F64:
            return np.asarray(weight**0.5 * (np.exp((np.log(light) + p[1]) * np.exp(-p[0])) - share))

        scale = max(float(np.median(np.abs(miss(start)))), 1e-6)
        found.append(least_squares(miss, start, loss="soft_l1", f_scale=scale).x)
    gamma, exposure = np.exp(np.array(found)).T
    return PowerLaw(gamma, exposure)


def _starts(stored: F64, radiance: F64) -> list[F64]:
    out = []
    for share, light in zip(np.log(stored).T, np.log(radiance).T, strict=True):
        slope = float(np.clip(share.std() / max(light.std(), 1e-9), 0.2, 2.0))
        out.append(np.array([-np.log(slope), np.median(share) / slope - np.median(light)]))
    return out
