"""`observe`: an observation operator of a scene, its cameras and its pyranometers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers, shown, takes
from openswim.assimilation.observing.controls import FLOOR_PER_M, Controls
from openswim.assimilation.observing.core import Core
from openswim.assimilation.observing.instruments import (
    LOWEST_DEG,
    NEAR_SUN_DEG,
    Instrument,
    checked_angle,
    checked_cameras,
    checked_points,
    sun_at,
)
from openswim.assimilation.observing.operator import Operator
from openswim.assimilation.observing.quantities import Quantity
from openswim.assimilation.observing.variables import Variable, variables_of
from openswim.assimilation.observing.watts import watts_of
from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.ground.surface import settled, surface_of
from openswim.lighting import daylight
from openswim.lights.spectrum import solar_irradiance
from openswim.optics.limits import check_wavelengths
from openswim.optics.species import scene_optics
from openswim.pictures.observer import SPACE_M, check_above_ground, check_observer, extent_of, grid_place, place_of
from openswim.scene import Scene
from openswim.scene.frame import scene_frame
from openswim.scene.times import parse_time
from openswim.scene.variables import DIRECT_PREFIX, LEVEL_DIMS
from openswim.solver import Solver
from openswim.transport.engine.interpolation import bilinear

F64 = NDArray[np.float64]

_FINEST = 1e-12  # tolerance that rounding lets a solution reach
_SINGLE = 1e-4  # tolerance from which on single precision is enough

_LEVELS_BESIDE = 2  # of cloud, at which cloud may come to be


@takes
def observe(
    scene: Scene,
    cameras: Sequence[Camera] | Camera = (),
    irradiance: Sequence[Any] = (),
    wavelengths_nm: Sequence[float] = (550.0,),
    time: Any = None,
    sun: tuple[float, float] | None = None,
    controls: Sequence[str] = ("cloud_liquid",),
    quantity: str | Sequence[str] = "radiance",
    where: ArrayLike | None = None,
    heights_m: tuple[float, float] | None = None,
    near_sun_deg: float = NEAR_SUN_DEG,
    lowest_deg: float = LOWEST_DEG,
    floor_per_km: float = 1e3 * FLOOR_PER_M,
    tolerance: float = 3e-3,
    lean: bool = False,
    core: Core | None = None,
) -> Operator:
    """What cameras and pyranometers would measure, as a function of the scene's clouds, with its derivative.

    cameras : as for `render`; ``quantity`` of each, or of all: "radiance", "log_radiance", "reflectance_factor" or
        "ratio" (of channels to the first one).
    time : UTC, when it is observed and lit; by default the scene's. sun : (azimuth, altitude) of its light instead.
    irradiance : (latitude, longitude) of pyranometers, in flat scenes (y, x) in metres: global irradiance, W m-2.
    controls : what may change: "cloud_liquid", "cloud_ice" and other contents, "<species>_effective_radius",
        "<species>_number", "extinction_<name>", "aerosol_extinction", "aerosol_factor", "albedo", "scale" (of each
        camera and channel). Sizes act by extinction alone.
    where, heights_m : at which nodes (nz, ny, nx), or between which heights, cloud may change; by default two levels
        above and below the scene's own clouds. There it lies on a floor of ``floor_per_km`` at least.
    near_sun_deg, lowest_deg : pixels so near to the sun, or so low over a ground camera's horizon, are not used.
    tolerance : of the light that is scattered often; below .0001 it is solved in double precision. core : the
        transport, in place of the one that is made here.
    lean : 26 ordinates and 16 moments of light, in place of the 50 and 25 of `fast`, at half the cost; pictures from
        above are then some 7 % too bright (docs/linear.md).
    """
    wavelengths = np.atleast_1d(numbers("observe: wavelengths_nm", wavelengths_nm)).astype(float)
    check_wavelengths(wavelengths)
    if np.unique(wavelengths).size < wavelengths.size:
        raise UserError(f"observe: wavelengths_nm = {shown(wavelengths_nm)}: give each once, or its light counts twice")
    scene = settled(scene)
    if scene.grid is None:
        raise UserError("observe: the scene has no grid, so that no cloud of it can change")
    frame, day = scene_frame(scene), daylight(scene, time, sun)
    listed, points = checked_cameras(cameras, frame), checked_points(irradiance)
    if not listed and not len(points):
        raise UserError("observe: there are neither cameras nor pyranometers")
    _check_inside(scene, points)
    if day.direction[2] <= 0:
        raise UserError("observe: the sun is down; the linear core knows the light of day alone")
    names = [quantity] * len(listed) if isinstance(quantity, str) else list(quantity)
    if len(names) != len(listed):
        raise UserError(f"observe: {len(names)} quantities are given for {len(listed)} cameras")
    near, low = checked_angle("near_sun_deg", near_sun_deg), checked_angle("lowest_deg", lowest_deg)
    toa = solar_irradiance(wavelengths) / day.distance_au**2
    instruments = []
    for camera, name in zip(listed, names, strict=True):
        lon, lat = place_of(camera)
        place = sun_at(frame, day.direction, lat, lon)
        instruments.append(Instrument(camera, Quantity(name, toa), place, near, low))
    if not _FINEST <= number("observe: tolerance", tolerance) < 1:
        raise UserError(f"observe: tolerance = {tolerance:g}: give a small positive share, {_FINEST:g} or more")
    floor = number("observe: floor_per_km", floor_per_km) / 1e3
    if not 0 < floor < 1:
        raise UserError(f"observe: floor_per_km = {floor_per_km:g}: give a small positive extinction, such as .02")
    allowed = nodes_that_change(scene, variables_of(scene, controls), where, heights_m)
    made = core if core is not None else _core(scene, listed, points, wavelengths, day.direction, tolerance, lean)
    albedo = np.asarray(made.albedo, float)
    held = Controls.of(scene, controls, wavelengths, allowed, albedo, len(listed), floor)
    when = scene.time if time is None else parse_time(time)
    watts = np.zeros((wavelengths.size, len(points)))
    if len(points):
        watts += watts_of(scene, wavelengths, day)[:, None]
    relative = {one.name: one.relative_extinction for one in scene_optics(scene, wavelengths)}
    return Operator(scene, made, held, tuple(instruments), points, relative, watts, day, when, sun)


def _check_inside(scene: Scene, points: F64) -> None:
    """Raise UserError where a pyranometer stands beside the scene."""
    assert scene.grid is not None
    for north, east in points if not scene.grid.periodic else ():
        if grid_place([scene], east, north) is None:
            raise UserError(
                f"observe: the pyranometer at {north:g}, {east:g} is outside the domain: {extent_of(scene.grid)}"
            )


def _core(
    scene: Scene, cameras: tuple[Camera, ...], points: F64, wavelengths: F64, sun: F64, tolerance: float, lean: bool
) -> Core:  # fmt: skip
    """The linear transport of the scene, with what is seen by cameras' rays."""
    terrain_m, views = surface_of(scene, wavelengths).terrain_m, []
    for camera in cameras:
        check_observer(scene, camera, "reference")
        ground_m = ground_under(scene, terrain_m, camera)
        check_above_ground(camera, ground_m)
        views.append(camera.rays(scene_frame(scene), ground_m))
    single = tolerance >= _SINGLE
    return Solver("fast").linear_core(scene, sun, wavelengths, views, points, tolerance, lean, single)


