"""The page of a calibration: one HTML file that asks nothing of any server."""

import base64
import os
from html import escape

import numpy as np
from numpy.typing import NDArray

from openswim.errors import one_line
from openswim.observations.calibration import Calibration
from openswim.observations.frames import read_frame
from openswim.observations.lens_fit import residuals
from openswim.observations.overlay import drawn, jpeg
from openswim.observations.star_fit import StarFit
from openswim.observations.ticks import round_step, round_ticks
from openswim.scene.files import written_whole

F64 = NDArray[np.float64]
_STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:1440px;margin:2em auto;padding:0 1em;color:#1b2733}"
    "img{max-width:100%;display:block}table{border-collapse:collapse}td,th{padding:.2em .8em;text-align:right;"
    "border-bottom:1px solid #d5dde5}td:first-child,th:first-child{text-align:left}figure{margin:1.5em 0}"
    ".plots{display:flex;flex-wrap:wrap;gap:1em}figcaption{color:#51606e;overflow-wrap:anywhere}h1{overflow-wrap:anywhere}"
    ".chosen{font-weight:bold}"
)


def write_report(calibration: Calibration, path: str | os.PathLike[str], most_frames: int = 3) -> None:
    """What the fit cannot tell, the lenses, residuals by radius and azimuth, overlays of the best frames."""
    chosen, matched = calibration.chosen, calibration.matched
    fitted = np.stack(chosen.optics.project(matched.direction), axis=-1)
    miss = residuals(chosen.optics, matched.direction, matched.place)
    zenith = np.degrees(np.arccos(np.clip(matched.direction[:, 2], -1, 1)))
    what = {"stars": "stars", "sun": "suns", "moon": "moons"}[calibration.by]
    title = one_line(calibration.content.name or calibration.frames[0].path.stem)
    parts = [
        f"<h1>Camera: {escape(title)}</h1>",
        f"<p>{escape(_summary(calibration, what))}</p>",
        "<h2>What this fit cannot tell</h2><ul>",
        *(f"<li>{escape(line)}</li>" for line in calibration.cannot_tell),
        "</ul>",
        _lens_table(calibration),
        "<h2>Distances between what was found and where the camera has it</h2>",
        '<div class="plots">',
        _plot(zenith, np.hypot(*miss.T), "degrees from the zenith", "distance, px"),
        _plot(_azimuth(matched.direction), np.hypot(*miss.T), "azimuth, degrees", "distance, px", (0, 360)),
        _plot(zenith, _radial(miss, fitted, chosen.optics), "degrees from the zenith", "part away from the centre, px"),
        "</div>",
        _left_out(calibration),
        "<h2>Frames</h2>",
        *_overlays(calibration, fitted, what, most_frames),
    ]
    page = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style>" + "\n".join(parts) + "</html>\n"
    )  # fmt: skip
    with written_whole(path) as partial:
        partial.write_text(page, "utf-8", "backslashreplace")


def _summary(calibration: Calibration, what: str) -> str:
    chosen, optics = calibration.chosen, calibration.chosen.optics
    degrees = np.degrees(chosen.held_out_px / optics.lens.focal_px)
    frames = len(set(calibration.matched.frame.tolist()))
    axis = f"{optics.tilt_deg:.2f} degrees off the zenith toward azimuth {optics.tilt_azimuth_deg:.0f}"
    text = (
        f"{chosen.matches} {what} in {frames} frame{'s' if frames > 1 else ''} match one to one. "
        f"Lens: {chosen.name}, {optics.lens.focal_px:.2f} px per radian; centre row {optics.centre_row:.2f}, column "
        f"{optics.centre_column:.2f}; north {optics.rotation_deg:.2f} degrees counter-clockwise of up"
        f"{', mirrored' if optics.mirrored else ''}; axis {axis if optics.tilt_deg else 'in the zenith'}. "
        f"Median distance {chosen.median_px:.2f} px; of {what} that were left out of "
        f"the fit {chosen.held_out_px:.2f} px, {degrees:.3f} degrees."
    )
    if isinstance(calibration.fit, StarFit):
        return (
            f"{text} The next distinct solution has {calibration.fit.next_matches} matches; chance alone would make "
            f"{calibration.fit.by_chance:.0f}."
        )
    return f"{text} The last third's, from a fit to those before: {calibration.fit.later_px:.2f} px."


