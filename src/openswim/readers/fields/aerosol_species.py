"""Aerosol species as models carry them, and what a gram of each does to light.

Mass extinction, albedo and asymmetry by humidity and wavelength are those of the IFS (Bozzo et al. 2020, GMD 13, 1007)
for CAMS, and our own Mie theory for GOCART. Phase functions are by Mie theory for both. The tables are made by
tools/make_model_aerosol.py; docs/models.md has what they cannot do.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.optics.aerosol import aerosol_optics
from openswim.scene import Optics
from openswim.scene.phase import AerosolPhase, Mixture, PhaseFunction
from openswim.scene.phase.tables import model_tables

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_DAMPEST = 0.95  # growth beyond is cloud
_AT_NM = 550.0


@dataclass(frozen=True)
class AerosolSpecies:
    """A species of a model.

    kind: what it is called in a scene, which has one field for each kind. table: its name in the tables; "" where it is
    like one of our own types (`like`), with `extinction_m2_g` in dry air at 550 nm, which grows as (1 - RH)^-growth.
    factor: of the table's extinction by mass.
    """

    kind: str
    table: str = ""
    like: str = ""
    extinction_m2_g: float = 0.0
    growth: float = 0.0
    factor: float = 1.0

    def mass_extinction(self, relative_humidity: F32) -> F32:
        """Extinction at 550 nm (m2/g, shape of the humidity)."""
        humidity = np.clip(relative_humidity, 0.0, _DAMPEST)
        if not self.table:
            return np.asarray(self.extinction_m2_g * (1.0 - humidity) ** np.float32(-self.growth), np.float32)
        tables = model_tables()
        at = int(np.flatnonzero(tables["wavelength_nm"] == _AT_NM)[0])
        rows = tables[f"{self.table}_extinction_m2_g"][:, at] * self.factor
        if rows.size == 1:
            return np.full(np.shape(humidity), rows[0], np.float32)
        return np.interp(humidity, _humidities(self.table), rows).astype(np.float32)


def _s(kind: str, table: str) -> AerosolSpecies:
    return AerosolSpecies(kind, table)


SMOKE = AerosolSpecies("smoke", like="smoke", extinction_m2_g=4.5, growth=0.2)  # Reid et al. 2005 (ACP 5, 827)
DRY_SMOKE = AerosolSpecies("smoke", like="smoke", extinction_m2_g=4.5)
FINE_PARTICLES = AerosolSpecies("fine_particles", like="continental", extinction_m2_g=4.0, growth=0.35)  # PM2.5
_ORGANIC, _ORGANIC_DRY = _s("organic_matter", "organic"), _s("organic_matter", "organic_dry")
_SOOT, _SULPHATE = _s("black_carbon", "black_carbon"), _s("sulphate", "sulphate")
_AMMONIUM = AerosolSpecies("sulphate", "sulphate", factor=0.727)  # its mass in ammonium sulphate, as the IFS has it
_NITRATE, _NITRATE_COARSE = _s("nitrate", "nitrate_1"), _s("nitrate", "nitrate_2")


SPECIES: dict[str, AerosolSpecies] = {
    # CAMS (ECMWF short names); salt by its mass at 80 % humidity
    "aermr01": _s("sea_salt", "sea_salt_1"),
    "aermr02": _s("sea_salt", "sea_salt_2"),
    "aermr03": _s("sea_salt", "sea_salt_3"),
    "aermr04": _s("dust", "dust_1"),
    "aermr05": _s("dust", "dust_2"),
    "aermr06": _s("dust", "dust_3"),
    "aermr07": _ORGANIC,
    "aermr08": _ORGANIC_DRY,
    "aermr09": _SOOT,
    "aermr10": _SOOT,
    "aermr11": _SULPHATE,
    "aermr16": _NITRATE,
    "aermr17": _NITRATE_COARSE,
    "aermr18": _AMMONIUM,
    "aermr19": _ORGANIC,
    "aermr20": _ORGANIC,
    # MERRA-2 and GEOS (GOCART): dust of .1-1, 1-1.8, 1.8-3, 3-6, 6-10 um, dry salt of .03-.1, .1-.5, .5-1.5, 1.5-5,
    # 5-10 um
    **{f"DU00{k}": _s("dust", f"dust_{bin}") for k, bin in enumerate("abcde", 1)},
    **{f"SS00{k}": _s("sea_salt", f"salt_{bin}") for k, bin in enumerate("abcde", 1)},
    "SO4": _SULPHATE,
    "BCPHOBIC": _SOOT,
    "BCPHILIC": _SOOT,
    "OCPHOBIC": _ORGANIC_DRY,
    "OCPHILIC": _ORGANIC,
    "NI001": _NITRATE,
    "NI002": _NITRATE_COARSE,
    "NI003": _NITRATE_COARSE,
    "NH4A": _AMMONIUM,
}
# Species known by their optical depth alone: what their particles are like.
BY_DEPTH: dict[str, tuple[str, ...]] = {
    "dust": ("dust_1", "dust_2", "dust_3"),
    "sea_salt": ("sea_salt_1", "sea_salt_2"),
    "organic_matter": ("organic",),
    "black_carbon": ("black_carbon",),
    "sulphate": ("sulphate",),
    "nitrate": ("nitrate_1",),
}
_SHARES = {"dust": (0.45, 0.2, 0.35), "sea_salt": (0.6, 0.4)}  # of a bin in the optical depth, as in CAMS on average
LIKE = {"smoke": "smoke", "aerosol": "continental", "fine_particles": "continental"}


def species_of_name(name: str) -> AerosolSpecies | None:
    """The species of a CAMS or MERRA-2 variable name; new CAMS files write "aermr04" in the same way."""
    return SPECIES.get(name) or SPECIES.get(name.lower()) or SPECIES.get(re.sub(r"_mmr$", "", name))


@dataclass(frozen=True)
class AerosolPart:
    """One species on the model's levels: extinction at 550 nm (1/m), and its mean humidity by extinction."""

    species: AerosolSpecies
    extinction_per_m: F32
    humidity: float


