"""`openswim render`: from a file's name and a few options to a picture."""

import contextlib
import math
import re
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from openswim.arguments import shown
from openswim.cli.options import tell_notes
from openswim.errors import UserError

if TYPE_CHECKING:
    import xarray as xr

    from openswim.cameras import Camera
    from openswim.readers import Neighbourhood
    from openswim.scene import Scene
    from openswim.solver import Solver

FULL_DISC_M = 1e8  # from farther away a satellite shows the whole Earth unless told otherwise
DARK_SUN_DEG = -6.0
_DARKEST_W_M2 = 1e-9  # a thousandth of what stars give
LAYERED = (".nc", ".zarr", ".exr")  # files that hold what is seen and how far away it is


@dataclass(frozen=True)
class RenderRequest:
    """The options of `openswim render`; None: not given."""

    file: Path | tuple[Path, ...]
    outputs: tuple[Path, ...]
    lat: float | None = None
    lon: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    height_m: float | None = None
    time: str | None = None
    member: int | None = None
    sun: str | None = None
    camera_file: Path | None = None
    view: str = "allsky"
    azimuth_deg: float | None = None
    altitude_deg: float | None = None
    fov_deg: float | None = None
    size: str | None = None
    solver: str = "fast"
    quality: str | None = None
    paths: int | None = None
    seed: int = 0
    error_percent: float | None = None
    checkpoint: Path | None = None
    exposure: str = "auto"
    eye: bool = False
    matrix: str = "srgb"
    gamma: float | None = None
    bits: str = "8"
    caption: str = "inside"
    roll_deg: float | None = None
    altitude_range: str | None = None
    only: tuple[str, ...] = ()
    allow_references: bool = False
    albedo_maps: tuple[Path, ...] = ()
    town_lights: tuple[Path, ...] = ()
    height_maps: tuple[Path, ...] = ()
    aerosol: str | None = None
    aod: float | None = None
    stratosphere: str | None = None
    droplet_variance: float | None = None
    pristine_ice: float | None = None
    level_ice: float | None = None
    level_columns: float | None = None
    wavelengths: str | None = None
    layers: bool = False


def run(request: RenderRequest) -> None:
    """Render and write; whatever can be wrong with the request is found before any work is done."""
    from openswim.colour import check_writable
    from openswim.colour.picture import check_bits, only_looked_at
    from openswim.ground.earth import preload
    from openswim.pictures.images import check_layers
    from openswim.readers import files_of
    from openswim.scene.files import check_target

    inputs = [*files_of(request.file), *request.albedo_maps, *request.height_maps, *request.town_lights]
    inputs += [] if request.camera_file is None else [request.camera_file]
    if request.checkpoint is not None:
        check_target(request.checkpoint, inputs, "--checkpoint")
        inputs.append(request.checkpoint)
    camera = camera_of(request)
    for output in request.outputs:
        check_writable(output, inputs, camera.name)
        check_bits(output, int(request.bits))
    if request.layers and not any(output.suffix.lower() in LAYERED for output in request.outputs):
        raise UserError(f"--layers are written to {', '.join(LAYERED)}: give such a file with -o as well")
    check_layers(request.layers, request.solver)
    look = look_of(request)
    sun = sun_of(request.sun)
    preload()

    import numpy as np

    import openswim
    from openswim.cli.estimate import announce
    from openswim.lighting import lights_of, sun_altitude_deg
    from openswim.optics.choosing import only
    from openswim.optics.displays.shapes import with_shapes
    from openswim.optics.species import for_wavelengths
    from openswim.pictures.viewpoint import LOOKED_AT

    solver, wavelengths = solver_of(request), wavelengths_of(request.wavelengths)
    given = request.albedo_maps or request.height_maps or request.town_lights
    maps = openswim.Ground(request.albedo_maps, request.height_maps, lights=request.town_lights)
    ground = maps if given else None
    scene = openswim.open_scene(
        request.file, time=request.time, around=neighbourhood(request, camera), ground=ground,
        allow_references=request.allow_references, member=request.member,
    )
    scene = only(scene, *request.only) if request.only else scene
    shapes = request.droplet_variance, request.pristine_ice, request.level_ice, request.level_columns
    if any(shape is not None for shape in shapes):
        scene = with_shapes(scene, *shapes)
    scene = for_wavelengths(with_aerosol_of(request, scene, sun.get("time")), np.array(wavelengths))
    tell_notes(scene.notes)
    whole = request.fov_deg is not None or request.camera_file is not None
    if request.view == "satellite" and not whole and camera.height_m < FULL_DISC_M:
        camera = framed(camera, scene.levels[-1])
    lights = lights_of(scene, solver.name, wavelengths, **sun)
    sun_deg = sun_altitude_deg(scene, **sun)
    announce(scene, camera, solver.name, request.paths, solver.quality, wavelengths, lights, sun_deg)
    if solver.name == "reference":
        scene = scene.alone()
    chosen: dict[str, Any] = {} if request.wavelengths is None else {"wavelengths_nm": wavelengths}
    chosen |= {"layers": True} if request.layers else {}
    looked_at = only_looked_at((output.suffix for output in request.outputs), int(request.bits))
    chosen |= {"sparse": LOOKED_AT} if looked_at else {}
    start = time.perf_counter()
    image = openswim.render(scene, camera, solver=solver, **sun | chosen)
    tell_notes(ends_of(image, camera, scene.levels[-1]))
    report(image)
    write(image, request.outputs, look)
    click.echo(f"{', '.join(map(str, request.outputs))}: {time.perf_counter() - start:.1f} s")


