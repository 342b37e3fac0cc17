"""A camera from the way of the sun, or of the moon, through its frames."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.lenses import Lens
from openswim.cameras.optics import Optics
from openswim.errors import UserError
from openswim.lights import moon_position, sun_position
from openswim.observations.frames import FrameInfo, SkyFrame
from openswim.observations.lens_fit import CANDIDATES, Freedom, fit, held_out_px, name_of, residuals, with_lens
from openswim.observations.star_fit import LensResult, Matched
from openswim.observations.sun_spot import OVEREXPOSED, Spot, find_spot, full_share
from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]

LEAST_SPOTS = 6
LEAST_ARC_DEG = 30.0  # between the first and the last direction
WORST_PX = 6.0  # held-out median, of a frame of 1920 rows: spots are lopsided by 2 to 5 pixels
FARTHEST = 0.25  # of the axis from the middle of the frame, over half of its shorter side, where a day tells no tilt
TELLS_TILT_DEG = 10.0  # range of declination from which on tilt and lens are told apart
_OUTLIER_PX = 15.0
# share of full that three quarters of a frame are below at night: .03 and .11 of clear ones, .5 and more by day; the
# median may be that of the corners beside a fisheye's circle
_DARK, _SKY_PERCENT = 0.25, 75
_MANY = 5.0  # an outlier lies so many medians away
ALIKE = 1.3
_SCALES = np.geomspace(0.6, 1.5, 7)


@dataclass(frozen=True)
class Sighting:
    """A frame, and the spot in it if there is one; the share of it that is full where that is too much to tell."""

    frame: FrameInfo
    spot: Spot | None
    overexposed: float = 0.0
    dark: bool = False  # as frames of a night are

    def lacks(self, body: str, altitude_deg: float) -> str:
        """Why there is no spot of a body that is so high at the place and time that are told."""
        if self.overexposed:
            return f"overexposed, every channel is full in {100 * self.overexposed:.0f} % of it"
        if self.dark and body == "sun" and altitude_deg > 0:
            up = f"the sun is {altitude_deg:.1f} degrees up at that place and time"
            return f"no sun in this frame, which is dark, while {up}: the time, its zone or the place may be wrong"
        return f"no {body} in this frame"


def sighting(frame: SkyFrame, hidden: NDArray[np.bool_] | None) -> Sighting:
    """Look for the sun, or the moon."""
    if (share := full_share(frame, hidden)) > OVEREXPOSED:
        return Sighting(frame.info, None, share)
    spot = find_spot(frame, hidden)
    dark = spot is None and float(np.percentile(frame.green, _SKY_PERCENT)) < _DARK * frame.saturated
    return Sighting(frame.info, spot, dark=dark)


@dataclass(frozen=True)
class TrackFit:
    """The lens, what it was chosen among, the spots that were used and those that were left out as too far."""

    body: str  # sun or moon
    chosen: LensResult
    lenses: tuple[LensResult, ...]
    matched: Matched
    frames: tuple[FrameInfo, ...]
    left_out: tuple[str, ...]  # and why
    tilt_told: bool
    later_px: float  # median distance of the last third's spots from a fit to the first two


def fit_track(sightings: Sequence[Sighting], lat: float, lon: float, height_m: float, body: str) -> TrackFit:
    """Find the camera; raises UserError where the spots do not give it.  `body`: sun or moon."""
    ordered = sorted(sightings, key=lambda each: each.frame.time)
    frames = [each.frame for each in ordered]
    direction, place, number, left_out, declination = [], [], [], [], []
    for index, each in enumerate(ordered):
        where = (sun_position if body == "sun" else moon_position)(each.frame.time, lat, lon, height_m)
        if each.spot is None or where.refracted_altitude_deg < 0:
            why = f"the {body} is below the horizon"
            if each.spot is None:
                why = each.lacks(body, where.refracted_altitude_deg)
            left_out.append(f"{each.frame.path.name}: {why}")
            continue
        vector = horizon_vector(where.azimuth_deg, where.refracted_altitude_deg)
        pole = np.array([0.0, np.cos(np.radians(lat)), np.sin(np.radians(lat))])
        declination.append(np.degrees(np.arcsin(np.clip(vector @ pole, -1, 1))))
        direction.append(vector)
        place.append((each.spot.row, each.spot.column))
        number.append(index)
    if len(direction) < LEAST_SPOTS:
        why = f" ({left_out[0]})" if left_out else ""
        raise UserError(
            f"{frames[0].path}: the {body} is found in {len(direction)} of {len(frames)} frames{why}; a fit needs "
            f"{LEAST_SPOTS}: give more frames of a clear {'day' if body == 'sun' else 'night'}"
        )
    matched = Matched(np.array(direction), np.array(place), np.array(number))
    arc = np.degrees(np.arccos(np.clip((matched.direction @ matched.direction.T).min(), -1, 1)))
    if arc < LEAST_ARC_DEG:
        raise UserError(
            f"{frames[0].path}: the {body}'s way in these frames spans {arc:.0f} degrees; give frames over 30 or more"
        )
    tilt = float(np.ptp(declination)) > TELLS_TILT_DEG
    return _fitted(frames, matched, body, left_out, tilt)


def _fitted(
    frames: Sequence[FrameInfo], matched: Matched, body: str, left_out: list[str], tilt: bool
) -> TrackFit:
    shape = frames[0].shape
    size = max(min(shape) / 1920, 0.3)
    first = _blind(matched, shape, size)
    away = np.linalg.norm(residuals(first, matched.direction, matched.place), axis=-1)
    far = away > max(_OUTLIER_PX * size, _MANY * float(np.median(away)))
    for index in matched.frame[far]:
        left_out.append(f"{frames[index].path.name}: its spot lies far from the {body}'s way")
    matched = Matched(matched.direction[~far], matched.place[~far], matched.frame[~far])
    if far.mean() > 1 / 3 or len(matched.direction) < LEAST_SPOTS:
        raise UserError(
            f"{frames[0].path}: {far.sum()} of {far.size} spots do not follow the {body}'s way: cloud, or a wrong time "
            "or place"
        )
    lenses = []
    for model, coefficients in CANDIDATES:
        if coefficients and not tilt:
            continue  # a day's way cannot tell
        freedom = Freedom(tilt=tilt, coefficients=coefficients)
        start = with_lens(first, model, coefficients)
        optics = fit(start, matched.direction, matched.place, freedom, scale_px=3 * size)
        miss = np.linalg.norm(residuals(optics, matched.direction, matched.place), axis=-1)
        held = held_out_px(start, matched.direction, matched.place, freedom)
        name = name_of(model, coefficients)
        lenses.append(LensResult(name, optics, len(held), float(np.median(miss)), float(np.median(held)), coefficients))
    best = min(lenses, key=lambda lens: lens.held_out_px)
    # of lenses that the spots do not tell apart, the first: equidistant before the rarer ones
    chosen = next(lens for lens in lenses if lens.held_out_px <= ALIKE * best.held_out_px)
    if chosen.held_out_px > WORST_PX * size:
        raise UserError(
            f"{frames[0].path}: spots that were left out lie {chosen.held_out_px:.1f} px from where the best lens has "
            "them: cloud, or a wrong time or place"
        )
    down, right = ((n - 1) / 2 - c for n, c in zip(shape, _centre(chosen.optics), strict=True))
    off = np.hypot(down, right) / (min(shape) / 2)
    if off > FARTHEST and not tilt:
        # a day's way is an arc, which a shifted lens can lay over that of another place or date
        raise UserError(
            f"{frames[0].path}: the axis of the lens that fits lies {off:.0%} of half of the frame's shorter side from "
            "its middle: a wrong time, date or place, or frames that were cut on one side"
        )
    later = _later_px(chosen, matched, Freedom(tilt=tilt, coefficients=chosen.coefficients))
    return TrackFit(body, chosen, tuple(lenses), matched, tuple(frames), tuple(left_out), tilt, later)


def _centre(optics: Optics) -> tuple[float, float]:
    return optics.centre_row, optics.centre_column


def _blind(matched: Matched, shape: tuple[int, int], size: float) -> Optics:
    """An equidistant lens, by least squares from all sides: scale, rotation, handedness."""
    middle = (shape[0] - 1) / 2, (shape[1] - 1) / 2
    best: tuple[float, Optics] | None = None
    for mirrored in (False, True):
        for scale in _SCALES:
            focal = min(shape) / 2 * scale / (np.pi / 2)
            guesses = [
                Optics(Lens("equidistant", focal), *middle, float(turn), mirrored=mirrored)
                for turn in range(0, 360, 15)
            ]
            costs = [_cost(guess, matched, size) for guess in guesses]
            start = guesses[int(np.argmin(costs))]
            optics = fit(start, matched.direction, matched.place, Freedom(centre=False, tilt=False), 10 * size)
            optics = fit(optics, matched.direction, matched.place, Freedom(tilt=False), 5 * size)
            cost = _cost(optics, matched, size)
            if best is None or cost < best[0]:
                best = cost, optics
    assert best is not None
    return best[1]


def _cost(optics: Optics, matched: Matched, size: float) -> float:
    away = np.linalg.norm(residuals(optics, matched.direction, matched.place), axis=-1)
    return float(np.sqrt(1 + (away / (5 * size)) ** 2).mean())


def _later_px(chosen: LensResult, matched: Matched, freedom: Freedom) -> float:
    n = len(matched.direction)
    early = np.arange(n) < n - n // 3
    optics = fit(chosen.optics, matched.direction[early], matched.place[early], freedom)
    miss = residuals(optics, matched.direction[~early], matched.place[~early])
    return float(np.median(np.linalg.norm(miss, axis=-1)))
