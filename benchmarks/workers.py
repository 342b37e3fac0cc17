"""What several processes of a batch gain: the same times made by one process of one thread, and by two.

    python benchmarks/workers.py
    python benchmarks/workers.py --jobs 4 --times 24 --columns 128

Prints the wall clock of the whole batch and from the end of its first time, which is made alone, to the last, and the
processor time a picture. The gain by processor time is what an idle machine would show; where others work on the same
cores, the wall clock tells of them, too.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import openswim
from openswim.batches import batch
from openswim.batches.working import Outcome
from openswim.scene.procedural import demo_scene

LEVELS, EVERY_MIN = 40, 10
PLAN = """openswim_batch = 1
files = "time_*.nc"
output = "by_{jobs}"

[[camera]]
name = "roof"
lat = {lat}
lon = {lon}
size = 200
"""


@dataclass(frozen=True)
class Measured:
    """One batch: its wall clock, that after the first time per time, and processor time a time (s)."""

    wall_s: float
    wall_each_s: float
    cpu_each_s: float


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--times", type=int, default=9)
    parser.add_argument("--columns", type=int, default=64)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lat, lon = write_weather(folder, given.times, given.columns)
        found = {jobs: measured(folder, jobs, lat, lon) for jobs in (1, given.jobs)}
    for jobs, one in found.items():
        print(f"{jobs} of one thread: {one.wall_s:.1f} s in all, {one.wall_each_s:.2f} s a time after the first, "
              f"{one.cpu_each_s:.2f} CPU s a time")  # fmt: skip
    one, more = found[1], found[given.jobs]
    print(f"gain of {given.jobs}: {given.jobs * one.cpu_each_s / more.cpu_each_s:.2f} by processor time, "
          f"{one.wall_each_s / more.wall_each_s:.2f} by the wall clock after the first time, "
          f"{one.wall_s / more.wall_s:.2f} in all")  # fmt: skip


def write_weather(folder: Path, times: int, columns: int) -> tuple[float, float]:
    """The demo's sky at several times, a file each; where its middle is."""
    scene = demo_scene(columns, columns, LEVELS)
    assert scene.time is not None
    start = scene.time
    for n in range(times):
        scene.time = start + np.timedelta64(EVERY_MIN * n, "m")
        scene.to_netcdf(folder / f"time_{n:02d}.nc")
    lat, lon = scene.place
    return float(lat), float(lon)


def measured(folder: Path, jobs: int, lat: float, lon: float) -> Measured:
    plan = folder / f"plan_{jobs}.toml"
    plan.write_text(PLAN.format(jobs=jobs, lat=lat, lon=lon))
    ends: list[float] = []

    def tell(outcome: Outcome) -> None:
        if outcome.failure:
            raise SystemExit(outcome.failure)
        ends.append(time.perf_counter())

    start = time.perf_counter()
    made = batch(plan, jobs=jobs, tell=tell).made
    # a process compiles nothing at its first time, but it loads all kernels: that is no time like the others
    each = statistics.median(one.cpu_s for one in made)
    return Measured(time.perf_counter() - start, (ends[-1] - ends[0]) / (len(ends) - 1), each)


if __name__ == "__main__":
    print(f"openswim {openswim.__version__}")
    main()
