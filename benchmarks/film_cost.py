"""What a film over model times costs beside single pictures: CPU seconds of whole commands a time, in alternation.

    python benchmarks/film_cost.py
    python benchmarks/film_cost.py --columns 128 --levels 30 --size 512 --times 12 --least 1.5

The weather is the demo's, whose clouds drift by a column every ten minutes.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from openswim.scene.procedural import demo_scene


def main() -> None:
    parser = argparse.ArgumentParser()
    for name, default in (("columns", 64), ("levels", 24), ("size", 256), ("times", 6), ("rounds", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--least", type=float, default=0.0, help="fail where a picture costs fewer times a film's time")
    given = parser.parse_args()
    scene = demo_scene(given.columns, given.columns, given.levels)
    lat, lon = scene.place
    start = scene.time
    assert start is not None  # the demo has a time
    look = ["--lat", str(lat), "--lon", str(lon), "--view", "allsky", "--size", str(given.size)]
    with tempfile.TemporaryDirectory() as name:
        files = [Path(name) / f"time_{k}.nc" for k in range(given.times)]
        for k, file in enumerate(files):
            data = scene.data.copy()
            for cloud in ("liquid_content", "liquid_effective_radius", "ice_content", "ice_effective_radius"):
                data[cloud] = scene.data[cloud].copy(data=np.roll(scene.data[cloud].values, k, -1))
            replace(scene, data=data, time=start + np.timedelta64(10 * k, "m")).to_netcdf(file)
        film, single = [], []
        for turn in range(given.rounds):
            film.append(cpu_s("film", *map(str, files), *look, "-o", f"{name}/film.mp4") / given.times)
            single.append(cpu_s("render", str(files[turn % given.times]), *look, "-o", f"{name}/one.png"))
            one, other = statistics.median(film), statistics.median(single)
            print(f"a time of the film {one:.1f}, a picture {other:.1f} CPU s: {other / one:.2f} times", flush=True)
    if other < given.least * one:
        raise SystemExit(f"the mark is {given.least:g} times")


def cpu_s(*command: str) -> float:
    """Processor time of a command of openswim's."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "openswim", *command], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
