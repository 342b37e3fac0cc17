"""The page of one comparison: a single HTML file that asks nothing of any server."""

import os
from html import escape
from pathlib import Path

import numpy as np
import xarray as xr

from openswim.cameras import Camera
from openswim.comparison.report.marks import bodies, overlay
from openswim.comparison.report.pictures import (
    CLOUD_COLOURS,
    clouds,
    common_views,
    data_uri,
    difference,
    pair,
    reprojected,
)
from openswim.comparison.report.plots import Plot
from openswim.errors import one_line
from openswim.scene.files import written_whole

COLOURS = {"red": "#c8402a", "green": "#2f8f46", "blue": "#2866c4", "grey": "#555"}
_POINTS = 1200  # of each channel in a plot
_FILES = Path(__file__).parent


def write_page(comparison: xr.Dataset, camera: Camera, path: str | os.PathLike[str]) -> None:
    """`camera`: of the comparison's pixels, that is, the frame's camera made as small."""
    title = one_line(f"{comparison.attrs['frame']} beside {comparison.attrs['model']}")
    time = np.datetime64(comparison.attrs["time"].rstrip("Z"))
    sun = comparison.attrs["sun_azimuth_deg"], comparison.attrs["sun_altitude_deg"]
    place = None  # of a camera in a flat scene, the scene's
    if {"latitude", "longitude"} <= comparison.attrs.keys():
        place = float(comparison.attrs["latitude"]), float(comparison.attrs["longitude"])
    places = bodies(place, time, sun)
    body = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{escape(_summary(comparison))}</p>",
        _viewer(comparison, camera, places),
        "<h2>Scores</h2>", _r_table(comparison), _cloud_table(comparison),
        '<div class="plots">', *_plots(comparison), "</div>",
        "<h2>What these numbers rest on</h2>", _notes(comparison, camera),
    ]  # fmt: skip
    with written_whole(path) as partial:
        partial.write_text(document(title, body), "utf-8", "backslashreplace")


def document(title: str, body: list[str]) -> str:
    """A whole page, with its style and its script."""
    style, script = ((_FILES / name).read_text("utf-8") for name in ("page.css", "page.js"))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width"><title>{escape(title)}</title><style>{style}</style></head><body>'
        + "\n".join(part for part in body if part)
        + f"<script>{script}</script></body></html>\n"
    )


def _summary(comparison: xr.Dataset) -> str:
    attrs = comparison.attrs
    r = comparison["r"].sel(weighting="solid angle", sun_mask=attrs["sun_mask_deg"], score_channel="mean")
    stored, decoded, undone = (float(r.sel(light=light)) for light in ("as stored", "decoded", "response undone"))
    azimuth, altitude = attrs["sun_azimuth_deg"], attrs["sun_altitude_deg"]
    mean = (
        f"Mean r {stored:.3f} of counts as stored, {decoded:.3f} decoded ({attrs['encoding']}), {undone:.3f} with the "
        "response undone." if np.isfinite(stored) else "There is no r."
    )  # fmt: skip
    weather = f"Weather of {attrs['model_time']}. " if "model_time" in attrs else ""
    used = f"{100 * attrs['share_of_sky_used']:.0f} % of this sky"
    mask = attrs["sun_mask_deg"]
    away = f", {mask:g} degrees or more from the sun" if altitude > -mask else ""
    night = f" By night (the sun is {-altitude:.1f} degrees below the horizon) colours say little of clouds."
    return (
        f"{attrs['time']}, sun at azimuth {azimuth:.1f}, altitude {altitude:.1f} degrees. {weather}{mean} "
        f"Scores are of pixels above {attrs['lowest_deg']:g} degrees that are not saturated{away}: {used}."
        f"{night if altitude < 0 else ''}"
    )


