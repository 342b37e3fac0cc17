"""The part of a domain that a view needs: cut from the file's grid, or resampled to a local map of even cells.

Any reader may use this. Describe the file's horizontal grid by a `Mesh`, call `select`, and read through the
`Selection`: only the rows and columns it names are asked for. Global grids may be cut across the date line and round
the poles. Cells of longitude and latitude that narrow too much across the part, or come together at a pole, are
resampled (linearly; averaged where the new cells are wider) to a Lambert azimuthal equal-area map centred there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.covering import meeting, within
from openswim.scene.grid import EARTH_RADIUS_M, EDGE, Grid, extent_text

if TYPE_CHECKING:
    from pyproj import CRS

    from openswim.scene import Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

GROUND_RADIUS_M = 200_000.0  # clouds farther away stand less than 3 degrees high
MOST_RADIUS_M = 10_000_000.0  # a hemisphere
WIDER_SIDE = 240  # columns along a side of what is seen beyond
FARTHER = 1.25  # times a radius that is worth a wider grid
_SEEN_FROM_SPACE_M = 3_000_000.0
_SPACE_M = 1e5
_SPACE_RADIUS_M = 1_330_000.0  # an eye so high sees as far
_MOST_WINDOW_M = 9_900_000.0  # cut from the model's own map
LARGE_COLUMNS = 300_000
_WIDE_CELL_M = 5000.0  # broken into clouds, which takes a finer grid the smaller the part is
_LARGE_SPAN = 1.9  # radians
_MOST_COLUMNS = 300_000  # cut as they are; more are averaged
_MOST_SEEN_COLUMNS = 6_000_000  # for an eye in space, which sees them part by part
_LEAST_CELLS = 3  # on each side of the observer
_NARROWING = 1.2  # width of cells at one edge of the part against its middle
_EVEN = 0.02  # of a cell, as Grid asks


@dataclass(frozen=True)
class Neighbourhood:
    """A place (degrees) and how far around it matters; `if_large`: leave small domains whole; `in_parts`: as many
    columns as an eye in space may see part by part (`transport.large`); `far_m`: how far around it clouds may still be
    seen, in wider cells; `most_side`: columns along a side of what is not as the model has it."""

    lat: float
    lon: float
    radius_m: float = GROUND_RADIUS_M
    if_large: bool = False
    in_parts: bool = True
    far_m: float = 0.0
    most_side: int = 420

    def __post_init__(self) -> None:
        if not (-90.0 <= self.lat <= 90.0 and -360.0 <= self.lon <= 360.0):
            raise UserError(f"around: latitude {self.lat}, longitude {self.lon} is no place on Earth: give degrees")
        if not self.radius_m > 0:
            raise UserError(f"radius_km must be positive, got {self.radius_m / 1e3:g}")

    @property
    def from_space(self) -> bool:
        """Whether all is seen that stands above the horizon, as from 100 km up and higher."""
        return self.radius_m > _SPACE_RADIUS_M

    @property
    def beyond(self) -> Neighbourhood | None:
        """What is seen beyond it, if that is farther."""
        if self.far_m < FARTHER * self.radius_m:
            return None
        return replace(self, radius_m=self.far_m, far_m=0.0, most_side=WIDER_SIDE, in_parts=False)


def reach_m(height_m: float) -> float:
    """How far the clouds may be that an eye `height_m` up still shows well [m]."""
    horizon = EARTH_RADIUS_M * math.acos(EARTH_RADIUS_M / (EARTH_RADIUS_M + max(height_m, 0.0)))
    return min(GROUND_RADIUS_M + horizon, MOST_RADIUS_M)


@dataclass(frozen=True)
class Mesh:
    """The columns of a file: node coordinates in `crs`, ascending; y may be uneven (Gaussian latitudes)."""

    x: F64
    y: F64
    crs: CRS | None
    earth_radius_m: float = EARTH_RADIUS_M

    @property
    def shape(self) -> tuple[int, int]:
        return self.y.size, self.x.size

    @property
    def in_degrees(self) -> bool:
        return self.crs is not None and bool(self.crs.is_geographic)

    @property
    def all_round(self) -> bool:
        """Whether the columns go once round the Earth."""
        step = (self.x[-1] - self.x[0]) / (self.x.size - 1)
        return self.in_degrees and abs(self.x.size * step - 360.0) < 0.5 * step

    def grid(self) -> Grid:
        """Its grid of two levels, to ask for positions; as if rows were even."""
        return Grid(self.x, np.linspace(self.y[0], self.y[-1], self.y.size), np.array([0.0, 1.0]), self.crs,
                    self.earth_radius_m)  # fmt: skip

    def index(self, lon: Any, lat: Any) -> tuple[F64, F64]:
        """Fractional indices of places; beyond the ends of a domain below 0 or above n - 1."""
        ix, iy = self.grid().index(lon, lat)
        if self.all_round:
            ix = ix % self.x.size
        if not self.even:
            step = (self.y[-1] - self.y[0]) / (self.y.size - 1)
            beyond = np.minimum(iy, 0.0) + np.maximum(iy - (self.y.size - 1), 0.0)
            iy = beyond + np.interp(self.y[0] + iy * step, self.y, np.arange(self.y.size, dtype=float))
        return ix, iy

    def covers(self, ix: Any, iy: Any) -> NDArray[np.bool_]:
        """Whether fractional indices lie in the domain; on a global one also between its last row and the pole."""
        ny, nx = self.shape
        if self.all_round:
            return np.asarray((iy > -1.01) & (iy < ny + 0.01))
        return np.asarray((ix > -EDGE) & (ix < nx - 1 + EDGE) & (iy > -EDGE) & (iy < ny - 1 + EDGE))

    @property
    def even(self) -> bool:
        straight = np.linspace(self.y[0], self.y[-1], self.y.size)
        return bool(np.abs(self.y - straight).max() <= _EVEN * (straight[1] - straight[0]))


@dataclass(frozen=True)
class Selection:
    """Which part of a file's fields becomes the scene's: its own axes, and how to read fields onto them."""

    x: F64
    y: F64
    crs: CRS | None
    earth_radius_m: float
    rows: slice  # of the file that are needed
    columns: tuple[slice, ...]  # of the file that are needed; two where the part goes over the seam of a global grid
    nodes: tuple[tuple[NDArray[np.int32], F32], ...] = ()  # resampling: (4, ny nx) flat indices and weights, averaged
    note: str = ""
    cut: bool = False  # whether the domain goes on beyond it

    @property
    def shape(self) -> tuple[int, int]:
        return self.y.size, self.x.size

    def read(self, get: Callable[[slice, slice], Any]) -> F32:
        """A field (..., y, x), where `get(rows, columns)` reads such a part of the file, (..., rows, columns)."""
        pieces = [np.asarray(get(self.rows, columns), np.float32) for columns in self.columns]
        part = pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=-1)
        if not self.nodes:
            return np.ascontiguousarray(part)
        flat = part.reshape(*part.shape[:-2], -1)
        return np.asarray(sum(_weighted(flat, *one) for one in self.nodes) / len(self.nodes), np.float32).reshape(
            *part.shape[:-2], *self.shape
        )

    def take(self, whole: NDArray[Any]) -> F32:
        """A field (..., y, x) from the whole one, which has the file's shape (..., ny, nx)."""
        return self.read(lambda rows, columns: whole[..., rows, columns])

    def grid(self, height_m: NDArray[Any]) -> Grid:
        """The scene's grid, with its heights."""
        return Grid(self.x, self.y, height_m, self.crs, self.earth_radius_m)


