"""`openswim compare`: from a model, a camera's file and frames to pages and files of scores."""

import time as clock
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from openswim.cli.options import known_to
from openswim.errors import UserError, one_line

if TYPE_CHECKING:
    import xarray as xr

    from openswim.cameras.files import CameraFile

MUCH = 0.8  # of the sky, below which it is said how much is used
PATIENCE_S, FEWEST = 10.0, 5  # what is left is told from so long and, for the first frame starts everything, so many on
FAR_SUN_DEG = 6.0  # that a spot may be off: calibrations by suns are a degree right, lopsided spots another
FAR_HOURS = 3.0  # between a frame and a model's time
_SETTINGS = ("size", "sun_mask_deg", "lowest_deg", "encoding", "ghi_w_m2", "dhi_w_m2")


@dataclass(frozen=True)
class CompareRequest:
    """The options of `openswim compare`; None: not given."""

    files: tuple[Path, ...]
    camera_file: Path
    clear: bool = False
    clear_frame: Path | None = None
    lat: float | None = None
    lon: float | None = None
    time: str | None = None
    time_pattern: str | None = None
    utc_offset_h: float | None = None
    aod: float | None = None
    albedo: float | None = None
    member: int | None = None
    solver: str = "fast"
    quality: str | None = None
    detail: bool | None = None
    size: int | None = None
    sun_mask_deg: float | None = None
    lowest_deg: float | None = None
    encoding: str | None = None
    ghi_w_m2: float | None = None
    dhi_w_m2: float | None = None
    output: Path = Path("openswim-compare")
    jobs: int | None = None

    def settings(self) -> dict[str, Any]:
        """What `openswim.compare` takes of them."""
        given = {name: getattr(self, name) for name in _SETTINGS if getattr(self, name) is not None}
        if "encoding" in given and given["encoding"].replace(".", "", 1).isdigit():
            given["encoding"] = float(given["encoding"])
        return given


def run(request: CompareRequest) -> None:
    """Compare and write; what can be wrong with the request is found before any work is done."""
    from openswim.comparison.into_folder import compare_into
    from openswim.comparison.settings import known_camera, settings_of, skies_of
    from openswim.ground.earth import preload
    from openswim.readers import files_of
    from openswim.solver import Solver
    from openswim.system.side_by_side import jobs_of

    jobs = jobs_of(request.jobs)
    model, frames = (None, request.files) if request.clear else (request.files[0], request.files[1:])
    if not frames:
        raise UserError("frames missing: write openswim compare MODEL FRAME... (or --clear FRAME...)")
    if request.time is not None and len(frames) > 1:
        raise UserError("--time is for a single frame: leave it out, or give --time-pattern")
    listed = [Path(path) for path in files_of(frames)]
    content = camera_content(request)
    settings = settings_of(request.settings())
    tell_without_obstacles(request.camera_file, content, settings.lowest_deg)
    if request.clear and request.member is not None:
        raise UserError("--member belongs to a MODEL; leave it out with --clear")
    if request.quality is not None and request.solver != "fast":
        raise UserError(f"--quality belongs to --solver fast; leave it out with {request.solver}")
    solver = Solver(request.solver, quality=request.quality or "standard")
    preload()
    skies = skies_of(model, solver, request.aod, request.albedo, None, len(listed) > 1, request.detail,
                     request.member)  # fmt: skip
    known = known_camera(content, settings, request.clear_frame, solver, skies)
    if known.doubt:
        click.echo(one_line(f"note: {request.clear_frame}: {known.doubt}"), err=True)
    jobs = 1 if len(listed) == 1 else jobs
    progress = Progress(jobs)
    done = compare_into(skies, listed, content, settings, known, request.output, request.time, progress.tell,
                        progress.tell_failed, jobs, progress.begin)  # fmt: skip
    click.echo(one_line(f"{done}"))
    if progress.failed:
        raise UserError(f"{progress.failed} of {len(listed)} frames are left out, as said above")


