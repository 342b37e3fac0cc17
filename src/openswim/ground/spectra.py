"""Albedo spectra of what covers the ground, 400-700 nm (the ends hold beyond; `near_infrared` has land there)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.scene.interpolation import at_wavelengths

FloatArray = NDArray[np.float64]

# MODIS bands 1, 4 and 3, from which Blue Marble's red, green and blue are made.
_BAND_NM = np.array([645.0, 555.0, 469.0])


def from_bands(red_green_blue: FloatArray, wavelengths_nm: ArrayLike) -> FloatArray:
    """Spectrum (n, nwl) through albedos (n, 3) at 645, 555, 469 nm, linear in between.

    At 400 nm .85 of the blue and at 700 nm 1.1 of the red (typical of soils; vegetation is flatter below 469
    nm and rises steeply above 690 nm).
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    red, green, blue = np.moveaxis(red_green_blue, -1, 0)
    knots_nm = np.array([400.0, *_BAND_NM[::-1], 700.0])
    knots = np.stack([0.85 * blue, blue, green, red, 1.1 * red], axis=-1)
    return np.clip(at_wavelengths(knots_nm, knots, wavelengths), 0.0, 0.99)


def generic_land(wavelengths_nm: ArrayLike) -> FloatArray:
    """(nwl,) grass and soil, for land that no map shows."""
    return _table(
        wavelengths_nm, [400, 450, 500, 550, 600, 650, 700], [0.035, 0.04, 0.05, 0.08, 0.08, 0.08, 0.12]
    )


def water_leaving(wavelengths_nm: ArrayLike, chlorophyll_mg_m3: ArrayLike = 0.2) -> FloatArray:
    """Reflectance pi L_w / E (n, nwl) of the light from within Case-1 water, by its chlorophyll (n,), .01 to 30 mg/m3.

    Absorption a = (a_w + .06 A C^.65) (1 + .2 exp(-.014 (lambda - 440))) (Prieur & Sathyendranath 1981, Morel 1991);
    backscattering half of sea water's and .30 C^.62 (.002 + .02 (.5 - .25 log C) 550/lambda) (Morel 1988);
    below the surface r = u (.0949 + .0794 u), u = b_b/(a + b_b) (Gordon et al. 1988), above .52 r / (1 - 1.7 r).
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    green = np.clip(np.atleast_1d(np.asarray(chlorophyll_mg_m3, float)), 0.01, 30.0)[:, None]
    water, pigment = (np.interp(wavelengths, _WATER_NM, row) for row in (_PURE_WATER_PER_M, _PIGMENT))
    absorption = (water + 0.06 * pigment * green**0.65) * (1 + 0.2 * np.exp(-0.014 * (wavelengths - 440)))
    molecules = 0.5 * 0.00288 * (wavelengths / 500) ** -4.32
    particles = 0.30 * green**0.62 * (0.002 + 0.02 * (0.5 - 0.25 * np.log10(green)) * 550 / wavelengths)
    u = (molecules + particles) / (absorption + molecules + particles)
    below = u * (0.0949 + 0.0794 * u)
    return np.pi * 0.52 * below / (1 - 1.7 * below)


# Absorption of pure water (Pope & Fry 1997; beyond 700 nm after Smith & Baker 1981, beyond 800 nm after Hale & Querry
# 1973) and of phytoplankton, 1 at 440 nm
# (Prieur & Sathyendranath 1981 as in Morel 1988).
_WATER_NM = [400, 420, 440, 460, 480, 500, 520, 540, 560, 580, 600, 620, 640, 660, 680, 700, 750, 800, 900, 970, 1080,
             1200, 1300, 1400]  # fmt: skip
_PURE_WATER_PER_M = [0.0066, 0.0045, 0.0064, 0.0098, 0.0127, 0.0204, 0.0409, 0.0474, 0.0619, 0.0896, 0.2224, 0.2755,
                     0.3108, 0.4100, 0.4650, 0.6240, 2.47, 2.07, 7.0, 45.0, 15.0, 110.0, 120.0, 1200.0]  # fmt: skip
_PIGMENT = [0.687, 0.913, 1.0, 0.917, 0.798, 0.668, 0.528, 0.416, 0.294, 0.291, 0.236, 0.276, 0.334, 0.441, 0.502,
            0.215, *[0.0] * 8]  # fmt: skip


def visible_from_broadband(broadband: FloatArray) -> FloatArray:
    """Mean visible albedo of a surface from its solar broadband albedo (same shape).

    Broadband = .45 visible + .55 near-infrared, and near-infrared = min(.22 + .75 visible, .68) holds from
    forest (.04/.25) over desert (.30/.44) to snow (.9/.68): .15 -> .034, .38 -> .30, .80 -> .95. Scatter
    about .04.
    """
    bare = (broadband - 0.55 * 0.22) / (0.45 + 0.55 * 0.75)
    bright = (broadband - 0.55 * 0.68) / 0.45
    return np.clip(np.maximum(bare, bright), 0.02, 0.97)


def _table(wavelengths_nm: ArrayLike, known_nm: list[int], values: list[float]) -> FloatArray:
    return np.interp(np.atleast_1d(np.asarray(wavelengths_nm, float)), known_nm, values)