def ground_under(scene: Scene, terrain_m: NDArray[Any], camera: Camera) -> float:
    """Height (m) of the ground below a camera; 0 where it is in space, or not over the grid."""
    found = None if camera.height_m >= SPACE_M else grid_place([scene], *place_of(camera))
    if found is None:
        return 0.0
    return float(bilinear(np.ascontiguousarray(terrain_m), np.array([found[1]]), np.array([found[2]]))[0])


def nodes_that_change(
    scene: Scene, variables: tuple[Variable, ...], where: ArrayLike | None, heights_m: tuple[float, float] | None
) -> NDArray[np.bool_]:
    """Nodes (nz, ny, nx) at which fields on levels may change: those that are given, or those between heights, but for
    the outermost columns of an open grid. All where no control is on levels."""
    assert scene.grid is not None
    shape = scene.grid.shape
    if where is not None:
        out = numbers("observe: where", where).astype(bool)
        if out.shape != shape:
            raise UserError(f"observe: where has shape {out.shape}; the scene has {shape}")
        if not out.any():
            raise UserError("observe: where is nowhere true")
        return out
    if not any("z" in each.dims for each in variables):
        return np.ones(shape, bool)
    height = scene.grid.height_m.reshape(shape[0], *(scene.grid.height_m.shape[1:] or (1, 1)))
    if heights_m is not None:
        between = numbers("observe: heights_m", heights_m)
        if between.shape != (2,):
            raise UserError(f"observe: heights_m is {shown(heights_m)}: give (lowest, highest) in metres")
        low, high = between
        inside = (height >= low) & (height <= high)
    else:
        inside = np.zeros((shape[0], 1, 1), bool)
        levels = np.flatnonzero(_cloudy(scene))
        if levels.size == 0:
            raise UserError("observe: the scene has no cloud: say by heights_m=(low, high) where some may come to be")
        inside[max(levels[0] - _LEVELS_BESIDE, 0) : levels[-1] + _LEVELS_BESIDE + 1] = True
    edge = np.ones(shape[1:], bool)
    if not scene.grid.periodic:
        edge[[0, -1]] = edge[:, [0, -1]] = False
    out = np.broadcast_to(inside, shape) & edge
    if not out.any():
        raise UserError("observe: no node lies between these heights_m")
    return out


def _cloudy(scene: Scene) -> NDArray[np.bool_]:
    """(nz,) levels with any cloud or other particles."""
    out = np.zeros(0 if scene.grid is None else scene.grid.shape[0], bool)
    for name, values in scene.data.data_vars.items():
        if str(name).endswith("_content") or str(name).startswith(DIRECT_PREFIX):
            out |= values.transpose(*LEVEL_DIMS).values.any(axis=(1, 2))
    return out
