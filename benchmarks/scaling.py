"""How cost grows: `python benchmarks/scaling.py` solves ever larger demo scenes, and views one in ever more pixels.

CPU seconds over a factor of 64 each, with the exponents fitted, into docs/images/solvers/scaling.png; the numbers
beside it as scaling.json. What is in there is not measured again (--again: it is).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

TARGET = Path(__file__).parents[1] / "docs/images/solvers"
COLUMNS = (32, 48, 64, 96, 128, 192, 256)
SPACING_M = 100.0
LEVELS = 64
ROWS = (90, 127, 180, 255, 360, 509, 720)  # of panoramas twice as wide
VIEWED = 128  # columns of the scene that is viewed
REPEATS = 3  # of what takes less than _LONG_S, of which the median counts
_LONG_S = 5.0


def median_seconds(work: Any) -> tuple[Any, dict[str, float]]:
    """What `work` returns, with the stages' CPU seconds of the median run: it returns (result, stages)."""
    runs: list[tuple[Any, dict[str, float]]] = []
    while len(runs) < REPEATS and (not runs or runs[0][1]["all"] < _LONG_S):
        start = time.process_time()
        result, stages = work()
        runs.append((result, {**stages, "all": time.process_time() - start}))
    return sorted(runs, key=lambda run: run[1]["all"])[len(runs) // 2]


def solved(columns: int) -> tuple[Any, dict[str, float]]:
    """The demo's kind of sky over so many columns each way, solved at three wavelengths."""
    from openswim.lights import sun_position
    from openswim.scene.frame import scene_frame
    from openswim.scene.procedural import demo_scene
    from openswim.solver import Solver

    scene = demo_scene(columns, columns, LEVELS, spacing_m=SPACING_M)
    assert scene.time is not None
    lat, lon = scene.place
    place = sun_position(scene.time, lat, lon)
    toward_sun = scene_frame(scene).direction(place.azimuth_deg, place.altitude_deg, lat, lon)

    def once() -> tuple[Any, dict[str, float]]:
        field = Solver().solve(scene, toward_sun, (615.0, 546.0, 450.0))
        return (scene, field), dict(field.timings)

    return median_seconds(once)


def viewed(field: Any, scene: Any, rows: int) -> dict[str, float]:
    """A panorama of so many rows."""
    from openswim.cameras import Camera

    lat, lon = scene.place
    camera = Camera.panorama(lat, lon, size=(rows, 2 * rows))
    middle = scene.grid.shape[1] // 2
    ground_m = float(scene.data["surface_altitude"].values[middle, middle])
    rays = camera.rays(field.frame, ground_m)
    return median_seconds(lambda: (field.view(rays), {}))[1]


def measure(file: Path, again: bool) -> dict[str, Any]:
    """All numbers, kept in the file as they come."""
    numbers: dict[str, Any] = {"solve": {}, "view": {}}
    if file.exists() and not again:
        numbers = json.loads(file.read_text())
    field = None
    wanted = [n for n in COLUMNS if str(n) not in numbers["solve"]]
    if wanted or any(str(n) not in numbers["view"] for n in ROWS):
        (scene, field), _ = solved(COLUMNS[0])  # compiles
        viewed(field, scene, 16)
    for columns in wanted:
        (_, solution), stages = solved(columns)
        numbers["solve"][str(columns)] = {**stages, "cells": int(np.prod(solution.medium.shape))}
        keep(file, numbers, f"{columns} columns each way", stages)
    for rows in ROWS:
        if str(rows) in numbers["view"]:
            continue
        if field is None or field.medium.shape[2] != VIEWED:
            (scene, field), _ = solved(VIEWED)
        numbers["view"][str(rows)] = viewed(field, scene, rows)
        keep(file, numbers, f"{rows} rows", numbers["view"][str(rows)])
    return numbers


def keep(file: Path, numbers: dict[str, Any], name: str, stages: dict[str, float]) -> None:
    file.write_text(json.dumps(numbers, indent=1) + "\n")
    print(f"{name}: " + ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in stages.items()), flush=True)


def exponent(size: Any, seconds: Any) -> tuple[float, float]:
    """Slope and intercept of the logarithms."""
    slope, start = np.polyfit(np.log(size), np.log(seconds), 1)
    return float(slope), float(start)


def draw(numbers: dict[str, Any], path: Path) -> None:
    """Seconds against cells and against pixels, double logarithmic, with a line of slope one."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
    rows = sorted(numbers["solve"].values(), key=lambda row: row["cells"])
    cells = np.array([row["cells"] for row in rows])
    wall = np.array([row["air"] + row["sun"] + row["diffuse"] for row in rows])
    whole = np.array([row["all"] for row in rows])
    grid = whole * np.array([row["sun"] + row["diffuse"] for row in rows]) / wall
    curve(left, cells, whole, "all", "#444444")
    curve(left, cells, grid, "grid: sun and sweeps", "#1b6ca8")
    left.set(xlabel="nodes of the transport grid", ylabel="CPU seconds", title="solving, three wavelengths")
    counts = np.array(sorted(int(n) for n in numbers["view"]))
    curve(right, 2 * counts**2, np.array([numbers["view"][str(n)]["all"] for n in counts]), "a panorama", "#1b6ca8")
    right.set(xlabel="pixels", ylabel="CPU seconds", title=f"a view of {VIEWED} x {VIEWED} columns")
    for axes in (left, right):
        axes.set(xscale="log", yscale="log")
        axes.xaxis.set_minor_formatter("")  # too many to stand side by side
        axes.grid(which="both", alpha=0.25)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def curve(axes: Any, size: Any, seconds: Any, name: str, colour: str) -> None:
    """Points, and the power law fitted to them."""
    slope, start = exponent(size, seconds)
    axes.plot(size, seconds, "o", color=colour, label=f"{name}: exponent {slope:.2f}")
    axes.plot(size, np.exp(start) * size**slope, "-", color=colour, lw=0.8)
    axes.plot(size, seconds[-1] * size / size[-1], ":", color=colour, lw=0.8)
    print(f"{name}: exponent {slope:.2f} over a factor of {size[-1] / size[0]:.0f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--again", action="store_true", help="measure anew what is there already")
    options = parser.parse_args()
    TARGET.mkdir(parents=True, exist_ok=True)
    draw(measure(TARGET / "scaling.json", options.again), TARGET / "scaling.png")


if __name__ == "__main__":
    main()
