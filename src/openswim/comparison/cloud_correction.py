"""`correct_clouds`: a model's clouds cleared and added by what cameras see (Albers et al. 2020, Sect. 4.3 and Fig. 14).

Both pictures get cloud masks by one rule: redder than the simulated clear sky. Along rays on which a camera sees clear
sky the model's clouds are taken away; where it sees cloud and the model has none, the model's typical cloud is added.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import takes
from openswim.comparison.cloud_edit import THINNEST_PER_M, Layer, edited, extinction, typical_layer
from openswim.comparison.cloud_rays import Crossings, crossings
from openswim.comparison.cloud_rules import DEPARTURE, NO_AIR, departure, is_black
from openswim.comparison.correlation import correlation
from openswim.comparison.prepared import Prepared, prepared, valid_pixels
from openswim.comparison.scores import NO_BALANCE, Region
from openswim.comparison.settings import (
    DEFAULT_AOD,
    KnownCamera,
    Settings,
    camera_content,
    encoding_of,
    frame_of,
    known_camera,
    settings_of,
    skies_of,
)
from openswim.comparison.skies import Model, Skies
from openswim.comparison.tiles import Interval
from openswim.errors import UserError
from openswim.scene import Scene

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
BLOCK_DEG = 3.0  # every second block of the sky this wide is kept aside, to score by
# of a node's rays that are clear, from which on it is, from pass to pass: thick cloud reaches almost to the next node
_CLEAR_SHARES = (0.12, 0.12, 0.08, 0.08)
MOST_LN = 0.7  # of the amount of cloud in a column: what a pass changes at most
_DARK = 1e-9  # light that is none
_STRENGTHS = (1.0, 1.5, 2.0, 2.0)  # of what is added


@dataclass(frozen=True, eq=False)
class _Eye:
    """One camera's frame: what it sees, which pixels say something, and which of these may be used."""

    frame: Prepared
    clear: F64
    cloud: Mask
    valid: Mask
    used: Mask
    light: F64  # (ny, nx, 3) linear, or radiance where the camera's response is known
    rays: Crossings


@takes
def correct_clouds(
    model: Model,
    frames: Sequence[Any],
    cameras: Sequence[Any],
    *,
    time: Any = None,
    clear_frames: Sequence[Any] = (),
    passes: int = 2,
    hold_out: bool = True,
    base_m: float | None = None,
    thickness_m: float = 400.0,
    solver: Any = "fast",
    sun: tuple[float, float] | None = None,
    member: int | None = None,
    **settings: Any,
) -> tuple[Scene, xr.Dataset]:
    """The model's scene with its clouds corrected, and the scores before and after each pass.

    frames, cameras : one frame of each camera, all of about one time; `clear_frames`: one of each, for response and
        white balance (else the camera's file must tell `red_blue`).
    passes : how often the edited scene is lit and looked at again, up to 4; the best one is returned.
    hold_out : every second block of 3 degrees is not used, but filled by its neighbours', and scored by itself.
    base_m, thickness_m : of clouds that are added, in place of the model's own.
    member : of an ensemble in the model's file, by its own number; by default the first.
    settings : as of `openswim.compare`.
    """
    chosen = settings_of(settings)
    frames, cameras, clear_frames = list(frames), list(cameras), list(clear_frames)
    if not 1 <= passes <= len(_CLEAR_SHARES):
        raise UserError(f"correct_clouds: passes {passes} is not within 1 to {len(_CLEAR_SHARES)}")
    if len(frames) != len(cameras) or not frames:
        raise UserError(f"correct_clouds: {len(frames)} frames of {len(cameras)} cameras: give one of each camera")
    if clear_frames and len(clear_frames) != len(cameras):
        raise UserError(
            f"correct_clouds: {len(clear_frames)} clear frames of {len(cameras)} cameras: give one of each, or none"
        )
    skies = skies_of(model, solver, None, None, sun, member=member)
    if skies.model is None:
        raise UserError("correct_clouds: needs a model: give its file or a Scene")
    contents = [camera_content(camera) for camera in cameras]
    read = [frame_of(frame, content, time) for frame, content in zip(frames, contents, strict=True)]
    scene = skies.scene(contents[0].camera, read[0].time)
    if scene.grid is None:
        raise UserError("correct_clouds: this scene has no grid: give a model with clouds on levels")
    layer = typical_layer(scene, base_m, thickness_m)
    levels = _levels(scene, layer)
    eyes, doubts = [], []
    for n, (frame, content) in enumerate(zip(read, contents, strict=True)):
        known = known_camera(content, chosen, clear_frames[n] if clear_frames else None, solver, skies)
        doubts += [f"{known.source}: {known.doubt}"] if known.doubt else []
        ready = prepared(frame, content.camera, encoding_of(chosen, content), chosen.size)
        eyes.append(_eye(Skies(scene, solver, None, None, sun), scene, ready, known, chosen, hold_out, levels))
    best, history = _passes(scene, layer, eyes, passes, solver, sun)
    return best, history.assign_attrs(doubt="; ".join(doubts)) if doubts else history