def _weighted(flat: F32, index: NDArray[np.int32], weight: F32) -> F32:
    """Interpolation that leaves missing values out, and is missing where they have half the weight."""
    values = flat[..., index]
    result = np.einsum("...kn,kn->...n", values, weight)
    if not np.isnan(result).any():
        return np.asarray(result, np.float32)
    there = np.isfinite(values)
    kept = np.einsum("...kn,kn->...n", there.astype(np.float32), weight)
    total = np.einsum("...kn,kn->...n", np.where(there, values, np.float32(0)), weight)
    return np.where(kept > 0.5, total / np.maximum(kept, np.float32(1e-6)), np.float32(np.nan)).astype(np.float32)


def is_large(mesh: Mesh) -> bool:
    """Whether a domain is too much to take whole: very many columns, or a large part of the Earth."""
    if mesh.crs is None:
        return False
    ny, nx = mesh.shape
    dx, dy = mesh.grid().spacing_m()
    return nx * ny > LARGE_COLUMNS or math.hypot(nx * dx, ny * dy) > _LARGE_SPAN * mesh.earth_radius_m


def _stays_whole(mesh: Mesh, radius_m: float) -> bool:
    """Whether a domain is taken whole: no large one, and of wide cells only one that the view needs whole."""
    ny, nx = mesh.shape
    dx, dy = mesh.grid().spacing_m()
    return not is_large(mesh) and (min(dx, dy) <= _WIDE_CELL_M or 2 * radius_m > math.hypot(nx * dx, ny * dy))


