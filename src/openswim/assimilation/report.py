"""The page of an analysis: a single HTML file that asks nothing of any server."""

from __future__ import annotations

import os
from html import escape

import numpy as np
from numpy.typing import NDArray

from openswim.assimilation.result import Found
from openswim.comparison.report.page import COLOURS, document
from openswim.comparison.report.pictures import GREY, data_uri, signed
from openswim.comparison.report.plots import Plot
from openswim.scene.files import written_whole

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

_MOST_ROWS = 400  # of a picture on the page
_LEAST_ROWS = 200
_STYLE = """<style>
figure { display: inline-block; margin: 0 14px 14px 0; vertical-align: top; }
figure img { image-rendering: pixelated; display: block; border: 1px solid #ccc; }
figcaption { font-size: 13px; color: #444; max-width: 340px; }
</style>"""


def write_report(analysis: Found, path: str | os.PathLike[str]) -> None:
    """Costs, pictures observed and seen before and after, and columns of what was changed."""
    rows = analysis.rows
    title = f"Analysis of {rows.scene.source or 'a scene'}"
    body = [_STYLE, f"<h1>{escape(title)}</h1>", f"<p>{escape(_summary(analysis))}</p>", "<h2>Cost</h2>",
            _costs(analysis), "<h2>Departures</h2>", _table(analysis)]  # fmt: skip
    for n in range(len(rows.instruments)):
        body += [f"<h3>Camera {n}</h3>", *_camera(analysis, n)]
    if len(rows.points):
        body += ["<h3>Global irradiance</h3>", _irradiance(analysis)]
    body += ["<h2>What was changed</h2>", *_changes(analysis)]
    with written_whole(path) as partial:
        partial.write_text(document(title, body), "utf-8", "backslashreplace")


def _summary(analysis: Found) -> str:
    steps = len(analysis.costs) - 1
    text = (
        f"{analysis.used} observations, {steps} iterations, departures by the solver {analysis.departures}. The cost "
        f"fell from {analysis.costs[0]:.4g} to {analysis.costs[-1]:.4g}; where all errors are as they were said to be, "
        f"it ends near half the number of observations, {analysis.used / 2:.4g}."
    )
    if analysis.told:
        text += f" Numbers that the observations tell: {'; '.join(map(str, analysis.told))}."
    return text + (" It was stopped before its end." if analysis.interrupted else "")


def _costs(analysis: Found) -> str:
    each = np.log10(np.maximum(analysis.costs, 1e-12))
    low, high = np.floor(each.min()), np.ceil(each.max() + 1e-9)
    count = max(len(each) - 1, 1)
    ticks = [(float(n), str(n)) for n in np.unique(np.linspace(0, count, 6).astype(int))]
    plot = Plot("iteration", "log10 of the cost", (0.0, float(count)), (float(low), float(max(high, low + 1))), ticks)
    plot.line(np.arange(len(each), dtype=float), each, COLOURS["blue"])
    noise = float(np.log10(max(analysis.used, 1) / 2))
    plot.line(np.array([0.0, count]), np.array([noise, noise]), COLOURS["grey"], dashed=True)
    return plot.svg


def _table(analysis: Found) -> str:
    lines = ["<table><tr><th>instrument</th><th>used</th><th>rms before, errors</th><th>after</th></tr>"]
    use = analysis.observed["use"].values.astype(bool)
    both = zip(analysis.rms(analysis.before), analysis.rms(analysis.after), strict=True)
    for part, (before, after) in zip(analysis.rows.parts, both, strict=True):
        count = int(use[part.here].sum())
        lines.append(f"<tr><td>{escape(part.name)}</td><td>{count}</td><td>{before:.2f}</td><td>{after:.2f}</td></tr>")
    return "".join([*lines, "</table>"])


