"""Make src/openswim/lights/data/solar_spectrum.csv from the ASTM G173-03 extraterrestrial spectrum.

The table is that of Gueymard (2004), 280-4000 nm, a work of the US National Renewable Energy Laboratory in
the public domain; the wheel of pvlib carries it.  Means over bins keep every integral:

    pip download --no-deps pvlib
    python tools/make_solar_spectrum.py pvlib-*.whl
"""

import io
import sys
import zipfile
from pathlib import Path

import numpy as np

TOTAL_IN_SOURCE = 1366.1  # W m-2 over all wavelengths: the solar constant to which Gueymard (2004) is scaled
TOTAL_MEASURED = 1361.1  # W m-2: the value from SORCE/TIM and its successors (Gueymard 2018)
TARGET = Path(__file__).parents[1] / "src/openswim/lights/data/solar_spectrum.csv"


def bin_edges_nm() -> np.ndarray:
    """5 nm where the eye sees, coarser in the infrared."""
    return np.concatenate(
        [np.arange(280, 1000, 5), np.arange(1000, 2000, 20), np.arange(2000, 4001, 100)]
    ).astype(float)


def main(wheel: str) -> None:
    text = zipfile.ZipFile(wheel).read("pvlib/data/ASTMG173.csv").decode()
    wavelength, extraterrestrial = np.loadtxt(
        io.StringIO(text), delimiter=",", skiprows=2, usecols=(0, 1), unpack=True
    )
    step = np.diff(wavelength) * (extraterrestrial[1:] + extraterrestrial[:-1]) / 2
    cumulative = np.concatenate([[0.0], np.cumsum(step)])
    edges = bin_edges_nm()
    mean = (
        np.diff(np.interp(edges, wavelength, cumulative)) / np.diff(edges) * TOTAL_MEASURED / TOTAL_IN_SOURCE
    )
    lines = [
        "# Extraterrestrial solar spectral irradiance at 1 au, means over bins",
        "# ASTM G173-03 / Gueymard (2004), NREL, public domain; scaled to a total of 1361.1 W m-2",
        "# made by tools/make_solar_spectrum.py",
        "from_nm,to_nm,irradiance_w_m2_nm",
    ]
    lines += [
        f"{low:g},{high:g},{value:.6g}" for low, high, value in zip(edges[:-1], edges[1:], mean, strict=True)
    ]
    TARGET.write_text("\n".join(lines) + "\n")
    print(f"{TARGET}: {len(mean)} bins, {np.sum(mean * np.diff(edges)):.1f} W m-2 between 280 and 4000 nm")


if __name__ == "__main__":
    main(sys.argv[1])
