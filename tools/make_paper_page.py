"""Make the pictures of docs/paper.md: figures of Albers et al. (2020) that need no data but our own.

    python tools/make_paper_page.py [folder]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import openswim
from openswim.colour import save
from openswim.optics.aerosol import aerosol_type
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere

TARGET = Path(__file__).parents[1] / "docs/images"
LAT, LON, SUN = 40.0, -105.3, (180.0, 40.0)
TYPES = {"colorado_dust": "Colorado dust", "saudi_dust_pollution": "Saudi dust and pollution"}


def panorama(name: str) -> xr.Dataset:
    """Figure 4a and b: an aerosol of optical depth .1 alone in the air, all round."""
    air = Atmosphere.us_standard(aerosol=openswim.optics.aerosol_profile(name, 0.1))
    scene = Scene.clear(LAT, LON, air)
    camera = openswim.Camera.panorama(LAT, LON, size="960x240", altitude_range_deg=(0.0, 90.0))
    return openswim.render(scene, camera, sun=SUN)


def phase_functions(path: Path) -> None:
    """Figure 4c: both at 615, 546 and 450 nm."""
    angle = np.concatenate([np.geomspace(0.3, 10, 80), np.linspace(10, 180, 120)])
    figure, axes = plt.subplots(figsize=(7.2, 4.2), layout="constrained")
    for (name, label), dash in zip(TYPES.items(), ("-", "--"), strict=True):
        phase = aerosol_type(name).phase
        for wavelength, colour in ((615.0, "#c0392b"), (546.0, "#2e8b57"), (450.0, "#2c5aa0")):
            each = phase[wavelength] if isinstance(phase, dict) else phase
            value = each.value(np.cos(np.radians(angle)))
            axes.semilogy(angle, value, dash, color=colour, label=f"{label}, {wavelength:.0f} nm")
    axes.set(xlabel="scattering angle (degrees)", ylabel="phase function (mean 1)", xlim=(0, 180))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def main(folder: Path) -> None:
    phase_functions(folder / "paper_phases.png")
    for name in TYPES:
        save(panorama(name), folder / f"paper_{name}.jpg", exposure=1.0, caption="none")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET)
