"""Radiance to display colours: XYZ, RGB primaries, exposure, tone, gamma, bytes."""

from typing import Literal

import numpy as np
import xarray as xr

from openswim.arguments import check_kind, shown, takes
from openswim.colour.cie import solar_illuminance_lx, xyz_weights
from openswim.colour.dark_eye import mesopic
from openswim.colour.exposure import auto_of, check_exposure, check_gamma, exposure_of
from openswim.colour.glare import glare_of_sun
from openswim.colour.spectrum import Extension
from openswim.errors import UserError
from openswim.srgb import to_srgb

SAMPLED = 100_000  # pixels that auto exposure looks at, evenly spread
LAST_SEEN_NM = 780.0  # by the standard observer
TILE = 2048  # pixels at a time: their spectra stay in a cache, and products too small to be worth threads

# Albers et al. 2020, Eq. 36; its white is x, y = .3292, .3449 (errata).
PAPER_MATRIX = np.array([[3.1894, -1.5755, -0.4948], [-0.9735, 1.8951, 0.0376], [0.0635, -0.2160, 1.2244]])
# IEC 61966-2-1 from the primaries and the D65 white.
SRGB_MATRIX = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])

SHOULDER = 0.5  # below this tones are proportional to the scene
PALE_RANGE = 3.0  # how far above white colours pale

Matrix = Literal["srgb", "paper"]


def solar_relative(image: xr.Dataset | xr.DataArray) -> xr.DataArray:
    """L' with `wavelength` as its last dimension, from a rendered image or a bare array."""
    check_kind("image", image, (xr.Dataset, xr.DataArray), "give what openswim.render returns")
    if isinstance(image, xr.Dataset):
        if "solar_relative_radiance" not in image:
            raise UserError("image has no variable solar_relative_radiance; use openswim.render's")
        image = image["solar_relative_radiance"]
    if "wavelength" not in image.dims or "wavelength" not in image.coords:
        raise UserError("image has no coordinate 'wavelength' (nm); use openswim.render's")
    return image.transpose(..., "wavelength")


def to_xyz(image: xr.Dataset | xr.DataArray) -> np.ndarray:
    """CIE 1931 X, Y, Z (..., 3), float32, of L'; L' = 1 has Y = 1, so a white wall facing the sun has 4.

    NaN pixels stay NaN.  Source: Albers et al. 2020, Sect. 3.8 (corrected).  Wavelengths beyond 780 nm say nothing
    of colour; an image of such alone is grey, as bright as at the shortest of them.
    """
    data = solar_relative(image)
    known_nm = data["wavelength"].values
    seen = np.flatnonzero(known_nm <= max(LAST_SEEN_NM, float(known_nm.min())))
    data = data.isel(wavelength=seen)
    wavelengths, weights = xyz_weights(step_nm=10)
    extension = Extension(data["wavelength"].values, wavelengths)
    flat = data.values.reshape(-1, data.sizes["wavelength"])
    weights = weights.astype(np.float32).T
    result = np.empty((len(flat), 3), dtype=np.float32)
    for start in range(0, len(flat), TILE):
        tile = slice(start, start + TILE)
        result[tile] = (weights @ extension.columns(np.ascontiguousarray(flat[tile].T, np.float32))).T
    return result.reshape((*data.shape[:-1], 3))


def rgb_matrix(matrix: Matrix = "srgb") -> np.ndarray:
    """(3, 3), XYZ to linear RGB.

    "srgb": sRGB primaries, the sun's white carried to D65 by the Bradford transform, so that a white wall in
    sunlight is neutral.  "paper": Albers et al. 2020, Eq. 36, in which it is (1.015, .987, 1.113).
    """
    if not isinstance(matrix, str) or matrix not in ("srgb", "paper"):
        raise UserError(f"colour matrix {shown(matrix)} is unknown; use 'srgb' or 'paper'")
    if matrix == "paper":
        return PAPER_MATRIX
    sun = xyz_weights(step_nm=10)[1].sum(axis=0)
    display = np.linalg.solve(SRGB_MATRIX, np.ones(3))
    gains = (BRADFORD @ display) / (BRADFORD @ sun)
    return SRGB_MATRIX @ np.linalg.solve(BRADFORD, gains[:, None] * BRADFORD)


