"""Pictures as analyses are given them: radiance by its dimensions and units, of the camera, sun and time they tell."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import shown
from openswim.assimilation.observing.instruments import Instrument
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError
from openswim.pictures.observer import place_of
from openswim.scene.frame import horizon_vector
from openswim.scene.labels.units import conversion
from openswim.scene.times import parse_time

F64 = NDArray[np.float64]

UNITS = {"radiance": "W m-2 sr-1 nm-1", "wavelength": "nm"}
_LATEST = np.timedelta64(5, "m")  # by which a picture's time may differ: the sun moves a degree
_FARTHEST_DEG = 2.0  # by which the sun, or a pixel, may stand elsewhere: calibrations differ by less
_FARTHEST_M, _FARTHEST_PLACE_DEG = 10.0, 1e-4  # by which a camera may


def radiance_of(image: Any, rows: Rows, n: int) -> F64:
    """(w, ny, nx) at the operator's wavelengths, NaN where masked; raises UserError.

    image: of camera n, a Dataset with ``radiance``, a DataArray with named dimensions in any order, or a plain array.
    """
    what, shape = f"observations: image {n}", rows.instruments[n].camera.shape
    if isinstance(image, xr.DataArray):
        image = (image if "wavelength" in image.dims else image.expand_dims("wavelength", -1)).to_dataset(
            name="radiance"
        )
    if isinstance(image, xr.Dataset):
        if "radiance" not in image or set(image["radiance"].dims) != {"y", "x", "wavelength"}:
            raise UserError(f"{what} has no radiance (y, x, wavelength)")
        image = in_units(image, what)
        values = image["radiance"].transpose("y", "x", "wavelength").values
        if "wavelength" in image.coords:
            at = np.asarray(image["wavelength"].values, float)
            nearest = np.abs(at[:, None] - rows.wavelengths_nm).argmin(axis=0)
            if not np.abs(at[nearest] - rows.wavelengths_nm).max() <= 1.0:  # NaN is far, too
                raise UserError(f"{what} is at {at.tolist()} nm, not at {rows.wavelengths_nm.tolist()}")
            values = values[..., nearest]
    else:
        values = plain(image)
        values = values[..., None] if values.ndim == 2 else values
    if values.shape != (*shape, rows.wavelengths_nm.size):
        raise UserError(f"{what} is {values.shape}; give {(*shape, rows.wavelengths_nm.size)}")
    return np.moveaxis(np.asarray(values, float), -1, 0)


def plain(values: Any) -> F64:
    """As float64, NaN where masked."""
    masked = np.ma.is_masked(values)
    return np.asarray(np.ma.filled(np.ma.asarray(values, float), np.nan) if masked else values, float)


def in_units(image: xr.Dataset, what: str) -> xr.Dataset:
    """Radiance and wavelengths converted from the units that they say; raises UserError."""
    for name, wanted in UNITS.items():
        if name not in image.variables:
            continue
        units = str(image[name].attrs.get("units", wanted))
        found = conversion(units, wanted)
        if found is None:
            raise UserError(f"{what}: {name} is in {shown(units)}: give it in {wanted}")
        if found[0] != 1.0:
            image = image.assign({name: (image[name] * found[0]).assign_attrs(units=wanted)})
    return image


def check_image(image: Any, rows: Rows, n: int, time: np.datetime64 | None) -> None:
    """Raise UserError where a picture says of itself that another camera made it, under another sun or at another time.

    time: when its camera sees; None where the sun stands where it was put.
    """
    if not isinstance(image, xr.Dataset):
        return
    what, each = f"observations: image {n}", rows.instruments[n]
    told = image.attrs.get("light_time")
    seen = None if told is None else parse_time(str(told))
    if seen is not None and time is not None and abs(seen - time) > _LATEST:
        raise UserError(
            f"{what} was lit at {seen}, its camera here at {time}: give that time to observe, or to the file or its "
            "[[camera]]"
        )
    sun = [float(image.attrs.get(f"sun_{angle}_deg", np.nan)) for angle in ("azimuth", "altitude")]
    if _apart_deg(sun, each.sun) > _FARTHEST_DEG:
        raise UserError(f"{what} has the sun at azimuth {sun[0]:.1f}, altitude {sun[1]:.1f}, its camera "
                        f"here at {each.sun[0]:.1f}, {each.sun[1]:.1f}: give observe its time or sun")  # fmt: skip
    if not _same_place(image.attrs, each) or not _same_pixels(image, each):
        raise UserError(
            f"{what} is of a camera that stands or looks elsewhere than camera {n}: give images in the order of the "
            "cameras; of one that is put elsewhere on purpose give radiance alone"
        )


def _same_place(attrs: dict[str, Any], each: Instrument) -> bool:
    here = place_of(each.camera)
    if {"x_m", "y_m"} <= attrs.keys():
        off = np.array([float(attrs[name]) for name in ("x_m", "y_m")]) - here
        return bool(np.abs(off).max() <= _FARTHEST_M)
    if {"longitude", "latitude"} <= attrs.keys():
        return _apart_deg([float(attrs[name]) for name in ("longitude", "latitude")], here) <= _FARTHEST_PLACE_DEG
    return True


def _same_pixels(image: xr.Dataset, each: Instrument) -> bool:
    """Whether the first and the last pixel look where the camera has them."""
    if not {"azimuth", "altitude"} <= set(image.coords) or image["azimuth"].shape != each.inside.shape:
        return True
    for at in np.argwhere(each.inside)[[0, -1]]:
        azimuth, altitude = (
            float(image[name].transpose("y", "x").values[tuple(at)]) for name in ("azimuth", "altitude")
        )
        off = each.camera.pixels().angle_to_deg(azimuth, altitude)[tuple(at)]
        if not off <= _FARTHEST_DEG:
            return False
    return True


def _apart_deg(one: ArrayLike, other: ArrayLike) -> float:
    """The angle between two directions or places, each azimuth and altitude, or longitude and latitude; degrees."""
    (a, h), (b, g) = np.asarray(one, float), np.asarray(other, float)
    off = np.linalg.norm(horizon_vector(a, h) - horizon_vector(b, g))
    return float(np.degrees(2 * np.arcsin(np.minimum(off / 2, 1.0))))
