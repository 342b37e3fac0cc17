"""All of one frame beside one sky: pictures, masks, scores."""

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.cameras.files import CameraFile
from openswim.comparison.below import below_scores, sees_land
from openswim.comparison.cloud_rules import CLEAR_SKY, DEPARTURE, FIXED, NO_AIR, is_black, log_red_blue
from openswim.comparison.doubt import doubt
from openswim.comparison.prepared import Prepared, open_pixels, prepared, valid_pixels
from openswim.comparison.response import AEROSOL_NOTE, Curve, encoded, fit_curve, fit_power_law
from openswim.comparison.scores import (
    NO_BALANCE,
    NO_SCALE,
    Region,
    Scores,
    cloud_scores,
    correlations,
    radiance_errors,
    undone,
)
from openswim.comparison.settings import SUN_MASKS_DEG, KnownCamera, Settings, encoding_of, weighted_median
from openswim.comparison.skies import Skies
from openswim.comparison.tiles import NO_PIXEL
from openswim.errors import UserError
from openswim.observations import SkyFrame

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_BITS, _MANTISSA = 12, 23
_ANGLE_BITS = 14  # of angles, .008 degrees at 360


def compare_frame(
    skies: Skies, frame: SkyFrame, content: CameraFile, settings: Settings, known: KnownCamera
) -> xr.Dataset:
    """All of one frame: pictures, masks, scores."""
    ready = prepared(frame, content.camera, encoding_of(settings, content), settings.size)
    camera, pixels, colours = ready.camera, ready.pixels, ready.linear.shape[-1]
    if known.curves is not None and len(known.curves) != colours:
        raise UserError(f"{frame.path}: is {'grey' if colours == 1 else 'in colours'}, the clear frame is not: give a "
                        "clear frame of the same kind, or none")  # fmt: skip
    sun = skies.sun_at(camera, ready.time)
    image = skies.simulated(camera, ready.time)
    if settings.ghi_w_m2 is not None or settings.dhi_w_m2 is not None or sees_land(ready):
        image = skies.with_irradiance(image)
    simulated = np.asarray(image.radiance.values, float)
    clear = simulated if skies.model is None else skies.clear(camera, ready.time)
    part = slice(None) if colours == 3 else slice(1, 2)
    regions = {}
    for mask_deg in sorted({*SUN_MASKS_DEG, settings.sun_mask_deg}):
        valid = valid_pixels(ready, sun, mask_deg, settings.lowest_deg)
        regions[mask_deg] = Region.of(ready, valid & np.isfinite(simulated).all(axis=-1))
    region = regions[settings.sun_mask_deg]
    scores = Scores()
    _put_pictures(scores, ready, simulated[..., part], clear[..., part], region)
    correlations(scores, ready, simulated[..., part], regions, known.curves)
    scale = _scale(known, settings, image, ready, simulated[..., part], region)
    radiance_errors(scores, ready, simulated[..., part], region, scale)
    curves: list[Curve | None] = list(known.curves or ())
    if not curves:
        pairs = zip(ready.linear[region.valid].astype(float).T, simulated[..., part][region.valid].T, strict=True)
        curves = [fit_curve(seen, truth, region.weight) for seen, truth in pairs]
    shown = as_stored(simulated[..., part], ready, region, known)
    if colours == 3:
        _clouds(scores, ready, simulated, clear, region, known, shown, by_day=sun[1] >= 0)
    below_scores(scores, ready, image, curves)
    if skies.model is None and settings.aod_range and region.weight.size:
        _aerosol_range(scores, skies, ready, region, clear, part)
    _response(scores, ready, simulated[..., part], region, curves)
    text = {"long_name": "the simulated picture as this camera would store it"}
    scores.variables["simulated_as_stored"] = (("y", "x", "channel"), rounded(shown), text)
    scores.attrs |= _attributes(skies, ready, image, sun, settings, known, scores.reasons)
    there = open_pixels(ready, sun, settings.sun_mask_deg, settings.lowest_deg)
    if skies.sun is None:
        place = skies.place_of_camera(content.camera, ready.time)
        odd = doubt(frame, content.camera, ready, simulated, region, sun[1], place, known.red_blue)
        scores.attrs["doubt"] = "; ".join(filter(None, (frame.doubt, odd)))
    whole = pixels.solid_angle_sr[there].sum()
    scores.attrs["share_of_sky_used"] = round(float(region.weight.sum() / whole), 4) if whole > 0 else 0.0
    distance = rounded(pixels.angle_to_deg(*sun), _ANGLE_BITS)
    scores.variables["sun_distance"] = (("y", "x"), distance, {"units": "degree"})
    return scores.dataset()


def rounded(values: NDArray[np.floating], bits: int = _BITS) -> F32:
    """Values to so many bits behind the leading one, 1.2e-4 of them, in half the room once they are packed; no camera
    and no model tells light so closely."""
    left = np.uint32(_MANTISSA - bits)
    dropped = np.uint32((1 << int(left)) - 1)
    found = np.array(values, np.float32).view(np.uint32)
    even = (found >> left) & np.uint32(1)  # halves go to the even neighbour
    return ((found + (dropped >> np.uint32(1)) + even) & ~dropped).view(np.float32)