def to_linear_rgb(image: xr.Dataset | xr.DataArray, matrix: Matrix = "srgb") -> np.ndarray:
    """Linear RGB (..., 3), float32, unbounded; a white wall facing the sun is 4 (see `to_xyz`)."""
    return to_xyz(image) @ rgb_matrix(matrix).T.astype(np.float32)


def auto_exposure(image: xr.Dataset | xr.DataArray, glare: bool = True) -> float:
    """The factor from L' to display light that a photographer would choose: see `openswim.colour.exposure.auto_of`."""
    data = solar_relative(image)
    pixels = data.size / data.sizes["wavelength"]
    every = slice(None, None, max(1, int(np.sqrt(pixels / SAMPLED))))
    some = {name: every for name in data.dims[:-1]}
    weight = None
    if isinstance(image, xr.Dataset) and "solid_angle" in image and image["solid_angle"].dims == data.dims[:-1]:
        weight = image["solid_angle"].isel(some).values
    added: np.ndarray | float = 0.0
    if glare and (sun := glare_of_sun(image, every)) is not None:
        added = sun[0] * to_xyz(sun[1])[1]
    return auto_of(to_xyz(data.isel(some))[..., 1], weight, added)


def exposure_for(image: xr.Dataset | xr.DataArray, exposure: float | str, glare: bool = True) -> float:
    """The factor that a picture gets by what was asked for: see `openswim.colour.exposure.check_exposure`."""
    check_exposure(exposure)
    factor = exposure_of(image, exposure)
    return auto_exposure(image, glare) if factor is None else factor


@takes
def to_rgb(
    image: xr.Dataset | xr.DataArray,
    exposure: float | str = "auto",
    matrix: Matrix = "srgb",
    gamma: float | Literal["srgb"] = "srgb",
    roll_off: bool = True,
    dither: bool = True,
    glare: bool = True,
    bits: int = 8,
    eye: bool = False,
) -> np.ndarray:
    """A picture, uint8 or, of 16 `bits`, uint16 (y, x, 3), of a rendered image; NaN pixels are black.

    `exposure` multiplies L' (.25 makes a white wall facing the sun exactly white), or it is "auto", see
    `auto_exposure`; "sun", by the sun's altitude alone and so alike in all pictures of a series; or a curve such as
    "-6:900,0:14,30:1.3" of the sun's altitude and the exposure.  `matrix` "srgb" or "paper" (Eq. 36).  `gamma` "srgb"
    (the standard's curve) or a number (the paper: 2.2).  `roll_off`: a soft shoulder instead of a hard clip, the same
    for the three colours, so that bright things keep their hue.  `dither`: noise below one step against banding, the
    same at every call.  `glare`: what a lens scatters of the sun's disc where it is seen (`glare.spread`).
    `eye`: as an eye that has got used to the dark sees, which has few colours in moonlight and none under stars
    (`dark_eye.mesopic`).
    """
    if (dims := solar_relative(image).dims)[:-1] != ("y", "x"):
        found = ", ".join(map(str, dims))
        raise UserError(f"image has dimensions ({found}), not (y, x, wavelength): cut rows and columns as isel(x=[0])")
    if bits not in (8, 16):
        raise UserError(f"bits {shown(bits)}: a picture has 8 or 16 a colour")
    factor = exposure_for(image, exposure, glare)
    return developed(display_light(image, matrix, glare, eye), float(factor), gamma, roll_off, dither, bits)


