"""Pictures to brightness and colour differences of video: ITU-R BT.709 in its limited range, 4:2:0."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)  # of red, green and blue: BT.709-6, item 3.2
_BLACK, _WHITE, _MIDDLE, _SWING = 16.0, 235.0, 128.0, 224.0  # item 4.6: 8 bits a component
_BLUE, _RED = 1.8556, 1.5748  # item 3.3: what B - Y and R - Y are divided by
_EXACT = 255.0 / _SWING * _BLUE  # 2.112: what decoders multiply Cb by for blue, in 255ths,
_COARSE = 2.0  # and libyuv's fixed point of 8 bits, the most that it holds: Chromium without a graphics card
BETWEEN = 2.0 * _EXACT / (_EXACT + _COARSE)  # times Cb, 1.027: one decoder is as much too blue as the other is too grey


def components(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Planes Y (y, x), Cb and Cr (y/2, x/2) of a picture (y, x, 3) uint8 of even size, one after the other (n,).

    Cb is `BETWEEN` times the standard's, lest one kind of decoder be far off. Both show every colour whose Cb is within
    50 of the middle to 4 of 255, and no sky of the documentation's pictures goes beyond 47. At worst they are off by 8,
    and would be by 1 and 12.
    """
    light = picture.astype(np.float32)
    brightness = light @ _LUMA
    coarse = _halved(light)
    mean = coarse @ _LUMA
    blue = (coarse[..., 2] - mean) / np.float32(_BLUE) * np.float32(BETWEEN)
    red = (coarse[..., 0] - mean) / np.float32(_RED)
    y = _BLACK + (_WHITE - _BLACK) / 255.0 * brightness
    return np.concatenate([_bytes(y), *(_bytes(_MIDDLE + _SWING / 255.0 * each) for each in (blue, red))])


def _halved(light: F32) -> F32:
    """Means of 2 x 2 pixels; decoders that have chroma half a pixel to the left show edges that much beside."""
    ny, nx, n = light.shape
    return np.asarray(light.reshape(ny // 2, 2, nx // 2, 2, n).mean(axis=(1, 3)))


def _bytes(values: NDArray[np.floating]) -> NDArray[np.uint8]:
    return np.clip(np.rint(values), 1, 254).astype(np.uint8).ravel()
