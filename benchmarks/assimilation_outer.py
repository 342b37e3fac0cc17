"""Not the same model: pictures by `fast` of a field on 20 m, clouds found again on cells of 40 m by the linear core.

`python benchmarks/assimilation_outer.py LES`: one satellite and three cameras, an error of 25 % (representation and
noise). r is the correlation of `fast` of what was found with `fast` of the truth, of a camera that was not used.
Departures by the linear core alone, and by `fast` in outer loops.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import openswim
from assimilation_twin import (
    BELIEF,
    CELL_M,
    PLACES,
    SUN,
    all_sky,
    bare,
    correlation,
    displaced,
    from_above,
    rico,
    scene_of,
)
from openswim import Scene


def main() -> None:
    fine, coarse = rico(sys.argv[1], coarse=1), rico(sys.argv[1], coarse=2)
    truth, guess = scene_of(fine, CELL_M / 2), scene_of(displaced(coarse))
    views = [from_above(), *(all_sky(place) for place in PLACES[3])]
    images = [openswim.render(truth, camera, wavelengths_nm=[550], sun=SUN) for camera in views]
    judge = all_sky((0.6, 0.45))
    use = judge.pixels().inside & (judge.pixels().angle_to_deg(*SUN) > 20)

    def unseen(scene: Scene) -> np.ndarray:
        seen = openswim.render(scene, judge, wavelengths_nm=[550], sun=SUN).radiance.values[..., 0]
        return np.asarray(seen[use], float)

    want = unseen(truth)
    print(f"first guess: r {correlation(unseen(guess), want):.3f}", flush=True)
    op = openswim.observe(guess, views, sun=SUN, controls="extinction_cloud", heights_m=(2 * CELL_M, 22 * CELL_M))
    observed = op.observations(images, noise=0.02, representation=0.25)
    for departures, outer in (("linear", 1), ("fast", 3)):
        start = time.process_time()
        found = openswim.analyse(op, observed, background=BELIEF, departures=departures, outer=outer, iterations=60)
        seconds, field = time.process_time() - start, bare(op, found.state)
        columns, true = field.sum(axis=0), coarse.sum(axis=0)
        print(
            f"{departures}: 3-D {np.abs(field - coarse).sum() / coarse.sum():.3f}, "
            f"column {np.abs(columns - true).sum() / true.sum():.3f}, r {correlation(unseen(found.scene), want):.3f}, "
            f"rms {max(found.rms(found.after)):.2f} errors, {seconds:.0f} CPU s", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
