"""Solved light as named arrays and a description of how they belong together, and back: what can be kept on disk.

What follows from the scene and the options alone (its matter, its ground, the shape of its land) is not kept: it is
handed in again. Only classes that are named here are made from a description, and every array is checked against the
grid that it claims to belong to before a kernel may read it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.ground.sky_view import Terrain
from openswim.lights.eclipses import MoonShadow
from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.transport.air.dimmed import Dimmed, Eclipse
from openswim.transport.beam.lit_volume import Channels
from openswim.transport.columns.columns import Columns, FromAbove
from openswim.transport.columns.discrete_ordinates import Layers
from openswim.transport.diffuse.moments import Coarser, Moments
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.ground_light.landscape import landscape_of
from openswim.transport.lit.lit_grid import GridLight, LitGrid
from openswim.transport.march.volume import AIR_DEGREE, DEGREE, Shells, Volume
from openswim.transport.medium.coefficients import Coefficients
from openswim.transport.medium.core import Core
from openswim.transport.medium.medium import Medium, air_of
from openswim.transport.medium.surface import Surface

_KINDS: tuple[type, ...] = (
    LitGrid, GridLight, Channels, Shells, Volume, Lighting, Medium, Coefficients, Moments, Coarser, Columns, FromAbove,
    Layers, Core, Eclipse, Dimmed, MoonShadow,
)  # fmt: skip
# what is handed in again, or follows from what is
_GIVEN: dict[type, set[str]] = {
    LitGrid: {"options", "surface", "air", "frame", "landscape", "wider", "once", "decide"},
    GridLight: {"medium"},
    Medium: {"frame", "species", "grid", "air", "drift_m"},
    Lighting: {"terrain"},
    Columns: {"medium", "coefficients"},
    MoonShadow: {"tables"},
}


@dataclass(frozen=True)
class Description:
    """``levels``: of each pack of wavelengths the grids from the innermost on, with names in place of ``arrays``."""

    levels: list[list[dict[str, Any]]]
    arrays: dict[str, NDArray]


def described(packs: Sequence[LitGrid], of: str) -> Description:
    """The light ``of`` a lamp, all packs of wavelengths; arrays that are one are named once."""
    arrays: dict[str, NDArray] = {}
    names: dict[int, str] = {}

    def one(value: Any, name: str) -> Any:
        if isinstance(value, np.ndarray):
            if id(value) not in names:
                names[id(value)] = name
                arrays[name] = value
            return {"array": names[id(value)]}
        if isinstance(value, np.generic):
            return value.item()
        if type(value) in _KINDS:
            return {"kind": type(value).__name__} | {
                field: one(getattr(value, field), f"{name}/{field}") for field in _fields(type(value))
            }
        if isinstance(value, tuple):
            return {"tuple": [one(each, f"{name}/{n}") for n, each in enumerate(value)]}
        if isinstance(value, list):
            return [one(each, f"{name}/{n}") for n, each in enumerate(value)]
        if isinstance(value, Mapping):
            return {"map": {str(key): one(each, f"{name}/{key}") for key, each in value.items()}}
        assert value is None or isinstance(value, (bool, int, float, str)), type(value)
        return value

    levels = [
        [one(level, f"{of}/pack{p}/level{n}") for n, level in enumerate(pack.levels)] for p, pack in enumerate(packs)
    ]
    return Description(levels, arrays)


def restored(
    levels: Sequence[Sequence[Mapping[str, Any]]], array: Callable[[str], NDArray], options: Options, matter: Matter,
    surface: Surface,
) -> list[LitGrid]:  # fmt: skip
    """The light of a scene's matter and ground from a `Description`; ValueError where it is not that of any light.

    array: reads one by its name.
    """
    packs = []
    for n, pack in enumerate(levels):
        which = np.minimum(np.arange(n * PACK, (n + 1) * PACK), matter.wavelengths_nm.size - 1)
        of_pack, ground = matter.at(which), surface.at_wavelengths(which)
        scenes = list(_levels(of_pack, ground))
        _require(len(scenes) == len(pack), "as many grids as the scene has")
        found = None
        for description, (own, own_ground) in zip(reversed(pack), reversed(scenes), strict=True):
            found = _lit(description, array, options, own, own_ground, found)
            _require(np.array_equal(found.wavelengths_nm, own.wavelengths_nm), "the scene's wavelengths")
        assert found is not None
        packs.append(found)
    return packs


def _levels(matter: Matter, surface: Surface) -> Iterator[tuple[Matter, Surface]]:
    yield matter, surface
    if matter.wider is not None and surface.wider is not None:
        yield from _levels(matter.wider, surface.wider)


def _fields(kind: type) -> list[str]:
    every = getattr(kind, "_fields", None) or [f.name for f in dataclasses.fields(kind)]
    return [name for name in every if name not in _GIVEN.get(kind, ())]


def _require(holds: bool, what: str) -> None:
    if not holds:
        raise ValueError(f"expected {what}")


def _lit(
    tree: Mapping[str, Any], array: Callable[[str], NDArray], options: Options, matter: Matter, surface: Surface,
    wider: LitGrid | None,
) -> LitGrid:  # fmt: skip
    given: dict[type, dict[str, Any]] = {}

    def one(value: Any) -> Any:
        if isinstance(value, Mapping):
            if "array" in value:
                return array(value["array"])
            if "tuple" in value:
                return tuple(one(each) for each in value["tuple"])
            if "map" in value:
                return {key: one(each) for key, each in value["map"].items()}
            return made(value)
        return [one(each) for each in value] if isinstance(value, list) else value

    def made(value: Mapping[str, Any]) -> Any:
        kind = {each.__name__: each for each in _KINDS}.get(str(value.get("kind")))
        _require(kind is not None and set(value) == {"kind", *_fields(kind)}, "a part of light with all its fields")
        assert kind is not None
        return kind(**{name: one(value[name]) for name in _fields(kind)}, **given.get(kind, {}))

    medium = None
    if tree.get("medium") is not None:
        air = air_of(matter.air, float(tree["medium"]["ground_m"]))
        given[Medium] = {
            "frame": matter.frame, "grid": matter.grid, "species": list(matter.species), "air": air,
            "drift_m": matter.drift_m,
        }  # fmt: skip
        medium = one(tree["medium"])
        _check_medium(medium)
    land = None if medium is None else Terrain(medium.terrain_m, medium.cell_m, medium.periodic)
    given[Lighting] = {"terrain": None if land is None or land.level else land}
    given[GridLight] = {"medium": medium}
    if isinstance(tree.get("light"), Mapping):
        given[Columns] = {"medium": medium, "coefficients": one(tree["light"]["coefficients"])}
    landscape = None
    if medium is not None:
        landscape = landscape_of(surface, medium, None if wider is None else wider.landscape)
    given[LitGrid] = {
        "options": options, "surface": surface, "air": matter.air, "frame": matter.frame, "landscape": landscape,
        "wider": wider,
    }  # fmt: skip
    lit: LitGrid = one({**tree, "medium": None})
    lit = dataclasses.replace(lit, medium=medium)
    _check(lit)
    return lit


def _check_medium(m: Medium) -> None:
    """What kernels take for granted of a medium."""
    nz, ny, nx = m.shape
    _require(m.extinction.shape == (len(m.species), nz, ny, nx) and m.extinction.dtype == FLOAT, "extinction")
    _require(bool((np.diff(m.levels_m) > 0).all()) and nz > 1, "levels that rise")
    _require(m.axes.shape == (ny, nx, 3, 3) and m.place.shape == (ny, nx, 3), "columns of the terrain's shape")
    _require(bool(np.isfinite(m.terrain_m).all() and np.isfinite(m.place).all()), "columns in their place")


def _check(lit: LitGrid) -> None:
    """That arrays have the shapes, and point to where, kernels take for granted."""
    shells, volume, light, m = lit.shells, lit.volume, lit.light, lit.medium
    _require(type(volume) is Volume, "a volume")
    _require(0 < lit.count <= PACK and lit.wavelengths_nm.shape == (PACK,) and lit.sun.shape == (3,), "wavelengths")
    _check_shells(shells)
    if lit.eclipse is not None:
        _check_eclipse(lit.eclipse, shells)
    ns = volume.species
    _require(lit.table.shape[0] == ns + 1 and lit.table.shape[3:] == (PACK,), "forward peaks of all species")
    if m is None:
        _require(light is None, "no light on a grid that is none")
        return
    nz, ny, nx = m.shape
    lighting = lit.lighting
    _require(
        all(a.shape == (PACK, ny, nx) for a in (lighting.albedo, lighting.direct, lighting.diffuse, lighting.up_top)),
        "fluxes on all columns",
    )
    _require(
        ns == len(m.species) and volume.scaled.shape == volume.forward.shape == (ns, PACK)
        and volume.single.shape == (ns, DEGREE, PACK) and volume.terrain_m.shape == volume.steep.shape == (ny, nx)
        and volume.free.shape == (nz, ny, nx) and volume.bend.shape in ((nz, ny, nx, PACK), (0, ny, nx, PACK))
        and volume.levels_m.shape == (nz + 1,) and volume.air.shape == (nz, 4 * PACK)
        and volume.haze_depth.shape == (nz, PACK)
        and volume.chart.ndim == 3 and volume.chart.shape[2] == 2 and volume.sides_m.shape == (4,)
        and _indices(volume.level_table, nz) and volume.fields.size <= 64 and volume.turning.size == 0,
        "a volume of the grid's shape",
    )  # fmt: skip
    kept = volume.cloud_channel - 2 * PACK - ns
    channels = lit.channels
    _require(
        channels is not None and channels.beam.shape == (nz, ny, nx, PACK) and 0 < kept <= PACK
        and channels.forward_depth.shape == (kept, nz, ny, nx)
        and (channels.source is None or channels.source.shape == (nz, ny, nx, PACK))
        and volume.forward_factors.shape == (kept, PACK),
        "the beam on all nodes",
    )  # fmt: skip
    _require(light is not None, "light on the grid")
    assert light is not None
    _require(len(light.coefficients) == PACK, "coefficients at all wavelengths")
    for c in light.coefficients:
        _require(
            c.scaled.shape == (ns,) and c.scattering.shape == (ns, m.degree) and c.air_extinction.shape == (nz,)
            and c.air_scattering.shape == (nz, DEGREE),
            "coefficients of all species",
        )  # fmt: skip
    if light.columns is not None:
        _check_columns(light.columns, (nz, ny, nx))
    for moments, coarser in zip(light.moments or [], light.coarser, strict=True):
        blocks = -(-nx // moments.values.shape[-1])
        _require(moments.place.shape == (nz, ny, blocks) and _places(moments.place, moments.values), "moments")
        _require(coarser.factor in (0, 2, 4) and _places(coarser.place, coarser.values), "a coarser grid")
        if coarser.factor:
            rows = -(-ny // coarser.factor)
            _require(coarser.place.shape[:2] == (nz, rows) and 0 < coarser.columns <= nx, "a coarser grid's shape")


def _check_columns(columns: Columns, shape: tuple[int, int, int]) -> None:
    """What the kernel of a grid's columns takes for granted."""
    _require(type(columns) is Columns and type(columns.above) is FromAbove, "columns")
    (nz, ny, nx), count = shape, columns.count
    inflow, lacking, sun_table, missed = columns.above
    node, suns = columns.ground_node, inflow.shape[1]
    _require(
        0 < count <= PACK and inflow.shape == (count, suns, 2) and missed.shape == (count, suns)
        and lacking.shape[:3] == (count, nz, suns) and lacking.ndim == 4
        and min(suns, lacking.shape[3]) > 1 and _indices(sun_table, suns)
        and node.shape == columns.mu_sun.shape == (ny, nx) and bool(((node >= 0) & (node <= nz - 2)).all())
        and columns.local_sun.shape == (ny, nx, 3) and columns.half_m.shape == (2, 2)
        and columns.albedo.shape == columns.direct.shape == (count, ny, nx),
        "light from above the grid's columns",
    )  # fmt: skip


