"""What dimensions of arrays are called, and which axis of a grid they are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from openswim.errors import UserError

_NAMES = {
    "x": "x xh xu ni i lon longitude rlon grid_longitude west_east easting projection_x_coordinate",
    "y": "y yh yv nj j lat latitude rlat grid_latitude south_north northing projection_y_coordinate",
    "z": "z zh zw zt nk k lev level levels height altitude alt plev pressure bottom_top model_level_number hybrid",
    "wavelength": "wavelength wl band",
    "time": "time t",
}
_AXES = {name: axis for axis, names in _NAMES.items() for name in names.split()}


def ordered(what: str, values: Any, dims: Sequence[str]) -> Any:
    """A DataArray with its dimensions in this order, as far as they are known by name; anything else as it is.

    UserError where a known name stands at another axis' place, and too few of them are known to tell the order.
    """
    if not isinstance(values, xr.DataArray) or values.ndim != len(dims):
        return values
    axes = [_AXES.get(str(name).lower()) for name in values.dims]
    known = [axis for axis in axes if axis]
    if set(known) <= set(dims) and len(dims) - 1 <= len(set(known)) == len(known):
        rest = [axis for axis in dims if axis not in known]
        place = {axis or rest[0]: number for number, axis in enumerate(axes)}
        return values.transpose(*(values.dims[place[axis]] for axis in dims))
    if any(axis not in (None, dim) for axis, dim in zip(axes, dims, strict=True)):
        raise UserError(
            f"{what} has dimensions {_tuple(values.dims)}; it must have {_tuple(dims)}: rename or select them"
        )
    return values


def _tuple(dims: Sequence[Any]) -> str:
    return f"({', '.join(map(str, dims))})"
