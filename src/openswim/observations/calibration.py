"""`calibrate`: frames, place and times in, a camera out, with what speaks for it and what it cannot tell."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import openswim
from openswim.arguments import number, paths, shown, takes
from openswim.cameras import Camera
from openswim.cameras.checks import check_place, require
from openswim.cameras.files import CameraFile, FrameSettings
from openswim.cameras.obstacles import Mask
from openswim.cameras.picture_files import read_picture
from openswim.errors import UserError
from openswim.lights import sun_position
from openswim.observations.frames import FrameInfo, read_frame
from openswim.observations.lens_fit import residuals
from openswim.observations.limits import star_limits, track_limits
from openswim.observations.matching import TOLERANCES_PX, expected_by_chance, pairs
from openswim.observations.standing import Standing
from openswim.observations.star_fit import LensResult, Matched, Sky, StarFit, fit_stars, sky_of, too_few
from openswim.observations.track_fit import LEAST_SPOTS, Sighting, TrackFit, fit_track, sighting
from openswim.scene.times import Time

WAYS = ("stars", "sun", "moon")
MOST_STAR_FRAMES = 12
_NIGHT_DEG, _DAY_DEG = -6.0, 0.0


@dataclass(frozen=True)
class Calibration:
    """A fitted camera: its file's content, the fit, and what the fit cannot tell."""

    content: CameraFile
    by: str
    fit: StarFit | TrackFit
    cannot_tell: tuple[str, ...]

    @property
    def camera(self) -> Camera:
        return self.content.camera

    @property
    def chosen(self) -> LensResult:
        return self.fit.chosen

    @property
    def matched(self) -> Matched:
        return self.fit.matched

    @property
    def frames(self) -> tuple[FrameInfo, ...]:
        """The frames that were used, in the order of `matched.frame`."""
        return tuple(sky.frame for sky in self.fit.skies) if isinstance(self.fit, StarFit) else self.fit.frames


@takes
def calibrate(
    frames: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    lat: float,
    lon: float,
    height_m: float = 0.0,
    time: Time = None,
    settings: FrameSettings | None = None,
    by: str | None = None,
    mask: str | os.PathLike[str] | None = None,
    name: str = "",
) -> Calibration:
    """Fit a fisheye camera to its frames, blind: nothing but place and time need be known.

    `height_m`: of the place above sea level, for refraction; `time`: UTC, of a single frame; `settings`: how names
    tell the time, and the zone; `by`: stars, sun or moon (by default what was up); `mask`: picture, black where the sky
    is hidden; without one, what is dark before the sky of a clear day is found (`standing`).  Raises UserError where
    the frames do not give a camera.
    """
    lat, lon, height_m = number("latitude", lat), number("longitude", lon), number("height", height_m)
    settings = settings or FrameSettings()
    require(not re.search("[\ud800-\udfff]", name), f"calibrate: name {shown(name)} is no text in UTF-8: write another")
    check_place(lat, lon, None, None)
    require(by is None or by in WAYS, f"calibrate: by {shown(by)} is unknown: choose one of {', '.join(WAYS)}")
    given = [Path(path) for path in paths("frames", frames)]
    require(bool(given), "calibrate: give at least one frame")
    require(time is None or len(given) == 1, "calibrate: --time is the time of one frame; several tell theirs by name")
    standing = Standing()
    seen = _looked_at(given, lat, lon, height_m, time, settings, by, _hidden(mask), standing)
    skies = [each for each in seen if isinstance(each, Sky)]
    sightings = [each for each in seen if isinstance(each, Sighting)]
    fit: StarFit | TrackFit
    if len(sightings) > len(skies):
        body = "moon" if by == "moon" else "sun"
        fit = fit_track(sightings, lat, lon, height_m, body)
        cannot = track_limits(fit, lat)
    else:
        body = "stars"
        skies = sorted(skies, key=lambda sky: -len(sky.peaks))[:MOST_STAR_FRAMES]
        fit = fit_stars(skies)
        cannot = star_limits(fit, lat)
    camera = _camera(fit, lat, lon, mask)
    if mask is None and body == "sun" and (hidden := standing.hidden(camera)) is not None:
        camera = replace(camera, mask=Mask(hidden, "the frames"))
        cannot = (*cannot, "bright roofs and wires before the sky: only what is dark in all frames went into the mask")
    content = CameraFile(camera, name, settings, _table(body, fit, cannot, len(given)))
    return Calibration(content, body, fit, cannot)


class Checked(NamedTuple):
    """How many stars of a frame a camera finds, their median distance, and how many it would find by chance."""

    matches: int
    median_px: float
    by_chance: float

    @property
    def doubt(self) -> str:
        """Why so many stars say nothing of the camera, by the rule of a fit; empty where they do."""
        return too_few(self.matches, self.by_chance)


