"""WRF output and input files (ARW core): wrfout, wrfinput, wrfrst subsets with the usual variable names."""

from __future__ import annotations

from pathlib import Path

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
    place_text,
)
from openswim.readers.common.clock import undated
from openswim.readers.common.members import member_numbers
from openswim.readers.common.opening import reading
from openswim.readers.fields.absent import SNOW_COVERS_KG_M2, low_top, no_ground, no_sizes
from openswim.readers.fields.aerosol_beyond import background_note
from openswim.readers.fields.air import precipitable_water_kg_m2, relative_humidity, wind_along_axes, with_vapour
from openswim.readers.fields.vapour import checked_humidity
from openswim.readers.wrf.file import MASS_LEVELS, STAGGERED_X, STAGGERED_Y, SURFACE, WRFFile
from openswim.readers.wrf.grid import PROJECTIONS, lowest_height_m, projection_kind, wrf_grid
from openswim.readers.wrf.particles import (
    AEROSOL,
    CATEGORIES,
    CONTENTS,
    EXPECTED,
    aerosol,
    aerosol_kinds,
    cover,
    cover_guess,
    hydrometeors,
)
from openswim.scene import Grid, Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.plausible import high_bottom

NEEDED = ("PH", "PHB", "P", "PB", "T")
_CALLED = {
    "surface_altitude": "HGT",
    "land_area_fraction": "LANDMASK or XLAND",
    "snow_area_fraction": "SNOWC",
    "sea_ice_area_fraction": "SEAICE",
    "surface_albedo": "ALBEDO",
    "wind_east_10m": "U10, V10",
}
SURFACE_FIELDS = ("HGT", "LANDMASK", "XLAND", "SNOWC", "SEAICE", "ALBEDO", "U10", "V10")

DRY_AIR_GAS_CONSTANT = 287.0  # J kg-1 K-1, these four as in WRF share/module_model_constants.F
VAPOUR_GAS_CONSTANT = 461.6
HEAT_CAPACITY = 7.0 * DRY_AIR_GAS_CONSTANT / 2.0
REFERENCE_PRESSURE_PA = 1e5
BASE_THETA_K = 300.0