def _viewer(comparison: xr.Dataset, camera: Camera, places: dict[str, tuple[float, float]]) -> str:
    seen, shown = pair(comparison)
    layers = {"observed": seen, "simulated": shown, "difference": difference(comparison)}
    if (masks := clouds(comparison)) is not None:
        layers["clouds"] = masks
    views = []
    for name, view in {"camera": camera, **common_views(camera)}.items():
        images, marks = [], overlay(view, places)
        for layer, picture in layers.items():
            drawn = picture if view is camera else reprojected(picture, camera, view, 0 if layer == "clouds" else 1)
            uri = data_uri(drawn, lossless=layer == "clouds")
            images.append(f'<figure class="{layer}"><img alt="{layer}" src="{uri}">{marks}</figure>')
        ratio = f"{view.shape[1]}/{view.shape[0]}"
        views.append(f'<div class="view" data-view="{name}" style="--ratio:{ratio}">{"".join(images)}</div>')
    modes = ["swipe", "blink", "difference", "side by side", *(["clouds"] if masks is not None else [])]
    buttons = "".join(f'<button data-mode="{mode}">{mode}</button>' for mode in modes)
    choices = "".join(f'<button data-choose="{name}">{name}</button>' for name in ("camera", "all-sky", "panorama"))
    ticks = "".join(
        f'<label><input type="checkbox" data-mark="{name}"> {text}</label>'
        for name, text in (("rings", "rings"), ("compass", "compass"), ("bodies", "sun, moon, planets"))
    )
    legend = "".join(
        f'<span><i style="background:rgb{colour}"></i>{name}</span>' for name, colour in CLOUD_COLOURS.items()
    )
    return (
        f'<section class="viewer" data-mode="swipe"><div class="controls">{buttons}<b></b>{choices}<b></b>{ticks}</div>'
        f'<input class="slider" type="range" min="0" max="100" value="50" aria-label="swipe">{"".join(views)}'
        f'<p class="legend clouds-only">{legend}<span><i style="background:#787e84"></i>no score</span></p>'
        '<p class="legend difference-only">red: the frame is brighter than the simulation; blue: it is darker; '
        "full colour at 30 % of full scale</p>"
        '<p class="legend swipe-only">left: observed; right: simulated</p></section>'
    )


def with_bounds(value: float, bounds: np.ndarray, digits: int = 3) -> str:
    """A score and its interval as a table shows it."""
    if not np.isfinite(value):
        return "&ndash;"
    value, low, high = (round(float(number), digits) + 0.0 for number in (value, *bounds))  # there is no less than 0
    ends = f" <small>{low:.{digits}f} to {high:.{digits}f}</small>" if np.isfinite([low, high]).all() else ""
    return f"{value:.{digits}f}{ends}"


def _r_table(comparison: xr.Dataset) -> str:
    channels = [str(name) for name in comparison["score_channel"].values]
    dims = "light", "weighting", "sun_mask"
    r = comparison["r"].transpose(*dims, "score_channel").values
    bounds = comparison["r_bounds"].transpose(*dims, "score_channel", "bound").values
    rows, masks = [], comparison["sun_mask"].values
    places = [comparison[name].values for name in dims]
    # the sun is down: its masks hide nothing
    alike = np.array_equal(r, np.broadcast_to(r[:, :, :1], r.shape), equal_nan=True)
    for at in np.ndindex(r.shape[:3]):
        if alike and masks[at[2]] != comparison.attrs["sun_mask_deg"]:
            continue
        light, weighting, mask = (values[n] for values, n in zip(places, at, strict=True))
        cells = "".join(f"<td>{with_bounds(float(v), b)}</td>" for v, b in zip(r[at], bounds[at], strict=True))
        rows.append(f"<tr><td>{light}</td><td>{weighting}</td><td>{mask:g}</td>{cells}</tr>")
    head = "".join(f"<th>{name}</th>" for name in ("r of light", "by", "sun mask, degrees", *channels))
    return f'<table><tr>{head}</tr>{"".join(rows)}</table>'


def _cloud_table(comparison: xr.Dataset) -> str:
    if "rule" not in comparison.dims:
        return ""
    names = {"observed_cover": "observed cover", "simulated_cover": "simulated cover", "pod": "POD", "far": "FAR",
             "ets": "ETS"}  # fmt: skip
    rows, scores = [], [(comparison[name].values, comparison[f"{name}_bounds"].values) for name in names]
    for n, rule in enumerate(comparison["rule"].values):
        cells = "".join(f"<td>{with_bounds(float(value[n]), bounds[n])}</td>" for value, bounds in scores)
        rows.append(f"<tr><td>{escape(str(rule))}</td>{cells}</tr>")
    head = "".join(f"<th>{name}</th>" for name in ("cloud by rule", *names.values()))
    return f'<table><tr>{head}</tr>{"".join(rows)}</table>'


