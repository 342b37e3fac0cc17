"""Heights, pressure and temperature of a gridded file's levels, by whatever the file gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.fields import air
from openswim.readers.fields.vapour import checked_humidity
from openswim.readers.gridded.columns import Columns
from openswim.readers.gridded.names import STATE, SURFACE

F32 = NDArray[np.float32]
_EXNER = 287.05 / 1004.6  # R/c_p


@dataclass
class Levels:
    """Heights (nz,) or (nz, ny, nx) above sea level, pressure, temperature and specific humidity (nz, ny, nx)."""

    height_m: NDArray[Any]
    pressure_pa: F32
    temperature_k: F32
    specific_humidity: F32 | None
    density_kg_m3: F32


def levels_of(columns: Columns, terrain_m: F32 | None) -> Levels:
    """The state of the air, levels turned upward; what was assumed goes to the notes."""
    notes = columns.notes
    axis_pa, axis_m = columns.profile(STATE["pressure"]), columns.profile(STATE["altitude"])
    _turn_up(columns, axis_pa, axis_m)
    axis_pa, axis_m = columns.profile(STATE["pressure"]), columns.profile(STATE["altitude"])
    humidity = columns.get("specific_humidity")
    pressure = _pressure(columns, axis_pa)
    height = _given_heights(columns, axis_m, pressure, terrain_m)
    temperature = columns.get("temperature")
    theta = columns.get("potential_temperature") if temperature is None else None
    if pressure is None and height is None:
        raise UserError(
            f"{columns.path}: neither heights nor pressures of the levels ({columns.z_dim}) are in the file: add "
            "geopotential, height or pressure"
        )
    if pressure is None:
        assert height is not None
        tall = height if height.ndim == 3 else np.broadcast_to(height[:, None, None], columns.shape)
        pressure, standard = air.standard_air(tall)
        notes.append("no pressure in the file: that of the US standard atmosphere")
    elif temperature is None and theta is None:
        notes.append("no temperature in the file: that of the US standard atmosphere")
        standard = air.standard_air(air.standard_height_m(pressure))[1]
    if theta is not None:
        temperature = theta * (pressure / np.float32(1e5)) ** np.float32(_EXNER)
        _finite(columns, "potential temperature", temperature)
    if temperature is None:
        temperature = standard
    _finite(columns, "pressure", pressure)
    _finite(columns, "temperature", temperature)
    if not pressure.min() > 0:
        raise UserError(f"{columns.path}: pressure is not positive everywhere: wrong units, or a damaged file")
    if humidity is not None:
        name = columns.used["specific_humidity"][-1]
        humidity = checked_humidity(name, humidity, temperature, pressure, notes)
    elif columns.find(STATE["relative_humidity"]) is None:
        notes.append("no humidity in the file: dry air")
    if height is None:
        height = _hydrostatic(columns, pressure, air.virtual_temperature_k(temperature, humidity), terrain_m)
    expected = air.density_kg_m3(pressure, temperature, humidity)
    density = _density(columns, expected)
    return Levels(_checked(columns, height), pressure, temperature, humidity, density)


def _density(columns: Columns, expected: F32) -> F32:
    """The file's own density, unless it is none; else that of pressure and temperature."""
    own = columns.get("density")
    if own is None:
        return expected
    _finite(columns, "density", own)
    share = float(np.median(own / expected))
    if not 0.8 < share < 1.25:
        raise UserError(
            f"{columns.path}: density ({columns.used['density'][-1]}) is {share:.3g} times that of its pressure and "
            "temperature: one of the three is in another unit, or damaged"
        )
    return own


def _turn_up(columns: Columns, axis_pa: NDArray[np.float64] | None, axis_m: NDArray[np.float64] | None) -> None:
    """Order the levels upward; repeated ones are dropped."""
    if axis_m is not None or axis_pa is not None:
        key = axis_m if axis_m is not None else -np.asarray(axis_pa)
        if not np.isfinite(key).all():
            raise UserError(f"{columns.path}: the levels ({columns.z_dim}) hold missing values: damaged file")
        order = np.unique(key, return_index=True)[1]
        if order.size < key.size:
            columns.notes.append(f"{key.size - order.size} repeated levels in the file: the first of each is used")
        columns.keep(order)
        return
    for what in ("altitude", "geopotential", "geopotential_height", "pressure"):
        found = columns.find(STATE[what])
        if found is not None:
            ends = columns.laid.read(columns.path, found.transpose(columns.z_dim, ...)[[0, -1]], STATE[what].units)
            means = [float(np.nanmean(end)) if np.isfinite(end).any() else np.nan for end in ends]
            if (means[0] > means[1]) != (what == "pressure"):
                columns.keep(np.arange(columns.levels.size)[::-1])
            return
    if columns.find(STATE["thickness"]) is not None:  # MERRA-2: from the top, unless said
        level = columns.files.get(columns.z_dim, ndim=1)
        if level is None or str(level.attrs.get("positive", "down")).lower() != "up":
            columns.keep(np.arange(columns.levels.size)[::-1])