def part_of_mass(species: AerosolSpecies, mass_kg_m3: F32, relative_humidity: F32 | None) -> AerosolPart:
    """A species by its mass per volume of air as the model counts it; without humidity it is taken as dry."""
    humidity = np.zeros((), np.float32) if relative_humidity is None else relative_humidity
    extinction = np.asarray(mass_kg_m3 * np.float32(1e3) * species.mass_extinction(humidity), np.float32)
    total = float(extinction.sum(dtype=np.float64))
    damp = np.broadcast_to(np.clip(humidity, 0.0, _DAMPEST), extinction.shape)
    mean = float((extinction * damp).sum(dtype=np.float64)) / total if total > 0 else 0.5
    return AerosolPart(species, extinction, mean)


def added_up(parts: Sequence[AerosolPart]) -> tuple[dict[str, F32], dict[str, Optics]]:
    """Extinction at 550 nm by kind, and what the particles of each kind are like together."""
    fields: dict[str, F32] = {}
    for part in parts:
        kind = part.species.kind
        fields[kind] = fields[kind] + part.extinction_per_m if kind in fields else part.extinction_per_m
    return fields, {kind: _optics([p for p in parts if p.species.kind == kind]) for kind in fields}


def optics_by_depth(kind: str) -> Optics:
    """What particles of a kind are like where only their optical depth is known; at 60 % humidity."""
    if kind in LIKE:
        return aerosol_optics(LIKE[kind])
    tables = BY_DEPTH[kind]
    shares = np.array(_SHARES.get(kind, (1.0,)))
    return _mean_optics([(table, share, 0.6) for table, share in zip(tables, shares, strict=True)])


def _optics(parts: Sequence[AerosolPart]) -> Optics:
    species = parts[0].species
    if not species.table:
        return aerosol_optics(species.like)
    weights = np.array([float(part.extinction_per_m.sum(dtype=np.float64)) for part in parts])
    weights = weights / weights.sum() if weights.sum() > 0 else np.full(len(parts), 1 / len(parts))
    return _mean_optics([(p.species.table, share, p.humidity) for p, share in zip(parts, weights, strict=True)])


def _mean_optics(bins: Sequence[tuple[str, float, float]]) -> Optics:
    """Of bins: table, share of the extinction at 550 nm, and humidity of each."""
    tables = model_tables()
    wavelengths = tables["wavelength_nm"]
    at = int(np.flatnonzero(wavelengths == _AT_NM)[0])
    extinction, albedo = ([_at_humidity(t, w, rh) for t, _, rh in bins] for w in ("extinction_m2_g", "albedo"))
    share = np.array([s * e / e[at] for (_, s, _), e in zip(bins, extinction, strict=True)])  # (bins, nwl)
    total = share.sum(axis=0)
    scattered = share * np.array(albedo)
    phases: dict[float, PhaseFunction] = {}
    for w, wavelength in enumerate(wavelengths.tolist()):
        weights: dict[str, float] = {}
        for (table, _, humidity), own in zip(bins, scattered[:, w] / scattered[:, w].sum(), strict=True):
            for row, part in _phase_rows(table, humidity).items():
                weights[row] = weights.get(row, 0.0) + own * part
        rows = {row: weight for row, weight in weights.items() if weight > 1e-4}
        named = [AerosolPhase(row, wavelength) for row in rows]
        sums = np.array(list(rows.values())) / sum(rows.values())
        phases[wavelength] = named[0] if len(named) == 1 else Mixture(sums.tolist(), named)
    keys = wavelengths.tolist()
    return Optics(
        dict(zip(keys, np.minimum(scattered.sum(axis=0) / total, 1.0).tolist(), strict=True)), phases, "aerosol",
        relative_extinction=dict(zip(keys, total.tolist(), strict=True)),
    )  # fmt: skip


def _humidities(table: str) -> F64:
    """Of the rows of a table of a species that grows."""
    tables = model_tables()
    every = tables["relative_humidity"].astype(float)
    return every if len(tables[f"{table}_extinction_m2_g"]) == every.size else every[tables["with_phase"].astype(int)]


def _at_humidity(table: str, what: str, humidity: float) -> F64:
    """A spectrum (nwl,) of a species."""
    rows = np.asarray(model_tables()[f"{table}_{what}"], float)
    if len(rows) == 1:
        return np.asarray(rows[0])
    return np.array([np.interp(humidity, _humidities(table), column) for column in rows.T])


def _phase_rows(table: str, humidity: float) -> dict[str, float]:
    """Shares of the phase functions of a species at a humidity, by name."""
    tables = model_tables()
    if f"{table}_log_value" in tables:
        return {table: 1.0}
    numbers = tables["with_phase"].astype(int)
    position = float(np.interp(humidity, tables["relative_humidity"][numbers], np.arange(numbers.size)))
    lower = min(int(position), numbers.size - 2)
    part = position - lower
    return {f"{table}_{numbers[lower]}": 1 - part, f"{table}_{numbers[lower + 1]}": part}