class WRFReader:
    """Reads WRF files in any of its map projections."""

    name = "WRF"

    def detects(self, path: Path) -> bool:
        """True for netCDF files with WRF's staggered dimensions and its title or its geopotential."""
        try:
            with WRFFile(path) as file:
                gridded = file.size("south_north") and file.size("west_east") and file.size("bottom_top")
                titled = any(word in str(file.attr("TITLE", "")) for word in ("WRF", "REAL_EM"))
                return bool(gridded) and (titled or ("PH" in file and "PHB" in file))
        except UserError:
            return False

    def read(self, path: Path, time: Time = None, member: int | None = None) -> Scene:
        """The scene at one time of the file (default: its first), of one member; only that is read."""
        with WRFFile(path) as file, naming(path), reading(path):
            check_complete(file)
            notes: list[str] = []
            file.choose(member, notes)
            valid = file.go_to(time)
            grid = wrf_grid(file, notes)
            if valid is None:
                valid = _undated(file, time, grid, notes)
            levels, air, humidity, vapour_kg_m3 = air_of(file, notes)
            levels |= hydrometeors(file, air, notes)
            levels |= cover(file, min(grid.spacing_m()), levels, air, notes)
            haze = aerosol(file, air, humidity, notes)
            levels |= haze.fields
            if winds_wanted():
                levels |= _wind(file, grid, notes)
            surface = _surface(file, grid, notes)
            notes += _absences(file)
            notes += low_top(grid.height_m)
            atmosphere = Atmosphere.us_standard(aerosol=haze.background(grid.height_m, notes))
            if vapour_kg_m3 is not None:
                terrain = surface["surface_altitude"]
                surface["precipitable_water"] = precipitable_water_kg_m2(vapour_kg_m3, grid.height_m, terrain)
                atmosphere = with_vapour(atmosphere, grid.height_m, vapour_kg_m3)
            return Scene(
                grid,
                labelled(levels, surface),
                atmosphere,
                dict(haze.optics),
                time=valid,
                source=f"{path.name}: {str(file.attr('TITLE', 'WRF')).strip()}",
                notes=notes,
            )

    def times(self, path: Path) -> list[np.datetime64]:
        """Valid times of a file, UTC."""
        with WRFFile(path) as file, naming(path), reading(path):
            return list(file.times())

    def members(self, path: Path) -> set[int]:
        """Of an ensemble, by their own numbers."""
        with WRFFile(path) as file, naming(path), reading(path):
            return member_numbers(path, file.ensemble())

    def grid(self, path: Path, time: Time = None) -> Grid:
        """The grid at one time (nests move)."""
        with WRFFile(path) as file, naming(path), reading(path):
            check_complete(file)
            file.go_to(time)
            return wrf_grid(file, [])

    def describe(self, path: Path) -> SceneInfo:
        """Grid, times and contents of a file, from its header and the geopotential of the first time."""
        with WRFFile(path) as file, naming(path), reading(path):
            lacking = [name for name in NEEDED if name not in file]
            notes: list[str] = []
            file.choose(None, notes)
            times = [iso(time) for time in file.times()]
            grid = None if lacking else wrf_grid(file, notes)
            if grid is not None and not times:
                _undated(file, None, grid, notes)
            if grid is not None:
                cloudy = "QVAPOR" in file and ("QCLOUD" in file or "QICE" in file)
                guessed = cover_guess(file, min(grid.spacing_m())) if cloudy else None
                notes += [] if guessed is None else [guessed]
                notes += low_top(grid.height_m)
                notes += high_bottom(grid.height_m[0], file.field("HGT", SURFACE, "m") if "HGT" in file else None)
            notes += _absences(file)
            notes.append(background_note(aerosol_kinds(file)))
            extent = covered_text(grid)
            if grid is not None and len(times) > 1:  # nests move
                file.go_to(times[-1])
                last = covered_text(wrf_grid(file, []))
                extent += f" at first, {last} at last: it moves" if last != extent else ""
            kind = projection_kind(file)
            nx, ny, nz = (file.size(dim) for dim in ("west_east", "south_north", "bottom_top"))
            everything = (*NEEDED, "QVAPOR", *EXPECTED, *SURFACE_FIELDS)
            return SceneInfo.on(
                grid,
                path=str(path),
                model=str(file.attr("TITLE", "WRF")).strip(),
                grid=f"{nx} x {ny} x {nz} (x, y, z)",
                projection=PROJECTIONS[kind] + place_text(grid),
                times=times,
                extent=extent,
                species=[f"{species} ({name})" for name, species in CONTENTS.items() if name in file]
                + [f"aerosol ({name})" for name in AEROSOL if name in file],
                surface=[name for name in SURFACE_FIELDS if name in file],
                missing=[name for name in everything if name not in file],
                assumed=notes,
            )


def _undated(file: WRFFile, time: Time, grid: Grid, notes: list[str]) -> np.datetime64:
    """The time of a file without dates."""
    if file.size("Time") > 1:
        notes.append(f"{file.size('Time')} times without dates in the file: the first is taken")
    return undated(time, float(grid.lonlat(*grid.centre_index)[0]) if grid.curved else None, notes)


def check_complete(file: WRFFile) -> None:
    """Raise UserError where heights, pressure or temperature are missing."""
    lacking = [name for name in NEEDED if name not in file]
    if lacking:
        raise UserError(
            f"{file.path}: a WRF file without {', '.join(lacking)}, needed for heights, pressure and "
            "temperature: keep these variables when cutting the file"
        )


def air_of(
    file: WRFFile, notes: list[str]
) -> tuple[dict[str, NDArray[np.float32]], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32] | None]:
    """Pressure [Pa] and temperature [K] as scene variables, the density of dry air [kg m-3], relative humidity, and the
    density of vapour where the file has it.

    Density includes the vapour: rho_d = p/(R_d T (1 + r_v R_v/R_d)).
    """
    pressure = file.field("P", MASS_LEVELS, "Pa") + file.field("PB", MASS_LEVELS, "Pa")
    if not pressure.min() > 0:
        raise UserError("P + PB is not positive everywhere: wrong units, or a damaged file")
    theta = file.field("T", MASS_LEVELS, "K") + np.float32(BASE_THETA_K)
    temperature = theta * (pressure / np.float32(REFERENCE_PRESSURE_PA)) ** np.float32(
        DRY_AIR_GAS_CONSTANT / HEAT_CAPACITY
    )
    vapour = np.zeros_like(pressure)
    if "QVAPOR" in file:
        given = file.field("QVAPOR", MASS_LEVELS, "kg kg-1")
        vapour = checked_humidity("QVAPOR", given, temperature, pressure, notes)
    moist = 1.0 + vapour * np.float32(VAPOUR_GAS_CONSTANT / DRY_AIR_GAS_CONSTANT)
    dry_density = (pressure / (DRY_AIR_GAS_CONSTANT * temperature * moist)).astype(np.float32)
    humidity = relative_humidity(pressure, temperature, (vapour / (1 + vapour)).astype(np.float32))
    own = vapour * dry_density if "QVAPOR" in file else None
    return {"air_pressure": pressure, "air_temperature": temperature}, dry_density, humidity, own