def _plots(comparison: xr.Dataset) -> list[str]:
    out = [_response_plot(comparison)]
    if "fss" in comparison and np.isfinite(comparison["fss"]).any():
        out.append(_fss_plot(comparison))
    if "r_by_aod" in comparison:
        at, r = comparison["aod"].values, comparison["r_by_aod"].values
        if np.isfinite(r).all():
            low, top = np.floor(20 * r.min() - 0.2) / 20, min(1.0, np.ceil(20 * r.max() + 0.2) / 20)
            plot = Plot("aerosol optical depth at 550 nm", "mean r, response undone", (0, at.max() * 1.1), (low, top))
            plot.line(at, r, COLOURS["grey"])
            plot.points(at, r, COLOURS["grey"], 4, 1)
            out.append(_figure(plot, "r if the aerosol were half or twice what was taken. It is never fitted by r."))
    return [each for each in out if each]


def _response_plot(comparison: xr.Dataset) -> str:
    valid = comparison["valid"].values
    if valid.sum() < 10:
        return ""
    light, radiance = comparison["observed"].values[valid], comparison["simulated"].values[valid]
    some = np.linspace(0, len(light) - 1, min(_POINTS, len(light))).astype(int)
    top = float(np.percentile(light, 99.5)), float(np.percentile(radiance, 99.5)) * 1.1
    if min(top) <= 0:  # black, as the clear sky without air
        return ""
    names = "observed linear light, share of full scale", "simulated radiance, W/(m2 sr nm)"
    plot = Plot(*names, (0, top[0]), (0, top[1]))
    for k, name in enumerate(comparison["channel"].values):
        plot.points(light[some, k], radiance[some, k], COLOURS[str(name)])
        if "response_curve" in comparison:
            at = comparison["light_level"].values
            inside = at <= top[0]
            plot.line(at[inside], comparison["response_curve"].values[inside, k], COLOURS[str(name)])
    return _figure(plot, "Each point a pixel; lines: the monotone response that was found and undone.")


def _fss_plot(comparison: xr.Dataset) -> str:
    window = comparison["window"].values
    at = np.log2(window)
    plot = Plot("width of the window, degrees", "fractions skill score", (at[0] - 0.3, at[-1] + 0.3), (0, 1),
                [(float(a), f"{w:g}") for a, w in zip(at, window, strict=True)])  # fmt: skip
    bounds = comparison["fss_bounds"].values
    plot.bars(at, bounds[:, 0], bounds[:, 1], COLOURS["blue"])
    plot.line(at, comparison["fss"].values, COLOURS["blue"])
    plot.line(at, comparison["fss_random"].values, COLOURS["grey"], dashed=True)
    plot.line(at, comparison["fss_useful"].values, COLOURS["green"], dashed=True)
    return _figure(plot, "Blue: FSS of the cloud masks on a map of equal area. Grey: the same clouds in random order. "
                         "Green: from here on a simulation is useful.")  # fmt: skip


def _figure(plot: Plot, text: str) -> str:
    return f"<figure>{plot.svg}<figcaption>{escape(text)}</figcaption></figure>"


def _notes(comparison: xr.Dataset, camera: Camera) -> str:
    attrs = comparison.attrs
    depth, typical = attrs["aerosol_optical_depth_550"], attrs.get("red_blue_of_this_frame", np.nan)
    lines = [
        f"Aerosol optical depth {depth:.3g} at 550 nm, taken and not fitted. {attrs['aerosol_note']}",
        f"Response from: {attrs['response_from']}.",
        "Intervals hold 95 % by weighing tiles of the sky of 15 degrees anew 1000 times, neighbouring tiles alike.",
        *_reasons(attrs["reasons"]),
    ]
    if np.isfinite(typical):
        lines.insert(2, f"If this sky is clear, its camera's white balance is red_blue = {typical:.3f}.")
    if camera.nothing_hides:
        lines.insert(0, f"The camera's file names no obstacles: trees, masts and roofs above {attrs['lowest_deg']:g} "
                        "degrees count as sky.")  # fmt: skip
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>"


def _reasons(text: str) -> list[str]:
    """Lines "score: reason" as one line for each reason."""
    scores: dict[str, list[str]] = {}
    for line in text.splitlines():
        score, reason = line.split(": ", 1)
        scores.setdefault(reason, []).append(score.replace("_", " "))
    return [f"No {', '.join(names)}: {reason}." for reason, names in scores.items()]
