"""`openswim film`: a sky over model times, or along a camera's path."""

import re
import time as clock
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from openswim.cli.options import tell_notes
from openswim.cli.render import RenderRequest, camera_of, look_of, neighbourhood, solver_of
from openswim.errors import UserError
from openswim.scene.times import interval_s

if TYPE_CHECKING:
    from openswim.films import CameraPath

_LOOKED_AT = 3  # model times, for the estimate: some skies are clear


@dataclass(frozen=True)
class FilmRequest:
    """The options of `openswim film` beside those of a picture; None: not given."""

    picture: RenderRequest
    output: Path
    every: str | None = None
    path: Path | None = None
    start: str | None = None
    end: str | None = None
    frames_per_second: float = 25.0
    speed: float | None = None
    keogram: Path | None = None
    star_trails: Path | None = None
    irradiance: Path | None = None
    title: bool = True
    all_members: bool = False  # a film of each, its number in the name


def run(request: FilmRequest) -> None:
    """Make the film, or one of each member."""
    for one in _of_each_member(request) if request.all_members else [request]:
        _run(one)


def _of_each_member(request: FilmRequest) -> list[FilmRequest]:
    """The requests for all members that there are, whose outputs have "_m003" in their names."""
    from openswim.readers import members_of

    def named(path: Path, number: int) -> Path:
        return path.with_name(f"{path.stem}_m{number:03d}{path.suffix}")

    def beside(path: Path | None, number: int) -> Path | None:
        return None if path is None else named(path, number)

    return [
        replace(
            request, picture=replace(request.picture, member=number), output=named(request.output, number),
            keogram=beside(request.keogram, number), star_trails=beside(request.star_trails, number),
            irradiance=beside(request.irradiance, number),
        )
        for number in members_of(request.picture.file, request.picture.allow_references)
    ] or [request]  # fmt: skip


def member_of(text: str | None) -> tuple[int | None, bool]:
    """A member's number, None where none is given, and whether all are wanted."""
    if text is None or text.strip().lower() == "all":
        return None, text is not None
    if not re.fullmatch(r"\s*\d{1,9}\s*", text):
        raise UserError(f"--member {text}: give a member's number, or all")
    return int(text), False


def _run(request: FilmRequest) -> None:
    """Check the request, say what it will take, make the film."""
    from openswim.cli.estimate import estimate, mean_of
    from openswim.films import CameraPath, Weather, film
    from openswim.films.making import shots_of
    from openswim.films.outputs import check_output
    from openswim.lighting import lights_of, sun_altitude_deg
    from openswim.readers import Neighbourhood

    check_output(request.output)
    path = None if request.path is None else CameraPath.read(request.path)
    if path is None and request.speed is not None:
        raise UserError("--speed is how fast a --path is played: leave it out, and give --every or --fps")
    speed = 1.0 if request.speed is None else request.speed
    picture = request.picture
    camera = camera_of(picture if path is None else _at_start(picture, path))
    every = None if request.every is None else interval_s("--every", request.every)
    around = neighbourhood(picture, camera) if path is None else Neighbourhood.seen_along(*path.place.T)
    weather = Weather.of_files(
        picture.file, around=around, member=picture.member, allow_references=picture.allow_references
    )
    shots = shots_of(weather, camera, every, path, request.frames_per_second, speed, request.start, request.end)
    tell_notes(weather.first.notes)
    solver = solver_of(picture)
    count = f"{len(shots)} frame{'s' if len(shots) > 1 else ''}"
    middle, times = shots[len(shots) // 2].time, len({shot.time for shot in shots})
    one = mean_of([
        estimate(
            scene, camera, solver.name, quality=solver.quality, lights=lights_of(scene, solver.name, time=middle),
            sun_deg=sun_altitude_deg(scene, middle),
        )
        for scene in weather.spanned([shot.time for shot in shots], most=_LOOKED_AT)
    ])
    solves = "every five minutes of the path" if path is not None else f"for {times} time{'s' if times > 1 else ''}"
    click.echo(
        f"{count}, light is solved {solves}; of one frame and its light {one}; what is done is kept beside "
        "the output, and a film that was stopped goes on", err=True,
    )  # fmt: skip
    start = clock.perf_counter()
    film(
        weather, camera, request.output, every_s=every, path=path, frames_per_second=request.frames_per_second,
        speed=speed, exposure=look_of(picture)["exposure"],
        keogram=request.keogram, star_trails=request.star_trails, irradiance=request.irradiance,
        title=request.title, solver=solver, from_time=request.start, to_time=request.end,
    )  # fmt: skip
    click.echo(f"{request.output}: {count}, {clock.perf_counter() - start:.0f} s")


def _at_start(picture: RenderRequest, path: "CameraPath") -> RenderRequest:
    for option, given in (("lat", picture.lat), ("lon", picture.lon), ("x", picture.x_m), ("y", picture.y_m)):
        if given is not None:
            raise UserError(f"--path says where the camera is: leave out --{option}")
    if picture.height_m is not None:
        raise UserError("--path says where the camera is, by its column height_m: leave out --height")
    if picture.azimuth_deg is not None and picture.view == "perspective":
        raise UserError("--path says where the camera looks, along its way or by a column azimuth: leave out --azimuth")
    lat, lon, _ = path.place[0]
    return replace(picture, lat=float(lat), lon=float(lon))
