"""What a GRIB file's columns hold for a scene: condensate by species, and the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.fields.absent import SNOW_COVERS_KG_M2
from openswim.readers.fields.air import filled_wind, wind_along_axes, without_gaps
from openswim.readers.fields.cover import WIDE_CELL_M, XU_RANDALL, cover_from_humidity
from openswim.readers.fields.particles import known_sizes
from openswim.readers.grib.codes import CONTENT, FNMOC, NCEP, NUMBER, RADIUS, TOTAL
from openswim.readers.grib.columns import Air, Columns
from openswim.readers.grib.file import Field
from openswim.scene.oddities.damage import held_values
from openswim.scene.variables import HYDROMETEORS

F32 = NDArray[np.float32]

COVER = "cloud cover"
_LIQUID, _ICE = f"liquid_{CONTENT}", f"ice_{CONTENT}"
_HRRR_RAP = (83, 105)  # NCEP's generating processes: their cloud water is water alone
SPLIT = "one cloud condensate in the file: split by temperature, all liquid above 0 degC, all ice below -20 degC"
_PACKED = 0.005  # beyond a fraction's range, where bits are few
_SNOW_DEPTH_COVERS = 0.1  # m, ECMWF's HTESSEL


def condensate(columns: Columns, air: Air) -> dict[str, F32]:
    """Contents [kg m-3], numbers [m-3] and effective radii [m] on levels, as scene variables."""
    found: dict[str, F32] = {}
    for name in (TOTAL, *(f"{species}_{CONTENT}" for species in HYDROMETEORS)):
        fields = columns.levels_of(name)
        if fields:
            found[name] = _per_volume(columns, air, name, fields)
    _split(columns, air, found)
    for species in HYDROMETEORS:
        for suffix in (NUMBER, RADIUS):
            name = f"{species}_{suffix}"
            fields = columns.levels_of(name)
            if not fields or f"{species}_{CONTENT}" not in found:
                continue
            values = known_sizes(name, _per_volume(columns, air, name, fields), columns.notes)
            if values is not None:
                found[name] = values
    _cover(columns, air, found)
    if found and not any(values.any() for name, values in found.items() if name.endswith(CONTENT)):
        columns.notes.append("all cloud and precipitation fields are zero: a clear sky")
    return found


def _cover(columns: Columns, air: Air, found: dict[str, F32]) -> None:
    """Cloud fraction of the levels; where a file of wide cells has none, from its humidity."""
    fields = columns.levels_of("cloud_cover")
    if fields:
        columns.tell_lacking(COVER, fields, air.levels)
        values = taken(columns, COVER, fields, air.levels)
        if float(values.max(initial=0.0)) > 1.01 or float(values.min(initial=0.0)) < -0.01:
            raise UserError(f"{columns.file.path}: cloud cover to {float(np.abs(values).max()):g}: wrong units")
        found["cloud_area_fraction"] = _fraction(columns, COVER, values)
        return
    water = [found[name] for name in (_LIQUID, _ICE) if name in found]
    if cover_is_guessed(columns, air) and np.any(water):
        given = columns.levels_of("relative_humidity")
        relative = columns.stack(given, air.levels) if given else None
        humidity = 1 - air.dry_density_kg_m3 / air.density_kg_m3
        condensate = np.sum(water, axis=0) / air.density_kg_m3
        found["cloud_area_fraction"] = cover_from_humidity(
            condensate, air.temperature_k, air.pressure_pa, humidity, relative
        )
        columns.notes.append(XU_RANDALL)


def cover_is_guessed(columns: Columns, air: Air) -> bool:
    """Whether cloud fraction follows from humidity: none in the file, whose cells are wide."""
    humid = air.dry_density_kg_m3 is not air.density_kg_m3
    wide = min(columns.layout.mesh.grid().spacing_m()) > WIDE_CELL_M
    return humid and wide and not columns.levels_of("cloud_cover")


def _per_volume(columns: Columns, air: Air, name: str, fields: dict[float, Field]) -> F32:
    outside = sorted(set(fields) - set(air.levels) - set(air.buried))
    if len(outside) > 0.2 * len(fields):
        raise UserError(
            f"{columns.file.path}: {name} is on {len(fields)} levels, of which {len(outside)} have no temperature: "
            "keep all levels of both when cutting the file"
        )
    if outside:
        listed = ", ".join(f"{level:g}" for level in outside)
        columns.notes.append(f"{name} on levels {listed} is left out: no temperature there")
    columns.tell_lacking(name, fields, air.levels)
    values = taken(columns, name, fields, air.levels)
    per = next(iter(fields.values())).meaning.per
    if name.endswith(RADIUS) or per == "volume":
        return values
    return np.multiply(values, air.dry_density_kg_m3 if per == "dry" else air.density_kg_m3, out=values)


def taken(columns: Columns, name: str, fields: dict[float, Field], levels: Sequence[float]) -> F32:
    """A quantity on levels, zero where it is missing; a note says where a level that the file has holds gaps."""
    values = columns.stack(fields, levels)
    gaps = without_gaps(values) - sum(level not in fields for level in levels) * values[0].size
    if gaps:
        columns.notes.append(f"{name}: {gaps} missing values (bitmap, fill or NaN) taken as none")
    if name != COVER:  # of which many nodes have all that there can be
        columns.notes += held_values(name, values)
    return values


def of_both_phases(columns: Columns) -> str | None:
    """Name of a condensate that is liquid and ice in one; None where there is none, or ice by itself."""
    liquid = columns.levels_of(_LIQUID)
    if columns.levels_of(_ICE):
        return None
    if not liquid:
        return TOTAL if columns.levels_of(TOTAL) else None
    one = next(iter(liquid.values()))
    own_phase = one.meaning.per != "dry" or one.centre not in (NCEP, FNMOC)
    return None if own_phase or (one.centre == NCEP and one.process in _HRRR_RAP) else _LIQUID


def _split(columns: Columns, air: Air, found: dict[str, F32]) -> None:
    """One condensate for both phases: ice grows from none at 0 degC to all at -20 degC, as in the GFS's radiation."""
    name = of_both_phases(columns)
    total = None if name is None else found[name]
    found.pop(TOTAL, None)
    if total is not None:
        share = np.clip((np.float32(273.16) - air.temperature_k) * np.float32(0.05), 0.0, 1.0)
        found[_ICE], found[_LIQUID] = total * share, total * (1 - share)
        columns.notes.append(SPLIT)


