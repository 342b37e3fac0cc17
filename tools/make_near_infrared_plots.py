"""Make docs/images/near_infrared.png: gases, particles and land from 400 to 1700 nm (docs/near-infrared.md).

    python tools/make_near_infrared_plots.py astm-g173.txt     # the standard spectrum: nm, outside, tilted, direct
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from openswim.ground import snow
from openswim.ground.near_infrared import VISIBLE_NM, land_beyond_visible
from openswim.ground.spectra import from_bands
from openswim.optics import hydrometeors
from openswim.optics.gas_bands import WIDTH_NM, terms_of
from openswim.optics.species import background
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere

OUT = Path(__file__).parents[1] / "docs/images/near_infrared.png"
CENTRES_NM = np.arange(410.0, 1691.0, 20.0)
FINE_NM = np.arange(400.0, 1701.0, 5.0)
COVERS = {  # albedo at 469, 555 and 645 nm
    "forest": ([0.02, 0.045, 0.03], "#2b6a34"), "fields": ([0.04, 0.09, 0.06], "#7ab648"),
    "desert": ([0.17, 0.30, 0.41], "#c8904a"),
}  # fmt: skip


def direct_light(centres_nm):
    """Share of the sun's light that comes straight down through 1.5 air masses of the standard's air."""
    terms = terms_of(centres_nm)
    air = Atmosphere.us_standard(ozone_du=340.0, aerosol=AerosolProfile(0.084, 1.3, 1500.0, 0.0, reference_nm=500.0))
    height = np.concatenate([np.arange(0.0, 30_000.0, 100.0), np.arange(30_000.0, 100_001.0, 1000.0)])
    found = background(air, terms.nm, height, terms)
    depth = np.trapezoid(found.rayleigh_per_m + found.absorption_per_m + found.aerosol_per_m, height, axis=1)
    return terms.mean(np.exp(-1.5 * depth))


def main(standard: str) -> None:
    nm, outside, _, direct = np.loadtxt(standard).T
    inside = np.abs(nm - CENTRES_NM[:, None]) <= WIDTH_NM / 2
    truth = np.array([np.trapezoid(direct[i], nm[i]) / np.trapezoid(outside[i], nm[i]) for i in inside])
    figure, (gas, particles, land) = plt.subplots(3, 1, figsize=(9, 10.5), sharex=True, constrained_layout=True)
    gas.plot(CENTRES_NM, truth, "o", ms=4, color="black", label="ASTM G173-03, means over 20 nm")
    gas.plot(CENTRES_NM, direct_light(CENTRES_NM), color="#c23b22", label="OpenSWIm")
    gas.set_ylabel("direct light over that outside")
    for radius_um, colour in ((6, "#9ecae1"), (12, "#4292c6"), (20, "#08519c")):
        albedo = hydrometeors.single_scattering_albedo("liquid", FINE_NM, radius_um * 1e-6)
        particles.semilogy(FINE_NM, 1 - albedo, color=colour, label=f"droplets, {radius_um} µm")
    for radius_um, colour in ((10, "#fdae6b"), (40, "#d94801")):
        albedo = hydrometeors.single_scattering_albedo("ice", FINE_NM, radius_um * 1e-6)
        absorbed = np.where(albedo < 1, 1 - albedo, np.nan)
        particles.semilogy(FINE_NM, absorbed, color=colour, label=f"ice, {radius_um} µm")
    particles.set(ylim=(1e-7, 1), ylabel="1 - single-scattering albedo")
    far = FINE_NM > 700
    for name, (visible, colour) in COVERS.items():
        near = from_bands(np.array([visible[::-1]]), FINE_NM[~far])[0]
        beyond = land_beyond_visible(np.array([visible]), FINE_NM[far])[0]
        land.plot(FINE_NM, np.append(near, beyond), color=colour, label=name)
        land.plot(VISIBLE_NM, visible, "o", ms=4, color=colour)
    for days, colour in ((0.0, "#6baed6"), (3.0, "#3182bd"), (30.0, "#756bb1")):
        land.plot(FINE_NM, snow.snow_albedo(FINE_NM, days)[0], "--", color=colour, label=f"snow of {days:g} days")
    land.set(ylim=(0, 1), xlim=(400, 1700), xlabel="wavelength, nm", ylabel="albedo")
    for axes in (gas, particles, land):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(OUT, dpi=100)


if __name__ == "__main__":
    main(sys.argv[1])
