"""What was observed, as an analysis takes it: values, their errors, and which may be used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import check_kind, number, numbers
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError
from openswim.scene.times import parse_time

F64 = NDArray[np.float64]

_LEAST_W_M2 = -20.0  # that pyranometers show by night, as they cool
_MOST_W_M2 = 2500.0  # more than clouds' edges ever add to the sun
_LATEST = np.timedelta64(5, "m")  # by which a picture's time may differ: the sun moves a degree
NOISE, NOISE_OF_IRRADIANCE = 0.02, 0.03


def observations(
    rows: Rows,
    images: Sequence[Any] = (),
    irradiance_w_m2: ArrayLike | None = None,
    noise: float = NOISE,
    irradiance_noise: float = NOISE_OF_IRRADIANCE,
    representation: float | Sequence[float] = 0.0,
    saturated: float | None = None,
    use: Sequence[ArrayLike | None] | None = None,
) -> xr.Dataset:
    """A row of ``value``, ``error`` (standard deviation) and ``use`` on ``observation``.

    images : one of each camera: what `render` makes, or an array (y, x, wavelength) of radiance, W m-2 sr-1 nm-1.
    noise : of a camera's radiance L, as a share of the root mean square of L and the picture's mean: errors that are a
        share of L alone would let dark pixels rule, absolute ones the bright ones.
    representation : what a model's grid cannot show (`representation_error`), a share like the noise, of all or of each
        camera; the two add as squares. saturated : radiance from which on a pixel is not used.
    use : of each camera (ny, nx), which pixels may be used beside all that `observe` says.
    """
    if len(images) != len(rows.instruments):
        raise UserError(f"observations: {len(images)} images for {len(rows.instruments)} cameras")
    for n, (image, time) in enumerate(zip(images, _times(rows), strict=True)):
        _check_time(image, time, n)
    each_share = numbers("observations: representation", representation)
    shares = np.broadcast_to(each_share, len(images)) if each_share.ndim == 0 else each_share
    of_noise, saturates = _share("noise", noise), None if saturated is None else number("saturated", saturated)
    masks = [None] * len(images) if use is None else list(use)
    if len(shares) != len(images) or len(masks) != len(images):
        raise UserError(f"observations: representation and use must be given for each of {len(images)} cameras")
    value, error, usable = np.empty(rows.size), np.empty(rows.size), np.zeros(rows.size, bool)
    for n, (part, each) in enumerate(zip(rows.parts, rows.instruments, strict=False)):
        radiance = _radiance(images[n], rows, n)[:, each.inside]  # (w, n)
        light = each.quantity.relative(radiance)
        good = each.usable & np.isfinite(light).all(axis=0)
        if saturates is not None:
            good &= (radiance < saturates).all(axis=0)
        mask = masks[n]
        if mask is not None:
            good &= np.asarray(mask, bool)[each.inside]
        if not good.any():
            raise UserError(f"observations: no pixel of camera {n} may be used")
        light = np.where(good, light, 0.0)
        mean = light[:, good].mean(axis=1, keepdims=True)
        if not (mean > 0).all():  # errors are shares of it: of none they would weigh without bounds
            raise UserError(f"observations: image {n} has no light in the mean of its pixels: is it a picture by day, "
                            "in W m-2 sr-1 nm-1?")  # fmt: skip
        total = np.hypot(of_noise, _share("representation", shares[n]))
        if total == 0:
            raise UserError("observations: noise and representation are both 0, and an analysis weighs by errors: give "
                            "noise = .02, for instance")  # fmt: skip
        sigma = total * np.sqrt(0.5 * (light**2 + mean**2))
        light = np.where(good, light, mean)
        value[part.here] = each.quantity.value(light).ravel()
        error[part.here] = np.maximum(each.quantity.error(light, sigma), 1e-12).ravel()
        usable[part.here] = np.tile(good, part.shape[0])
    if len(rows.points):
        _add_irradiance(rows, irradiance_w_m2, irradiance_noise, value, error, usable)
    data = {"value": rows.row(value), "error": rows.row(error), "use": rows.row(usable).astype(bool)}
    return xr.Dataset(data)


def check_observed(rows: Rows, observed: xr.Dataset) -> None:
    """Raise UserError unless this is a row of an operator's observations, some of which may be used."""
    check_kind("observed", observed, xr.Dataset, "give what operator.observations(...) makes")
    for name in ("value", "error", "use"):
        if name not in observed or observed[name].shape != (rows.size,):
            raise UserError(f"observed: {name} is missing or not a row of {rows.size} observations")
    use = observed["use"].values.astype(bool)
    good = np.isfinite(observed["value"].values) & (observed["error"].values > 0)
    if not use.any() or not good[use].all():
        raise UserError("observed: none may be used, or one that may has no value or no positive error")


