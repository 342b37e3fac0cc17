"""The fields of a file in the documented layout: units brought to SI, gaps below the terrain filled."""

from __future__ import annotations

import json
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.optics.aerosol import aerosol_optics, described_profile
from openswim.readers.common.base import naming
from openswim.readers.common.opening import reading
from openswim.readers.common.units import canonical, conversion, has_value
from openswim.scene import Grid, Optics, plausible
from openswim.scene.aerosol import DEFAULT_AEROSOL, AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.cf import AEROSOL, FIELDS, PROFILES, VAPOUR_PROFILE
from openswim.scene.checks import WAVELENGTH_DIM
from openswim.scene.phase import by_wavelength, phases_from_dict
from openswim.scene.variables import DIRECT_PREFIX, is_known, variable

DRY_AIR_GAS_CONSTANT = 287.0  # J kg-1 K-1
_PER_MASS = {"kg kg-1": ("kg m-3", 1.0), "g kg-1": ("kg m-3", 1e-3), "kg-1": ("m-3", 1.0)}
_NO_OPTICS = "attributes not as docs/scene-format.md describes"
_GLOBAL = ("openswim_layout", FIELDS, "earth_radius_m", "periodic_sides", "atmosphere")
_OPTICAL = (
    "phase_function", "single_scattering_albedo", "angstrom_exponent", "relative_extinction", "aerosol_type", "kind",
)  # fmt: skip
_OF_LAYERS = (*AerosolProfile.__dataclass_fields__, "aerosol_type")
_WORDS = ("aerosol_type", "name")  # attributes of layers that are no JSON
_ALIKE = 0.75
_STATE = ("air_pressure", "air_temperature")


def fields_of(data: xr.Dataset, grid: Grid | None, notes: list[str]) -> xr.Dataset:
    """The known variables of an upright dataset at one time, in the units of a scene."""
    names = [str(name) for name in data.data_vars if is_known(str(name))]
    names.sort(key=lambda name: name not in _STATE)  # mixing ratios need pressure and temperature
    fields: dict[str, xr.DataArray] = {}
    for name in names:
        fields[name] = _in_si(name, data[name], fields, notes)
    if grid is not None:
        _fill_below_ground(fields, grid, notes)
    coords: dict[str, Any] = {
        name: float(data[name])
        for name in ("latitude", "longitude")
        if name in data.variables and data[name].ndim == 0
    }
    if WAVELENGTH_DIM in data.variables:
        coords[WAVELENGTH_DIM] = _wavelengths(data[WAVELENGTH_DIM])
    return xr.Dataset(fields, coords=coords)


def optics_of(data: xr.Dataset) -> dict[str, Optics]:
    """Optical properties kept as attributes of extinction_<name> (and of aerosol_extinction)."""
    found = {}
    for name, field in data.data_vars.items():
        if str(name) != "aerosol_extinction" and not str(name).startswith(DIRECT_PREFIX):
            continue
        species = "aerosol" if str(name) == "aerosol_extinction" else str(name).removeprefix(DIRECT_PREFIX)
        if species == "aerosol" and not {"aerosol_type", "phase_function"} & set(field.attrs):
            continue
        with naming(str(name)), reading(str(name), _NO_OPTICS):
            found[species] = _optics(str(name), field.attrs)
    return found


def _optics(name: str, attributes: Mapping[Any, Any]) -> Optics:
    if "aerosol_type" in attributes:
        return aerosol_optics(str(attributes["aerosol_type"]))
    if "phase_function" not in attributes:
        raise UserError(
            f"{name} lacks the attribute phase_function, for example "
            '\'{"type": "henyey_greenstein", "g": 0.85}\', or aerosol_type, for example "dust"'
        )
    albedo = _maybe_json(name, "single_scattering_albedo", attributes.get("single_scattering_albedo", 1.0))
    if isinstance(albedo, dict):
        albedo = by_wavelength("single_scattering_albedo", albedo)
    phase = _json(name, "phase_function", attributes["phase_function"])
    exponent = attributes.get("angstrom_exponent")
    spectrum = attributes.get("relative_extinction")
    if spectrum is not None:
        spectrum = by_wavelength("relative_extinction", _json(name, "relative_extinction", spectrum))
    return Optics(albedo, phases_from_dict(phase), str(attributes.get("kind", "other")), exponent, spectrum)


def high_bottom(data: xr.Dataset, grid: Grid | None) -> list[str]:
    """What a scene of these fields will say of ground far below the lowest level."""
    if grid is None:
        return []
    if "surface_altitude" not in data:
        return plausible.high_bottom(grid.height_m[0], None)
    terrain = _converted("surface_altitude", data["surface_altitude"].transpose("y", "x"), "m")
    return plausible.high_bottom(grid.height_m[0], terrain)


def lost_fields(data: xr.Dataset) -> list[str]:
    """A note on fields that were written to a file of ours and are there no more."""
    lost = [name for name in str(data.attrs.get(FIELDS, "")).split() if name not in data.variables]
    listed = ", ".join(lost[:6]) + (" ..." if len(lost) > 6 else "")
    return [f"no {listed} any more, which the file was written with: lost, or left out?"] if lost else []


def misspelt(data: xr.Dataset) -> list[str]:
    """Notes on attributes that are not used, where one of a similar name would be."""
    looked_at: list[tuple[str, Mapping[Any, Any], tuple[str, ...]]] = [("", data.attrs, _GLOBAL)]
    for name, field in data.variables.items():
        if is_layer(str(name)):
            looked_at.append((f"{name}: ", field.attrs, _OF_LAYERS))
        elif name == "aerosol_extinction" or str(name).startswith(DIRECT_PREFIX):
            looked_at.append((f"{name}: ", field.attrs, _OPTICAL))
    return [
        f"{where}attribute {name} is not used: is {meant[0]} meant?"
        for where, attributes, known in looked_at
        for name in map(str, attributes)
        if name not in known and (meant := get_close_matches(name, known, 1, _ALIKE))
    ]


