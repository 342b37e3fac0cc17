"""What floats in WRF and WRF-Chem: the species of all microphysics schemes, and aerosol as extinction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.readers.fields import aerosol_species
from openswim.readers.fields.aerosol_beyond import Haze
from openswim.readers.fields.aerosol_species import AerosolPart, added_up, part_of_mass
from openswim.readers.fields.cover import WIDE_CELL_M, XU_RANDALL, cover_from_humidity
from openswim.readers.fields.particles import Category, known_sizes, together
from openswim.readers.wrf.file import MASS_LEVELS, WRFFile
from openswim.scene import Optics
from openswim.scene.checks import checked_values
from openswim.scene.oddities.damage import copied_levels
from openswim.scene.phase import HenyeyGreenstein
from openswim.scene.variables import Variable

F32 = NDArray[np.float32]
# Scene species: (mass, names of its number, names of its effective radius) of the categories that make it. QICE2 and
# QICE3 are free ice categories of P3 and ISHMAEL; "QN..." as all schemes write them, QNDROP with WRF-Chem.
CATEGORIES: dict[str, tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...]] = {
    "liquid": (("QCLOUD", ("QNCLOUD", "QNDROP"), ("RE_CLOUD", "EFFCS")),),
    "rain": (("QRAIN", ("QNRAIN",), ()),),
    "ice": (
        ("QICE", ("QNICE",), ("RE_ICE", "EFFIS")),
        ("QICE2", ("QNICE2",), ()),
        ("QICE3", ("QNICE3",), ()),
    ),
    "snow": (("QSNOW", ("QNSNOW",), ("RE_SNOW",)),),
    "graupel": (("QGRAUP", ("QNGRAUPEL",), ()), ("QHAIL", ("QNHAIL",), ())),
}
CONTENTS = {mass: species for species, categories in CATEGORIES.items() for mass, _, _ in categories}
EXPECTED = ("QCLOUD", "QRAIN", "QICE", "QSNOW", "QGRAUP")

EXTINCTION = "EXTCOF55"
# GOCART's species in WRF-Chem, as those of aerosol_species.py; micrograms per kg of dry air.
GOCART = {f"DUST_{k}": f"DU00{k}" for k in range(1, 6)} | {f"SEAS_{k}": f"SS00{k + 1}" for k in range(1, 5)}
GOCART |= {"BC1": "BCPHOBIC", "BC2": "BCPHILIC", "OC1": "OCPHOBIC", "OC2": "OCPHILIC"}
SMOKE = ("smoke", "SMOKE", "trc_smoke", "tracer_smoke")
PARTICULATE = "PM2_5_DRY"
AEROSOL = (EXTINCTION, *GOCART, PARTICULATE, *SMOKE)
_FRACTION = Variable("1", "", 0.0, 1.0, clip=True, hint="is it in percent?")
_MIXING_RATIO = Variable("kg kg-1", "", 0.0, 0.1, clip=True, hint="is it in g/kg? 1000 times too large")


def mixing_ratio(file: WRFFile, name: str, notes: list[str]) -> F32:
    """A mixing ratio, noise below zero clipped."""
    field = file.field(name, MASS_LEVELS, "kg kg-1")
    notes += copied_levels(name, field)
    return checked_values(name, field, _MIXING_RATIO, notes)


def hydrometeors(file: WRFFile, dry_density: F32, notes: list[str]) -> dict[str, F32]:
    """Contents [kg m-3], and numbers [m-3] or effective radii [m] where the file has them.

    A species of several categories that hold mass (graupel and hail) gets the effective radius that takes out as much
    light as they do together.
    """
    fields: dict[str, F32] = {}
    for species, categories in CATEGORIES.items():
        there = [each for each in categories if each[0] in file]
        if not there:
            continue
        masses = {mass: mixing_ratio(file, mass, notes) for mass, _, _ in there}
        full = [each for each in there if masses[each[0]].any()] or there[:1]
        sized = [
            (masses[mass], _first(file, numbers, "kg-1", notes), _first(file, radii, "m", notes))
            for mass, numbers, radii in full
        ]
        if len(sized) == 1:
            content, number, radius = sized[0]
            if number is not None:
                fields[f"{species}_number"] = number * dry_density
        else:
            content, radius = together(species, [Category(*each) for each in sized])
            notes.append(f"{' and '.join(mass for mass, _, _ in full)} are counted as {species}")
        fields[f"{species}_content"] = content * dry_density
        if radius is not None:
            fields[f"{species}_effective_radius"] = radius
    if fields and not any(field.any() for name, field in fields.items() if name.endswith("_content")):
        notes.append("all cloud and precipitation fields are zero: a clear sky")
    return fields


def cover(file: WRFFile, cell_m: float, air: dict[str, F32], dry_density: F32, notes: list[str]) -> dict[str, F32]:
    """Cloud fraction: CLDFRA. Where it is missing or knows only 0 and 1, that of humidity in wide cells, and none in
    others: they are full of cloud wherever they have any, also before the model's radiation has set CLDFRA at all.

    air: scene variables read so far, pressure, temperature and contents among them.
    """
    guessed = cover_guess(file, cell_m)
    if guessed is None and _has_fractions(file):
        fraction = checked_values("CLDFRA", file.field("CLDFRA", MASS_LEVELS, ""), _FRACTION, notes)
        return {"cloud_area_fraction": fraction}
    water = [air[f"{kind}_content"] for kind in ("liquid", "ice") if f"{kind}_content" in air]
    if guessed is None or not np.any(water) or "QVAPOR" not in file:
        return {}
    vapour = mixing_ratio(file, "QVAPOR", [])
    notes.append(guessed)
    condensate = np.sum(water, axis=0) / dry_density
    humidity = np.asarray(vapour / (1 + vapour), np.float32)
    temperature, pressure = air["air_temperature"], air["air_pressure"]
    return {"cloud_area_fraction": cover_from_humidity(condensate, temperature, pressure, humidity, None)}


def cover_guess(file: WRFFile, cell_m: float) -> str | None:
    """A note if cloud fraction is to follow from humidity: cells are wide, and CLDFRA is missing or only 0 and 1."""
    if cell_m <= WIDE_CELL_M:
        return None
    if "CLDFRA" not in file:
        return XU_RANDALL
    return None if _has_fractions(file) else f"{XU_RANDALL}, since CLDFRA is 0 or 1"


def _has_fractions(file: WRFFile) -> bool:
    """Whether CLDFRA knows more than 0 and 1."""
    if "CLDFRA" not in file:
        return False
    fraction = file.field("CLDFRA", MASS_LEVELS, "")
    return bool(((fraction != 0) & (fraction != 1)).any())


def aerosol(file: WRFFile, dry_density: F32, humidity: F32, notes: list[str]) -> Haze:
    """Aerosol at 550 nm: EXTCOF55, else GOCART's species, else PM2_5_DRY; smoke tracers are added to none of these."""
    if EXTINCTION in file:
        extinction = _clean(file.field(EXTINCTION, MASS_LEVELS, "km-1")) * np.float32(1e-3)
        if extinction.any():
            notes.append(f"aerosol extinction at 550 nm from {EXTINCTION}")
            mixed = Optics(0.93, HenyeyGreenstein(0.66), "aerosol", 1.3)
            return Haze({"aerosol": extinction}, {"aerosol": mixed}, True)
        notes.append(f"{EXTINCTION} is zero everywhere: not filled in at this time")
    species = aerosol_species.SPECIES
    parts: list[AerosolPart] = []
    for name, like in GOCART.items():
        if name in file:
            mass = _clean(file.field(name, MASS_LEVELS, "ug/kg-dryair")) * np.float32(1e-9) * dry_density
            parts.append(part_of_mass(species[like], mass, humidity))
    smoke, whole = next((name for name in SMOKE if name in file), None), True
    if not parts and PARTICULATE in file:
        mass = _clean(file.field(PARTICULATE, MASS_LEVELS, "ug m^-3")) * np.float32(1e-9)
        parts.append(part_of_mass(aerosol_species.FINE_PARTICLES, mass, humidity))
        notes.append(f"aerosol from {PARTICULATE}: {aerosol_species.FINE_PARTICLES.extinction_m2_g:g} m2/g when dry")
    elif not parts and smoke is not None:
        whole = False
        mass = _clean(file.field(smoke, MASS_LEVELS, "ug/kg")) * np.float32(1e-9) * dry_density
        parts.append(part_of_mass(aerosol_species.SMOKE, mass, humidity))
        notes.append(f"smoke from {smoke}: {aerosol_species.SMOKE.extinction_m2_g:g} m2/g when dry, on the background")
    elif parts:
        notes.append("aerosol from GOCART's species (docs/models.md), sulphate left out")
    return Haze(*added_up(parts), whole and bool(parts))


def aerosol_kinds(file: WRFFile) -> list[str]:
    """Kinds of aerosol that replace the default background, by the names of the file's variables."""
    if EXTINCTION in file:
        return ["aerosol"]
    kinds = [aerosol_species.SPECIES[like].kind for name, like in GOCART.items() if name in file]
    return list(dict.fromkeys(kinds)) or [aerosol_species.FINE_PARTICLES.kind] * (PARTICULATE in file)


def _first(file: WRFFile, names: tuple[str, ...], units: str, notes: list[str]) -> F32 | None:
    """The first of some fields that the file has, where it is anywhere positive."""
    for name in names:
        if name not in file:
            continue
        scale = np.float32(1e-6 if name.startswith("EFF") else 1.0)  # EFFCS, EFFIS are in micrometres
        field = known_sizes(name, file.field(name, MASS_LEVELS, "" if name.startswith("EFF") else units), notes)
        if field is not None:
            return np.asarray(field * scale, np.float32)
    return None


def _clean(field: F32) -> F32:
    return np.maximum(field, np.float32(0))
