"""What a lens, or the eye, scatters of the sun's light over the rest of a picture."""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from openswim.scene.frame import azimuth_altitude, horizon_dip_deg, horizon_vector

EYE_SHARE = 0.15  # a good lens scatters 1 to 1.5 % of what enters it beyond half a degree, the eye 9
LEAST_DEG = 0.1  # within it lies what is sharp
SUN_DEG = 0.3  # a little more than the disc's radius
_NEAR_DEG, _PARTS = 2.0, 9  # beyond, glare is that of the middle to 2 %; parts across what shines, finer than LEAST


def spread(angle_deg: np.ndarray) -> np.ndarray:
    """Radiance per irradiance (1/sr) at angles from a point of light, by a lens: .15 of 10/a^3 + 5/a^2.

    The eye's: CIE 135/1 (Vos and van den Berg 1999), of a young observer, .1 to 30 degrees.
    """
    angle = np.maximum(angle_deg, LEAST_DEG)
    return np.asarray(EYE_SHARE * (10 / angle + 5) / angle**2)


class SunSeen(NamedTuple):
    """Where the sun's disc is in an image, and what it adds."""

    parts: np.ndarray  # (n, 3) directions to what is seen of it
    weight: np.ndarray  # (n,) their shares of its light
    rows: slice  # that hold the disc and what is around it
    sunny: np.ndarray  # of these rows (rows, x): the pixels of the disc
    sky: np.ndarray  # (wavelength,) L' around it
    irradiance: np.ndarray  # (wavelength,) L' sr that these pixels hold beyond the sky's


def glare_of_sun(
    image: xr.Dataset | xr.DataArray, some: slice = slice(None)
) -> tuple[np.ndarray, xr.DataArray] | None:  # fmt: skip
    """What an irradiance of one from the sun's place adds to each pixel (y, x), 1/sr, and the irradiance (wavelength,),
    L' sr, that the pixels about that place hold beyond the sky's; None where the sun would not be in the picture.
    ``some``: of the rows and columns.
    """
    found = sun_seen(image)
    if found is None:
        return None
    assert isinstance(image, xr.Dataset)
    irradiance = xr.DataArray(found.irradiance, dims="wavelength", coords={"wavelength": image["wavelength"]})
    azimuth, altitude = (image[name].values[some, some].astype(np.float32) for name in ("azimuth", "altitude"))
    share = np.where(_ground(image)[some, some], 0.0, _spread_to(azimuth, altitude, found.parts, found.weight))
    return np.nan_to_num(share).astype(np.float32), irradiance