def _put_pictures(scores: Scores, frame: Prepared, simulated: F64, clear: F64, region: Region) -> None:
    plane, unit = ("y", "x"), {"units": "W m-2 sr-1 nm-1"}
    pixels = frame.pixels
    scores.variables |= {
        "stored": ((*plane, "channel"), rounded(frame.stored), {"long_name": "counts as a share of full scale"}),
        "observed": ((*plane, "channel"), rounded(frame.linear), {"long_name": "linear share of full scale"}),
        "simulated": ((*plane, "channel"), rounded(simulated), {"long_name": "radiance", **unit}),
        "clear_sky": ((*plane, "channel"), rounded(clear), {"long_name": "radiance", **unit}),
        "valid": (plane, region.valid, {"long_name": "pixels that the scores are of"}),
    }
    scores.coords |= {
        "channel": list(frame.channels),
        "azimuth": (plane, rounded(pixels.azimuth_deg, _ANGLE_BITS), {"units": "degree"}),
        "altitude": (plane, rounded(pixels.altitude_deg, _ANGLE_BITS), {"units": "degree"}),
        "solid_angle": (plane, pixels.solid_angle_sr.astype(np.float32), {"units": "sr"}),
    }


def _clouds(
    scores: Scores, frame: Prepared, simulated: F64, clear: F64, region: Region, known: KnownCamera, shown: F64,
    by_day: bool,
) -> None:  # fmt: skip
    """Masks by all rules, of both pictures, and their scores; shown: the simulated one as stored. By night the frame
    tells no white balance, as it is of stars, lamps and noise rather than of a blue sky, and fixed ratios, which are of
    daylight, tell no clouds."""
    plane = ("y", "x")
    blue_sky = log_red_blue(clear)
    black = is_black(clear[region.valid]) and bool(region.weight.size)
    with np.errstate(invalid="ignore"):  # of a black sky
        raw = log_red_blue(frame.linear) - blue_sky
    typical = weighted_median(raw[region.valid], region.weight) if by_day and not black else float("nan")
    scores.attrs["red_blue_of_this_frame"] = typical
    masks = {}
    if known.red_blue is not None and not black:
        with np.errstate(invalid="ignore"):
            pair = raw - known.red_blue > DEPARTURE, log_red_blue(simulated) - blue_sky > DEPARTURE
        masks[CLEAR_SKY] = pair
        scores.variables["departure"] = (plane, (raw - known.red_blue).astype(np.float32),
                                         {"long_name": "ln(red/blue) above the clear sky's"})  # fmt: skip
        for name, mask in zip(("observed_cloud", "simulated_cloud"), pair, strict=True):
            scores.variables[name] = (plane, mask & region.valid)
    counts = frame.stored[region.valid].astype(float), shown[region.valid]
    for name, rule in FIXED.items() if by_day else ():
        pair = np.zeros(region.valid.shape, bool), np.zeros(region.valid.shape, bool)
        if region.weight.size:
            for mask, own in zip(pair, counts, strict=True):
                mask[region.valid] = rule(own)
        masks[name] = pair
    cloud_scores(scores, frame, masks, region, NO_AIR if black else NO_BALANCE)


def as_stored(simulated: F64, frame: Prepared, region: Region, known: KnownCamera) -> F64:
    """Shares of full scale (ny, nx, channels) that this camera would have stored of simulated radiance: by its response
    where that is known, or by a gain for each channel; without a valid pixel by one that shows the sky."""
    lit = region.valid & (simulated > 0).all(axis=-1)
    if not region.weight.size or not lit.any():
        light = simulated * (0.2 / np.median(simulated[simulated > 0]) if (simulated > 0).any() else 1.0)
    elif known.answers is not None:
        parts = np.moveaxis(simulated, -1, 0)
        light = np.stack([curve.smooth(part) for curve, part in zip(known.answers, parts, strict=True)], axis=-1)
    else:
        seen, truth = (np.median(v[lit], axis=0) for v in (frame.linear.astype(float), simulated))
        light = simulated * (seen / truth)
    return encoded(np.clip(np.nan_to_num(light), 0, 1), frame.encoding)


def _aerosol_range(scores: Scores, skies: Skies, frame: Prepared, region: Region, clear: F64, part: slice) -> None:
    """Mean r with the response undone for half and twice the aerosol: how little r says of it."""
    from openswim.comparison.correlation import correlation

    assert skies.aod is not None
    depths = [skies.aod * factor for factor in (0.5, 1.0, 2.0)]
    found = []
    for depth in depths:
        sky = clear if depth == skies.aod else skies.clear(frame.camera, frame.time, depth)
        truth = sky[..., part][region.valid]
        light = undone(frame.linear[region.valid].astype(float), truth, region, None)
        found.append(correlation(light, truth, region.weight, region.tiles).value)
    scores.coords["aod"] = ("aod", depths, {"long_name": "aerosol optical depth at 550 nm"})
    scores.variables["r_by_aod"] = ("aod", found, {"long_name": "mean r, response undone, if the aerosol were this"})


