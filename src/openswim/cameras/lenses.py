"""Lenses: where in the picture light arrives that comes at an angle to the axis, and back.

The picture plane counts x to the right and y up, in pixels from where the axis meets it; directions are unit vectors
(right, up, forward) in front of the camera.  t is the angle from the axis, r the distance from it in the picture.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import polynomial as poly
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers, shown
from openswim.cameras.distortion import Distortion
from openswim.errors import UserError

F64 = NDArray[np.float64]

# name: (meaning of the coefficients, how many at most)
MODELS = {
    "equidistant": ("", 0),  # r = f t
    "equisolid": ("", 0),  # r = 2 f sin(t/2)
    "stereographic": ("", 0),  # r = 2 f tan(t/2)
    "orthographic": ("", 0),  # r = f sin t
    "polynomial": ("k3, k5, k7 in pixels", 3),  # r = f t + k3 t^3 + k5 t^5 + k7 t^7
    "kannala-brandt": ("k1, k2, k3, k4", 4),  # r = f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9)
    "ocam": ("a2, a3, a4 in pixels^-1, ^-2, ^-3", 3),  # (x, y, f + a2 r^2 + a3 r^3 + a4 r^4) along the ray
    "pinhole": ("k1, k2, p1, p2, k3 of Brown and Conrady", 5),  # r = f tan t, then distorted
}
FISHEYES = tuple(name for name in MODELS if name != "pinhole")
LARGEST_PX = 1e7
_LARGEST = 1e60  # of coefficients, whose ratios and powers stay numbers then


@dataclass(frozen=True)
class Lens:
    """A lens by its model, its focal length in pixels (pixels per radian near the axis), and its coefficients.

    Kannala and Brandt 2006 is OpenCV's fisheye; OCam is Scaramuzza's (its toolbox has the axis pointing the other way:
    change the signs of its a0 and the rest where a0 is negative; a1 is 0); Brown and Conrady as OpenCV orders them.
    """

    model: str
    focal_px: float
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.model, str) or self.model not in MODELS:
            raise UserError(f"lens {shown(self.model)} is unknown: choose one of {', '.join(MODELS)}")
        focal = number("lens: focal_px", self.focal_px)
        if not 0 < focal < LARGEST_PX:
            raise UserError(f"lens: focal_px {focal:g} must lie between 0 and {LARGEST_PX:g} pixels per radian")
        given = np.atleast_1d(numbers("lens: coefficients", self.coefficients)).astype(float).ravel()
        meaning, most = MODELS[self.model]
        if given.size > most:
            takes = f"takes at most {most} coefficients ({meaning})" if most else "takes no coefficients"
            raise UserError(f"lens: {self.model} {takes}, got {given.size}")
        size = np.abs(given[given != 0])
        if not ((size >= 1 / _LARGEST) & (size <= _LARGEST)).all():
            raise UserError(f"lens: coefficients {shown(self.coefficients)} must be numbers within {_LARGEST:g}")
        object.__setattr__(self, "focal_px", focal)
        object.__setattr__(self, "coefficients", tuple(float(c) for c in given))

    @property
    def limit_rad(self) -> float:
        """Angle from the axis up to which the model holds: where the radius would no longer grow."""
        return float(self._limits()[0])

    def radius_px(self, angle_rad: ArrayLike) -> F64:
        """r of t, for all lenses that are round (of a pinhole, that of its radial terms); NaN beyond the limit."""
        t = np.asarray(angle_rad, float)
        limit, farthest = self._limits()
        inside = np.where((t >= 0) & (t <= limit), t, np.nan)
        f = self.focal_px
        if self.model == "equidistant":
            return f * inside
        if self.model == "equisolid":
            return np.asarray(2 * f * np.sin(inside / 2))
        if self.model == "stereographic":
            return np.asarray(2 * f * np.tan(inside / 2))
        if self.model == "orthographic":
            return f * np.sin(inside)
        if self.model == "pinhole":
            return f * Distortion.of(self.coefficients).radial(np.tan(inside))
        if self.model == "ocam":
            return _inverse(lambda r: np.arctan2(r, poly.polyval(r, self._power())), inside, farthest)
        return np.asarray(poly.polyval(inside, self._power()), float)

    def angle_rad(self, radius_px: ArrayLike) -> F64:
        """t of r; NaN where the lens shows nothing."""
        r = np.asarray(radius_px, float)
        limit, farthest = self._limits()
        inside = np.where((r >= 0) & (r <= farthest), r, np.nan)
        f = self.focal_px
        if self.model == "equidistant":
            return inside / f
        if self.model == "equisolid":
            return 2 * np.arcsin(np.clip(inside / (2 * f), 0, 1))
        if self.model == "stereographic":
            return 2 * np.arctan(inside / (2 * f))
        if self.model == "orthographic":
            return np.arcsin(np.clip(inside / f, 0, 1))
        if self.model == "ocam":
            return np.arctan2(inside, poly.polyval(inside, self._power()))
        return _inverse(self.radius_px, inside, limit)

    def project(self, direction: ArrayLike) -> tuple[F64, F64]:
        """x, y in the picture of directions (..., 3); NaN where the lens does not see."""
        d = np.asarray(direction, float)
        across = np.hypot(d[..., 0], d[..., 1])
        angle = np.arctan2(across, d[..., 2])
        if self.model == "pinhole":
            seen = angle <= self.limit_rad
            depth = np.where(seen, d[..., 2], np.nan)
            x, y = Distortion.of(self.coefficients).distorted(d[..., 0] / depth, -d[..., 1] / depth)
            return self.focal_px * x, -self.focal_px * y  # its coefficients count y down
        radius = self.radius_px(angle)
        scale = np.divide(radius, across, out=np.full_like(radius, self.focal_px), where=across > 1e-12)
        return np.where(np.isnan(radius), np.nan, scale * d[..., 0]), np.where(
            np.isnan(radius), np.nan, scale * d[..., 1]
        )

    def direction(self, x_px: ArrayLike, y_px: ArrayLike) -> F64:
        """Directions (..., 3) of places in the picture; NaN where the lens shows nothing."""
        x, y = np.broadcast_arrays(np.asarray(x_px, float), np.asarray(y_px, float))
        if self.model == "pinhole":
            u, v = Distortion.of(self.coefficients).undistorted(x / self.focal_px, -y / self.focal_px)
            return np.stack([u, -v, np.ones_like(u)], axis=-1) / np.sqrt(1 + u**2 + v**2)[..., None]
        radius = np.hypot(x, y)
        angle = self.angle_rad(radius)
        scale = np.divide(np.sin(angle), radius, out=np.full_like(angle, 1 / self.focal_px), where=radius > 1e-9)
        return np.stack([scale * x, scale * y, np.cos(angle)], axis=-1)

    def solid_angle_sr(self, x_px: ArrayLike, y_px: ArrayLike) -> F64:
        """Solid angle of a square pixel of side 1 at places in the picture."""
        x, y = np.broadcast_arrays(np.asarray(x_px, float), np.asarray(y_px, float))
        if self.model == "pinhole":
            distortion = Distortion.of(self.coefficients)
            u, v = distortion.undistorted(x / self.focal_px, -y / self.focal_px)
            return (1 + u**2 + v**2) ** -1.5 / (self.focal_px**2 * distortion.stretch(u, v))
        radius = np.atleast_1d(np.maximum(np.hypot(x, y), 1e-6 * self.focal_px))
        angle = self.angle_rad(radius)
        slope = self._slope(angle, radius)
        with np.errstate(divide="ignore"):
            found = np.sin(angle) / (radius * slope)
        # near a rim where the radius stops growing: by the ring between the pixel's inner and outer edge
        rim = (slope < min(4 * np.sqrt(self.focal_px), 0.3 * self.focal_px)) & (radius > 0.5)
        r = radius[rim]
        edges = self.angle_rad(r - 0.5), self.angle_rad(np.minimum(r + 0.5, self._limits()[1]))
        found[rim] = (np.cos(edges[0]) - np.cos(edges[1])) / r
        return found

    def scaled(self, factor: float) -> "Lens":
        """The same lens before pixels `factor` times as fine."""
        powers = {"polynomial": (1, 1, 1), "ocam": (-1, -2, -3)}.get(self.model, (0,) * 5)
        scaled = tuple(c * factor**p for c, p in zip(self.coefficients, powers, strict=False))
        return replace(self, focal_px=self.focal_px * factor, coefficients=scaled)

    def _slope(self, angle: F64, radius: F64) -> F64:
        """dr/dt, pixels per radian."""
        f = self.focal_px
        if self.model == "equidistant":
            return np.full_like(angle, f)
        if self.model == "equisolid":
            return np.asarray(f * np.cos(angle / 2))
        if self.model == "stereographic":
            return f / np.cos(angle / 2) ** 2
        if self.model == "orthographic":
            return f * np.cos(angle)
        if self.model == "ocam":
            along, grows = poly.polyval(radius, self._power()), poly.polyval(radius, poly.polyder(self._power()))
            return (along**2 + radius**2) / (along - radius * grows)
        return np.asarray(poly.polyval(angle, poly.polyder(self._power())), float)

    def _power(self) -> F64:
        """Coefficients by power: of r(t), or of OCam's z(r)."""
        c = list(self.coefficients)
        if self.model == "ocam":
            return np.array([self.focal_px, 0.0, *c])
        unit = self.focal_px if self.model == "kannala-brandt" else 1.0
        return np.array([0.0, self.focal_px, *(v for each in c for v in (0.0, unit * each))])

    def _limits(self) -> tuple[float, float]:
        """The largest angle (rad) and the radius there (px)."""
        f = self.focal_px
        if self.model == "equidistant":
            return np.pi, np.pi * f
        if self.model == "equisolid":
            return np.pi, 2 * f
        if self.model == "stereographic":
            return np.radians(179.0), 2 * f * np.tan(np.radians(179.0) / 2)
        if self.model == "orthographic":
            return np.pi / 2, f
        if self.model == "pinhole":
            distortion = Distortion.of(self.coefficients)
            return float(np.arctan(distortion.limit)), f * float(distortion.radial(np.array(distortion.limit)))
        power = self._power()
        if self.model == "ocam":
            turning = power * (1.0 - np.arange(power.size))  # of the angle's derivative: z - r dz/dr
            farthest = min(_first_root(turning), 100 * f)
            return float(np.arctan2(farthest, poly.polyval(farthest, power))), farthest
        limit = min(np.sqrt(_first_root(power[1::2] * np.arange(1, power.size, 2))), np.pi)  # of dr/dt, in t^2
        return float(limit), float(poly.polyval(limit, power))


