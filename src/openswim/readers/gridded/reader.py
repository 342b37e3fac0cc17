"""Gridded CF output of weather models, analyses and large-eddy models: ERA5, CAMS, MERRA-2, UM, MicroHH, PALM, CM1.

netCDF, Zarr, kerchunk or icechunk; one file or several of one state. What is what is found by names and units
(names.py), where it lies by coordinates (horizontal.py, vertical.py). docs/models.md says what is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.asked import winds_wanted
from openswim.readers.common.base import (
    SceneInfo,
    Time,
    iso,
    labelled,
    naming,
)
from openswim.readers.common.clock import start_of_undated, undated
from openswim.readers.common.fileset import FileSet, Part, opened_set
from openswim.readers.common.members import member_numbers
from openswim.readers.common.opening import opened, reading
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.readers.fields import air
from openswim.readers.fields.absent import (
    FLAT_INSTEAD,
    INSTEAD,
    SNOW_COVERS_KG_M2,
    low_top,
    no_ground,
    no_sizes,
    no_species,
)
from openswim.readers.fields.aerosol_beyond import Haze
from openswim.readers.fields.aerosol_by_depth import NAMES, from_depths
from openswim.readers.fields.aerosol_species import AerosolPart, added_up, part_of_mass, species_of_name
from openswim.readers.fields.cover import WIDE_CELL_M, XU_RANDALL, cover_from_humidity, liquid_from_cover
from openswim.readers.fields.particles import known_sizes
from openswim.readers.fields.vapour import RELATIVE
from openswim.readers.gridded.columns import PER_VOLUME, Columns
from openswim.readers.gridded.names import CONTENTS, FRACTIONS, NUMBERS, RADII, STATE, SURFACE, WIND, matches
from openswim.readers.gridded.vertical import Levels, levels_of
from openswim.scene import Grid, Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.checks import checked_values
from openswim.scene.labels.units import canonical
from openswim.scene.variables import HYDROMETEORS, Variable

F32 = NDArray[np.float32]
_SELDOM = ("surface_geopotential", "snow_water", "wave_mean_square_slope")  # on the ground; nobody misses them
_DRY_NAMES = ("qc", "qr", "qi", "qs", "qg", "qh", "qhl")  # mixing ratios: per mass of dry air


class GriddedReader:
    """Reads CF-style gridded model output by names, units and coordinates."""

    name = "gridded model"

    def recognises(self, data: xr.Dataset) -> bool:
        """Whether an opened file is this reader's."""
        timeless = np.array([], "datetime64[ms]")
        return "openswim_layout" not in data.attrs and _is_model(FileSet([Part(Path(), data, (), timeless)]))

    def adapt(self, path: Path, data: xr.Dataset) -> xr.Dataset:
        """The file in CF terms that the tables of names.py know; readers of other conventions translate here."""
        return data

    def detects(self, path: Path) -> bool:
        """True for files with a known species, or with temperature at known heights, on levels."""
        try:
            with opened(path, decode=False) as data:
                return self.recognises(data)
        except UserError:
            return False

    def joins(self, path: Path) -> bool:
        """Whether a file that nobody knows by itself, such as one of surface fields, may be a part of a state."""
        try:
            with opened(path, decode=False):
                return True
        except UserError:
            return False

    def read(self, path: Path, time: Time = None, member: int | None = None) -> Scene:
        """The scene at one time of the file (default: its first); only that time is read."""
        return self.read_parts([path], time, member=member)

    def read_parts(
        self, paths: Sequence[Path], time: Time = None, around: Neighbourhood | None = None, member: int | None = None
    ) -> Scene:
        """The scene of several files that hold different variables or times of one model."""
        return _read(self, paths, time, around, member)[0]

    def members(self, path: Path) -> set[int]:
        """Of an ensemble, by their own numbers."""
        with opened(path, decode=False) as data:
            return member_numbers(path, self.adapt(path, data))

    def describe(self, path: Path) -> SceneInfo:
        """Grid, times and contents; the first time is read for it."""
        return self.describe_parts([path])

    def describe_parts(self, paths: Sequence[Path], around: Neighbourhood | None = None) -> SceneInfo:
        scene, columns, times = _read(self, paths, None, around)
        grid = scene.grid
        assert grid is not None
        used = {what: ", ".join(dict.fromkeys(names)) for what, names in columns.used.items()}
        species = [f"{name} ({used[name]})" for name in HYDROMETEORS if name in used]
        species += [f"aerosol ({used['aerosol']})"] if "aerosol" in used else []
        surface = [f"{what} ({used[what]})" for what in SURFACE if what in used]
        missing = [what for what in (*HYDROMETEORS, "temperature", "pressure") if what not in used]
        missing += [what for what in SURFACE if what not in used and what not in _SELDOM]
        return SceneInfo.on(
            grid,
            path=", ".join(map(str, paths)),
            model=scene.source,
            times=times,
            species=species,
            surface=surface,
            missing=missing,
            assumed=scene.notes,
        )


