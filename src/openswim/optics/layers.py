"""The layers of a background aerosol together, where their ground is, and fields that they stand for elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.optics import aerosol
from openswim.scene.aerosol import AerosolProfile, central_ground_m
from openswim.scene.interpolation import smooth_step
from openswim.scene.phase import Mixture, PhaseFunction

if TYPE_CHECKING:
    from openswim.scene.grid import Grid
    from openswim.scene.scene import Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_RIM_SHARE, _RIM_CELLS = 0.15, 2  # of a domain's width, and at least so many cells, over which fields go over
_TOP_SHARE = 0.15  # of a domain's height


@dataclass(frozen=True, eq=False)
class LayerOptics:
    """Layers added: coefficients (nwl, nz) in 1/m; albedo (nwl,) and phase functions (one per wavelength) of the whole
    column."""

    extinction_per_m: F64
    scattering_per_m: F64
    albedo: F64
    phase: list[PhaseFunction]


def layers_optics(layers: Sequence[AerosolProfile], wavelengths_nm: F64, height_m: F64) -> LayerOptics:
    """Layers at heights (nz,) above sea level. The particles of all layers scatter by one phase function, the mean of
    theirs by what each scatters in the whole column."""
    kinds = [aerosol.type_of_profile(layer) for layer in layers] or [aerosol.aerosol_type()]
    albedos = np.array([aerosol.spectral_albedo(kind, wavelengths_nm) for kind in kinds])
    phases = [aerosol.spectral_phase(kind, wavelengths_nm) for kind in kinds]
    zero = np.zeros((wavelengths_nm.size, height_m.size))
    if not layers:
        return LayerOptics(zero, zero, albedos[0], phases[0])
    extinctions = np.array([layer.extinction_per_m(height_m, wavelengths_nm) for layer in layers])
    depths = np.array([layer.optical_depth_at(wavelengths_nm) for layer in layers])
    depths = np.where(depths.sum(axis=0) > 0, depths, 1.0)
    weights = depths * albedos
    weights = np.where(weights.sum(axis=0) > 0, weights, 1.0)
    weights /= weights.sum(axis=0)
    mixed = [_mixed(weights[:, w], [own[w] for own in phases]) for w in range(wavelengths_nm.size)]
    scattering = (extinctions * albedos[:, :, None]).sum(axis=0)
    return LayerOptics(extinctions.sum(axis=0), scattering, (depths * albedos).sum(axis=0) / depths.sum(axis=0), mixed)


def _mixed(weights: F64, phases: list[PhaseFunction]) -> PhaseFunction:
    there = [n for n in range(len(phases)) if weights[n] > 1e-6]
    if len(there) == 1:
        return phases[there[0]]
    share = weights[there] / weights[there].sum()
    return Mixture(share.tolist(), [phases[n] for n in there])


def ground_of_place_m(scene: Scene) -> float:
    """Height above sea level of the ground that a background aerosol counts from; sea level where the scene has no
    terrain."""
    if "surface_altitude" not in scene.data:
        return 0.0
    terrain = scene.data["surface_altitude"]
    if scene.grid is None or terrain.ndim < 2:
        return float(terrain.mean())
    return central_ground_m(terrain.transpose("y", "x").values, scene.grid.spacing_m())


def beside_background(scene: Scene, name: str, extinction: F32) -> F32:
    """Extinction of a species (nz, ny, nx) beside that of the layer which goes on beyond its domain, if there is one.

    Both together are the field within, and the layer alone at the sides and the top.
    """
    layers = [] if scene.atmosphere is None else scene.atmosphere.layers
    layer = next((each for each in layers if each.beyond and each.name == name), None)
    if layer is None or scene.grid is None:
        return extinction
    grid = scene.grid
    height = grid.height_m
    background = layer.extinction_per_m(height, 550.0)[0].astype(np.float32)
    if background.ndim == 1:
        background = background[:, None, None]
    return np.maximum(extinction - background, np.float32(0)) * share_within(grid, scene.wider is None)


def share_within(grid: Grid, sides: bool = True) -> F32:
    """What a domain's own aerosol counts for (nz, ny, nx) or (nz, 1, 1): 1, smoothly none at its top and sides (unless
    it goes on there in a wider one)."""
    heights = grid.height_m if grid.height_m.ndim == 3 else grid.height_m[:, None, None]
    top, low = heights[-1], heights[0]
    share = smooth_step((top - heights) / (_TOP_SHARE * np.maximum(top - low, 1.0)))
    if grid.periodic or not sides:
        return share.astype(np.float32)
    _, ny, nx = grid.shape
    from_side = [smooth_step(_cells_within(n) / max(_RIM_SHARE * n, _RIM_CELLS)) for n in (ny, nx)]
    return (share * from_side[0][:, None] * from_side[1]).astype(np.float32)


def _cells_within(count: int) -> F64:
    place = np.arange(count, dtype=float)
    return np.minimum(place, count - 1 - place)
