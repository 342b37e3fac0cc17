"""Make the pictures, plot and tables of docs/solvers.md: swim, fast and reference side by side, and what they cost.

    python tools/make_solver_page.py [--references ../shared/reference/clouds] [--part demo|rico|plot ...]

RICO needs the reference files; without them that part is left out, and said so. Numbers are kept in
docs/images/solvers/numbers.json, paths of `reference` in build/solvers: cut off, it goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr

from openswim import Camera, Solver, render, to_rgb
from openswim.colour.rgb import auto_exposure
from openswim.lighting import light
from openswim.scene.procedural import demo_scene
from openswim.validation import cases3d
from openswim.validation.reference import read_reference
from openswim.validation.reference.metrics import LIT, Score, block_means, image_score, score

mpl.use("Agg")
from matplotlib import pyplot as plt

ROOT = Path(__file__).parents[1]
PAGE, TARGET, KEPT = ROOT / "docs/solvers.md", ROOT / "docs/images/solvers", ROOT / "build/solvers"
DEMO_NODES, DEMO_PATHS, RICO_PATHS = 128, 256, 256
VIEWS = {"rico_nadir": "from above", "rico_oblique": "aslant", "rico_ground_shadow": "ground, in shadow",
         "rico_ground_sun": "ground, in the sun"}  # fmt: skip
SETTINGS = {
    "swim": Solver("swim"),
    "fast, preview": Solver(quality="preview"),
    "fast, standard": Solver(),
    "fast, high": Solver(quality="high"),
    **{f"reference, {n} paths": Solver("reference", paths=n) for n in (4, 16, 64)},
}
# Quoted: relative RMSE (%) of single pixels from above and CPU seconds, on two AVX-512 cores, before the project began
QUOTED = {
    "SHDOM, 4x8 streams": (7.2, 32.0),
    "Numba Monte Carlo, 64 paths": (88.0, 0.5),
    "Mitsuba 3, 64 paths": (100.0, 40.0),
}
MOST_PERCENT = 30.0
_COLOURS = {"swim": "#d95f02", "fast": "#1b6ca8", "reference": "#444444"}


def timed(work: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """What `work` returns, and its CPU seconds."""
    start = time.process_time()
    result = work(*arguments)
    return result, time.process_time() - start


def difference(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Difference over ``truth`` (per cent) of 4x4-pixel means; nothing where there is hardly light."""
    ours, theirs = block_means(image)[0], block_means(truth)[0]
    return np.where(theirs > 0.02 * np.nanmean(theirs), 100 * (ours / np.maximum(theirs, 1e-9) - 1), np.nan)


class Shown(NamedTuple):
    """A picture, the lit radiances (ny, nx) behind it, and their score by the yardstick, which has none itself."""

    name: str
    picture: np.ndarray
    radiance: np.ndarray
    score: Score | None


def side_by_side(path: Path, rows: dict[str, list[Shown]]) -> None:
    """A row of pictures, the yardstick last, and below each its map of differences."""
    columns = max(len(row) for row in rows.values())
    tall = [row[0].picture.shape[0] / row[0].picture.shape[1] for row in rows.values()]
    wide = 3.4
    figure, axes = plt.subplots(
        2 * len(rows), columns, figsize=(wide * columns, sum(2 * wide * t + 0.5 for t in tall)), squeeze=False,
        height_ratios=[t for t in tall for _ in range(2)], layout="constrained",
    )  # fmt: skip
    for axis in axes.ravel():
        axis.axis("off")
    colours = mpl.cm.ScalarMappable(mpl.colors.Normalize(-MOST_PERCENT, MOST_PERCENT), "RdBu_r")
    for n, (view, row) in enumerate(rows.items()):
        for m, shown in enumerate(row):
            above, below = axes[2 * n, m], axes[2 * n + 1, m]
            above.imshow(shown.picture, interpolation="nearest")
            above.set_title(f"{shown.name}, {view}", fontsize=9)
            if shown.score is None:
                bar = figure.colorbar(colours, cax=below.inset_axes((0.1, 0.1, 0.06, 0.8)))
                bar.set_label("minus reference, over it, %", fontsize=8)
                continue
            percent = difference(shown.radiance, row[-1].radiance)
            below.imshow(percent, colours.cmap, colours.norm, interpolation="nearest")
            rmse, bias = 100 * shown.score.relative_rmse, 100 * shown.score.bias
            off = f"{rmse:.1f} %" if rmse > 0 else "below the reference's noise"
            below.set_title(f"minus reference: RMSE {off}, bias {bias:+.1f} %", fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)
    print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


