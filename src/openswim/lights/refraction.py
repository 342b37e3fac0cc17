"""Refraction: how much higher than they are things in the sky appear."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

STANDARD_PRESSURE_PA, STANDARD_TEMPERATURE_K = 101_000.0, 283.15
_LOWEST_DEG = -1.0  # apparent altitude; below, the ground is in the way


def refraction_deg(
    apparent_altitude_deg: ArrayLike,
    pressure_pa: float = STANDARD_PRESSURE_PA,
    temperature_k: float = STANDARD_TEMPERATURE_K,
) -> NDArray[np.float64]:
    """Apparent less true altitude, degrees, for visible light (Bennett 1982, Journal of Navigation 35, 255).

    0.1 minute of arc above 15 degrees, half a minute near the horizon in the air that he took; the real air
    differs by a tenth of it there.  None below -1 degree.
    """
    altitude = np.asarray(apparent_altitude_deg, float)
    held = np.clip(altitude, _LOWEST_DEG, 89.9)
    lifted = 0.016667 / np.tan(np.radians(held + 7.31 / (held + 4.4)))
    lifted = lifted * (0.28 * pressure_pa / 100.0 / temperature_k)
    return np.where((altitude >= _LOWEST_DEG) & (altitude <= 89.9), lifted, 0.0)


def refracted_altitude_deg(
    altitude_deg: ArrayLike,
    pressure_pa: float = STANDARD_PRESSURE_PA,
    temperature_k: float = STANDARD_TEMPERATURE_K,
) -> NDArray[np.float64]:
    """Apparent altitude of what stands at a true `altitude_deg`; unchanged where it would stay below -1 degree."""
    true = np.asarray(altitude_deg, float)
    apparent = true.copy()
    for _ in range(30):  # a contraction: each round brings two digits, fewer at the horizon
        apparent = true + refraction_deg(apparent, pressure_pa, temperature_k)
    return apparent


TWILIGHT_LIFT_DEG = 0.2  # of sunlight that passes 10 to 20 km above the ground, on its way in and out: .35 to .1
_SETTLES_DEG = 1.2


def lit_altitude_deg(altitude_deg: ArrayLike, pressure_pa: float = STANDARD_PRESSURE_PA) -> NDArray[np.float64]:
    """From where straight rays of a sun at a true altitude light a place as its bent ones do.

    While any of the sun is up, where it appears. Below, what lights the sky has passed high above the ground, and is
    bent the less; smooth, so that nothing leaps at sunset.
    """
    true = np.asarray(altitude_deg, float)
    lift_at_horizon = float(refraction_deg(0.0, pressure_pa))
    below = np.maximum(-lift_at_horizon - true, 0.0)
    fading = np.exp(-below / _SETTLES_DEG)
    sunk = true + TWILIGHT_LIFT_DEG + (lift_at_horizon - TWILIGHT_LIFT_DEG) * fading
    return np.where(below > 0, sunk, refracted_altitude_deg(true, pressure_pa))
