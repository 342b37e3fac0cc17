"""Make src/openswim/optics/data/ice_prisms.npz: phase functions of smooth hexagonal prisms in all orientations.

    python tools/make_ice_halos.py

Takes a minute. Refracted and reflected light alone, without diffraction and without what goes straight on through faces
that are opposite each other, whose share is kept beside it. Means over the solar disc, in steps of .1 degrees; the
logarithm of P, whose mean over the sphere is 1, in half precision. Lengths are given over the diameter of the
circumscribed circle.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from make_mie_tables import disc_average

from openswim.optics.displays.crystals import LENGTH_OVER_WIDTH
from openswim.transport.ice.prisms import scattered

INDEX = np.array([1.3194, 1.3115, 1.3069])  # of 400, about 546, and 700 nm (Warren & Brandt 2008)
RAYS = 10_000_000  # of which about half meet the prism
STEPS = 1800
OUT = Path(__file__).parents[1] / "src/openswim/optics/data/ice_prisms.npz"


def main() -> None:
    edge = np.linspace(0, 180, STEPS + 1)
    middle = 0.5 * (edge[1:] + edge[:-1])
    solid = 0.5 * -np.diff(np.cos(np.radians(edge)))
    log_value = np.empty((len(LENGTH_OVER_WIDTH), INDEX.size, STEPS), np.float16)
    straight = np.empty(log_value.shape[:2])
    for s, ratio in enumerate(LENGTH_OVER_WIDTH.values()):
        for i, index in enumerate(INDEX):
            shares = scattered(index, ratio, RAYS, STEPS)
            straight[s, i] = shares[-1]
            value = shares[:-1] / (1 - shares[-1]) / solid
            log_value[s, i] = np.log(np.maximum(disc_average(middle, middle, value), 1e-4))
    np.savez_compressed(
        OUT, shape=list(LENGTH_OVER_WIDTH), index=INDEX, angle_deg=middle, log_value=log_value, straight=straight
    )
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
