"""Candelas and lux: what the light-adapted eye makes of spectral radiance."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.colour.cie import solar_illuminance_lx
from openswim.colour.rgb import to_xyz


def luminance_cd_m2(image: xr.Dataset) -> NDArray[np.float64]:
    """Luminance (y, x) of a rendered image; 22 magnitudes per square second of arc are 1.7e-4."""
    distance = float(image.attrs.get("sun_distance_au", 1.0))
    return np.asarray(to_xyz(image)[..., 1], float) * solar_illuminance_lx() / (4 * np.pi * distance**2)


def illuminance_lx(relative: ArrayLike, wavelengths_nm: ArrayLike, sun_distance_au: float = 1.0) -> float:
    """Lux of spectral irradiance (nw,) over the sun's at its distance."""
    values = np.asarray(relative, float)
    if not values.any():
        return 0.0
    spectrum = xr.DataArray(values, dims="wavelength", coords={"wavelength": np.asarray(wavelengths_nm, float)})
    return float(to_xyz(spectrum)[1]) * solar_illuminance_lx() / sun_distance_au**2