@dataclass
class Progress:
    """What is said while frames are compared."""

    jobs: int
    waiting: int = 1
    failed: int = 0
    done: int = 0
    began: float = field(default_factory=clock.monotonic)

    def begin(self, waiting: int, standing: int) -> None:
        """Say what there is to do of a series, and where nothing is."""
        self.waiting, self.began = waiting, clock.monotonic()
        if waiting + standing > 1:
            by = f" by up to {self.jobs} processes" if min(self.jobs, waiting) > 1 else ""
            left = f"{waiting} to compare{by}" if waiting else "nothing is left to compare"
            click.echo(f"{waiting + standing} frames, {standing} of them done; {left}", err=True)
        elif standing:
            click.echo("this frame is done, with the same settings; nothing is left to compare", err=True)

    def tell(self, comparison: "xr.Dataset") -> None:
        """One line about a frame, and how long the others will take."""
        click.echo(one_line(line_of(comparison)) + self._left())
        if (off := comparison.attrs.get("sun_spot_off_deg", 0.0)) > FAR_SUN_DEG:
            told = f"the round bright spot of {comparison.attrs['frame']} lies {off:.0f} degrees from where its camera"
            text = f"note: {told} and time have the sun: a lit cloud, or a wrong time, zone, place or camera"
            click.echo(one_line(text), err=True)
        if doubt := comparison.attrs.get("doubt"):
            click.echo(one_line(f"note: {comparison.attrs['frame']}: {doubt}"), err=True)
        if "model_time" in comparison.attrs:
            seen, model = (np.datetime64(comparison.attrs[name].rstrip("Z")) for name in ("time", "model_time"))
            tell_when_far(seen, model, "frame")

    def tell_failed(self, path: Path, failure: str) -> None:
        self.failed += 1
        context = click.get_current_context(silent=True)
        failure = known_to(None if context is None else context.command, failure)
        click.echo(f"left out: {one_line(failure)}{self._left()}", err=True)

    def _left(self) -> str:
        self.done += 1
        left_s = (clock.monotonic() - self.began) / self.done * (self.waiting - self.done)
        if left_s < PATIENCE_S or self.done < FEWEST:
            return ""
        return f" ({self.waiting - self.done} to do, {left_s / 60:.0f} min)" if left_s >= 90 else (
            f" ({self.waiting - self.done} to do, {left_s:.0f} s)")  # fmt: skip


def camera_content(request: CompareRequest) -> "CameraFile":
    """The camera's file, with the options that go before it."""
    from openswim.cameras.files import read_camera

    content = read_camera(request.camera_file, lat=request.lat, lon=request.lon)
    return with_clock(content, request.time_pattern, request.utc_offset_h)


def with_clock(content: "CameraFile", time_pattern: str | None, utc_offset_h: float | None) -> "CameraFile":
    """The camera with what --time-pattern and --utc-offset say of its frames' times, as far as they are given."""
    given = {"time_pattern": time_pattern, "utc_offset_h": utc_offset_h}
    told: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return replace(content, frames=replace(content.frames, **told))


def tell_without_obstacles(path: Path, content: "CameraFile", lowest_deg: float) -> None:
    """Note it where a camera's file names nothing that hides the sky."""
    if content.camera.nothing_hides:
        where = f"trees, masts and roofs above {lowest_deg:g} degrees count as sky, and spoil scores and masks"
        remedy = "write [obstacles] into it (docs/cameras.md), or raise --lowest"
        click.echo(f"note: {one_line(str(path))} names no obstacles: {where}; {remedy}", err=True)


def tell_when_far(seen: np.datetime64, model: np.datetime64, what: str) -> None:
    """Note it where a model's nearest time is not that of what was seen."""
    hours = float((seen - model) / np.timedelta64(1, "h"))
    if abs(hours) > FAR_HOURS:
        apart = f"{abs(hours):.0f} hours" if abs(hours) < 96 else f"{abs(hours) / 24:.0f} days"
        click.echo(f"note: the model's nearest time, {np.datetime_as_string(model, 's')}Z, is {apart} "
                   f"{'before' if hours > 0 else 'after'} this {what}: its clouds are not those of the {what}",
                   err=True)  # fmt: skip


def line_of(comparison: "xr.Dataset") -> str:
    """Frame, time, mean r or why there is none, share of the sky where much is missing, cloud cover."""
    from openswim.comparison.cloud_rules import NO_AIR

    attrs = comparison.attrs
    at = {"weighting": "solid angle", "sun_mask": attrs["sun_mask_deg"], "score_channel": "mean"}
    stored, undone = (float(comparison["r"].sel(at | {"light": name})) for name in ("as stored", "response undone"))
    why = " and ".join(line[3:] for line in attrs["reasons"].splitlines() if line.startswith("r: "))
    text = f"{attrs['frame']}: {attrs['time']}, "
    if np.isfinite(stored):
        told, because = (f"{undone:.3f}", "") if np.isfinite(undone) else ("none", f" ({why})")
        text += f"r {stored:.3f} as stored, {told} with the response undone{because}"
    else:
        text += f"no r: {why}"
    if attrs["share_of_sky_used"] < MUCH:
        used = 100 * attrs["share_of_sky_used"]
        text += f", of {used:.0f} % of the sky (the rest is black, saturated or unlike its surroundings)"
    if attrs["sun_altitude_deg"] < 0:
        text += f"; the sun is {-attrs['sun_altitude_deg']:.1f} degrees below the horizon: colours say little of clouds"
    if "observed_cover" in comparison:
        covers = [float(comparison[f"{who}_cover"].sel(rule="clear sky")) for who in ("observed", "simulated")]
        if np.isfinite(covers).all():
            return f"{text}; cloud {100 * covers[0]:.0f} % observed, {100 * covers[1]:.0f} % simulated"
        if f"observed_cover: {NO_AIR}" in attrs["reasons"]:
            return f"{text}; no cloud masks: {NO_AIR}"
        typical = attrs["red_blue_of_this_frame"]
        if np.isfinite(typical):
            text += f"; no cloud masks without a clear frame (if this sky is clear: red_blue = {typical:.3f})"
    return text
