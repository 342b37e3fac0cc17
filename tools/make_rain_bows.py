"""Make src/openswim/optics/data/rain_bows.npz: the rainbows in fine steps of the scattering angle.

    python tools/make_rain_bows.py

Needs miepython (`pip install 'openswim[mie]'`); takes some three minutes. The same water, radii and wavelengths as
those of `tools/make_mie_tables.py`, but drops of more sizes, and phase functions every .05 degrees where the bows are.
They are means over the solar disc, and the logarithm of P, whose mean over the sphere is 1, in half precision.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from make_mie_tables import RADIUS_UM, VISIBLE_NM, disc_average, index_of_water

from openswim.optics.spheres import gamma_sizes, scattering_by_spheres

ANGLE_DEG = np.unique(np.r_[np.arange(110.0, 121.0, 0.2), np.arange(2400, 2901) / 20, np.arange(145.0, 152.1, 0.2)])
FINE_DEG = np.arange(109.5, 152.6, 0.03)
SIZES = 90
OUT = Path(__file__).parents[1] / "src/openswim/optics/data/rain_bows.npz"


def main() -> None:
    radii = RADIUS_UM["rain"]
    log_value = np.empty((VISIBLE_NM.size, radii.size, ANGLE_DEG.size), np.float16)
    for w, wavelength in enumerate(VISIBLE_NM):
        for r, radius in enumerate(radii):
            sizes = gamma_sizes(radius, 1 / 3, radius / 7.5, min(radius * 4, 3000.0), SIZES)
            found = scattering_by_spheres(sizes, index_of_water(wavelength, None), wavelength, FINE_DEG)
            log_value[w, r] = np.log(disc_average(ANGLE_DEG, FINE_DEG, found.value))
            print(f"{radius:g} um, {wavelength:.0f} nm", flush=True)
    np.savez_compressed(OUT, angle_deg=ANGLE_DEG, log_value=log_value)
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
