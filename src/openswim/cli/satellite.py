"""`openswim satellite`: a model's clouds as an imager in space sees them, beside what it saw."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import click

from openswim.errors import UserError


@dataclass(frozen=True)
class SatelliteRequest:
    """The options of `openswim satellite`; None: not given."""

    files: tuple[Path, ...]
    like: Path
    outputs: tuple[Path, ...] = ()
    imager: str = "goes-16 abi"
    bands: tuple[str, ...] = ()
    time: str | None = None
    solver: str = "fast"


def run(request: SatelliteRequest) -> None:
    """Render on the observed picture's grid, write, and say how both agree."""
    from openswim.satellites import band, imagers
    from openswim.scene.files import check_target

    known = imagers()
    if request.imager not in known:
        raise UserError(f"--imager {request.imager}: unknown; known: {', '.join(known)}")
    if not request.bands:
        raise UserError(f"--band missing: give some of {', '.join(known[request.imager])}")
    bands = [band(request.imager, name) for name in request.bands]
    for output in request.outputs:
        if os.path.isdir(output):
            continue  # the file gets the name that satpy knows
        if output.suffix.lower() not in (".nc", ".tif", ".tiff"):
            raise UserError(f"output {output}: suffix {output.suffix!r} is unknown; use .nc or .tif")
        check_target(output, [*request.files, request.like])

    import numpy as np

    import openswim
    from openswim.cli.compare import tell_when_far
    from openswim.readers import Neighbourhood, describe
    from openswim.satellites.comparison import agreement, displacement
    from openswim.satellites.files import grid_of, middle_of, read, write
    from openswim.satellites.picture import reflectance
    from openswim.scene.times import parse_time

    observed = read(request.like)
    grid = grid_of(observed)
    if not np.isfinite(observed.latitude).any():
        raise UserError(f"{request.like}: no pixel of it lies on the Earth")
    start = parse_time(observed.attrs["time_coverage_start"].rstrip("Z") or None)
    if start is None and request.time is None:
        raise UserError(f"{request.like}: does not say its time: give --time, of the model and of the light")
    around = Neighbourhood.seen_from(*middle_of(observed, grid.lon_0), 36e6)
    chosen = parse_time(request.time)
    if chosen is None and start is not None:
        times = [parse_time(each) for each in describe(request.files).times]
        chosen = min((each for each in times if each is not None), key=lambda each: abs(each - start), default=None)
    scene = openswim.open_scene(request.files, time=chosen, around=around)
    if request.time is None and start is not None and scene.time is not None:
        tell_when_far(start, scene.time, "picture")
    picture = reflectance(scene, grid, bands, start if request.time is None and start else scene.time,
                          solver=request.solver)  # fmt: skip
    for output in request.outputs:
        write(picture, output)
    simulated = picture.reflectance_factor.values[0]
    found = agreement(simulated, observed.reflectance_factor.values)
    click.echo(f"reflectance factor, {bands[0].name}, {found.n} pixels: bias {found.bias:+.3f}, RMSE {found.rmse:.3f}, "
               f"correlation {found.correlation:.3f}")  # fmt: skip
    for name, values in (("simulated", found.simulated), ("observed", found.observed)):
        click.echo(f"{name:10} 5, 25, 50, 75, 95 %: {', '.join(f'{value:.3f}' for value in values)}")
    down, right, best = displacement(simulated, observed.reflectance_factor.values)
    told = np.isfinite(down)
    if told.any():
        click.echo(f"displaced by {np.median(down[told]):+.0f} rows and {np.median(right[told]):+.0f} columns "
                   f"(median of {told.sum()} windows, of {best.size})")  # fmt: skip
