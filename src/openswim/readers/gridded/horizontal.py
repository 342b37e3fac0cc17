"""Where a CF file's columns lie: its x and y axes, even and ascending, in a projection or in flat metres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.base import cells_off
from openswim.readers.common.bounds import check_size
from openswim.readers.common.fileset import FileSet, values
from openswim.readers.domain.cutting import select
from openswim.readers.domain.mesh import Mesh
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.readers.domain.selection import Selection
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.labels.units import conversion

if TYPE_CHECKING:
    from pyproj import CRS

F64 = NDArray[np.float64]

_LAT_NAMES = {"lat", "latitude", "Latitude", "nav_lat", "XLAT", "rlat", "grid_latitude"}
_LON_NAMES = {"lon", "longitude", "Longitude", "nav_lon", "XLONG", "rlon", "grid_longitude"}
_X_NAMES = {"x", "xh", "xt", "xc", "xu", "west_east", "ni", "X"}
_Y_NAMES = {"y", "yh", "yt", "yc", "yv", "south_north", "nj", "Y"}


@dataclass(frozen=True)
class Horizontal:
    """The columns of a file that a scene takes, and how to read fields onto them."""

    x_dim: str
    y_dim: str
    selection: Selection
    file_shape: tuple[int, int]  # rows, columns
    turned: tuple[bool, bool]  # rows, columns are listed from the north, from the east

    @cached_property
    def beyond(self) -> NDArray[np.bool_] | None:
        """Columns (ny, nx) of a resampled part that lie outside the file's domain; None where there are none."""
        if not self.selection.nodes:
            return None
        outside = np.isnan(self.selection.take(np.zeros(self.file_shape, np.float32)))
        return outside if outside.any() else None

    def read(self, path: Path, variable: xr.DataArray, units: str, cloud: bool = False) -> NDArray[np.float32]:
        """A variable (..., y, x) in the wanted units, NaN where missing; only the part that is needed.

        Beyond the domain: nothing of what clouds are made of (`cloud`), else the mean within.
        """
        variable = variable.transpose(..., self.y_dim, self.x_dim)
        check_size(path, str(variable.name), variable.shape)

        def part(rows: slice, columns: slice) -> NDArray[np.float32]:
            there = {self.y_dim: _turned(rows, self.file_shape[0], self.turned[0]),
                     self.x_dim: _turned(columns, self.file_shape[1], self.turned[1])}  # fmt: skip
            found = values(path, variable.isel(there), units)
            return found[..., :: -1 if self.turned[0] else 1, :: -1 if self.turned[1] else 1]

        found = self.selection.read(part)
        if self.beyond is not None:
            found[..., self.beyond] = 0.0 if cloud else found[..., ~self.beyond].mean(axis=-1, keepdims=True)
        return found


def horizontal(files: FileSet, sample: xr.DataArray, around: Neighbourhood | None, notes: list[str]) -> Horizontal:
    """The horizontal grid of `sample`'s dimensions, or its part around a place.

    Flat domains without any place on Earth are laid around the place, where one is given.
    """
    along = {str(dim): _coordinate(files, str(dim)) for dim in sample.dims}
    kinds: dict[str, tuple[str, str]] = {}  # x, y: dimension and what its coordinate is
    for dim, coordinate in along.items():
        kind = _kind(coordinate)
        if kind and kind[0] not in kinds:
            kinds[kind[0]] = dim, kind
    if set(kinds) != {"x", "y"}:
        raise UserError(
            f"{files.path}: {sample.name}({', '.join(along)}) has no recognisable horizontal axes: give the dimensions "
            "coordinates with standard_name (longitude, latitude, projection_x_coordinate ...) and units"
        )
    (x_dim, kind), (y_dim, _) = kinds["x"], kinds["y"]
    crs, radius = _projection(files, sample, kind, notes)
    x, x_turned = _nodes(files.path, along[x_dim], crs is not None and crs.is_geographic)
    y, y_turned = _nodes(files.path, along[y_dim], False)
    if crs is None and around is not None:
        from pyproj import CRS

        crs = CRS.from_proj4(f"+proj=aeqd +lat_0={around.lat} +lon_0={around.lon} +R={radius} +no_defs")
        x, y = x - 0.5 * (x[0] + x[-1]), y - 0.5 * (y[0] + y[-1])
        notes.append(f"no place in the file: its centre is laid at latitude {around.lat:g}, longitude {around.lon:g}")
    elif crs is None:
        notes.append("no place in the file: flat Earth, open sides")
    selection = select(Mesh(x, y, crs, radius), around)
    if selection.note:
        notes.append(selection.note)
    found = Horizontal(x_dim, y_dim, selection, (y.size, x.size), (y_turned, x_turned))
    if crs is not None:
        _check(files, found)
    return found


def _coordinate(files: FileSet, dim: str) -> xr.DataArray | None:
    """The 1-D coordinate along a dimension: of its name, else the only one there is along it."""
    own = files.get(dim, ndim=1)
    if own is not None and own.dims == (dim,):
        return own
    others = [f for f in files if f.dims == (dim,) and _kind(f)]
    return others[0] if others else None