def _passes(
    scene: Scene, layer: Layer, eyes: list[_Eye], passes: int, solver: Any, sun: Any
) -> tuple[Scene, xr.Dataset]:
    current, best, best_r, chosen = scene, scene, -np.inf, 0
    rows: list[tuple[F64, F64, float, str]] = []
    for number in range(passes + 1):
        skies = Skies(current, solver, None, None, sun)
        images = [skies.simulated(eye.frame.camera, eye.frame.time) for eye in eyes]
        pictures = [np.asarray(image.radiance.values, float) for image in images]
        rows.append(_scores(eyes, pictures))
        told = rows[-1][0][np.isfinite(rows[-1][0])]  # a camera without a pixel left has no r
        if told.size and told.mean() > best_r:
            best, best_r, chosen = current, float(told.mean()), number
        if number < passes:
            current = _step(current, layer, eyes, pictures, _CLEAR_SHARES[number], _STRENGTHS[number])
    used, unused, kept, why = (np.array(part) for part in zip(*rows, strict=True))
    history = xr.Dataset(
        {
            "r_used": (("edit", "camera"), used, {"long_name": "mean r of pixels that the edit has used"}),
            "r_unused": (("edit", "camera"), unused, {"long_name": "mean r of pixels that it has not used"}),
            "cloud_error": ("edit", kept, {"long_name": "share of valid pixels whose masks differ"}),
            "reason": ("edit", why, {"long_name": "why scores are missing"}),
        },
        coords={"edit": np.arange(passes + 1)},
        attrs={"chosen_edit": chosen},
    )
    if best is not scene:
        best.notes.append(f"clouds corrected by {', '.join(eye.frame.name for eye in eyes)}: openswim correct-clouds")
    return best, history


def _step(
    scene: Scene, layer: Layer, eyes: list[_Eye], pictures: list[F64], clear_share: float, strength: float
) -> Scene:
    """One pass: cells that any camera sees through are cleared, then columns are filled where a camera sees cloud."""
    assert scene.grid is not None
    shape = scene.grid.shape
    clear = np.zeros(shape, bool)
    for eye in eyes:
        seen_clear, seen_cloud = (eye.rays.votes(mask) for mask in (~eye.cloud[eye.valid], eye.cloud[eye.valid]))
        total = seen_clear + seen_cloud
        clear |= (total > 0) & (seen_clear >= clear_share * total) & (seen_clear > 0)
    left = (extinction(scene) > THINNEST_PER_M) & ~clear
    columns = np.zeros(shape[1:], bool)
    darker, weight = np.zeros(columns.size), np.full(columns.size, 1e-9)
    for eye, picture in zip(eyes, pictures, strict=True):
        cloud = eye.cloud[eye.valid]
        simulated = (departure(picture, eye.clear) > DEPARTURE)[eye.valid]
        missing = cloud & (~eye.rays.touches(left) | ~simulated)
        at = eye.rays.column_at(layer.middle_m)
        both = cloud & simulated & (at >= 0)
        darker += np.bincount(at[both], _too_bright(eye, picture, simulated)[both], minlength=columns.size)
        weight += np.bincount(at[both], minlength=columns.size)
        wanted, rays = (np.bincount(at[part & (at >= 0)], minlength=columns.size) for part in (missing, at >= 0))
        columns |= ((wanted > 0) & (wanted >= 0.5 * rays)).reshape(columns.shape)
    add = columns[None] & ~clear
    factor = np.exp(np.clip(darker / weight, -MOST_LN, MOST_LN)).reshape(columns.shape)
    return edited(scene, clear, add, layer, strength, factor)


def _too_bright(eye: _Eye, picture: F64, simulated: Mask) -> F64:
    """(valid pixels,): ln of the simulated over the observed green light, where clear skies in both are alike.

    Light below thick cloud is about inverse to its depth, so this is what ln of the depth has to be raised by.
    """
    model, seen = (np.maximum(light[eye.valid][:, 1], _DARK) for light in (picture, eye.light))
    ratio, lit = np.log(model / seen), model > _DARK  # without air the clear sky is black, and like no other
    clear = lit & ~simulated & ~eye.cloud[eye.valid]
    alike = clear if clear.sum() > 50 else lit
    return np.asarray(ratio - np.median(ratio[alike])) if alike.any() else np.zeros_like(ratio)


