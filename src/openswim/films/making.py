"""`film`: a sky over model times, or along a camera's path."""

from __future__ import annotations

import hashlib
import os
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import number, takes
from openswim.cameras import Camera
from openswim.colour.exposure import check_exposure
from openswim.errors import UserError
from openswim.films.camera_path import CameraPath
from openswim.films.exposure import exposure_curve
from openswim.films.from_frames import NIGHT_DEG, StarTrails
from openswim.films.keogram import keogram as keogram_of
from openswim.films.kept_frames import KeptFrame, KeptFrames
from openswim.films.outputs import check_curves, check_output, check_outputs, write_curves, write_film
from openswim.films.titles import titled
from openswim.films.weather import Weather
from openswim.films.whereabouts import told_of_drift, told_of_places, told_of_times
from openswim.lighting import WAVELENGTHS_NM, checked_wavelengths, light, solver_of
from openswim.lights import sun_position
from openswim.pictures.observer import check_observer, ground_below
from openswim.pictures.viewpoint import LOOKED_AT, LitScene, Viewpoint
from openswim.progress import tell, track
from openswim.scene import Scene
from openswim.scene.files import written_whole
from openswim.solver import Solver
from openswim.transport import EarlierLight

MOST_FRAMES = 100_000
_LONGEST_STEP_S = 366 * 86400.0
LIGHT_EVERY_S = 300.0  # of a path: the sun is placed anew so often, and frames between two lights are blended
_ONE_LIGHT = 0.5  # of that time, up to which one light in the middle will do
_MOST_HALF = 65000.0  # that half floats hold
_LOWEST_M = 1.5  # above the ground, of a camera on a path
# ``sparse`` of frames: what is kept is exact. At .05 pictures of skies and of a landing are off by .15 to .33 of 255
# rms, where H.264 and AV1 lose 2.4 of a sky: decoded films are as near to the exact frames with it as without it
_SPARSE = {"radiance": 0.0, "pictures": LOOKED_AT, "video": 0.05}


@dataclass(frozen=True)
class Shot:
    """One frame to be: the time of its weather and light, and its camera."""

    time: np.datetime64
    camera: Camera


@takes
def film(
    weather: Weather | Sequence[Scene] | Scene | str | os.PathLike[str],
    camera: Camera,
    output: str | os.PathLike[str],
    *,
    every_s: float | None = None,
    path: CameraPath | str | os.PathLike[str] | None = None,
    frames_per_second: float = 25.0,
    speed: float = 1.0,
    exposure: float | str = "auto",
    keogram: str | os.PathLike[str] | None = None,
    star_trails: str | os.PathLike[str] | None = None,
    irradiance: str | os.PathLike[str] | None = None,
    title: bool = True,
    solver: str | Solver = "fast",
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    from_time: Any = None,
    to_time: Any = None,
) -> Path:
    """Make a film and return its path.

    weather : scenes, or a model's files. camera : how it looks, and from where if there is no path.
    output : .mp4 (H.264), .webm (AV1), .zarr (spectral radiance of all frames), or a folder, for pictures by number.
    every_s : seconds from frame to frame, also between model times, where clouds are carried by the wind (`between`);
        without it each model time is a frame. from_time, to_time: only this part, UTC.
    path : a camera's path (or its CSV or GPX file), played at ``speed`` times its own speed; see `CameraPath.read`.
    exposure : a factor from L' to display; "auto", one smooth curve for the film (`exposure_curve`); or what else
        `openswim.to_rgb` takes.
    keogram : also write the middle columns of all frames, side by side, as this picture.
    star_trails : also write the brightest that each pixel is by night as this picture, of a camera that stands still.
    irradiance : also write irradiance at the camera and the sun's place in each frame, .csv or .nc.
    title : valid time, place and model at the foot of each frame.

    Frames that are done are kept in a hidden folder beside the output: a film that was stopped goes on where it was.
    """
    target = Path(output)
    kind = check_output(target)
    for name, picture in (("keogram", keogram), ("star trails", star_trails)):
        if picture is not None and Path(picture).suffix.lower() not in (".png", ".jpg", ".tif"):
            raise UserError(f"{name} {picture}: give a picture's name, .png, .jpg or .tif")
    if irradiance is not None:
        check_curves(Path(irradiance))
    if star_trails is not None and path is not None:
        raise UserError("star trails: they are of a camera that stands still: leave out the path")
    fps = number("film: frames_per_second", frames_per_second)
    if not 0 < fps <= 240:
        raise UserError(f"film: {fps:g} frames per second; give more than 0, at most 240")
    check_exposure(exposure)
    wavelengths = checked_wavelengths(wavelengths_nm)
    sky = _weather(weather)
    way = path if isinstance(path, CameraPath) or path is None else CameraPath.read(path)
    beside = [("keogram", keogram), ("star trails", star_trails), ("irradiance", irradiance)]
    check_outputs(target, beside, [*sky.inputs, *([] if way is None or way.file is None else [way.file])])
    shots = shots_of(sky, camera, every_s, way, fps, number("film: speed", speed), from_time, to_time)
    chosen = solver_of(solver)
    times, cameras = [shot.time for shot in shots], [shot.camera for shot in shots]
    drifting = told_of_drift(sky.times) if every_s is not None and irradiance is not None else ""
    for note in filter(None, (told_of_places(sky, times, cameras), told_of_times(sky.times, times), drifting)):
        tell(f"note: {note}")
    if star_trails is not None:
        _check_night(shots)
    with_irradiance = kind == "radiance" or irradiance is not None
    plan = _plan(sky, shots, chosen, wavelengths, kind, exposure, with_irradiance)
    with KeptFrames(target, plan).held() as kept:
        lights = _Lights(sky, chosen, wavelengths, shots, every_s if way is None else LIGHT_EVERY_S)
        _make(kept, sky, lights, shots, kind, exposure, with_irradiance)
        curve = _exposures(kept, len(shots), exposure, fps)
        lines: list[NDArray[np.uint8]] = []
        trails = None if star_trails is None else StarTrails([kept.facts(n) for n in range(len(shots))])
        pictures = _pictures(kept, curve, title, lines, trails)
        write_film(target, kept, len(shots), pictures, fps, kept.facts(0), wavelengths.tolist())
        if kind == "radiance" and (keogram is not None or trails is not None):  # such a film makes no pictures
            deque(pictures, maxlen=0)
        if keogram is not None:
            _write_picture(Path(keogram), keogram_of(lines), "keogram: the middle columns of a film's frames")
        if star_trails is not None and trails is not None:
            content = "star trails: the brightest of a film's frames by night"
            _write_picture(Path(star_trails), trails.picture(), content)
        if irradiance is not None:
            write_curves(Path(irradiance), kept, len(shots))
        kept.remove()
    return target


