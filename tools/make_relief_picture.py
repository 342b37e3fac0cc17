"""Make docs/images/relief.jpg: made-up mountains of 30 m in a made-up model of 3 km, from a valley (docs/ground.md).

    python tools/make_relief_picture.py [folder]
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray
from pyproj import CRS

import openswim
from openswim.colour import save
from openswim.lighting import light
from openswim.rendering import render
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.procedural.noise import blur, fractal_noise, lattice_noise, sample, smoothstep

TARGET = Path(__file__).parents[1] / "docs/images"
LAT, LON = 46.5, 10.5
PIXEL_M, NODES = 30.0, 2400
EAST_M, NORTH_M = 615_134.0, 5_150_927.0  # of LAT, LON in UTM 32
EYE = 46.4353, 10.5823
GRASS, ROCK, SNOW = (0.06, 0.08, 0.04), (0.16, 0.15, 0.13), (0.85, 0.86, 0.88)


def mountains(seed: int = 4) -> NDArray:
    """Heights (NODES, NODES), north up: ridged fractal noise, whose valleys are smooth and whose crests are not."""
    rng = np.random.default_rng(seed)
    axes = (PIXEL_M * np.arange(NODES),) * 2
    bend = [fractal_noise(rng, axes, 4000.0, 500.0, gain=0.5) * np.float32(600.0 / PIXEL_M) for _ in range(2)]
    row, column = np.indices((NODES, NODES), dtype=np.float32)
    bent = (row + bend[0], column + bend[1])
    height, weight = np.zeros((NODES, NODES)), 1.0
    for octave in range(9):
        noise = lattice_noise(rng, axes, max(6500.0 / 2**octave, 1.3 * PIXEL_M))
        ridge = (1.0 - np.clip(np.abs(sample(noise, bent) if octave < 5 else noise) / 2.0, 0.0, 1.0)) ** 1.5
        height = height + 0.52**octave * ridge * weight
        weight = 0.15 + 0.85 * smoothstep(height, 0.3, 1.5)  # valleys are smooth
    lowest, highest = np.quantile(height, [0.01, 0.999])
    return 600.0 + 2700.0 * np.maximum((height - lowest) / (highest - lowest), 0.0) ** 1.25


def cover(height: NDArray, seed: int = 5) -> NDArray:
    """Reflectance (3, NODES, NODES): grass, rock where it is steep or high, snow where it is high and not steep."""
    rng = np.random.default_rng(seed)
    axes = (PIXEL_M * np.arange(NODES),) * 2
    patches = sum(0.7**n * lattice_noise(rng, axes, 1200.0 / 3**n) for n in range(3))
    steep = np.hypot(*np.gradient(height, PIXEL_M))
    bare = smoothstep(steep + 0.1 * patches + (height - 2000.0) / 900.0, 0.6, 1.1)
    white = smoothstep((height - 2150.0) / 250.0 + 0.5 * patches - 1.5 * np.maximum(steep - 0.8, 0), 0, 1)
    out = np.array(GRASS) * (1 + 0.25 * patches[..., None])
    for share, colour in ((bare, ROCK), (white, SNOW)):
        out = out + share[..., None] * (np.array(colour) - out)
    return np.moveaxis(np.clip(out, 0.01, 0.95), -1, 0)


def write(path: Path, data: NDArray) -> Path:
    """A GeoTIFF of data (bands, rows, columns)."""
    half = 0.5 * NODES * PIXEL_M
    transform = rasterio.Affine(PIXEL_M, 0, EAST_M - half, 0, -PIXEL_M, NORTH_M + half)
    bands = len(data)
    with rasterio.open(
        path, "w", driver="GTiff", count=bands, height=NODES, width=NODES, dtype="float32", crs="EPSG:32632",
        transform=transform, tiled=True,
    ) as file:  # fmt: skip
        file.write(data.astype(np.float32))
    return path


def model(height: NDArray, cell_m: float = 3000.0) -> openswim.Scene:
    """What a model of 3 km knows of it."""
    n = int(NODES * PIXEL_M / cell_m)
    coarse = blur(height, (40, 40))[:: NODES // n, :: NODES // n][::-1]
    coarse = coarse[:n, :n]
    crs = CRS.from_proj4(f"+proj=lcc +lat_1=40 +lat_2=50 +lat_0={LAT} +lon_0={LON} +R=6371000")
    x = cell_m * (np.arange(n) - (n - 1) / 2)
    scene = openswim.Scene.from_arrays(
        {}, x, x, np.linspace(0.0, 12e3, 25), crs=crs, atmosphere=Atmosphere.us_standard(),
        terrain_m=coarse,
    )  # fmt: skip
    return replace(scene, data=scene.data.drop_vars("surface_albedo", errors="ignore"))


def main(folder: str = "") -> None:
    height = mountains()
    with tempfile.TemporaryDirectory() as temporary:
        ground = openswim.Ground(
            write(Path(temporary) / "albedo.tif", cover(height)), write(Path(temporary) / "dem.tif", height[None])
        )
        scene = replace(model(height), ground=ground)
        started = time.process_time()
        lit = light(scene, solver="fast", sun=(235.0, 24.0))
        print(f"light {time.process_time() - started:.1f} s")
        camera = openswim.Camera.perspective(
            *EYE, 60.0, azimuth_deg=297.0, altitude_deg=2.0, fov_deg=55.0, size=(500, 1000)
        )
        started = time.process_time()
        image = render(lit, camera)
        print(f"view {time.process_time() - started:.1f} s")
        path = (Path(folder) if folder else TARGET) / "relief.jpg"
        save(image, path)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(*sys.argv[1:])
