"""Frames into a folder: a file and a page for each, by several processes; what is done is never done again."""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import openswim
from openswim.cameras.files import CameraFile
from openswim.comparison.one_frame import compare_frame
from openswim.comparison.report.page import write_page
from openswim.comparison.report.series_page import write_series_page
from openswim.comparison.series import joined, of_series
from openswim.comparison.settings import KnownCamera, Settings, frame_of
from openswim.comparison.skies import Skies, light_number
from openswim.errors import UserError
from openswim.kept_light import fingerprint as fingerprint_of
from openswim.observations.frame_times import frame_time
from openswim.observations.sun_spot import stray_deg
from openswim.pictures.viewpoint import LitScene
from openswim.readers import files_of
from openswim.scene import Scene
from openswim.scene.cf import save_netcdf
from openswim.system import side_by_side
from openswim.system.inputs import check_name, size_and_change

_ALONE = 5  # frames that are given to a process at once where their names do not tell which share light


@dataclass(frozen=True)
class Comparing:
    """What all frames share."""

    skies: Skies
    content: CameraFile
    settings: Settings
    known: KnownCamera
    folder: Path
    time: Any = None  # UTC, of a single frame
    mark: str = ""  # fingerprint of all this
    series: bool = True


@dataclass(frozen=True)
class Compared:
    """What became of a frame: what is told of it and what a series keeps of it, or why it was left out."""

    path: Path
    scores: xr.Dataset | None = None
    part: xr.Dataset | None = None
    failure: str = ""


@dataclass(frozen=True)
class Share:
    """What became of frames that were compared one after another."""

    frames: tuple[Compared, ...]
    peak_bytes: float = 0.0


def compare_into(
    skies: Skies, frames: Sequence[Path], content: CameraFile, settings: Settings, known: KnownCamera, folder: Path,
    time: Any = None, tell: Callable[[xr.Dataset], None] = lambda scores: None,
    tell_failed: Callable[[Path, str], None] = lambda path, failure: None,
    jobs: int = 1, begin: Callable[[int, int], None] = lambda waiting, standing: None,
) -> Path:  # fmt: skip
    """Compare frames into a folder: NAME.nc and NAME.html of each, and of several scores.nc and index.html.

    A frame's file appears when it is complete, and frames whose file is there, made with the same settings, are left as
    they are: after an interruption the same call goes on where it stopped. Of several frames those that cannot be
    compared are told and left out; if there is no other, the first error is raised. Numbers do not depend on `jobs`,
    the processes that work side by side. Returns the page to look at.
    """
    check_name(folder, "output")
    names = [path.stem for path in frames]
    doubled = {name for name in names if names.count(name) > 1}
    if doubled:
        raise UserError(f"two frames are called {min(doubled)}: compare them one by one, into folders of their own")
    _check_targets(folder, frames, skies)
    mark = fingerprint(skies, content, settings, known)
    comparing = Comparing(skies, content, settings, known, folder, time, mark, len(frames) > 1)
    parts = {path: part for path in frames if (part := _done(comparing, path)) is not None}
    waiting = [path for path in frames if path not in parts]
    begin(len(waiting), len(parts))
    failures = []
    with _made(folder):
        for done in _compared(comparing, waiting, jobs):
            if done.scores is None or done.part is None:
                failures.append(done.failure)
                if len(failures) == len(frames):
                    raise UserError(failures[0])
                tell_failed(done.path, done.failure)
                continue
            parts[done.path] = done.part
            tell(done.scores)
    if len(frames) == 1:
        return folder / f"{names[0]}.html"
    series = joined(list(parts.values()))
    save_netcdf(series, folder / "scores.nc")
    write_series_page(series, folder / "index.html")
    return folder / "index.html"


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """A folder to write into; one that was not there does not stay empty."""
    fresh = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({error.strerror}); choose another folder with -o") from None
    try:
        yield
    finally:
        if fresh:
            with suppress(OSError):  # it has something
                folder.rmdir()


def _compared(comparing: Comparing, frames: Sequence[Path], jobs: int) -> Iterator[Compared]:
    shares = in_shares(frames, comparing.content)
    if shares and comparing.skies.of_files:
        comparing.skies.states()  # lest each process looks through all files
    if min(jobs, len(shares)) <= 1:
        with one_thread() if comparing.series else nullcontext():
            for share in shares:
                for path in share:
                    yield _compare_one(comparing, path)
        return
    for found in side_by_side.outcomes(_work, comparing, shares, min(jobs, len(shares)), _killed):
        yield from found.frames


def in_shares(frames: Sequence[Path], content: CameraFile) -> list[list[Path]]:
    """Frames in the order of their times, as far as names tell them: those of one light together."""
    named, others = {}, []
    for path in sorted(frames, key=lambda path: path.name):
        try:
            named[path] = frame_time(path, {}, {}, content.frames).time
        except UserError:  # it is in the file, or will be told with what else is wrong
            others.append(path)
    shares: dict[int, list[Path]] = {}
    for path in sorted(named, key=lambda path: named[path]):
        shares.setdefault(light_number(named[path]), []).append(path)
    return [*shares.values(), *(others[n : n + _ALONE] for n in range(0, len(others), _ALONE))]


