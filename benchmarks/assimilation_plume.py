"""A plume of smoke found again by six cameras on the ground (after Aides et al. 2013): one row of errors.

`python benchmarks/assimilation_plume.py`: smoke rises from a fire and drifts off, 16 x 24 x 24 nodes 50 m apart, with
optical depths up to .74 over haze of .08. Pictures are by the linear core, with a noise of 2 %, at 550 nm; the sun is
50 degrees high. Two first guesses: smoke that drifts elsewhere, lower, wider and thinner; and no smoke at all.
Errors are sum |found - truth| / sum truth of what is above the haze, of nodes and of columns; r is the correlation of
a camera that was not used, without 20 degrees around the sun.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

import openswim
from openswim import Background, Camera, Scene
from openswim.scene.optics import Optics
from openswim.scene.phase import HenyeyGreenstein

F64 = NDArray[np.float64]

SHAPE, CELL_M, SUN = (16, 24, 24), 50.0, (150.0, 50.0)
WIDE = (SHAPE[1] - 1) * CELL_M
HAZE = 1e-4  # 1/m
PLACES = [(0.15, 0.2), (0.12, 0.7), (0.5, 0.9), (0.88, 0.75), (0.85, 0.25), (0.5, 0.1)]


def smoke(toward_deg: float, rise_m: float, wide_m: float, thick_per_m: float) -> F64:
    """A plume (nz, ny, nx) from a fire in the southwest: it rises, bends, widens, and is lumpy; clear at the sides."""
    z, y, x = np.meshgrid(*(CELL_M * np.arange(n) for n in SHAPE), indexing="ij")
    a = np.radians(toward_deg)
    east, north = x - 350.0, y - 400.0
    along, across = east * np.sin(a) + north * np.cos(a), east * np.cos(a) - north * np.sin(a)
    ahead = np.maximum(along, 0.0)
    height, wide = 120.0 + rise_m * (1 - np.exp(-ahead / 300.0)), wide_m * (1 + ahead / 500.0)
    meander = 50.0 * np.sin(ahead / 120.0)
    lumps = 1 + 0.5 * np.sin(along / 45.0) * np.cos(z / 60.0)
    far = ((across - meander) / wide) ** 2 + ((z - height) / (0.8 * wide)) ** 2 + (np.minimum(along, 0) / wide_m) ** 2
    out = thick_per_m * lumps * np.exp(-far) * (wide_m / wide)
    out[:, [0, -1]] = out[:, :, [0, -1]] = out[[0, -1]] = 0.0
    return np.where(out > 0.02 * thick_per_m, out, 0.0)


def scene_of(plume: F64) -> Scene:
    y, x, z = (CELL_M * np.arange(n) for n in (SHAPE[1], SHAPE[2], SHAPE[0]))
    out = Scene.from_arrays(
        None, x, y, z, fields={"aerosol_extinction": HAZE + plume}, surface_albedo=0.15, place=(32.8, 35.0),
        atmosphere="default",
    )  # fmt: skip
    out.optics["aerosol"] = Optics(0.92, HenyeyGreenstein(0.65))
    return out


def all_sky(place: tuple[float, float], size: int = 32) -> Camera:
    return Camera.allsky(y_m=place[0] * WIDE, x_m=place[1] * WIDE, height_m=1.0, size=size, fov_deg=160.0)


def main() -> None:
    truth = smoke(40.0, 320.0, 75.0, 6e-3)
    print(f"truth: columns to {truth.sum(axis=0).max() * CELL_M:.2f}", flush=True)
    guesses = {"displaced": smoke(62.0, 230.0, 95.0, 4e-3), "none": np.zeros(SHAPE)}
    views = [all_sky(place) for place in PLACES]
    for name, guess in guesses.items():
        op = openswim.observe(
            scene_of(guess), views, sun=SUN, controls="aerosol_extinction", heights_m=(CELL_M, 14 * CELL_M), lean=True
        )  # fmt: skip
        true = op.first()
        true["aerosol_extinction"].values[:] = HAZE + truth
        images = [image.to_dataset(name="radiance") for image in op.pictures(op(true).values)]
        observed = op.observations(images, noise=0.02)
        chance = np.random.default_rng(0).standard_normal(op.size)
        observed = observed.assign(value=observed["value"] + observed["error"] * chance)
        start = time.process_time()
        found = openswim.analyse(op, observed, background=Background(length_m=80.0), iterations=60)
        seconds = time.process_time() - start
        judge = openswim.observe(
            scene_of(guess), all_sky((0.4, 0.55)), sun=SUN, controls="aerosol_extinction", where=np.ones(SHAPE),
            near_sun_deg=20.0, lean=True,
        )  # fmt: skip
        use, want = judge.instruments[0].usable, judge(true).values
        scores = []
        for state in (found.first, found.state):
            plume = state["aerosol_extinction"].values - HAZE
            both = (plume, truth), (plume.sum(axis=0), truth.sum(axis=0))
            r = float(np.corrcoef(judge(state).values[use], want[use])[0, 1])
            scores.append([*(float(np.abs(a - b).sum() / b.sum()) for a, b in both), r])
        rows = zip(("3-D", "column", "r"), *scores, strict=True)
        told = ", ".join(f"{what} {before:.3f} > {after:.3f}" for what, before, after in rows)
        print(f"{name}: {told}; cost {found.costs[-1] / found.used:.2f} each, {seconds:.0f} CPU s", flush=True)


if __name__ == "__main__":
    main()
