"""How frames are compared, and what is known of their camera."""

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import check_kind, number, paths, whole
from openswim.cameras import Camera
from openswim.cameras.files import CameraFile, checked_encoding, read_camera
from openswim.comparison.cloud_rules import departure, log_red_blue
from openswim.comparison.prepared import SIZE, prepared, valid_pixels
from openswim.comparison.response import Curve, fit_curve
from openswim.comparison.scores import Region
from openswim.comparison.skies import Model, Skies
from openswim.errors import UserError
from openswim.observations import SkyFrame, read_frame
from openswim.pictures.viewpoint import LitScene
from openswim.scene import Scene
from openswim.solver import Solver

F64 = NDArray[np.float64]
SUN_MASKS_DEG = (5.0, 12.0)  # Albers et al. 2020, Sect. 4.2.3 and Table 4
DEFAULT_AOD = 0.1  # of a clear sky at 550 nm: a usual value over land, taken and never fitted

_HIGH_DEG = 10.0  # of the sun, by which a clear sky is blue
# Mean r of red over blue and of green with the clear sky's: 12 clear frames .9 and more, of lenses that see trees .5; 3
# overcast ones of 3 cameras .33 at most, whichever way they are turned
_LEAST_ALIKE = 0.4


@dataclass(frozen=True)
class Settings:
    """How frames are compared."""

    size: int = SIZE
    sun_mask_deg: float = SUN_MASKS_DEG[-1]
    lowest_deg: float = 5.0
    encoding: str | float | None = None
    ghi_w_m2: float | None = None
    dhi_w_m2: float | None = None
    aod_range: bool = True

    def __post_init__(self) -> None:
        limits = {"sun_mask_deg": (0, 90), "lowest_deg": (0, 89), "ghi_w_m2": (0, 2000), "dhi_w_m2": (0, 2000)}
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if value is not None and not low <= number(f"compare: {name}", value) <= high:
                raise UserError(f"compare: {name} {value:g} is not within {low} to {high}")
        if whole("compare: size", self.size) < 32:
            raise UserError(f"compare: size {self.size} is too small: give 32 columns or more")
        checked_encoding(self.encoding)


@dataclass(frozen=True, eq=False)
class KnownCamera:
    """What is known of a camera's response: curves from its light to radiance, answers from radiance to its light, and
    white balance, what they were found from, and what speaks against that, half a sentence."""

    curves: list[Curve] | None = None
    answers: list[Curve] | None = None
    red_blue: float | None = None
    scale: F64 | None = None
    source: str = ""
    doubt: str = ""


def skies_of(
    model: Model, solver: str | Solver, aod: float | None, albedo: float | None, sun: Any = None, table: bool = False,
    detail: bool | None = None, member: int | None = None,
) -> Skies:  # fmt: skip
    """The skies of a model, checked."""
    if not (model is None or isinstance(model, Scene | LitScene)):
        paths("model", model)
    if aod is not None and not 0 <= number("compare: aod", aod) <= 10:
        raise UserError(f"compare: aod {aod:g} is no optical depth of 0 to 10")
    if albedo is not None and not 0 <= number("compare: albedo", albedo) <= 1:
        raise UserError(f"compare: albedo {albedo:g} is not within 0 to 1")
    if isinstance(model, LitScene) and aod is not None:
        raise UserError("compare: the light of this model is solved: leave out aod, or give the scene")
    aod = DEFAULT_AOD if model is None and aod is None else aod
    if member is not None and (model is None or isinstance(model, Scene | LitScene)):
        raise UserError("compare: member is of a model's files: leave it out, or give these")
    return Skies(model, solver, aod, albedo, sun, table, detail, member)


def frame_of(frame: Any, content: CameraFile, time: Any = None, alone: bool = True) -> SkyFrame:
    """A frame that is read already, or a file's. alone: whether its time could be given."""
    return frame if isinstance(frame, SkyFrame) else read_frame(frame, time, content.frames, alone)