def _response(scores: Scores, frame: Prepared, simulated: F64, region: Region, curves: list[Curve | None]) -> None:
    """The curve that was found, its rms, and the power law nearest to it."""
    channels = len(frame.channels)
    gamma = exposure = balance = rms = np.full(channels, np.nan)
    known = [curve for curve in curves if curve is not None]
    if len(known) == channels and region.weight.size:
        law = fit_power_law(frame.stored[region.valid].astype(float), simulated[region.valid], region.weight)
        gamma, exposure, balance = law.gamma, law.exposure, law.white_balance
        rms = np.array([curve.rms for curve in known]) * 255
        at = np.linspace(0, 1, 65)
        scores.coords["light_level"] = at
        scores.variables["response_curve"] = (
            ("light_level", "channel"), np.stack([curve(at) for curve in known], axis=-1),
            {"long_name": "radiance by linear light", "units": "W m-2 sr-1 nm-1"},
        )  # fmt: skip
    texts = {
        "response_gamma": (gamma, "stored = (exposure radiance)^(1 / gamma)"),
        "response_exposure": (exposure, "per W m-2 sr-1 nm-1"),
        "white_balance": (balance, "exposure over green's"),
        "response_rms": (rms, "what the curve leaves, counts of 255"),
    }
    for name, (values, text) in texts.items():
        scores.variables[name] = ("channel", values, {"long_name": text})


def _scale(
    known: KnownCamera, settings: Settings, image: xr.Dataset, frame: Prepared, simulated: F64, region: Region
) -> F64 | str:
    """Radiance of a linear full scale (channels,): the camera's own, or by a pyranometer beside it; or why there is
    none.

    One irradiance fixes one number: colours, and the parts that are masked, are taken from the simulated sky.
    """
    channels = simulated.shape[-1]
    if known.scale is not None:
        return np.broadcast_to(known.scale, channels)
    measured, diffuse = settings.dhi_w_m2, float(image.attrs.get("diffuse_horizontal_irradiance_w_m2", np.nan))
    less = ""
    if measured is None and settings.ghi_w_m2 is not None:
        direct = float(image.attrs["direct_horizontal_irradiance_w_m2"])
        measured = settings.ghi_w_m2 - direct
        less = f" (--ghi less the simulated direct part, {direct:.0f}; give --dhi)"
    if measured is None:
        return NO_SCALE
    if not region.weight.size:
        return NO_PIXEL
    if not (measured > 0 and diffuse > 0):
        return f"diffuse irradiance of {measured:.0f} W/m2{less} beside {diffuse:.0f} simulated gives no scale"
    weight = region.weight * frame.pixels.direction[region.valid][:, 2]
    seen, truth = (np.average(v[region.valid], axis=0, weights=weight) for v in (frame.linear, simulated))
    return np.asarray(measured / diffuse * truth / seen, float)


def _attributes(
    skies: Skies, frame: Prepared, image: xr.Dataset, sun: tuple[float, float], settings: Settings, known: KnownCamera,
    reasons: list[str],
) -> dict[str, Any]:  # fmt: skip
    kept = {key: value for key, value in image.attrs.items() if "irradiance" in key or key in ("latitude", "longitude")}
    if skies.sun is None:  # of a flat scene, its own place
        kept["latitude"], kept["longitude"] = skies.place_of_camera(frame.camera, frame.time)
    attrs = kept | {
        "Conventions": "CF-1.11",
        "title": f"OpenSWIm comparison with {frame.name}",
        "precision": "pictures are kept to 12 bits of their mantissas, 1.2e-4 of their light",
        "frame": frame.name,
        "time": f"{np.datetime_as_string(frame.time, 's')}Z",
        "model": "clear sky" if skies.model is None else image.attrs.get("source", "model"),
        "solver": image.attrs.get("solver", ""),
        "sun_azimuth_deg": round(sun[0], 4),
        "sun_altitude_deg": round(sun[1], 4),
        "sun_mask_deg": settings.sun_mask_deg,
        "lowest_deg": settings.lowest_deg,
        "encoding": str(frame.encoding),
        "aerosol_optical_depth_550": skies.aerosol_depth(frame.camera, frame.time),
        "aerosol_note": AEROSOL_NOTE,
        "response_from": "this frame, each half of the sky by the other" if known.curves is None
        else "; ".join(filter(None, (known.source, known.doubt))),
        "reasons": "\n".join(dict.fromkeys(reasons)),
    }
    if known.red_blue is not None:
        attrs["red_blue"] = known.red_blue
    if skies.model is not None:
        attrs["detail"] = f"{'more than' if skies.invents else 'what'} the model knows"
    if skies.model is not None and "valid_time" in image.attrs:
        attrs["model_time"] = image.attrs["valid_time"]
    return attrs