def ground(columns: Columns, terrain: F32 | None) -> dict[str, F32]:
    """Terrain, land, snow, ice, albedo, wind and waves, as far as the file has them."""
    found: dict[str, F32] = {}
    if terrain is not None:
        found["surface_altitude"] = terrain
    for name, target in (("land", "land_area_fraction"), ("sea_ice", "sea_ice_area_fraction")):
        values = columns.on_ground(name, instant=False)
        if values is not None:
            found[target] = _fraction(columns, target, columns.tell_gaps(target, values))
    snow = _snow(columns)
    if snow is not None:
        found["snow_area_fraction"] = snow
    albedo = columns.on_ground("albedo", instant=False)
    if albedo is not None and np.isfinite(albedo).all():
        if float(albedo.max()) < 0.0105:  # a fraction, though the parameter is in percent
            albedo = albedo * 100
        if float(albedo.min()) > 0.0:
            found["surface_albedo"] = np.clip(albedo, 0.0, 1.0)
        elif float(albedo.min()) == 0.0:  # a mean over hours of night
            columns.notes.append("albedo is zero where it was night: surface albedo from the ground map")
        else:
            raise UserError(f"{columns.file.path}: albedo to {float(albedo.min()):g}: damaged")
    elif albedo is not None:
        columns.notes.append("albedo is missing in places: surface albedo from the ground map")
    found |= _wind(columns)
    waves = columns.on_ground("wave_slope")
    if waves is not None:  # missing over land and ice
        found["wave_mean_square_slope"] = np.nan_to_num(waves)
    return found


def _snow(columns: Columns) -> F32 | None:
    for name, full in (("snow_cover", 1.0), ("snow_depth", _SNOW_DEPTH_COVERS), ("snow_water", SNOW_COVERS_KG_M2)):
        values = columns.on_ground(name)
        if values is None:
            continue
        if name == "snow_cover" and float(np.nanmax(values, initial=0.0)) < 0.0105:
            values = values * 100  # a fraction, though the parameter is in percent
        if name != "snow_cover":
            columns.notes.append(f"snow covers the ground fully from {full:g} {'m' if full < 1 else 'kg m-2'} on")
        values = columns.tell_gaps(name, values)
        return _fraction(columns, name, values if full == 1.0 else np.minimum(values / np.float32(full), 1.0))
    return None


def _fraction(columns: Columns, name: str, values: F32) -> F32:
    """A share of a cell or of the ground, from 0 to 1; a note where it is less or more than packing makes it."""
    if values.min() < -_PACKED or values.max() > 1 + _PACKED:
        columns.notes.append(
            f"{name} runs from {values.min():.3g} to {values.max():.3g}: none below 0, all above 1; a damaged field?"
        )
    return np.asarray(np.clip(values, 0.0, 1.0), np.float32)


def _wind(columns: Columns) -> dict[str, F32]:
    """10-m wind toward geographic east and north, turned where the file has it along the grid."""
    parts = []
    for name in ("wind_u", "wind_v"):
        fields = columns.levels_of(name, "height above ground") | columns.levels_of(name, "surface")
        one = fields.get(10.0, fields.get(0.0))
        if one is None:
            return {}
        parts.append(columns.read(one))
    u, v = parts
    if np.isnan(u).any() or np.isnan(v).any():
        columns.notes.append("10-m wind is missing in places: calm there")
        u, v = np.nan_to_num(u), np.nan_to_num(v)
    return wind_along_axes(u, v, _axis_angle(columns))


def wind(columns: Columns, air: Air) -> dict[str, F32]:
    """Wind on levels, toward east and north."""
    u, v = (columns.levels_of(name) for name in ("wind_u", "wind_v"))
    lacking = [level for level in air.levels if level not in u or level not in v]
    if 2 * len(lacking) > len(air.levels):
        columns.notes.append("no wind on most levels of the file: none is used")
        return {}
    east, north = (filled_wind(columns.stack(fields, air.levels)) for fields in (u, v))
    return wind_along_axes(east, north, _axis_angle(columns), "")


def _axis_angle(columns: Columns) -> NDArray[np.float64]:
    """By how much winds are to be turned, radians; 0 where the file has them toward east and north."""
    if columns.layout.wind_along_grid and not columns.layout.kind.startswith(("regular", "reduced")):
        own = columns.layout.mesh.grid()
        lon, lat = columns.selection.grid(np.array([0.0, 1.0])).lonlat(
            *np.meshgrid(np.arange(columns.selection.x.size), np.arange(columns.selection.y.size))
        )
        return own.axis_angle(*own.index(lon, lat))
    return np.zeros((1, 1))