def demo(numbers: dict[str, Any], _: Path) -> None:
    """The demo scene from the ground and from above."""
    scene = demo_scene(DEMO_NODES, DEMO_NODES, 64)
    lat, lon = scene.place
    cameras = {
        "from the ground": Camera.panorama(lat, lon, size=(80, 160)),
        "from above": Camera.perspective(lat, lon, height_m=14_000, altitude_deg=-90, fov_deg=40, size=(96, 96)),
    }
    solvers = {"swim": Solver("swim"), "fast": Solver(detail=False)}  # the reference sees the grid as it is
    images: dict[str, dict[str, xr.Dataset]] = {view: {} for view in cameras}
    table: dict[str, Any] = {}
    for name, solver in solvers.items():
        light(scene, solver)  # compiles
        lit, spent = timed(light, scene, solver)
        table[name] = {"solve": spent}
        for view, camera in cameras.items():
            images[view][name], table[name][view] = timed(render, lit, camera)
    KEPT.mkdir(parents=True, exist_ok=True)
    for view, camera in cameras.items():
        kept = KEPT / f"demo_{view.replace(' ', '_')}.npz"
        lit = light(scene, Solver("reference", paths=DEMO_PATHS, checkpoint=kept))
        images[view]["reference"], spent = timed(render, lit, camera)
        kept.unlink(missing_ok=True)  # for a run that was interrupted: the next one's cost is its own
        table.setdefault("reference", {"solve": 0.0})[view] = spent
        table["reference"][f"{view}, error"] = float(images[view]["reference"].attrs["mean_error_percent"])
    rows: dict[str, list[Shown]] = {}
    for view, found in images.items():
        exposure = auto_exposure(found["reference"])
        green = {name: image["solar_relative_radiance"].sel(wavelength=546).values for name, image in found.items()}
        scale = (4 * np.pi / found["reference"]["solar_irradiance"].sel(wavelength=546)).item()
        noise = scale * found["reference"]["radiance_standard_error"].sel(wavelength=546).values
        rows[view] = []
        for name, image in found.items():
            result = None if name == "reference" else image_score(green[name], green["reference"], noise)
            rows[view].append(Shown(name, to_rgb(image, exposure=exposure), green[name], result))
            if result is not None:
                table[name][f"{view}, rmse"] = 100 * result.relative_rmse
                table[name][f"{view}, bias"] = 100 * result.bias
    numbers["demo"] = table
    side_by_side(TARGET / "demo.png", rows)


def rico(numbers: dict[str, Any], folder: Path) -> None:
    """Cumulus of a large-eddy model over black ground: every setting against the files, and the three side by side."""
    cases = {name: read_reference(folder / f"{name}_sza60.nc") for name in VIEWS}
    first = next(iter(cases.values()))
    scene = cases3d.case_scene(first, 0.0)
    sun = np.asarray(first.data.sun_direction.values, float)
    sun = sun / np.linalg.norm(sun)
    where = [cases3d.WAVELENGTH_NM]
    table: dict[str, Any] = {}
    images: dict[str, dict[str, np.ndarray]] = {view: {} for view in cases}
    noises: dict[str, np.ndarray] = {}
    for solver in (Solver("swim"), Solver(quality="preview"), Solver("reference", paths=2)):  # have all compiled
        field = solver.solve(scene, sun, where)
        (cases3d.case_estimate if solver.name == "reference" else cases3d.case_image)(field, first)
    settings = SETTINGS | {"reference": Solver("reference", paths=RICO_PATHS)}
    for name, solver in settings.items():
        field, spent = timed(solver.solve, scene, sun, where)
        measured: dict[str, Any] = {"solve": spent}
        for view, case in cases.items():
            make = cases3d.case_estimate if solver.name == "reference" else cases3d.case_image
            (image, own), seconds = timed(make, field, case)
            images[view][name], noises[view] = image, own  # of `reference`, which comes last
            truth, sigma = (case.data[v].transpose("i", "j", ...).values[..., 0] for v in ("radiance", "sigma"))
            # a solver's own noise is part of its error, the truth's is not
            lit = truth > LIT
            found, single = image_score(image, truth, sigma), score(image[lit], truth[lit], sigma[lit])
            measured[view] = {
                "seconds": seconds, "rmse": 100 * found.relative_rmse, "bias": 100 * found.bias,
                "pixels": 100 * single.relative_rmse, "sigma": 100 * float(np.nanmean(own) / np.nanmean(truth)),
            }  # fmt: skip
        table[name] = measured
        print(f"RICO, {name}: {spent:.2f} s", flush=True)
    numbers["rico"] = table
    rows: dict[str, list[Shown]] = {}
    for view in ("rico_nadir", "rico_ground_shadow"):
        truth = images[view]["reference"]
        row = rows[VIEWS[view]] = []
        for short, name in (("swim", "swim"), ("fast", "fast, standard"), ("reference", "reference")):
            image = images[view][name]
            result = None if name == "reference" else image_score(image, truth, noises[view])
            row.append(Shown(short, grey(image, truth), image, result))
    side_by_side(TARGET / "rico.png", rows)