def _work(comparing: Comparing, frames: list[Path]) -> Share:
    with one_thread():
        return Share(tuple(_compare_one(comparing, path) for path in frames), side_by_side.peak_bytes())


@contextmanager
def one_thread() -> Iterator[None]:
    """The last bit of solved light depends on the number of threads: all of a series has one, whoever makes it."""
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)


def _killed(frames: list[Path]) -> Share:
    return Share(tuple(Compared(path, failure=f"{path}: {side_by_side.KILLED}") for path in frames))


def _compare_one(comparing: Comparing, path: Path) -> Compared:
    content, settings, target = comparing.content, comparing.settings, comparing.folder / f"{path.stem}.nc"
    camera = content.camera.resized(settings.size) if settings.size < content.camera.shape[1] else content.camera
    try:
        mark = _mark_of(comparing, path)  # before it is read: one that changes meanwhile is done again
        frame = frame_of(path, content, comparing.time, not comparing.series)
        done = compare_frame(comparing.skies, frame, content, settings, comparing.known)
        sun = done.attrs["sun_azimuth_deg"], done.attrs["sun_altitude_deg"]
        done.attrs["sun_spot_off_deg"] = round(stray_deg(frame, content.camera, *sun), 1)
    except UserError as error:
        text = str(error)
        return Compared(path, failure=text if str(path) in text else f"{path}: {text}")
    done.attrs["fingerprint"] = mark
    write_page(done, camera, target.with_suffix(".html"))
    save_netcdf(done, target)
    return Compared(path, done.drop_dims(("y", "x")), of_series(done, content.camera))


def fingerprint(skies: Skies, content: CameraFile, settings: Settings, known: KnownCamera) -> str:
    """What a comparison depends on but for the frame: files made otherwise are not taken for it."""
    pixels = content.camera.resized(min(32, content.camera.shape[1])).pixels()
    curves = None if known.curves is None else [curve.radiance.tolist() for curve in known.curves]
    said = json.dumps(
        [_model_mark(skies), str(skies.solver), skies.aod, skies.albedo, skies.sun, asdict(settings), known.red_blue,
         curves, str(content.response), str(content.frames), repr(content.camera), skies.table, openswim.__version__],
        default=str,
    )  # fmt: skip
    hidden = np.packbits(content.camera.open_sky()).tobytes()
    shown = np.nan_to_num(pixels.direction).round(6).tobytes()
    return hashlib.sha256(said.encode() + shown + hidden).hexdigest()[:16]


def _model_mark(skies: Skies) -> Any:
    """The model's files, their sizes and times of change."""
    if not skies.of_files:
        return _mark_of_scene(skies.model) if isinstance(skies.model, Scene | LitScene) else "clear"
    try:
        files: list[Any] = [(str(path), *size_and_change(path)) for path in files_of(skies.model)]  # type: ignore[arg-type]
        return files if skies.member is None else [*files, skies.member]
    except OSError:  # it will be told when it is opened
        return str(skies.model)


def _mark_of_scene(model: Scene | LitScene) -> list[str]:
    """A scene by all that is in it, and the light that it has been given."""
    if isinstance(model, Scene):
        return [fingerprint_of(model)]
    lights = [(each.name, np.asarray(each.strength).tolist()) for each in model.lights]
    field = model.field
    return [
        *_mark_of_scene(model.scene),
        str((field.solver, np.asarray(field.wavelengths_nm).tolist(), lights, model.daylight, model.time)),
    ]


def _check_targets(folder: Path, frames: Sequence[Path], skies: Skies) -> None:
    """UserError where what is written would replace what is read, or each other."""
    series = ["scores.nc", "index.html"] if len(frames) > 1 else []
    try:
        inputs = [*frames, *(files_of(skies.model) if skies.of_files else [])]  # type: ignore[arg-type]
    except UserError:  # of a model that cannot be read it is told with each frame
        inputs = list(frames)
    known = {os.path.realpath(each): each for each in inputs}
    targets = [f"{path.stem}{suffix}" for path in frames for suffix in (".nc", ".html")]
    for name in series:
        if name in targets:
            raise UserError(f"a frame is called {Path(name).stem}, as a file of the whole series: rename it")
    for name in (*targets, *series):
        at = os.path.realpath(folder / name)
        if at in known:
            raise UserError(f"{folder / name}: would replace {known[at]}, which is read: choose another folder with -o")


def _mark_of(comparing: Comparing, path: Path) -> str:
    """The fingerprint of a frame's comparison, by the frame's size and time of change as well."""
    try:
        size, changed = size_and_change(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from None
    said = f"{comparing.mark} {size} {changed} {comparing.time}"
    return hashlib.sha256(said.encode()).hexdigest()[:16]


def _done(comparing: Comparing, path: Path) -> xr.Dataset | None:
    """What a series keeps of a frame that an earlier run has left, if it was made alike."""
    target = comparing.folder / f"{path.stem}.nc"
    if not (target.is_file() and target.with_suffix(".html").is_file()):
        return None
    try:
        with xr.open_dataset(target) as found:
            alike = found.attrs.get("fingerprint") == _mark_of(comparing, path)
            return of_series(found, comparing.content.camera).load() if alike else None
    except Exception:  # of a damaged file: of netCDF, HDF5, or of what it lacks
        return None
