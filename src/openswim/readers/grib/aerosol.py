"""Aerosol of GRIB files: mixing ratios on levels (CAMS), smoke (HRRR), and optical depths of columns (GEFS, CAMS)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.readers.fields import air as of_air
from openswim.readers.fields.aerosol_beyond import Haze
from openswim.readers.fields.aerosol_by_depth import from_depths
from openswim.readers.fields.aerosol_species import DRY_SMOKE, SPECIES, AerosolPart, added_up, part_of_mass
from openswim.readers.grib.codes import DEPTH, MASS
from openswim.readers.grib.columns import Air, Columns
from openswim.readers.grib.fields import taken
from openswim.scene.checks import checked_values
from openswim.scene.variables import Variable

F32 = NDArray[np.float32]

SMOKE = "smoke: 4.5 m2/g at 550 nm, single-scattering albedo .94, on the background (Reid et al. 2005)"
_MOST_MASS = 1e-3  # per kg or m3; the densest smoke and dust have some 1e-5
_DEPTHS = Variable("1", "", 0.0, 50.0, clip=True, hint="a fill value, or another unit?")
_SMOKE_SCALE_M = 1000.0  # of smoke known only near the ground


def aerosol(columns: Columns, air: Air | None, height_m: NDArray[Any], terrain: F32 | None) -> Haze:
    """What a file knows of aerosol, the most exact of it: mass of species on levels, smoke, optical depths."""
    parts = [] if air is None else _masses(columns, air)
    if parts:
        return Haze(*added_up(parts), True)
    parts = [] if air is None else _smoke(columns, air)
    if parts:
        return Haze(*added_up(parts), False)
    depths = {}
    for kind in sorted({one.name.removeprefix(DEPTH) for one in columns.fields if one.name.startswith(DEPTH)}):
        depth = columns.on_ground(DEPTH + kind, ("column", "surface"))
        if depth is not None:
            name = f"optical depth of {kind}"
            depths[kind] = checked_values(name, columns.tell_gaps(name, depth), _DEPTHS, columns.notes)
    if depths:
        return Haze(*from_depths(depths, height_m, terrain, columns.notes), True)
    parts = _smoke_near_ground(columns, height_m, terrain)
    return Haze(*added_up(parts), False)


def kinds(columns: Columns) -> list[str]:
    """Kinds of aerosol in a file, for its description."""
    names = {one.name for one in columns.fields}
    found = {SPECIES[name.removeprefix(MASS)].kind for name in names if name.startswith(MASS)}
    found |= {name.removeprefix(DEPTH) for name in names if name.startswith(DEPTH)} - {"aerosol"}
    found |= {"smoke"} if "smoke_density" in names else set()
    return sorted(found) or ["aerosol"] * (DEPTH + "aerosol" in names)


def _masses(columns: Columns, air: Air) -> list[AerosolPart]:
    humidity: F32 | None = None
    parts = []
    for name in SPECIES:
        fields = columns.levels_of(MASS + name)
        if not fields:
            continue
        if humidity is None:
            moist = np.clip(1 - air.dry_density_kg_m3 / air.density_kg_m3, 0, None).astype(np.float32)
            humidity = of_air.relative_humidity(air.pressure_pa, air.temperature_k, moist)
        mass = _told(columns, name, fields, air, "kg kg-1") * air.density_kg_m3
        parts.append(part_of_mass(SPECIES[name], mass, humidity))
    return parts


def _told(columns: Columns, name: str, fields: dict[float, Any], air: Air, units: str) -> F32:
    """A quantity on levels, of mass; what is missing is none, and told."""
    columns.tell_lacking(name, fields, air.levels)
    return checked_values(name, taken(columns, name, fields, air.levels), _mass(units), columns.notes)


def _mass(units: str) -> Variable:
    return Variable(units, "", 0.0, _MOST_MASS, clip=True, hint="is it in micrograms?")


def _smoke(columns: Columns, air: Air) -> list[AerosolPart]:
    """Smoke on levels (HRRR-Smoke's mass density)."""
    fields = columns.levels_of("smoke_density")
    if not fields:
        return []
    return _smoke_part(columns, _told(columns, "smoke", fields, air, "kg m-3"))


def _smoke_near_ground(columns: Columns, height_m: NDArray[Any], terrain: F32 | None) -> list[AerosolPart]:
    """Smoke that is known only just above the ground (HRRR-Smoke's 8-m density)."""
    for one in columns.fields:
        if one.name == "smoke_density" and one.kind == "height above ground" and not columns.kind:
            values = columns.tell_gaps("smoke", columns.read(one))
            values = checked_values("smoke", values, _mass("kg m-3"), columns.notes)
            columns.notes.append(f"smoke is given at {one.level:g} m only: taken to thin upward by 1/e in 1 km")
            tall = height_m if height_m.ndim == 3 else height_m[:, None, None]
            above = np.maximum(tall - (np.float32(0) if terrain is None else terrain), np.float32(0))
            return _smoke_part(columns, values * np.exp(-above / np.float32(_SMOKE_SCALE_M)))
    return []


def _smoke_part(columns: Columns, density: F32) -> list[AerosolPart]:
    columns.notes.append(SMOKE)
    return [part_of_mass(DRY_SMOKE, density, None)]
