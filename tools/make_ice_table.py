"""Make src/openswim/optics/data/ice_near_infrared.csv: how ice crystals absorb and scatter forward beyond 700 nm.

    python tools/make_ice_table.py baum-general-habit-mixture_ice_scattering.nc

The file is one of ecRad's (ECMWF, Apache 2.0): bulk optics of the severely roughened general habit mixture of Baum et
al. (2014) with the refractive index of Warren & Brandt (2008). Kept are six effective radii every 20 nm from 700 to
1700 nm.
"""

import sys
from pathlib import Path

import xarray as xr

OUT = Path(__file__).parents[1] / "src/openswim/optics/data/ice_near_infrared.csv"
RADIUS_UM = (5, 10, 20, 30, 45, 60)


def main(path: str) -> None:
    data = xr.open_dataset(path)
    lines = [
        "# Ice crystals: 1 - single-scattering albedo, and asymmetry factor, at effective radii in um.",
        "# Baum et al. (2014) as tabulated by ecRad (Apache 2.0): made by tools/make_ice_table.py",
        ",".join(["wavelength_nm", *(f"{name}_{r}" for name in ("coalbedo", "asymmetry") for r in RADIUS_UM)]),
    ]
    for nm in range(700, 1701, 20):
        at = data.sel(effective_radius=[r * 1e-6 for r in RADIUS_UM], method="nearest").interp(wavenumber=1e7 / nm)
        coalbedo = [f"{max(1 - float(a), 0):.3g}" for a in at.single_scattering_albedo]
        lines.append(",".join([str(nm), *coalbedo, *(f"{float(g):.4f}" for g in at.asymmetry_factor)]))
    OUT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1])
