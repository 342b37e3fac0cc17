"""Make src/openswim/scene/data/model_aerosol.npz: optics of the aerosol that models carry, bin by bin.

Needs miepython (`pip install 'openswim[mie]'`) and aerosol_ifs_49R1.nc of ecRad (ECMWF; Apache License 2.0), the
optics of Bozzo et al. (2020, GMD 13, 1007). Usage: python tools/make_model_aerosol.py aerosol_ifs_49R1.nc

Species of the IFS: mass extinction, albedo and asymmetry are a few numbers of that file. It has no phase functions:
those are our own Mie theory with its refractive index and the size distributions of the paper (Table 1), the radius
scaled until the asymmetry at 550 nm is the file's. Organic matter is a mixture of which the file gives one index:
that of OPAC's water-soluble particles (Hess et al. 1998) is taken for its phase functions. Species of GOCART
(MERRA-2, GEOS, WRF-Chem): all by our own Mie theory, with dust's index of Dubovik et al. (2002) and salt's of OPAC.
Dust has as much volume in each step of ln r within a bin; in the finest as GOCART divides it among four, which is a
power of 2.55; salt follows OPAC's modes. Large dust scatters as irregular particles do.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from openswim.optics.spheres import Sizes, SphereOptics, scattering_by_spheres

WAVELENGTH_NM = np.array([400.0, 450.0, 500.0, 550.0, 650.0, 870.0, 1240.0, 1650.0])
AT = 3  # 550 nm
ANGLES = np.concatenate([[0.0], np.geomspace(0.2, 10, 28), np.arange(12.0, 170, 3.0), np.arange(171.0, 180.1, 1.0)])
HUMIDITIES = (3, 4, 8, 11)  # of the file's twelve, for which there are phase functions: 35, 45, 82 and 97 %
OUT = Path(__file__).parents[1] / "src/openswim/scene/data/model_aerosol.npz"
COUNT = 120


@dataclass(frozen=True)
class Species:
    """Lognormal modes (median radius in um, geometric standard deviation, number) between two radii (um)."""

    modes: tuple[tuple[float, float, float], ...]
    smallest: float
    largest: float
    irregular: bool = False
    index: complex | None = None  # in place of the file's

    def sizes(self, growth: float) -> Sizes:
        radius = np.geomspace(self.smallest, self.largest, COUNT)
        number = sum(n * np.exp(-0.5 * (np.log(radius / r) / np.log(s)) ** 2) / np.log(s) for r, s, n in self.modes)
        return Sizes(radius * growth, np.asarray(number))


SALT = ((0.1992, 1.9, 70.0), (1.992, 2.0, 3.0))  # at 80 % humidity
DUST = ((0.29, 2.0, 1.0),)
ORGANIC = ((0.0212, 2.24, 1.0),)
HYDROPHOBIC = {  # by its number in the file
    "dust_1": (0, Species(DUST, 0.03, 0.55, True)),
    "dust_2": (1, Species(DUST, 0.55, 0.9, True)),
    "dust_3": (2, Species(DUST, 0.9, 20.0, True)),
    "organic_dry": (9, Species(ORGANIC, 0.005, 5.0, index=1.53 + 0.006j)),
    "black_carbon": (10, Species(((0.0118, 2.0, 1.0),), 0.005, 0.5)),
}
HYDROPHILIC = {
    "sea_salt_1": (0, Species(SALT, 0.03, 0.5)),
    "sea_salt_2": (1, Species(SALT, 0.5, 5.0)),
    "sea_salt_3": (2, Species(SALT, 5.0, 20.0)),
    "organic": (3, Species(ORGANIC, 0.005, 5.0, index=1.39 + 0.003j)),
    "sulphate": (4, Species(((0.0355, 2.0, 1.0),), 0.005, 3.0)),
    "nitrate_1": (8, Species(((0.0355, 2.0, 1.0),), 0.005, 0.9)),
    "nitrate_2": (9, Species(((0.199, 1.9, 1.0), (1.992, 2.0, 0.05)), 0.9, 20.0)),
}
GOCART_DUST = {"dust_a": (0.1, 1.0), "dust_b": (1.0, 1.8), "dust_c": (1.8, 3.0), "dust_d": (3.0, 6.0),
               "dust_e": (6.0, 10.0)}  # fmt: skip
GOCART_SALT = {"salt_a": (0.03, 0.1), "salt_b": (0.1, 0.5), "salt_c": (0.5, 1.5), "salt_d": (1.5, 5.0),
               "salt_e": (5.0, 10.0)}  # fmt: skip
DUST_DENSITY, SALT_DENSITY = 2.6, 2.2  # g cm-3


def mie(sizes: Sizes, indices: np.ndarray, irregular: bool) -> list[SphereOptics]:
    return [scattering_by_spheres(sizes, complex(m), wl, ANGLES, irregular)
            for m, wl in zip(indices, WAVELENGTH_NM, strict=True)]  # fmt: skip


def scaled(species: Species, growth: float, indices: np.ndarray, asymmetry: float, name: str) -> list[SphereOptics]:
    """Mie theory with the radius that has the asymmetry at 550 nm, sought within a factor of two."""

    def g(factor: float) -> float:
        sizes = species.sizes(growth * factor)
        return scattering_by_spheres(sizes, complex(indices[AT]), 550.0, ANGLES, species.irregular).phase.asymmetry

    factors = np.geomspace(0.5, 2.0, 9)
    found = np.array([g(f) for f in factors])
    near = int(np.argmin(np.abs(found - asymmetry)))
    crossing = [k for k in range(8) if (found[k] - asymmetry) * (found[k + 1] - asymmetry) <= 0]
    factor = float(factors[near])
    if crossing:
        k = min(crossing, key=lambda each: abs(each + 0.5 - 4))
        low, high = factors[k], factors[k + 1]
        for _ in range(8):
            factor = float(np.sqrt(low * high))
            same = (g(factor) - asymmetry) * (g(float(low)) - asymmetry) > 0
            low, high = (factor, high) if same else (low, factor)
    rows = mie(species.sizes(growth * factor), indices, species.irregular)
    print(f"{name}: g {found[4]:.3f} of the paper's sizes, {rows[AT].phase.asymmetry:.3f} with radii times "
          f"{factor:.2f}; the file's {asymmetry:.3f}", flush=True)  # fmt: skip
    return rows


def main(path: str) -> None:
    file = xr.open_dataset(path)
    order = np.argsort(file["wavelength"].values)
    known = 1e9 * file["wavelength"].values[order]

    def spectrum(name: str, *at: int) -> np.ndarray:
        values = file[name].values[at].astype(float)
        return np.array([np.interp(WAVELENGTH_NM, known, row[order]) for row in np.atleast_2d(values)])

    low, high = (file[f"relative_humidity{k}"].values.astype(float) for k in (1, 2))
    tables: dict[str, np.ndarray] = {
        "wavelength_nm": WAVELENGTH_NM, "angle_deg": ANGLES, "relative_humidity": 0.5 * (low + high),
        "with_phase": np.array(HUMIDITIES),
    }

    def keep(name: str, optics: dict[str, np.ndarray], phases: list[list[SphereOptics]]) -> None:
        tables.update({f"{name}_{what}": values.astype(np.float32) for what, values in optics.items()})
        for k, rows in enumerate(phases):
            row = name if len(phases) == 1 else f"{name}_{HUMIDITIES[k]}"
            tables[f"{row}_log_value"] = np.log([one.phase.value(np.cos(np.radians(ANGLES))) for one in rows]).astype(
                np.float16
            )

    for kind, every in (("hydrophobic", HYDROPHOBIC), ("hydrophilic", HYDROPHILIC)):
        for name, (n, species) in every.items():
            optics = {what: spectrum(f"{key}_{kind}", n) for what, key in
                      (("extinction_m2_g", "mass_ext"), ("albedo", "ssa"), ("asymmetry", "asymmetry"))}  # fmt: skip
            optics["extinction_m2_g"] /= 1e3
            phases = []
            for h in HUMIDITIES if kind == "hydrophilic" else (0,):
                at = (n, h) if kind == "hydrophilic" else (n,)
                index = spectrum(f"ref_index_real_{kind}", *at)[0] + 1j * spectrum(f"ref_index_imag_{kind}", *at)[0]
                if species.index is not None:
                    index = np.full(WAVELENGTH_NM.size, species.index)
                growth = float(file["growth_factor_hydrophilic"].values[n, h]) if kind == "hydrophilic" else 1.0
                phases.append(scaled(species, growth, index, float(optics["asymmetry"][h, AT]), f"{name} {h}"))
            keep(name, optics, phases)

    dust = spectrum("ref_index_real_hydrophobic", 0)[0] + 1j * spectrum("ref_index_imag_hydrophobic", 0)[0]
    for name, (smallest, largest) in GOCART_DUST.items():
        radius = np.geomspace(smallest, largest, COUNT // 2)
        sizes = Sizes(radius, radius ** (-0.45 if name == "dust_a" else -3.0))
        keep(name, *per_mass(name, sizes, [1.0], [dust], DUST_DENSITY, True))
    growths = file["growth_factor_hydrophilic"].values[0].astype(float)
    indices = [spectrum("ref_index_real_hydrophilic", 0, h)[0] + 1j * spectrum("ref_index_imag_hydrophilic", 0, h)[0]
               for h in HUMIDITIES]  # fmt: skip
    for name, (smallest, largest) in GOCART_SALT.items():
        grown = [growths[h] / growths[0] for h in HUMIDITIES]
        dry = Species(tuple((r * growths[0], s, n) for r, s, n in SALT), smallest, largest)
        keep(name, *per_mass(name, dry.sizes(1.0), grown, indices, SALT_DENSITY, False))
    np.savez_compressed(OUT, **tables)
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


def per_mass(
    name: str, dry: Sizes, growths: list[float], indices: list[np.ndarray], density: float, irregular: bool
) -> tuple[dict[str, np.ndarray], list[list[SphereOptics]]]:
    """Optics of a bin per dry mass, at each growth."""
    phases = [mie(Sizes(dry.radius_um * growth, dry.number), index, irregular)
              for growth, index in zip(growths, indices, strict=True)]  # fmt: skip
    per_gram = [3 * growth**2 / (4 * density * dry.effective_radius_um) for growth in growths]  # m2 of shadow
    optics = {
        "extinction_m2_g": np.array(
            [[p * o.efficiency for o in rows] for p, rows in zip(per_gram, phases, strict=True)]
        ),
        "albedo": np.array([[o.single_scattering_albedo for o in rows] for rows in phases]),
        "asymmetry": np.array([[o.phase.asymmetry for o in rows] for rows in phases]),
    }
    at = optics["extinction_m2_g"][:, AT], optics["albedo"][:, AT], optics["asymmetry"][:, AT]
    print(f"{name}: m2/g, albedo, g at 550 nm", *(np.round(each, 3) for each in at), flush=True)
    return optics, phases


if __name__ == "__main__":
    main(sys.argv[1])