def look_of(request: RenderRequest) -> dict[str, Any]:
    """What `openswim.save` is told of how pictures look."""
    from openswim.colour.exposure import check_exposure, check_gamma

    exposure: float | str = request.exposure
    with contextlib.suppress(ValueError):
        exposure = float(exposure)
    check_exposure(exposure)
    gamma: float | str = "srgb" if request.gamma is None else request.gamma
    check_gamma(gamma)
    return {
        "exposure": exposure, "eye": request.eye, "matrix": request.matrix, "gamma": gamma, "bits": int(request.bits),
        "caption": request.caption,
    }  # fmt: skip


def altitudes_of(text: str) -> tuple[float, float]:
    """Bottom and top of a panorama, degrees."""
    try:
        bottom, top = (float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"--altitude-range {text}: write BOTTOM,TOP in degrees, such as -10,45") from None
    return bottom, top


def wavelengths_of(text: str | None) -> tuple[float, ...]:
    """The wavelengths (nm) to render."""
    from openswim.lighting import WAVELENGTHS_NM

    if text is None:
        return WAVELENGTHS_NM
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"--wavelengths {text}: give numbers divided by commas, such as 640,550,470 (nm)") from None
    if len(set(found)) < len(found):
        raise UserError(f"--wavelengths {text}: give each once")
    return found


def with_aerosol_of(request: RenderRequest, scene: "Scene", time: Any = None) -> "Scene":
    """The scene with the aerosol that the options choose, if they choose one."""
    if request.aerosol is not None or request.aod is not None:
        from openswim.optics.chosen import with_aerosol

        place = None if request.lat is None or request.lon is None else (request.lat, request.lon)
        scene = with_aerosol(scene, request.aerosol, request.aod, time, place)
    if request.stratosphere is not None:
        from openswim.optics.chosen import with_stratosphere

        scene = with_stratosphere(scene, *_stratosphere(request.stratosphere))
    return scene


def _stratosphere(text: str) -> tuple[str, float | None]:
    """NAME or NAME:DEPTH."""
    name, colon, depth = text.partition(":")
    try:
        return name, float(depth) if colon else None
    except ValueError:
        raise UserError(f"--stratosphere {shown(text)}: give NAME or NAME:DEPTH, such as pinatubo:0.1") from None


def sun_of(text: str | None) -> dict[str, Any]:
    """What `openswim.render` is told of the sun: a time, or its azimuth and altitude."""
    from openswim.scene.times import parse_time

    if text is None:
        return {}
    if "," not in text:
        try:
            return {"time": parse_time(text)}
        except UserError as error:
            raise UserError(f"--sun: {error}, or as AZIMUTH,ALTITUDE in degrees, such as 150,40") from None
    try:
        azimuth, altitude = (float(part) for part in text.split(","))
    except ValueError as error:
        raise UserError(f"--sun {text}: write a time, or AZIMUTH,ALTITUDE in degrees") from error
    if not (-360.0 <= azimuth <= 360.0 and -90.0 <= altitude <= 90.0):
        raise UserError(f"--sun {text}: azimuth in degrees, and an altitude of -90 to 90")
    return {"sun": (azimuth, altitude)}


def neighbourhood(request: RenderRequest, camera: "Camera") -> "Neighbourhood | None":
    """The part of a large domain (global, or of very many columns) that the view needs; small domains stay whole."""
    from openswim.readers import Neighbourhood

    if camera.lat is None or camera.lon is None:
        return None
    return Neighbourhood.seen_from(camera.lat, camera.lon, camera.height_m, request.solver != "reference")


