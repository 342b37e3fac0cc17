"""Columns of tables of stations: which quantity each has, by its name, and in which unit, by the brackets behind it."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import shown, written_number
from openswim.errors import UserError

F64 = NDArray[np.float64]

_NAMES = {  # how names begin or read; the first is what a column of ours is called
    "ghi": r"ghi|global (horiz|cmp22|psp)",
    "dni": r"dni|direct (normal|chp1|nip)",
    "dhi": r"dhi|diffuse (horiz|cm22|cmp22|psp|8-48)|diffuse$",
    "up": r"uw(_?sol(ar)?)?(_?\d+)?$",  # not of infrared light
    "temperature": r"temp(_air|_c)?$|(air )?temperature|deck dry bulb",
    "relative_humidity": r"rh$|rel(ative)?[ _]hum(idity)?",
    "pressure": r"(station )?press(ure)?",
}
_LIGHT = frozenset({"ghi", "dni", "dhi", "up"})
_NO_VALUES = frozenset({  # words of columns about a quantity
    "accumulated", "avail", "clear", "clearsky", "count", "dev", "err", "error", "etr", "flag", "flags", "max",
    "maximum", "min", "minimum", "model", "n", "qc", "quality", "sd", "sigma", "std", "stdev", "toa", "uncertainty",
    # units other than W/m2 that stand in the name, not in brackets
    "j", "jcm2", "jm2", "kj", "kjm2", "kw", "kwh", "kwhm2", "kwm2", "mj", "mjm2", "mv", "mw", "mwcm2", "volt", "wh",
    "whm2",
})  # fmt: skip
# what instruments of light have beside W/m2, and what is no slip of writing: sums, voltages, illuminance, quanta
_OTHER_UNITS = re.compile(
    r"[km]?w-?h(rs?|ours?)?([/m].*)?|[km]?j(oules?)?([/m].*)?|[mu]?v(olts?)?|k?lu?x|.*mol.*|1|-|%"
)
_UNLIKE, _BRIGHT_W_M2 = 0.1, 50.0  # instruments of one light are within .03 of their mean, by day
_THOUSANDS = re.compile(r"\s*-?[1-9]\d{0,2},\d{3}\s*")
_LACKING = -900.0  # below it values stand for none, in any unit
_FACTORS = {  # to SI, or of temperature the zero's offset as well; "" where no unit is written
    "light": {"": (1.0, 0.0), "w/m2": (1.0, 0.0), "wm-2": (1.0, 0.0), "kw/m2": (1e3, 0.0), "kwm-2": (1e3, 0.0)},
    "temperature": {"": (1.0, 273.15), "c": (1.0, 273.15), "k": (1.0, 0.0), "f": (5 / 9, 459.67 * 5 / 9)},
    "relative_humidity": {"": (0.01, 0.0), "%": (0.01, 0.0), "percent": (0.01, 0.0), "1": (1.0, 0.0)},
    "pressure": {"": (100.0, 0.0), "mbar": (100.0, 0.0), "mb": (100.0, 0.0), "hpa": (100.0, 0.0), "pa": (1.0, 0.0),
                 "kpa": (1e3, 0.0)},
}  # fmt: skip


def check_names(names: Sequence[str]) -> None:
    """Raise UserError where two columns that count have one name, in capitals or not: either could be meant."""
    plain = [_name_and_unit(name) for name in names]
    twice = [name for number, name in enumerate(names) if plain[number] in plain[:number] and _counts(name)]
    if twice:
        raise UserError(f"the column {shown(twice[0])} is there twice: remove one, or name them apart")


def _counts(column: str) -> bool:
    name, _ = _name_and_unit(column)
    return name == "utc" or any(re.match(pattern, name) for pattern in _NAMES.values())


def of_light(unit: str) -> float | None:
    """What a unit of irradiance is in W m-2; None: it is none."""
    found = _FACTORS["light"].get(_plain_unit(unit.lower()))
    return None if found is None else found[0]


def columns_of(columns: Mapping[str, Sequence[str]], quantity: str, decimal_commas: bool = False) -> F64 | None:
    """Values (columns, rows) in SI of all instruments of a quantity, or of the column that has its plain name; None:
    it has none. Columns about a quantity, or of a unit that is none of it, are no values of it."""
    units = _FACTORS["light" if quantity in _LIGHT else quantity]
    found: dict[str, tuple[float, float]] = {}
    for column in columns:
        name, unit = _name_and_unit(column)
        words = re.split(r"[^a-z0-9]+", name)
        if re.match(_NAMES[quantity], name) and _NO_VALUES.isdisjoint(words):
            if unit in units:
                found[column] = units[unit]
            elif quantity not in _LIGHT:  # of light there are sums and voltages beside
                raise UserError(f"the column {shown(column)} has a unit unknown of {quantity}: "
                                f"give one of {', '.join(filter(None, units))}")  # fmt: skip
    if plain := [column for column in found if _name_and_unit(column)[0] == quantity]:
        found = {column: found[column] for column in plain[:1]}
    elif quantity == "temperature" and len(found) > 1:
        first = next((column for column in found if "2m" in column), next(iter(found)))
        found = {first: found[first]}
    if not found:
        return None
    values = {column: _values(column, columns[column], decimal_commas) for column in found}
    if quantity == "relative_humidity":
        for column, given in values.items():
            if not _name_and_unit(column)[1] and 0 < np.nanmax(given, initial=0.0) <= 1:  # of which no air is so dry
                raise UserError(f"no more than {np.nanmax(given):g} % in the column {shown(column)}: is it a share? "
                                f"Write {column} [1] for its name")  # fmt: skip
    out = np.array([values[column] * factor + zero for column, (factor, zero) in found.items()])
    if quantity in _LIGHT:
        _check_alike(quantity, list(found), out)
    return out


def _check_alike(quantity: str, columns: Sequence[str], values: F64) -> None:
    """Raise UserError where columns (n, rows) that would be averaged are not of one light: a clear sky by a model, a
    tilted instrument, or one that has failed."""
    with np.errstate(invalid="ignore"):
        mean = values.mean(axis=0)
        bright = mean > _BRIGHT_W_M2
        if len(columns) < 2 or not bright.any():
            return
        off = np.median(np.abs(values[:, bright] / mean[bright] - 1), axis=1)
    if off.max() > _UNLIKE:
        listed, share = ", ".join(map(shown, columns)), round(100 * off.max())
        raise UserError(f"the columns {listed} are no instruments of one {quantity}: they differ by {share} % from "
                        f"their mean; remove what is none, or call the one that counts {quantity}")  # fmt: skip


def not_understood(columns: Iterable[str]) -> str:
    """What is to be told of columns of light in a unit that is not understood, which do not count."""
    lost = []
    for column in columns:
        name, unit = _name_and_unit(column)
        of_light = any(re.match(_NAMES[quantity], name) for quantity in _LIGHT)
        counts = of_light and _NO_VALUES.isdisjoint(re.split(r"[^a-z0-9]+", name))
        if counts and unit not in _FACTORS["light"] and not _OTHER_UNITS.fullmatch(unit):
            lost.append(shown(column))
    return f"left out for a unit that is not understood: {', '.join(lost)}; write W/m2 or kW/m2" if lost else ""


def _name_and_unit(column: str) -> tuple[str, str]:
    """In small letters; of brackets within, such as those of an instrument, only the last that are square or have a
    division or a power are a unit."""
    text = _plain_signs(column.strip().lower())
    found = re.fullmatch(r"(.*?)\s*(?:\[([^]]*)\]|\(([^)]*(?:/|-2)[^)]*)\))", text)
    if found is None:
        return text, ""
    return found[1], _plain_unit(found[2] or found[3] or "")


def _plain_unit(text: str) -> str:
    return re.sub(r"watts?", "w", re.sub(r"[\s.·^*]|deg|°", "", _plain_signs(text)))


def _plain_signs(text: str) -> str:
    """m⁻² as m-2."""
    return unicodedata.normalize("NFKC", text).replace("\N{MINUS SIGN}", "-")


def _values(column: str, texts: Sequence[str], decimal_commas: bool) -> F64:
    """Numbers; blank is none."""
    if decimal_commas and any("," in text for text in texts):
        texts = _with_points(column, texts)
    out = np.full(len(texts), np.nan)
    for row, text in enumerate(texts):
        try:
            out[row] = written_number(text) if text.strip() else np.nan
        except ValueError:
            remedy = "write a decimal point" if "," in text else "leave it empty where there is no value"
            raise UserError(f"{shown(text)} in the column {shown(column)} is no number: {remedy}") from None
    return np.where(out < _LACKING, np.nan, out)


def _with_points(column: str, texts: Sequence[str]) -> list[str]:
    """Decimal commas as points. Raises UserError where commas may divide thousands: all have three digits behind, and
    smaller numbers have none."""
    with_comma = [text for text in texts if "," in text]
    if len(with_comma) < sum(bool(text.strip()) for text in texts) and all(map(_THOUSANDS.fullmatch, with_comma)):
        raise UserError(f"{shown(with_comma[0])} in the column {shown(column)} may be {with_comma[0].replace(',', '')} "
                        f"or {with_comma[0].replace(',', '.')}: write a decimal point")  # fmt: skip
    return [text.replace(",", ".") for text in texts]
