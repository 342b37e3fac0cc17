"""A larger field: 128 x 128 x 48 nodes, three wavelengths, a satellite and three cameras.

`python benchmarks/assimilation_size.py LES`: CPU seconds of a forward, of one that is begun from a state nearby, of a
tangent linear and of an adjoint, and the peak of memory. `--loop` goes through an outer loop with ten inner iterations
as well (conjugate gradients of Gauss-Newton, first the preconditioner). `--lean` takes the lean core.
LES: `les_rico_122x106x39.txt`, 20 m, mirrored at its sides to 128 x 128 columns.
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import openswim
from openswim import Background, Camera, Scene
from openswim.scene.phase import HenyeyGreenstein

SHAPE, CELL_M = (48, 128, 128), 20.0
SUN, WAVELENGTHS = (150.0, 50.0), [615.0, 546.0, 450.0]
WIDE = 127 * CELL_M


def rico(path: str) -> NDArray[np.float64]:
    """Extinction (1/m), five clear levels below it, clear at the sides."""
    rows = np.loadtxt(path, delimiter=",", skiprows=5)
    at = rows[:, :3].astype(int)
    full = np.zeros((39, 106, 122))
    full[at[:, 2], at[:, 1], at[:, 0]] = 1.5 * rows[:, 3] / rows[:, 4]
    full = np.pad(full, ((0, 0), (11, 11), (3, 3)), mode="symmetric")
    out = np.zeros(SHAPE)
    out[5:44, 3:-3, 3:-3] = full[:, 3:-3, 3:-3]
    return out


def scene_of(extinction: NDArray[np.float64]) -> Scene:
    y, x, z = (CELL_M * np.arange(n) for n in (SHAPE[1], SHAPE[2], SHAPE[0]))
    return Scene.from_arrays(
        extinction.astype(np.float32), x, y, z, phase=HenyeyGreenstein(0.85), surface_albedo=0.1, place=(18.0, -61.5),
        atmosphere="default",
    )  # fmt: skip


def cameras() -> list[Camera]:
    size, height = 64, 5e4
    above = Camera(
        "perspective", (size, size), x_m=0.5 * WIDE, y_m=0.5 * WIDE, height_m=height, above="sea level",
        azimuth_deg=0.0, altitude_deg=-90.0, fov_deg=float(np.degrees(2 * np.arctan(0.5 * WIDE / height))),
    )  # fmt: skip
    places = ((0.25, 0.3), (0.72, 0.25), (0.55, 0.78))
    ground = [Camera.allsky(y_m=a * WIDE, x_m=b * WIDE, height_m=1.0, size=size, fov_deg=150.0) for a, b in places]
    return [above, *ground]


class Clock:
    """CPU and wall seconds since the last look, as text."""

    def __init__(self) -> None:
        self.cpu, self.wall = time.process_time(), time.monotonic()

    def __str__(self) -> str:
        cpu, wall = time.process_time(), time.monotonic()
        text = f"{cpu - self.cpu:.1f} CPU s, {wall - self.wall:.1f} s"
        self.cpu, self.wall = cpu, wall
        return f"{text}; peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("les")
    parser.add_argument("--loop", action="store_true", help="an outer loop with ten inner iterations")
    parser.add_argument("--lean", action="store_true")
    options = parser.parse_args()
    truth = rico(options.les)
    guess = 0.8 * gaussian_filter(np.roll(truth, (0, 6, 4), (0, 1, 2)), 1.5)
    clock = Clock()
    op = openswim.observe(
        scene_of(guess), cameras(), sun=SUN, wavelengths_nm=WAVELENGTHS, controls="extinction_cloud",
        heights_m=(3 * CELL_M, 46 * CELL_M), lean=options.lean,
    )  # fmt: skip
    print(f"{op}, {op.core.shape} nodes: made in {clock}", flush=True)
    state = op.first()
    first = op.linearize(state)
    print(f"forward: {clock}; sweeps {first._light.sweeps}", flush=True)
    near = state.copy(deep=True)
    near["extinction_cloud"].values[:] *= 1.1
    lin = op.linearize(near, first)
    print(f"forward, from nearby: {clock}; sweeps {lin._light.sweeps}", flush=True)
    row = lin.jvp(0.1 * state).values
    print(f"tangent linear: {clock}; sweeps {lin._light.tangent_sweeps}", flush=True)
    lin.vjp(row)
    print(f"adjoint: {clock}; sweeps {lin._light.adjoint_sweeps}", flush=True)
    if options.loop:
        true = op.first()
        true["extinction_cloud"].values[:] = truth
        images = [image.to_dataset(name="radiance") for image in op.pictures(op(true).values)]
        observed = op.observations(images, noise=0.05)
        print(f"observed: {clock}", flush=True)
        found = openswim.analyse(
            op, observed, background=Background(length_m=60.0), method="gauss-newton", outer=1, iterations=10
        )
        before, after = max(found.rms(found.before)), max(found.rms(found.after))
        print(f"an outer loop: {clock}; departures of {before:.1f} errors before, {after:.1f} after", flush=True)


if __name__ == "__main__":
    main()