def framed(camera: "Camera", scene: "Scene") -> "Camera":
    """A satellite's camera with a field of view that shows the scene's domain, not the whole Earth around it; the whole
    Earth where the domain lies aside."""
    if scene.grid is None or not scene.grid.curved or camera.lat is None or camera.lon is None:
        return camera
    _, ny, nx = scene.grid.shape
    ix, iy = scene.grid.index(camera.lon, camera.lat)
    if not (0 <= ix <= nx - 1 and 0 <= iy <= ny - 1):
        return camera
    dx, dy = scene.grid.spacing_m()
    half = 0.5 * math.hypot((nx - 1) * dx, (ny - 1) * dy)
    fov = 2 * math.degrees(math.atan2(0.85 * half, camera.height_m))
    return replace(camera, fov_deg=min(fov, camera.fov_deg))


def ends_of(image: "xr.Dataset", camera: "Camera", scene: "Scene") -> list[str]:
    """What is to be said of an image from space that shows more of the Earth than a scene's domain."""
    import numpy as np

    from openswim.pictures.observer import SPACE_M

    grid = scene.grid
    if grid is None or not grid.curved or camera.height_m < SPACE_M:
        return []
    lat, lon = image["latitude"].values, image["longitude"].values
    there = np.isfinite(lat) & np.isfinite(lon)
    ix, iy = grid.index(lon[there], lat[there])
    _, ny, nx = grid.shape
    inside = (ix > -1) & (ix < nx) & (iy > -1) & (iy < ny)  # within a cell, so that global grids have no gap
    return [] if inside.all() else ["the picture shows more than the model's domain, with whose edges its clouds end"]


def solver_of(request: RenderRequest) -> "Solver":
    """The solver that the options describe."""
    from openswim.solver import Solver

    given = {"--paths": request.paths, "--error": request.error_percent, "--checkpoint": request.checkpoint}
    if request.quality is not None and request.solver != "fast":
        raise UserError(f"--quality belongs to --solver fast; leave it out with {request.solver}")
    if request.solver != "reference":
        for name in [n for n, value in given.items() if value is not None] + ["--seed"] * (request.seed != 0):
            raise UserError(f"{name} belongs to --solver reference; leave it out with {request.solver}")
        return Solver(request.solver, quality=request.quality or "standard")
    target = None if request.error_percent is None else request.error_percent / 100
    return Solver(
        "reference", paths=request.paths, seed=request.seed, target_error=target, checkpoint=request.checkpoint
    )


def camera_of(request: RenderRequest) -> "Camera":
    """The camera that the options describe; options that its view does not have are refused."""
    from openswim.cameras.camera import GEOSTATIONARY_HEIGHT_M, Camera
    from openswim.cameras.views import VIEWS

    if request.camera_file is not None:
        return _camera_of_file(request, request.camera_file)
    place = _place(request)
    options = _aim(request)
    allowed = {*VIEWS[request.view], *(("altitude_deg",) if request.view == "allsky" else ())}  # its centre
    for name in sorted(options.keys() - allowed):
        raise UserError(f"--view {request.view} has no {_option(name)}; leave it out")
    if request.size is not None:
        options["size"] = parse_size(request.size, square=request.view == "allsky")
    if request.height_m is not None:
        options["height_m"] = request.height_m
    elif request.view == "satellite":
        options["height_m"] = GEOSTATIONARY_HEIGHT_M
    if request.view == "allsky":
        options["centre"] = _centre(options.pop("altitude_deg", 90.0))
    return getattr(Camera, request.view)(**place, **options)


def _aim(request: RenderRequest) -> dict[str, Any]:
    """What the options say of where a camera looks."""
    names = ("azimuth_deg", "altitude_deg", "fov_deg", "roll_deg")
    aim: dict[str, Any] = {name: value for name in names if (value := getattr(request, name)) is not None}
    if request.altitude_range is not None:
        aim["altitude_range_deg"] = altitudes_of(request.altitude_range)
    return aim


def _option(name: str) -> str:
    return "--" + name.removesuffix("_deg").replace("_", "-")


def _camera_of_file(request: RenderRequest, path: Path) -> "Camera":
    from openswim.cameras.files import load_camera

    for name in _aim(request):
        raise UserError(f"--camera says where its camera looks: leave out {_option(name)}")
    place = {name: getattr(request, name) for name in ("lat", "lon", "x_m", "y_m", "height_m")}
    camera = load_camera(path, **place)
    return camera if request.size is None else camera.resized(parse_size(request.size))


