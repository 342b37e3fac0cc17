"""A camera from the stars in its frames: blind, and refused where it could be chance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.optics import Optics
from openswim.errors import UserError
from openswim.lights import star_positions
from openswim.observations.blind import Start, starts
from openswim.observations.frames import FrameInfo, SkyFrame
from openswim.observations.lens_fit import CANDIDATES, Freedom, fit, held_out_px, name_of, residuals, with_lens
from openswim.observations.matching import TOLERANCES_PX, expected_by_chance, pairs, refined
from openswim.observations.peaks import Peaks, find_peaks
from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]

FAINTEST = 3.6
LOWEST_DEG = 12.0  # refraction and extinction are sure above
LEAST_MATCHES = 15
TIMES_THE_NEXT = 1.4  # right solutions had 4 to 10 times the matches of the next distinct one, wrong ones 1.0 to 1.2
WORST_PX = 3.0  # held-out median; right ones had .3 to 2.3, wrong ones 5 to 8
GO_ON = 12  # of the guesses that have been refined coarsely, so many finely
SIGMAS = 5.0  # above what chance would match
RINGS_DEG = (0.0, 40.0, 78.0)
POLYNOMIAL_GAIN = 2.5  # a named lens is kept unless a polynomial is so many times nearer
_APART_TURN_DEG, _APART_SCALE, _APART_CENTRE = 5.0, 0.08, 0.1


@dataclass(frozen=True)
class Sky:
    """One frame's stars (n, 3: east, north, up, brightest first) and its peaks."""

    frame: FrameInfo
    direction: F64
    magnitude: F64
    name: NDArray[np.str_]
    peaks: Peaks


@dataclass(frozen=True)
class Matched:
    """Directions (n, 3) and the places (n, 2) at which frame number `frame` (n,) shows them."""

    direction: F64
    place: F64
    frame: NDArray[np.int_]


@dataclass(frozen=True)
class LensResult:
    """How one lens does: its fit, and the medians of its residuals, in sample and held out (pixels)."""

    name: str
    optics: Optics
    matches: int
    median_px: float
    held_out_px: float
    coefficients: int


@dataclass(frozen=True)
class StarFit:
    """The lens that was chosen, what it was chosen among, and what speaks for the match."""

    chosen: LensResult
    lenses: tuple[LensResult, ...]
    matched: Matched
    skies: tuple[Sky, ...]
    next_matches: int  # of the best distinct solution
    by_chance: float


def sky_of(frame: SkyFrame, lat: float, lon: float, height_m: float, hidden: NDArray[np.bool_] | None) -> Sky:
    """Stars and peaks of a frame."""
    stars = star_positions(frame.time, lat, lon, height_m, magnitude=FAINTEST, above_deg=LOWEST_DEG)
    direction = horizon_vector(stars.azimuth_deg, stars.refracted_altitude_deg)
    peaks = find_peaks(frame.green, hidden)
    return Sky(frame.info, direction, stars.catalogue.magnitude, stars.catalogue.name, peaks)


def fit_stars(skies: Sequence[Sky]) -> StarFit:
    """Find the camera; raises UserError where stars do not give it."""
    shape = skies[0].frame.shape
    size = min(max(min(shape) / 1040, 0.3), 1.0)
    richest = max(skies, key=lambda sky: len(sky.peaks))
    if len(richest.peaks) < LEAST_MATCHES:
        raise UserError(
            f"{richest.frame.path}: only {len(richest.peaks)} bright points: no stars show; take a clear night's frame"
        )
    found: list[tuple[int, Optics]] = []
    # most frames were not cut: guesses with the axis near their middle come first
    for guesses in starts(richest.direction, richest.peaks.place, shape):
        found = _solutions(guesses, richest, shape, size, found)
        judged = _judged(found, richest, skies, size)
        if isinstance(judged, StarFit):
            return judged
    raise UserError(f"{richest.frame.path}: {judged}: cloud, moonlight, twilight, or a wrong time or place")


def _judged(found: Sequence[tuple[int, Optics]], richest: Sky, skies: Sequence[Sky], size: float) -> StarFit | str:
    """The best of the solutions with the lens that does best, or what speaks against it."""
    best = found[0]
    following = found[1][0] if len(found) > 1 else 0
    results = [_result(best[1], model, n, skies, size) for model, n in CANDIDATES]
    lenses = [r for r in results if r is not None]
    chance = expected_by_chance(richest.direction, best[1], richest.peaks.place, TOLERANCES_PX[-1] * size)
    if not lenses or best[0] < LEAST_MATCHES:
        return f"no more than {best[0]} stars match"
    chosen = _choose([lens for lens in lenses if lens.matches >= 0.7 * max(each.matches for each in lenses)])
    matches = len(pairs(chosen.optics, richest.direction, richest.peaks.place, TOLERANCES_PX[-1] * size)[0])
    refused = _why_refused(matches, following, chance, chosen, size)
    matched = _matched(chosen.optics, skies, size)
    refused = refused or _why_uneven(matched, chosen.optics)
    return refused or StarFit(chosen, tuple(lenses), matched, tuple(skies), following, chance)


