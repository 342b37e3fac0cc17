"""The columns of a GRIB file at one time: which levels there are, and the state of the air on them, upward."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.domain.selection import Selection
from openswim.readers.fields.air import (
    DRY_GAS_CONSTANT,
    GRAVITY,
    density_kg_m3,
    filled_from_above,
    geometric_height_m,
    hydrostatic_heights_m,
    saturation_pa,
    specific_humidity_of,
    standard_air,
    standard_height_m,
    virtual_temperature_k,
    without_gaps,
)
from openswim.readers.fields.vapour import RELATIVE, checked_humidity
from openswim.readers.grib.codes import CONTENT
from openswim.readers.grib.file import Field, GRIBFile
from openswim.readers.grib.grid import GribGrid
from openswim.scene.checks import checked_values
from openswim.scene.oddities.damage import copied_levels, held_values

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

LEVEL_KINDS = ("hybrid", "layer", "pressure", "height above ground", "height above sea", "sigma")
_MOST_MISSING = 0.9  # of a level's values


@dataclass
class Columns:
    """Fields of one time and one grid, read on a selection; each problem met on the way becomes one note."""

    file: GRIBFile
    fields: list[Field]
    layout: GribGrid
    selection: Selection
    kind: str  # of the levels
    notes: list[str]

    def read(self, one: Field) -> F32:
        """(ny, nx) of a field; NaN where missing."""
        values = self.file.values(one)
        return self.selection.read(lambda rows, columns: self.layout.window(values, rows, columns))

    def levels_of(self, name: str, kind: str | None = None) -> dict[float, Field]:
        """Fields of a quantity by level, the first where a level comes twice."""
        found: dict[float, Field] = {}
        for one in self.fields:
            if one.name == name and one.kind == (kind or self.kind) and one.instant:
                found.setdefault(one.level, one)
        return found

    def on_ground(self, name: str, kinds: Sequence[str] = ("surface",), instant: bool = True) -> F32 | None:
        """A field on the ground (or at 2 or 10 m); averages over time only where there is nothing else."""
        for wanted in (True, False) if not instant else (True,):
            for one in self.fields:
                if one.name == name and one.kind in kinds and one.instant == wanted:
                    return self.read(one)
        return None

    def tell_lacking(self, name: str, fields: dict[float, Field], levels: Sequence[float]) -> None:
        """A note on levels that have a temperature, but not this quantity."""
        lacking = [level for level in levels if level not in fields]
        if lacking:
            listed = ", ".join(f"{level:g}" for level in lacking[:6]) + " ..." * (len(lacking) > 6)
            self.notes.append(f"{name} is missing on {len(lacking)} of {len(levels)} levels ({listed}): none there")

    def tell_gaps(self, name: str, values: F32) -> F32:
        """Missing values as none, with a note."""
        gaps = int(np.isnan(values).sum())
        if not gaps:
            return values
        self.notes.append(f"{name}: {gaps} of {values.size} values are missing (bitmap, fill or NaN): none there")
        return np.nan_to_num(values)

    def stack(self, fields: dict[float, Field], levels: Sequence[float]) -> F32:
        """(nz, ny, nx) of a quantity on these levels; NaN on those it lacks."""
        out = np.empty((len(levels), *self.selection.shape), np.float32)
        for k, level in enumerate(levels):
            out[k] = self.read(fields[level]) if level in fields else np.nan
        self.notes += copied_levels(next(iter(fields.values())).name, out) if fields else []
        return out


@dataclass
class Air:
    """State of the air on levels upward, (nz, ny, nx), and the order of the file's levels."""

    levels: list[float]
    height_m: F32
    pressure_pa: F32
    temperature_k: F32
    density_kg_m3: F32
    dry_density_kg_m3: F32
    terrain_m: F32 | None
    buried: list[float]  # levels of the file that lie below the ground everywhere


def kind_and_grid(fields: list[Field]) -> tuple[str, bytes] | None:
    """The kind of level and the grid with most levels of condensate, else of temperature; None for flat files."""
    cloud: Counter[tuple[str, bytes]] = Counter()
    warm: defaultdict[tuple[str, bytes], set[float]] = defaultdict(set)  # levels, of which some may come twice
    for one in fields:
        if one.kind in LEVEL_KINDS and one.instant:
            cloud[one.kind, one.grid] += one.name.endswith(CONTENT)
            if one.name == "temperature":
                warm[one.kind, one.grid].add(one.level)
    known = [key for key in warm if len(warm[key]) >= 2]
    if not known:
        return None
    return max(known, key=lambda key: (cloud[key], len(warm[key]), -LEVEL_KINDS.index(key[0])))


