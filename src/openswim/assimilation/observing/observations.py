"""What was observed, as an analysis takes it: values, their errors, and which may be used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import check_kind, number, numbers
from openswim.assimilation.observing.images import check_image, plain, radiance_of
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError

F64 = NDArray[np.float64]

_LEAST_W_M2 = -20.0  # that pyranometers show by night, as they cool
_MOST_W_M2 = 2500.0  # more than clouds' edges ever add to the sun
_DIMMEST_W_M2, _HIGH_SUN_DEG = 5.0, 30.0  # the darkest clouds let more through of a sun above it
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

    images : one of each camera: what `render` makes, or an array (y, x, wavelength) of radiance, W m-2 sr-1 nm-1. Those
        with units are converted, and those that tell camera, sun and time must be of these. Where an array is masked,
        or NaN, nothing was seen.
    noise : of a camera's radiance L, as a share of the root mean square of L and the picture's mean: errors that are a
        share of L alone would let dark pixels rule, absolute ones the bright ones.
    representation : what a model's grid cannot show (`representation_error`), a share like the noise, of all or of each
        camera; the two add as squares. saturated : radiance from which on a pixel is not used.
    use : of each camera (ny, nx), which pixels may be used beside all that `observe` says.
    """
    if len(images) != len(rows.instruments):
        raise UserError(f"observations: {len(images)} images for {len(rows.instruments)} cameras")
    for n, (image, time) in enumerate(zip(images, _times(rows), strict=True)):
        check_image(image, rows, n, time)
    each_share = numbers("observations: representation", representation)
    shares = np.broadcast_to(each_share, len(images)) if each_share.ndim == 0 else each_share
    of_noise, saturates = _share("noise", noise), None if saturated is None else number("saturated", saturated)
    masks = [None] * len(images) if use is None else list(use)
    if len(shares) != len(images) or len(masks) != len(images):
        raise UserError(f"observations: representation and use must be given for each of {len(images)} cameras")
    value, error, usable = np.empty(rows.size), np.empty(rows.size), np.zeros(rows.size, bool)
    for n, (part, each) in enumerate(zip(rows.parts, rows.instruments, strict=False)):
        radiance = radiance_of(images[n], rows, n)[:, each.inside]  # (w, n)
        light = each.quantity.relative(radiance)
        good = each.usable & np.isfinite(light).all(axis=0)
        if saturates is not None:
            good &= (radiance < saturates).all(axis=0)
        mask = masks[n]
        if mask is not None:
            if np.shape(mask) != each.inside.shape:
                raise UserError(f"observations: use of camera {n} is {np.shape(mask)}; give {each.inside.shape}")
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
    ours = rows.row(np.zeros(rows.size))
    for name in map(str, ours.coords):
        if name in observed.coords and not np.array_equal(observed[name].values, ours[name].values, equal_nan=True):
            raise UserError(f"observed: its {name} is not that of this operator's rows: give what its own "
                            "observations(...) made, in that order")  # fmt: skip
    use = observed["use"].values.astype(bool)
    good = np.isfinite(observed["value"].values) & (observed["error"].values > 0)
    if not use.any() or not good[use].all():
        raise UserError("observed: none may be used, or one that may has no value or no positive error")


def _add_irradiance(
    rows: Rows, given: ArrayLike | None, noise: float, value: F64, error: F64, use: NDArray[np.bool_]
) -> None:
    measured = np.full(len(rows.points), np.nan) if given is None else plain(given)
    if measured.shape != (len(rows.points),):
        raise UserError(f"observations: {measured.size} values of irradiance for {len(rows.points)} pyranometers")
    here, known = rows.parts[-1].here, np.isfinite(measured)
    value[here] = np.where(known, measured, 0.0)
    within = (measured[known] >= _LEAST_W_M2) & (measured[known] <= _MOST_W_M2)
    if not within.all() or np.isinf(measured).any():
        raise UserError(
            f"observations: irradiance in W m-2 lies within {_LEAST_W_M2:g} to {_MOST_W_M2:g}: leave out others"
        )
    high = min(one.daylight.direction[2] for one in rows.of_times) > np.sin(np.radians(_HIGH_SUN_DEG))
    if known.any() and high and measured[known].max() < _DIMMEST_W_M2:
        raise UserError(f"observations: irradiance is {measured[known].max():.3g} W m-2 at most, less than the darkest "
                        "clouds let through: is it in kW m-2?")  # fmt: skip
    share = _share("irradiance_noise", noise)
    if known.any() and share == 0:
        raise UserError("observations: irradiance_noise is 0, and an analysis weighs by errors: give .03, for instance")
    mean = measured[known].mean() if known.any() else 1.0
    error[here] = np.maximum(share * np.sqrt(0.5 * (value[here] ** 2 + mean**2)), 1e-6)
    use[here] = known


def _times(rows: Rows) -> list[np.datetime64 | None]:
    """Of each camera, when it sees; None where nothing tells, or the sun stands where it was put."""
    return [one.time if one.sun is None else None for one in rows.of_times for _ in one.instruments]


def _share(what: str, value: Any) -> float:
    """A share of a signal that is its error."""
    if not 0 <= number(f"observations: {what}", value) < np.inf:
        raise UserError(f"observations: {what} = {value:g}: give a share of 0 or more, such as .02")
    return float(value)
