"""Clouds found again from pictures of them: `python benchmarks/assimilation_twin.py LES` prints a row for each case.

LES: `les_rico_122x106x39.txt` (RICO trade cumulus, 20 m). A cut of 24 x 32 x 32 nodes at 40 m is the truth; the first
guess is that displaced by 120 and 80 m, blurred, and .8 as thick. Noise 2 %, sun at 40 degrees from the zenith. Errors
are sum |found - truth| / sum truth, of nodes and of columns; r is the correlation of a camera that was not used,
without 20 degrees around the sun. CPU seconds are of the analysis alone, one thread, kernels compiled.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import openswim
from openswim import Background, Camera, Scene
from openswim.assimilation import Operator
from openswim.assimilation.departures import scene_of as scene_with
from openswim.scene.phase import HenyeyGreenstein

F64 = NDArray[np.float64]

SUN = (150.0, 50.0)
CELL_M = 40.0
SHAPE = (24, 32, 32)
WIDE = (SHAPE[1] - 1) * CELL_M
BELIEF = Background(length_m=60.0)
PLACES: dict[int, list[tuple[float, float]]] = {
    0: [], 1: [(0.5, 0.5)], 3: [(0.25, 0.3), (0.72, 0.25), (0.55, 0.78)],
    9: [((a + 0.5) / 3, (b + 0.5) / 3) for a in range(3) for b in range(3)],
}  # fmt: skip


def rico(path: str, coarse: int = 2) -> F64:
    """Extinction (1/m), means over so many columns each way, five clear levels below it, clear at the sides."""
    rows = np.loadtxt(path, delimiter=",", skiprows=5)
    at = rows[:, :3].astype(int)
    full = np.zeros((39, 106, 122))
    full[at[:, 2], at[:, 1], at[:, 0]] = 1.5 * rows[:, 3] / rows[:, 4]
    nz, ny, nx = SHAPE
    part = full[: nz - 6, 20 : 20 + 2 * ny, 30 : 30 + 2 * nx]
    part = part.reshape(len(part), 2 * ny // coarse, coarse, 2 * nx // coarse, coarse).mean(axis=(2, 4))
    out = np.zeros((nz, *part.shape[1:]))
    out[5 : 5 + len(part)] = part
    edge = np.zeros(part.shape[1:], bool)
    margin = 4 // coarse
    edge[margin:-margin, margin:-margin] = True
    return np.where(edge, out, 0.0)


def displaced(truth: F64) -> F64:
    """A first guess, clear at the sides as the truth is."""
    out = np.zeros_like(truth)
    inner = np.s_[2:-2, 2:-2, 2:-2]
    out[inner] = 0.8 * gaussian_filter(np.roll(truth, (0, 3, 2), (0, 1, 2)), 1.2)[inner]
    return out


def scene_of(extinction: F64, cell_m: float = CELL_M, albedo: float = 0.1) -> Scene:
    y, x = (cell_m * np.arange(n) for n in extinction.shape[1:])
    return Scene.from_arrays(
        extinction.astype(np.float32), x, y, CELL_M * np.arange(extinction.shape[0]), phase=HenyeyGreenstein(0.85),
        surface_albedo=albedo, place=(18.0, -61.5), atmosphere="default",
    )  # fmt: skip


def all_sky(place: tuple[float, float], size: int = 40) -> Camera:
    return Camera.allsky(y_m=place[0] * WIDE, x_m=place[1] * WIDE, height_m=1.0, size=size, fov_deg=150.0)


def from_above(size: int = 40) -> Camera:
    """So high and narrow that its rays are all but parallel."""
    height = 5e4
    fov = float(np.degrees(2 * np.arctan(0.5 * WIDE / height)))
    return Camera("perspective", (size, size), x_m=0.5 * WIDE, y_m=0.5 * WIDE, height_m=height, above="sea level",
                  azimuth_deg=0.0, altitude_deg=-90.0, fov_deg=fov)  # fmt: skip


def correlation(a: F64, b: F64) -> float:
    return float(np.corrcoef(a, b)[0, 1])


class Judge:
    """How near a state is to the truth, and how a camera that was not used sees both."""

    def __init__(self, truth: F64, guess: Scene) -> None:
        self.truth = truth
        self.op = openswim.observe(
            guess, [all_sky((0.62, 0.45))], sun=SUN, controls="extinction_cloud", where=np.ones(SHAPE),
            near_sun_deg=20.0,
        )  # fmt: skip
        self.use = self.op.instruments[0].usable
        self.want = self._seen(truth)

    def _seen(self, extinction: F64) -> F64:
        state = self.op.first()
        state["extinction_cloud"].values[:] = extinction
        return np.asarray(self.op(state).values[self.use])

    def __call__(self, extinction: F64) -> dict[str, float]:
        columns, true = extinction.sum(axis=0), self.truth.sum(axis=0)
        return {
            "3-D": float(np.abs(extinction - self.truth).sum() / self.truth.sum()),
            "column": float(np.abs(columns - true).sum() / true.sum()),
            "r": correlation(self._seen(extinction), self.want),
        }


def case(truth: F64, judge: Judge, cameras: int, satellites: int, pyranometers: int = 0, noise: float = 0.02,
         lean: bool = False, **settings: Any) -> str:  # fmt: skip
    """One analysis, as a row of text."""
    guess = scene_of(displaced(truth))
    n = round(pyranometers**0.5)
    at: F64 = np.linspace(3, SHAPE[1] - 4, n) * CELL_M
    points = [(y, x) for y in at for x in at]
    views = [from_above()] * satellites + [all_sky(p) for p in PLACES[cameras]]
    heights = (2 * CELL_M, 22 * CELL_M)
    op = openswim.observe(guess, views, points, sun=SUN, controls="extinction_cloud", heights_m=heights, lean=lean)
    observed = seen_of(op, truth, noise)
    start = time.process_time()
    found = openswim.analyse(op, observed, background=settings.pop("background", BELIEF), **settings)
    seconds = time.process_time() - start
    before, after = judge(bare(op, found.first)), judge(bare(op, found.state))
    scores = ", ".join(f"{name} {before[name]:.3f} > {after[name]:.3f}" for name in before)
    misfit = found.costs[-1] / found.used
    return f"{scores}; cost {misfit:.2f} each, {len(found.costs) - 1} iterations, {seconds:.0f} CPU s"


def bare(op: Operator, state: xr.Dataset) -> F64:
    """What the scene of an analysis has."""
    return np.asarray(scene_with(op, state).data["extinction_cloud"].values, float)


def seen_of(op: Operator, truth: F64, noise: float) -> xr.Dataset:
    """What is observed of the truth by the same model, with noise."""
    state = op.first()
    state["extinction_cloud"].values[:] = truth
    row = op(state).values
    images = [image.to_dataset(name="radiance") for image in op.pictures(row)]
    observed = op.observations(images, op.irradiance_w_m2(row), noise=noise, irradiance_noise=noise)
    chance = np.random.default_rng(0).standard_normal(op.size)
    return observed.assign(value=observed["value"] + observed["error"] * chance)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("les")
    parser.add_argument("--only", help="a part of a case's name")
    options = parser.parse_args()
    truth = rico(options.les)
    judge = Judge(truth, scene_of(displaced(truth)))
    cases: dict[str, dict[str, Any]] = {
        "1 above, 3 cameras, 60": {"cameras": 3, "satellites": 1, "iterations": 60},
        "1 above, 3 cameras, 60, lean": {"cameras": 3, "satellites": 1, "iterations": 60, "lean": True},
        "1 above, 3 cameras, 40": {"cameras": 3, "satellites": 1, "iterations": 40},
        "1 above, 9 cameras, 60": {"cameras": 9, "satellites": 1, "iterations": 60},
        "81 pyranometers, 60, lean": {
            "cameras": 0, "satellites": 0, "pyranometers": 81, "iterations": 60, "lean": True,
        },
        "1 above, 9 cameras, 330, lean": {"cameras": 9, "satellites": 1, "iterations": 330, "lean": True},
        "1 above, 3 cameras, Gauss-Newton": {"cameras": 3, "satellites": 1, "iterations": 60, "method": "gauss-newton"},
    }
    for name, settings in cases.items():
        if options.only is None or options.only in name:
            print(f"{name}: {case(truth, judge, **settings)}", flush=True)


if __name__ == "__main__":
    main()