def _spread_to(azimuth: np.ndarray, altitude: np.ndarray, parts: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Share of an irradiance from some parts that a lens spreads to pixels at angles in degrees, 1/sr."""
    middle = weight @ parts
    toward = azimuth_altitude(middle / np.linalg.norm(middle))
    angle = np.degrees(_between(*np.radians([azimuth, altitude]), *np.radians(toward)))
    share = spread(angle)
    near = angle < _NEAR_DEG
    if len(parts) > 1:
        beside = horizon_vector(azimuth[near].astype(float), altitude[near].astype(float)) - parts[0]
        found = np.zeros(len(beside))
        for part, own in zip(parts - parts[0], weight, strict=True):
            found += own * spread(np.degrees(np.linalg.norm((beside - part).astype(np.float32), axis=-1)))
        share[near] = found
    return share


def sun_seen(image: xr.Dataset | xr.DataArray) -> SunSeen | None:
    """The sun's disc in an image; None where it would not be in the picture, or the ground is there instead."""
    known = {"azimuth", "altitude", "solar_relative_radiance"}
    if not isinstance(image, xr.Dataset) or not known <= set(image.variables):
        return None
    if "sun_azimuth_deg" not in image.attrs or min(image["azimuth"].shape) < 3:
        return None
    azimuth, altitude = (np.radians(image[name].values.astype(np.float32)) for name in ("azimuth", "altitude"))
    sun_azimuth, sun_altitude = (math.radians(image.attrs[f"sun_{name}_deg"]) for name in ("azimuth", "altitude"))
    angle = np.degrees(_between(azimuth, altitude, sun_azimuth, sun_altitude))
    if not np.isfinite(angle).any():
        return None
    j, i = np.unravel_index(np.nanargmin(angle), angle.shape)
    beside = np.s_[max(j - 1, 0) : j + 2, max(i - 1, 0) : i + 2]
    pixel = np.degrees(np.nanmax(_between(azimuth[beside], altitude[beside], azimuth[j, i], altitude[j, i])))
    if angle[j, i] > SUN_DEG + pixel:
        return None
    sunny, around = angle < SUN_DEG + 2 * pixel, angle < SUN_DEG + 4 * pixel
    if _ground(image)[sunny].all():
        return None
    rows = np.flatnonzero(around.any(axis=1))
    some = slice(max(rows[0] - 1, 0), rows[-1] + 2)
    sunny, around = sunny[some], around[some] & ~sunny[some]
    if "solid_angle" in image:
        solid_angle = image["solid_angle"].values[some]
    else:
        direction = horizon_vector(*(image[name].values[some].astype(float) for name in ("azimuth", "altitude")))
        solid_angle = np.linalg.norm(np.cross(np.gradient(direction, axis=0), np.gradient(direction, axis=1)), axis=-1)
    light = np.nan_to_num(image["solar_relative_radiance"].transpose(..., "wavelength").values[some])
    sky = np.median(light[around], axis=0) if around.any() else np.zeros(light.shape[-1])
    each = ((light - sky) * np.nan_to_num(solid_angle)[..., None])[sunny]
    held, bright = np.maximum(each.sum(axis=0), 0), np.maximum(each, 0).sum(axis=1)
    parts, weight = horizon_vector(*np.degrees([[sun_azimuth], [sun_altitude]])), np.ones(1)
    if bright.any():  # of a sun that is hidden in part, glare spreads from what is seen
        toward = horizon_vector(*np.degrees([azimuth[some][sunny], altitude[some][sunny]]).astype(float))
        parts, weight = _parts(toward, bright, np.argwhere(sunny))
    return SunSeen(parts, weight, some, sunny, sky, held)


def _parts(toward: np.ndarray, light: np.ndarray, pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles (n, 3) of some parts of what shines at directions (m, 3), pixels (m, 2) of a picture, and their shares
    (n,) of the light (m,)."""
    lit = light > 0
    pixel = pixel[lit] - pixel[lit].min(axis=0)
    cell = (pixel * _PARTS // (pixel.max() + 1)) @ (_PARTS, 1)
    weight = np.bincount(cell, light[lit], _PARTS**2)
    middle = np.stack([np.bincount(cell, light[lit] * each, _PARTS**2) for each in toward[lit].T], axis=-1)
    some = weight > 0
    middle = middle[some] / np.linalg.norm(middle[some], axis=-1, keepdims=True)
    return middle, weight[some] / weight.sum()


def _ground(image: xr.Dataset) -> np.ndarray:
    """Whether a pixel (y, x) shows the Earth, on which no glare is drawn: where it knows its place, or looks below the
    horizon, be it at a cloud."""
    height_m = 0.0 if "x_m" in image.attrs else float(image.attrs.get("height_m", 0.0))
    ground = image["altitude"].values < -horizon_dip_deg(height_m)
    if "latitude" in image.coords and image["latitude"].dims == image["azimuth"].dims:
        ground = ground | np.isfinite(image["latitude"].values)
    return np.asarray(ground)


def _between(azimuth: np.ndarray, altitude: np.ndarray, other_azimuth: float, other_altitude: float) -> np.ndarray:
    """Angles (radians) between directions, right for small ones."""
    half = np.sin((altitude - other_altitude) / 2) ** 2
    half += np.cos(altitude) * np.cos(other_altitude) * np.sin((azimuth - other_azimuth) / 2) ** 2
    return np.asarray(2 * np.arcsin(np.sqrt(np.clip(half, 0, 1))))
