"""`openswim satellite`: a model's clouds as an imager in space sees them, beside what it saw."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from openswim.cameras.checks import MAX_SIZE
from openswim.cli.options import tell_notes
from openswim.errors import UserError

if TYPE_CHECKING:
    from openswim.satellites import Band, FixedGrid, Pixels
    from openswim.scene import Scene

_HIGH_M = 36e6  # imagers stand so high, or higher
_NEAREST_KM, _FARTHEST_KM = 6.6e3, 2e6  # as of Pixels
_DISC_DEG, _DISC_PIXELS = 0.62, 512  # field of EPIC: the whole disc and a little beside it; its pixels each way
_BESIDE, _EARTH_KM = 1.02, 6378.2  # from nearer by the disc is wider, and so is the field


@dataclass(frozen=True)
class SatelliteRequest:
    """The options of `openswim satellite`; None: not given."""

    files: tuple[Path, ...]
    like: Path | None = None
    grid: str | None = None
    every: int | None = None
    lon_0: float | None = None
    disc: tuple[float, float, float] | None = None
    size: int | None = None
    outputs: tuple[Path, ...] = ()
    imager: str = "goes-16 abi"
    bands: tuple[str, ...] = ()
    time: str | None = None
    member: int | None = None
    solver: str = "fast"


def run(request: SatelliteRequest) -> None:
    """Render on the pixels that are asked for, write, and say how that agrees with an observed picture."""
    from openswim.satellites import band, imagers
    from openswim.scene.files import check_target

    known = imagers()
    if request.imager not in known:
        raise UserError(f"--imager {request.imager}: unknown; known: {', '.join(known)}")
    if not request.bands:
        raise UserError(f"--band missing: give some of {', '.join(known[request.imager])}")
    bands = [band(request.imager, name) for name in request.bands]
    _check_pixels(request)
    for output in request.outputs:
        if os.path.isdir(output):
            continue  # the file gets the name that satpy knows
        if output.suffix.lower() not in (".nc", ".tif", ".tiff"):
            raise UserError(f"output {output}: suffix {output.suffix!r} is unknown; use .nc or .tif")
        if request.disc is not None and output.suffix.lower() != ".nc":
            raise UserError(f"output {output}: the disc from L1 has no fixed grid, which GeoTIFF needs; use .nc")
        check_target(output, [*request.files, *([] if request.like is None else [request.like])])
    if request.like is None:
        _alone(request, bands)
    else:
        _beside(request, bands, request.like)


def _check_pixels(request: SatelliteRequest) -> None:
    """One way of saying which pixels, and nothing that belongs to another."""
    ways = {"--like": request.like, "--grid": request.grid, "--disc": request.disc}
    if sum(way is not None for way in ways.values()) != 1:
        raise UserError("which pixels: give one of --like OBSERVED_FILE, --grid full (or conus), --disc LAT LON KM")
    for name, value, own in (("--every", request.every, "--grid"), ("--lon-0", request.lon_0, "--grid"),
                             ("--size", request.size, "--disc")):  # fmt: skip
        if value is not None and ways[own] is None:
            raise UserError(f"{name} belongs to {own}")
    if request.disc is not None:
        lat, lon, distance_km = request.disc
        if not (abs(lat) <= 90 and abs(lon) <= 360 and _NEAREST_KM <= distance_km <= _FARTHEST_KM):
            told = " ".join(f"{number:g}" for number in request.disc)
            raise UserError(f"--disc {told}: give latitude within -90..90 and longitude within -360..360 degrees, and "
                            f"{_NEAREST_KM:g} to {_FARTHEST_KM:g} km from the Earth's centre")  # fmt: skip
    if request.size is not None and not 1 <= request.size <= MAX_SIZE:
        raise UserError(f"--size {request.size}: give 1 to {MAX_SIZE} rows and columns")
    if request.like is None and not request.outputs:
        raise UserError("--output missing: give -o with the name of a .nc or .tif file")


def _alone(request: SatelliteRequest, bands: list[Band]) -> None:
    """A picture with nothing beside it, at the model's time and in its light."""
    import openswim
    from openswim.readers import Neighbourhood
    from openswim.satellites import Pixels, named_grid
    from openswim.satellites.files import write
    from openswim.satellites.named_grids import shown_part
    from openswim.satellites.picture import reflectance
    from openswim.scene.times import parse_time

    grid: FixedGrid | Pixels
    size = _DISC_PIXELS if request.size is None else request.size
    if request.disc is not None:
        lat, lon, distance_km = request.disc
    else:
        whole = named_grid(request.imager, request.grid or "full", request.lon_0)
        lat, lon = 0.0, whole.lon_0
    scene = openswim.open_scene(request.files, time=parse_time(request.time), member=request.member,
                                around=Neighbourhood.seen_from(lat, lon, _HIGH_M))  # fmt: skip
    if scene.time is None:
        raise UserError("the model's files tell no time, by which the sun is placed: give --time")
    if request.disc is not None:
        _announce(scene, (size, size), bands, request.solver)
        field_deg = max(_DISC_DEG, 2 * _BESIDE * np.degrees(np.arcsin(_EARTH_KM / distance_km)))
        grid = Pixels.disc(lat, lon, 1000 * distance_km, field_deg, size)
    else:
        grid, every = shown_part(whole, scene.levels[-1].grid, request.every)
        some = "" if every == 1 else f", each {every}. of the imager's"
        click.echo(f"{grid.y.size} rows and {grid.x.size} columns{some}", err=True)
        _announce(scene, grid.shape, bands, request.solver)
    picture = reflectance(scene, grid, bands, solver=request.solver)
    for output in request.outputs:
        click.echo(f"{write(picture, output)}")
    values = picture.reflectance_factor.values[0]
    known = values[np.isfinite(values)]
    told = ", ".join(f"{value:.3f}" for value in np.percentile(known, (5, 25, 50, 75, 95)))
    click.echo(f"reflectance factor, {bands[0].name}, {known.size} pixels, 5, 25, 50, 75, 95 %: {told}")


