"""Albedo spectra of what covers the ground, 400-700 nm (the ends hold beyond)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

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


def at_wavelengths(known_nm: FloatArray, known: FloatArray, wavelengths_nm: FloatArray) -> FloatArray:
    """Spectra (..., nknown) interpolated linearly to (..., nwl); the ends hold beyond."""
    if known_nm.size == 1:
        return np.repeat(known, wavelengths_nm.size, axis=-1)
    order = np.argsort(known_nm)
    position = np.interp(wavelengths_nm, known_nm[order], np.arange(known_nm.size))
    lower = np.minimum(position.astype(int), known_nm.size - 2)
    share = position - lower
    return known[..., order[lower]] * (1 - share) + known[..., order[lower + 1]] * share


def generic_land(wavelengths_nm: ArrayLike) -> FloatArray:
    """(nwl,) grass and soil, for land that no map shows."""
    return _table(
        wavelengths_nm, [400, 450, 500, 550, 600, 650, 700], [0.035, 0.04, 0.05, 0.08, 0.08, 0.08, 0.12]
    )


def snow(wavelengths_nm: ArrayLike) -> FloatArray:
    """(nwl,) snow a few days old, slightly dusty (after Wiscombe & Warren 1980)."""
    return _table(wavelengths_nm, [400, 500, 600, 700], [0.88, 0.88, 0.86, 0.82])


def sea_ice(wavelengths_nm: ArrayLike) -> FloatArray:
    """(nwl,) first-year ice, in part bare and in part under snow (after Grenfell & Maykut 1977)."""
    return _table(wavelengths_nm, [400, 500, 600, 700], [0.72, 0.73, 0.68, 0.58])


def water_leaving(wavelengths_nm: ArrayLike) -> FloatArray:
    """(nwl,) reflectance pi L_w / E of clear ocean, chlorophyll .2 mg/m3 (after Morel & Maritorena 2001)."""
    return _table(
        wavelengths_nm,
        [400, 450, 490, 510, 546, 580, 615, 660, 700],
        [0.018, 0.014, 0.0115, 0.0075, 0.0042, 0.0020, 0.0009, 0.0004, 0.0002],
    )


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