def _surface(file: WRFFile, grid: Grid, notes: list[str]) -> dict[str, NDArray[np.float32]]:
    """Terrain, land, snow, ice, albedo and wind, as far as the file has them."""
    fields: dict[str, NDArray[np.float32]] = {}
    for name, target, units in (
        ("HGT", "surface_altitude", "m"),
        ("SNOWC", "snow_area_fraction", ""),
        ("SNOWH", "snow_depth", "m"),
        ("SEAICE", "sea_ice_area_fraction", ""),
    ):
        if name in file:
            fields[target] = file.field(name, SURFACE, units)
    if "HGT" not in file:
        fields["surface_altitude"] = lowest_height_m(file)
        notes.append("no HGT in the file: terrain height from the geopotential of the lowest level")
    if "SNOWC" not in file and "SNOW" in file:
        fields["snow_area_fraction"] = np.clip(file.field("SNOW", SURFACE, "kg m-2") / SNOW_COVERS_KG_M2, 0.0, 1.0)
        notes.append(f"snow cover from SNOW: {SNOW_COVERS_KG_M2:.0f} kg m-2 hide the ground")
    if "LANDMASK" in file:
        fields["land_area_fraction"] = file.field("LANDMASK", SURFACE)
    elif "XLAND" in file:
        fields["land_area_fraction"] = 2.0 - file.field("XLAND", SURFACE)
    if "ALBEDO" in file:
        albedo = file.field("ALBEDO", SURFACE)
        if albedo.min() > 0:
            fields["surface_albedo"] = albedo
        else:
            notes.append("ALBEDO is not filled in at this time: surface albedo from the ground map")
    if "U10" in file and "V10" in file:
        u, v = file.field("U10", SURFACE, "m s-1"), file.field("V10", SURFACE, "m s-1")
        fields |= wind_along_axes(u, v, grid.axis_angles)
    return fields


def _wind(file: WRFFile, grid: Grid, notes: list[str]) -> dict[str, NDArray[np.float32]]:
    """Wind on mass levels: the mean of both sides of a cell, turned from the grid's axes."""
    if "U" not in file or "V" not in file:
        notes.append("no U, V in the file: no wind on levels")
        return {}
    u, v = file.field("U", STAGGERED_X, "m s-1"), file.field("V", STAGGERED_Y, "m s-1")
    u, v = np.float32(0.5) * (u[..., 1:] + u[..., :-1]), np.float32(0.5) * (v[:, 1:] + v[:, :-1])
    return wind_along_axes(u, v, grid.axis_angles, "")


def _absences(file: WRFFile) -> list[str]:
    """One line for each thing the file lacks: what is assumed instead."""
    notes = []
    if "QVAPOR" not in file:
        notes.append("no QVAPOR in the file: dry air assumed for density")
    absent = {name: CONTENTS[name] for name in EXPECTED if name not in file}
    if absent:
        notes.append(f"no {', '.join(absent)} in the file: no {', '.join(absent.values())} assumed")
    present = {f"{species}_content" for name, species in CONTENTS.items() if name in file}
    present |= {
        f"{species}_number"
        for species, kinds in CATEGORIES.items()
        if any(name in file for _, *sizes in kinds for names in sizes for name in names)
    }
    notes += no_sizes(present)
    known = {
        "surface_altitude": True,  # if need be from the geopotential
        "land_area_fraction": "LANDMASK" in file or "XLAND" in file,
        "snow_area_fraction": "SNOWC" in file or "SNOW" in file,
        "sea_ice_area_fraction": "SEAICE" in file,
        "surface_albedo": "ALBEDO" in file,
        "wind_east_10m": "U10" in file and "V10" in file,
    }
    return notes + no_ground([name for name, there in known.items() if there], called=_CALLED)
