"""Light: a scene and its sun solved for once, for as many cameras as one likes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import shown, takes
from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.ground.surface import settled
from openswim.heavens.eyes import LitBy
from openswim.heavens.lamps import Lamps, lamps_of, shadow_over
from openswim.kept_light import read_light
from openswim.lights import subsolar_point, sun_position
from openswim.lights.daylight import Daylight
from openswim.lights.eclipses import MoonShadow
from openswim.lights.refraction import lit_altitude_deg
from openswim.optics.limits import check_wavelengths
from openswim.pictures.viewpoint import LitScene
from openswim.scene import Scene
from openswim.scene.frame import azimuth_altitude, scene_frame
from openswim.scene.times import parse_time
from openswim.solver import Solver
from openswim.transport import EarlierLight, Field

F64 = NDArray[np.float64]

WAVELENGTHS_NM = (615.0, 546.0, 450.0)  # the paper's red, green, blue
_DUSK_DEG = -18.0  # the sun's altitude at which astronomical twilight ends


def daylight(scene: Scene, time: Any = None, sun: tuple[float, float] | None = None) -> Daylight:
    """The sun at a time (UTC; the scene's own by default), or at ``sun`` = (azimuth, altitude) degrees over
    the middle of the scene.

    Its direction is raised by atmospheric refraction at the centre of the scene, so that it sets when it should;
    rays themselves are straight.
    """
    frame = scene_frame(scene)
    if sun is not None:
        return Daylight(frame.direction(*_checked_sun(sun), frame.lat, frame.lon))
    when = scene.time if time is None else time
    if when is None:
        raise UserError("the scene has no time: give time=... (UTC, --time) or sun=(azimuth, altitude) (--sun)")
    place = sun_position(when, *((frame.lat, frame.lon) if frame.curved else scene.place))
    lit_from_deg = float(lit_altitude_deg(place.altitude_deg))
    if not frame.curved:
        direction = frame.direction(place.azimuth_deg, lit_from_deg, 0.0, 0.0)
        return Daylight(direction, place.distance_au, place.angular_radius_deg)
    direction = frame.enu(*subsolar_point(when))[2]
    lift = np.radians(lit_from_deg - place.altitude_deg)
    if lift > 0:
        up = np.array([0.0, 0.0, 1.0])
        tangent = up - direction * direction[2]
        direction = direction * np.cos(lift) + tangent / max(np.linalg.norm(tangent), 1e-9) * np.sin(lift)
    return Daylight(direction, place.distance_au, place.angular_radius_deg)


def sun_over_camera(scene: Scene, camera: Camera, sun: tuple[float, float] | None) -> tuple[float, float] | None:
    """Azimuth and altitude (degrees) over the middle of a scene of a sun that stands at ``sun`` over a camera."""
    frame = scene_frame(scene)
    if sun is None or not frame.curved or camera.lat is None or camera.lon is None:
        return sun
    return azimuth_altitude(frame.direction(*_checked_sun(sun), camera.lat, camera.lon))


def _checked_sun(sun: Any) -> tuple[float, float]:
    try:
        azimuth, altitude = (float(angle) for angle in sun)
    except (TypeError, ValueError):
        azimuth = altitude = np.nan
    if not (np.isfinite(azimuth) and -90 <= altitude <= 90):
        raise UserError(f"sun = {shown(sun)}: give (azimuth, altitude) in degrees, the altitude within -90..90")
    return azimuth, altitude


def checked_wavelengths(wavelengths_nm: Any) -> F64:
    """(n,), each once, as data are told apart by them, and of which light can be solved for."""
    try:
        wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    except (TypeError, ValueError, OverflowError):
        wavelengths = np.empty((0, 0))
    if wavelengths.ndim != 1 or np.unique(wavelengths).size < wavelengths.size:
        raise UserError(f"wavelengths_nm = {shown(wavelengths_nm)}: give a list of numbers, each once")
    check_wavelengths(wavelengths)
    return wavelengths


def solver_of(solver: str | Solver) -> Solver:
    return solver if isinstance(solver, Solver) else Solver(solver)


@takes
def light(
    scene: Scene,
    solver: str | Solver = "fast",
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    time: Any = None,
    sun: tuple[float, float] | None = None,
    earlier: EarlierLight | None = None,
) -> LitScene:
    """Solve the light of a scene once, to render it from many cameras (`render` does this by itself for one).

    sun: azimuth and altitude (degrees) over the middle of the scene, in place of a time.
    earlier: an `openswim.transport.EarlierLight`, handed to one solve after the other of a series of times: solver fast
    begins from what the one before has left there. It takes up to a quarter less time where clouds change little
    between them, and light is the same within the solver's tolerance, not bit for bit.
    """
    wavelengths = checked_wavelengths(wavelengths_nm)
    if time is not None and sun is not None:
        raise UserError(f"time = {shown(time)} and sun = {shown(sun)}: give one of them, both say where the sun stands")
    scene = settled(scene)
    day = daylight(scene, time, sun)
    when = scene.time if time is None else parse_time(time)
    chosen = solver_of(solver)
    if not scene_frame(scene).curved and _DUSK_DEG < (altitude := azimuth_altitude(day.direction)[1]) < 0:
        warnings.warn(
            f"the sun is {-altitude:.1f} degrees below the horizon of a flat Earth, which has no dusk: it lights "
            "nothing; give a sun above the horizon, or open the file at a place (around=; --lat and --lon)",
            stacklevel=3,
        )
    lamps = None if sun is not None or when is None else _lamps(scene, when, day, wavelengths)
    at = None if sun is not None else when
    if lamps is None or chosen.name == "reference" or _is_day(lamps):
        shadow = None if lamps is None else lamps.shadow
        field = chosen.solve(scene, day.direction, wavelengths, shadow=shadow, earlier=earlier)
        alone = None if lamps is None else lamps.sun_alone()
        for line in [] if alone is None else alone.stated():
            warnings.warn(f"solver {chosen.name}: {line}: take fast", stacklevel=3)
        return LitScene(scene, field, day, at, lamps=alone)
    lights = []
    for lamp in lamps.every:
        if lamp.direction is None:
            found = chosen.solve_starlit(scene, wavelengths, lamp.towns, earlier)
        else:
            found = chosen.solve(
                scene, lamp.direction, wavelengths, shadow=lamp.shadow, earlier=earlier, light=lamp.name
            )
        assert isinstance(found, Field)
        lights.append(LitBy(lamp.name, found, lamp.strength))
    return LitScene(scene, lights[0].field, day, at, lamps=lamps, lights=tuple(lights))


def lights_of(
    scene: Scene, solver: str = "fast", wavelengths_nm: Sequence[float] = WAVELENGTHS_NM, time: Any = None,
    sun: tuple[float, float] | None = None,
) -> int:  # fmt: skip
    """How many lights (sun, moon, night sky with towns) `light` would solve a scene for, one after the other."""
    when = scene.time if time is None else parse_time(time)
    if sun is not None or when is None or solver == "reference":
        return 1
    scene = settled(scene)
    lamps = _lamps(scene, when, daylight(scene, time), checked_wavelengths(wavelengths_nm))
    return 1 if _is_day(lamps) else len(lamps.every)


def sun_altitude_deg(scene: Scene, time: Any = None, sun: tuple[float, float] | None = None) -> float:
    """Altitude from which the sun lights the middle of a scene, as `daylight` takes time and ``sun``."""
    return azimuth_altitude(daylight(scene, time, sun).direction)[1]


def _lamps(scene: Scene, when: Any, day: Daylight, wavelengths: F64) -> Lamps:
    """The lights over the middle of a scene."""
    towns = scene.levels[-1].grid is not None
    return lamps_of(when, _middle(scene), scene_frame(scene), day, wavelengths, scene.ground, _reach_deg(scene), towns)


def moon_shadow(scene: Scene, when: Any) -> MoonShadow | None:
    """The moon's shadow in an eclipse of the sun, where it is on the scene or near it; a time is known."""
    return shadow_over(when, _middle(scene), _reach_deg(scene))


def _middle(scene: Scene) -> tuple[float, float]:
    frame = scene_frame(scene)
    return (frame.lat, frame.lon) if frame.curved else scene.place


def _reach_deg(scene: Scene) -> float:
    """How far a scene goes from its middle, over the Earth."""
    grid = scene.levels[-1].grid
    return 0.0 if grid is None else float(np.degrees(0.5 * np.hypot(*grid.size_m()) / grid.earth_radius_m))


def _is_day(lamps: Lamps) -> bool:
    """Whether the whole sun alone lights the scene."""
    sun_alone = [lamp.name for lamp in lamps.every] == ["sun"] and bool((lamps.every[0].strength == 1).all())
    return sun_alone and lamps.shadow is None


@takes
def open_light(path: str | os.PathLike[str], scene: Scene | None = None) -> LitScene:
    """Light that `LitScene.save` has kept: pictures from it are those of the light that was saved, bit for bit.

    scene: that which was lit, to be used in place of the one that was kept with the light; needed where it has the
    user's own maps of the ground. Raises UserError where the folder holds no light, that of another version, or of
    another scene than is given.
    """
    scene, lights, whole_sun, day, when = read_light(path, None if scene is None else settled(scene))
    field = lights[0].field
    lamps = None if when is None else _lamps(scene, when, day, field.wavelengths_nm)
    if whole_sun:
        return LitScene(scene, field, day, when, lamps=None if lamps is None else lamps.sun_alone())
    every = tuple(LitBy(light.name, light.field, light.strength) for light in lights)
    return LitScene(scene, field, day, when, lamps=lamps, lights=every)
