"""Clouds of a scene taken away and added cell by cell."""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.variables import DIRECT_PREFIX, HYDROMETEORS, LEVEL_DIMS

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
THINNEST_PER_M = 1e-4  # extinction of a cloud: 1 over 10 km
_ROUGH_PER_M = {"liquid": 150.0, "ice": 40.0, "rain": 2.0, "snow": 3.0, "graupel": 1.0}  # extinction of 1 kg m-3
_COMMON = 0.35  # of cloudy columns: levels that fewer have are no part of a typical cloud
_DROP_M = 8e-6


@dataclass(frozen=True)
class Layer:
    """A typical cloud of a scene: amounts by variable and level (nz,), and the height of its middle (m)."""

    amounts: dict[str, F64]
    middle_m: float


def extinction(scene: Scene) -> F64:
    """(nz, ny, nx), 1/m, of all that is cloud, roughly."""
    assert scene.grid is not None
    total = np.zeros(scene.grid.shape)
    for name, factor in _cloud_variables(scene).items():
        total += factor * scene.data[name].values
    return total


def typical_layer(scene: Scene, base_m: float | None = None, thickness_m: float = 400.0) -> Layer:
    """The cloud that is added: the mean of the model's own cloudy cells in its thickest layer; with `base_m`, or where
    the model has none, one of .3 g/m3 of water."""
    grid = scene.grid
    assert grid is not None
    height = grid.height_m if grid.height_m.ndim == 1 else grid.height_m.mean(axis=(1, 2))
    cloudy = extinction(scene) > THINNEST_PER_M
    if base_m is not None or not cloudy.any():
        if base_m is None:
            raise UserError("this model has no cloud to take as a pattern: give the base of clouds in metres (--base)")
        inside = (height >= base_m) & (height <= base_m + thickness_m)
        if not inside.any():
            top_m = base_m + thickness_m
            raise UserError(f"no level of the model lies in {base_m:g} to {top_m:g} m: give another base")
        water = np.where(inside, 3e-4, 0.0)
        return Layer({"liquid_content": water, "liquid_effective_radius": np.where(inside, _DROP_M, 0.0)},
                     base_m + thickness_m / 2)  # fmt: skip
    columns = cloudy.sum(axis=(1, 2))
    peak = int(np.argmax(columns))
    low = high = peak
    while low > 0 and columns[low - 1] > 0:
        low -= 1
    while high < len(columns) - 1 and columns[high + 1] > 0:
        high += 1
    inside = np.zeros(len(columns), bool)
    inside[low : high + 1] = columns[low : high + 1] >= _COMMON * cloudy[low : high + 1].any(axis=0).sum()
    inside[peak] = True
    amounts = {}
    for name in _cloud_variables(scene):
        species = name.removesuffix("_content")
        for each in (name, f"{species}_effective_radius", f"{species}_number"):
            if each in scene.data and scene.data[each].dims == LEVEL_DIMS:
                values = np.where(cloudy, scene.data[each].values, 0.0).sum(axis=(1, 2)) / np.maximum(columns, 1)
                amounts[each] = np.where(inside, values, 0.0)
    weight = np.where(inside, columns, 0)
    return Layer(amounts, float(np.average(height, weights=weight)))


def edited(
    scene: Scene, clear: Mask, add: Mask, layer: Layer, strength: float = 1.0, factor: F64 | float = 1.0
) -> Scene:
    """A scene without cloud in cells `clear`, and with the layer's in cells `add` (both nz, ny, nx) that have less;
    what there was is multiplied by `factor` (ny, nx)."""
    data: dict[str, xr.DataArray] = {}
    names = {*_cloud_variables(scene), *layer.amounts}
    for name in names:
        dims = LEVEL_DIMS
        assert scene.grid is not None
        old = scene.data[name].values if name in scene.data else np.zeros(scene.grid.shape, np.float32)
        new = old.copy()
        if name in _cloud_variables(scene):
            new = new * factor
            new[clear] = 0
        profile = np.broadcast_to(layer.amounts.get(name, np.zeros(len(old)))[:, None, None], old.shape)
        amount = strength if name.endswith("_content") or name.startswith(DIRECT_PREFIX) else 1.0
        new = np.where(add & (profile > 0), np.maximum(new, amount * profile), new)
        data[name] = xr.DataArray(new.astype(np.float32), dims=dims)
    if "cloud_area_fraction" in scene.data:  # what is added fills its cell
        share = np.where(add, 1.0, np.where(clear, 0.0, scene.data["cloud_area_fraction"].values))
        data["cloud_area_fraction"] = xr.DataArray(share.astype(np.float32), dims=LEVEL_DIMS)
    return replace(scene, data=scene.data.assign(data))


def _cloud_variables(scene: Scene) -> dict[str, float]:
    """Names of the amounts of cloud and the extinction of one unit."""
    found = {f"{name}_content": _ROUGH_PER_M[name] for name in HYDROMETEORS if f"{name}_content" in scene.data}
    found |= {str(name): 1.0 for name in scene.data.data_vars if str(name).startswith(DIRECT_PREFIX)}
    return {name: factor for name, factor in found.items() if scene.data[name].dims == LEVEL_DIMS}