def _add_irradiance(
    rows: Rows, given: ArrayLike | None, noise: float, value: F64, error: F64, use: NDArray[np.bool_]
) -> None:
    measured = np.full(len(rows.points), np.nan) if given is None else np.asarray(given, float)
    if measured.shape != (len(rows.points),):
        raise UserError(f"observations: {measured.size} values of irradiance for {len(rows.points)} pyranometers")
    here, known = rows.parts[-1].here, np.isfinite(measured)
    value[here] = np.where(known, measured, 0.0)
    within = (measured[known] >= _LEAST_W_M2) & (measured[known] <= _MOST_W_M2)
    if not within.all() or np.isinf(measured).any():
        raise UserError(
            f"observations: irradiance in W m-2 lies within {_LEAST_W_M2:g} to {_MOST_W_M2:g}: leave out others"
        )
    share = _share("irradiance_noise", noise)
    if known.any() and share == 0:
        raise UserError("observations: irradiance_noise is 0, and an analysis weighs by errors: give .03, for instance")
    mean = measured[known].mean() if known.any() else 1.0
    error[here] = np.maximum(share * np.sqrt(0.5 * (value[here] ** 2 + mean**2)), 1e-6)
    use[here] = known


def _times(rows: Rows) -> list[np.datetime64 | None]:
    """Of each camera, when it sees; None where nothing tells, or the sun stands where it was put."""
    return [one.time if one.sun is None else None for one in rows.of_times for _ in one.instruments]


def _check_time(image: Any, time: np.datetime64 | None, n: int) -> None:
    """Raise UserError where a picture says of itself that it was lit at another time."""
    told = image.attrs.get("light_time") if isinstance(image, xr.Dataset) else None
    seen = None if told is None else parse_time(str(told))
    if seen is not None and time is not None and abs(seen - time) > _LATEST:
        raise UserError(
            f"observations: image {n} was lit at {seen}, its camera here at {time}: give that time to observe, or to "
            "the file or its [[camera]]"
        )


def _share(what: str, value: Any) -> float:
    """A share of a signal that is its error."""
    if not 0 <= number(f"observations: {what}", value) < np.inf:
        raise UserError(f"observations: {what} = {value:g}: give a share of 0 or more, such as .02")
    return float(value)


def _radiance(image: Any, rows: Rows, n: int) -> F64:
    """(w, ny, nx) at the operator's wavelengths."""
    shape = rows.instruments[n].camera.shape
    if isinstance(image, xr.Dataset):
        if "radiance" not in image or set(image["radiance"].dims) != {"y", "x", "wavelength"}:
            raise UserError(f"observations: image {n} has no radiance (y, x, wavelength)")
        at = np.asarray(image["wavelength"].values, float)
        nearest = np.abs(at[:, None] - rows.wavelengths_nm).argmin(axis=0)
        if not np.abs(at[nearest] - rows.wavelengths_nm).max() <= 1.0:  # NaN is far, too
            raise UserError(f"observations: image {n} is at {at.tolist()} nm, not at {rows.wavelengths_nm.tolist()}")
        values = image["radiance"].transpose("y", "x", "wavelength").values[..., nearest]
    else:
        values = np.asarray(image, float)
        values = values[..., None] if values.ndim == 2 else values
    if values.shape != (*shape, rows.wavelengths_nm.size):
        raise UserError(f"observations: image {n} is {values.shape}; give {(*shape, rows.wavelengths_nm.size)}")
    return np.moveaxis(np.asarray(values, float), -1, 0)