def display_light(
    image: xr.Dataset | xr.DataArray, matrix: Matrix = "srgb", glare: bool = True, eye: bool = False
) -> np.ndarray:
    """What a display is to show, before any exposure: linear RGB (y, x, 3), float32, within its primaries; see
    `to_rgb`. NaN pixels are 0."""
    xyz = np.nan_to_num(to_xyz(image))
    if glare and (sun := glare_of_sun(image)) is not None:
        share, irradiance = sun
        xyz += share[..., None] * to_xyz(irradiance)
    if eye:
        luminance = np.float32(solar_illuminance_lx() / (4 * np.pi * image.attrs.get("sun_distance_au", 1.0) ** 2))
        xyz = mesopic(luminance * xyz) / luminance
    return into_gamut(xyz @ rgb_matrix(matrix).T.astype(np.float32), np.maximum(xyz[..., 1:2], 0))


def developed(
    light: np.ndarray, exposure: float, gamma: float | Literal["srgb"] = "srgb", roll_off: bool = True,
    dither: bool = True, bits: int = 8,
) -> np.ndarray:  # fmt: skip
    """The picture, uint8 or uint16 (y, x, 3), of `display_light` at an exposure; see `to_rgb`."""
    linear = light * np.float32(exposure)
    if roll_off:
        linear = shoulder(linear)
    return quantise(encode(np.clip(linear, 0, 1), gamma), dither, bits)


def into_gamut(linear: np.ndarray, luminance: np.ndarray) -> np.ndarray:
    """Colours beyond the primaries (a component below zero) moved straight toward grey of their luminance."""
    lowest = _of_three(np.minimum, linear)
    share = luminance / np.maximum(luminance - lowest, 1e-30)
    return np.where(lowest < 0, luminance + share * (linear - luminance), linear)


def shoulder(linear: np.ndarray) -> np.ndarray:
    """Highlights rolled off: the largest component m > .5 becomes 1 - .5 e^-((m - .5)/.5).

    The other two follow in proportion, so the hue stays; above white colours pale, as the eye's and the film's do, and
    what is brighter is never less white.
    """
    largest = _of_three(np.maximum, linear)
    room = 1 - SHOULDER
    rolled = 1 - room * np.exp(-np.maximum(largest - SHOULDER, 0) / room)
    scaled = linear * np.where(largest > SHOULDER, rolled / np.maximum(largest, SHOULDER), 1)
    pale = -np.expm1(-np.maximum(largest - 1, 0) / PALE_RANGE)
    return scaled + pale * (rolled - scaled)


def _of_three(choose: np.ufunc, colour: np.ndarray) -> np.ndarray:
    """Least or greatest component (..., 1); numpy is slow to reduce an axis of three."""
    return np.asarray(choose(choose(colour[..., 0:1], colour[..., 1:2]), colour[..., 2:3]))


def encode(linear: np.ndarray, gamma: float | Literal["srgb"] = "srgb") -> np.ndarray:
    """Linear light 0..1 to display values 0..1 by the sRGB curve or a power law."""
    if gamma == "srgb":
        return to_srgb(linear)
    check_gamma(gamma)
    return linear ** (1 / gamma)


def quantise(display: np.ndarray, dither: bool = True, bits: int = 8) -> np.ndarray:
    """Display values 0..1 (y, x, 3) to uint8, or uint16; 0 and 1 stay exact.

    The dither of 8 bits is interleaved gradient noise (Jimenez 2014), spread evenly like blue noise, uniform in [0, 1).
    """
    if bits == 16:
        return np.round(display * 65535).astype(np.uint16)
    if not dither:
        return np.round(display * 255).astype(np.uint8)
    y, x = np.ogrid[: display.shape[0], : display.shape[1]]
    ramp = np.stack([(x + s) * 0.06711056 + (y + s) * 0.00583715 for s in (0, 17, 41)], axis=-1) % 1.0
    noise = (52.9829189 * ramp % 1.0).astype(np.float32)
    return np.minimum(display * 255 + noise, 255).astype(np.uint8)