def _announce(scene: Scene, shape: tuple[int, int], bands: list[Band], solver: str) -> None:
    """What was assumed, and what a large picture costs."""
    from openswim.cli.estimate import Pictured, announce

    tell_notes(scene.notes)
    wavelengths = sorted({nm for one in bands for nm in one.wavelength_nm})
    announce(scene, Pictured(shape, _HIGH_M), solver, wavelengths_nm=wavelengths)


def _beside(request: SatelliteRequest, bands: list[Band], like: Path) -> None:
    """On an observed picture's pixels, and how both agree."""
    import openswim
    from openswim.cli.compare import tell_when_far
    from openswim.readers import Neighbourhood, describe
    from openswim.satellites.comparison import agreement, displacement
    from openswim.satellites.files import grid_of, middle_of, read, write
    from openswim.satellites.picture import reflectance
    from openswim.scene.times import parse_time

    observed = read(like, request.bands)
    grid = grid_of(observed)
    seen_in = observed.attrs["band"]
    compared = bands[0].name if seen_in in ("", bands[0].name) else seen_in
    if compared not in request.bands:
        what = f"{like} is a picture in {seen_in}, which --band does not name"
        if not request.outputs:
            raise UserError(f"{what}: nothing to compare: give --band {seen_in}, or -o to write without comparing")
        click.echo(f"note: {what}: nothing is compared", err=True)
    if left_out := observed.attrs["pixels_left_out"]:
        share = f"{100 * left_out / observed.reflectance_factor.size:.2g} %"
        click.echo(f"note: {like}: {left_out} pixels ({share}) are left out: its flags of quality (DQF) say that they "
                   "have no value, or were too warm", err=True)  # fmt: skip
    if not np.isfinite(observed.latitude).any():
        raise UserError(f"{like}: no pixel of it lies on the Earth")
    start = parse_time(observed.attrs["time_coverage_start"].rstrip("Z") or None)
    if start is None and request.time is None:
        raise UserError(f"{like}: does not say its time: give --time, of the model and of the light")
    around = Neighbourhood.seen_from(*middle_of(observed, grid.lon_0), _HIGH_M)
    chosen = parse_time(request.time)
    if chosen is None and start is not None:
        times = [parse_time(each) for each in describe(request.files).times]
        chosen = min((each for each in times if each is not None), key=lambda each: abs(each - start), default=None)
    scene = openswim.open_scene(request.files, time=chosen, around=around, member=request.member)
    if request.time is None and start is not None and scene.time is not None:
        tell_when_far(start, scene.time, "picture")
    _announce(scene, grid.shape, bands, request.solver)
    picture = reflectance(scene, grid, bands, start if request.time is None and start else scene.time,
                          solver=request.solver)  # fmt: skip
    for output in request.outputs:
        click.echo(f"{write(picture, output)}")
    if compared not in request.bands:
        return
    simulated = picture.reflectance_factor.values[request.bands.index(compared)]
    found = agreement(simulated, observed.reflectance_factor.values)
    click.echo(f"reflectance factor, {compared}, {found.n} pixels: bias {found.bias:+.3f}, RMSE {found.rmse:.3f}, "
               f"correlation {found.correlation:.3f}")  # fmt: skip
    for name, values in (("simulated", found.simulated), ("observed", found.observed)):
        click.echo(f"{name:10} 5, 25, 50, 75, 95 %: {', '.join(f'{value:.3f}' for value in values)}")
    down, right, best = displacement(simulated, observed.reflectance_factor.values)
    told = np.isfinite(down)
    if told.any():
        rows, columns = np.median(down[told]), np.median(right[told])
        click.echo(f"fits best when moved down by {rows:+.0f} rows and to the right by {columns:+.0f} columns "
                   f"(median of {told.sum()} windows, of {best.size})")  # fmt: skip
