"""What stands in where a file has cloud fraction without liquid water, or water of wide cells without a fraction."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.readers.fields.air import GRAVITY, saturation_over_ice_pa, saturation_pa, specific_humidity_of

F32 = NDArray[np.float32]
_SURFACE_LIQUID_KG_M3 = 0.21e-3
_WARM_K, _COLD_K = 263.15, 243.15
WIDE_CELL_M = 5000.0  # cells above which condensate does not fill them
XU_RANDALL = "cloud fraction from humidity and condensate (Xu and Randall 1996)"


def liquid_from_cover(
    cover: F32,
    temperature_k: F32,
    specific_humidity: F32,
    pressure_pa: F32,
    height_m: NDArray[Any],
    terrain_m: F32,
) -> F32:
    """Mean liquid content [kg m-3] of cells of which `cover` is cloud, levels upward, all (nz, ny, nx).

    In-cloud water .21 g m-3 exp(-z/h), h = 700 m ln(1 + precipitable water / kg m-2) (Hack 1998, J. Climate 11, 1497:
    the diagnostic of NCAR CCM2 and CCM3), times the liquid share, 1 above -10 degC to 0 below -30 degC (Rasch and
    Kristjansson 1998), times the cover. A climatology: fit for a picture where a file keeps its liquid to itself.
    """
    layers = 0.5 * (specific_humidity[1:] + specific_humidity[:-1]) * (pressure_pa[:-1] - pressure_pa[1:])
    vapour = layers.sum(axis=0) / GRAVITY
    scale_m = 700.0 * np.log1p(np.maximum(vapour, 0.1))
    tall = height_m if np.ndim(height_m) == 3 else np.asarray(height_m)[:, None, None]
    above = np.maximum(tall - terrain_m, 0.0)
    share = np.clip((temperature_k - _COLD_K) / (_WARM_K - _COLD_K), 0.0, 1.0)
    return (_SURFACE_LIQUID_KG_M3 * np.exp(-above / scale_m) * share * cover).astype(np.float32)


def _saturated(temperature_k: F32, pressure_pa: F32) -> F32:
    """Specific humidity at saturation: over water above 0 degC, over ice below -20 degC, in between by share."""
    celsius = temperature_k - np.float32(273.16)
    share = np.clip(-celsius / 20.0, 0.0, 1.0)
    vapour_pa = saturation_pa(celsius) * (1 - share) + saturation_over_ice_pa(celsius) * share
    return specific_humidity_of(vapour_pa, pressure_pa)


def cover_from_humidity(
    condensate: F32, temperature_k: F32, pressure_pa: F32, specific_humidity: F32 | None, relative_humidity: F32 | None
) -> F32:
    """Cloud fraction of a mean condensate [kg kg-1]: RH^.25 (1 - exp(-100 q_c/((1 - RH) q*)^.49)), all (nz, ny, nx).

    Xu and Randall 1996, J. Atmos. Sci. 53, 3084, as in the radiation of GFS and WRF. The model's own relative humidity
    comes before the specific one.
    """
    saturated = _saturated(temperature_k, pressure_pa)
    humidity = relative_humidity
    if humidity is None:
        humidity = (np.float32(0) if specific_humidity is None else specific_humidity) / saturated
    humidity = np.clip(np.nan_to_num(humidity), 0.0, 1.0)
    gap = np.maximum((1 - humidity) * saturated, 1e-9) ** 0.49
    return np.asarray(humidity**0.25 * (1 - np.exp(-100.0 * np.maximum(condensate, 0) / gap)), np.float32)
