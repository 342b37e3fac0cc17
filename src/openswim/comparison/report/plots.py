"""Plots as SVG: points, lines with bands, on axes with numbers."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.observations.ticks import round_ticks

F64 = NDArray[np.float64]
WIDE, HIGH, LEFT, BOTTOM, RIGHT, TOP = 460, 300, 62, 44, 16, 14


@dataclass
class Plot:
    """Axes of ranges (low, high), filled piece by piece; `svg` is the text."""

    x_name: str
    y_name: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    x_ticks: Sequence[tuple[float, str]] = ()
    wide: int = WIDE
    parts: list[str] = field(default_factory=list)

    def across(self, x: ArrayLike) -> F64:
        low, high = self.x_range
        return np.asarray(LEFT + (np.asarray(x, float) - low) / (high - low) * (self.wide - LEFT - RIGHT))

    def up(self, y: ArrayLike) -> F64:
        low, high = self.y_range
        return np.asarray(HIGH - BOTTOM - (np.asarray(y, float) - low) / (high - low) * (HIGH - BOTTOM - TOP))

    def points(self, x: F64, y: F64, colour: str, radius: float = 1.6, opacity: float = 0.35) -> None:
        """Those within the axes."""
        inside = (x >= self.x_range[0]) & (x <= self.x_range[1]) & (y >= self.y_range[0]) & (y <= self.y_range[1])
        places = zip(self.across(x[inside]), self.up(y[inside]), strict=True)
        dots = "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{radius}"/>' for a, b in places)
        self.parts.append(f'<g fill="{colour}" fill-opacity="{opacity}">{dots}</g>')

    def line(self, x: F64, y: F64, colour: str, dashed: bool = False) -> None:
        """Broken where a value is missing."""
        path, pen = [], "M"
        for a, b in zip(self.across(x), self.up(np.clip(y, *self.y_range)), strict=True):
            if not np.isfinite(a + b):
                pen = "M"
                continue
            path.append(f"{pen}{a:.1f} {b:.1f}")
            pen = "L"
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        self.parts.append(f'<path d="{"".join(path)}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>')

    def bars(self, x: F64, low: F64, high: F64, colour: str) -> None:
        """Intervals."""
        for a, b, c in zip(self.across(x), self.up(np.clip(low, *self.y_range)), self.up(np.clip(high, *self.y_range)),
                           strict=True):  # fmt: skip
            if np.isfinite(a + b + c):
                self.parts.append(f'<line x1="{a:.1f}" x2="{a:.1f}" y1="{b:.1f}" y2="{c:.1f}" stroke="{colour}" '
                                  'stroke-width="5" stroke-opacity=".3"/>')  # fmt: skip

    def label(self, x: float, y: float, text: str, colour: str) -> None:
        self.parts.append(f'<text x="{float(self.across(x)):.1f}" y="{float(self.up(y)):.1f}" '
                          f'fill="{colour}">{escape(text)}</text>')  # fmt: skip

    @property
    def svg(self) -> str:
        wide, marks = self.wide, []
        ticks = self.x_ticks or [(v, f"{v:.6g}") for v in round_ticks(*self.x_range)]
        for value, text in ticks:
            a = float(self.across(value))
            marks.append(f'<text x="{a:.1f}" y="{HIGH - BOTTOM + 17}" text-anchor="middle">{escape(text)}</text>')
        for value in round_ticks(*self.y_range):
            b = float(self.up(value))
            marks.append(f'<line x1="{LEFT}" x2="{wide - RIGHT}" y1="{b:.1f}" y2="{b:.1f}" stroke="#e2e8ee"/>'
                         f'<text x="{LEFT - 6}" y="{b + 4:.1f}" text-anchor="end">{value:.6g}</text>')  # fmt: skip
        names = (
            f'<text x="{(LEFT + wide) / 2:.0f}" y="{HIGH - 6}" text-anchor="middle">{escape(self.x_name)}</text>'
            f'<text transform="translate(13 {(HIGH - BOTTOM) / 2:.0f}) rotate(-90)" '
            f'text-anchor="middle">{escape(self.y_name)}</text>'
        )
        head = f'viewBox="0 0 {wide} {HIGH}" width="{wide}" height="{HIGH}" font-family="system-ui,sans-serif"'
        drawn = "".join([*marks, *self.parts, names])
        return f'<svg {head} font-size="12" fill="#1b2733" role="img">{drawn}</svg>'
