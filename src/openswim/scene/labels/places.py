"""Where the values of a labelled array stand, by its own coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.labels.units import conversion

Axis = tuple[NDArray[Any], str]  # places, and the unit they are in

_CELL, _FLOAT32 = 0.01, 2e-7  # rounding: of the smallest step, and of the largest number
_LENGTHS = ["x", "xh", "xu", "y", "yh", "yv", "z", "zh", "zw", "zt", "height", "altitude", "alt", "easting", "northing"]
_ANGLES = ["x", "y", "lon", "longitude", "lat", "latitude", "rlon", "rlat", "grid_longitude", "grid_latitude"]
_PRESSURES = ["pressure", "plev", "pressure_level", "isobaric", "isobaricinhpa"]
_UNITLESS = {  # names of dimensions that stand for places in this unit where they say none; others may be numbering
    "m": [*_LENGTHS, "projection_x_coordinate", "projection_y_coordinate"],
    "degrees": _ANGLES,
    "nm": ["wavelength", "wl"],
}


def aligned(what: str, values: Any, dims: Sequence[str], axes: Mapping[str, Axis]) -> Any:
    """A DataArray whose values stand in the order of these axes: its own coordinates say where they are.

    Anything else comes back as it is, and so does what has no coordinates, or such as are no places. UserError where
    they are other places than the axes have.
    """
    if not isinstance(values, xr.DataArray) or values.ndim != len(dims):
        return values
    for own, axis in zip(values.dims, dims, strict=True):
        if axis in axes and own in values.coords:
            order = _order(what, values.coords[own], axis, *axes[axis])
            values = values if order is None else values.isel({own: order})
        if axis == "z":
            rises = not ("z" in axes and falls(axes["z"][0]))
            for name, coordinate in values.coords.items():
                if coordinate.dims == (own,):
                    _check_pressures(what, str(name), coordinate, rises)
    return values


def _check_pressures(what: str, name: str, coordinate: xr.DataArray, rises: bool) -> None:
    """Raise UserError where values lie on pressures that rise where heights do."""
    said = str(coordinate.attrs.get("units", "")) or ("Pa" if name.lower() in _PRESSURES else "1")
    if coordinate.dtype.kind not in "iuf" or conversion(said, "Pa") is None:
        return
    upside_down = (np.diff(coordinate.values.astype(np.float64)) > 0) == rises
    if coordinate.size > 1 and upside_down.all():
        way, dim = "rise" if rises else "fall", coordinate.dims[0]
        raise UserError(
            f"{what} lies on pressures of {_range(coordinate.values)} {said} ({name}), which {way} while heights do: "
            f"turn it over, isel({dim}=slice(None, None, -1))"
        )


def falls(places: NDArray[Any]) -> bool:
    """Whether places along an axis go down from the first to the last."""
    return bool(places.ndim == 1 and places.size > 1 and (np.diff(places) < 0).all())


def upward(places: NDArray[Any]) -> NDArray[Any]:
    """Places along an axis in rising order where they fall, else as they are."""
    return places[::-1] if falls(places) else places


def _order(what: str, coordinate: xr.DataArray, axis: str, places: NDArray[Any], unit: str) -> NDArray[Any] | None:
    """Which value belongs to each of the places; None: as they are."""
    if coordinate.dtype.kind not in "iuf" or coordinate.shape != places.shape:
        return None  # a wrong shape is told elsewhere
    said = str(coordinate.attrs.get("units", ""))
    factor = conversion(said, unit) if said else (1.0, 0.0)
    if factor is None:
        return None  # levels of pressure, say
    own = factor[0] * coordinate.values.astype(np.float64) + factor[1]
    near = _FLOAT32 * float(np.abs(places).max())
    if places.size > 1:
        near = max(near, _CELL * float(np.abs(np.diff(places)).min()))
    order, wanted = np.argsort(own), np.argsort(places)
    off = own[order] - places[wanted]
    if unit == "degrees" and axis == "x" and abs(turns := np.round(np.median(off) / 360.0)) < 3:
        off = off - 360.0 * turns
    if (np.abs(off) <= near).all():
        place = np.empty_like(order)
        place[wanted] = order
        return None if (place == np.arange(places.size)).all() else place
    if not said and (str(coordinate.dims[0]).lower() not in _UNITLESS[unit] or _counts(coordinate.values)):
        return None
    raise UserError(
        f"{what} has its own {coordinate.dims[0]}, {_range(own)} {unit}, and is asked for at {_range(places)}: select "
        "the same places, or drop its coordinates"
    )


def _counts(values: NDArray[Any]) -> bool:
    """Whether these are no places, but count the values from 0 or 1 on."""
    counted = np.arange(values.size)
    return bool((values == counted).all() or (values == counted + 1).all())


def _range(values: NDArray[Any]) -> str:
    return f"{values[0]:g} to {values[-1]:g}"
