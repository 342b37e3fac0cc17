"""What stands before the sky in the frames of a clear day: trees and masts, which are darker than it in all of them.

Each frame is looked at as it comes, since no more than one is held at a time. The logarithm of the bluest channel's
light, over that of the frame's middle, is averaged over the frames. What is far darker in this mean than the bright
part of its ring of altitude, and reaches down to the edge of the picture, is no sky: the dark part of a clear sky has
half of the light of the bright one, leaves have a twentieth. Bright roofs and thin wires are not found.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.observations.frames import SkyFrame

F32 = NDArray[np.float32]

_DARKER = 0.25  # than what is bright of its ring, as light
_BRIGHT = 80.0  # percentile
_RING_DEG, _WIDE_DEG, _HIGHEST_DEG = 2.0, 15.0, 75.0
_AROUND_DEG = 0.7  # that leaves move, and their edges are blurred over
_MOST = 0.6  # of the sky: more is no clear day
_COLUMNS = 640


@dataclass
class Standing:
    """Running mean of frames, made smaller by a whole number."""

    total: F32 | None = None
    frames: int = 0
    step: int = 1
    shape: tuple[int, int] = field(default=(0, 0))

    def add(self, frame: SkyFrame) -> None:
        """A frame of the day."""
        counts = frame.counts[..., -1] if frame.counts.ndim == 3 else frame.counts
        self.shape, self.step = frame.shape, max(1, frame.shape[1] // _COLUMNS)
        ny, nx = (n // self.step for n in frame.shape)
        small = counts[: ny * self.step, : nx * self.step].reshape(ny, self.step, nx, self.step).mean(axis=(1, 3))
        share = np.maximum(small / frame.full_scale, 1e-3)
        light = np.log(share**2.2 if frame.full_scale == 255 else share)
        light -= np.median(light[ny // 4 : -ny // 4, nx // 4 : -nx // 4])
        self.total = light.astype(np.float32) if self.total is None else self.total + light.astype(np.float32)
        self.frames += 1

    def hidden(self, camera: Camera) -> NDArray[np.bool_] | None:
        """(ny, nx) of the camera's frame: where the sky is hidden; None where nothing is found, or nearly all."""
        from scipy.ndimage import binary_closing, binary_dilation, binary_opening, label

        if self.total is None:
            return None
        ny, nx = self.total.shape
        rows, columns = (np.arange(n) * self.step + self.step // 2 for n in (ny, nx))
        pixels = camera.pixels()
        altitude = pixels.altitude_deg[np.ix_(rows, columns)]
        inside = pixels.inside[np.ix_(rows, columns)] & (altitude > 0)
        mean, dark = self.total / self.frames, np.zeros(inside.shape, bool)
        for low in np.arange(0, _HIGHEST_DEG, _RING_DEG):
            ring = inside & (altitude >= low) & (altitude < low + _RING_DEG)
            wide = inside & (altitude >= low) & (altitude < low + _WIDE_DEG)  # trees may stand all around
            if ring.any():
                dark[ring] = mean[ring] < np.percentile(mean[wide], _BRIGHT) + np.log(_DARKER)
        dark = binary_closing(binary_opening(dark), iterations=2)
        number, _ = label(dark | ~inside)
        outer = np.unique(number[~inside])
        dark &= np.isin(number, outer[outer > 0])
        reach = max(1, round(_AROUND_DEG / max(float(np.nanmedian(np.hypot(*np.gradient(altitude))[inside])), 1e-3)))
        dark = binary_dilation(dark, iterations=reach) & inside
        if not dark.any() or dark.sum() > _MOST * inside.sum():
            return None
        whole = np.repeat(np.repeat(dark, self.step, axis=0), self.step, axis=1)
        rest = [(0, size - had) for size, had in zip(self.shape, whole.shape, strict=True)]
        return np.pad(whole, rest, mode="edge")
