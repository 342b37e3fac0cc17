"""The ground of a scene at given wavelengths, as transport asks for it (`transport.medium.surface.Surface`)."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.ground import earth
from openswim.ground.albedo import surface_properties
from openswim.ground.cities import city_radiance, sodium_tint
from openswim.ground.footprints import LongFootprints
from openswim.ground.maps import maps_of
from openswim.ground.model import ModelGround
from openswim.ground.reflectance import hemispherical_albedo
from openswim.ground.relief import height_maps, mapped_height, mapped_normals, refined_terrain
from openswim.ground.sample import SurfaceSample
from openswim.ground.streets import WIDEST_M, lamps_seen
from openswim.optics.matter import with_own_vapour
from openswim.scene.aerosol import central_ground_m
from openswim.scene.frame import Frame
from openswim.scene.grid import Grid
from openswim.scene.scene import Scene
from openswim.scene.variables import SURFACE_DIMS

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SceneSurface:
    """The ground of a scene: the user's maps, the scene's own fields, the default Earth's; see `Surface`."""

    scene: Scene
    wavelengths_nm: F64
    lamps: F64 | None = None  # (nw,) L' of what shines with 1 nW cm-2 sr-1; None by day

    @property
    def wider(self) -> SceneSurface | None:
        return None if self.scene.wider is None else replace(self, scene=self.scene.wider)

    def at_wavelengths(self, which: NDArray[np.int64]) -> SceneSurface:
        lamps = None if self.lamps is None else self.lamps[which]
        return replace(self, wavelengths_nm=self.wavelengths_nm[which], lamps=lamps)

    def window(self, rows: slice, columns: slice) -> SceneSurface:
        return replace(self, scene=_ground_of(self.scene, rows, columns))

    # what it is

    @cached_property
    def _model(self) -> ModelGround:
        return ModelGround.of(self.scene, self.wavelengths_nm)

    def sample(
        self, lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike = 0.0, detail: bool = False,
        long: LongFootprints | None = None,
    ) -> SurfaceSample:  # fmt: skip
        return surface_properties(self.scene, lat, lon, self.wavelengths_nm, footprint_m, detail, self._model, long)

    @property
    def pictured(self) -> bool:
        ground, grid = self.scene.ground, self.scene.grid
        return ground is not None and grid is not None and grid.curved and bool(maps_of(ground).albedo)

    def albedo(self, lat: ArrayLike, lon: ArrayLike) -> F64:
        return hemispherical_albedo(self.sample(lat, lon), self.wavelengths_nm)

    def shining(
        self, lat: ArrayLike, lon: ArrayLike, footprint_m: ArrayLike = 0.0, detail: bool = False
    ) -> F64 | None:
        if self.lamps is None or (self.scene.grid is not None and not self.scene.grid.curved):
            return None
        bright = city_radiance(lat, lon, self.scene.ground, footprint_m)
        shining = bright[..., None] * self.lamps
        if detail:
            some = np.flatnonzero((bright > 0) & (np.asarray(footprint_m) < WIDEST_M))
            seen, sodium = lamps_seen(*(v[some] for v in np.broadcast_arrays(lat, lon, footprint_m, bright)))
            shining[some] *= seen[:, None] * (1 + (2 * sodium[:, None] - 1) * sodium_tint(self.wavelengths_nm))
        return np.asarray(shining)

    # how high it is

    @property
    def terrain_m(self) -> F32:
        shape = (1, 1) if self.scene.grid is None else self.scene.grid.shape[1:]
        terrain = np.zeros(shape, np.float32)
        if "surface_altitude" in self.scene.data:
            own = self.scene.data["surface_altitude"].values.astype(np.float32)
            terrain = np.nan_to_num(own).reshape(shape)
        return refined_terrain(self.scene, terrain)

    def finer_terrain_m(self, terrain_m: F32, fineness: int) -> F32:
        return refined_terrain(self.scene, terrain_m, fineness)

    @property
    def mapped(self) -> bool:
        return bool(height_maps(self.scene))

    @property
    def map_outlines(self) -> list[tuple[float, F64, F64]]:
        return [(one.pixel_m, *one.raster.outline()) for one in height_maps(self.scene)]

    def mapped_m(
        self, lat: F64, lon: F64, footprint_m: F64, between: Callable[[F64], F64] | None = None
    ) -> tuple[F64, F64]:
        return mapped_height(height_maps(self.scene), lat, lon, footprint_m, between)

    def mapped_normals(self, frame: Frame, place: F64, up: F64, footprint_m: F64) -> tuple[F64, F64]:
        return mapped_normals(height_maps(self.scene), frame, place, up, footprint_m)

    @property
    def mountains(self) -> bool:
        return self.earth_known and "surface_altitude" in self.scene.data

    @property
    def earth_known(self) -> bool:
        wanted = self.scene.ground is None or self.scene.ground.mountains
        return wanted and earth.has_relief()

    def earth_m(self, lat: F64, lon: F64) -> F64:
        return earth.relief_m(lat, lon)

    def sea(self, lat: F64, lon: F64) -> NDArray[np.bool_]:
        return earth.sea_at_nearest(lat, lon)


def surface_of(scene: Scene, wavelengths_nm: ArrayLike) -> SceneSurface:
    """The ground of a scene and of the wider ones around it."""
    return SceneSurface(scene, np.atleast_1d(np.asarray(wavelengths_nm, float)))


def settled(scene: Scene) -> Scene:
    """The scene, and the wider ones around it, with a background that says all of itself: aerosol that counts from the
    ground of the place, and the scene's own water vapour."""
    air = scene.atmosphere
    if air is None or (air.above_ground(0.0) is air and with_own_vapour(scene) is air):
        return scene
    terrain = surface_of(scene, 550.0).terrain_m
    spacing = (1.0, 1.0) if scene.grid is None else scene.grid.spacing_m()
    return _above_ground(scene, central_ground_m(terrain, spacing))


def _above_ground(scene: Scene, ground_m: float) -> Scene:
    out = copy(scene)
    out.atmosphere = None if scene.atmosphere is None else with_own_vapour(scene).above_ground(ground_m)
    out.wider = scene.wider and _above_ground(scene.wider, ground_m)
    return out


def _ground_of(scene: Scene, rows: slice, columns: slice) -> Scene:
    """What a scene has on the ground in a window."""
    grid = scene.grid
    assert grid is not None
    data = {str(n): v[rows, columns] if v.dims == SURFACE_DIMS else v.isel(y=rows, x=columns)
            for n, v in scene.data.data_vars.items() if "z" not in v.dims}  # fmt: skip
    highest_m = float(data["surface_altitude"].max()) if "surface_altitude" in data else 0.0
    levels_m = np.array([highest_m, highest_m + 1.0])  # nothing is on them, but no ground is above them all
    part = Grid(grid.x[columns], grid.y[rows], levels_m, grid.crs, grid.earth_radius_m)
    fields = xr.Dataset(data).drop_vars(["x", "y", "height"], errors="ignore")
    return Scene(part, fields, scene.atmosphere, {}, scene.time, scene.source, [], scene.ground)
