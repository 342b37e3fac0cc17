"""Pictures of a comparison: in the camera's own pixels and in common projections, as bytes and as data for a page."""

import base64
import io
from functools import cache, lru_cache
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.cameras import Camera

U8 = NDArray[np.uint8]
_SHADES = 512  # from white to full colour
GREY = np.array([120, 126, 132], np.uint8)  # no score here
CLOUD_COLOURS = {
    "cloud in both": (244, 246, 248),
    "observed only": (224, 96, 60),
    "simulated only": (52, 132, 214),
    "clear in both": (28, 44, 64),
}


def pair(comparison: xr.Dataset) -> tuple[U8, U8]:
    """The frame, and the simulated sky as its camera would have written it (ny, nx, 3)."""
    return _bytes(comparison["stored"].values), _bytes(comparison["simulated_as_stored"].values)


def difference(comparison: xr.Dataset) -> U8:
    """Observed less simulated brightness as stored: red where the frame is brighter, blue where it is darker."""
    seen, shown = (comparison[name].values.mean(axis=-1) for name in ("stored", "simulated_as_stored"))
    return signed(np.where(comparison["valid"].values, seen - shown, np.nan), 0.3)


def signed(value: NDArray[np.floating], most: float) -> U8:
    """Values (ny, nx) as red above 0 and blue below, in full colour at ``most``; grey where there is none."""
    number = np.clip(np.nan_to_num(value * (_SHADES / most)), -_SHADES, _SHADES).astype(np.intp) + _SHADES
    return _shades()[np.where(np.isfinite(value), number, -1)]


@cache
def _shades() -> U8:
    """(2 _SHADES + 2, 3): from blue over white to red, and last grey."""
    share = np.linspace(-1, 1, 2 * _SHADES + 1)[:, None]
    up, down, white = np.array([202, 62, 42.0]), np.array([36, 92, 190.0]), np.array([246, 246, 246.0])
    colour = np.where(share > 0, white + share * (up - white), white - share * (down - white))
    return np.concatenate([colour, GREY[None]]).astype(np.uint8)


def clouds(comparison: xr.Dataset) -> U8 | None:
    """The contingency of the masks; None where there are none."""
    if "observed_cloud" not in comparison:
        return None
    seen, shown = comparison["observed_cloud"].values, comparison["simulated_cloud"].values
    number = np.where(seen, np.where(shown, 0, 1), np.where(shown, 2, 3))
    colours = np.array(list(CLOUD_COLOURS.values()), np.uint8)[number]
    return np.where(comparison["valid"].values[..., None], colours, GREY)


def reprojected(picture: U8, camera: Camera, view: Camera, order: int = 1) -> U8:
    """A picture of one camera in the pixels of another at the same place: bilinear, or (order 0) of the nearest pixel;
    black where it does not look."""
    parts = np.ascontiguousarray(picture.reshape(-1, picture.shape[-1]), np.float32)
    return np.round(_shares(camera, view, order) @ parts).astype(np.uint8).reshape(*view.shape, -1)


@lru_cache(maxsize=8)
def _shares(camera: Camera, view: Camera, order: int) -> Any:
    """(pixels of the view, pixels of the camera): how much of each one's colour is another's, as a sparse matrix."""
    from scipy.sparse import csr_array

    pixels = view.pixels()
    row, column = camera.pixel_of(pixels.azimuth_deg, pixels.altitude_deg)
    outside = ~(np.isfinite(row) & (row > -0.5) & (row < camera.shape[0] - 0.5))
    outside |= ~((column > -0.5) & (column < camera.shape[1] - 0.5))
    outside |= ~pixels.inside
    number = np.flatnonzero(~outside)
    place = [np.clip(v.ravel()[number], 0, n - 1) for v, n in zip((row, column), camera.shape, strict=True)]
    if order == 0:
        place = [np.round(v) for v in place]
    lower = [np.floor(v).astype(np.intp) for v in place]
    corners = []
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)) if order else ((0, 0),):
        share = np.ones(number.size, np.float32)
        for v, low, step in zip(place, lower, (down, right), strict=True):
            share *= (v - low if step else 1 - (v - low)).astype(np.float32)
        at = [np.minimum(low + step, n - 1) for low, step, n in zip(lower, (down, right), camera.shape, strict=True)]
        corners.append((share, at[0] * camera.shape[1] + at[1]))
    shares, columns = (np.concatenate(each) for each in zip(*corners, strict=True))
    rows = np.tile(number, len(corners))
    return csr_array((shares, (rows, columns)), shape=(outside.size, camera.shape[0] * camera.shape[1]))


def common_views(camera: Camera) -> dict[str, Camera]:
    """All-sky with north up, and the panorama above the horizon, of the camera's place."""
    place: dict[str, Any] = {name: getattr(camera, name) for name in ("lat", "lon", "x_m", "y_m", "height_m")}
    return {
        "all-sky": Camera.allsky(**place, size=min(camera.shape)),
        "panorama": Camera.panorama(**place, size=2 * camera.shape[1], altitude_range_deg=(0.0, 90.0)),
    }


def data_uri(picture: U8, lossless: bool = False) -> str:
    """JPEG, or PNG, as text that a page holds."""
    from PIL import Image

    stream = io.BytesIO()
    kind = "png" if lossless else "jpeg"
    Image.fromarray(picture).save(stream, kind, **({} if lossless else {"quality": 88}))
    return f"data:image/{kind};base64,{base64.b64encode(stream.getvalue()).decode()}"


def _bytes(share: NDArray[np.floating]) -> U8:
    values = np.round(255 * np.clip(np.nan_to_num(share), 0, 1)).astype(np.uint8)
    return values if values.shape[-1] == 3 else np.repeat(values, 3, axis=-1)