def _kind(coordinate: xr.DataArray | None) -> str | None:
    """ "x..." or "y..." with what it is: "x longitude", "y grid_latitude", "x metres"; None for other axes."""
    if coordinate is None:
        return None
    name, said = str(coordinate.name), str(coordinate.attrs.get("standard_name", ""))
    units = str(coordinate.attrs.get("units", "")).lower()
    axis = str(coordinate.attrs.get("axis", "")).upper()
    if said.startswith("grid_l") or name in ("rlat", "rlon"):
        return "y rotated" if "lat" in (said or name) else "x rotated"
    if said == "latitude" or "degrees_n" in units or "degree_n" in units or name in _LAT_NAMES:
        return "y degrees"
    if said == "longitude" or "degrees_e" in units or "degree_e" in units or name in _LON_NAMES:
        return "x degrees"
    metric = conversion(units, "m") is not None or not units or units == "1"
    if metric and (said == "projection_x_coordinate" or name in _X_NAMES or axis == "X"):
        return "x metres"
    if metric and (said == "projection_y_coordinate" or name in _Y_NAMES or axis == "Y"):
        return "y metres"
    return None


def _nodes(path: Path, coordinate: xr.DataArray | None, unwrap: bool) -> tuple[F64, bool]:
    """Ascending nodes (metres or degrees), and whether the file lists them the other way."""
    assert coordinate is not None  # _kind has seen it
    if not 2 <= coordinate.size <= 200_000:
        raise UserError(f"{path}: {coordinate.name} has {coordinate.size} nodes; a scene takes 2 to 200000 each way")
    nodes = np.asarray(coordinate.values, np.float64)
    factor = conversion(str(coordinate.attrs.get("units", "m") or "m"), "m")
    if factor is not None:
        nodes = nodes * factor[0]
    if unwrap:
        nodes = np.degrees(np.unwrap(np.radians(nodes)))
    turned = bool(nodes[0] > nodes[-1])
    nodes = nodes[::-1] if turned else nodes
    if not (np.isfinite(nodes).all() and (np.diff(nodes) > 0).all()):
        why = _why_not(coordinate, unwrap)
        raise UserError(f"{path}: the coordinate {coordinate.name} does not run one way ({why}")
    far_east, far_west = 180.0 <= nodes[0] < 540.0 and nodes[-1] > 360.0, nodes[0] >= -540.0 and nodes[-1] < -180.0
    if unwrap and (far_east or far_west):  # a turn too far
        nodes = nodes - math.copysign(360.0, nodes[0])
    if unwrap and nodes[-1] - nodes[0] > 360.0 - 1e-3:
        raise UserError(f"{path}: {coordinate.name} runs over more than 360 degrees: drop the repeated columns")
    return nodes, turned


def _why_not(coordinate: xr.DataArray, unwrap: bool) -> str:
    """Why nodes do not run one way, and what to do: columns over the date line may have been sorted from -180 on."""
    steps = np.diff(np.asarray(coordinate.values, np.float64))
    if unwrap and (steps > 0).all() and steps.max() > 180.0:
        name = coordinate.name
        return f"it leaves out more than half the Earth between two columns): over the date line sort by {name} % 360"
    return "repeated or missing values): damaged"


def _turned(part: slice, count: int, turned: bool) -> slice:
    return slice(count - part.stop, count - part.start) if turned else part


def _projection(files: FileSet, sample: xr.DataArray, kind: str, notes: list[str]) -> tuple[CRS | None, float]:
    from openswim.readers.cf.grid import crs_from_cf, sphere_of

    named = str(sample.attrs.get("grid_mapping") or sample.encoding.get("grid_mapping") or "")
    mapping = files.get(named.split(":")[0]) if named else None
    if mapping is None:
        mapping = next((f for f in files if "grid_mapping_name" in f.attrs), None)
    if mapping is not None and not (kind == "x degrees" and "latitude_longitude" not in str(mapping.attrs)):
        crs = crs_from_cf(str(mapping.name), mapping.attrs)
        return crs, sphere_of(crs, notes)
    if kind == "x degrees":
        from pyproj import CRS

        return CRS.from_proj4(f"+proj=longlat +R={EARTH_RADIUS_M} +no_defs"), EARTH_RADIUS_M
    if kind == "x rotated":
        raise UserError(f"{files.path}: rotated axes without a grid mapping: where the pole lies must be in the file")
    return None, EARTH_RADIUS_M


def _check(files: FileSet, laid: Horizontal) -> None:
    """Compare with the file's own 2-D latitudes and longitudes, where it has them: within a tenth of a cell."""
    own: dict[str, NDArray[np.float32]] = {}
    for f in files:
        said = str(f.attrs.get("standard_name", f.name))[:3]
        if set(f.dims) == {laid.x_dim, laid.y_dim} and said in ("lat", "lon"):
            own[said] = laid.read(files.path, f.drop_attrs(), "1")
    if set(own) != {"lat", "lon"} or laid.selection.nodes:
        return
    off = cells_off(laid.selection.grid(np.array([0.0, 1.0])), own["lon"], own["lat"])
    if not off < 0.1:
        raise UserError(
            f"{files.path}: latitudes and longitudes lie up to {off:.3g} cells off what the grid mapping says: "
            "correct the grid mapping"
        )
