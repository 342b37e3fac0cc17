"""Exposure: by what a picture shows, the sun's height, a curve of it, a camera's settings, or as it is given."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from openswim.arguments import shown
from openswim.colour.cie import solar_illuminance_lx
from openswim.errors import UserError

MIDDLE = 0.33  # where auto exposure would put the typical luminance ...
HIGHLIGHT = 1.1  # ... and the most that it lets the bright parts have; the shoulder takes 1.1 to .849
BRIGHT, GLARING = 98.0, 85.0  # percentiles of the bright parts, and of those that may burn out for dark land's sake
DARK, READABLE = 15.0, 0.024  # percentile of the dark parts, and what they then have: 43/255 on the screen
# A disc of the sun or moon is what a long lens is for where it has at least this share of the picture, all else is so
# much darker, with next to nothing between, and it is in one place: a crescent has a tenth of the box around it.
# A thin crescent seen 3 degrees wide has a share of .005; through lenses of 12 degrees discs have less
DISC_SHARE, DISC_ALONE, DISC_EVEN, DISC_BOX = 0.003, 1e3, 30.0, 0.08
# Night is to look like night: where the typical luminance falls from that of deep twilight to that of a moonless sky,
# what it goes to falls from a third of white to less than a tenth, and what the dark parts have as much
DUSK, NIGHT, NIGHT_MIDDLE = 1e-5, 2e-8, 0.09
MOST_EXPOSURE = 1e9
LARGEST_EXPOSURE = 1e12  # that makes sense, of the darkest night
# The sun's altitude and the exposure of `sun`: what `auto_of` gives all-round pictures of the clear standard sky
SUN_CURVE = ((-18.0, 7e6), (-12.0, 2.5e5), (-10.0, 6e4), (-8.0, 1.1e4), (-6.0, 1900.0), (-4.0, 260.0), (-2.0, 50.0),
             (0.0, 13.0), (2.0, 5.2), (5.0, 2.4), (10.0, 1.4), (20.0, 1.0), (45.0, 0.92), (90.0, 0.75))


def auto_of(luminance: np.ndarray, weight: np.ndarray | None = None, glare: np.ndarray | float = 0.0) -> float:
    """The factor from L' to display light that a photographer would choose for pixels of a luminance, which count by a
    weight, such as their solid angle; glare: what a lens adds to them.

    The typical luminance (geometric mean) goes to a third of white unless that would burn out the bright parts: their
    98th percentile stays at 1.1, which the shoulder brings below white. Where that would leave land dark under a low
    sun, up to 15 % of the pixels may burn out. At night it goes to less than a tenth, as from a tripod. Pixels outside
    the image, black space (below .2 % of the bright parts) and the sun's disc do not count, but for a lens so long that
    it sees little but a disc: that of the sun or moon is what counts then. Which pixels count is told without the
    glare, and how bright they are with it.
    """
    added = np.broadcast_to(glare, luminance.shape)
    weight = np.ones_like(luminance) if weight is None else np.broadcast_to(weight, luminance.shape)
    known = np.isfinite(luminance) & (luminance > 0) & (weight > 0)
    if not known.any():
        return 1.0
    valid, weight, added = luminance[known], weight[known], added[known]
    if luminance.ndim == 2:
        disc = _disc(np.where(known, luminance, 0.0), known)[known]
        valid, weight, added = valid[disc], weight[disc], added[disc]
    (bright,) = _percentiles(valid, weight, BRIGHT)
    some = (valid > 0.002 * bright) & (valid < 30 * bright)
    scene, weight = (valid + added)[some], weight[some]
    typical = np.exp(np.average(np.log(scene), weights=weight))
    late = np.clip(np.log(DUSK / typical) / np.log(DUSK / NIGHT), 0, 1)
    fallen = (NIGHT_MIDDLE / MIDDLE) ** late
    dark, glaring, bright = _percentiles(scene, weight, DARK, GLARING, BRIGHT)
    readable = min(READABLE * fallen / dark, HIGHLIGHT / glaring)
    return float(min(MIDDLE * fallen / typical, max(HIGHLIGHT / bright, readable), MOST_EXPOSURE))


def _disc(luminance: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Which pixels (ny, nx) are those of a disc that stands alone in the dark; all, where there is none."""
    most = luminance.max()
    even, dark = luminance > most / DISC_EVEN, luminance < most / DISC_ALONE
    share, between = even.sum() / known.sum(), (known & ~(even | dark)).sum() / known.sum()
    rows, columns = (np.flatnonzero(even.any(axis=axis)) for axis in (1, 0))
    sides = np.ptp(rows) + 1, np.ptp(columns) + 1
    together = even.sum() > DISC_BOX * max(sides) ** 2
    alone = together and DISC_SHARE < share < 1 - BRIGHT / 100 and between < 0.5 * share
    return even if alone else known


