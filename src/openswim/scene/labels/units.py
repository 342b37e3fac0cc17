"""The few unit conversions that files and labelled arrays may need, without a unit library."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError

STATE = ("air_pressure", "air_temperature")
DRY_AIR_GAS_CONSTANT = 287.0  # J kg-1 K-1
_PER_MASS = {"kg kg-1": ("kg m-3", 1.0), "g kg-1": ("kg m-3", 1e-3), "kg-1": ("m-3", 1.0)}

_UNNAMED_FILL = -9999.0

# canonical unit: {spelling: (factor, offset)}
_CONVERSIONS: dict[str, dict[str, tuple[float, float]]] = {
    "kg m-3": {"g m-3": (1e-3, 0.0), "mg m-3": (1e-6, 0.0), "ug m-3": (1e-9, 0.0)},
    "m": {"km": (1e3, 0.0), "cm": (1e-2, 0.0), "mm": (1e-3, 0.0), "um": (1e-6, 0.0), "gpm": (1.0, 0.0)},
    "nm": {"um": (1e3, 0.0), "m": (1e9, 0.0)},
    "m-3": {"cm-3": (1e6, 0.0), "l-1": (1e3, 0.0)},
    "m-1": {"km-1": (1e-3, 0.0), "Mm-1": (1e-6, 0.0)},
    "Pa": {"hPa": (1e2, 0.0), "mbar": (1e2, 0.0), "kPa": (1e3, 0.0)},
    "K": {"degC": (1.0, 273.15)},
    "1": {"%": (1e-2, 0.0)},
    "m s-1": {"km h-1": (1.0 / 3.6, 0.0), "knot": (1852.0 / 3600.0, 0.0)},
    "day": {"h": (1.0 / 24.0, 0.0), "s": (1.0 / 86400.0, 0.0)},
    "degrees": {},
    "kg kg-1": {"1": (1.0, 0.0), "g kg-1": (1e-3, 0.0), "mg kg-1": (1e-6, 0.0), "ug kg-1": (1e-9, 0.0)},
    "kg-1": {},
    "m2 s-2": {"gpm": (9.80665, 0.0)},
    "kg m-2 s-1": {},
    "W m-2 sr-1 nm-1": {
        "W m-2 nm-1 sr-1": (1.0, 0.0), "mW m-2 sr-1 nm-1": (1e-3, 0.0), "W m-2 sr-1 um-1": (1e-3, 0.0),
        "W m-2 um-1 sr-1": (1e-3, 0.0),
    },
}  # fmt: skip
_SPELLING = {
    "micron": "um",
    "microns": "um",
    "\u00b5m": "um",
    "\u03bcm": "um",
    "L-1": "l-1",
    "pascal": "Pa",
    "mb": "mbar",
    "millibar": "mbar",
    "millibars": "mbar",
    "hectopascals": "hPa",
    "degrees kelvin": "K",
    "kelvins": "K",
    "deg k": "K",
    "degk": "K",
    "kelvin": "K",
    "celsius": "degC",
    "degree_celsius": "degC",
    "degrees_celsius": "degC",
    "deg_c": "degC",
    "c": "degC",
    "percent": "%",
    "": "1",
    "-": "1",
    "none": "1",
    "fraction": "1",
    "fractional": "1",
    "(0 - 1)": "1",
    "proportion": "1",
    "boolean": "1",
    "dimensionless": "1",
    "degree": "degrees",
    "degrees_east": "degrees",
    "degree_east": "degrees",
    "degrees_north": "degrees",
    "degree_north": "degrees",
    "knots": "knot",
    "d": "day",
    "days": "day",
    "hours": "h",
    "seconds": "s",
    "kt": "knot",
}


_LONGEST = 200  # characters
_PREFIXES = {"": "", "kilo": "k", "centi": "c", "milli": "m", "micro": "u", "nano": "n"}
_TERMS = {
    "second": "s",
    "seconds": "s",
    "\u00b5g": "ug",
    "\u03bcg": "ug",
    "\u00b5m": "um",
    "\u03bcm": "um",
    **{
        f"{prefix}{word}{plural}": f"{short}{letter}"
        for prefix, short in _PREFIXES.items()
        for word, letter in {"meter": "m", "metre": "m", "gram": "g", "gramme": "g"}.items()
        for plural in ("", "s")
    },
}
_RAISED = str.maketrans(  # powers that stand above the line; and the sign of minus
    "\u207b\u2212\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079", "--0123456789"
)
_WORD = re.compile(r"^[A-Za-z\u00b5\u03bc]+")


def canonical(units: str) -> str:
    """One spelling of a unit: "kg/m^3", "kg/(m^3)", "kg m**-3" and "kg.m-3" all become "kg m-3"."""
    if len(units) > _LONGEST:  # no unit, and patience of its own
        return units[:_LONGEST]
    plain = units.strip().translate(_RAISED)
    text = re.sub(r"\*\*|\^", "", plain).replace(".", " ").replace("*", " ").replace("#", "1")
    above, _, below = text.partition("/")
    terms = [term for term in above.split() if term != "1"]
    terms += [
        re.sub(r"(\d*)$", lambda power: f"-{power[1] or 1}", term, count=1)
        for term in re.split(r"[ /()]+", below)
        if term
    ]
    terms = terms or ["1"]
    terms = [_WORD.sub(lambda word: _TERMS.get(word[0], _TERMS.get(word[0].lower(), word[0])), term) for term in terms]
    joined = " ".join(terms)
    return _SPELLING.get(joined, _SPELLING.get(joined.lower(), joined))


def conversion(found: str, expected: str) -> tuple[float, float] | None:
    """(factor, offset) so that expected = factor * found + offset; None where there is no such conversion."""
    plain = canonical(found)
    if plain == expected:
        return 1.0, 0.0
    return _CONVERSIONS.get(expected, {}).get(plain)


def has_value(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Where a field has values: numbers below 1e19, and not -9999, which says the same in files that name no fill."""
    return (np.abs(values) < 1e19) & (values != _UNNAMED_FILL)