def _weather(weather: Any) -> Weather:
    if isinstance(weather, Weather):
        return weather
    if isinstance(weather, Scene):
        return Weather.of_scenes([weather])
    if isinstance(weather, Sequence) and weather and all(isinstance(each, Scene) for each in weather):
        return Weather.of_scenes(weather)
    return Weather.of_files(weather)


def shots_of(
    sky: Weather, camera: Camera, every_s: float | None, path: CameraPath | None, fps: float, speed: float,
    from_time: Any, to_time: Any,
) -> list[Shot]:  # fmt: skip
    """What is to be seen in each frame."""
    from openswim.scene.times import parse_time

    begin, end = parse_time(from_time), parse_time(to_time)
    if path is not None:
        if every_s is not None or begin is not None or end is not None:
            raise UserError("film: a path has times of its own: leave out every, from and to")
        if not 0 < speed <= 1e6:
            raise UserError(f"film: speed {speed:g}; give more than 0")
        length_s = float((path.time[-1] - path.time[0]) / np.timedelta64(1, "ms")) / 1e3
        count = _count(length_s / speed * fps, "play the path faster (--speed)")
        steps = np.round(np.arange(count) / fps * speed * 1e3).astype("timedelta64[ms]")
        times = path.time[0] + steps
        sky.check_between(times)
        return [Shot(time, each) for time, each in zip(times, path.camera(camera, times), strict=True)]
    times = sky.times
    if every_s is not None:
        if np.isnat(times).any():
            raise UserError("film: frames in steps (every) are between times, and these scenes tell none")
        if not 1e-3 <= number("film: every", every_s) <= _LONGEST_STEP_S:
            raise UserError(f"film: every {every_s:g} s; give .001 s to a year")
        step = np.timedelta64(round(every_s * 1e3), "ms")
        first, last = times[0] if begin is None else begin, times[-1] if end is None else end
        _count(float((last - first) / step))
        times = np.arange(first, last + np.timedelta64(1, "ms"), step)
    chosen = [t for t in times if (begin is None or t >= begin) and (end is None or t <= end)]
    if not chosen:
        asked = " ".join(f"{name} {time}" for name, time in (("--from", begin), ("--to", end)) if time is not None)
        raise UserError(f"film: no frames {asked}; the model's times are {sky.times[0]} to {sky.times[-1]}")
    sky.check_between(chosen)
    return [Shot(time, camera) for time in chosen]


def _count(frames: float, remedy: str = "choose longer steps") -> int:
    if not frames <= MOST_FRAMES:
        raise UserError(f"film: {frames:.7g} frames; at most {MOST_FRAMES} are made: {remedy}")
    return int(np.floor(frames + 1e-9)) + 1


