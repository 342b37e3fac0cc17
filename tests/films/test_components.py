"""Brightness and colour differences of pictures, as decoders turn them back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from openswim.films.components import components

EXACT, LIBYUV = 2.1124, 2.0  # from Cb to blue: BT.709-6 for 8 bits; 128/64, in libyuv's row_common.cc


def _patches(colours: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Y, Cb, Cr (n, 3) of colours (n, 3), each of a patch of 2 x 2 pixels."""
    n = len(colours)
    found = components(np.repeat(np.repeat(colours[None].astype(np.uint8), 2, axis=0), 2, axis=1))
    y, cb, cr = found[: 4 * n].reshape(2, 2 * n), found[4 * n : 5 * n], found[5 * n :]
    assert (y == y[:1, ::2].repeat(2, axis=1)).all()
    return np.stack([y[0, ::2], cb, cr], axis=-1)


def _decoded(of: NDArray[np.uint8], blue: float) -> NDArray[np.float64]:
    """By the inverse of BT.709-6, items 3.2 to 3.4, with the factor of a decoder for blue."""
    y, cb, cr = (of.astype(float) - (16, 128, 128)).T
    light = 255 / 219 * y
    rgb = [light + 1.7927 * cr, light - 0.2132 * cb - 0.5329 * cr, light + blue * cb]
    return np.clip(np.rint(np.stack(rgb, axis=-1)), 0, 255)


@pytest.mark.parametrize(("blue", "worst"), [(EXACT, 7), (LIBYUV, 8)])
def test_both_kinds_of_decoder_show_skies_within_4_of_255(blue: float, worst: int) -> None:
    colours = np.random.default_rng(3).integers(0, 256, (200_000, 3))
    coded = _patches(colours)
    off = np.abs(_decoded(coded, blue) - colours).max(axis=1)
    assert off[np.abs(coded[:, 1].astype(int) - 128) <= 50].max() <= 4
    assert off.max() <= worst


def test_neither_decoder_is_nearer_than_the_other() -> None:
    colours = np.random.default_rng(4).integers(40, 216, (20_000, 3))
    coded = _patches(colours)
    off = [(_decoded(coded, blue) - colours)[:, 2] for blue in (EXACT, LIBYUV)]
    share = coded[:, 1].astype(float) - 128
    slopes = [float(share @ each / (share @ share)) for each in off]  # too blue, too grey, of the colour difference
    assert slopes == pytest.approx([0.0562, -0.0562], abs=0.002)


def test_grey_has_no_colour_and_colour_is_the_mean_of_four_pixels() -> None:
    grey = _patches(np.arange(256)[:, None] * np.ones((1, 3), int))
    assert (grey[:, 1:] == 128).all()
    np.testing.assert_array_equal(grey[[0, 255], 0], [16, 235])
    fine = np.zeros((2, 4, 3), np.uint8)
    fine[0, 0], fine[1, 1], fine[:, 2:] = (80, 90, 230), (40, 10, 110), (30, 25, 85)
    np.testing.assert_allclose(*components(fine)[8:].reshape(2, 2).T.astype(int), atol=1)
