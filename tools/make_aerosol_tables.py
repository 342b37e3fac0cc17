"""Make src/openswim/scene/data/mie_aerosol.npz: optics of the aerosol types that are made from size and index.

Needs miepython (`pip install 'openswim[mie]'`); takes a minute. Run it after changing a recipe below.

AERONET climatologies are those of Dubovik et al. (2002, J. Atmos. Sci. 59, 590, Table 1) at an optical depth of .5:
two lognormal modes of volume (median radius in um, standard deviation of ln r, volume), and refractive indices at
440 and 670 nm.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from openswim.optics.spheres import Mode, lognormal_sizes, scattering_angles, scattering_by_spheres

WAVELENGTH_NM = np.array([400.0, 450.0, 500.0, 550.0, 615.0, 700.0])
OUT = Path(__file__).parents[1] / "src/openswim/scene/data/mie_aerosol.npz"
SIZES = 600


@dataclass(frozen=True)
class Recipe:
    modes: tuple[Mode, ...]
    real: float
    absorbing: dict[float, float]  # imaginary part of the refractive index by wavelength in nm
    irregular: bool = False


def aeronet(fine: tuple[float, float, float], coarse: tuple[float, float, float]) -> tuple[Mode, Mode]:
    (r_f, s_f, v_f), (r_c, s_c, v_c) = fine, coarse
    return Mode(r_f, float(np.exp(s_f)), v_f, "volume"), Mode(r_c, float(np.exp(s_c)), v_c, "volume")


RECIPES = {
    # Solar Village, Saudi Arabia; large particles irregular
    "dust": Recipe(
        aeronet((0.12, 0.40, 0.030), (2.32, 0.60, 0.470)), 1.56, {440: 0.0029, 670: 0.0013}, irregular=True
    ),
    # boreal forest fires of the United States and Canada
    "smoke": Recipe(aeronet((0.1575, 0.43, 0.060), (3.31, 0.81, 0.025)), 1.50, {550: 0.0094}),
    # urban, industrial: Mexico City
    "pollution": Recipe(aeronet((0.14, 0.43, 0.060), (3.02, 0.63, 0.055)), 1.47, {550: 0.014}),
    # accumulation and coarse mode of clean sea air, OPAC (Hess et al. 1998), at 80 % relative humidity
    "sea_salt": Recipe((Mode(0.416, 2.03, 20.0), Mode(3.49, 2.03, 3.2e-3)), 1.361, {550: 3.5e-9}),
    # ammonium sulphate at 80 % relative humidity: .0355 um dry (Boucher & Anderson 1995), grown by 1.44
    "sulphate": Recipe((Mode(0.0511, 2.0, 1.0),), 1.411, {550: 4.4e-8}),
    # the stratosphere without eruptions: droplets of 75 % sulphuric acid (Palmer & Williams 1975; Pinnick et al. 1976)
    "stratospheric": Recipe((Mode(0.0725, 1.86, 1.0),), 1.43, {550: 1e-8}),
    # half a year to a year after Pinatubo: effective radius .5 um (Russell et al. 1996; Stothers 1997)
    "volcanic": Recipe((Mode(0.331, 1.5, 1.0),), 1.43, {550: 1e-8}),
}


def main() -> None:
    angle = scattering_angles()
    tables: dict[str, np.ndarray] = {"wavelength_nm": WAVELENGTH_NM, "angle_deg": angle}
    for name, recipe in RECIPES.items():
        sizes = lognormal_sizes(recipe.modes, SIZES)
        known = sorted(recipe.absorbing)
        rows = []
        for wavelength in WAVELENGTH_NM:
            absorbing = float(np.interp(wavelength, known, [recipe.absorbing[wl] for wl in known]))
            rows.append(
                scattering_by_spheres(sizes, complex(recipe.real, absorbing), wavelength, angle, recipe.irregular)
            )
        tables[f"{name}_log_value"] = np.log([row.value for row in rows]).astype(np.float32)
        tables[f"{name}_albedo"] = np.array([row.single_scattering_albedo for row in rows])
        tables[f"{name}_efficiency"] = np.array([row.efficiency for row in rows])
        slope = np.polyfit(np.log(WAVELENGTH_NM), np.log(tables[f"{name}_efficiency"]), 1)[0]
        at = rows[3]
        lidar = 4 * np.pi / (at.value[-1] * at.single_scattering_albedo)
        print(
            f"{name}: r_eff {sizes.effective_radius_um:.3f} um, at 550 nm g {at.phase.asymmetry:.3f}, albedo "
            f"{at.single_scattering_albedo:.3f}, lidar ratio {lidar:.0f} sr; Angstrom exponent {-slope:.2f}",
            flush=True,
        )
    np.savez_compressed(OUT, **tables)
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
