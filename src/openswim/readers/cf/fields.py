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
from openswim.scene import Grid, Optics, plausible
from openswim.scene.aerosol import DEFAULT_AEROSOL, AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.cf import AEROSOL, FIELDS, PROFILES, VAPOUR_PROFILE
from openswim.scene.checks import WAVELENGTH_DIM, fill_below_ground
from openswim.scene.labels.units import STATE, converted, in_units
from openswim.scene.phase import by_wavelength, phases_from_dict
from openswim.scene.variables import DIRECT_PREFIX, is_known, variable

_NO_OPTICS = "attributes not as docs/scene-format.md describes"
_GLOBAL = ("openswim_layout", FIELDS, "earth_radius_m", "periodic_sides", "atmosphere")
_OPTICAL = (
    "phase_function", "single_scattering_albedo", "angstrom_exponent", "relative_extinction", "aerosol_type", "kind",
)  # fmt: skip
_OF_LAYERS = (*AerosolProfile.__dataclass_fields__, "aerosol_type")
_WORDS = ("aerosol_type", "name")  # attributes of layers that are no JSON
_ALIKE = 0.75


def fields_of(data: xr.Dataset, grid: Grid | None, notes: list[str]) -> xr.Dataset:
    """The known variables of an upright dataset at one time, in the units of a scene."""
    names = [str(name) for name in data.data_vars if is_known(str(name))]
    names.sort(key=lambda name: name not in STATE)  # mixing ratios need pressure and temperature
    fields: dict[str, xr.DataArray] = {}
    for name in names:
        expected = variable(name).units
        if "units" not in data[name].attrs and expected != "1":
            notes.append(f"{name} gives no units: taken as {expected}")
        fields[name] = in_units(name, data[name], expected, fields, notes)
    if grid is not None:
        fill_below_ground(fields, grid, notes)
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
    terrain = converted("surface_altitude", data["surface_altitude"].transpose("y", "x"), "m")
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
        columns[target] = converted(name, data[name], attributes["units"])
    if VAPOUR_PROFILE in data.variables:
        columns["vapour_kg_m3"] = converted(VAPOUR_PROFILE, data[VAPOUR_PROFILE], "kg m-3")
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


def _wavelengths(axis: xr.DataArray) -> NDArray[np.float64]:
    return np.asarray(converted(WAVELENGTH_DIM, axis, "nm"), dtype=np.float64)


def _json(name: str, attribute: str, text: Any) -> Any:
    try:
        return json.loads(text)
    except (TypeError, ValueError) as error:
        raise UserError(f"{name}: attribute {attribute} is not JSON: {str(text)[:60]!r}") from error


def _maybe_json(name: str, attribute: str, value: Any) -> Any:
    if isinstance(value, str):
        return _json(name, attribute, value)
    return value.item() if isinstance(value, np.generic) else value
