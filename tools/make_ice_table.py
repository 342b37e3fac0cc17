"""Make src/openswim/optics/data/ice_near_infrared.csv: how ice crystals absorb and scatter forward beyond 700 nm.

    python tools/make_ice_table.py baum-general-habit-mixture_ice_scattering.nc

The file is one of ecRad's (ECMWF, Apache 2.0): bulk optics of the severely roughened general habit mixture of Baum et
al. (2014) with the refractive index of Warren & Brandt (2008). Kept are six effective radii every 20 nm from 700 to
1700 nm.
"""

import sys
from pathlib import Path

import numpy as np
import xarray as xr

OUT = Path(__file__).parents[1] / "src/openswim/optics/data/ice_near_infrared.csv"
RADIUS_UM = (5, 10, 20, 30, 45, 60)
# The file has four digits, too few for what absorbs so little: to 1100 nm 1 - albedo is in proportion to the way
# through ice, by the imaginary part of its index (Warren & Brandt 2008), 1e-8, every 10 nm from 700 nm; with the factor
# that the file has at 1030 and at 1240 nm.
INDEX_1E8 = np.array([
    2.90, 3.44, 4.03, 4.30, 4.92, 5.87, 7.08, 8.58, 10.2, 11.8, 13.4, 14.0, 14.3, 14.5, 15.1, 18.3, 21.5, 26.5, 33.5,
    39.2, 42.0, 44.4, 47.4, 51.1, 55.3, 60.2, 75.5, 92.6, 112.0, 133.0, 162.0, 200.0, 225.0, 233.0, 233.0, 217.0, 196.0,
    181.0, 174.0, 173.0, 170.0])  # fmt: skip
WAY_PER_RADIUS = 1.03


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
        if nm <= 1100:
            per_um = 4 * np.pi * INDEX_1E8[(nm - 700) // 10] * 1e-8 / (nm * 1e-3)
            coalbedo = [f"{WAY_PER_RADIUS * per_um * r:.3g}" for r in RADIUS_UM]
        lines.append(",".join([str(nm), *coalbedo, *(f"{float(g):.4f}" for g in at.asymmetry_factor)]))
    OUT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1])
