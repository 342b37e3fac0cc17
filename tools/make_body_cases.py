"""Cases of a sphere or a box with sharp edges, for `openswim validate`: other depths and suns than the references have.

    python tools/make_body_cases.py TARGET sphere_sunlit.nc sphere_shadow.nc

An independent backward Monte Carlo, exact in its geometry, sees the body along the rays of the given reference files;
with their own body and sun it agrees with them within the noise (.1 % of the mean).
"""

from __future__ import annotations

import random
import sys
from pathlib import Path

import numpy as np
import xarray as xr
from numba import njit, prange

PATHS, ASYMMETRY = 1500, 0.85
CENTRE, HALF = np.array([0.0, 0.0, 1.0]), 0.5  # km
CASES = [("sphere", k, z) for k in (5.0, 60.0) for z in (20, 60, 80)] + [("box", 20.0, z) for z in (5, 45, 75)]


@njit
def chord(box, o, d):
    """Distances at which a ray enters the body and leaves it; the second is less where it misses."""
    p = o - CENTRE
    if not box:
        b = (p * d).sum()
        q = b * b - (p * p).sum() + HALF * HALF
        return (max(-b - np.sqrt(q), 0.0), -b + np.sqrt(q)) if q > 0 else (0.0, -1.0)
    first, last = 0.0, 1e30
    for a in range(3):
        if abs(d[a]) > 1e-12:
            near, far = (-HALF - p[a]) / d[a], (HALF - p[a]) / d[a]
            first, last = max(first, min(near, far)), min(last, max(near, far))
        elif abs(p[a]) > HALF:
            return 0.0, -1.0
    return first, last


@njit
def sunlight(box, extinction, o, sun):
    """Direct transmission from the sun."""
    first, last = chord(box, o, sun)
    return np.exp(-extinction * max(last - first, 0.0))


@njit
def turned(d, cosine, azimuth):
    """A direction at an angle from another."""
    other = np.array([-d[1], d[0], 0.0]) if abs(d[2]) < 0.9 else np.array([0.0, -d[2], d[1]])
    e = other / np.sqrt((other * other).sum())
    sine = np.sqrt(max(0.0, 1.0 - cosine * cosine))
    return cosine * d + sine * (np.cos(azimuth) * e + np.sin(azimuth) * np.cross(d, e))


@njit
def path(box, extinction, albedo, sun, o, d):
    """L' by one path back from the eye."""
    weight, light, g = 1.0, 0.0, ASYMMETRY
    while True:
        first, last = chord(box, o, d)
        free = first - np.log(1 - random.random()) / extinction
        ground = -o[2] / d[2] if d[2] < 0 else 1e30
        if last > first and free < min(last, ground):
            o = o + free * d
            cosine = (d * sun).sum()
            phase = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5
            light += weight * phase * sunlight(box, extinction, o, sun)
            t = (1 - g * g) / (1 - g + 2 * g * random.random())
            d = turned(d, (1 + g * g - t * t) / (2 * g), 2 * np.pi * random.random())
        elif ground < 1e29 and albedo > 0:
            o = o + ground * d
            o[2] = 1e-9
            weight *= albedo
            light += 4 * weight * sun[2] * sunlight(box, extinction, o, sun)
            u, azimuth = random.random(), 2 * np.pi * random.random()
            d = np.array([np.sqrt(u) * np.cos(azimuth), np.sqrt(u) * np.sin(azimuth), np.sqrt(1 - u)])
        else:
            return light
        if weight < 0.02:
            if random.random() < 0.5:
                return light
            weight *= 2


@njit(parallel=True)
def image(box, extinction, albedo, sun, origin, direction, u, v, seed):
    """L' of pixels (n,) and its standard error."""
    mean, error = np.zeros(len(origin)), np.zeros(len(origin))
    for i in prange(len(origin)):
        random.seed(seed + i)
        found = np.zeros(PATHS)
        for p in range(PATHS):
            o = origin[i] + (random.random() - 0.5) * u + (random.random() - 0.5) * v
            found[p] = path(box, extinction, albedo, sun, o, direction[i])
        mean[i], error[i] = found.mean(), found.std() / np.sqrt(PATHS)
    return mean, error


def main(target: str, *references: str) -> None:
    Path(target).mkdir(parents=True, exist_ok=True)
    for name in references:
        like = xr.open_dataset(name).load()
        u, v = (like[side].values.astype(float) for side in ("pixel_u", "pixel_v"))
        rays = [like[part].transpose("i", "j", "xyz").values.astype(float) for part in ("ray_origin", "ray_direction")]
        shape = rays[0].shape[:2]
        origin, direction = (np.ascontiguousarray(r.reshape(-1, 3)) for r in rays)
        for body, extinction, zenith in CASES:
            sun = np.array([np.sin(np.radians(zenith)), 0.0, np.cos(np.radians(zenith))])
            seen = [
                image(body == "box", extinction, albedo, sun, origin, direction, u, v, 100_000 * n)
                for n, albedo in enumerate((0.0, 0.2))
            ]
            radiance, sigma = (np.stack([s[k].reshape(shape) for s in seen], -1).astype("f4") for k in (0, 1))
            case = like.drop_vars(["radiance", "sigma", "surface_albedo"]).assign(
                radiance=(("i", "j", "surface_albedo"), radiance), sigma=(("i", "j", "surface_albedo"), sigma),
                sun_direction=("xyz", sun), surface_albedo=[0.0, 0.2],
            )  # fmt: skip
            size = "radius 0.5" if body == "sphere" else "edge 1 km"
            case.attrs["geometry"] = f"{body}: centre (0,0,1) km {size} extinction {extinction:g}/km"
            case.attrs |= {"solar_zenith_deg": float(zenith), "paths_per_pixel": PATHS}
            path_out = Path(target) / f"{body}{extinction:g}_{Path(name).stem.split('_')[1]}_sza{zenith}.nc"
            case.to_netcdf(path_out)
            print(path_out, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