def _percentiles(values: np.ndarray, weight: np.ndarray, *wanted: float) -> np.ndarray:
    order = np.argsort(values)
    below = np.cumsum(weight[order], dtype=float) - 0.5 * weight[order]
    return np.interp(np.array(wanted) / 100 * weight.sum(dtype=float), below, values[order])


def exposure_of(image: xr.Dataset | xr.DataArray, exposure: Any) -> float | None:
    """The factor that a picture gets; None for "auto", which looks at its pixels. See `check_exposure`."""
    if not isinstance(exposure, str):
        return float(exposure)
    if exposure == "auto":
        return None
    if (settings := _settings(exposure)) is not None:
        return camera_exposure(*settings, image.attrs.get("sun_distance_au", 1.0))
    curve = SUN_CURVE if exposure == "sun" else _curve(exposure)
    altitude = image.attrs.get("sun_altitude_deg")
    if altitude is None:
        told = f"exposure {shown(exposure)} goes by the sun, whose altitude the image does not have"
        raise UserError(f"{told}: give a number")
    heights, values = np.array(sorted(curve)).T
    return float(np.exp(np.interp(float(altitude), heights, np.log(values))))


def camera_exposure(seconds: float, f_number: float, iso: float, sun_distance_au: float = 1.0) -> float:
    """The factor from L' to display light of a camera's settings: white is where a sensor of that speed is full (ISO
    12232: 78 lx s over the speed, of .65 of the scene's light by the square of the f-number)."""
    luminance = solar_illuminance_lx() / (4 * np.pi * sun_distance_au**2)  # of L' = 1
    return float(0.65 * seconds / f_number**2 * luminance * iso / 78.0)


def check_exposure(exposure: Any) -> None:
    """Raise UserError unless it is a positive number, "auto", "sun" (by the sun's altitude alone, alike for all
    pictures of a series), such a curve as "-6:900,0:14,30:1.3" of altitudes in degrees and exposures, or a camera's
    settings such as "1/250s f/8 ISO100"."""
    if isinstance(exposure, str) and exposure not in ("auto", "sun"):
        if _settings(exposure) is None:
            _curve(exposure)
    elif not isinstance(exposure, str) and not is_positive(exposure):
        raise UserError(_WRONG.format(shown(exposure)))


def check_gamma(gamma: Any) -> None:
    """Raise UserError unless it is "srgb" or a positive number."""
    if gamma != "srgb" and not is_positive(gamma):
        raise UserError(f"gamma {shown(gamma)} must be 'srgb' or a positive number such as 2.2")


def is_positive(value: object) -> bool:
    return isinstance(value, (int, float, np.number)) and bool(0 < value <= LARGEST_EXPOSURE)


_WRONG = (
    "exposure {} must be a positive number up to 1e12, 'auto', 'sun', a curve ALTITUDE:EXPOSURE,... of the sun, or a "
    "camera's, such as '15s f/2.8 ISO1600'"
)


def _settings(text: str) -> tuple[float, float, float] | None:
    """Seconds, f-number and speed of a camera; None where the text does not speak of one."""
    found = re.fullmatch(r"\s*(?:1/)?([\d.]+)\s*s[,\s]+f/?([\d.]+)[,\s]+iso\s*([\d.]+)\s*", text, re.IGNORECASE)
    if found is None:
        return None
    try:
        seconds, f_number, iso = (float(part) for part in found.groups())
        seconds = 1 / seconds if text.lstrip().startswith("1/") else seconds
        sensible = 1e-9 < seconds < 1e9 and 1e-2 < f_number < 1e4 and 1e-2 < iso < 1e9
    except (ValueError, ZeroDivisionError):
        sensible = False
    if not sensible:
        raise UserError(_WRONG.format(shown(text)))
    return seconds, f_number, iso


def _curve(text: str) -> Sequence[tuple[float, float]]:
    points = [re.fullmatch(r"\s*([-+.\d]+)\s*:\s*([-+.\deE]+)\s*", part) for part in text.split(",")]
    try:
        curve = [(float(p[1]), float(p[2])) for p in points if p is not None]
    except ValueError:
        curve = []
    if not curve or len(curve) < len(points) or not all(is_positive(value) and abs(a) <= 90 for a, value in curve):
        raise UserError(_WRONG.format(shown(text)))
    if len({altitude for altitude, _ in curve}) < len(curve):
        raise UserError(f"exposure {shown(text)} has an altitude twice: leave one of them out")
    return curve
