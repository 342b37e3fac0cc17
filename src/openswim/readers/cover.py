"""What a file says of cloud by its cover alone: liquid water diagnosed where only a cloud fraction is given."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.readers.air import GRAVITY

F32 = NDArray[np.float32]
_SURFACE_LIQUID_KG_M3 = 0.21e-3
_WARM_K, _COLD_K = 263.15, 243.15


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