def _overlays(calibration: Calibration, fitted: F64, what: str, most: int) -> list[str]:
    out = []
    matched = calibration.matched
    counts = np.bincount(matched.frame, minlength=len(calibration.frames))
    for number in np.argsort(-counts, kind="stable")[:most]:
        if not counts[number]:
            continue
        info = calibration.frames[number]
        frame = read_frame(info.path, info.time, calibration.content.frames)
        here = matched.frame == number
        seen, expected = np.empty((0, 2)), np.empty((0, 2))
        if isinstance(calibration.fit, StarFit):
            sky = calibration.fit.skies[number]
            seen, expected = sky.peaks.place, _unmatched(calibration, sky.direction, fitted[here])
        pairs = zip(matched.place[here], fitted[here], strict=True)
        picture = drawn(frame, calibration.camera, seen, expected, pairs, magnify=10.0)
        data = base64.b64encode(jpeg(picture)).decode()
        stars = " Yellow crosses: points found. Red: stars that were not found." if what == "stars" else ""
        text = (
            f"{info.path.name}, {str(info.time)[:19]} UTC (told by: {info.time_source}). Green: {what} that match, the "
            f"distance ten times as long.{stars} Rings every 15 degrees of altitude."
        )
        out.append(f'<figure><img alt="overlay" src="data:image/jpeg;base64,{data}">'
                   f"<figcaption>{escape(one_line(text))}</figcaption></figure>")  # fmt: skip
    return out


def _unmatched(calibration: Calibration, direction: F64, fitted: F64) -> F64:
    place = np.stack(calibration.chosen.optics.project(direction), axis=-1)
    place = place[np.isfinite(place[:, 0])]
    apart = np.linalg.norm(place[:, None] - fitted[None], axis=-1).min(axis=1, initial=np.inf)
    return np.asarray(place[apart > 0.01])


def _lens_table(calibration: Calibration) -> str:
    rows = []
    for lens in calibration.fit.lenses:
        mark = ' class="chosen"' if lens is calibration.chosen else ""
        degrees = np.degrees(lens.held_out_px / lens.optics.lens.focal_px)
        rows.append(
            f"<tr{mark}><td>{escape(lens.name)}</td><td>{lens.matches}</td><td>{lens.median_px:.2f}</td>"
            f"<td>{lens.held_out_px:.2f}</td><td>{degrees:.3f}</td></tr>"
        )
    head = "<tr><th>lens</th><th>matches</th><th>median, px</th><th>held out, px</th><th>held out, degrees</th></tr>"
    return f"<h2>Lenses</h2><table>{head}{''.join(rows)}</table>"


def _left_out(calibration: Calibration) -> str:
    if isinstance(calibration.fit, StarFit) or not calibration.fit.left_out:
        return ""
    lines = "".join(f"<li>{escape(line)}</li>" for line in calibration.fit.left_out)
    return f"<h2>Frames that were left out</h2><ul>{lines}</ul>"


def _azimuth(direction: F64) -> F64:
    return np.asarray(np.degrees(np.arctan2(direction[:, 0], direction[:, 1])) % 360)


def _radial(miss: F64, fitted: F64, optics: object) -> F64:
    """The part of the misses that points away from the centre."""
    away = fitted - np.array([optics.centre_row, optics.centre_column])  # type: ignore[attr-defined]
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    return np.asarray((miss * away).sum(axis=1))


def _plot(x: F64, y: F64, x_name: str, y_name: str, x_range: tuple[float, float] = (0, 90)) -> str:
    """Points on axes, as SVG."""
    wide, high, left, bottom = 440, 260, 48, 40
    step = round_step(max(float(np.abs(y).max(initial=0.1)), 0.1) * 1.05 / 4)
    top = step * np.ceil(float(np.abs(y).max(initial=0.1)) * 1.05 / step)
    low = -top if (y < 0).any() else 0.0

    def across(value: float) -> float:
        return left + (value - x_range[0]) / (x_range[1] - x_range[0]) * (wide - left - 10)

    def up(value: float) -> float:
        return high - bottom - (value - low) / (top - low) * (high - bottom - 10)

    marks = [f'<line x1="{left}" x2="{wide - 10}" y1="{up(0):.1f}" y2="{up(0):.1f}" stroke="#8895a3"/>']
    for value in np.linspace(*x_range, 7 if x_range[1] == 90 else 5):
        marks.append(f'<text x="{across(value):.1f}" y="{high - bottom + 18}" text-anchor="middle">{value:.0f}</text>')
    for value in round_ticks(low, top, 10):
        y_px = f"{up(value):.1f}"
        marks.append(f'<text x="{left - 6}" y="{y_px}" dy="4" text-anchor="end">{round(value, 6):g}</text>'
                     f'<line x1="{left}" x2="{wide - 10}" y1="{y_px}" y2="{y_px}" stroke="#e2e8ee"/>')  # fmt: skip
    points = [f'<circle cx="{across(a):.1f}" cy="{up(b):.1f}" r="3" fill="#2a78b8" fill-opacity=".7"/>'
              for a, b in zip(x, y, strict=True)]  # fmt: skip
    names = (
        f'<text x="{(left + wide) / 2}" y="{high - 4}" text-anchor="middle">{escape(x_name)}</text>'
        f'<text transform="translate(12 {high / 2 - 10}) rotate(-90)" text-anchor="middle">{escape(y_name)}</text>'
    )
    return (f'<svg width="{wide}" height="{high}" font-family="system-ui,sans-serif" font-size="12" role="img">'
            f"{''.join(marks)}{''.join(points)}{names}</svg>")  # fmt: skip