def air_of(columns: Columns) -> Air:
    """Temperature, pressure and heights on all levels that have a temperature, whatever way the file gives them."""
    temperatures = columns.levels_of("temperature")
    upward = _ordered(columns, sorted(temperatures))
    temperature = columns.stack(temperatures, upward)
    upward, temperature = _above_ground(columns, upward, temperature)
    temperature = _completed(columns, "temperature", temperature)
    terrain = terrain_of(columns)
    surface_pa = _surface_pressure(columns)
    pressure = _pressure(columns, upward, temperature, surface_pa)
    humidity = _humidity(columns, upward, pressure, temperature)
    height = _heights(columns, upward, pressure, temperature, humidity, surface_pa, terrain)
    if pressure is None:
        pressure = _pressure_from_heights(columns, height, temperature, surface_pa, terrain)
        humidity = _humidity(columns, upward, pressure, temperature)
    density = density_kg_m3(pressure, temperature, humidity)
    _check_rising(columns, upward, height)
    dry = density if humidity is None else density * (1 - humidity)
    return Air(upward, height, pressure, temperature, density, dry, terrain, sorted(set(temperatures) - set(upward)))


def terrain_of(columns: Columns) -> F32 | None:
    """Height of the ground [m]; from geopotential height, geometric height or geopotential at the surface."""
    height = columns.on_ground("height", instant=False)
    if height is None:
        potential = columns.on_ground("geopotential", instant=False)
        if potential is None:  # IFS keeps it on the first model level
            potential = _lone_hybrid(columns, "geopotential")
        height = None if potential is None else potential / np.float32(GRAVITY)
    if height is not None and np.isnan(height).any():
        height = columns.tell_gaps("terrain height", height)
    return height


def _lone_hybrid(columns: Columns, name: str) -> F32 | None:
    fields = columns.levels_of(name, "hybrid")
    return columns.read(fields[1.0]) if list(fields) == [1.0] else None


def _ordered(columns: Columns, levels: list[float]) -> list[float]:
    """Levels from the ground up."""
    kind = columns.kind
    if kind in ("pressure", "sigma"):
        return levels[::-1]
    if kind.startswith("height"):
        return levels
    for name in ("pressure", "height", "geopotential"):
        own = columns.levels_of(name)
        both = [level for level in levels if level in own]
        if len(both) >= 2:
            fall = columns.read(own[both[0]]) - columns.read(own[both[-1]])
            return levels if (np.nan_to_num(fall).sum() > 0) == (name == "pressure") else levels[::-1]
    return levels[::-1]  # where A and B, or the heights of interfaces, are numbered from the top


def _surface_pressure(columns: Columns) -> F32 | None:
    pressure = columns.on_ground("pressure")
    if pressure is None:
        logarithm = columns.on_ground("log_pressure")
        if logarithm is None:
            logarithm = _lone_hybrid(columns, "log_pressure")
        pressure = None if logarithm is None else np.exp(logarithm)
    if pressure is not None and not (np.isfinite(pressure).all() and pressure.min() > 2e4 and pressure.max() < 1.2e5):
        raise UserError(
            f"{columns.file.path}: surface pressure runs from {np.nanmin(pressure):.4g} to {np.nanmax(pressure):.4g} "
            "Pa, or is missing in places: damaged, or in other units"
        )
    columns.notes += [] if pressure is None else held_values("surface pressure", pressure[None])
    return pressure


def _pressure(columns: Columns, levels: list[float], temperature: F32, surface_pa: F32 | None) -> F32 | None:
    """Pressure [Pa] on levels; None where it must come from heights."""
    if columns.kind == "pressure":
        axis = np.asarray(levels, np.float32)[:, None, None]
        return np.broadcast_to(axis, temperature.shape)
    own = columns.levels_of("pressure")
    if all(level in own for level in levels):
        pressure = columns.stack(own, levels)
        return _completed(columns, "pressure", pressure)
    if columns.kind == "sigma" and surface_pa is not None:
        return np.asarray(np.asarray(levels, np.float32)[:, None, None] * surface_pa)
    if columns.kind != "hybrid":
        return None
    coefficients = columns.file.array(columns.levels_of("temperature")[levels[0]], "pv")
    half = coefficients.size // 2
    if surface_pa is None or half < 2:
        raise UserError(
            f"{columns.file.path}: hybrid levels without pressure: add surface pressure (sp or lnsp) and keep the "
            "vertical coordinate (PV) in the messages, or add pressure on levels"
        )
    a, b = coefficients[:half], coefficients[half:]
    if max(levels) > half - 1 or min(levels) < 1:
        raise UserError(f"{columns.file.path}: level {max(levels):.0f} of a vertical coordinate of {half - 1}: damaged")
    k = np.asarray(levels, int)
    at = 0.5 * (a[k - 1] + a[k]), 0.5 * (b[k - 1] + b[k])
    return np.asarray(at[0][:, None, None] + at[1][:, None, None] * surface_pa, np.float32)