def _solutions(
    guesses: Sequence[Start], sky: Sky, shape: tuple[int, int], size: float, known: list[tuple[int, Optics]]
) -> list[tuple[int, Optics]]:
    """Numbers of matches and distinct solutions, best first, from guesses and with those that are known."""
    found = [(0, with_lens(start.optics, "polynomial", 1)) for start in guesses]
    for tolerances, most in ((TOLERANCES_PX[:3], len(found)), (TOLERANCES_PX[3:], GO_ON)):
        better = []
        for _, start in found[:most]:
            optics, (star, _) = refined(
                start, sky.direction, sky.peaks.place, Freedom(coefficients=1), size, tolerances
            )
            better.append((int(star.size), optics))
        found = _all_distinct(better, min(shape) / 2)
    return _all_distinct(found + known, min(shape) / 2)


def _all_distinct(solutions: list[tuple[int, Optics]], half: float) -> list[tuple[int, Optics]]:
    """Best first, those left out that are like a better one."""
    kept: list[tuple[int, Optics]] = []
    for count, optics in sorted(solutions, key=lambda each: -each[0]):
        if all(_distinct(optics, other, half) for _, other in kept):
            kept.append((count, optics))
    return kept


def _distinct(one: Optics, other: Optics, half: float) -> bool:
    turn = (one.rotation_deg - other.rotation_deg + 180) % 360 - 180
    scale = one.lens.focal_px / other.lens.focal_px - 1
    apart = np.hypot(one.centre_row - other.centre_row, one.centre_column - other.centre_column) / half
    return (
        one.mirrored != other.mirrored or abs(turn) > _APART_TURN_DEG or abs(scale) > _APART_SCALE
        or apart > _APART_CENTRE
    )  # fmt: skip


def _matched(optics: Optics, skies: Sequence[Sky], size: float) -> Matched:
    parts = []
    for number, sky in enumerate(skies):
        star, peak = pairs(optics, sky.direction, sky.peaks.place, TOLERANCES_PX[-1] * size)
        parts.append((sky.direction[star], sky.peaks.place[peak], np.full(star.size, number)))
    return Matched(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _result(start: Optics, model: str, coefficients: int, skies: Sequence[Sky], size: float) -> LensResult | None:
    """Fit a lens to all frames, the match renewed with each round; None where too few stars are left."""
    optics, freedom = with_lens(start, model, coefficients), Freedom(coefficients=coefficients)
    for tolerance in (25.0, 12.0, 8.0, 8.0):
        parts = []
        for sky in skies:
            star, peak = pairs(optics, sky.direction, sky.peaks.place, tolerance * size)
            parts.append((sky.direction[star], sky.peaks.place[peak]))
        direction, place = (np.concatenate(each) for each in zip(*parts, strict=True))
        if len(direction) < LEAST_MATCHES:
            return None
        optics = fit(optics, direction, place, freedom, scale_px=size)
    matched = _matched(optics, skies, size)
    if len(matched.direction) < LEAST_MATCHES:
        return None
    away = np.linalg.norm(residuals(optics, matched.direction, matched.place), axis=-1)
    held = held_out_px(optics, matched.direction, matched.place, freedom)
    name = name_of(model, coefficients)
    return LensResult(name, optics, len(held), float(np.median(away)), float(np.median(held)), coefficients)


def _choose(lenses: Sequence[LensResult]) -> LensResult:
    """By the held-out residual; of a named lens and a polynomial that is little nearer, the named one."""
    best = min(lenses, key=lambda lens: lens.held_out_px)
    for count in range(best.coefficients):
        simpler = [lens for lens in lenses if lens.coefficients == count]
        if simpler:
            first = min(simpler, key=lambda lens: lens.held_out_px)
            if first.held_out_px <= POLYNOMIAL_GAIN * best.held_out_px:
                return first
    return best


def too_few(matches: int, chance: float) -> str:
    """Why so many matches tell no camera; empty where they do."""
    if matches < LEAST_MATCHES:
        return f"no more than {matches} stars match"
    if matches < chance + SIGMAS * np.sqrt(max(chance, 1.0)):
        return f"{matches} stars match, {chance:.0f} would by chance"
    return ""


def _why_refused(matches: int, following: int, chance: float, chosen: LensResult, size: float) -> str:
    """What speaks against a match; empty where nothing does."""
    if matches < TIMES_THE_NEXT * following:
        return f"{matches} stars match one way and {following} another"
    if few := too_few(matches, chance):
        return few
    if chosen.held_out_px > WORST_PX * size:
        return f"stars that were left out lie {chosen.held_out_px:.1f} px from where the best lens has them"
    return ""


def _why_uneven(matched: Matched, optics: Optics) -> str:
    """Whether the matches cover the sky: three quadrants and two rings."""
    row, column = (matched.place - [optics.centre_row, optics.centre_column]).T
    quadrants = np.bincount((row > 0) * 2 + (column > 0), minlength=4)
    zenith = np.degrees(np.arccos(np.clip(matched.direction[:, 2], -1, 1)))
    rings = np.histogram(zenith, RINGS_DEG)[0]
    if (quadrants >= 3).sum() < 3 or (rings >= 3).sum() < 2:
        return f"{len(zenith)} stars match, in one part of the sky only"
    return ""
