"""Reduce the Bright Star Catalogue to what the package ships: python tools/make_star_catalogue.py bsc5.dat

Source: D. Hoffleit and W. H. Warren Jr. 1991, The Bright Star Catalogue, 5th revised edition, Astronomical Data Center,
NSSDC/ADC; CDS V/50 (columns as in its ReadMe). Numbers that have been measured, distributed without a licence or a
condition; none of the remarks are taken. The fourteen lines without a place (novae, clusters) fall away.
"""

import argparse
from pathlib import Path

import numpy as np

from openswim.lights.stars import UNKNOWN

FAINTEST = 6.5


def main() -> None:
    """Read, cut at the magnitude, sort by it, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("catalogue", type=Path)
    target = Path(__file__).parents[1] / "src/openswim/lights/data/bright_stars.npz"
    lines = parser.parse_args().catalogue.read_text("latin-1").splitlines()
    stars = [line.ljust(200) for line in lines if line[75:77].strip() and line[102:107].strip()]
    stars = [line for line in stars if float(line[102:107]) <= FAINTEST]
    stars.sort(key=lambda line: float(line[102:107]))

    def column(first: int, last: int, scale: float, empty: float = 0.0) -> np.ndarray:
        """Columns `first` to `last` (from 1) as whole numbers."""
        text = [line[first - 1 : last].strip() for line in stars]
        return np.array([round(float(t) * scale) if t else empty for t in text])

    ascension = column(76, 77, 36000) + column(78, 79, 600) + column(80, 83, 10)
    declination = column(85, 86, 3600) + column(87, 88, 60) + column(89, 90, 1)
    south = np.array([line[83] == "-" for line in stars])
    np.savez_compressed(
        target,
        number=column(1, 4, 1).astype(np.int16),
        name=np.array([" ".join(line[4:14].split()) for line in stars], "S10"),
        right_ascension_ds=ascension.astype(np.int32),  # tenths of seconds of time
        declination_arcsec=np.where(south, -declination, declination).astype(np.int32),
        proper_motion_ra_mas=column(149, 154, 1000).astype(np.int16),
        proper_motion_dec_mas=column(155, 160, 1000).astype(np.int16),
        magnitude_cmag=column(103, 107, 100).astype(np.int16),
        colour_cmag=column(110, 114, 100, UNKNOWN).astype(np.int16),
    )
    print(f"{target}: {len(stars)} stars, {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
