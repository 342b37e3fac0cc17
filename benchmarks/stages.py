"""One process's share of a benchmark: the demo scene and a panorama, stage by stage; prints JSON.

Started by `run.py`, which decides whether Numba's cache is empty or filled.
"""

import argparse
import json
import resource
import time
from collections.abc import Callable
from typing import Any

GRID = (256, 256, 64)
PANORAMA = (720, 1440)
WAVELENGTHS_NM = (615.0, 546.0, 450.0)

Stages = dict[str, dict[str, float]]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--solver", default="fast")
    solver = parser.parse_args().solver
    stages: Stages = {}
    prepared = timed(stages, "import and scene", prepare)
    rendered(stages, "", solver, *prepared)
    rendered(stages, "again: ", solver, *prepared)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    bare_march(stages)
    print(json.dumps({"stages": stages, "peak_mb": peak_mb}))


def timed(stages: Stages, name: str, work: Callable[..., Any], *arguments: Any) -> Any:
    """Run `work`, note its seconds under `name`, and return what it returns."""
    start = time.perf_counter()
    result = work(*arguments)
    stages[name] = {"seconds": time.perf_counter() - start}
    return result


def prepare() -> tuple[Any, Any, Any, Any]:
    """The demo scene, the direction to its sun, a camera at its centre, and the camera's rays."""
    from openswim.cameras import Camera
    from openswim.lights import sun_position
    from openswim.scene.frame import scene_frame
    from openswim.scene.procedural import demo_scene

    scene = demo_scene(*GRID)
    lat, lon = scene.place
    frame = scene_frame(scene)
    assert scene.time is not None
    sun = sun_position(scene.time, lat, lon)
    camera = Camera.panorama(lat, lon, size=PANORAMA)
    ground_m = float(scene.data["surface_altitude"][GRID[1] // 2, GRID[0] // 2])
    toward_sun = frame.direction(sun.azimuth_deg, sun.altitude_deg, lat, lon)
    return scene, toward_sun, camera, camera.rays(frame, ground_m)


def rendered(
    stages: Stages, prefix: str, solver: str, scene: Any, toward_sun: Any, camera: Any, rays: Any
) -> None:
    """Solve, view and colour once; the solver's own timings become stages of their own."""
    from openswim.solver import Solver

    field = timed(stages, f"{prefix}solve", Solver(solver).solve, scene, toward_sun, WAVELENGTHS_NM)
    for name, seconds in field.timings.items():
        stages[f"{prefix}solve: {name}"] = {"seconds": float(seconds)}
    view = timed(stages, f"{prefix}view", field.view, rays)
    samples = getattr(view, "samples", None)
    if samples is not None:
        stages[f"{prefix}view"]["samples"] = float(samples)
    timed(stages, f"{prefix}colour", coloured, camera, view.radiance)


def bare_march(stages: Stages) -> None:
    """What a view is measured against: see `yardstick.py`."""
    import numpy as np

    from yardstick import grid, panorama

    field, out = grid(*GRID), np.empty((*PANORAMA, 3), np.float32)
    panorama(field, 16, 16, out)
    stages["yardstick"]["samples"] = float(timed(stages, "yardstick", panorama, field, *PANORAMA, out))


def coloured(camera: Any, radiance: Any) -> Any:
    """From L' per ray to bytes."""
    import xarray as xr

    from openswim.colour import to_rgb

    image = camera.pixels().image(radiance)
    coords = {"wavelength": list(WAVELENGTHS_NM)}
    return to_rgb(xr.DataArray(image, dims=("y", "x", "wavelength"), coords=coords))


if __name__ == "__main__":
    main()