def check_decimals(what: str, kind: str, units: str) -> None:
    """UserError where a ratio, density or flux of water, far below 1, is stored in whole numbers (a NumPy kind)."""
    if kind in "iub" and units in ("kg kg-1", "kg m-3", "kg m-2 s-1"):
        raise UserError(
            f"{what} holds whole numbers, but {units} of water are far below one: its decimals or its scale_factor are "
            "lost: write it as floating-point numbers"
        )


def in_units(
    name: str, field: xr.DataArray, expected: str, state: Mapping[str, xr.DataArray], notes: list[str]
) -> xr.DataArray:
    """A field in the expected units, which it has where it says nothing; what is per mass of air needs the `state`."""
    found = str(field.attrs.get("units", expected))
    per_volume, factor = _PER_MASS.get(canonical(found), ("", 0.0))
    if per_volume != expected:
        return field.copy(data=converted(name, field, expected))
    if not all(needed in state for needed in STATE):
        raise UserError(
            f"{name} is in {shown(found)}: to make it {expected!r} give {' and '.join(STATE)} too, or convert it first"
        )
    notes.append(f"{name} converted from {found} with the density of dry air")
    pressure, temperature = (state[needed] for needed in STATE)
    return field * (factor * pressure / (DRY_AIR_GAS_CONSTANT * temperature))


def converted(name: str, field: xr.DataArray, expected: str) -> NDArray[Any]:
    """The values of a field in the expected units, which it has where it says nothing."""
    found = str(field.attrs.get("units", expected))
    factor = conversion(found, expected)
    if factor is None:
        raise UserError(f"{name} is in {shown(found)}; it must be in {expected!r}: convert it")
    if factor == (1.0, 0.0):
        return field.values
    precise = np.result_type(field.dtype, np.float32)  # whole numbers become fractions
    return (factor[0] * field.values.astype(np.float64) + factor[1]).astype(precise)