def _check_night(shots: Sequence[Shot]) -> None:
    """UserError where no frame shows stars."""
    for shot in shots:
        camera = shot.camera
        if camera.lat is None or camera.lon is None or np.isnat(shot.time):
            raise UserError("star trails: they need a place by latitude and longitude, and weather with times")
        if sun_position(shot.time, camera.lat, camera.lon).altitude_deg < NIGHT_DEG:
            return
    raise UserError(f"star trails: no frame has the sun {-NIGHT_DEG:g} degrees below the horizon: film a night")


def _plan(
    sky: Weather, shots: Sequence[Shot], solver: Solver, wavelengths: NDArray[np.float64], kind: str,
    exposure: float | str, irradiance: bool,
) -> dict[str, Any]:  # fmt: skip
    import openswim

    return {
        "openswim": openswim.__version__, "times": sky.times.astype(str).tolist(), "solver": repr(solver),
        "wavelengths": wavelengths.tolist(), "kind": kind,
        "exposure": exposure if isinstance(exposure, str) else "auto",
        "shots": [(str(shot.time), repr(shot.camera)) for shot in shots],
        "looking": hashlib.sha256(shots[0].camera.pixels().direction.tobytes()).hexdigest(),
        "weather": sky.identity, "irradiance": irradiance,
    }  # fmt: skip


def _make(
    kept: KeptFrames, sky: Weather, lights: _Lights, shots: Sequence[Shot], kind: str, exposure: float | str,
    irradiance: bool,
) -> None:  # fmt: skip
    """Make all frames that are not there yet."""
    for count, shot in enumerate(track(shots, "film")):
        if kept.has(count):
            continue
        frame = _frame(lights.at(shot.time), shot, kind, exposure, irradiance)
        sky.check_unchanged()  # now, not when all are made in vain
        kept.put(count, frame)


class _Lights:
    """Solved light about a time: one, or two of which a frame is blended. Other light is let go first."""

    def __init__(
        self, sky: Weather, solver: Solver, wavelengths_nm: Any, shots: Sequence[Shot], every_s: float | None
    ) -> None:
        self._sky, self._solver, self._wavelengths = sky, solver, wavelengths_nm
        self._held: dict[np.datetime64, LitScene] = {}
        self._earlier = EarlierLight()
        self._drifting = every_s is not None  # frames follow each other closely
        self._nodes = self._times(shots, every_s)

    @staticmethod
    def _times(shots: Sequence[Shot], every_s: float | None) -> NDArray[np.datetime64]:
        times = np.unique(np.array([shot.time for shot in shots]))
        if every_s is None or times.size < 2:
            return times
        span_s = float((times[-1] - times[0]) / np.timedelta64(1, "ms")) / 1e3
        if span_s <= _ONE_LIGHT * every_s:
            return np.array([times[0] + np.timedelta64(round(500 * span_s), "ms")])
        steps = int(np.ceil(span_s / every_s))
        nodes = times[0] + np.round(np.linspace(0, span_s, steps + 1) * 1e3).astype("timedelta64[ms]")
        return nodes if nodes.size < times.size else times

    def at(self, time: np.datetime64) -> list[tuple[float, LitScene]]:
        """Shares and lights."""
        shares = self._shares(time)
        self._held = {node: lit for node, lit in self._held.items() if node in shares}
        return [(share, self._light(node)) for node, share in shares.items()]

    def _shares(self, time: np.datetime64) -> dict[np.datetime64, float]:
        """Times that light is solved for, and how much of each a frame shows."""
        nodes = self._nodes
        if len(nodes) == 1:
            return {nodes[0]: 1.0}
        later = int(np.clip(np.searchsorted(nodes, time), 0, len(nodes) - 1))
        if later == 0 or nodes[later] == time:
            return {nodes[later]: 1.0}
        share = float((time - nodes[later - 1]) / (nodes[later] - nodes[later - 1]))
        return {nodes[later - 1]: 1 - share, nodes[later]: share}

    def _light(self, time: np.datetime64) -> LitScene:
        if time not in self._held:
            scene = self._sky.at(time, self._drifting)
            when = None if np.isnat(time) else time
            self._held[time] = light(scene, self._solver, self._wavelengths, when, earlier=self._earlier)
        return self._held[time]