@takes
def check(
    camera: CameraFile, frame: str | os.PathLike[str], time: Time = None, height_m: float = 0.0
) -> Checked:
    """How well a camera finds the stars of a frame; nothing is fitted."""
    seen = read_frame(frame, time, camera.frames)
    place, optics = camera.camera, camera.camera.optics
    if place.lat is None or place.lon is None or optics is None:
        raise UserError("only a camera with a lens, at a latitude and longitude, can be checked by stars")
    if seen.shape != place.shape:
        raise UserError(f"{seen.path}: is {seen.shape[1]}x{seen.shape[0]} pixels, its camera {place.shape[1]}x"
                        f"{place.shape[0]}: give the camera of this frame")  # fmt: skip
    altitude = sun_position(seen.time, place.lat, place.lon, height_m).refracted_altitude_deg
    if altitude >= _NIGHT_DEG:
        raise UserError(f"{seen.path}: the sun is {altitude:.1f} degrees high: a camera is checked by the stars of a "
                        "clear night's frame")  # fmt: skip
    sky = sky_of(seen, place.lat, place.lon, height_m, None if place.mask is None else place.mask.hidden)
    size = min(max(min(seen.shape) / 1040, 0.3), 1.0)
    away_px = TOLERANCES_PX[-1] * size
    star, peak = pairs(optics, sky.direction, sky.peaks.place, away_px)
    chance = expected_by_chance(sky.direction, optics, sky.peaks.place, away_px)
    if not star.size:
        return Checked(0, float("nan"), chance)
    miss = residuals(optics, sky.direction[star], sky.peaks.place[peak])
    return Checked(int(star.size), float(np.median(np.linalg.norm(miss, axis=-1))), chance)


def _looked_at(
    given: Sequence[Path], lat: float, lon: float, height_m: float, time: Time, settings: FrameSettings, by: str | None,
    hidden: NDArray[np.bool_] | None, standing: Standing,
) -> list[Sky | Sighting]:  # fmt: skip
    """What each frame shows, and in those with the sun, what stands before the sky; no more than one frame's counts are
    held at a time."""
    out: list[Sky | Sighting] = []
    shape: tuple[int, int] | None = None
    by_day = False
    for path in given:
        frame = read_frame(path, time, settings, len(given) == 1)
        pixels = f"{path}: is {frame.shape[1]}x{frame.shape[0]} pixels"
        require(shape in (None, frame.shape), f"{pixels}, the frames before are not: give those of one camera")
        require(hidden is None or hidden.shape == frame.shape, f"{pixels}, the mask is not")
        shape = frame.shape
        altitude = sun_position(frame.time, lat, lon, height_m).refracted_altitude_deg
        way = by or ("stars" if altitude < _NIGHT_DEG else "sun" if altitude > _DAY_DEG else "")
        if not way:
            if len(given) == 1:
                raise UserError(f"{path}: the sun is {altitude:.1f} degrees high: neither sun nor stars show")
            continue
        if way == "moon" and altitude > _DAY_DEG:
            by_day = True
            continue  # the round bright spot is the sun
        if way == "stars":
            out.append(sky_of(frame, lat, lon, height_m, hidden))
            continue
        out.append(found := sighting(frame, hidden))
        if way == "sun" and found.spot is not None:
            standing.add(frame)
    if len(out) == 1 and isinstance(out[0], Sighting):
        body, span = ("moon", "night") if by == "moon" else ("sun", "day")
        altitude = sun_position(out[0].frame.time, lat, lon, height_m).refracted_altitude_deg
        told = out[0].lacks(body, altitude) if out[0].spot is None else f"one {body} tells no camera"
        raise UserError(f"{given[0]}: {told}; give {LEAST_SPOTS} frames or more of a clear {span}, or a starry one")
    if not out and by_day:
        raise UserError(f"{given[0]}: the sun is up in all frames, and its spot no moon: give a night's frames")
    if not out:
        raise UserError(f"{given[0]}: in none of the frames sun or stars show")
    return out


def _hidden(mask: str | os.PathLike[str] | None) -> NDArray[np.bool_] | None:
    if mask is None:
        return None
    counts = read_picture(Path(mask)).counts
    return np.asarray((counts if counts.ndim == 2 else counts.max(axis=-1)) == 0)


def _camera(fit: StarFit | TrackFit, lat: float, lon: float, mask: Any) -> Camera:
    shape = (fit.skies[0].frame if isinstance(fit, StarFit) else fit.frames[0]).shape
    hidden = _hidden(mask)
    return Camera(
        "fisheye", shape, lat, lon, lens_optics=fit.chosen.optics,
        mask=None if hidden is None else Mask(hidden, str(mask)),
    )  # fmt: skip


def _table(body: str, fit: StarFit | TrackFit, cannot: tuple[str, ...], given: int) -> dict[str, Any]:
    """What goes into the camera's file."""
    chosen = fit.chosen
    per_degree = np.radians(1) * chosen.optics.lens.focal_px
    table: dict[str, Any] = {
        "by": body, "lens": chosen.name, "made_by": f"openswim {openswim.__version__}", "frames": given,
        "matches": chosen.matches, "median_px": round(chosen.median_px, 3), "held_out_px": round(chosen.held_out_px, 3),
        "held_out_deg": round(chosen.held_out_px / per_degree, 4),
    }  # fmt: skip
    if isinstance(fit, StarFit):
        table |= {"matches_of_the_next_solution": fit.next_matches, "matches_by_chance": round(fit.by_chance, 1)}
        first = fit.skies[0].frame
    else:
        table |= {"last_third_px": round(fit.later_px, 3), "left_out": list(fit.left_out)}
        first = fit.frames[0]
    table |= {"first_frame": first.path.name, "first_time": f"{first.time}Z", "time_from": first.time_source}
    table |= {"cannot_tell": list(cannot)}
    return table | {"held_out_px_of_lenses": {lens.name: round(lens.held_out_px, 3) for lens in fit.lenses}}
