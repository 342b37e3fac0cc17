"""One exposure curve for a film: what each frame would like, smoothed over time so that nothing flickers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SMOOTHED = 0.08  # standard deviation of the smoothing, as a share of the film
LEAST_FRAMES = 2.0  # and at least so many frames


def exposure_curve(wanted: ArrayLike) -> NDArray[np.float64]:
    """Factors (n,) from L' to display light, smooth over frames, from what each frame by itself wants (n,), positive.

    A Gaussian mean of the logarithm; at the ends the film is taken to go on as its mirror image does.
    """
    logs = np.log(np.asarray(wanted, float))
    count = len(logs)
    sigma = max(SMOOTHED * count, LEAST_FRAMES)
    if count < 2:
        return np.exp(logs)
    reach = min(int(np.ceil(3 * sigma)), count - 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    around = np.pad(logs, reach, mode="reflect", reflect_type="even")
    return np.exp(np.convolve(around, weights / weights.sum(), mode="valid"))