def select(mesh: Mesh, around: Neighbourhood | None = None) -> Selection:
    """The part of a mesh around a place; without one, or where the domain is small enough, all of it."""
    if around is None or mesh.crs is None or (around.if_large and _stays_whole(mesh, around.radius_m)):
        return _whole(mesh)
    ix, iy = (float(v) for v in mesh.index(around.lon, around.lat))
    if not mesh.covers(ix, iy):
        if around.if_large and around.radius_m > _SEEN_FROM_SPACE_M:
            return _whole(mesh)  # it lies aside, but is seen
        raise UserError(f"the observer is outside the domain: {extent_text(mesh.grid())}")
    window = _window(mesh, around, ix, iy)
    return window if window is not None else _resampled(mesh, around)


def part_of(scene: Scene, around: Neighbourhood) -> Scene:
    """The part of a scene around a place, for readers that cannot read a part."""
    import xarray as xr

    grid = scene.grid
    if grid is None or grid.crs is None:
        return scene
    part = select(Mesh(grid.x, grid.y, grid.crs, grid.earth_radius_m), around)
    if part.shape == grid.shape[1:] and not part.nodes:
        return scene
    gaps = part.take(np.zeros(grid.shape[1:], np.float32))
    if np.isnan(gaps).any():
        raise UserError(
            f"around: the domain ends within the neighbourhood of {around.lat:g}, {around.lon:g}, and cannot be "
            "resampled there: give a smaller radius_km"
        )
    height = grid.height_m if grid.height_m.ndim == 1 else part.take(grid.height_m)
    data = scene.data.drop_vars(["x", "y", "height"], errors="ignore")
    fields = {}
    for name, values in data.data_vars.items():
        spectral = "wavelength" in values.dims
        whole = values.transpose("wavelength", ...).values if spectral else values.values
        taken = part.take(whole)
        fields[name] = (values.dims, np.moveaxis(taken, 0, -1) if spectral else taken)
    coords = {name: data.coords[name] for name in data.coords}
    return replace(
        scene, grid=part.grid(height), data=xr.Dataset(fields, coords, data.attrs), notes=[*scene.notes, part.note],
        cut=scene.cut or part.cut,
    )


def _whole(mesh: Mesh) -> Selection:
    ny, nx = mesh.shape
    every = Selection(mesh.x, mesh.y, mesh.crs, mesh.earth_radius_m, slice(0, ny), (slice(0, nx),))
    if mesh.even:
        return every
    y = np.linspace(mesh.y[0], mesh.y[-1], ny)
    at = np.interp(y, mesh.y, np.arange(ny, dtype=float))
    ix, iy = np.meshgrid(np.arange(nx, dtype=float), at)
    nodes = (_bilinear(mesh, every.rows, ix.ravel(), iy.ravel()),)
    return Selection(mesh.x, y, mesh.crs, mesh.earth_radius_m, every.rows, every.columns, nodes, "rows made even")


