"""`openswim calibrate`: from frames to a camera's file, and the page that shows how well it fits."""

from dataclasses import dataclass, replace
from pathlib import Path

import click

from openswim.errors import UserError, one_line


@dataclass(frozen=True)
class CalibrateRequest:
    """The options of `openswim calibrate`; None: not given."""

    frames: tuple[Path, ...]
    lat: float | None = None
    lon: float | None = None
    height_m: float = 0.0
    time: str | None = None
    time_pattern: str | None = None
    utc_offset_h: float | None = None
    by: str | None = None
    mask: Path | None = None
    name: str = ""
    camera_file: Path | None = None
    output: Path | None = None
    report: Path | None = None


def run(request: CalibrateRequest) -> None:
    """Fit a camera, or check one."""
    from openswim.readers import files_of
    from openswim.scene.files import check_targets

    frames = [Path(path) for path in files_of(request.frames)]
    if request.camera_file is not None:
        _check(request, request.camera_file, frames)
        return
    if request.output is None:
        raise UserError("--output missing: give -o camera.toml (or --camera camera.toml to check one)")
    if request.lat is None or request.lon is None:
        raise UserError("place missing: give --lat and --lon in degrees")
    if request.output.suffix.lower() != ".toml":
        raise UserError(f"output {request.output}: a camera's file ends in .toml")
    report = request.report or request.output.with_suffix(".html")
    inputs = [*frames, *([request.mask] if request.mask else [])]
    check_targets([("output", request.output), ("--report", report)], inputs)
    from openswim.cameras.files import FrameSettings, write_camera
    from openswim.observations.calibration import calibrate
    from openswim.observations.report import write_report

    settings = FrameSettings(request.time_pattern, request.utc_offset_h)
    found = calibrate(
        frames, request.lat, request.lon, request.height_m, request.time, settings, request.by, request.mask,
        request.name,
    )  # fmt: skip
    write_report(found, report)
    written = write_camera(found.content, request.output)
    table = found.content.calibration
    click.echo(
        f"{table['matches']} matches by {found.by}, lens {table['lens']}: median {table['median_px']:.2f} px, held out "
        f"{table['held_out_px']:.2f} px ({table['held_out_deg']:.3f} degrees)"
    )
    for info in found.frames:
        if info.doubt:
            click.echo(one_line(f"note: {info.path}: {info.doubt}"), err=True)
    for line in found.cannot_tell:
        click.echo(f"cannot tell {one_line(line)}")
    click.echo(one_line(", ".join(map(str, [*written, report]))))


def _check(request: CalibrateRequest, path: Path, frames: list[Path]) -> None:
    from openswim.cameras.files import FrameSettings, read_camera
    from openswim.observations.calibration import check

    of_a_fit = {"-o": request.output, "--report": request.report, "--by": request.by, "--mask": request.mask,
                "--name": request.name or None}  # fmt: skip
    if given := [name for name, value in of_a_fit.items() if value is not None]:
        raise UserError(f"--camera is checked, and nothing is fitted: leave out {', '.join(given)}, or --camera")
    if request.time is not None and len(frames) > 1:
        raise UserError("--time is the time of one frame; several tell theirs by name: leave it out")
    content = read_camera(path, lat=request.lat, lon=request.lon)
    offset_h = content.frames.utc_offset_h if request.utc_offset_h is None else request.utc_offset_h
    pattern, full = request.time_pattern or content.frames.time_pattern, content.frames.saturated_count
    settings = FrameSettings(pattern, offset_h, full)
    for frame in frames:
        found = check(replace(content, frames=settings), frame, request.time, request.height_m)
        told = f"{found.matches} stars match, median distance {found.median_px:.2f} px"
        if found.doubt:
            told = f"{found.doubt}: cloud, moonlight, twilight, or another camera, place or time"
        click.echo(f"{one_line(str(frame))}: {told}")
