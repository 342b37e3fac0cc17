"""`compare`: a camera's frame beside the sky that a model, or the clear sky's physics, has at that place and time."""

import os
from collections.abc import Sequence
from typing import Any

import xarray as xr

from openswim.arguments import takes
from openswim.cameras import Camera
from openswim.cameras.files import CameraFile
from openswim.comparison.one_frame import compare_frame
from openswim.comparison.series import scores_over_time
from openswim.comparison.settings import camera_content, frame_of, known_camera, settings_of, skies_of
from openswim.comparison.skies import Model
from openswim.observations import SkyFrame
from openswim.solver import Solver

Frames = SkyFrame | str | os.PathLike[str] | Sequence[SkyFrame | str | os.PathLike[str]]


@takes
def compare(
    model: Model,
    frames: Frames,
    camera: Camera | CameraFile | str | os.PathLike[str],
    *,
    time: Any = None,
    clear_frame: SkyFrame | str | os.PathLike[str] | None = None,
    solver: str | Solver = "fast",
    aod: float | None = None,
    albedo: float | None = None,
    sun: tuple[float, float] | None = None,
    detail: bool | None = None,
    member: int | None = None,
    **settings: Any,
) -> xr.Dataset:
    """Compare frames of a camera with what a model would show it (docs/compare.md).

    model : a model's file or files, a Scene, what `openswim.light` returns, or None: the clear sky of place and time.
    frames : one or several; of one the result has pictures, masks and scores, of several the scores over time.
    camera : a `Camera` of the frames' size, or its TOML file, which tells the zone of the frames' clock where neither
        their names nor EXIF do (a `Camera` does in `CameraFile(camera, frames=FrameSettings(utc_offset_h=1))`).
    time : UTC, of a single frame where nothing else tells it.
    clear_frame : a frame of the same camera under a clear sky, which gives its response and white balance.
    aod, albedo : of the clear sky in place of the default or the model's; aerosol is never fitted.
    detail : whether to see more of near clouds and land than the model knows; by default of a single frame only.
    member : of an ensemble in the model's files, by its own number; by default the first.
    settings : `size` (columns to average to), `sun_mask_deg`, `lowest_deg`, `encoding`, `ghi_w_m2`, `dhi_w_m2` (what a
        pyranometer beside the camera measures), `aod_range`.
    """
    content = camera_content(camera)
    chosen = settings_of(settings)
    listed = [frames] if isinstance(frames, SkyFrame | str | os.PathLike) else list(frames)
    skies = skies_of(model, solver, aod, albedo, sun, len(listed) > 1, detail, member)
    known = known_camera(content, chosen, clear_frame, solver, skies)
    if len(listed) != 1:
        return scores_over_time(skies, listed, content, chosen, known)
    return compare_frame(skies, frame_of(listed[0], content, time), content, chosen, known)