def _window(mesh: Mesh, around: Neighbourhood, ix: float, iy: float) -> Selection | None:
    """Rows and columns of the mesh itself; None where these would be no fair map of the part."""
    ny, nx = mesh.shape
    j = int(np.clip(round(iy), 1, ny - 2)) if ny > 2 else 0
    i = int(np.clip(round(ix), 1, nx - 2)) if nx > 2 and not mesh.all_round else round(ix)
    near = mesh.grid()
    wide, tall = _cell_m(near, i, j)
    up = max(around.radius_m / tall, _LEAST_CELLS)
    south, north = max(0, math.floor(iy - up)), min(ny - 1, math.ceil(iy + up))
    if mesh.in_degrees:
        across = np.cos(np.radians(mesh.y[[south, north]]))
        middle = math.cos(math.radians(mesh.y[j]))
        if across.min() < middle / _NARROWING or across.max() > middle * _NARROWING:
            return None
        wide *= float(across.min()) / middle
    rows = mesh.y[south : north + 1]
    even = np.linspace(rows[0], rows[-1], rows.size)
    if rows.size < 2 or np.abs(rows - even).max() > _EVEN * (even[1] - even[0]):
        return None
    side = max(around.radius_m / wide, _LEAST_CELLS)
    west, east = math.floor(ix - side), math.ceil(ix + side)
    step = (mesh.x[-1] - mesh.x[0]) / (nx - 1)
    if not mesh.all_round:
        west, east = max(0, west), min(nx - 1, east)
    elif east - west >= nx:
        return None
    columns: tuple[slice, ...] = (slice(west, east + 1),)
    if west < 0:
        columns = (slice(west + nx, nx), slice(0, east + 1))
    elif east >= nx:
        columns = (slice(west, nx), slice(0, east + 1 - nx))
    if (east - west) * wide > _MOST_WINDOW_M or (north - south) * tall > _MOST_WINDOW_M:
        return None
    in_parts = around.in_parts and around.radius_m >= reach_m(_SPACE_M) and max(wide, tall) <= _WIDE_CELL_M
    most = _MOST_SEEN_COLUMNS if in_parts else min(_MOST_COLUMNS, 2 * around.most_side**2)
    if (east - west) * (north - south) > most:
        return None
    x = mesh.x[0] + step * np.arange(west, east + 1)
    cut = (north - south + 1, east - west + 1) != mesh.shape
    note = _note(around, "cut from") if cut else ""
    return Selection(x, even, mesh.crs, mesh.earth_radius_m, slice(south, north + 1), columns, (), note, cut)


def _note(around: Neighbourhood, how: str) -> str:
    return f"a neighbourhood of {around.lat:.2f}, {around.lon:.2f} {how} the domain"


def _cell_m(grid: Grid, i: float, j: float) -> tuple[float, float]:
    """Width and height [m] of the cell around a node."""
    from openswim.scene.grid import great_circle_m

    across = grid.lonlat([i - 0.5, i + 0.5], [j, j])
    along = grid.lonlat([i, i], [j - 0.5, j + 0.5])
    return great_circle_m(*across, grid.earth_radius_m), great_circle_m(*along, grid.earth_radius_m)


