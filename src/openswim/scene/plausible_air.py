"""Air that weighs what air weighs: pressure, temperature and heights beside the standard atmosphere, and each other."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.atmosphere import us_standard_pressure_temperature
from openswim.scene.oddities.neighbours import GAS_CONSTANT, GRAVITY

_KNOWN_TO_M = 80_000.0  # up to here pressure is compared with the standard atmosphere
_SPREAD, _SPREAD_PER_M = 0.7, 1 / 40_000.0  # of ln(p/standard): a plateau called sea level; winter high above the poles
_WARMTH, _WARMTHS = (0.98, 1.025), (0.94, 1.07)  # of temperature to that of thickness: columns, layers; moist air 1.02
_ROUNDING = 2e-5  # of the largest pressure: that of files packed in 16 bits
_THIN_M, _HIGH_PA = 50.0, 2000.0  # thinner or higher layers tell no temperature
_LAYER_K, _COLUMN_K = (60.0, 1000.0), (150.0, 450.0)  # of layers and of columns, from thickness and pressures
# Of pressure to that of the standard atmosphere at its height, at the ground: Antarctica's plateau has 0.93, Siberia's
# winter 1.05, Tibet's summer 1.03, the middle of a hurricane 0.95 in the mean over 200 km
_AT_SEA, _PLATEAU_M = (0.9, 1.08), 4500.0
_DEEP_M = 2000.0  # thinner domains may have a pressure of their own: that of their dynamics
_SAMPLES = 64  # columns each way that stand for all where a mean is asked for


def check_temperature(temperature: NDArray[np.float32], height_m: NDArray[np.float32]) -> None:
    """Colder than any mesopause, or warmer than the ground of a desert (higher up: less), is no air."""
    for level, height in zip(temperature, height_m, strict=True):
        low, high = float(np.min(height)), float(level.max())
        warmest = max(345.0 - 3e-3 * max(low, 0.0), 310.0)
        if low < _KNOWN_TO_M and not (high <= warmest and level.min() >= 110.0):
            raise UserError(
                f"scene: air_temperature runs from {level.min():.4g} to {high:.4g} K at {low:.0f} m; air has 110 to "
                f"{warmest:.0f} K there: is it in K, or a fill value?"
            )


def check_pressure(pressure: NDArray[np.float32], height_m: NDArray[np.float32], heights: NDArray[np.float32]) -> None:
    """Near that of the standard atmosphere, falling with height, by as much as air of a sane temperature makes it."""
    if not _falls(pressure):
        raise UserError("scene: air_pressure rises with height: levels out of order or upside down, or a damaged field")
    for level, height in zip(pressure, height_m, strict=True):
        low, high = float(np.min(height)), float(np.max(height))
        if high > _KNOWN_TO_M:
            break
        most, least = us_standard_pressure_temperature(np.array([low, high]))[0]
        spread = np.exp(_SPREAD + _SPREAD_PER_M * max(high, 0.0))
        for found, expected in ((float(level.max()), most), (float(level.min()), least)):
            if not expected / spread < found < expected * spread:
                smell = times_text(found / expected)
                raise UserError(
                    f"scene: air_pressure is {found:.4g} Pa at {low:.0f} m, where air has about {expected:.4g} Pa"
                    f"{f', {smell}' if smell else ''}: is it in Pa, is it the whole pressure, and heights in metres?"
                )
    sample = np.maximum(sampled(pressure), 1e-3)
    fall = np.log(sample[:-1] / sample[1:]).mean(axis=(1, 2), dtype=np.float64)
    thick = np.diff(heights, axis=0).mean(axis=(1, 2), dtype=np.float64)
    known = sample[1:].mean(axis=(1, 2)) > _HIGH_PA
    with np.errstate(divide="ignore"):
        layer = GRAVITY * thick / (GAS_CONSTANT * fall)
        column = float(GRAVITY * thick.sum() / (GAS_CONSTANT * fall.sum()))
    if thick.sum() > 2 * _THIN_M and not fall.sum() > 0:
        raise UserError("scene: air_pressure does not fall with height: a damaged field, or one value for all levels")
    odd = known & (thick > _THIN_M) & ~((layer > _LAYER_K[0]) & (layer < _LAYER_K[1]))
    if thick.sum() > 2 * _THIN_M and not _COLUMN_K[0] < column < _COLUMN_K[1]:
        raise UserError(
            f"scene: pressures and heights of the levels fit together only if air had {column:.3g} K: are heights in "
            "metres, pressure in Pa?"
        )
    if odd.any():
        k = int(np.argmax(odd))
        raise UserError(
            f"scene: pressures and heights of levels {k + 1} and {k + 2} fit together only if air had {layer[k]:.3g} "
            "K: a repeated, lost or misplaced level, or a damaged field"
        )


def pressure_of_sea_level(lowest: NDArray[np.float32], height_m: NDArray[np.float32]) -> list[str]:
    """A note where the lowest level's pressure is not that of its height, anywhere on Earth: the ground is too high or
    too low, by what it is said to be."""
    high = np.asarray(height_m, np.float64)
    standard = us_standard_pressure_temperature(high)[0]
    middle = float(np.median(lowest / standard))
    if float(np.median(high)) > _PLATEAU_M or _AT_SEA[0] < middle < _AT_SEA[1]:
        return []
    return [
        f"air_pressure is {middle:.2g} times that of the standard atmosphere at {float(np.median(high)):.0f} m, the "
        "lowest level: are heights above sea level, and in metres?"
    ]


def warmth(pressure: NDArray[Any], temperature: NDArray[Any], heights: NDArray[Any]) -> list[str]:
    """A note where air would have to be warmer or colder to fill its layers; weather models agree within 2 %."""
    sample, warm = np.maximum(sampled(pressure), 1e-3), sampled(temperature)
    thick = np.diff(heights, axis=0).mean(axis=(1, 2), dtype=np.float64)
    known = (sample[1:].mean(axis=(1, 2)) > _HIGH_PA) & (thick > _THIN_M)
    if thick[known].sum() < _DEEP_M:
        return []
    fall = np.log(sample[:-1] / sample[1:]).mean(axis=(1, 2), dtype=np.float64)
    needed = GRAVITY * thick[known] / GAS_CONSTANT
    given = (fall * 0.5 * (warm[1:] + warm[:-1]).mean(axis=(1, 2), dtype=np.float64))[known]
    whole, layers = float(needed.sum() / given.sum()), needed / given
    if _WARMTH[0] < whole < _WARMTH[1] and _WARMTHS[0] < layers.min() and layers.max() < _WARMTHS[1]:
        return []
    odd = whole if not _WARMTH[0] < whole < _WARMTH[1] else layers[np.argmax(np.abs(layers - 1))]
    return [f"pressure, temperature and heights disagree: layers are as thick as those of air {odd:.3g} times as warm"]


def _falls(pressure: NDArray[np.float32]) -> bool:
    rounding = np.float32(_ROUNDING * pressure[0].max())
    return all(bool((above <= below + rounding).all()) for below, above in pairwise(pressure))


def times_text(factor: float) -> str:
    """ "1000 times too large", "100 times too small" of a factor that is near a power of ten; else ""."""
    power = round(float(np.log10(max(abs(factor), 1e-30))))
    return "" if power == 0 else f"{10.0 ** abs(power):g} times too {'large' if power > 0 else 'small'}"


def sampled(field: NDArray[Any]) -> NDArray[Any]:
    """Some columns of a field (..., y, x), spread evenly."""
    rows, columns = (max(1, size // _SAMPLES) for size in field.shape[-2:])
    return field[..., ::rows, ::columns]