def _frame(
    lights: list[tuple[float, LitScene]], shot: Shot, kind: str, exposure: float | str, irradiance: bool
) -> KeptFrame:
    from openswim.colour.rgb import display_light, exposure_for

    camera = _above_ground(lights[0][1], shot.camera)
    eyes = [(share, lit.viewpoint(camera)) for share, lit in lights if share > 0]
    images = [(share, eye.view(irradiance=irradiance, sparse=_SPARSE[kind])) for share, eye in eyes]
    image = images[0][1]
    for share, other in images[1:]:
        for name in ("solar_relative_radiance", "radiance"):
            image[name] = ((1 - share) * image[name] + share * other[name]).assign_attrs(image[name].attrs)
        image.attrs |= _between(image.attrs, other.attrs, share, shot.time)
    data = image["radiance"].transpose("y", "x", "wavelength").values if kind == "radiance" else None
    wanted = exposure_for(image, exposure if isinstance(exposure, str) else "auto")
    shown = np.clip(display_light(image) * np.float32(wanted), 0, _MOST_HALF).astype(np.float16)
    facts = _facts(image, wanted) | _time(shot.time) | _height(shot.camera, eyes[0][1]) | _ahead(eyes[0][1])
    return KeptFrame(shown, facts, data)


def _between(one: dict[str, Any], other: dict[str, Any], share: float, time: np.datetime64) -> dict[str, Any]:
    """What is to be known of a blend: numbers in between, and the time where the two have not the same."""
    found: dict[str, Any] = {}
    for name in one.keys() & other.keys():
        a, b = one[name], other[name]
        if name.endswith("_time") and a != b:
            found[name] = f"{np.datetime_as_string(time, 's')}Z"
        elif isinstance(a, float) and isinstance(b, float):
            angle = name.endswith("azimuth_deg")
            turn = 360.0 * round((a - b) / 360.0) if angle else 0.0
            mixed = (1 - share) * a + share * (b + turn)
            found[name] = mixed % 360.0 if angle else mixed
    return found


def _time(time: np.datetime64) -> dict[str, Any]:
    """The frame's own time, which along a path is not that of its weather and its light."""
    return {} if np.isnat(time) else {"time": f"{np.datetime_as_string(time, 'ms')}Z"}


def _height(asked: Camera, eye: Viewpoint) -> dict[str, Any]:
    """Height as the path counts it, from sea level, also where the camera was lifted."""
    if asked.above != "sea level":
        return {}
    return {"height_m": float(eye.camera.height_above_sea_m(eye.ground_m)), "height_above": asked.above}


def _ahead(eye: Viewpoint) -> dict[str, Any]:
    """What a camera that looks in one direction has in the middle of its picture, unless that is the sky."""
    camera = eye.camera
    if camera.view != "perspective":
        return {}
    sight = eye.ahead()
    if not np.isfinite(sight.distance_m[0]):
        return {}
    return {"ahead": sight.names[sight.kind[0]], "ahead_m": float(sight.distance_m[0])}


def _above_ground(lit: LitScene, camera: Camera) -> Camera:
    """No eye in the ground: a camera of a path is lifted to stand on it."""
    if camera.above != "sea level" or camera.height_m > 9000.0 or camera.lat is None:
        return camera
    standing = replace(camera, above="ground", height_m=_LOWEST_M)
    try:
        check_observer(lit.scene, standing, lit.field.solver.name)
    except UserError:  # beside the domain it flies over ground that nobody knows
        return camera
    ground_m = ground_below(lit.scene, lit.field, standing)
    return (
        standing
        if camera.height_m < ground_m + _LOWEST_M
        else replace(camera, above="ground", height_m=camera.height_m - ground_m)
    )


def _facts(image: xr.Dataset, exposure: float) -> dict[str, Any]:
    known = {name: value for name, value in image.attrs.items() if isinstance(value, str | int | float)}
    known |= {"exposure": exposure, "view": image.attrs.get("view", "")}
    return known


def _exposures(kept: KeptFrames, count: int, exposure: float | str, fps: float) -> NDArray[np.float64]:
    if not isinstance(exposure, str):
        return np.full(count, float(exposure))
    wanted = np.array([kept.facts(n)["exposure"] for n in range(count)])
    return exposure_curve(wanted, fps) if exposure == "auto" else wanted


def _pictures(
    kept: KeptFrames, curve: NDArray[np.float64], title: bool, lines: list[NDArray[np.uint8]],
    trails: StarTrails | None = None,
) -> Iterator[NDArray[np.uint8]]:  # fmt: skip
    """Pictures of all frames; their middle columns, without a title, go into ``lines``."""
    from openswim.colour.rgb import developed

    for frame, factor in zip(kept.each(len(curve)), curve, strict=True):
        light = frame.light.astype(np.float32)
        picture = developed(light, float(factor / frame.facts["exposure"]))
        if trails is not None:
            trails.add(light, frame.facts, float(factor))
        lines.append(picture[:, picture.shape[1] // 2].copy())
        yield titled(picture, frame.facts) if title else picture


def _write_picture(path: Path, picture: NDArray[np.uint8], content: str) -> None:
    from openswim.colour.picture import write_picture

    with written_whole(path) as partial:
        write_picture(picture, partial, {"Content": content})