def _pressure(columns: Columns, axis_pa: NDArray[np.float64] | None) -> F32 | None:
    field = columns.get("pressure")
    if field is not None:
        return field
    thickness = columns.get("thickness")
    if thickness is not None:  # upward: sum from the top, which MERRA-2 has at 1 Pa
        _finite(columns, "layer thickness", thickness)
        below = 1.0 + np.cumsum(thickness[::-1].astype(np.float64), axis=0)[::-1]
        return (below - 0.5 * thickness).astype(np.float32)
    if axis_pa is None:
        return None
    return np.broadcast_to(axis_pa.astype(np.float32)[:, None, None], columns.shape)


def _given_heights(
    columns: Columns, axis_m: NDArray[np.float64] | None, pressure: F32 | None, terrain_m: F32 | None
) -> NDArray[Any] | None:
    altitude = columns.find(STATE["altitude"])
    if altitude is not None:
        height = _grown_down(columns, columns.read("height", altitude, "m"), pressure)
        if altitude.attrs.get("standard_name") == "height" and terrain_m is not None:
            height = height + terrain_m
        return height
    geopotential = columns.find(STATE["geopotential"])
    if geopotential is not None:
        field = columns.read("height", geopotential, "m2 s-2")
        return air.geometric_height_m(_grown_down(columns, field, pressure) / air.GRAVITY)
    gph = columns.find(STATE["geopotential_height"])
    if gph is not None:
        return air.geometric_height_m(_grown_down(columns, columns.read("height", gph, "m"), pressure))
    if axis_m is None:
        return None
    level = columns.files.get(columns.z_dim, ndim=1)
    sigma = columns.files.get("sigma", ndim=1)
    if sigma is not None and sigma.dims == (columns.z_dim,):  # hybrid heights (UM): level_height + sigma * orography
        if terrain_m is None:
            columns.notes.append("hybrid heights without orography: levels as over the sea")
            return axis_m
        part = np.asarray(sigma.values, np.float64)[columns.levels]
        return (axis_m[:, None, None] + part[:, None, None] * terrain_m).astype(np.float32)
    if terrain_m is not None and level is not None and level.attrs.get("standard_name") == "height":
        return (axis_m[:, None, None] + terrain_m).astype(np.float32)
    return axis_m


def _grown_down(columns: Columns, height: F32, pressure: F32 | None) -> F32:
    """Heights with gaps at the bottom of columns continued downward.

    By the mean thickness of the layer elsewhere; where it is missing everywhere, by the thickness of the one above and
    the logarithm of pressure.
    """
    if not np.isnan(height).any():
        return height
    height = height.copy()
    steps = np.diff(height, axis=0)
    for level in range(height.shape[0] - 2, -1, -1):
        gap = np.isnan(height[level]) & np.isfinite(height[level + 1])
        if not gap.any():
            continue
        known = steps[level][np.isfinite(steps[level])]
        if known.size:
            thick = np.full(gap.shape, known.mean())
        elif pressure is not None and level + 2 < height.shape[0]:
            drop = np.log(pressure[level : level + 2] / pressure[level + 1 : level + 3])
            thick = (height[level + 2] - height[level + 1]) * drop[0] / drop[1]
        else:
            break
        height[level] = np.where(gap, height[level + 1] - thick, height[level])
    columns.notes.append("heights missing at the bottom of columns are continued downward")
    return height


def _hydrostatic(columns: Columns, pressure: F32, virtual_k: F32, terrain_m: F32 | None) -> F32:
    surface = columns.ground("surface_pressure", SURFACE["surface_pressure"])
    if surface is None or terrain_m is None:
        lowest = air.standard_height_m(pressure[0]).astype(np.float32)
        columns.notes.append("heights from pressure and temperature, the lowest level at its standard height")
    else:
        scale = air.DRY_GAS_CONSTANT / air.GRAVITY
        lowest = terrain_m + virtual_k[0] * np.float32(scale) * np.log(surface / pressure[0])
        columns.notes.append("heights from pressure and temperature above the model's ground")
    return air.hydrostatic_heights_m(pressure, virtual_k, lowest)


def _checked(columns: Columns, height: NDArray[Any]) -> NDArray[Any]:
    _finite(columns, "height", height)
    if height.shape[0] < 2:
        raise UserError(f"{columns.path}: only {height.shape[0]} level: a scene needs at least two")
    if not (np.diff(height, axis=0) > 0).all():
        wrong = int((np.diff(height, axis=0) <= 0).sum())
        raise UserError(
            f"{columns.path}: heights do not rise from level to level at {wrong} places: damaged geopotential or "
            "pressure, or levels out of order"
        )
    return height


def _finite(columns: Columns, what: str, field: NDArray[Any]) -> None:
    missing = int(field.size - np.isfinite(field).sum())
    if missing:
        raise UserError(
            f"{columns.path}: {what} has {missing} missing values (NaN or fill) of {field.size}: fill them, or crop "
            "the file to where it has data"
        )
