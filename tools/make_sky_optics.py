"""Make docs/images/sky_optics/*.jpg: a rainbow, a halo display, a glory and a corona (docs/sky-optics.md).

    python tools/make_sky_optics.py [rainbow halo glory corona]
"""

import sys
import time
from pathlib import Path

import numpy as np

from openswim import Camera, Solver, render
from openswim.colour import save
from openswim.optics.displays.shapes import with_shapes
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere

TARGET = Path(__file__).parents[1] / "docs/images/sky_optics"
WAVELENGTHS_NM = (640.0, 600.0, 560.0, 510.0, 460.0, 430.0)


def lumps(shape: tuple[int, int], waves: int, seed: int) -> np.ndarray:
    """A smooth random field (ny, nx) of mean 0 and standard deviation 1, periodic, of up to so many waves."""
    rng = np.random.default_rng(seed)
    ky, kx = (np.fft.fftfreq(n, 1 / n) for n in shape)
    k = np.hypot(ky[:, None], kx)
    spectrum = np.where((k > 0) & (k <= waves), np.maximum(k, 1) ** -1.3, 0) * np.exp(2j * np.pi * rng.random(shape))
    field = np.fft.ifft2(spectrum).real
    return np.asarray((field - field.mean()) / field.std())


def rainbow() -> tuple[Scene, Camera, tuple[float, float]]:
    """Rain and its cloud in the east, the sun low in the west."""
    x, y, z = np.arange(0, 16e3, 400.0), np.arange(0, 16e3, 400.0), np.arange(0, 5.5e3, 300.0)
    zz, yy, xx = np.meshgrid(z, y, x, indexing="ij")
    edge = 1 / (1 + np.exp(-(xx - 5.5e3 - 500 * lumps((y.size, x.size), 5, 3)) / 350))
    north = np.exp(-(((yy - 8e3) / 6.5e3) ** 4))
    streaks = np.maximum(1 + 0.35 * lumps((y.size, x.size), 9, 5), 0.1)
    rain = 6e-4 * edge * north * streaks * np.clip((3000 - zz) / 400, 0, 1)
    body = edge * north * np.clip((zz - 2500) / 500, 0, 1) * np.clip((5000 - zz) / 1000, 0, 1)
    body *= np.maximum(1 + 0.5 * lumps(edge.shape[1:], 10, 7), 0)
    fields = {"rain_content": rain, "liquid_content": 8e-4 * body}
    scene = Scene.from_arrays(
        None, x, y, z, fields=fields, atmosphere=Atmosphere.us_standard(), surface_albedo=0.1
    )
    camera = Camera.perspective(
        x_m=2e3, y_m=8e3, height_m=20.0, azimuth_deg=90.0, altitude_deg=26.0, fov_deg=100.0, size=(400, 600)
    )
    return scene, camera, (270.0, 10.0)


def halo() -> tuple[Scene, Camera, tuple[float, float]]:
    """A veil of cirrus before a sun of 20 degrees."""
    x, z = np.arange(0, 60e3, 1000.0), np.arange(7.5e3, 9.6e3, 250.0)
    shape = np.exp(0.45 * lumps((x.size, x.size), 12, 11))
    ice = 5e-6 * shape * np.exp(-(((z - 8500) / 500) ** 2))[:, None, None]
    z = np.concatenate([[0.0, 4e3], z])
    ice = np.concatenate([np.zeros((2, *ice.shape[1:])), ice])
    scene = Scene.from_arrays(
        None, x, x, z, fields={"ice_content": ice}, atmosphere=Atmosphere.us_standard(), surface_albedo=0.4,
        periodic=True,
    )
    camera = Camera.perspective(
        x_m=30e3, y_m=30e3, azimuth_deg=180.0, altitude_deg=33.0, fov_deg=86.0, size=(450, 600)
    )
    return with_shapes(scene, pristine=0.3, plates=0.015, columns=0.05), camera, (180.0, 20.0)


def glory() -> tuple[Scene, Camera, tuple[float, float]]:
    """Stratocumulus below an aeroplane."""
    x, z = np.arange(0, 9.6e3, 200.0), np.arange(0, 1.7e3, 100.0)
    top = 1250 + 90 * lumps((x.size, x.size), 24, 21)
    zz = z[:, None, None]
    water = 4e-4 * np.clip((top - zz) / 100, 0, 1) * np.clip((zz - 700) / 100, 0, 1)
    fields = {"liquid_content": water, "liquid_effective_radius": np.full(water.shape, 8e-6)}
    scene = Scene.from_arrays(
        None, x, x, z, fields=fields, atmosphere=Atmosphere.us_standard(), surface_albedo=0.06, periodic=True
    )
    camera = Camera.perspective(
        x_m=4.8e3, y_m=4.8e3, height_m=3000.0, azimuth_deg=0.0, altitude_deg=-37.0, fov_deg=24.0, size=(320, 400)
    )
    return with_shapes(scene, droplet_variance=0.02), camera, (180.0, 38.0)


def corona() -> tuple[Scene, Camera, tuple[float, float]]:
    """A thin cloud of water before the sun."""
    x, z = np.arange(0, 9.6e3, 200.0), np.concatenate([[0.0, 2.5e3], np.arange(3.5e3, 4.3e3, 100.0)])
    shape = np.exp(0.6 * lumps((x.size, x.size), 24, 31))
    water = 1.0e-5 * shape * np.exp(-(((z - 3850) / 150) ** 2))[:, None, None]
    fields = {"liquid_content": water, "liquid_effective_radius": np.full(water.shape, 8e-6)}
    scene = Scene.from_arrays(
        None, x, x, z, fields=fields, atmosphere=Atmosphere.us_standard(), surface_albedo=0.1, periodic=True
    )
    camera = Camera.perspective(
        x_m=4.8e3, y_m=4.8e3, azimuth_deg=180.0, altitude_deg=50.0, fov_deg=22.0, size=(320, 400)
    )
    return with_shapes(scene, droplet_variance=0.01), camera, (180.0, 50.0)


SCENES = {"rainbow": rainbow, "halo": halo, "glory": glory, "corona": corona}


def main() -> None:
    TARGET.mkdir(exist_ok=True)
    for name in sys.argv[1:] or SCENES:
        scene, camera, sun = SCENES[name]()
        start = time.perf_counter()
        image = render(scene, camera, Solver("fast", quality="preview"), wavelengths_nm=WAVELENGTHS_NM, sun=sun)
        save(image, TARGET / f"{name}.jpg", caption="none")
        print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