def _camera(analysis: Found, n: int) -> list[str]:
    """What was observed, what is seen before and after, and what is left, in errors."""
    rows, use = analysis.rows, analysis.observed["use"].values.astype(bool)
    value, error = analysis.observed["value"].values, analysis.observed["error"].values
    each = rows.instruments[n]
    pictures = [np.where(use, row, np.nan) for row in (value, analysis.before.values, analysis.after.values)]
    images = [rows.pictures(row)[n].values for row in pictures]
    known = images[0][np.isfinite(images[0])]
    low, high = np.percentile(known, [1, 99]) if known.size else (0.0, 1.0)
    names = ("observed", "seen before", "seen after")
    unit = f" {each.quantity.units}" if each.quantity.units != "1" else ""
    what = each.quantity.name.replace("_", " ").capitalize()
    scale = f"{what}: black is {low:.2g}, white {high:.2g}{unit}."
    out = [f"<p>{escape(scale)} What is left: blue is -5 errors, red 5. Grey: not used.</p>"]
    out += [_figure(_shades(_rgb(image), float(low), float(high)), name)
            for image, name in zip(images, names, strict=True)]  # fmt: skip
    for row, name in ((analysis.before.values, "before"), (analysis.after.values, "after")):
        left = rows.pictures(np.where(use, (value - row) / error, np.nan))[n].values.mean(axis=-1)
        out.append(_figure(signed(left, 5.0), f"observed less seen {name}"))
    return out


def _irradiance(analysis: Found) -> str:
    rows = analysis.rows
    value = rows.irradiance_w_m2(analysis.observed["value"])
    seen = [rows.irradiance_w_m2(row) for row in (analysis.before, analysis.after)]
    most = 100 * float(np.ceil(1.1 * max(each.max(initial=100.0) for each in (value, *seen)) / 100))
    plot = Plot("observed, W/m2", "seen, W/m2", (0.0, most), (0.0, most), [(0.0, "0"), (most / 2, f"{most / 2:.0f}")])
    plot.line(np.array([0.0, most]), np.array([0.0, most]), COLOURS["grey"])
    for each, colour in zip(seen, (COLOURS["red"], COLOURS["blue"]), strict=True):
        plot.points(value, each, colour, 3.0, 0.7)
    return plot.svg + "<p>Red: before, blue: after.</p>"


def _changes(analysis: Found) -> list[str]:
    """Fields on levels as columns' sums, before and after; numbers of what has few."""
    out = []
    for variable in analysis.rows.controls.variables:
        before, after = (state[variable.name].values for state in (analysis.first, analysis.state))
        if before.ndim == 3 and before.shape[0] > 0 and variable.dims[0] in ("z", "wavelength"):
            sums = [field.sum(axis=0) if variable.dims[0] == "z" else field.mean(axis=0) for field in (before, after)]
            most = float(max(np.percentile(s, 99.5) for s in sums)) or 1.0
            what = "sum over the levels" if variable.dims[0] == "z" else "mean of the channels"
            unit = f" {variable.units}" if variable.units != "1" else ""
            scale = f"{variable.name}, {what}: black is 0, white {most:.2g}{unit}; north is on top."
            out.append(f"<p>{escape(scale)}</p>")
            for values, name in zip(sums, ("before", "after"), strict=True):
                picture = _shades(np.repeat(values[::-1, :, None], 3, axis=2), 0.0, most)
                out.append(_figure(picture, name))
        else:
            text = ", ".join(f"{a:.4g} → {b:.4g}" for a, b in zip(before.ravel(), after.ravel(), strict=True))
            out.append(f"<p>{escape(variable.name)}: {escape(text)}</p>")
    return out


def _rgb(image: F64) -> F64:
    """Three channels of a picture (ny, nx, c): the longest wavelengths first, or one grey."""
    return image[..., [0, image.shape[-1] // 2, -1]] if image.shape[-1] >= 3 else np.repeat(image[..., :1], 3, axis=-1)


def _shades(image: F64, low: float, high: float) -> U8:
    grey = np.clip((image - low) / max(high - low, 1e-12), 0, 1) ** (1 / 2.2)
    return np.where(np.isfinite(image), 255 * np.nan_to_num(grey), GREY).astype(np.uint8)


def _figure(picture: U8, caption: str) -> str:
    """A picture as large as one sees: small ones have their pixels repeated."""
    rows = len(picture)
    times, every = max(1, -(-_LEAST_ROWS // rows)), max(1, -(-rows // _MOST_ROWS))
    shown = np.repeat(np.repeat(picture[::every, ::every], times, axis=0), times, axis=1)
    return f'<figure><img src="{data_uri(shown, lossless=True)}"><figcaption>{escape(caption)}</figcaption></figure>'
