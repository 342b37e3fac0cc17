"""The gradient of a misfit, node by node, against central differences: cloud on a curved Earth over a hill, in air and
haze, at two wavelengths, seen by an all-sky camera, a satellite and two pyranometers.

    python benchmarks/linear_gradient.py [nodes]

Differences are of fourth order, of fixed points solved to 1e-13, with few ordinates. It takes some minutes.
"""

from __future__ import annotations

import sys

import numpy as np
from pyproj import CRS

from openswim.ground.surface import settled, surface_of
from openswim.optics.matter import matter_of
from openswim.options import Options
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import HenyeyGreenstein
from openswim.scene.rays import Rays
from openswim.transport.engine.ordinates import lebedev
from openswim.transport.linear.of_matter import SceneCore, core_of

WAVELENGTHS_NM = (650.0, 450.0)
SHAPE, CELL_M, LAYER_M = (8, 10, 9), 200.0, 150.0


def core_of_hill(tolerance: float = 1e-13, ordinates: int = 14) -> SceneCore:
    """The scene's core; clear nodes have none of the cloud."""
    nz, ny, nx = SHAPE
    z, y, x = np.meshgrid(*(np.arange(n) / (n - 1) - 0.5 for n in SHAPE), indexing="ij")
    lump = np.exp(-(((z - 0.1) / 0.2) ** 2 + (y / 0.2) ** 2 + (x / 0.2) ** 2))
    lump *= 0.6 + 0.4 * np.random.default_rng(5).random(SHAPE)
    cloud = np.where(lump > 0.05, 0.8 / LAYER_M * lump, 0.0).astype(np.float32)
    along_x, along_y = (CELL_M * (np.arange(n) - (n - 1) / 2) for n in (nx, ny))
    hill = 350 * np.exp(-((y[0] + 0.2) ** 2 + (x[0] - 0.25) ** 2) / 0.05)
    scene = Scene.from_arrays(
        {"cloud": cloud}, along_x, along_y, LAYER_M * np.arange(nz), phase=HenyeyGreenstein(0.85), surface_albedo=0.2,
        crs=CRS.from_proj4("+proj=lcc +lat_1=30 +lat_2=50 +lat_0=40 +lon_0=10 +R=6371000"), terrain_m=hill,
        atmosphere=Atmosphere.us_standard(),
    )  # fmt: skip
    u, v = np.meshgrid(*(2 * [(np.arange(12) + 0.5) / 6 - 1]))
    r = np.hypot(u, v)
    zenith, azimuth = np.radians(78) * r[r <= 1], np.arctan2(v, u)[r <= 1]
    up = np.column_stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])
    down = -np.array([0.3, 0.4, 0.75**0.5])
    ends = np.stack(np.meshgrid(along_x[1:-1], along_y[1:-1], 0.0), axis=-1).reshape(-1, 3)
    views = [Rays(np.array([-500.0, 300.0, 40.0]), up), Rays(ends - 60_000 * down, down)]
    sun = np.array([0.45, 0.46, 0.77])
    scene = settled(scene)
    matter = matter_of(scene, WAVELENGTHS_NM)
    return core_of(
        Options("fast", detail=False), matter, surface_of(scene, matter.wavelengths_nm), sun, views,
        [[40.0, 10.0], [40.002, 9.998]], tolerance, 5, lebedev(ordinates),
    )  # fmt: skip


def main(nodes: int) -> None:
    """Print the greatest difference over the greatest slope, kind by kind."""
    core, rng = core_of_hill(), np.random.default_rng(1)
    images, state = core.forward(core.extinction, core.albedo)
    print("grid", core.shape, "kinds", core.names, "sweeps", state.sweeps)
    residual = images.like(0.2 * rng.standard_normal(images.flat().size) * images.flat())
    bar, albedo_bar = core.adjoint(state, residual)
    columns = core.shape[1] * core.shape[2]
    for kind, name in enumerate(core.names):
        for term in range(2):
            of_term = core.extinction[term].reshape(len(core.names), -1)
            count = nodes if kind == 0 and term == 0 else max(nodes // 40, 12)
            level = np.arange(core.world.nodes) // columns
            own = np.flatnonzero(level >= np.tile(core.world.ground_node.ravel(), core.shape[0]))
            some = own if count >= own.size else np.sort(rng.choice(own, count, replace=False))
            scale = np.abs(bar[term, kind]).max()
            worst, clear = 0.0, float((of_term[kind, some] == 0).mean())
            for n in some:
                h = 0.02 * max(of_term[kind, n], 0.02 * of_term[kind].max())
                slope = 0.0
                for step, share in ((h, 8), (-h, -8), (2 * h, -1), (-2 * h, 1)):
                    moved = of_term.copy()
                    moved[kind, n] += step
                    one = core._solve(term, moved, core.albedo[term].ravel(), state.terms[term])
                    views, ghi = core.observe(term, one)
                    for seen, wanted in zip([*views, ghi], [*(r[term] for r in residual.radiance), residual.ghi[term]],
                                            strict=True):  # fmt: skip
                        slope += share * float(seen @ wanted) / (12 * h)
                worst = max(worst, abs(slope - bar[term, kind].ravel()[n]) / scale)
            which = f"{name} {WAVELENGTHS_NM[term]:.0f} nm"
            print(f"{which:30s} {some.size} nodes, {clear:.2f} of them clear: {worst:.1e}", flush=True)
    slope = 0.0
    for step, share in ((0.02, 8), (-0.02, -8), (0.04, -1), (-0.04, 1)):
        seen = core.forward(core.extinction, core.albedo + step, state)[0].flat()
        slope += share * float(seen @ residual.flat()) / 0.24
    print(f"albedo: {abs(slope / albedo_bar.sum() - 1):.1e}")
    change = 0.05 * rng.standard_normal(core.extinction.shape) * core.extinction
    slopes = core.tangent(state, change).flat()
    left = []
    for h in (1.0, 0.1, 0.01, 0.001):
        moved = core.forward(core.extinction + h * change, core.albedo, state)[0].flat()
        left.append(np.linalg.norm(moved - images.flat() - h * slopes) / (h * np.linalg.norm(slopes)))
    print("Taylor remainders", " ".join(f"{one:.2e}" for one in left))
    of_ground = 0.1 * rng.standard_normal(core.albedo.shape)
    found = core.tangent(state, change, of_ground).flat()
    other = images.like(rng.standard_normal(found.size))
    bars = core.adjoint(state, other)
    size = np.abs(found * other.flat()).sum()
    apart = abs((found * other.flat()).sum() - (change * bars[0]).sum() - (of_ground * bars[1]).sum())
    print(f"dot product {apart / size:.1e} of the sum of absolute products")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1200)
