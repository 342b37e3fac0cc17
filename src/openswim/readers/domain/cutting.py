"""The part of a domain that a view needs: cut from the file's grid, or resampled to a local map of even cells.

Any reader may use this. Describe the file's horizontal grid by a `Mesh`, call `select`, and read through the
`Selection`: only the rows and columns it names are asked for. Global grids may be cut across the date line and round
the poles. Cells of longitude and latitude that narrow too much across the part, or come together at a pole, are
resampled (linearly; averaged where the new cells are wider) to a Lambert azimuthal equal-area map centred there.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.domain.mesh import Mesh, cell_m, cut_out, equal_area_map, meeting, mesh_of, within
from openswim.readers.domain.neighbourhood import MOST_RADIUS_M, WIDER_SIDE, Neighbourhood, reach_m
from openswim.readers.domain.selection import Selection, onto, whole
from openswim.scene.grid import extent_text, great_circle_m

if TYPE_CHECKING:
    from openswim.scene import Scene

F64 = NDArray[np.float64]

_SEEN_FROM_SPACE_M = 3_000_000.0
_SPACE_M = 1e5
_MOST_WINDOW_M = 9_900_000.0  # cut from the model's own map
LARGE_COLUMNS = 300_000
_WIDE_CELL_M = 5000.0  # broken into clouds, which takes a finer grid the smaller the part is
_LARGE_SPAN = 1.9  # radians
_MOST_COLUMNS = 300_000  # cut as they are; more are averaged
_MOST_SEEN_COLUMNS = 6_000_000  # for an eye in space, which sees them part by part
_LEAST_CELLS = 3  # on each side of the observer
_NARROWING = 1.2  # width of cells at one edge of the part against its middle
_EVEN = 0.02  # of a cell, as Grid asks


def is_large(mesh: Mesh) -> bool:
    """Whether a domain is too much to take whole: very many columns, or a large part of the Earth."""
    if mesh.crs is None:
        return False
    span = math.hypot(*mesh.grid().size_m()) / mesh.earth_radius_m
    return math.prod(mesh.shape) > LARGE_COLUMNS or span > _LARGE_SPAN


def _stays_whole(mesh: Mesh, radius_m: float) -> bool:
    """Whether a domain is taken whole: no large one, and of wide cells only one that the view needs whole."""
    grid = mesh.grid()
    return not is_large(mesh) and (min(grid.spacing_m()) <= _WIDE_CELL_M or 2 * radius_m > math.hypot(*grid.size_m()))


def select(mesh: Mesh, around: Neighbourhood | None = None) -> Selection:
    """The part of a mesh around a place; without one, or where the domain is small enough, all of it."""
    if around is None or mesh.crs is None or (around.if_large and _stays_whole(mesh, around.radius_m)):
        return whole(mesh)
    ix, iy = (float(v) for v in mesh.index(around.lon, around.lat))
    if not mesh.covers(ix, iy):
        if around.if_large and around.radius_m > _SEEN_FROM_SPACE_M:
            return whole(mesh)  # it lies aside, but is seen
        raise UserError(f"the observer is outside the domain: {extent_text(mesh.grid())}")
    window = _window(mesh, around, ix, iy)
    return window if window is not None else _resampled(mesh, around)


def part_of(scene: Scene, around: Neighbourhood) -> Scene:
    """The part of a scene around a place, for readers that cannot read a part.

    Where it is resampled and reaches beyond the domain there are no clouds, and all else is the mean within.
    """
    import xarray as xr

    grid = scene.grid
    if grid is None or grid.crs is None:
        return scene
    part = select(mesh_of(scene), around)
    if part.shape == grid.shape[1:] and not part.nodes:
        return scene
    beyond = np.isnan(part.take(np.zeros(grid.shape[1:], np.float32)))

    def take(name: str, whole: NDArray[Any]) -> NDArray[np.float32]:
        taken = part.take(whole)
        if beyond.any():
            taken[..., beyond] = 0.0 if _is_cloud(name) else taken[..., ~beyond].mean(axis=-1, keepdims=True)
        return taken

    height = grid.height_m if grid.height_m.ndim == 1 else take("height", grid.height_m)
    data = scene.data.drop_vars(["x", "y", "height"], errors="ignore")
    fields = {}
    for name, values in data.data_vars.items():
        spectral = "wavelength" in values.dims
        whole = values.transpose("wavelength", ...).values if spectral else values.values
        taken = take(str(name), whole)
        fields[name] = (values.dims, np.moveaxis(taken, 0, -1) if spectral else taken)
    coords = {name: data.coords[name] for name in data.coords}
    return replace(
        scene, grid=part.grid(height), data=xr.Dataset(fields, coords, data.attrs), notes=[*scene.notes, part.note],
        cut=scene.cut or part.cut,
    )


def _is_cloud(name: str) -> bool:
    """Whether a variable says how much there is of particles."""
    return name == "cloud_area_fraction" or name.startswith("extinction_") or name.endswith(("_content", "_number"))


def _window(mesh: Mesh, around: Neighbourhood, ix: float, iy: float) -> Selection | None:
    """Rows and columns of the mesh itself; None where these would be no fair map of the part."""
    ny, nx = mesh.shape
    j = int(np.clip(round(iy), 1, ny - 2)) if ny > 2 else 0
    i = int(np.clip(round(ix), 1, nx - 2)) if nx > 2 and not mesh.all_round else round(ix)
    near = mesh.grid()
    wide, tall = cell_m(near, i, j)
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


def _resampled(mesh: Mesh, around: Neighbourhood) -> Selection:
    """An equal-area map centred on the place, with cells of the model's size, or larger where it reaches far."""
    ny, nx = mesh.shape
    grid, radius = mesh.grid(), mesh.earth_radius_m
    _, tall = cell_m(grid, 0.5 * (nx - 1), 0.5 * (ny - 1))
    wanted = min(max(around.radius_m, _LEAST_CELLS * tall), MOST_RADIUS_M, _farthest_m(mesh, around) + tall)
    half = 2.0 * radius * math.sin(0.5 * wanted / radius)
    step = max(tall, 2.0 * half / (around.most_side - 1))
    count = 2 * math.floor(half / step + 1e-6) + 1  # never beyond the farthest radius
    target = equal_area_map(around.lat, around.lon, step, count, radius)
    # what lies beyond a part may end where the domain does
    kept = within(mesh, target, 0.5) if around.most_side == WIDER_SIDE else None
    target = cut_out(target, kept or meeting(mesh, target))
    note = _note(around, "resampled from") + f" ({step / 1e3:.3g} km, equal-area map)"
    return replace(onto(mesh, target, note), cut=_farthest_m(mesh, around) > wanted)


def _farthest_m(mesh: Mesh, around: Neighbourhood) -> float:
    """How far the domain reaches from a place."""
    if mesh.all_round:
        return math.inf
    ny, nx = mesh.shape
    edge = np.linspace(0, 1, 21)
    i = np.concatenate([edge, edge, 0 * edge, 0 * edge + 1]) * (nx - 1)
    j = np.concatenate([0 * edge, 0 * edge + 1, edge, edge]) * (ny - 1)
    ends = zip(*mesh.grid().lonlat(i, j), strict=True)
    return max(great_circle_m([around.lon, lon], [around.lat, lat], mesh.earth_radius_m) for lon, lat in ends)