def _first_root(power: Any) -> float:
    """The smallest positive root of a polynomial; infinity where there is none."""
    if len(power) <= 2:  # most fits have one coefficient
        a, b = float(power[0]), float(power[1]) if len(power) == 2 else 0.0
        return -a / b if b * a < 0 else np.inf
    roots = poly.polyroots(np.trim_zeros(np.asarray(power, float), "b")) if np.any(power[1:]) else np.empty(0)
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.maximum(np.abs(roots), 1e-300)) & (roots.real > 0)]
    return float(real.min()) if real.size else np.inf


def _inverse(function: Any, value: F64, highest: float) -> F64:
    """Where an ascending function takes a value, between 0 and `highest`: a table, then secants held between bounds."""
    nodes = np.linspace(0.0, highest, 513)
    table = np.maximum.accumulate(function(nodes))
    at = np.clip(np.searchsorted(table, value, side="right") - 1, 0, nodes.size - 2)
    low, high = nodes[at], nodes[at + 1]
    below, above = table[at] - value, table[at + 1] - value
    for _ in range(60):
        with np.errstate(invalid="ignore", divide="ignore"):
            guess = low - below * (high - low) / (above - below)
        guess = np.where((guess > low) & (guess < high), guess, (low + high) / 2)
        off = function(guess) - value
        less = off < 0
        # the end that stays counts half (Illinois): else one end would never move
        above = np.where(less, above / 2, off)
        below = np.where(less, off, below / 2)
        low, high = np.where(less, guess, low), np.where(less, high, guess)
        if not np.nanmax(np.abs(off), initial=0.0) > 1e-12 * np.nanmax(np.abs(table)):
            break
    return np.where(np.isnan(value), np.nan, guess)
