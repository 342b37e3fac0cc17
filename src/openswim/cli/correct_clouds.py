"""`openswim correct-clouds`: a model's clouds corrected by what cameras see, written as a scene."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from openswim.errors import UserError, one_line

if TYPE_CHECKING:
    from openswim.cameras.files import CameraFile


@dataclass(frozen=True)
class CorrectCloudsRequest:
    """The options of `openswim correct-clouds`; None: not given."""

    model: Path
    frames: tuple[Path, ...]
    output: Path
    camera_files: tuple[Path, ...] = ()
    clear_frames: tuple[Path, ...] = ()
    time: str | None = None
    time_pattern: str | None = None
    utc_offset_h: float | None = None
    member: int | None = None
    passes: int = 2
    hold_out: bool = True
    base_m: float | None = None
    thickness_m: float = 400.0
    quality: str = "standard"
    size: int | None = None
    sun_mask_deg: float | None = None
    lowest_deg: float | None = None
    encoding: str | None = None


def run(request: CorrectCloudsRequest) -> None:
    """Correct and write; the scores before and after are printed, and written beside the scene."""
    from openswim.cameras.files import read_camera
    from openswim.cli.compare import tell_without_obstacles, with_clock
    from openswim.comparison.cloud_correction import correct_clouds
    from openswim.comparison.settings import settings_of
    from openswim.ground.earth import preload
    from openswim.readers import files_of
    from openswim.scene.cf import save_netcdf
    from openswim.scene.files import check_targets
    from openswim.solver import Solver

    frames = [Path(path) for path in files_of(request.frames)]
    if request.output.suffix not in (".nc", ".zarr"):
        raise UserError(f"output {request.output}: the scene is written as .nc or .zarr")
    scores = request.output.with_name(f"{request.output.stem}_scores.nc")
    inputs = [*frames, *request.camera_files, *request.clear_frames, request.model]
    check_targets([("output", request.output), ("output", scores)], inputs)
    names = ("size", "sun_mask_deg", "lowest_deg", "encoding")
    settings: dict[str, Any] = {name: value for name in names if (value := getattr(request, name)) is not None}
    cameras = [with_clock(read_camera(path), request.time_pattern, request.utc_offset_h)
               for path in request.camera_files]  # fmt: skip
    for path, camera in zip(request.camera_files, cameras, strict=True):
        tell_without_obstacles(path, camera, settings_of(settings).lowest_deg)
    if frames and cameras:
        _tell_time(request, frames[0], cameras[0])
    preload()
    scene, history = correct_clouds(
        str(request.model), frames, cameras, time=request.time, clear_frames=request.clear_frames,
        passes=request.passes, hold_out=request.hold_out, base_m=request.base_m, thickness_m=request.thickness_m,
        solver=Solver("fast", quality=request.quality), member=request.member, **settings,
    )  # fmt: skip
    if "doubt" in history.attrs:
        click.echo(one_line(f"note: {history.attrs['doubt']}"), err=True)
    for number in history["edit"].values:
        used, unused = (history[f"r_{name}"].sel(edit=number).mean("camera").item() for name in ("used", "unused"))
        of_unused = f", {unused:.3f} of pixels that were not used" if request.hold_out else ""
        error = 100 * history["cloud_error"].sel(edit=number).item()
        title = "model" if number == 0 else f"edit {number}"
        why = history["reason"].sel(edit=number).item()
        because = f" ({why})" if why else ""
        masks = f"differ on {error:.1f} % of the sky" if np.isfinite(error) else "are none"
        click.echo(f"{title}: mean r {used:.3f}{of_unused}; cloud masks {masks}{because}")
    chosen = history.attrs["chosen_edit"]
    told = f"edit {chosen} has the highest r, and is written"
    click.echo(told if chosen else "no edit has raised r: the scene is written as it was", err=True)
    save = scene.to_zarr if request.output.suffix == ".zarr" else scene.to_netcdf
    save(request.output)
    save_netcdf(history, scores)
    click.echo(one_line(f"{request.output}, {scores}"))


def _tell_time(request: CorrectCloudsRequest, frame: Path, camera: "CameraFile") -> None:
    """Note it, before any work is done, where the model's nearest time is far from the first frame's."""
    from openswim.cli.compare import tell_when_far
    from openswim.comparison.skies import Skies
    from openswim.observations import read_frame

    seen = read_frame(frame, request.time, camera.frames)
    if seen.doubt:
        click.echo(one_line(f"note: {frame}: {seen.doubt}"), err=True)
    model = Skies(str(request.model)).state_at(seen.time)[0]
    if model is not None:
        tell_when_far(seen.time, model, "frame")
