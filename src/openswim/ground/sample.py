"""What the ground is at given places, whoever knows it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.ground import water

FloatArray = NDArray[np.float64]


@dataclass
class SurfaceSample:
    """The ground at n places.

    albedo: (n, nwl) of all that is not open water (land, snow, ice); water: open-water fraction; snow: share
    of the rest that reflects like snow; sea_ice: sea-ice fraction of the place; wind_speed: m/s at 10 m;
    chlorophyll: mg m-3 in the water; all (n,). lambertian: reflect the same in all directions (reference cases).
    mean_square_slope: of the waves (n,), where something else than the wind tells it; None: by the wind.
    """

    albedo: FloatArray
    water: FloatArray
    snow: FloatArray
    sea_ice: FloatArray
    wind_speed: FloatArray
    chlorophyll: FloatArray
    lambertian: bool = False
    mean_square_slope: FloatArray | None = None

    @property
    def slope_variance(self) -> FloatArray:
        """Variance of the waves' slopes (n,), both directions summed: as it is known, else by the wind."""
        return water.mean_square_slope(self.wind_speed) if self.mean_square_slope is None else self.mean_square_slope

    def __getitem__(self, where: NDArray[Any]) -> SurfaceSample:
        """Some of the places."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "lambertian"}
        return replace(self, **{name: values[where] for name, values in arrays.items() if values is not None})