def _place(request: RenderRequest) -> dict[str, float]:
    if request.lat is not None and request.lon is not None and request.x_m is None and request.y_m is None:
        return {"lat": request.lat, "lon": request.lon}
    geographic = request.lat is not None or request.lon is not None or request.view == "satellite"
    if request.x_m is not None and request.y_m is not None and not geographic:
        return {"x_m": request.x_m, "y_m": request.y_m}
    raise UserError("observer missing: give --lat and --lon in degrees (in a flat scene --x and --y in metres)")


def _centre(altitude_deg: float) -> str:
    if altitude_deg not in (90.0, -90.0):
        raise UserError("--view allsky looks up (--altitude 90) or down (--altitude -90), nowhere else")
    return "zenith" if altitude_deg > 0 else "nadir"


def parse_size(text: str, square: bool = False) -> int | tuple[int, int]:
    """ "1440" or "1440x720" (columns x rows) as what cameras take: columns, or (rows, columns)."""
    from openswim.cameras.checks import MAX_SIZE

    match = re.fullmatch(r"(\d{1,6})(?:[xX,](\d{1,6}))?", text.strip())
    if not match:
        raise UserError(f"--size {shown(text)} is not understood; write COLUMNS or COLUMNSxROWS, such as 1440x720")
    columns = int(match.group(1))
    if not all(1 <= int(pixels) <= MAX_SIZE for pixels in match.groups() if pixels):
        raise UserError(f"--size {text}: give 1 to {MAX_SIZE} pixels each way")
    if match.group(2) is None:
        return columns
    rows = int(match.group(2))
    if square:
        if rows != columns:
            raise UserError(f"--size {text}: an all-sky image is square; give one number")
        return columns
    return rows, columns


def report(image: "xr.Dataset") -> None:
    """Print what the image says of itself: the sun, and the irradiance at the observer."""
    attributes = image.attrs
    weather, light = attributes.get("valid_time"), attributes.get("light_time")
    if weather and light and weather != light:
        click.echo(f"note: weather of {weather}, light of {light}: clouds do not move between them", err=True)
    if "sun_altitude_deg" in attributes:
        click.echo(
            f"sun: altitude {float(attributes['sun_altitude_deg']):.2f}, "
            f"azimuth {float(attributes.get('sun_azimuth_deg', math.nan)):.2f} degrees"
        )
        if float(attributes["sun_altitude_deg"]) < DARK_SUN_DEG and "lights" not in attributes:
            click.echo("note: it is night there; moon and stars need a time (--sun TIME)", err=True)
        if "lights" in attributes and float(attributes["sun_altitude_deg"]) < 0:
            click.echo(
                f"lights: {attributes['lights']}; moon: altitude {float(attributes['moon_altitude_deg']):.2f}, azimuth "
                f"{float(attributes['moon_azimuth_deg']):.2f} degrees, {float(attributes['moon_illuminated']):.0%} lit"
            )
        if "illuminance_lx" in attributes:
            click.echo(f"illuminance: {float(attributes['illuminance_lx']):.3g} lx")
    if "mean_error_percent" in attributes:
        cut = ", interrupted" if attributes.get("interrupted") else ""
        click.echo(
            f"paths: {attributes['paths_per_pixel']} a pixel, mean error {attributes['mean_error_percent']:.2g} %{cut}"
        )
    if "aerosol_optical_depth_550nm" in attributes:
        depth = float(attributes["aerosol_optical_depth_550nm"])
        click.echo(f"aerosol: optical depth {depth:.3g} at 550 nm above the observer's ground")
    line = irradiance_line(image)
    if line:
        click.echo(line)


def irradiance_line(image: "xr.Dataset") -> str:
    """Global, direct and diffuse horizontal irradiance, W/m2; empty where the image carries none."""
    names = ("global", "direct", "diffuse")
    attributes = [f"{name}_horizontal_irradiance_w_m2" for name in names]
    if not set(attributes) <= set(image.attrs):
        return ""
    values = [float(image.attrs[name]) for name in attributes]
    return "irradiance: " + ", ".join(f"{n} {_watts(v)}" for n, v in zip(names, values, strict=True)) + " W/m2"


def _watts(value: float) -> str:
    """To a tenth by day, with digits that count by night; darker than any night is 0."""
    return f"{value:.1f}" if value >= 1 or value < _DARKEST_W_M2 else f"{value:.2g}"


def write(image: "xr.Dataset", outputs: tuple[Path, ...], look: dict[str, Any] | None = None) -> None:
    """Write the image to every output; each appears only when it is complete."""
    from openswim.colour import save

    for output in outputs:
        save(image, output, **look or {})