def known_camera(
    content: CameraFile, settings: Settings, clear_frame: Any, solver: str | Solver, skies: Skies
) -> KnownCamera:
    """By the camera's file, and by a clear frame of it."""
    given = content.response
    scale = None if given.radiance_per_unit is None else np.array(given.radiance_per_unit)
    if clear_frame is None:
        return KnownCamera(None, None, given.red_blue, scale, "camera file" if given.red_blue is not None else "")
    seen = frame_of(clear_frame, content, alone=False)
    frame = prepared(seen, content.camera, encoding_of(settings, content), settings.size)
    clear = Skies(None, solver, skies.aod if skies.aod is not None else DEFAULT_AOD, skies.albedo, skies.sun)
    camera = skies.on_earth(frame.camera, frame.time)
    truth = np.asarray(clear.clear(camera, frame.time))
    truth = truth if frame.linear.shape[-1] == 3 else truth[..., 1:2]
    valid = valid_pixels(frame, clear.sun_at(camera, frame.time), settings.sun_mask_deg, settings.lowest_deg)
    region = Region.of(frame, valid & np.isfinite(truth).all(axis=-1))
    linear, sky = frame.linear[region.valid].astype(float), truth[region.valid]
    curves = [fit_curve(a, b, region.weight) for a, b in zip(linear.T, sky.T, strict=True)]
    answers = [fit_curve(b, a, region.weight) for a, b in zip(linear.T, sky.T, strict=True)]
    if any(curve is None for curve in [*curves, *answers]):
        raise UserError(f"{frame.name}: too few pixels are left of this clear frame: give another")
    red_blue = given.red_blue
    if red_blue is None and linear.shape[1] == 3:
        red_blue = weighted_median(departure(linear, sky), region.weight)
    by_day = clear.sun_at(camera, frame.time)[1] > _HIGH_DEG
    odd = _unlike_clear(linear, sky) if by_day and linear.shape[1] == 3 else ""
    return KnownCamera(
        [c for c in curves if c is not None], [c for c in answers if c is not None], red_blue, scale, frame.name,
        "; ".join(filter(None, (seen.doubt, odd))),
    )  # fmt: skip


def _unlike_clear(linear: F64, sky: F64) -> str:
    """What is to be told of a clear frame that has neither the colours nor the light of a clear sky where it has them:
    linear and sky are (n, 3), of the frame and of the clear sky."""
    pairs = (log_red_blue(linear), log_red_blue(sky)), (linear[:, 1], sky[:, 1])
    if not all(one.std() > 0 and other.std() > 0 for one, other in pairs):
        return ""
    alike = float(np.mean([np.corrcoef(*pair)[0, 1] for pair in pairs]))
    if not alike < _LEAST_ALIKE:
        return ""
    return (
        f"colours and light of this clear frame do not lie as in a clear sky (r {alike:.2f}): is it cloudy, or of "
        "another camera, time or zone?"
    )


def weighted_median(values: F64, weight: F64) -> float:
    """Weighted median."""
    if not values.size:
        return float("nan")
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def encoding_of(settings: Settings, content: CameraFile) -> str | float | None:
    return settings.encoding if settings.encoding is not None else content.response.encoding


def camera_content(camera: Any) -> CameraFile:
    if isinstance(camera, CameraFile):
        return camera
    if isinstance(camera, Camera):
        return CameraFile(camera)
    check_kind("camera", camera, (str, Path, os.PathLike), "give a Camera, or the name of its TOML file")
    return read_camera(camera)


def settings_of(given: dict[str, Any]) -> Settings:
    """The defaults but for what is given; raises UserError."""
    try:
        return replace(Settings(), **given)
    except TypeError:
        unknown = sorted(set(given) - set(Settings.__dataclass_fields__))
        raise UserError(f"compare: unknown option {', '.join(unknown)}") from None
