"""GRIB1 and GRIB2 files of HRRR, RAP, GFS, GDAS, NAVGEM, IFS, ICON, AROME and models like them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.asked import winds_wanted
from openswim.readers.common.base import (
    SceneInfo,
    Time,
    covered_text,
    iso,
    labelled,
    naming,
    pick_time,
    place_text,
    spacing_text,
)
from openswim.readers.common.members import picked
from openswim.readers.common.opening import reading
from openswim.readers.domain.cutting import select
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.readers.fields.absent import low_top, no_ground, no_sizes, no_species
from openswim.readers.fields.aerosol_beyond import Haze
from openswim.readers.fields.air import precipitable_water_kg_m2, with_vapour
from openswim.readers.fields.cover import XU_RANDALL
from openswim.readers.grib.aerosol import aerosol, kinds
from openswim.readers.grib.columns import LEVEL_KINDS, Air, Columns, air_of, kind_and_grid, terrain_of
from openswim.readers.grib.fields import (
    SPLIT,
    condensate,
    cover_is_guessed,
    ground,
    of_both_phases,
    wind,
)
from openswim.readers.grib.file import Field, GRIBFile
from openswim.readers.grib.grid import NAMES, GribGrid, grid_of
from openswim.readers.grib.order import check_order
from openswim.readers.grib.sections import is_grib
from openswim.scene import Grid, Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.plausible import high_bottom
from openswim.scene.variables import HYDROMETEORS

MAX_NODES = 2_000_000_000
_LATE_DAYS = 17.0  # GFS and ensembles go to 16; what goes on is climate
_FLAT_LEVELS_M = np.linspace(0.0, 10_000.0, 21)  # of files without fields on levels
_KG_PER_DOBSON = 2.1415e-5
_MODELS = {  # (centre, generating process): ON388 table A
    (7, 81): "GFS analysis",
    (7, 82): "GDAS",
    (7, 83): "HRRR",
    (7, 96): "GFS",
    (7, 105): "RAP",
    (7, 84): "NAM",
    (7, 89): "NAM",
}
_CENTRES = {7: "NCEP", 58: "FNMOC (NAVGEM)", 78: "DWD (ICON)", 84: "Meteo-France", 85: "Meteo-France (AROME)",
            98: "ECMWF (IFS)", 34: "JMA", 74: "Met Office"}  # fmt: skip
_EXPECTED = ("land_area_fraction", "sea_ice_area_fraction", "snow_area_fraction", "surface_albedo", "wind_east_10m")


class GRIBReader:
    """Reads any GRIB file with temperature on levels, or with something on the ground to show."""

    name = "GRIB"

    def detects(self, path: Path) -> bool:
        """True for files that begin with a GRIB message."""
        return path.is_file() and is_grib(path)

    def read(
        self, path: Path, time: Time = None, around: Neighbourhood | None = None, member: int | None = None
    ) -> Scene:
        """The scene at one valid time (default: the first); only the fields of that time are decoded, one by one.

        around : the part of the domain that is wanted.
        """
        with naming(path), reading(path), GRIBFile(path) as file:
            columns, valid = _columns(file, time, around, member=member)
            air = air_of(columns) if columns.kind else None
            fields: dict[str, Any]
            if air is not None:
                fields = _on_levels(columns, air)
                fields |= wind(columns, air) if winds_wanted() else {}
                height, terrain = air.height_m, air.terrain_m
            else:
                fields, (height, terrain) = {}, _flat_levels(columns)
            haze = aerosol(columns, air, height, terrain)
            fields |= haze.fields
            surface, atmosphere = ground(columns, terrain), _atmosphere(columns, haze, height)
            if air is not None and air.dry_density_kg_m3 is not air.density_kg_m3:  # the humidity is known
                vapour_kg_m3 = air.density_kg_m3 - air.dry_density_kg_m3
                ground_m = 0.0 if terrain is None else terrain
                surface["precipitable_water"] = precipitable_water_kg_m2(vapour_kg_m3, height, ground_m)
                atmosphere = with_vapour(atmosphere, height, vapour_kg_m3)
            data = labelled(fields, surface)
            columns.notes += no_species(data) + no_sizes(data) + no_ground(data) + low_top(height)
            return Scene(
                columns.selection.grid(height),
                data,
                atmosphere,
                dict(haze.optics),
                valid,
                f"{path.name}: {_model(columns.fields)}",
                list(dict.fromkeys(columns.notes)),
                cut=columns.selection.cut,
            )

    def members(self, path: Path) -> set[int]:
        """Of an ensemble, by their own numbers; 0 also of a single run."""
        with naming(path), reading(path), GRIBFile(path) as file:
            return set(_members(file.fields))

    def describe(self, path: Path) -> SceneInfo:
        """What a file holds, from its headers and the heights of the first time (of 21 columns across the middle)."""
        with naming(path), reading(path), GRIBFile(path) as file:
            columns, _ = _columns(file, None, None, only_index=True)
            mesh = columns.layout.mesh
            ny, nx = mesh.shape
            grid: Grid | None = None
            names = Counter(one.name for one in columns.fields if one.kind == (columns.kind or one.kind))
            present = {s for s in HYDROMETEORS if f"{s}_content" in names}
            middle, _ = _columns(file, None, _middle(mesh))
            if columns.kind:
                air = air_of(middle)
                grid = middle.selection.grid(air.height_m)
                middle.notes += high_bottom(air.height_m[0], air.terrain_m)
                if of_both_phases(middle) is not None:
                    present |= {"liquid", "ice"}
                    middle.notes.append(SPLIT)
                if present & {"liquid", "ice"} and cover_is_guessed(middle, air):
                    middle.notes.append(XU_RANDALL)
                _atmosphere(middle, aerosol(middle, air, air.height_m, air.terrain_m), air.height_m)
            else:
                flat = _flat_levels(middle)
                _atmosphere(middle, aerosol(middle, None, *flat), flat[0])
            columns.notes += middle.notes
            species = [s for s in HYDROMETEORS if s in present]
            species += kinds(columns)
            levels = f", {names['temperature']} {columns.kind} levels" if columns.kind else ", no levels"
            found = set(ground(columns, terrain_of(columns)))
            contents = {f"{s}_content" for s in species}
            columns.notes += no_species(contents) + no_sizes(contents | set(names)) + no_ground(found)
            whole = mesh.grid()
            unused = ", ".join(f"{code} ({count})" for code, count in file.unused.most_common(8))
            if unused:
                columns.notes.append(f"parameters not used: {unused}")
            return SceneInfo.on(
                grid,
                path=str(path),
                model=_model(columns.fields),
                grid=f"{nx} x {ny}{levels}",
                projection=NAMES[columns.layout.kind] + place_text(whole),
                spacing=spacing_text(whole),
                extent=covered_text(whole),
                times=[iso(moment) for moment in _times(file)],
                species=species,
                surface=sorted(found),
                missing=[name for name in _EXPECTED if name not in found],
                assumed=[note for note in dict.fromkeys(columns.notes) if "neighbourhood" not in note],
            )


def _times(file: GRIBFile) -> NDArray[np.datetime64]:
    """Valid times, of the fields on levels where there are any: those on the ground may be older."""
    found = kind_and_grid(file.fields)
    times = {one.valid for one in file.fields if found is None or one.kind == found[0]}
    return np.array(sorted(times), "datetime64[ms]")


def _columns(
    file: GRIBFile, time: Time, around: Neighbourhood | None, only_index: bool = False, member: int | None = None
) -> tuple[Columns, np.datetime64]:
    """The fields of one time, grid and member, and the part of the grid that is wanted."""
    if not file.fields:
        held = ", ".join(code for code, _ in file.unused.most_common(6)) or "nothing"
        raise UserError(
            f"{file.path}: no field a scene can use (it holds {held}): give the file that has temperature and cloud on "
            "levels"
        )
    times = _times(file)
    valid = times[pick_time(file.path, times, time)]
    fields = [one for one in file.fields if one.valid == valid]
    # terrain, land and heights of levels may come once, with the analysis
    fields += [one for one in file.fields if one.valid != valid and (one.name == "land" or _is_place(one))]
    notes = _late(file, fields[0], valid)
    members = _members(fields)
    shown = members[picked(file.path, members, member, notes)]
    if len(members) > 1:
        own = [one for one in fields if one.member == shown]
        theirs = {(one.name, one.kind, one.level) for one in own}
        # what all members share may come once, as of no ensemble
        fields = own + [
            o for o in fields if o.member == 0 and _is_shared(o) and (o.name, o.kind, o.level) not in theirs
        ]
    chosen = kind_and_grid(fields)
    kind, definition = chosen if chosen is not None else ("", fields[0].grid)
    fields = [one for one in fields if one.grid == definition]
    repeated = sum(
        n - 1 for n in Counter((o.name, o.kind, o.level) for o in fields if o.kind == kind and o.instant).values()
    )
    if repeated:
        notes.append(f"{repeated} fields come twice: the first of each is used")
    if chosen is None:
        notes.append("no temperature on levels in the file: no clouds, only the ground and what stands above it")
    layout = grid_of(file, next(one for one in fields if one.kind == (kind or one.kind)), notes)
    if not only_index:
        _check_order(file, layout, fields, kind)
    selection = select(layout.mesh, around)
    ny, nx = selection.shape
    levels = len({one.level for one in fields if one.kind == kind and one.name == "temperature"}) or _FLAT_LEVELS_M.size
    if not only_index and nx * ny * levels > MAX_NODES:
        raise UserError(
            f"{file.path}: {nx} x {ny} x {levels} nodes are more than {MAX_NODES:.0e}: open a part of it, "
            "open_scene(path, around=(lat, lon))"
        )
    if selection.note:
        notes.append(selection.note)
    return Columns(file, fields, layout, selection, kind, notes), valid


def _late(file: GRIBFile, one: Field, valid: np.datetime64) -> list[str]:
    """A note on a forecast for longer than weather is forecast, as a damaged step makes one."""
    keys = file.keys(one, ("dataDate", "dataTime"))
    try:
        day, clock = f"{int(keys['dataDate']):08d}", int(keys["dataTime"])
        minutes = np.timedelta64(60 * (clock // 100) + clock % 100, "m")
        begun = np.datetime64(f"{day[:4]}-{day[4:6]}-{day[6:]}") + minutes
    except (TypeError, ValueError):
        return []
    days = float((valid - begun) / np.timedelta64(1, "D"))
    return [f"valid {days:.0f} days after its analysis: is that what the file means?"] if days > _LATE_DAYS else []


def _check_order(file: GRIBFile, layout: GribGrid, fields: list[Field], kind: str) -> None:
    """Of the ground, which is rough where it is not sea, and of a temperature."""
    terrain = [one for one in fields if one.kind in ("surface", "hybrid") and one.name in ("height", "geopotential")]
    warm = [one for one in fields if one.kind == kind and one.name == "temperature"]
    for one in (*terrain[:1], *warm[len(warm) // 2 :][:1]):
        check_order(f"{file.path}: {one.name} (message {one.number})", layout, file.values(one))


def _members(fields: list[Field]) -> list[int]:
    """Those with temperatures on levels, where there are any; 0 of a single run."""
    warm = {one.member for one in fields if one.kind in LEVEL_KINDS and one.name == "temperature"}
    return sorted(warm or {one.member for one in fields if one.kind != "surface"} or {0})


def _is_shared(one: Field) -> bool:
    return one.kind not in LEVEL_KINDS or (one.kind == "hybrid" and one.name in ("height", "geopotential"))


def _is_place(one: Field) -> bool:
    return one.kind == "interface" or (one.kind == "surface" and one.name in ("height", "geopotential"))


def _middle(mesh: Any) -> Neighbourhood:
    ny, nx = mesh.shape
    lon, lat = mesh.grid().lonlat(0.5 * (nx - 1), 0.5 * (ny - 1))
    return Neighbourhood(float(lat), float(lon), radius_m=1.0)


def _on_levels(columns: Columns, air: Air) -> dict[str, Any]:
    fields: dict[str, Any] = {"air_pressure": air.pressure_pa, "air_temperature": air.temperature_k}
    fields |= condensate(columns, air)
    if not any(name.endswith("_content") for name in fields):
        columns.notes.append("no cloud or precipitation on levels in the file: a clear sky")
    return fields


def _flat_levels(columns: Columns) -> tuple[NDArray[Any], NDArray[np.float32] | None]:
    terrain = terrain_of(columns)
    low = 0.0 if terrain is None else float(np.floor(terrain.min()))
    return _FLAT_LEVELS_M + low, terrain


def _atmosphere(columns: Columns, haze: Haze, height_m: NDArray[Any]) -> Atmosphere:
    column = columns.on_ground("ozone_column", ("column", "surface"))
    ozone: dict[str, float] = {}
    if column is not None and np.isfinite(column).any():
        mean = float(np.nanmean(column))
        dobson = mean if mean > 1.0 else mean / _KG_PER_DOBSON
        if 50.0 < dobson < 700.0:
            ozone["ozone_du"] = dobson
            columns.notes.append(f"the file's ozone, {dobson:.0f} DU")
    return Atmosphere.us_standard(aerosol=haze.background(height_m, columns.notes), **ozone)


def _model(fields: list[Field]) -> str:
    one = next((f for f in fields if f.kind not in ("surface", "column")), fields[0])
    return _MODELS.get((one.centre, one.process)) or _CENTRES.get(one.centre, f"centre {one.centre}")