def _check_shells(shells: Shells) -> None:
    _require(type(shells) is Shells, "shells")
    nl = len(shells.rows)
    _require(
        shells.rows.shape == (nl, 4 * PACK) and shells.phase.shape == (2, AIR_DEGREE, PACK)
        and len(shells.horizon) == nl and shells.slant.shape[0] == nl
        and shells.slant.shape[2:] == (2 * PACK,) and shells.source.shape[0] == nl
        and shells.ground_flux.shape[1:] == (PACK,) and _indices(shells.level_table, nl),
        "shells of one shape",
    )  # fmt: skip
    suns = len(shells.ground_flux)
    _require(_indices(shells.moment_sun_table, suns) and shells.source.shape[1] == suns, "suns of one shape")


def _check_eclipse(eclipse: Eclipse, shells: Shells) -> None:
    """That the moon's shadow is on these shells."""
    _require(type(eclipse) is Eclipse and type(eclipse.dimmed) is Dimmed, "an eclipse")
    _check_shells(eclipse.lit)
    dimmed, shadow = eclipse.dimmed, eclipse.dimmed.shadow
    _require(type(shadow) is MoonShadow and shadow.to_sun_m.shape == shadow.to_moon_m.shape == (3,), "a shadow")
    _require(
        eclipse.lit.source.shape == shells.source.shape
        and dimmed.source.shape == shells.source.shape[:1] + shells.source.shape[2:]
        and dimmed.moments.shape == shells.moments.shape[:1] + shells.moments.shape[2:]
        and dimmed.here.shape == dimmed.flux.shape == dimmed.wavelengths_nm.shape == (PACK,)
        and dimmed.sun.shape == (3,) and bool((dimmed.here > 0).all()),
        "light of the shells in an eclipse",
    )  # fmt: skip


def _indices(table: NDArray, count: int) -> bool:
    """Whether a table holds fractional indices of ``count`` rows."""
    return table.ndim == 1 and table.size > 1 and bool(((table >= 0) & (table <= count - 1)).all())


def _places(place: NDArray, values: NDArray) -> bool:
    """Whether blocks are where they are said to be."""
    return place.ndim == 3 and values.ndim == 3 and values.shape[1] == DEGREE**2 and bool(
        ((place >= -1) & (place < len(values))).all()
    )