def _humidity(columns: Columns, levels: list[float], pressure: F32 | None, temperature: F32) -> F32 | None:
    """Specific humidity [kg/kg]; zero where a level lacks it, None where the file does."""
    if pressure is None:
        return None
    for name in ("specific_humidity", "humidity_mixing_ratio", "relative_humidity"):
        fields = columns.levels_of(name)
        if not fields:
            continue
        columns.tell_lacking(name, fields, levels)
        found = columns.stack(fields, levels)
        lacking = sum(level not in fields for level in levels)
        gaps = without_gaps(found) - lacking * found[0].size
        if gaps:
            columns.notes.append(f"{name}: {gaps} missing values (bitmap, fill or NaN) taken as none")
        if name == "relative_humidity":
            found = checked_values(name, found, RELATIVE, columns.notes)
            return specific_humidity_of(found * saturation_pa(temperature - np.float32(273.15)), pressure)
        found = checked_humidity(name, found, temperature, pressure, columns.notes)
        return np.asarray(found / (1 + found) if name == "humidity_mixing_ratio" else found, np.float32)
    columns.notes.append("no humidity in the file: dry air assumed for density")
    return None


def _heights(
    columns: Columns, levels: list[float], pressure: F32 | None, temperature: F32, humidity: F32 | None,
    surface_pa: F32 | None, terrain: F32 | None,
) -> F32:  # fmt: skip
    """Heights above sea level [m]: the file's, else from interfaces, the level itself, or the hydrostatic equation."""
    for name in ("height", "geopotential"):
        own = columns.levels_of(name)
        if own and all(level in own for level in levels):
            found = columns.stack(own, levels)
            if name == "geopotential":
                found /= np.float32(GRAVITY)
            if columns.kind != "layer":  # geopotential metres; layers' are geometric
                found = geometric_height_m(found)
            if columns.kind == "pressure" and pressure is not None:
                _extend_down(found, pressure, temperature)
            return _completed(columns, "height", found)
    interfaces = columns.levels_of("height", "interface")
    if columns.kind == "layer" and all(level in interfaces and level + 1 in interfaces for level in levels):
        above, below = (columns.stack({k - n: f for k, f in interfaces.items()}, levels) for n in (0.0, 1.0))
        return _completed(columns, "height", 0.5 * (above + below))
    if columns.kind.startswith("height"):
        ground = np.zeros(columns.selection.shape, np.float32)
        if columns.kind == "height above ground":
            if terrain is None:
                columns.notes.append("no terrain height in the file: heights above ground taken above sea level")
            else:
                ground = terrain
        return np.asarray(np.asarray(levels, np.float32)[:, None, None] + ground, np.float32)
    if pressure is None:
        raise UserError(
            f"{columns.file.path}: levels without height or pressure: add the heights of the interfaces (HHL), the "
            "geopotential or the pressure"
        )
    columns.notes.append("heights of levels: hydrostatic, from temperature, humidity and pressure")
    virtual = virtual_temperature_k(temperature, humidity)
    return _hydrostatic(columns, pressure, virtual, surface_pa, terrain)


