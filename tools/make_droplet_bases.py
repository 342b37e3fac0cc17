"""Make src/openswim/optics/data/mie_droplets.npz: phase functions of droplets of nearly one size.

    python tools/make_droplet_bases.py

Needs miepython (`pip install 'openswim[mie]'`); takes a minute. Each row is the mean over droplets whose sizes lie
around a node, with weights that fall linearly in ln x to none at the next nodes, so that sums of rows are the mean
over any number of droplets that is linear in between. The refractive index is that of water without absorption, as in
`tools/make_mie_tables.py`, of three wavelengths. All are means over the solar disc. The logarithm of P is kept in half
precision; the mean of P over the sphere is 1.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from make_mie_tables import VISIBLE_NM, disc_average, water_index

from openswim.optics.spheres import Sizes, scattering_by_spheres

STEP = 0.05  # of ln x
SIZE_PARAMETER = np.exp(np.arange(np.log(11.0), np.log(720.0), STEP))
ROWS_NM = np.array([400.0, 500.0, 700.0])
SIZES = 24  # within two steps
ANGLE_DEG = np.unique(
    np.r_[
        0.0, np.arange(1, 101) / 10, np.arange(10.2, 20, 0.4), np.arange(20, 60, 1.0), np.arange(60, 120, 1.5),
        np.arange(240, 341) / 2, 180 - np.arange(0, 100) / 10,
    ]
)  # fmt: skip
FINE_DEG = np.unique(np.r_[0, np.arange(1, 1101) / 100, ANGLE_DEG, 180 - np.arange(0, 1101) / 100])
OUT = Path(__file__).parents[1] / "src/openswim/optics/data/mie_droplets.npz"


def main() -> None:
    log_value = np.empty((ROWS_NM.size, SIZE_PARAMETER.size, ANGLE_DEG.size), np.float16)
    scattering = np.empty(log_value.shape[:2])
    offset = STEP * ((np.arange(SIZES) + 0.5) / SIZES * 2 - 1)
    share = (1 - np.abs(offset) / STEP) * 2 / SIZES  # whose sum is 1
    disc = (ANGLE_DEG < 10.1) | (ANGLE_DEG > 169.9)
    for w, wavelength in enumerate(ROWS_NM):
        for n, x in enumerate(SIZE_PARAMETER):
            # at a wavelength of 2 pi um the radius in um is the size parameter
            sizes = Sizes(x * np.exp(offset), share)
            found = scattering_by_spheres(sizes, complex(water_index(wavelength)), 2000 * np.pi, FINE_DEG)
            value = np.interp(ANGLE_DEG, FINE_DEG, found.value)
            value[disc] = disc_average(ANGLE_DEG[disc], FINE_DEG, found.value)
            log_value[w, n] = np.log(value)
            # the cross section of droplets, of which one in each step of ln x
            scattering[w, n] = found.efficiency * (share * sizes.radius_um**2).sum()
        print(f"{wavelength:.0f} nm", flush=True)
    np.savez_compressed(
        OUT, size_parameter=SIZE_PARAMETER, index=[water_index(w) for w in ROWS_NM], angle_deg=ANGLE_DEG,
        wavelength_nm=VISIBLE_NM, index_at=[water_index(w) for w in VISIBLE_NM], log_value=log_value,
        scattering=scattering.astype(np.float32),
    )  # fmt: skip
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
