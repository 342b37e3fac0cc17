"""A day of a camera's frames, one a minute, beside a model's sky that changes every five minutes: see README.md."""

import argparse
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from openswim import Camera, Solver, render
from openswim.cameras.files import CameraFile, FrameSettings, write_camera
from openswim.comparison.response import encoded
from openswim.scene import Scene
from openswim.scene.procedural import demo_scene

SCENE_MINUTES = 5
EXPOSURE, NIGHT_MEAN = 4.0, 0.3  # of a day; what the mean light of a night's frame is made


def make(folder: Path, frames: int, size: int, start: np.datetime64) -> tuple[list[Path], Path]:
    """Scenes, frames and the camera's file. Frames are of the sky of a cell before, with noise, as JPEG."""
    whole = demo_scene(48, 48, 16, spacing_m=1000.0)
    if (folder / "camera.toml").exists():
        return sorted(folder.glob("sky_*.jpg"))[:frames], folder / "camera.toml"
    camera = Camera.fisheye(*whole.place, size=size, lens="equisolid", rotation_deg=33.0)
    write_camera(CameraFile(camera, "made-up", FrameSettings(utc_offset_h=0.0)), folder / "camera.toml")
    random, pictures = np.random.default_rng(0), []
    for k in range(-(-frames // SCENE_MINUTES)):
        when = start + np.timedelta64(2 + k * SCENE_MINUTES, "m")
        moved(whole, k, when).to_netcdf(folder / f"scene_{k:03}.nc")
        seen = render(moved(whole, k - 1, when), camera, Solver("fast", quality="preview"), time=when).radiance.values
        exposure = max(EXPOSURE, NIGHT_MEAN / float(np.nanmean(seen)))
        for minute in range(SCENE_MINUTES * k, min(frames, SCENE_MINUTES * (k + 1))):
            noisy = np.nan_to_num(seen) * random.normal(1, 0.02, seen.shape)
            stamp = str(start + np.timedelta64(minute, "m"))[:16].replace("-", "").replace(":", "").replace("T", "_")
            pictures.append(folder / f"sky_{stamp}00.jpg")
            counts = np.round(255 * encoded(np.clip(exposure * noisy, 0, 1), "srgb")).astype(np.uint8)
            Image.fromarray(counts).save(pictures[-1], quality=90)
    return pictures, folder / "camera.toml"


def moved(scene: Scene, cells: int, when: np.datetime64) -> Scene:
    """The clouds so many cells further east, at a time; the land stays under the camera."""
    clouds = scene.data[[name for name in scene.data if str(name).startswith(("liquid_", "ice_"))]]
    return replace(scene, data=scene.data.assign(clouds.roll(x=cells, roll_coords=False)), time=when)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path, help="for scenes, frames, pages and files")
    options.add_argument("--frames", type=int, default=20)
    options.add_argument("--start", default="2024-06-20T08:58", help="UTC")
    options.add_argument("--size", type=int, default=512, help="columns of the frames")
    options.add_argument("--columns", type=int, default=320, help="that are compared")
    options.add_argument("--jobs", type=int, default=1)
    options.add_argument("--quality", default="preview")
    chosen = options.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    frames, camera = make(chosen.folder, chosen.frames, chosen.size, np.datetime64(chosen.start, "ms"))
    output = chosen.folder / f"compared_{chosen.jobs}"
    command = [
        "compare", f"{chosen.folder}/scene_*.nc", *map(str, frames), "--camera", str(camera), "--output", str(output),
        "--size", str(chosen.columns), "--quality", chosen.quality, "--jobs", str(chosen.jobs),
    ]  # fmt: skip
    shutil.rmtree(output, ignore_errors=True)  # or nothing would be left to do
    began, cpu = time.perf_counter(), _cpu_s()
    subprocess.run([sys.executable, "-m", "openswim", *command], check=True, capture_output=True)
    wall, cpu = time.perf_counter() - began, _cpu_s() - cpu
    print(f"{len(frames)} frames by {chosen.jobs} processes: {wall:.0f} s, {cpu:.0f} CPU seconds")


def _cpu_s() -> float:
    """Of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