def _is_model(files: FileSet) -> bool:
    """Something to see on levels, with levels that can be given heights."""
    fields = [f for f in files if f.ndim >= 3]
    species = [q for groups in CONTENTS.values() for q in groups] + [STATE["cloud_fraction"]]
    seen = any(matches(f, q, PER_VOLUME) for f in fields for q in species)
    seen = seen or any(species_of_name(str(f.name)) for f in fields)
    air_only = any(matches(f, STATE["temperature"]) for f in fields) and any(
        matches(f, STATE[q]) for f in fields for q in ("geopotential", "geopotential_height", "pressure", "altitude")
    )
    return seen or air_only


def _read(
    reader: GriddedReader, paths: Sequence[Path], time: Time, around: Neighbourhood | None, member: int | None = None
) -> tuple[Scene, Columns, list[str]]:
    with opened_set(paths, reader.adapt) as files, naming(files.path), reading(files.path):
        notes = [line for line in str(files.attrs("openswim_notes")).split("\n") if line]
        if not files.dated:
            files.start_at(start_of_undated(None if around is None else around.lon))
            notes.append(f"times count from an unknown start: it is set to {iso(files.times[0])} UTC")
        times = [iso(each) for each in files.times]
        valid, told = files.go_to(time if files.dated or files.times.size > 1 else None, member)
        notes += told
        columns = Columns(files, around, notes)
        surface = _surface(columns)
        terrain = surface.get("surface_altitude")
        levels = levels_of(columns, terrain)
        grid = columns.laid.selection.grid(levels.height_m)
        if valid is None or (not files.dated and time is not None and files.times.size == 1):
            lon = None if grid.crs is None else float(grid.lonlat(*grid.centre_index)[0])
            valid = undated(time, lon, notes)
        fields: dict[str, Any] = {"air_pressure": levels.pressure_pa, "air_temperature": levels.temperature_k}
        fields |= _hydrometeors(columns, levels, grid, terrain)
        haze = _aerosol(columns, levels, terrain)
        fields |= haze.fields
        fields |= _wind(columns, grid) if winds_wanted() else {}
        columns.gaps.check(files.path, levels.height_m, terrain, notes)
        notes += files.lost(columns.read_names)
        _turn_wind(surface, columns, grid)
        _say_absent(columns, surface, fields, grid)
        atmosphere = Atmosphere.us_standard(aerosol=haze.background(grid.height_m, notes))
        if levels.specific_humidity is not None:
            vapour_kg_m3 = levels.specific_humidity * levels.density_kg_m3
            ground_m = 0.0 if terrain is None else terrain
            surface["precipitable_water"] = air.precipitable_water_kg_m2(vapour_kg_m3, levels.height_m, ground_m)
            atmosphere = air.with_vapour(atmosphere, np.asarray(grid.height_m), vapour_kg_m3)
        data, optics, cut = labelled(fields, surface), dict(haze.optics), columns.laid.selection.cut
        scene = Scene(grid, data, atmosphere, optics, valid, _source(files), notes, cut=cut)
    return scene, columns, times


