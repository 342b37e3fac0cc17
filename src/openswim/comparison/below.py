"""What a camera sees of the land: its light, and snow on it."""

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.comparison.categories import contingency
from openswim.comparison.correlation import correlations_by_channel
from openswim.comparison.prepared import Prepared
from openswim.comparison.response import Curve
from openswim.comparison.scores import Region, Scores
from openswim.comparison.tiles import Interval

F64 = NDArray[np.float64]
SNOW_ALBEDO, SNOW_BLUE_RED = 0.4, 0.7  # apparent albedo in the green, and blue over red: bare soil is redder
FEWEST = 200  # pixels below the horizon
_NAMES = ("snow_pod", "snow_far", "snow_ets")
_NONE = "the camera sees too little land"


def below_scores(
    scores: Scores, frame: Prepared, image: xr.Dataset, curves: list[Curve | None]
) -> None:
    """r of the land's light, and scores of snow by one rule for both pictures.

    Snow is where the apparent albedo pi L / E in the green exceeds .4 and its blue over red .7; observed light goes
    through the response that the sky has given.
    """
    valid = _land(frame)
    simulated = np.asarray(image.radiance.values, float)
    if simulated.shape[-1] != frame.linear.shape[-1]:
        simulated = simulated[..., 1:2]
    region = Region.of(frame, valid & np.isfinite(simulated).all(axis=-1))
    enough = region.weight.size >= FEWEST and all(curve is not None for curve in curves)
    channels = (*frame.channels, "mean")
    found = np.full(len(channels), Interval(np.nan, reason=_NONE), object)
    snow = np.full(len(_NAMES), Interval(np.nan, reason=_NONE), object)
    if enough:
        truth = simulated[region.valid]
        linear = frame.linear[region.valid].astype(float)
        seen = np.stack([c(part) for c, part in zip(curves, linear.T, strict=True) if c is not None], axis=-1)
        found[:] = correlations_by_channel(seen, truth, region.weight, region.tiles)
        if len(channels) == 4 and (ground := _irradiance(image)) is not None:
            masks = [_snow(light, ground) for light in (seen, truth)]
            table = contingency(masks[0], masks[1], region.weight, region.tiles)
            snow[:] = [table.scores[name.removeprefix("snow_")] for name in _NAMES]
            names = ("observed_snow_cover", "simulated_snow_cover")
            for name, score in zip(names, ("observed_cover", "simulated_cover"), strict=True):
                scores.attrs[name] = table.scores[score].value
    scores.add("r_below", ("score_channel",), found, "correlation of the light of the land")
    for name, interval in zip(_NAMES, snow, strict=True):
        scores.add(name, (), np.array(interval, object), "snow on the land: " + name.removeprefix("snow_"))


def sees_land(frame: Prepared) -> bool:
    """Whether there is enough of it for a score."""
    return bool(np.count_nonzero(_land(frame)) >= FEWEST)


def _land(frame: Prepared) -> NDArray[np.bool_]:
    pixels = frame.pixels
    with np.errstate(invalid="ignore"):
        valid = pixels.inside & (pixels.altitude_deg < -0.5) & ~frame.saturated
    return valid if frame.camera.mask is None else valid & ~frame.camera.mask.hidden


def _irradiance(image: xr.Dataset) -> F64 | None:
    given: Any = image.attrs.get("global_horizontal_spectral_irradiance_w_m2_nm")
    return None if given is None else np.asarray(given, float)


def _snow(light: F64, irradiance: F64) -> NDArray[np.bool_]:
    albedo = np.pi * light / irradiance
    return np.asarray((albedo[:, 1] > SNOW_ALBEDO) & (albedo[:, 2] > SNOW_BLUE_RED * albedo[:, 0]))
