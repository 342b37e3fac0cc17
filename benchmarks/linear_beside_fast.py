"""The linear core beside `fast`: pictures, and how they change with the cloud.

    python benchmarks/linear_beside_fast.py LES

LES: `les_rico_122x106x39.txt`. A cut of 48 x 48 columns and 26 levels (to a depth of 15), the sun 40 degrees high, no
air, black ground. RMSE and bias are over what is brighter than a twentieth of the brightest pixel, without 10 degrees
around the sun, of its mean. Then the angle and the length of the tangent linear to differences of `fast`, for smooth
changes of the cloud and for cloud that clear nodes gain from a floor of .02 per km. Twenty CPU seconds.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from openswim import Scene, Solver
from openswim.scene.phase import HenyeyGreenstein
from openswim.scene.rays import Rays

F64 = NDArray[np.float64]

CELL_M, LAYER_M, PIXELS = 20.0, 40.0, 48
SUN = np.array([0.866, 0.5, 1.0]) * np.sin(np.radians(50.0))
SUN[2] = np.cos(np.radians(50.0))


def cut(path: str) -> F64:
    """Extinction (26, 48, 48), 1/m, clear at all sides."""
    rows = np.loadtxt(path, delimiter=",", skiprows=5)
    x, y, z = rows[:, :3].astype(int).T
    every = np.zeros((39, 106, 122))
    every[z, y, x] = 1.5 * rows[:, 3] / rows[:, 4]
    out = np.zeros((26, 48, 48))
    out[2:-2, 2:-2, 2:-2] = every[2:24, 22:66, 36:80]
    return out


def scene(extinction: F64) -> Scene:
    across, levels = CELL_M * np.arange(48), LAYER_M * np.arange(26)
    return Scene.from_arrays(
        extinction.astype(np.float32), across, across, levels, phase=HenyeyGreenstein(0.85), surface_albedo=0.0,
        atmosphere=None,
    )  # fmt: skip


def eyes() -> dict[str, Rays]:
    """From above, aslant, and an all-sky camera on the ground."""
    wide, share = CELL_M * 47, (np.arange(PIXELS) + 0.5) / PIXELS
    x, y = (a.ravel() for a in np.meshgrid(wide * share, wide * share))
    end = np.stack([x, y, 0 * x], axis=-1)
    tilt = np.radians(40.0)
    down = -np.array([0.8 * np.sin(tilt), 0.6 * np.sin(tilt), np.cos(tilt)])
    u, v = (a.ravel() for a in np.meshgrid(2 * share - 1, 2 * share - 1))
    zenith, around = np.radians(75.0) * np.hypot(u, v), np.arctan2(v, u)
    up = np.stack([np.sin(zenith) * np.cos(around), np.sin(zenith) * np.sin(around), np.cos(zenith)], axis=-1)
    return {
        "from above": Rays(end + np.array([0.0, 0.0, 1500.0]), np.broadcast_to([0.0, 0.0, -1.0], end.shape).copy()),
        "aslant": Rays(end - 1500.0 / np.cos(tilt) * down, np.broadcast_to(down, end.shape).copy()),
        "from the ground": Rays(np.array([wide / 2, wide / 2, 1e-3]), up[np.hypot(u, v) <= 1]),
    }


def apart(a: F64, b: F64) -> str:
    """Angle and length of one change to another."""
    cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
    return f"{np.degrees(np.arccos(min(1.0, cosine))):.2f} degrees, {np.linalg.norm(a) / np.linalg.norm(b):.3f}"


def main() -> None:
    cloud, views = cut(sys.argv[1]), eyes()
    away = [np.asarray(rays.directions() @ SUN < np.cos(np.radians(10.0))) for rays in views.values()]

    def seen(extinction: F64, solver: str) -> list[F64]:
        light = Solver(solver, tolerance=1e-3, detail=False).solve(scene(extinction), SUN, [550.0])
        return [np.ravel(light.view(rays).radiance).astype(float) for rays in views.values()]

    for name, own, theirs, use in zip(views, seen(cloud, "linear"), seen(cloud, "fast"), away, strict=True):
        bright = use & (theirs > 0.05 * theirs.max())
        off = 100 * (own - theirs)[bright] / theirs[bright].mean()
        print(f"{name}: RMSE {np.sqrt((off**2).mean()):.2f} %, bias {off.mean():+.2f} %", flush=True)

    rng = np.random.default_rng(3)
    smooth = cloud * gaussian_filter(rng.standard_normal(cloud.shape), 3.0)
    smooth *= 0.09 / np.abs(smooth[cloud > 0] / cloud[cloud > 0]).max()  # 9 % at most
    gained = np.pad((gaussian_filter(cloud, 2.0) * (cloud == 0))[1:-1, 1:-1, 1:-1], 1)
    gained *= 2e-5 / gained.max()
    # `fast` jumps where the last of a node's cloud goes, so that there differences are of one side
    cases = ("smooth changes", cloud, smooth, (1, -1)), ("clear nodes", cloud + gained, gained, (5, 0))
    for title, about, change, steps in cases:
        core = Solver("linear", tolerance=1e-4).linear_core(scene(about), SUN, [550.0], views=list(views.values()))
        _, state = core.forward(core.extinction, core.albedo)
        more, less = (core_extinction(about + step * change) for step in steps)
        found = core.tangent(state, more - less, 0 * core.albedo).radiance
        up, down = (seen(about + step * change, "fast") for step in steps)
        for name, own, a, b, use in zip(views, found, up, down, away, strict=True):
            print(f"{title}, {name}: {apart(np.ravel(own)[use], (a - b)[use])}", flush=True)


def core_extinction(extinction: F64) -> F64:
    """At the nodes of the core's own grid."""
    return Solver("linear").linear_core(scene(extinction), SUN, [550.0]).extinction


if __name__ == "__main__":
    main()