def _hydrometeors(columns: Columns, levels: Levels, grid: Grid, terrain: F32 | None) -> dict[str, F32]:
    """Contents [kg m-3], numbers [m-3] and effective radii [m]."""
    fields: dict[str, F32] = {}
    kinds: dict[bool, str] = {}  # a variable by mass of air, and one by its volume
    q = 0.0 if levels.specific_humidity is None else levels.specific_humidity
    dry = (levels.density_kg_m3 * (1.0 - q)).astype(np.float32)
    for species, groups in CONTENTS.items():
        for quantity in groups:
            found = columns.find(quantity, PER_VOLUME)
            if found is None:
                continue
            if "called" not in found.attrs:  # else its reader has made it so
                kinds.setdefault(_is_per_volume(found), str(found.name))
            content = _content(columns, species, found, levels.density_kg_m3, dry)
            name = f"{species}_content"
            fields[name] = fields[name] + content if name in fields else content
    if len(kinds) > 1:
        columns.notes.append(f"{kinds[True]} is per volume of air and {kinds[False]} per mass: are both units right?")
    for species, quantity in NUMBERS.items():
        found = columns.find(quantity, ("m-3",))
        if found is not None and f"{species}_content" in fields and fields[f"{species}_content"].any():
            per_mass = canonical(str(found.attrs.get("units", ""))) == "kg-1"
            number = _sizes(columns, f"{species} number", found, "kg-1" if per_mass else "m-3")
            if number is not None:
                fields[f"{species}_number"] = number * (dry if per_mass else np.float32(1))
    for species, quantity in RADII.items():
        found = columns.find(quantity)
        if found is not None and f"{species}_content" in fields and fields[f"{species}_content"].any():
            radius = _sizes(columns, f"{species} radius", found, "m")
            if radius is not None:
                fields[f"{species}_effective_radius"] = radius
    cover = columns.find(STATE["cloud_fraction"])
    if cover is not None:
        share = columns.cloud("cloud_fraction", cover, "1")
        _by_cover(columns, levels, grid, terrain, share, fields)
    elif grid.crs is not None and levels.specific_humidity is not None and min(grid.spacing_m()) > WIDE_CELL_M:
        _cover_of_wide_cells(columns, levels, fields)
    if not any(f"{species}_content" in fields and fields[f"{species}_content"].any() for species in HYDROMETEORS):
        columns.notes.append("all cloud and precipitation fields are zero or absent: a clear sky")
    return fields


def _is_per_volume(found: xr.DataArray) -> bool:
    return canonical(str(found.attrs.get("units", ""))) in ("kg m-3", "g m-3", "mg m-3", "ug m-3")


def _content(columns: Columns, species: str, found: xr.DataArray, density: F32, dry: F32) -> F32:
    """One variable as mass per volume of air; what is missing below the terrain is none."""
    per_volume = _is_per_volume(found)
    spec = Variable("kg m-3" if per_volume else "kg kg-1", "", 0.0, 0.1, clip=True, hint="is it in g/kg?")
    values = columns.cloud(species, found, spec.units)
    values = checked_values(str(found.name), values, spec, columns.notes)
    if per_volume:
        return values
    said = str(found.attrs.get("standard_name", "")) + str(found.attrs.get("units", ""))
    mixing = str(found.name).startswith(_DRY_NAMES) or "mixing_ratio" in said or "dry" in said
    return values * (dry if mixing else density)


def _sizes(columns: Columns, what: str, found: xr.DataArray, units: str) -> F32 | None:
    """Numbers or radii; what is missing or negative is unknown (zero). None where they are unknown everywhere."""
    values = columns.read(what, found, units)
    return known_sizes(columns.used[what][-1], values, columns.notes)


