"""What the code numbers of GRIB parameters mean to a scene.

GRIB2 by discipline, category and number (WMO code table 4.2) and not by ecCodes' short names, which call several of
these "unknown"; GRIB1 by the table and number, of WMO, NCEP (ON388 table 2), ECMWF (128) and DWD (201).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Per = Literal["dry", "moist", "volume"]


@dataclass(frozen=True)
class Meaning:
    """A quantity: state and surface fields by name; condensate, numbers and radii by species.

    per : kg of dry air (mixing ratio), kg of moist air (specific content), or m3.
    factor : brings the file's unit to SI.
    """

    name: str
    per: Per = "dry"
    factor: float = 1.0


MASS, DEPTH = "mass of ", "depth of "  # of aerosol: mixing ratio of a species; optical depth at 550 nm of a kind
CONTENT, NUMBER, RADIUS = "content", "number", "effective_radius"
TOTAL = "total_content"  # liquid and ice in one


def _contents(codes: dict[int, tuple[str, Per]]) -> dict[tuple[int, int, int], Meaning]:
    return {(0, 1, n): Meaning(f"{species}_{CONTENT}", per) for n, (species, per) in codes.items()}


GRIB2: dict[tuple[int, int, int], Meaning] = {
    (0, 0, 0): Meaning("temperature"),
    (0, 1, 0): Meaning("specific_humidity"),
    (0, 1, 1): Meaning("relative_humidity", factor=0.01),
    (0, 1, 2): Meaning("humidity_mixing_ratio"),
    (0, 1, 11): Meaning("snow_depth"),
    (0, 1, 13): Meaning("snow_water"),
    (0, 1, 42): Meaning("snow_cover", factor=0.01),
    (0, 1, 60): Meaning("snow_water"),
    (0, 1, 121): Meaning("snow_cover"),
    (0, 1, 129): Meaning(f"liquid_{RADIUS}"),
    (0, 1, 130): Meaning(f"rain_{RADIUS}"),
    (0, 1, 131): Meaning(f"ice_{RADIUS}"),
    (0, 1, 132): Meaning(f"snow_{RADIUS}"),
    (0, 1, 133): Meaning(f"graupel_{RADIUS}"),
    (0, 2, 2): Meaning("wind_u"),
    (0, 2, 3): Meaning("wind_v"),
    (0, 3, 0): Meaning("pressure"),
    (0, 3, 4): Meaning("geopotential"),
    (0, 3, 5): Meaning("height"),
    (0, 3, 6): Meaning("height"),
    (0, 3, 25): Meaning("log_pressure"),
    (0, 6, 1): Meaning("cloud_cover", factor=0.01),
    (0, 6, 22): Meaning("cloud_cover", factor=0.01),
    (0, 6, 28): Meaning(f"liquid_{NUMBER}", "moist"),
    (0, 6, 29): Meaning(f"ice_{NUMBER}", "moist"),
    (0, 6, 30): Meaning(f"liquid_{NUMBER}", "volume"),
    (0, 6, 31): Meaning(f"ice_{NUMBER}", "volume"),
    (0, 6, 32): Meaning("cloud_cover"),
    (0, 14, 0): Meaning("ozone_column"),
    (0, 19, 1): Meaning("albedo", factor=0.01),
    (0, 20, 0): Meaning("smoke_density"),
    (0, 20, 2): Meaning("aerosol_mass"),  # of a species: see aerosol_meaning
    (0, 20, 102): Meaning("aerosol_depth"),
    (2, 0, 0): Meaning("land"),
    (10, 0, 20): Meaning("wave_slope"),
    (10, 2, 0): Meaning("sea_ice"),
} | _contents(
    {
        21: ("total", "dry"),
        22: ("liquid", "dry"),
        23: ("ice", "dry"),
        24: ("rain", "dry"),
        25: ("snow", "dry"),
        32: ("graupel", "dry"),
        71: ("graupel", "dry"),
        80: ("total", "dry"),
        82: ("ice", "dry"),
        83: ("liquid", "moist"),
        84: ("ice", "moist"),
        85: ("rain", "moist"),
        86: ("snow", "moist"),
        96: ("rain", "volume"),
        97: ("snow", "volume"),
        98: ("graupel", "volume"),
        149: ("liquid", "dry"),
    }
)
for _n, _species in enumerate(("rain", "snow", "graupel")):
    GRIB2[0, 1, 100 + _n] = Meaning(f"{_species}_{NUMBER}", "moist")
    GRIB2[0, 1, 104 + _n] = Meaning(f"{_species}_{NUMBER}", "volume")
# of the centre's own: (centre, discipline, category, number)
GRIB2_LOCAL: dict[tuple[int, int, int, int], Meaning] = {
    (7, 0, 14, 192): Meaning("ozone_mixing_ratio"),
}

_WMO: dict[int, Meaning] = {
    1: Meaning("pressure"),
    6: Meaning("geopotential"),
    7: Meaning("height"),
    8: Meaning("height"),
    10: Meaning("ozone_column"),
    11: Meaning("temperature"),
    33: Meaning("wind_u"),
    34: Meaning("wind_v"),
    51: Meaning("specific_humidity"),
    52: Meaning("relative_humidity", factor=0.01),
    53: Meaning("humidity_mixing_ratio"),
    65: Meaning("snow_water"),
    66: Meaning("snow_depth"),
    71: Meaning("cloud_cover", factor=0.01),
    81: Meaning("land"),
    84: Meaning("albedo", factor=0.01),
    91: Meaning("sea_ice"),
}
_NCEP: dict[int, Meaning] = _WMO | {
    153: Meaning("liquid_content"),
    170: Meaning("rain_content"),
    171: Meaning("snow_content"),
    178: Meaning("ice_content"),
    179: Meaning("graupel_content"),
    238: Meaning("snow_cover", factor=0.01),
}
_ECMWF: dict[int, Meaning] = {
    31: Meaning("sea_ice"),
    54: Meaning("pressure"),
    75: Meaning("rain_content", "moist"),
    76: Meaning("snow_content", "moist"),
    129: Meaning("geopotential"),
    130: Meaning("temperature"),
    131: Meaning("wind_u"),
    132: Meaning("wind_v"),
    133: Meaning("specific_humidity"),
    134: Meaning("pressure"),
    141: Meaning("snow_water", factor=1000.0),  # metres of water
    152: Meaning("log_pressure"),
    156: Meaning("height"),
    157: Meaning("relative_humidity", factor=0.01),
    165: Meaning("wind_u"),
    166: Meaning("wind_v"),
    172: Meaning("land"),
    174: Meaning("albedo"),
    243: Meaning("albedo"),
    246: Meaning("liquid_content", "moist"),
    247: Meaning("ice_content", "moist"),
    248: Meaning("cloud_cover"),
}
_DWD: dict[int, Meaning] = {
    29: Meaning("cloud_cover", factor=0.01),
    31: Meaning("liquid_content", "moist"),
    33: Meaning("ice_content", "moist"),
    35: Meaning("rain_content", "moist"),
    36: Meaning("snow_content", "moist"),
    39: Meaning("graupel_content", "moist"),
}
_ECMWF_WAVES: dict[int, Meaning] = {244: Meaning("wave_slope")}  # table 140, msqs
# CAMS, table 210: mixing ratios of species, and optical depths at 550 nm
_CAMS: dict[int, Meaning] = {n: Meaning(f"{MASS}aermr{n:02d}", "moist") for n in range(1, 12)}
_CAMS |= {n: Meaning(f"{MASS}aermr{k}", "moist") for n, k in ((247, 16), (248, 17), (249, 18), (252, 19), (253, 20))}
_CAMS |= {
    n: Meaning(DEPTH + kind)
    for n, kind in (
        (207, "aerosol"), (208, "sea_salt"), (209, "dust"), (210, "organic_matter"), (211, "black_carbon"),
        (212, "sulphate"), (250, "nitrate"),
    )
}  # fmt: skip
NCEP, FNMOC = 7, 58
# GRIB2's code table 4.233, as far as models use it
_UNUSED = ("aermr12", "aermr13", "aermr14", "aermr15")
_AEROSOL_TYPES = {
    62000: "aerosol", 62001: "dust", 62004: "nitrate", 62006: "sulphate", 62008: "sea_salt", 62009: "black_carbon",
    62010: "organic_matter", 62020: "smoke", 62021: "smoke",
}  # fmt: skip


def aerosol_meaning(meaning: Meaning, kind: int | None, at_550: bool, short_name: str) -> Meaning | None:
    """A GRIB2 parameter of aerosol with the type (code table 4.233), wavelength and ecCodes' name of its message."""
    if meaning.name == "aerosol_depth":
        return Meaning(DEPTH + _AEROSOL_TYPES[kind]) if at_550 and kind in _AEROSOL_TYPES else None
    if meaning.name == "aerosol_mass":  # which bin of which model it is, only its name tells
        known = short_name.startswith("aermr") and short_name[5:].isdigit() and short_name not in _UNUSED
        return Meaning(f"{MASS}{short_name}", "moist") if known else None
    return meaning


def grib2_meaning(centre: int, discipline: int, category: int, number: int) -> Meaning | None:
    """What a GRIB2 parameter is; None where a scene has no use for it."""
    if discipline == 192 and category in (128, 140, 210):  # ECMWF's GRIB1 tables, carried over
        return {128: _ECMWF, 140: _ECMWF_WAVES, 210: _CAMS}[category].get(number)
    if number >= 192 or category >= 192:
        return GRIB2_LOCAL.get((centre, discipline, category, number))
    return GRIB2.get((discipline, category, number))


def grib1_meaning(centre: int, table: int, number: int) -> Meaning | None:
    """What a GRIB1 parameter is; None where a scene has no use for it."""
    if table == 128:
        return _ECMWF.get(number)
    if table == 140:
        return _ECMWF_WAVES.get(number)
    if table == 210:
        return _CAMS.get(number)
    if table == 201:
        return _DWD.get(number)
    if table > 3:
        return None
    return (_NCEP if centre in (NCEP, FNMOC) else _WMO).get(number)