def grey(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """A picture of one wavelength, exposed for ``truth``."""
    factor = 0.9 / np.nanpercentile(truth, 99)
    level = np.clip(np.nan_to_num(image) * factor, 0, 1) ** (1 / 2.2)
    return np.repeat((255 * level).astype(np.uint8)[..., None], 3, axis=-1)


def plot(numbers: dict[str, Any], _: Path) -> None:
    """Error against cost of the view of RICO from above."""
    if "rico" not in numbers:
        print("no plot of error against cost: RICO was never rendered")
        return
    figure, axes = plt.subplots(figsize=(8, 5.2), layout="constrained")
    lines: dict[str, list[tuple[float, float, float, str]]] = {}
    for name, row in numbers["rico"].items():
        kind = name.split(",")[0]
        case = row["rico_nadir"]
        label = name.removeprefix(f"{kind}, ") if "," in name else f"{RICO_PATHS} paths" if kind == "reference" else ""
        lines.setdefault(kind, []).append((row["solve"] + case["seconds"], case["rmse"], case["pixels"], label))
    for kind, points in lines.items():
        seconds, means, pixels, labels = zip(*sorted(points), strict=True)
        colour = _COLOURS[kind]
        axes.plot(seconds, means, "o-", color=colour, label=f"{kind}, 4x4-pixel means")
        axes.plot(seconds, pixels, "o--", color=colour, mfc="white", lw=0.8, label=f"{kind}, single pixels")
        for n, (x, y, label) in enumerate(zip(seconds, means, labels, strict=True)):
            axes.annotate(label, (x, y), (4, 5 if n % 2 else -10), textcoords="offset points", fontsize=8, color=colour)
    for name, (error, cost) in QUOTED.items():
        axes.plot(cost, error, "k^", mfc="white")
        axes.annotate(name, (cost, error), (6, 3), textcoords="offset points", fontsize=8)
    axes.plot([], [], "k^", mfc="white", label="quoted, single pixels, another machine")
    axes.set(xscale="log", yscale="log", xlabel="CPU seconds: solving and one view from above",
             ylabel="relative RMSE where it is lit, %", title="RICO cumulus, sun at 60 degrees")  # fmt: skip
    axes.grid(which="both", alpha=0.25)
    axes.set_xlim(right=200)
    axes.legend(fontsize=8)
    figure.savefig(TARGET / "error_against_cost.png", dpi=100)
    plt.close(figure)


def tables(numbers: dict[str, Any]) -> dict[str, str]:
    """Markdown by the name of its place in the page."""
    out = {}
    if "rico" in numbers:
        head = ["| RMSE (bias), % | " + " | ".join(VIEWS.values()) + " | solve, CPU s | a view |", "|---" * 7 + "|"]
        for name, row in numbers["rico"].items():
            label = f"reference, {RICO_PATHS} paths" if name == "reference" else name
            cells = [f"{row[v]['rmse']:.1f} ({row[v]['bias']:+.1f})" for v in VIEWS]
            views = np.mean([row[v]["seconds"] for v in VIEWS])
            head.append(f"| {label} | {' | '.join(cells)} | {row['solve']:.2f} | {views:.2f} |")
        out["rico"] = "\n".join(head)
    if "demo" in numbers:
        views = ("from the ground", "from above")
        first = f"| RMSE (bias) by reference, % | {' | '.join(views)} | solve, CPU s | views |"
        head = [first, "|---" * 5 + "|"]
        for name, row in numbers["demo"].items():
            cells = [f"{row[f'{v}, rmse']:.1f} ({row[f'{v}, bias']:+.1f})" if f"{v}, rmse" in row
                     else f"its own error, a pixel: {row[f'{v}, error']:.0f}" for v in views]  # fmt: skip
            head.append(f"| {name} | {' | '.join(cells)} | {row['solve']:.1f} | {sum(row[v] for v in views):.1f} |")
        out["demo"] = "\n".join(head)
    return out


def into_page(numbers: dict[str, Any]) -> None:
    """Put the tables between their marks in the page."""
    page = PAGE.read_text()
    for name, table in tables(numbers).items():
        begin, end = f"<!-- {name} -->\n", f"\n<!-- /{name} -->"
        before, rest = page.split(begin)
        page = before + begin + table + end + rest.split(end)[1]
    PAGE.write_text(page)


PARTS = {"demo": demo, "rico": rico, "plot": plot}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--references", type=Path, default=ROOT / "../shared/reference/clouds")
    parser.add_argument("--part", action="append", choices=PARTS, help="only this; may be given several times")
    options = parser.parse_args()
    TARGET.mkdir(parents=True, exist_ok=True)
    file = TARGET / "numbers.json"
    numbers = json.loads(file.read_text()) if file.exists() else {}
    for name in options.part or PARTS:
        if name == "rico" and not options.references.is_dir():
            print(f"RICO left out: no reference files in {options.references}; name their folder with --references")
            continue
        PARTS[name](numbers, options.references)
        file.write_text(json.dumps(numbers, indent=1) + "\n")
    into_page(numbers)


if __name__ == "__main__":
    main()
