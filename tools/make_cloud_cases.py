"""Make 3-D reference cases of one's own: a cloud field under other suns, by the Monte Carlo of `reference`.

    python tools/make_cloud_cases.py FILE --sun 30 --sun 75 -o cases && openswim validate cases

FILE: fields with cloud liquid that open as a flat scene (large-eddy models), or a 3-D case, whose extinction is taken.
Seen from above, aslant, and from the ground under the thinnest and under thick cloud; isotropic ground of albedo 0 and
.2, no gas. The files are of the format of `openswim validate`. `fast` and this yardstick share code, not their method.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import xarray as xr

import openswim
from openswim.cameras import Rays
from openswim.optics.species import scene_optics
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport.montecarlo.reference import ReferenceView

ALBEDOS, ASYMMETRY, AZIMUTH_DEG = (0.0, 0.2), 0.85, 200.0
ASLANT = np.array([0.5, 0.3, -0.8])
UPWARD = 88  # pixels across a sky
WL = [550.0]


def cloud(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Extinction (z, y, x) in 1/m and its axes in m."""
    if path.suffix == ".nc":
        with xr.open_dataset(path) as data:
            if "ray_origin" in data:
                extinction = data.extinction.transpose("z", "y", "x").values / 1000.0
                return extinction, *(1000.0 * data[axis].values.astype(float) for axis in "xyz")
    scene = openswim.open_scene(path)
    grid = scene.grid
    if grid is None or grid.curved or grid.height_m.ndim > 1:
        raise SystemExit(f"{path}: not a flat scene on level layers")
    extinction = np.sum([s.extinction_per_m for s in scene_optics(scene, np.array(WL))], axis=0)
    return extinction, grid.x, grid.y, grid.height_m.astype(float)


def toward(zenith_deg: float) -> np.ndarray:
    zenith, azimuth = np.radians([zenith_deg, AZIMUTH_DEG])
    return np.array([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])


def downward(x: np.ndarray, y: np.ndarray, z: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parallel rays (j, i, 3) from above the field, one through each cell."""
    way = way / np.linalg.norm(way)
    across = np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
    middle = np.stack([*across, np.full_like(across[0], 0.5 * (z[0] + z[-1]))], axis=-1)
    above_m = 0.5 * (z[-1] - z[0]) + 50.0
    return middle + above_m / way[2] * way, np.broadcast_to(way, middle.shape)


def upward(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The sky above a place, equidistant to 88 degrees."""
    u, v = np.meshgrid(*[np.linspace(-1, 1, UPWARD)] * 2)
    radius = np.hypot(u, v)
    zenith, azimuth = np.radians(88 * radius), np.arctan2(v, u)
    way = np.stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)], axis=-1)
    way[radius > 1] = np.nan
    return np.broadcast_to(place, way.shape), way


def grounds(scene: Scene, x: np.ndarray, y: np.ndarray, sun: np.ndarray) -> dict[str, np.ndarray]:
    """Places under the thinnest cloud toward the sun, the most central of them, and where nine in ten are thinner."""
    inner = (np.linspace(axis[0], axis[-1], 25)[4:-4] for axis in (x, y))
    at = np.stack(np.meshgrid(*inner), axis=-1).reshape(-1, 2)
    places = np.column_stack([at, np.ones(len(at))])
    seen = Solver("swim").solve(scene, sun, WL).view(Rays(places, np.tile(sun, (len(places), 1))))
    depth = -np.log(np.maximum(seen.transmittance[:, 0], 1e-12))
    central = np.hypot(*(at - at.mean(axis=0)).T)
    return {
        "sun": places[np.lexsort((central, depth.round(3)))[0]],
        "shadow": places[np.argsort(depth)[int(0.9 * len(depth))]],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--sun", type=float, action="append", required=True, help="solar zenith angle in degrees")
    parser.add_argument("--paths", type=int, default=400, help="of a pixel")
    parser.add_argument("-o", "--out", type=Path, default=Path("cases"))
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    extinction, x, y, z = cloud(chosen.file)
    for zenith_deg in chosen.sun:
        sun = toward(zenith_deg)
        scenes = [
            Scene.from_arrays(
                extinction.astype(np.float32), x, y, z, phase=HenyeyGreenstein(ASYMMETRY), surface_albedo=albedo
            )
            for albedo in ALBEDOS
        ]
        views = {"nadir": downward(x, y, z, np.array([0.0, 0.0, -1.0])), "oblique": downward(x, y, z, ASLANT)}
        views |= {f"ground_{name}": upward(place) for name, place in grounds(scenes[0], x, y, sun).items()}
        for name, (origin, way) in views.items():
            seen = np.isfinite(way).all(axis=-1)
            radiance, sigma = (np.full((*seen.shape, len(ALBEDOS)), np.nan, np.float32) for _ in range(2))
            for n, scene in enumerate(scenes):
                field = Solver("reference", paths=chosen.paths).solve(scene, sun, WL)
                view = field.view(Rays(origin[seen], way[seen]))
                assert isinstance(view, ReferenceView)
                radiance[seen, n], sigma[seen, n] = view.radiance[:, 0], view.sigma[:, 0]
            title = f"{chosen.file.stem}_{name}_sza{zenith_deg:g}"
            data = xr.Dataset(
                {
                    "radiance": (("i", "j", "surface_albedo"), radiance),
                    "sigma": (("i", "j", "surface_albedo"), sigma),
                    "ray_origin": (("i", "j", "xyz"), origin / 1000.0),
                    "ray_direction": (("i", "j", "xyz"), way),
                    "pixel_u": ("xyz", np.zeros(3)),
                    "pixel_v": ("xyz", np.zeros(3)),
                    "sun_direction": ("xyz", sun),
                    "extinction": (("x", "y", "z"), (1000.0 * extinction.T).astype(np.float32)),
                },
                {"surface_albedo": list(ALBEDOS), "x": x / 1000.0, "y": y / 1000.0, "z": z / 1000.0},
                {
                    "title": title, "geometry": "grid", "boundary": "open", "paths_per_pixel": chosen.paths,
                    "solver": "openswim reference", "surface": "infinite Lambertian plane at z = 0",
                    "phase_function": "Henyey-Greenstein", "asymmetry_parameter": ASYMMETRY,
                    "single_scattering_albedo": 1.0, "solar_zenith_deg": zenith_deg, "sun_azimuth_deg": AZIMUTH_DEG,
                },
            )  # fmt: skip
            target = chosen.out / f"{title}.nc"
            data.to_netcdf(target.with_suffix(".part"))
            target.with_suffix(".part").replace(target)
            print(target)


if __name__ == "__main__":
    main()
