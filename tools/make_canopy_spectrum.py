"""Make src/openswim/colour/data/green_canopy.csv, the reflectance of green land, with the PROSAIL model.

PROSPECT-5 leaves (Feret et al. 2008) in a 4SAIL canopy (Verhoef et al. 2007), as the package prosail has them; the
geometric mean over leaves, canopies, soils and views drawn at random, so that the shape is that of the kind:

    pip install prosail==2.0.5
    python tools/make_canopy_spectrum.py
"""

from pathlib import Path

import numpy as np
import prosail

DRAWS = 500
TARGET = Path(__file__).parents[1] / "src/openswim/colour/data/green_canopy.csv"
NM = np.arange(400, 781, 10)


def canopy(rng: np.random.Generator) -> np.ndarray:
    """Bidirectional reflectance at `NM` of one canopy: sparse meadow to dense wood."""
    chlorophyll_ug_cm2 = rng.uniform(15, 60)
    reflectance = prosail.run_prosail(
        n=rng.uniform(1.2, 2.2), cab=chlorophyll_ug_cm2, car=0.2 * chlorophyll_ug_cm2, cbrown=rng.uniform(0, 0.3),
        cw=0.012, cm=0.009, lai=rng.uniform(1.0, 6.0), lidfa=rng.uniform(-0.5, 0.5), lidfb=0.0, hspot=0.05,
        tts=rng.uniform(20, 70), tto=rng.uniform(0, 60), psi=rng.uniform(0, 180),
        typelidf=1, rsoil=rng.uniform(0.5, 1.2), psoil=rng.uniform(0, 1),
    )  # fmt: skip
    return np.asarray(reflectance)[NM - 400]


def main() -> None:
    rng = np.random.default_rng(0)
    mean = np.exp(np.mean([np.log(canopy(rng)) for _ in range(DRAWS)], axis=0))
    lines = [
        f"# Reflectance of green land: geometric mean of {DRAWS} canopies by PROSAIL",
        "# (PROSPECT-5, Feret et al. 2008; 4SAIL, Verhoef et al. 2007); made by tools/make_canopy_spectrum.py",
        "wavelength_nm,reflectance",
    ]
    TARGET.write_text("\n".join(lines + [f"{nm},{value:.5f}" for nm, value in zip(NM, mean, strict=True)]) + "\n")


if __name__ == "__main__":
    main()
