"""Air that readers share: density, humidity, heights from pressure, and what stands in where a file is silent."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.scene.atmosphere import Atmosphere, us_standard_pressure_temperature

DRY_GAS_CONSTANT = 287.05  # J kg-1 K-1
VAPOUR_RATIO = 0.622  # molar mass of water vapour over that of dry air
GRAVITY = 9.80665  # m s-2
GEOID_RADIUS_M = 6_371_229.0  # for geopotential heights, as in the IFS

F32 = NDArray[np.float32]


def geometric_height_m(geopotential_height_m: NDArray[Any]) -> F32:
    """Height above sea level [m] of a geopotential height H [gpm]: R H/(R - H)."""
    given = np.asarray(geopotential_height_m)
    out = np.empty(given.shape, np.float32)
    levels = zip(out, given, strict=True) if given.ndim == 3 else [(out, given)]
    for heights, values in levels:  # one after the other: double precision of large domains takes memory
        h = values.astype(np.float64)
        heights[...] = GEOID_RADIUS_M * h / (GEOID_RADIUS_M - h)
    return out


def virtual_temperature_k(temperature_k: F32, specific_humidity: F32 | None) -> F32:
    """T (1 + .608 q)."""
    if specific_humidity is None:
        return temperature_k
    return temperature_k * (1 + np.float32(0.608) * specific_humidity)


def density_kg_m3(pressure_pa: F32, temperature_k: F32, specific_humidity: F32 | None) -> F32:
    """Density of moist air, p/(R T_v)."""
    virtual = virtual_temperature_k(temperature_k, specific_humidity)
    return (pressure_pa / (np.float32(DRY_GAS_CONSTANT) * virtual)).astype(np.float32)


def saturation_pa(celsius: F32) -> F32:
    """Pressure of vapour over water (Bolton 1980, Eq. 10; within .3 % from -35 to 35 degC)."""
    return np.asarray(611.2 * np.exp(17.67 * celsius / np.maximum(celsius + 243.5, 30.0)))


def saturation_over_ice_pa(celsius: F32) -> F32:
    """Pressure of vapour over ice (Magnus; WMO-No. 8, annex 4.B); above 0 degC as at it."""
    return np.asarray(611.2 * np.exp(22.46 * np.minimum(celsius, 0) / np.maximum(celsius + 272.6, 30.0)))


def relative_humidity(pressure_pa: F32, temperature_k: F32, specific_humidity: F32) -> F32:
    """Over water, 0 to 1; not clipped above."""
    vapour = specific_humidity * pressure_pa / (VAPOUR_RATIO + (1 - VAPOUR_RATIO) * specific_humidity)
    return np.asarray(vapour / saturation_pa(temperature_k - np.float32(273.15)), np.float32)


def specific_humidity_of(vapour_pa: F32, pressure_pa: F32) -> F32:
    """Of air in which vapour has a fifth of the pressure at most."""
    vapour = np.minimum(vapour_pa, 0.2 * pressure_pa)
    return np.asarray(VAPOUR_RATIO * vapour / (pressure_pa - (1 - VAPOUR_RATIO) * vapour), np.float32)


def precipitable_water_kg_m2(
    vapour_kg_m3: Iterable[F32], height_m: NDArray[Any], ground_m: F32 | float
) -> F32:
    """Column of vapour (ny, nx) above the ground, from its density on levels upward, each (ny, nx): trapezoidal between
    them and constant below the lowest; what lies below the ground does not count."""
    column, below, low = np.zeros(1), None, ground_m
    for vapour, height in zip(vapour_kg_m3, height_m, strict=True):
        high = np.maximum(height, ground_m)
        column = column + (vapour if below is None else 0.5 * (below + vapour)) * (high - low)
        below, low = vapour, high
    return np.asarray(column, np.float32)


def hydrostatic_heights_m(pressure_pa: F32, virtual_k: F32, lowest_m: F32) -> F32:
    """(nz, ny, nx) heights of levels above a lowest one at `lowest_m` (ny, nx): dz = R T_v/g d(ln p), levels upward."""
    steps = 0.5 * (virtual_k[1:] + virtual_k[:-1]) * (np.log(pressure_pa[:-1]) - np.log(pressure_pa[1:]))
    rise = np.cumsum(steps.astype(np.float64) * DRY_GAS_CONSTANT / GRAVITY, axis=0)
    geopotential = lowest_m + np.concatenate([np.zeros_like(rise[:1]), rise])
    return geometric_height_m(geopotential)


def standard_height_m(pressure_pa: NDArray[Any]) -> NDArray[np.float64]:
    """Height at which the US Standard Atmosphere has a pressure."""
    heights = np.arange(-1000.0, 90_001.0, 250.0)
    pressure, _ = us_standard_pressure_temperature(heights)
    return np.interp(-np.log(np.maximum(np.asarray(pressure_pa, float), 0.2)), -np.log(pressure), heights)


def standard_air(height_m: NDArray[Any]) -> tuple[F32, F32]:
    """Pressure [Pa] and temperature [K] of the US Standard Atmosphere at heights above sea level."""
    pressure, temperature = us_standard_pressure_temperature(np.asarray(height_m, float))
    return pressure.astype(np.float32), temperature.astype(np.float32)


def wind_along_axes(u: F32, v: F32, angle: NDArray[Any], where: str = "_10m") -> dict[str, F32]:
    """Wind along axes turned by an angle (radians, counter-clockwise) from the east, as the scene's toward east and
    north: 10 m above the ground, or, with ``where`` = "", on levels."""
    cos, sin = np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32)
    return {f"wind_east{where}": (u * cos - v * sin).astype(np.float32),
            f"wind_north{where}": (v * cos + u * sin).astype(np.float32)}  # fmt: skip


def without_gaps(values: F32) -> int:
    """Make missing values (NaN) of levels zero, in place; how many there were."""
    count = 0
    for level in values:
        gap = np.isnan(level)
        if gap.any():
            count += int(gap.sum())
            level[gap] = 0
    return count


def filled_from_above(values: F32) -> F32:
    """Levels upward: gaps (NaN) at the bottom of columns, as below the terrain, take the value above them."""
    filled = values
    for level in range(values.shape[0] - 2, -1, -1):
        gap = np.isnan(filled[level])
        if gap.any():
            filled = filled.copy() if filled is values else filled
            filled[level] = np.where(gap, filled[level + 1], filled[level])
    return filled


def filled_wind(values: F32) -> F32:
    """Levels (nz, ny, nx) of wind upward without gaps: as the level above has it, else the one below, else calm."""
    upward = filled_from_above(values)
    return np.nan_to_num(filled_from_above(upward[::-1])[::-1])


_MOST_COLUMNS = 2000  # of which a mean is made


def with_vapour(atmosphere: Atmosphere, height_m: NDArray[Any], vapour_kg_m3: NDArray[Any]) -> Atmosphere:
    """The background with the domain's mean water vapour: densities (nz, ny, nx) on levels, (nz,) or 3-D, upward.

    Above the highest level no more than the background's own; below the ground as just above it.
    """
    nz, columns = vapour_kg_m3.shape[0], vapour_kg_m3[0].size
    some = np.linspace(0, columns - 1, min(columns, _MOST_COLUMNS)).astype(int)
    vapour = np.maximum(np.nan_to_num(vapour_kg_m3.reshape(nz, columns)[:, some]), 0.0)
    levels = height_m.reshape(nz, -1) if height_m.ndim > 1 else height_m[:, None]
    heights = np.broadcast_to(levels, (nz, columns))[:, some]
    at = atmosphere.height_m
    own = atmosphere.vapour_kg_m3_at(at)
    total, count = np.zeros(at.size), np.zeros(at.size)
    for z, density in zip(heights.T, vapour.T, strict=True):
        above, inside = at > z[-1], at >= z[0]
        found = np.where(above, np.minimum(own, density[-1]), np.interp(at, z, density))
        total += np.where(inside, found, 0.0)
        count += inside
    lowest = int(np.argmax(count > 0))
    mean = total / np.maximum(count, 1)
    mean[:lowest] = mean[lowest]
    return replace(atmosphere, vapour_kg_m3=mean)