def _resampled(mesh: Mesh, around: Neighbourhood) -> Selection:
    """An equal-area map centred on the place, with cells of the model's size, or larger where it reaches far."""
    from pyproj import CRS

    ny, nx = mesh.shape
    grid, radius = mesh.grid(), mesh.earth_radius_m
    _, tall = _cell_m(grid, 0.5 * (nx - 1), 0.5 * (ny - 1))
    wanted = min(max(around.radius_m, _LEAST_CELLS * tall), MOST_RADIUS_M, _farthest_m(mesh, around) + tall)
    half = 2.0 * radius * math.sin(0.5 * wanted / radius)
    step = max(tall, 2.0 * half / (around.most_side - 1))
    count = 2 * math.floor(half / step + 1e-6) + 1  # never beyond the farthest radius
    crs = CRS.from_proj4(f"+proj=laea +lat_0={around.lat} +lon_0={around.lon} +R={radius} +no_defs")
    axis: F64 = step * (np.arange(count, dtype=np.float64) - count // 2)
    target = Grid(axis, axis, np.array([0.0, 1.0]), crs, radius)
    kept_x, kept_y = meeting(mesh, target)
    if around.most_side == WIDER_SIDE:  # what lies beyond a part may end where the domain does
        kept_x, kept_y = within(mesh, target, 0.5) or (kept_x, kept_y)
    target = Grid(axis[kept_x], axis[kept_y], np.array([0.0, 1.0]), crs, radius)
    note = _note(around, "resampled from") + f" ({step / 1e3:.3g} km, equal-area map)"
    return replace(onto(mesh, target, note), cut=_farthest_m(mesh, around) > wanted)


def _farthest_m(mesh: Mesh, around: Neighbourhood) -> float:
    """How far the domain reaches from a place."""
    from openswim.scene.grid import great_circle_m

    if mesh.all_round:
        return math.inf
    ny, nx = mesh.shape
    edge = np.linspace(0, 1, 21)
    i = np.concatenate([edge, edge, 0 * edge, 0 * edge + 1]) * (nx - 1)
    j = np.concatenate([0 * edge, 0 * edge + 1, edge, edge]) * (ny - 1)
    ends = zip(*mesh.grid().lonlat(i, j), strict=True)
    return max(great_circle_m([around.lon, lon], [around.lat, lat], mesh.earth_radius_m) for lon, lat in ends)


def onto(mesh: Mesh, target: Grid, note: str = "") -> Selection:
    """A mesh's fields on another grid: linear between its nodes, averaged where cells are wider; NaN beyond it."""
    ny, nx = mesh.shape
    _, tall = _cell_m(mesh.grid(), 0.5 * (nx - 1), 0.5 * (ny - 1))
    step = target.spacing_m()[1]
    parts = max(1, min(4, round(step / tall)))  # cells wider than the model's: the mean of parts x parts points
    offsets = (np.arange(parts) + 0.5) / parts - 0.5
    i, j = np.meshgrid(np.arange(target.x.size, dtype=float), np.arange(target.y.size, dtype=float))
    found = [mesh.index(*target.lonlat((i + di).ravel(), (j + dj).ravel())) for dj in offsets for di in offsets]
    reached = np.concatenate([iy[np.isfinite(iy)] for _, iy in found])
    rows = slice(int(np.clip(np.floor(reached.min()), 0, ny - 2)), int(np.clip(np.ceil(reached.max()), 1, ny - 1)) + 1)
    nodes = tuple(_bilinear(mesh, rows, ix, iy) for ix, iy in found)
    return Selection(target.x, target.y, target.crs, target.earth_radius_m, rows, (slice(0, nx),), nodes, note)


def _bilinear(mesh: Mesh, rows: slice, ix: F64, iy: F64) -> tuple[NDArray[np.int32], F32]:
    """Flat indices (4, n) into some rows of a mesh, and weights, of bilinear interpolation; NaN outside the mesh."""
    nx, ny = mesh.shape[1], rows.stop - rows.start
    outside = ~(np.isfinite(ix) & np.isfinite(iy) & mesh.covers(ix, iy))
    ix, iy = np.where(outside, 0.0, ix), np.where(outside, 0.0, iy - rows.start)
    j = np.clip(np.floor(iy), 0, ny - 2).astype(np.int64)
    v = np.clip(iy - j, 0.0, 1.0)
    i = np.floor(ix).astype(np.int64)
    if not mesh.all_round:
        i = np.clip(i, 0, nx - 2)
    u = ix - i
    right, i = (i + 1) % nx, i % nx
    index = np.stack([j * nx + i, j * nx + right, (j + 1) * nx + i, (j + 1) * nx + right]).astype(np.int32)
    weight = np.stack([(1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u])
    weight[:, outside] = np.nan
    return index, weight.astype(np.float32)