def atmosphere_of(data: xr.Dataset, notes: list[str]) -> Atmosphere | None:
    """The gas profile and background aerosol of the file; US standard unless it gives some or says "none"."""
    if "atmosphere" in data.attrs:
        if data.attrs["atmosphere"] != "none":
            raise UserError(f'attribute atmosphere is {shown(data.attrs["atmosphere"])}: "none", or leave it out')
        return None
    layers = [_layer(name, data[name].attrs) for name in _layer_names(data)]
    aerosol = layers or None
    if not any(name in data.variables for name in PROFILES):
        if aerosol is None:
            notes.append(f"gas and aerosol background: US standard atmosphere with {DEFAULT_AEROSOL}")
            return Atmosphere.us_standard()
        depth = sum(layer.optical_depth for layer in layers)
        notes.append(
            f"gas and aerosol background: US standard atmosphere with the file's aerosol, optical depth {depth:.3g}"
        )
        return Atmosphere.us_standard(aerosol=aerosol)
    lacking = [name for name in PROFILES if name not in data.variables]
    if lacking:
        raise UserError(
            f"the background profile lacks {', '.join(lacking)}: give all of {', '.join(PROFILES)}, or none"
        )
    columns = {}
    for name, (target, attributes) in PROFILES.items():
        columns[target] = _converted(name, data[name], attributes["units"])
    if VAPOUR_PROFILE in data.variables:
        columns["vapour_kg_m3"] = _converted(VAPOUR_PROFILE, data[VAPOUR_PROFILE], "kg m-3")
    return Atmosphere(**columns, aerosol=aerosol)


def _layer_names(data: xr.Dataset) -> list[str]:
    """Variables that describe layers of background aerosol, in order: aerosol_background, aerosol_background_2 ..."""
    names = [str(name) for name in data.variables if is_layer(str(name))]
    return sorted(names, key=lambda name: (len(name), name))


def is_layer(name: str) -> bool:
    """Whether a variable describes a layer of background aerosol."""
    return name == AEROSOL or name.startswith(f"{AEROSOL}_")


def _layer(name: str, attributes: Mapping[Any, Any]) -> AerosolProfile:
    with naming(name), reading(name, _NO_OPTICS):
        described = {
            key: value if key in _WORDS else _maybe_json(name, key, value)
            for key, value in attributes.items()
            if key in _OF_LAYERS
        }
        return described_profile(described)


def _in_si(name: str, field: xr.DataArray, state: dict[str, xr.DataArray], notes: list[str]) -> xr.DataArray:
    expected = variable(name).units
    found = field.attrs.get("units")
    if found is None:
        if expected != "1":
            notes.append(f"{name} gives no units: taken as {expected}")
        return field
    per_volume, factor = _PER_MASS.get(canonical(str(found)), ("", 0.0))
    if per_volume == expected:
        if not all(needed in state for needed in _STATE):
            raise UserError(
                f"{name} is in {shown(found)}: to make it {expected!r} the file must hold air_pressure "
                "and air_temperature, or convert it first"
            )
        notes.append(f"{name} converted from {found} with the density of dry air")
        pressure, temperature = (state[needed] for needed in _STATE)
        return field * (factor * pressure / (DRY_AIR_GAS_CONSTANT * temperature))
    return field.copy(data=_converted(name, field, expected))


def _converted(name: str, field: xr.DataArray, expected: str) -> NDArray[Any]:
    found = str(field.attrs.get("units", expected))
    factor = conversion(found, expected)
    if factor is None:
        raise UserError(f"{name} is in {shown(found)}; it must be in {expected!r}: convert it")
    if factor == (1.0, 0.0):
        return field.values
    precise = np.result_type(field.dtype, np.float32)  # whole numbers become fractions
    return (factor[0] * field.values.astype(np.float64) + factor[1]).astype(precise)


def _wavelengths(axis: xr.DataArray) -> NDArray[np.float64]:
    return np.asarray(_converted(WAVELENGTH_DIM, axis, "nm"), dtype=np.float64)


def _fill_below_ground(fields: dict[str, xr.DataArray], grid: Grid, notes: list[str]) -> None:
    """Missing values below the terrain are usual on height or pressure levels and matter to nothing."""
    if "surface_altitude" not in fields:
        return
    height = grid.height_m if grid.height_m.ndim == 3 else grid.height_m[:, None, None]
    ground = fields["surface_altitude"].transpose("y", "x").values
    for name, field in fields.items():
        if set(field.dims) != {"z", "y", "x"}:
            continue
        values = field.transpose("z", "y", "x").values
        gaps = ~has_value(values) & (height < ground)
        if not gaps.any():
            continue
        values = np.where(gaps, 0.0, values).astype(values.dtype)
        if name in _STATE:
            for level in range(values.shape[0] - 2, -1, -1):
                values[level] = np.where(gaps[level], values[level + 1], values[level])
        notes.append(f"{name}: {int(gaps.sum())} missing values below the terrain filled")
        fields[name] = xr.DataArray(values, dims=("z", "y", "x"))


def _json(name: str, attribute: str, text: Any) -> Any:
    try:
        return json.loads(text)
    except (TypeError, ValueError) as error:
        raise UserError(f"{name}: attribute {attribute} is not JSON: {str(text)[:60]!r}") from error


def _maybe_json(name: str, attribute: str, value: Any) -> Any:
    if isinstance(value, str):
        return _json(name, attribute, value)
    return value.item() if isinstance(value, np.generic) else value