def _by_cover(
    columns: Columns, levels: Levels, grid: Grid, terrain: F32 | None, cover: F32, fields: dict[str, F32]
) -> None:
    """Cloud fraction, and liquid where a file gives only that."""
    name = ", ".join(columns.used["cloud_fraction"])
    cover = np.clip(checked_values(name, cover, Variable("1", "", 0.0, 1.0, clip=True), columns.notes), 0, 1)
    if "liquid_content" not in fields and levels.specific_humidity is not None:
        ground = np.zeros(grid.shape[1:], np.float32) if terrain is None else terrain
        fields["liquid_content"] = liquid_from_cover(
            cover, levels.temperature_k, levels.specific_humidity, levels.pressure_pa, levels.height_m, ground
        )
        columns.notes.append(
            f"no liquid water in the file: a climatology of it (Hack 1998) where the cloud fraction ({name}) has cloud"
        )
    fields["cloud_area_fraction"] = cover


def _cover_of_wide_cells(columns: Columns, levels: Levels, fields: dict[str, F32]) -> None:
    """Cloud fraction of cells so wide that their water does not fill them, where the file has none."""
    water = [fields[f"{kind}_content"] for kind in ("liquid", "ice") if f"{kind}_content" in fields]
    if water and np.any(water):
        condensate = np.sum(water, axis=0) / levels.density_kg_m3
        fields["cloud_area_fraction"] = cover_from_humidity(
            condensate, levels.temperature_k, levels.pressure_pa, levels.specific_humidity, None
        )
        columns.notes.append(XU_RANDALL)


def _aerosol(columns: Columns, levels: Levels, terrain: F32 | None) -> Haze:
    """Aerosol species in the file."""
    humidity = None
    if levels.specific_humidity is not None:
        humidity = air.relative_humidity(levels.pressure_pa, levels.temperature_k, levels.specific_humidity)
    else:
        found = columns.get("relative_humidity")
        humidity = None if found is None else checked_values("relative humidity", found, RELATIVE, columns.notes)
    parts: list[AerosolPart] = []
    dims = {columns.laid.x_dim, columns.laid.y_dim, columns.z_dim}
    for f in columns.files:
        species = species_of_name(str(f.name))
        if species is None or set(f.dims) != dims:
            continue
        per_volume = canonical(str(f.attrs.get("units", "kg kg-1"))).endswith("m-3")
        units = "kg m-3" if per_volume else "kg kg-1"
        mass = columns.cloud("aerosol", f, units)
        mass = checked_values(str(f.name), mass, Variable(units, "", 0.0, 1e-3, clip=True), columns.notes)
        mass = mass if per_volume else mass * levels.density_kg_m3
        parts.append(part_of_mass(species, mass, humidity))
    if parts and humidity is None:
        columns.notes.append("no humidity in the file: aerosol is taken as dry")
    if not parts:
        return _aerosol_by_depth(columns, levels, terrain)
    return Haze(*added_up(parts), True)


def _aerosol_by_depth(columns: Columns, levels: Levels, terrain: F32 | None) -> Haze:
    """Aerosol of which the files have the optical depth alone."""
    depths: dict[str, F32] = {}
    for f in columns.files:
        kind = NAMES.get(str(f.name).lower())
        if kind is not None and kind not in depths and set(f.dims) == {columns.laid.x_dim, columns.laid.y_dim}:
            depth = columns.laid.read(columns.path, f.assign_attrs(units="1"), "1", True)
            columns.used.setdefault("aerosol", []).append(str(f.name))
            spec = Variable("1", "", 0.0, 50.0, clip=True)
            depths[kind] = checked_values(str(f.name), _over_gaps(columns, "aerosol", depth), spec, columns.notes)
    return Haze(*from_depths(depths, levels.height_m, terrain, columns.notes), True) if depths else Haze()


