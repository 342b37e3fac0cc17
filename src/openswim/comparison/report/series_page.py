"""The page of a series: scores over time, and what camera and model saw along the meridian."""

import os
from html import escape
from urllib.parse import quote

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.comparison.report.page import COLOURS, document
from openswim.comparison.report.pictures import data_uri
from openswim.comparison.report.plots import Plot
from openswim.errors import one_line
from openswim.scene.files import written_whole

F64 = NDArray[np.float64]
_WIDE = 940
_STEPS_MIN = (1, 2, 5, 10, 15, 30, 60, 120, 180, 360, 720, 1440)


def write_series_page(series: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Of what `joined` returns."""
    times = series["time"].values
    title = one_line(f"{len(times)} frames beside {series.attrs.get('model', 'a model')}")
    body = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{str(times[0])[:16].replace('T', ' ')} to {str(times[-1])[:16].replace('T', ' ')} UTC.</p>",
        "<h2>Scores over time</h2>",
        *_plots(series),
        "<h2>Keograms</h2><p>Columns are frames; from north on top over the zenith to south below.</p>",
        _keogram(series, "stored", "observed"), _keogram(series, "simulated_as_stored", "simulated"),
        "<h2>Frames</h2>", _table(series),
    ]  # fmt: skip
    with written_whole(path) as partial:
        partial.write_text(document(title, body), "utf-8", "backslashreplace")


def _plots(series: xr.Dataset) -> list[str]:
    hours = (series["time"].values - series["time"].values[0]) / np.timedelta64(1, "h")
    span = (0.0, max(float(hours[-1]), 1e-3))
    ticks = _clock_ticks(series, span[1])
    mask = float(series.attrs.get("sun_mask_deg", series["sun_mask"].values[-1]))
    r = series.sel(weighting="solid angle", sun_mask=mask, light="response undone", score_channel="mean")
    known = r["r_bounds"].values[np.isfinite(r["r_bounds"].values)]
    low = float(np.clip(np.floor(10 * known.min(initial=0.9)) / 10, -1, 0.9))
    plot = Plot("time, UTC", "mean r, response undone", span, (low, 1.0), ticks, _WIDE)
    plot.bars(hours, r["r_bounds"].values[:, 0], r["r_bounds"].values[:, 1], COLOURS["blue"])
    plot.line(hours, r["r"].values, COLOURS["blue"])
    plot.points(hours, r["r"].values, COLOURS["blue"], 2.5, 1)
    out = [f"<figure>{plot.svg}<figcaption>Bars: 95 % intervals.</figcaption></figure>"]
    if "observed_cover" in series and np.isfinite(series["observed_cover"].sel(rule="clear sky")).any():
        cover = series.sel(rule="clear sky")
        plot = Plot("time, UTC", "cloud cover", span, (0.0, 1.0), ticks, _WIDE)
        for name, colour in (("observed_cover", "red"), ("simulated_cover", "blue")):
            low, high = cover[f"{name}_bounds"].values.T
            plot.bars(hours, low, high, COLOURS[colour])
            plot.line(hours, cover[name].values, COLOURS[colour])
        out.append(f"<figure>{plot.svg}<figcaption>Red: observed. Blue: simulated.</figcaption></figure>")
    return out


def _clock_ticks(series: xr.Dataset, hours: float) -> list[tuple[float, str]]:
    """Full minutes, quarters and hours, at most eight: hours since the first frame, and what a clock shows."""
    start = series["time"].values[0].astype("datetime64[s]")
    step = next((each for each in _STEPS_MIN if hours * 60 / each <= 7), 1440 * int(np.ceil(hours / 24 / 7)))
    since = (start - start.astype("datetime64[D]")) / np.timedelta64(1, "m")  # midnight
    first = np.ceil(since / step) * step - since
    after = np.arange(first, hours * 60 + 1e-6, step)
    places = [start + np.timedelta64(round(60 * minutes), "s") for minutes in after]
    shown = slice(5, 10) if step >= 1440 else slice(11, 16)
    return [(m / 60, str(t)[shown]) for m, t in zip(after, places, strict=True)] or [(0.0, str(start)[11:19])]


def _keogram(series: xr.Dataset, name: str, text: str) -> str:
    values = np.nan_to_num(series[f"keogram_{name}"].transpose("meridian", "time", "channel").values)
    picture = np.round(255 * np.clip(values, 0, 1)).astype(np.uint8)
    if picture.shape[-1] == 1:
        picture = np.repeat(picture, 3, axis=-1)
    return (
        f'<figure><img alt="{text}" style="width:100%;max-width:{_WIDE}px;height:180px;image-rendering:pixelated" '
        f'src="{data_uri(picture)}"><figcaption>{text}</figcaption></figure>'
    )


def _table(series: xr.Dataset) -> str:
    mask = float(series.attrs.get("sun_mask_deg", series["sun_mask"].values[-1]))
    rows = []
    for i in range(series.sizes["time"]):
        part = series.isel(time=i)
        r = part["r"].sel(weighting="solid angle", sun_mask=mask, score_channel="mean")
        values = [float(r.sel(light=light)) for light in ("as stored", "response undone")]
        for cover in ("observed_cover", "simulated_cover"):
            values.append(float(part[cover].sel(rule="clear sky")) if cover in part else np.nan)
        cells = ["&ndash;" if np.isnan(value) else f"{value:.3f}" for value in values]
        name = str(part["frame"].values)
        to = quote(f"{os.path.splitext(name)[0]}.html")  # a name may begin as "javascript:" does, or have # or %
        link = f'<a href="{escape(to)}">{escape(one_line(name))}</a>'
        rows.append(f"<tr><td>{link}</td><td>{str(part['time'].values)[:19].replace('T', ' ')}</td>"
                    + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")  # fmt: skip
    head = "".join(f"<th>{name}</th>" for name in ("frame", "time, UTC", "r as stored", "r, response undone",
                                                   "observed cover", "simulated cover"))  # fmt: skip
    return f'<table class="frames"><tr>{head}</tr>{"".join(rows)}</table>'
