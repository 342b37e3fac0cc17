"""`render`: from a scene and a camera to an image of calibrated spectral radiance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from openswim.arguments import shown, takes
from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.lighting import WAVELENGTHS_NM, checked_wavelengths, daylight, light, solver_of, sun_over_camera
from openswim.pictures.images import check_fits, check_layers
from openswim.pictures.observer import check_observer
from openswim.pictures.viewpoint import LitScene
from openswim.scene import Scene
from openswim.scene.frame import azimuth_altitude
from openswim.scene.times import parse_time
from openswim.solver import Solver

_SAME_SUN = np.cos(np.radians(0.01))  # nobody gives angles more finely


@takes
def render(
    scene: Scene | LitScene,
    camera: Camera,
    solver: str | Solver = "fast",
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    time: Any = None,
    sun: tuple[float, float] | None = None,
    layers: bool = False,
    sparse: float = 0.0,
) -> xr.Dataset:
    """Image of a scene: what a calibrated camera would measure.

    Parameters: a scene (or the result of `light`, then solver, wavelengths, time and sun are the light's, and others
    are refused); a camera; "fast", "swim", "reference" or a `Solver`; wavelengths (nm, any number); time (UTC, default
    the scene's); sun = (azimuth, altitude) in degrees over the camera instead of a time.

    Returns a Dataset on (y, x, wavelength): ``radiance`` (W m-2 sr-1 nm-1), ``solar_relative_radiance`` (Albers et
    al. 2020, Eq. 2); coordinates on (y, x): ``azimuth``, ``altitude`` (degrees), ``latitude``, ``longitude`` where the
    ray ends on the ground; attributes with place, time, sun, solver and the irradiance at the observer. "reference"
    adds ``radiance_standard_error``, the paths per pixel and the mean error. layers=True adds what is seen in each
    pixel (``seen``), its ``distance`` and ``height`` (m), and the ``optical_depth`` of each species on (species, y, x).

    sparse: for pictures that are only looked at, up to a third faster: pixels between neighbours along whose rows and
    columns light bends by no more than this over its mean get theirs. At .015 they are within .2 % rms of what all rays
    see, and, but for one in a thousand, 1.7 %. Solver "reference" follows all rays.
    """
    if not 0 <= sparse < 1:
        raise UserError(f"sparse is {sparse:g}: give a bend of light over its mean from 0 to below 1, such as .015")
    if isinstance(scene, LitScene):
        _check_as_lit(scene, camera, solver, wavelengths_nm, time, sun)
        return scene.viewpoint(camera).view(layers, sparse=sparse)
    check_fits(camera.shape, checked_wavelengths(wavelengths_nm).size)
    chosen = solver_of(solver)
    part = _needed(scene, camera, chosen.name)
    check_observer(part, camera, chosen.name)
    check_layers(layers, chosen.name)
    sun = sun_over_camera(part, camera, sun)
    return light(part, chosen, wavelengths_nm, time, sun).viewpoint(camera).view(layers, sparse=sparse)


def _check_as_lit(
    lit: LitScene, camera: Camera, solver: str | Solver, wavelengths_nm: Any, time: Any, sun: tuple[float, float] | None
) -> None:
    """Raise UserError where an option is given of which the light, which is solved already, has another."""
    field = lit.field
    asked, its_own = vars(solver_of(solver)), vars(field.solver)
    others = [f"{name} = {value!r}" for name, value in its_own.items() if asked[name] != value]
    if solver != "fast" and others:
        raise _solved_with("solver", solver, f"a Solver of {', '.join(others)}")
    if wavelengths_nm is not WAVELENGTHS_NM:  # not left out
        given = checked_wavelengths(wavelengths_nm)
        if given.shape != np.shape(field.wavelengths_nm) or not np.allclose(given, field.wavelengths_nm, 1e-6, 0):
            its = f"wavelengths_nm = {np.array(field.wavelengths_nm).tolist()}"
            raise _solved_with("wavelengths_nm", wavelengths_nm, its)
    toward = lit.daylight.direction
    azimuth, altitude = azimuth_altitude(toward)
    its = f"sun = ({azimuth:.2f}, {altitude:.2f})" if lit.time is None else f"time = {lit.time}"
    if time is not None and parse_time(time) != lit.time:
        raise _solved_with("time", time, its)
    if sun is not None:
        # over the camera, as here, or over the middle of the scene, as `light` takes it
        over = [daylight(lit.scene, None, each).direction for each in (sun, sun_over_camera(lit.scene, camera, sun))]
        if max(float(each @ toward) for each in over) < _SAME_SUN:
            raise _solved_with("sun", sun, its)


def _solved_with(name: str, given: Any, its: str) -> UserError:
    return UserError(
        f"{name} = {shown(given)}: the light was solved with {its}; leave it out, or solve again with "
        f"openswim.light(scene, {name}=...)"
    )


def _needed(scene: Scene, camera: Camera, solver: str) -> Scene:
    """The part of a scene of very many columns, or of a large part of the Earth, that a view needs."""
    from openswim.readers import Neighbourhood, seen_part

    if camera.lat is None or camera.lon is None:
        return scene
    return seen_part(scene, Neighbourhood.seen_from(camera.lat, camera.lon, camera.height_m, solver != "reference"))