def _surface(columns: Columns) -> dict[str, F32]:
    """Terrain, land, snow, ice, albedo, wind and waves, as far as the files have them."""
    fields: dict[str, F32] = {}
    for name in ("surface_altitude", *FRACTIONS, "wind_east_10m", "wind_north_10m"):
        found = columns.ground(name, SURFACE[name])
        if found is not None:
            fields[name] = _over_gaps(columns, name, found)
    if "surface_altitude" not in fields:
        potential = columns.ground("surface_geopotential", SURFACE["surface_geopotential"])
        if potential is not None:
            potential = _over_gaps(columns, "surface_geopotential", potential)
            fields["surface_altitude"] = air.geometric_height_m(potential / air.GRAVITY)
    if "snow_area_fraction" not in fields:
        water = columns.ground("snow_water", SURFACE["snow_water"])
        if water is not None:
            water = _over_gaps(columns, "snow_water", water)
            fields["snow_area_fraction"] = np.clip(water / (1e-3 * SNOW_COVERS_KG_M2), 0.0, 1.0)
            columns.notes.append(f"snow cover from its water: {SNOW_COVERS_KG_M2:.0f} kg m-2 hide the ground")
    if "surface_albedo" in fields and not fields["surface_albedo"].min() > 0:
        del fields["surface_albedo"]
        columns.notes.append("the surface albedo is not filled in everywhere: that of the ground map")
    waves = columns.ground("wave_mean_square_slope", SURFACE["wave_mean_square_slope"])
    if waves is not None:  # missing over land and ice
        fields["wave_mean_square_slope"] = np.nan_to_num(waves)
    if ("wind_east_10m" in fields) != ("wind_north_10m" in fields):
        fields.pop("wind_east_10m", None)
        fields.pop("wind_north_10m", None)
    return fields


def _over_gaps(columns: Columns, what: str, field: F32) -> F32:
    """Fields of one medium are missing over the other (sea ice over land): none there."""
    lost = int(np.isnan(field).sum())
    if not lost:
        return field
    columns.notes.append(f"{columns.used[what][-1]} is missing at {lost} of {field.size} places: 0 there")
    return np.nan_to_num(field, nan=0.0)


def _turn_wind(surface: dict[str, F32], columns: Columns, grid: Grid) -> None:
    """Wind along the grid's axes (standard_name x_wind) to east and north."""
    east = columns.find(SURFACE["wind_east_10m"], on_levels=False)
    if "wind_east_10m" not in surface or east is None or not _along_axes(east):
        return
    surface |= air.wind_along_axes(surface["wind_east_10m"], surface["wind_north_10m"], grid.axis_angles)


def _wind(columns: Columns, grid: Grid) -> dict[str, F32]:
    """Wind on levels, toward east and north."""
    east, north = (columns.find(quantity) for quantity in WIND.values())
    if east is None or north is None:
        columns.notes.append("no wind on the levels of temperature and cloud in the file")
        return {}
    u, v = (air.filled_wind(columns.read("wind", each, "m s-1")) for each in (east, north))
    if not _along_axes(east):
        return {"wind_east": u, "wind_north": v}
    return air.wind_along_axes(u, v, grid.axis_angles, "")


def _along_axes(wind: xr.DataArray) -> bool:
    """Whether a wind counts along the grid's axes."""
    return wind.attrs.get("standard_name") in ("x_wind", "grid_eastward_wind")


def _say_absent(columns: Columns, surface: dict[str, F32], fields: dict[str, F32], grid: Grid) -> None:
    """One line for each thing the files lack: what is assumed instead."""
    flat = grid.crs is None
    columns.notes += no_species(fields) + _unsized(fields) + no_ground(surface, FLAT_INSTEAD if flat else INSTEAD)
    columns.notes += columns.unused()
    columns.notes += low_top(grid.height_m)
    if flat and "surface_albedo" not in surface:
        surface["surface_albedo"] = np.full(grid.shape[1:], 0.15, np.float32)


def _unsized(fields: dict[str, F32]) -> list[str]:
    """A note on species that there is something of, of unknown size."""
    return no_sizes({name for name, values in fields.items() if values.any()})


def _source(files: FileSet) -> str:
    said = [str(files.attrs(name)) for name in ("title", "source", "institution")]
    more = f" and {len(files.parts) - 1} more" if len(files.parts) > 1 else ""
    return f"{files.path.name}{more}: " + (next((text[:80] for text in said if text.strip()), "gridded CF file"))

