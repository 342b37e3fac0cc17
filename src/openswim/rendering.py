"""`render`: from a scene and a camera to an image of calibrated spectral radiance."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import openswim
from openswim.arguments import check_kind
from openswim.cameras import Camera, Rays
from openswim.errors import UserError
from openswim.irradiance import broadband, gases_above, quadrature_directions, spectral_irradiance
from openswim.lights import disc_coverage, solar_irradiance, subsolar_point, sun_position
from openswim.outlines import soften
from openswim.scene import Scene
from openswim.scene.frame import horizon_vector, scene_frame
from openswim.scene.grid import EDGE, extent_text
from openswim.scene.times import parse_time
from openswim.transport import Field, ReferenceField, Solver
from openswim.transport.montecarlo import PATHS, ReferenceView
from openswim.transport.planes import bilinear

F64 = NDArray[np.float64]

WAVELENGTHS_NM = (615.0, 546.0, 450.0)  # the paper's red, green, blue
_SPACE_M = 1e5
_QUADRATURE = 32  # .3 % off 64 under broken clouds, where 8 are 5 %
_SPREAD = 16  # so many times fewer paths a ray has where the rays' sum alone is asked for


@dataclass(frozen=True)
class Daylight:
    """The sun over a scene: ``direction`` (3,) in the scene frame, distance (au) and angular radius (degrees)."""

    direction: F64
    distance_au: float = 1.0
    angular_radius_deg: float = 0.2666


@dataclass(frozen=True)
class LitScene:
    """A scene with its field of light solved: render it from as many cameras as you like."""

    scene: Scene
    field: Field | ReferenceField
    daylight: Daylight
    time: np.datetime64 | None
    irradiances: dict[bytes, dict[str, Any]] = dataclasses.field(
        default_factory=dict, repr=False, compare=False
    )  # of places that a picture has been made from


def daylight(scene: Scene, time: Any = None, sun: tuple[float, float] | None = None) -> Daylight:
    """The sun at a time (UTC; the scene's own by default), or at ``sun`` = (azimuth, altitude) degrees.

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
    if not frame.curved:
        direction = frame.direction(place.azimuth_deg, place.refracted_altitude_deg, 0.0, 0.0)
        return Daylight(direction, place.distance_au, place.angular_radius_deg)
    direction = frame.enu(*subsolar_point(when))[2]
    lift = np.radians(place.refracted_altitude_deg - place.altitude_deg)
    if lift > 0:
        up = np.array([0.0, 0.0, 1.0])
        tangent = up - direction * direction[2]
        direction = direction * np.cos(lift) + tangent / max(np.linalg.norm(tangent), 1e-9) * np.sin(lift)
    return Daylight(direction, place.distance_au, place.angular_radius_deg)


def _checked_sun(sun: Any) -> tuple[float, float]:
    try:
        azimuth, altitude = (float(angle) for angle in sun)
    except (TypeError, ValueError):
        azimuth = altitude = np.nan
    if not (np.isfinite(azimuth) and -90 <= altitude <= 90):
        raise UserError(f"sun = {sun!r}: give (azimuth, altitude) in degrees, the altitude within -90..90")
    return azimuth, altitude


def _checked_wavelengths(wavelengths_nm: Any) -> F64:
    """(n,), each once: data are told apart by them."""
    try:
        wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    except (TypeError, ValueError):
        wavelengths = np.empty((0, 0))
    if wavelengths.ndim != 1 or np.unique(wavelengths).size < wavelengths.size:
        raise UserError(f"wavelengths_nm = {wavelengths_nm!r}: give a list of numbers, each once")
    return wavelengths


def _solver(solver: str | Solver) -> Solver:
    return solver if isinstance(solver, Solver) else Solver(solver)


def light(
    scene: Scene,
    solver: str | Solver = "fast",
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    time: Any = None,
    sun: tuple[float, float] | None = None,
) -> LitScene:
    """Solve the light of a scene once, to render it from many cameras (`render` does this by itself for one)."""
    check_kind("scene", scene, Scene, "give one: open_scene(path) first")
    wavelengths = _checked_wavelengths(wavelengths_nm)
    day = daylight(scene, time, sun)
    when = scene.time if time is None else parse_time(time)
    field = _solver(solver).solve(scene, day.direction, wavelengths)
    return LitScene(scene, field, day, None if sun is not None else when)


def render(
    scene: Scene | LitScene,
    camera: Camera,
    solver: str | Solver = "fast",
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    time: Any = None,
    sun: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Image of a scene: what a calibrated camera would measure.

    Parameters: a scene (or the result of `light`, then the other options are taken from it); a camera; "fast",
    "swim", "reference" or a `Solver`; wavelengths (nm, any number); time (UTC, default the scene's);
    sun = (azimuth, altitude) in degrees instead of a time.

    Returns a Dataset on (y, x, wavelength): ``radiance`` (W m-2 sr-1 nm-1), ``solar_relative_radiance`` (Albers et
    al. 2020, Eq. 2); coordinates on (y, x): ``azimuth``, ``altitude`` (degrees), ``latitude``, ``longitude`` where the
    ray ends on the ground; attributes with place, time, sun, solver and the irradiance at the observer. "reference"
    adds ``radiance_standard_error``, the paths per pixel and the mean error.
    """
    check_kind("camera", camera, Camera, "give one, such as Camera.allsky(lat, lon)")
    if isinstance(scene, LitScene):
        lit = scene
        _check_observer(lit.scene, camera, lit.field.solver.name)
    else:
        check_kind("scene", scene, Scene, "give one: open_scene(path) first")
        chosen = _solver(solver)
        part = _needed(scene, camera, chosen.name)
        _check_observer(part, camera, chosen.name)
        lit = light(part, chosen, wavelengths_nm, time, sun)
    field, frame = lit.field, lit.field.frame
    ground_m = _ground_below(lit, camera)
    pixels = camera.pixels()
    rays = camera.rays(frame, ground_m, pixels)
    sun_azimuth, sun_altitude = _sun_at(lit, camera)
    attrs = _attributes(lit, camera, sun_azimuth, sun_altitude)
    near = camera.height_above_sea_m(ground_m) < _SPACE_M
    if near:
        # before the view, which ends with light toward another eye where there is water
        place = np.asarray(rays.origin_m, float).tobytes()
        if place not in lit.irradiances:
            lit.irradiances[place] = _irradiance(lit, rays.origin_m, camera, sun_azimuth, sun_altitude)
        attrs |= lit.irradiances[place]
    view = field.view(rays)
    relative = view.radiance.astype(np.float32)
    # from space pixels are about as long on the ground as they are wide, and are seen as one
    if near and not isinstance(field, ReferenceField) and frame.curved:
        soften(relative, view, field, rays, pixels)
    _add_disc(relative, view, lit, np.asarray(pixels.angle_to_deg(sun_azimuth, sun_altitude)).ravel(), pixels)
    image = _dataset(lit, pixels, relative, view, attrs)
    if isinstance(view, ReferenceView):
        _add_errors(image, pixels, view, lit.field.solver.seed)
    return image


def _needed(scene: Scene, camera: Camera, solver: str) -> Scene:
    """The part of a scene of very many columns, or of a large part of the Earth, that a view needs."""
    from openswim.readers.beyond import far_m, with_beyond
    from openswim.readers.neighbourhood import Mesh, Neighbourhood, is_large, part_of, reach_m

    grid = scene.grid
    if scene.wider is not None or grid is None or grid.crs is None or camera.lat is None or camera.lon is None:
        return scene
    if not is_large(Mesh(grid.x, grid.y, grid.crs, grid.earth_radius_m)):
        return scene
    far = 0.0 if solver == "reference" else far_m(camera.height_m)
    around = Neighbourhood(camera.lat, camera.lon, reach_m(camera.height_m), if_large=True, far_m=far)
    return with_beyond(part_of(scene, around), around, lambda beyond: part_of(scene, beyond))


def _add_errors(image: xr.Dataset, pixels: Any, view: ReferenceView, seed: int) -> None:
    """What Monte Carlo knows of its own noise."""
    scale = (image["solar_irradiance"].values / (4 * np.pi)).astype(np.float32)
    image["radiance_standard_error"] = (
        ("y", "x", "wavelength"), pixels.image(view.sigma * scale),
        {"long_name": "standard error of the spectral radiance", "units": "W m-2 sr-1 nm-1"},
    )  # fmt: skip
    image["radiance"].attrs["ancillary_variables"] = "radiance_standard_error"
    image.attrs |= {
        "paths_per_pixel": view.paths, "seed": seed, "interrupted": int(view.interrupted),
        "mean_error_percent": round(100 * view.mean_error, 4),
    }  # fmt: skip


def _check_observer(scene: Scene, camera: Camera, solver: str) -> None:
    """Complain where the observer is outside the domain or buried; needs no light."""
    height = camera.height_m
    if not np.isfinite(height) or height < 0:
        raise UserError(f"the observer is {-height:g} m under the ground: give --height of 0 m or more")
    camera.check_frame(scene_frame(scene).curved)
    if scene.grid is None or scene.grid.periodic or _aloft(camera):
        return
    levels = scene.levels[:1] if solver == "reference" else scene.levels
    if _index(levels, *_place(camera)) is None:
        raise UserError(f"the observer is outside the domain: {_extent(levels[-1])}")


def _aloft(camera: Camera) -> bool:
    """Whether no ground need be looked for below the camera."""
    return camera.height_m >= _SPACE_M or camera.above == "sea level"


def _ground_below(lit: LitScene, camera: Camera) -> float:
    """Height of the ground under the camera (m)."""
    field, grid = lit.field, lit.scene.grid
    if grid is None or field.medium is None:
        return field.ground_m
    if grid.periodic or _aloft(camera):
        return 0.0
    x, y = _place(camera)
    landscape = None if isinstance(field, ReferenceField) else field.landscape
    if landscape is not None:
        return landscape.ground_m(y, x)
    media = [field.medium] if isinstance(field, ReferenceField) else field.media
    found = _index(lit.scene.levels[: len(media)], x, y)
    assert found is not None  # _check_observer has looked
    level, ix, iy = found
    fineness = media[level].fineness
    return float(bilinear(media[level].terrain_m, np.array([ix * fineness]), np.array([iy * fineness]))[0])


def _index(levels: Sequence[Scene], x: float, y: float) -> tuple[int, float, float] | None:
    """The finest of nested scenes that covers a place, and the place's fractional indices in it."""
    for level, scene in enumerate(levels):
        grid = scene.grid
        assert grid is not None
        if grid.curved:
            ix, iy = (float(v) for v in grid.index(x, y))
        else:
            ix, iy = (x - grid.x[0]) / grid.step[0], (y - grid.y[0]) / grid.step[1]
        _, ny, nx = grid.shape
        inner = min(max(ix, 0.0), nx - 1.0), min(max(iy, 0.0), ny - 1.0)
        if max(abs(ix - inner[0]), abs(iy - inner[1])) < EDGE:
            return level, *inner
    return None


def _place(camera: Camera) -> tuple[float, float]:
    """Longitude and latitude (degrees) of a camera, or x and y (m) in a flat scene."""
    x, y = (camera.lon, camera.lat) if camera.x_m is None else (camera.x_m, camera.y_m)
    assert x is not None  # Camera has checked
    assert y is not None
    return x, y


def _axes_at(lit: LitScene, camera: Camera) -> F64:
    """Rows east, north, up at the camera, in the scene frame."""
    lon, lat = _place(camera)
    return lit.field.frame.enu(lat, lon)


def _extent(scene: Scene) -> str:
    """What the domain covers, for an error message."""
    grid = scene.grid
    assert grid is not None
    if not grid.curved:
        return f"choose x in {grid.x[0]:g} to {grid.x[-1]:g} m and y in {grid.y[0]:g} to {grid.y[-1]:g} m"
    return extent_text(grid)


def _sun_at(lit: LitScene, camera: Camera) -> tuple[float, float]:
    """Azimuth and altitude (degrees) of the sun at the camera."""
    east, north, up = _axes_at(lit, camera) @ lit.daylight.direction
    return float(np.degrees(np.arctan2(east, north)) % 360), float(np.degrees(np.arcsin(np.clip(up, -1, 1))))


def _add_disc(relative: NDArray, view: Any, lit: LitScene, distance_deg: F64, pixels: Any) -> None:
    """The sun's disc, limb-darkened and anti-aliased, dimmed by the full optical depth in front of it."""
    inside = np.asarray(pixels.inside).ravel()
    distance = distance_deg[inside] if distance_deg.size == inside.size else distance_deg
    half = np.broadcast_to(np.asarray(pixels.half_width_deg), pixels.inside.shape).ravel()[inside]
    radius = lit.daylight.angular_radius_deg
    open_to = np.flatnonzero(~view.hit)
    disc = disc_coverage(distance[open_to], half[open_to], radius, lit.field.wavelengths_nm)
    relative[open_to] += (disc * view.transmittance[open_to]).astype(np.float32)


def _irradiance(lit: LitScene, origin: F64, camera: Camera, azimuth: float, altitude: float) -> dict[str, Any]:
    """Spectral and broadband irradiance on the horizontal at the observer."""
    field = lit.field
    quadrature = quadrature_directions(_QUADRATURE, azimuth, altitude)
    axes = _axes_at(lit, camera)
    local = horizon_vector(quadrature.azimuth_deg, quadrature.altitude_deg)
    view = _for_sums(field).view(Rays(origin, np.concatenate([local @ axes, lit.daylight.direction[None]])))
    direct = view.transmittance[-1] * (not view.hit[-1])
    wl = field.wavelengths_nm
    spectral = spectral_irradiance(view.radiance[:-1], quadrature, direct, altitude, wl, lit.daylight.distance_au)
    gases = gases_above(lit.scene.atmosphere, float(field.frame.latlon(origin)[2]))
    wide = broadband(
        direct, spectral["relative_diffuse_horizontal"].values, wl, altitude, lit.daylight.distance_au, **gases
    )
    out: dict[str, Any] = {
        "global_horizontal_irradiance_w_m2": wide.global_horizontal,
        "direct_normal_irradiance_w_m2": wide.direct_normal,
        "direct_horizontal_irradiance_w_m2": wide.direct_horizontal,
        "diffuse_horizontal_irradiance_w_m2": wide.diffuse_horizontal,
    }
    out = {name: round(float(value), 2) for name, value in out.items()}
    for part in ("global", "direct", "diffuse"):
        out[f"{part}_horizontal_spectral_irradiance_w_m2_nm"] = [
            float(v) for v in spectral[f"{part}_horizontal"].values
        ]
    return out


def _for_sums(field: Field | ReferenceField) -> Field | ReferenceField:
    """The field to look from along rays of which the sum counts: Monte Carlo spreads its paths over them."""
    if not isinstance(field, ReferenceField):
        return field
    solver = field.solver
    most = PATHS if solver.target_error is None and solver.seconds is None else None
    paths = solver.paths or most
    fewer = dataclasses.replace(
        solver,
        paths=None if paths is None else max(2, paths // _SPREAD),
        target_error=None if solver.target_error is None else min(solver.target_error * _SPREAD**0.5, 0.5),
    )
    return dataclasses.replace(field, solver=fewer)


def _attributes(lit: LitScene, camera: Camera, azimuth: float, altitude: float) -> dict[str, Any]:
    attrs: dict[str, Any] = {
        "Conventions": "CF-1.11",
        "title": f"OpenSWIm {camera.name} image",
        "history": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}: openswim {openswim.__version__}",
        "view": camera.name,
        "source": lit.scene.source,
        "assumptions": "\n".join(lit.scene.notes),
        "solver": lit.field.solver.name,
        "quality": lit.field.solver.quality if isinstance(lit.field, ReferenceField) else lit.field.quality,
        "sun_altitude_deg": round(altitude, 4),
        "sun_azimuth_deg": round(azimuth, 4),
        "sun_distance_au": lit.daylight.distance_au,
        "height_m": float(camera.height_m),
        "height_above": camera.above,
    }
    if camera.view == "perspective":
        attrs |= {
            "view_azimuth_deg": float(camera.azimuth_deg), "view_altitude_deg": float(camera.altitude_deg),
            "view_roll_deg": float(camera.roll_deg), "field_of_view_deg": float(camera.fov_deg),
        }  # fmt: skip
    x, y = _place(camera)
    attrs |= {"longitude": x, "latitude": y} if lit.field.frame.curved else {"x_m": x, "y_m": y}
    if lit.time is not None:
        attrs["time"] = f"{np.datetime_as_string(np.datetime64(lit.time), 's')}Z"
    return attrs


def _which_way(altitude_deg: NDArray) -> dict[str, str]:
    """The standard name of light from above or from below; an image of both has none."""
    way = "" if np.nanmin(altitude_deg) < 0 else "downwelling"
    way = "upwelling" if np.nanmax(altitude_deg) <= 0 else way
    return {"standard_name": f"{way}_radiance_per_unit_wavelength_in_air"} if way else {}


def _dataset(lit: LitScene, pixels: Any, relative: NDArray, view: Any, attrs: dict[str, Any]) -> xr.Dataset:
    wl = lit.field.wavelengths_nm
    toa = solar_irradiance(wl) / lit.daylight.distance_au**2
    spectral = relative * (toa / (4 * np.pi)).astype(np.float32)
    dims = ("y", "x", "wavelength")
    image = xr.Dataset(
        {
            "radiance": (
                dims, pixels.image(spectral),
                {"long_name": "spectral radiance", "units": "W m-2 sr-1 nm-1"} | _which_way(pixels.altitude_deg),
            ),
            "solar_relative_radiance": (
                dims, pixels.image(relative), {"long_name": "4 pi L / E_TOA (Albers et al. 2020, Eq. 2)", "units": "1"},
            ),
            "solar_irradiance": (
                ("wavelength",), toa,
                {"long_name": "solar spectral irradiance at the top of the atmosphere", "units": "W m-2 nm-1"},
            ),
        },
        coords={
            "wavelength": ("wavelength", wl, {"standard_name": "radiation_wavelength", "units": "nm"}),
            "azimuth": (
                ("y", "x"), pixels.azimuth_deg.astype(np.float32),
                {"long_name": "viewing azimuth, clockwise from north", "units": "degree"},
            ),
            "altitude": (
                ("y", "x"), pixels.altitude_deg.astype(np.float32),
                {"long_name": "viewing altitude above the horizon", "units": "degree"},
            ),
        },
        attrs=attrs,
    )  # fmt: skip
    if lit.field.frame.curved:
        lat, lon, _ = lit.field.frame.latlon(view.position)
        for name, value in (("latitude", lat), ("longitude", lon)):
            image.coords[name] = (
                ("y", "x"), pixels.image(value.astype(np.float32)),
                {"standard_name": name, "units": f"degrees_{'north' if name == 'latitude' else 'east'}",
                 "long_name": f"{name} of the ground that the pixel shows"},
            )  # fmt: skip
    return image
