"""The skies to compare with: a model's, lit for a frame's time, and the clear sky of that place and time."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.comparison.clear_table import ClearTable
from openswim.comparison.prepared import pixels_of
from openswim.errors import UserError
from openswim.lighting import WAVELENGTHS_NM, light, solver_of, sun_over_camera
from openswim.lights import sun_position
from openswim.optics.chosen import with_aerosol
from openswim.pictures.observer import place_of, terrain_below
from openswim.pictures.viewpoint import LitScene, Viewpoint
from openswim.readers import Neighbourhood, open_scene, states_of
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import scene_frame
from openswim.solver import Solver

F64 = NDArray[np.float64]
Model = Scene | LitScene | str | Path | Sequence[str | Path] | None
LIGHT_MINUTES = 5.0  # light of a model serves frames so near in time
SPARSE = 0.1  # bend of light between neighbours below which no ray is followed: see `transport.view.sparse`
DEFAULT_ALBEDO = 0.15
_EPOCH, _LIGHT = np.datetime64("1970-01-01", "ms"), np.timedelta64(int(60_000 * LIGHT_MINUTES), "ms")


@dataclass(eq=False)
class Skies:
    """A model (None: the clear sky alone) as cameras see it; light is solved when it is first asked for, and kept while
    frames are near in time.

    detail: whether more is seen of near clouds and land than the model knows (decisions 17 and 20), by default where
    the solver has it and not in a `table`: pictures look like photographs by it, but no more like the real sky, and
    cost twice as much. A model that is a `LitScene` is seen as it was lit.
    """

    model: Model
    solver: str | Solver = "fast"
    aod: float | None = None
    albedo: float | None = None
    sun: tuple[float, float] | None = None  # in place of the frames' times
    table: bool = False  # clear skies by interpolation in solar altitude: for many frames
    detail: bool | None = None
    member: int | None = None  # of an ensemble
    _lit: tuple[Any, LitScene] | None = field(default=None, repr=False)
    _clear: dict[Any, LitScene] = field(default_factory=dict, repr=False)
    _tables: dict[Any, ClearTable] = field(default_factory=dict, repr=False)
    _states: list[tuple[np.datetime64 | None, list[Path]]] | None = field(default=None, repr=False)
    _place: tuple[float, float] | None = field(default=None, repr=False)  # of a flat model
    _picture: tuple[LitScene, Camera, Viewpoint, xr.Dataset] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        chosen = solver_of(self.solver)
        detail = chosen.detail and not self.table if self.detail is None else self.detail
        self.solver = replace(chosen, detail=detail)

    def sun_at(self, camera: Camera, time: np.datetime64) -> tuple[float, float]:
        """Azimuth and altitude (degrees) at which the sun is seen, or from which its twilight comes."""
        if self.sun is not None:
            return self.sun
        place = sun_position(time, *self.place_of_camera(camera, time))
        return place.azimuth_deg, place.lit_altitude_deg

    def on_earth(self, camera: Camera, time: np.datetime64) -> Camera:
        """The camera as it stands under a clear sky, which is round: one at x and y is at its flat scene's place."""
        if camera.lat is not None:
            return camera
        lat, lon = (0.0, 0.0) if self.sun is not None else self.place_of_camera(camera, time)
        return replace(camera, x_m=None, y_m=None, lat=lat, lon=lon)

    def simulated(self, camera: Camera, time: np.datetime64) -> xr.Dataset:
        """The model's picture, or that of the clear sky."""
        if self.model is None:
            return self._clear_view(camera, time, self.aod)
        lit, kept = self._model_lit(camera, time), self._picture
        if kept is None or kept[0] is not lit or kept[1] is not camera:  # what has the same light looks the same
            eye = lit.viewpoint(camera)
            kept = self._picture = lit, camera, eye, eye.view(irradiance=not self.table, sparse=SPARSE)
        return kept[3]

    def with_irradiance(self, image: xr.Dataset) -> xr.Dataset:
        """A simulated picture with the irradiance at its observer among the attributes, which it lacks in a series."""
        if self._picture is None or self._picture[3] is not image:
            return image
        return image.assign_attrs(self._picture[2].attrs)

    def clear(self, camera: Camera, time: np.datetime64, aod: float | None = None) -> F64:
        """Radiance (ny, nx, 3; W m-2 sr-1 nm-1) of the clear sky; `aod` in place of that which the model has."""
        aod = self.aod if aod is None else aod
        if not self.table:
            return np.asarray(self._clear_view(camera, time, aod).radiance.values, float)
        atmosphere, albedo, ground_m = self._air(camera, time, aod)
        eye_m = camera.height_above_sea_m(ground_m) - ground_m
        key = (camera.lat, camera.lon, aod, albedo, ground_m, eye_m)
        if key not in self._tables:
            self._tables[key] = ClearTable(atmosphere, albedo, ground_m, eye_m, self.solver)
        distance_au = 1.0 if self.sun is not None else sun_position(time, 0.0, 0.0).distance_au
        return self._tables[key].radiance(pixels_of(camera), self.sun_at(camera, time), distance_au)

    def aerosol_depth(self, camera: Camera, time: np.datetime64) -> float:
        """At 550 nm, of the background."""
        air = self._air(camera, time, self.aod)[0]
        return 0.0 if air is None else float(air.aerosol_depth_at(550.0))

    def scene(self, camera: Camera, time: np.datetime64) -> Scene:
        """The model's scene that is nearest to a time; raises UserError where the camera's place is of another kind."""
        scene = self._scene(camera, time)
        camera.check_frame(scene_frame(scene).curved)
        return scene

    def _scene(self, camera: Camera, time: np.datetime64) -> Scene:
        if isinstance(self.model, LitScene):
            return self.model.scene
        if isinstance(self.model, Scene):
            return self.model
        assert self.model is not None
        around = None
        if camera.lat is not None and camera.lon is not None:
            around = Neighbourhood.seen_from(camera.lat, camera.lon, camera.height_m, True)
        chosen, files = self.state_at(time)
        return open_scene(files, time=chosen, around=around, member=self.member)

    def state_at(self, time: np.datetime64) -> tuple[np.datetime64 | None, list[Path]]:
        """The model's time that is nearest to another, and the files that hold it."""
        return min(self.states(), key=lambda state: abs((time if state[0] is None else state[0]) - time))

    @property
    def invents(self) -> bool:
        """Whether pictures show more of near clouds and land than the model knows."""
        return bool((self.model.field.solver if isinstance(self.model, LitScene) else solver_of(self.solver)).detail)

    @property
    def of_files(self) -> bool:
        """Whether the model is to be read."""
        return not (self.model is None or isinstance(self.model, Scene | LitScene))

    def states(self) -> list[tuple[np.datetime64 | None, list[Path]]]:
        """The times of a model's files, each with those that hold it; looked for once."""
        if self._states is None:
            self._states = states_of(self.model)  # type: ignore[arg-type]
        return self._states

    def _model_lit(self, camera: Camera, time: np.datetime64) -> LitScene:
        if isinstance(self.model, LitScene):
            return self.model
        number = light_number(time)
        # of files the part around the camera is read; a Scene has the same light for all cameras
        alike = isinstance(self.model, Scene) and self.sun is None
        key = (number if self.table else time, *(() if alike else (camera.lat, camera.lon)))
        if self._lit is None or self._lit[0] != key:
            self._lit = self._picture = None  # memory is for the light that is solved now
            # the middle of the minutes that this light serves: it is the same whichever frame asks for it first
            when = _EPOCH + number * _LIGHT if self.table else time
            scene = self.scene(camera, when)
            if self.aod is not None:
                scene = with_aerosol(scene, None, self.aod)
            sun = sun_over_camera(scene, camera, self.sun)
            self._lit = key, light(scene, self.solver, WAVELENGTHS_NM, None if sun else when, sun)
        return self._lit[1]

    def place_of_camera(self, camera: Camera, time: np.datetime64) -> tuple[float, float]:
        """Latitude and longitude of a camera, of one at x and y those of its flat scene."""
        if camera.lat is not None and camera.lon is not None:
            return camera.lat, camera.lon
        if self.model is None:
            raise UserError("compare: the clear sky of a place needs that place: give the camera lat and lon")
        if self._place is None:
            self._place = self.scene(camera, time).place
        return self._place

    def _clear_view(self, camera: Camera, time: np.datetime64, aod: float | None) -> xr.Dataset:
        return self._clear_lit(camera, time, aod).viewpoint(self.on_earth(camera, time)).view()

    def _clear_lit(self, camera: Camera, time: np.datetime64, aod: float | None) -> LitScene:
        atmosphere, albedo, ground_m = self._air(camera, time, aod)
        key = (str(time), camera.lat, camera.lon, aod, albedo, ground_m)
        if key not in self._clear:
            self._clear.clear()
            lon, lat = place_of(self.on_earth(camera, time))
            scene = Scene.clear(lat, lon, atmosphere, albedo, ground_m)
            self._clear[key] = light(scene, self.solver, WAVELENGTHS_NM, None if self.sun else time, self.sun)
        return self._clear[key]

    def _air(self, camera: Camera, time: np.datetime64, aod: float | None) -> tuple[Atmosphere | None, float, float]:
        """Atmosphere, albedo and height of the ground that the model has; defaults where there is none."""
        air, albedo, ground_m = Atmosphere.us_standard(), DEFAULT_ALBEDO if self.albedo is None else self.albedo, 0.0
        if self.model is None:
            return air if aod is None else air.with_aerosol_depth(aod), albedo, ground_m
        scene = self._lit[1].scene if self._lit is not None else self.scene(camera, time)
        if aod is not None:
            scene = with_aerosol(scene, None, aod)
        if scene.grid is not None:
            ground_m = _ground_m(scene, camera)
            if self.albedo is None and "surface_albedo" in scene.data:
                albedo = float(np.clip(scene.data.surface_albedo.mean(), 0, 1))
        return scene.atmosphere, albedo, ground_m


def light_number(time: np.datetime64) -> int:
    """Which of a series' lights a time belongs to, of which each serves the minutes around a full five."""
    return int(np.floor((time - _EPOCH) / _LIGHT + 0.5))


def _ground_m(scene: Scene, camera: Camera) -> float:
    """Of the model under the camera, or in the mean where it does not stand in the domain; never above the camera's own
    height above sea level: what a model has for a valley may be higher."""
    terrain_m = terrain_below(scene.levels, *place_of(camera))
    if terrain_m is None:
        terrain_m = float(scene.data.surface_altitude.mean()) if "surface_altitude" in scene.data else 0.0
    return max(min(terrain_m, camera.height_m) if camera.above == "sea level" else terrain_m, 0.0)
