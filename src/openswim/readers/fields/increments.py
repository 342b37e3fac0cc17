"""What putting an analysis's increments into a model's own file asks for, whatever the model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.base import open_netcdf
from openswim.readers.common.kept import first_bytes
from openswim.readers.fields.air import VAPOUR_RATIO, saturation_over_ice_pa, saturation_pa
from openswim.scene import Grid

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

HUMIDITY_LEFT = 0.95  # of saturation, at most, where an analysis took all cloud away
CLOUD = 1e-6  # kg/kg of liquid or ice: the least that models and retrievals usually call cloud
_NETCDF = (b"CDF", b"\x89HDF")  # first bytes
_ROUNDING = 1e-6  # share of what was there, below which the rest is rounding of single precision
_SAME_PLACE = 0.01  # cells, by which columns may be off


def check_plain(path: Path, names: Iterable[str]) -> set[str]:
    """Which of these variables a file has; raises UserError unless it is netCDF and they hold decimals as they are."""
    if path.is_dir() or not first_bytes(path).startswith(_NETCDF):
        raise UserError(f"{path}: only netCDF files can be written back to: write it as one, and analyse that")
    with open_netcdf(path) as file:
        found = {name: file.variables[name] for name in names if name in file.variables}
        for name, variable in found.items():
            plain = np.dtype(variable.dtype).newbyteorder("=") in (np.float32, np.float64)
            if not plain or {"scale_factor", "add_offset"} & set(variable.ncattrs()):
                raise UserError(f"{path}: {name} is packed, so that nothing can be written back: unpack it (ncpdq -U)")
            if "least_significant_digit" in variable.ncattrs():  # netCDF4 would round all of it again
                raise UserError(
                    f"{path}: {name} has the attribute least_significant_digit, by which all of it would be rounded: "
                    f"remove that (ncatted -a least_significant_digit,{name},d,,)"
                )
    return set(found)


def put(variable: Any, at: Any, before: F32, after: F32, order: Any = ...) -> None:
    """Write into a netCDF variable what was changed; the rest stays bit for bit, also where it is double precision."""
    moved = after != before
    if not np.isfinite(after[moved]).all():
        raise UserError(f"write-back: {variable.name} would not be finite: the analysis is none, nothing is written")
    whole = np.asarray(variable[at])
    found = whole[order]
    found[moved] = after[moved]
    whole[order] = found
    variable[at] = whole


def added(total: F64, more: F64) -> F64:
    """What there is with more or less of it, and nothing where all was taken; no other number where nothing changes."""
    found = np.maximum(total + more, 0.0)
    return np.where(more == 0, total, np.where(found < _ROUNDING * total, 0.0, found))


def window(grid: Grid, here: Grid, path: Path) -> tuple[slice, slice]:
    """Rows and columns of the file's grid that an analysis has; raises UserError where they are others."""
    out = []
    for own, whole in ((grid.y, here.y), (grid.x, here.x)):
        step = whole[1] - whole[0]
        start = int(np.rint((own[0] - whole[0]) / step))
        inside = 0 <= start <= whole.size - own.size
        off = np.abs(own - whole[start : start + own.size]).max() if inside else np.inf
        if grid.crs != here.crs or off > _SAME_PLACE * step:
            raise UserError(f"{path}: its columns are not those of the analysis: give the file that was analysed")
        out.append(slice(start, start + own.size))
    return out[0], out[1]


def on_levels(field: F64, grid: Grid, here: Grid, part: tuple[slice, slice]) -> F64:
    """A field on a grid's nodes, on the file's: linear in height in each column, 0 beyond."""
    out = np.zeros(here.shape)
    target = np.asarray(_tall(here)[(slice(None), *part)], float)
    height = _tall(grid)
    if np.array_equal(height, target):
        out[(slice(None), *part)] = field
        return out
    drawn = np.empty(target.shape)
    for j, i in np.ndindex(target.shape[1:]):
        drawn[:, j, i] = np.interp(target[:, j, i], height[:, j, i], field[:, j, i], left=0.0, right=0.0)
    out[(slice(None), *part)] = drawn
    return out


def _tall(grid: Grid) -> NDArray[Any]:
    """Heights (nz, ny, nx) of all nodes."""
    return np.broadcast_to(grid.height_m.reshape(-1, *(grid.height_m.shape[1:] or (1, 1))), grid.shape)


def vapour_beside_cloud(
    vapour: F32, pressure_pa: F64, temperature_k: F64, before: Mapping[str, F64], after: Mapping[str, F64]
) -> F32:
    """QVAPOR (kg/kg) that goes with liquid and ice (kg/kg) as they were before and are after.

    Where liquid was added, saturated over water at least; where ice was, over ice. Where cloud was taken away and none
    is left, `HUMIDITY_LEFT` of saturation at most, over the phase of which there had been more. Less than `CLOUD`
    carries vapour only its share of the way: an analysis leaves traces of cloud where air may be far from saturated.
    """
    celsius: NDArray[Any] = temperature_k - 273.15
    over_water: NDArray[Any] = saturation_pa(celsius)
    over_ice: NDArray[Any] = np.where(celsius < 0, saturation_over_ice_pa(celsius), over_water)
    was, left = before["liquid"] + before["ice"], after["liquid"] + after["ice"]
    own = vapour.astype(float)
    out = own
    for phase, saturated in (("liquid", over_water), ("ice", over_ice)):
        missing = np.maximum(_mixing_ratio(saturated, pressure_pa) - own, 0.0)
        out = np.maximum(out, own + _of_cloud(after[phase] - before[phase]) * missing)
    most = HUMIDITY_LEFT * np.where(before["liquid"] >= before["ice"], over_water, over_ice)
    gone = _of_cloud(was - left) * (1 - _of_cloud(left))
    return np.asarray(out - gone * np.maximum(out - _mixing_ratio(most, pressure_pa), 0.0)).astype(np.float32)


def _of_cloud(amount: F64) -> F64:
    """How far some liquid or ice (kg/kg) counts as cloud, from 0 to 1."""
    return np.asarray(np.clip(amount / CLOUD, 0.0, 1.0))


def _mixing_ratio(vapour_pa: F64, pressure_pa: F64) -> F64:
    """Vapour over dry air, kg/kg; vapour has a fifth of the pressure at most."""
    held = np.minimum(vapour_pa, 0.2 * pressure_pa)
    return np.asarray(VAPOUR_RATIO * held / (pressure_pa - held))