def _eye(
    skies: Skies, scene: Scene, frame: Prepared, known: KnownCamera, settings: Settings, hold_out: bool, levels: slice
) -> _Eye:
    if known.red_blue is None:
        raise UserError(f"{frame.name}: {NO_BALANCE}")
    if frame.linear.shape[-1] != 3:
        raise UserError(f"{frame.name}: has one channel: cloud masks need red and blue")
    skies.aod = DEFAULT_AOD if scene.atmosphere is not None and scene.atmosphere.aerosol is None else None
    clear = skies.clear(frame.camera, frame.time)
    sun = skies.sun_at(frame.camera, frame.time)
    valid = valid_pixels(frame, sun, settings.sun_mask_deg, settings.lowest_deg) & np.isfinite(clear).all(axis=-1)
    if valid.sum() < 100:
        raise UserError(f"{frame.name}: hardly a pixel is left to go by: lower --lowest or --sun-mask")
    with np.errstate(invalid="ignore"):
        cloud = (departure(frame.linear, clear, known.red_blue) > DEPARTURE) & valid
    used = valid & _even_blocks(frame) if hold_out else valid
    light = frame.linear.astype(float)
    if known.curves is not None:
        parts = zip(known.curves, np.moveaxis(light, -1, 0), strict=True)
        light = np.stack([curve(part) for curve, part in parts], axis=-1)
    rays = crossings(scene, frame.camera, frame.pixels.direction[valid], levels)
    return _Eye(frame, clear, _filled(cloud, used, valid, frame) if hold_out else cloud, valid, used, light, rays)


def _even_blocks(frame: Prepared) -> Mask:
    """Every second block of 3 degrees, as on a chessboard of altitude and azimuth."""
    altitude = np.nan_to_num(frame.pixels.altitude_deg)
    band = (altitude // BLOCK_DEG).astype(int)
    parts = np.maximum(2, np.round(360 * np.cos(np.radians((band + 0.5) * BLOCK_DEG)) / BLOCK_DEG / 2) * 2)
    return np.asarray((band + (np.nan_to_num(frame.pixels.azimuth_deg) / 360 * parts).astype(int)) % 2 == 0)


def _filled(cloud: Mask, used: Mask, valid: Mask, frame: Prepared) -> Mask:
    """The mask where it is used; elsewhere what its used neighbours say."""
    from scipy.ndimage import gaussian_filter

    width_px = BLOCK_DEG / (2 * float(np.nanmedian(frame.pixels.half_width_deg)))
    share = gaussian_filter((cloud & used).astype(float), 0.5 * width_px)
    weight = gaussian_filter(used.astype(float), 0.5 * width_px)
    return np.where(used, cloud, share > 0.5 * weight) & valid


def _scores(eyes: list[_Eye], pictures: list[F64]) -> tuple[F64, F64, float, str]:
    """Mean r of used and of unused pixels by camera, the share of pixels whose masks differ, and why any of these
    is NaN."""
    used: list[Interval] = []
    unused: list[Interval] = []
    why: dict[str, None] = {}
    wrong = total = 0.0
    for eye, picture in zip(eyes, pictures, strict=True):
        for found, mask in ((used, eye.used), (unused, eye.valid & ~eye.used)):
            region = Region.of(eye.frame, mask & np.isfinite(picture).all(axis=-1))
            found.append(correlation(eye.light[region.valid], picture[region.valid], region.weight, region.tiles))
        if is_black(eye.clear[eye.valid]):
            why[NO_AIR] = None
            continue
        weight = eye.frame.pixels.solid_angle_sr[eye.valid]
        differ = (departure(picture, eye.clear) > DEPARTURE)[eye.valid] != eye.cloud[eye.valid]
        wrong, total = wrong + float(weight[differ].sum()), total + float(weight.sum())
    why |= dict.fromkeys(each.reason for each in used if not np.isfinite(each.value))
    r_used, r_unused = (np.array([each.value for each in found]) for found in (used, unused))
    return r_used, r_unused, wrong / total if total else np.nan, "; ".join(why)


def _levels(scene: Scene, layer: Layer) -> slice:
    """Levels with cloud, the layer's among them."""
    cloudy = extinction(scene).max(axis=(1, 2)) > THINNEST_PER_M
    for amount in layer.amounts.values():
        cloudy |= amount > 0
    there = np.flatnonzero(cloudy)
    return slice(max(int(there[0]) - 1, 0), min(int(there[-1]) + 2, len(cloudy)))