def _hydrostatic(columns: Columns, pressure: F32, virtual: F32, surface_pa: F32 | None, terrain: F32 | None) -> F32:
    nothing = np.zeros(columns.selection.shape, np.float32)
    if surface_pa is None:
        columns.notes.append("no surface pressure in the file: the lowest level lies as in the standard atmosphere")
        lowest = np.asarray(standard_height_m(pressure[0]), np.float32)
        return hydrostatic_heights_m(pressure, virtual, lowest)
    if terrain is None:
        columns.notes.append("no surface geopotential in the file: terrain from surface pressure, standard atmosphere")
        terrain = np.asarray(standard_height_m(surface_pa), np.float32)
    rise = hydrostatic_heights_m(pressure, virtual, nothing)
    log_p, log_s = np.log(pressure), np.log(surface_pa)
    # where the surface lies above the lowest level: linear in ln p; below it: with the lowest level's temperature
    at_surface = (log_p[0] - log_s) * np.float32(DRY_GAS_CONSTANT / GRAVITY) * virtual[0]
    for k in range(len(pressure) - 1):
        within = (log_s <= log_p[k]) & (log_s > log_p[k + 1])
        share = (log_p[k] - log_s) / (log_p[k] - log_p[k + 1])
        at_surface = np.where(within, rise[k] + share * (rise[k + 1] - rise[k]), at_surface)
    return hydrostatic_heights_m(pressure, virtual, (terrain - at_surface).astype(np.float32))


def _pressure_from_heights(
    columns: Columns, height: F32, temperature: F32, surface_pa: F32 | None, terrain: F32 | None
) -> F32:
    """Hydrostatic pressure on levels of known height and temperature, from the surface or the standard atmosphere."""
    columns.notes.append("no pressure on levels: hydrostatic, from height and temperature")
    if surface_pa is None or terrain is None:
        lowest = standard_air(height[0])[0]
    else:
        lowest = surface_pa * np.exp((terrain - height[0]) * np.float32(GRAVITY / DRY_GAS_CONSTANT) / temperature[0])
    scale = np.float32(DRY_GAS_CONSTANT / GRAVITY) * 0.5 * (temperature[1:] + temperature[:-1])
    fall = np.cumsum(np.diff(height, axis=0) / scale, axis=0)
    return np.asarray(lowest * np.exp(-np.concatenate([np.zeros_like(fall[:1]), fall])), np.float32)


def _above_ground(columns: Columns, levels: list[float], temperature: F32) -> tuple[list[float], F32]:
    """Without the lowest pressure levels that are missing nearly everywhere here: they lie below the ground."""
    shares = [float(np.isnan(one).mean()) for one in temperature]
    buried = next((k for k, share in enumerate(shares) if share <= _MOST_MISSING), len(levels))
    if columns.kind == "pressure" and 0 < buried < len(levels) - 1:
        columns.notes.append(f"{buried} pressure levels without data here, below the ground, are left out")
        levels, temperature, shares = levels[buried:], temperature[buried:], shares[buried:]
    for level, share in zip(levels, shares, strict=True):
        if share > _MOST_MISSING:
            raise UserError(
                f"{columns.file.path}: temperature on level {level:g} is missing at {100 * share:.0f} % of the points "
                "here: take another file, or another place"
            )
    return levels, temperature


def _extend_down(height: F32, pressure: F32, temperature: F32) -> None:
    """Heights missing below the ground: hydrostatic, with the temperature above them."""
    for k in range(len(height) - 2, -1, -1):
        gap = np.isnan(height[k]) & ~np.isnan(height[k + 1])
        fall = np.float32(DRY_GAS_CONSTANT / GRAVITY) * temperature[k + 1] * np.log(pressure[k] / pressure[k + 1])
        height[k][gap] = (height[k + 1] - fall)[gap]


def _completed(columns: Columns, name: str, values: F32) -> F32:
    """Gaps below the terrain take the value above them; whole columns without data the mean of their level."""
    columns.notes += held_values(name, values)
    gaps = sum(int(np.isnan(level).sum()) for level in values)
    if not gaps:
        return values
    values = filled_from_above(values)
    for one in values:
        hole = np.isnan(one)
        if hole.any() and not hole.all():
            one[hole] = one[~hole].mean()
    if np.isnan(values).any():
        raise UserError(f"{columns.file.path}: {name} is missing on a whole level: damaged, or a field is all bitmap")
    columns.notes.append(f"{name}: {gaps} missing values filled from the level above, or the level's mean")
    return values


def _check_rising(columns: Columns, levels: list[float], height: F32) -> None:
    if not all(np.isfinite(level).all() and np.abs(level).max() < 1e6 for level in height):
        raise UserError(f"{columns.file.path}: heights of levels are missing or absurd: damaged, or in other units")
    rises = np.array([(above - below).min() for below, above in pairwise(height)])
    k = int(np.argmin(rises))
    if not rises[k] > 0:
        raise UserError(
            f"{columns.file.path}: heights are not monotonic: level {levels[k + 1]:g} ({columns.kind}) lies up to "
            f"{-rises[k]:.0f} m below level {levels[k]:g}: damaged, or levels of two models in one file"
        )
