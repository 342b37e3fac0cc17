"""A landing: half a minute through broken cloud to a runway, as a film.

    python benchmarks/landing.py landing.mp4
    python benchmarks/landing.py landing.mp4 --size 1280x720 --fps 25

The weather is the demo scene, the runway a map of the ground's colour that is drawn here (needs rasterio). The
approach is flown four times as fast as it would be. Prints how much pictures change from frame to frame: a jump, or
flicker, would stand out of its neighbours.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import openswim
from openswim import Camera, Ground, Scene
from openswim.films import CameraPath, film
from openswim.scene.procedural import demo_scene

NODES, LEVELS = 160, 40
ROW, THRESHOLD, LENGTH_M, WIDTH_M = 100, 100, 2000.0, 60.0  # the runway: row and column of its western end
SECONDS, SPEED = 30.0, 4.0
START_M, EYE_M, GLIDE = 2150.0, 4.0, 0.21  # above the ground; slope of the approach
PIXEL_M = 1.0


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("output", type=Path)
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--fps", type=float, default=5.0)
    given = parser.parse_args()
    columns, rows = map(int, given.size.split("x"))
    with tempfile.TemporaryDirectory() as folder:
        scene = airfield(Path(folder) / "runway.tif")
        path = approach(scene)
        lat, lon, _ = map(float, path.place[0])
        camera = Camera.perspective(lat, lon, fov_deg=65.0, altitude_deg=-5.0, size=(rows, columns))
        film(scene, camera, given.output, path=path, frames_per_second=given.fps, speed=SPEED)
    for second, change in enumerate(changes(given.output, given.fps)):
        print(f"{second:3d} s: mean change from frame to frame {change.mean():.2f} of 255, greatest {change.max():.2f}")


def airfield(path: Path) -> Scene:
    """The demo scene with a runway in a map of its ground."""
    scene = demo_scene(NODES, NODES, LEVELS)
    assert scene.grid is not None
    assert scene.grid.crs is not None
    x, y = (axis[at] for axis, at in ((scene.grid.x, THRESHOLD), (scene.grid.y, ROW)))
    write_runway(path, scene.grid.crs.to_wkt(), float(x), float(y))
    scene.ground = Ground(albedo=path)
    return scene


def write_runway(path: Path, crs: str, x_m: float, y_m: float) -> None:
    """Reflectance around a runway that begins at a place and goes east: grass, asphalt, white marks."""
    import rasterio
    from rasterio.transform import from_origin

    margin_m = 400.0
    east = np.arange(-margin_m, LENGTH_M + margin_m, PIXEL_M) + 0.5 * PIXEL_M
    north = -(np.arange(-margin_m, margin_m, PIXEL_M) + 0.5 * PIXEL_M)
    along, across = np.meshgrid(east, np.abs(north))
    grass, asphalt, paint = ((0.07, 0.11, 0.04), (0.06, 0.06, 0.06), (0.75, 0.75, 0.72))
    paved = (along > 0) & (along < LENGTH_M) & (across < 0.5 * WIDTH_M)
    marked = paved & (across < 0.6) & (along % 60.0 < 30.0)  # the middle line
    from_end = np.minimum(along, LENGTH_M - along) - 20.0
    bars = (from_end >= 0.0) & (from_end < 60.0) & (across > 4.0) & (across % 12.0 < 6.0)
    marked |= paved & bars & (across < 0.5 * WIDTH_M - 2)
    bands = [np.where(marked, p, np.where(paved, a, g)) for g, a, p in zip(grass, asphalt, paint, strict=True)]
    with rasterio.open(
        path, "w", driver="GTiff", width=east.size, height=north.size, count=3, dtype="float32", crs=crs,
        transform=from_origin(x_m - margin_m, y_m + margin_m, PIXEL_M, PIXEL_M),
    ) as file:  # fmt: skip
        file.write(np.array(bands, np.float32))


def approach(scene: Scene) -> CameraPath:
    """Down a straight slope from the west, then along the runway."""
    grid = scene.grid
    assert grid is not None
    terrain = scene.data["surface_altitude"].values
    cell_m = float(grid.step[0])
    touchdown_m = 300.0  # from the threshold
    far_m = touchdown_m - (START_M - EYE_M) / GLIDE
    along = np.array([far_m, touchdown_m - 600.0, touchdown_m, touchdown_m + 200.0])
    column = THRESHOLD + along / cell_m
    ground = np.interp(column, np.arange(NODES), terrain[ROW])
    height = np.array([ground[2] + START_M, ground[2] + EYE_M + 60.0, ground[2] + EYE_M, ground[3] + EYE_M])
    lon, lat = grid.lonlat(column, np.full(column.size, float(ROW)))
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(along), np.diff(height)))])
    slower = np.array([0.0, *(np.cumsum(np.diff(way) / [1.0, 0.8, 0.4]))])
    seconds = SECONDS * SPEED * slower / slower[-1]
    assert scene.time is not None
    time = scene.time + np.round(1e3 * seconds).astype("timedelta64[ms]")
    attitude = np.full((column.size, 4), np.nan)
    return CameraPath(time, np.stack([lat, lon, height], axis=-1), attitude)


def changes(path: Path, fps: float) -> list[NDArray[np.float64]]:
    """Mean absolute difference of following frames, of each second."""
    import av

    with av.open(str(path)) as container:
        frames = [frame.to_ndarray(format="rgb24").astype(float) for frame in container.decode(video=0)]
    each = np.array([np.abs(one - other).mean() for one, other in zip(frames[1:], frames, strict=False)])
    per = max(1, round(fps))
    return [each[n : n + per] for n in range(0, len(each), per)]


if __name__ == "__main__":
    print(f"openswim {openswim.__version__}")
    main()
