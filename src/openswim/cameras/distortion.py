"""The distortion of a pinhole camera's lens by Brown (1966) and Conrady (1919), on the plane one focal length away."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial as poly
from numpy.typing import NDArray

F64 = NDArray[np.float64]
_WIDEST = np.tan(np.radians(89.0))


@dataclass(frozen=True)
class Distortion:
    """x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2); y' alike, with p1 and p2 changed over.

    x to the right and y down, in focal lengths.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @classmethod
    def of(cls, coefficients: tuple[float, ...]) -> "Distortion":
        """From OpenCV's order k1, k2, p1, p2, k3, of which the last may be left out."""
        return cls(*coefficients)

    @property
    def limit(self) -> float:
        """The distance from the axis at which what is farther out would come back in."""
        slope = np.array([1, 0, 3 * self.k1, 0, 5 * self.k2, 0, 7 * self.k3])
        roots = poly.polyroots(np.trim_zeros(slope, "b")) if slope[1:].any() else np.empty(0)
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return float(min([*real, _WIDEST]))

    def radial(self, r: F64) -> F64:
        """r' of r by the radial terms alone."""
        s = np.asarray(r, float) ** 2
        return np.asarray(r * (1 + s * (self.k1 + s * (self.k2 + s * self.k3))), float)

    def distorted(self, x: F64, y: F64) -> tuple[F64, F64]:
        """x', y' of x, y."""
        s = x * x + y * y
        radial = 1 + s * (self.k1 + s * (self.k2 + s * self.k3))
        return (
            x * radial + 2 * self.p1 * x * y + self.p2 * (s + 2 * x * x),
            y * radial + 2 * self.p2 * x * y + self.p1 * (s + 2 * y * y),
        )

    def undistorted(self, x: F64, y: F64) -> tuple[F64, F64]:
        """x, y of x', y' by Newton's method, from the radial answer; NaN where no place within the limit goes there."""
        target = np.hypot(x, y)
        if self == Distortion():
            return tuple(np.where(target <= self.limit, part, np.nan) for part in (x, y))  # type: ignore[return-value]
        nodes = np.linspace(0.0, self.limit, 2049)
        r = np.interp(target, self.radial(nodes), nodes, right=np.nan)
        scale = np.divide(r, target, out=np.where(np.isnan(r), np.nan, 1.0), where=target > 1e-12)
        u, v = x * scale, y * scale
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            for _ in range(30):
                a, b, c, d = self._jacobian(u, v)
                fx, fy = self.distorted(u, v)
                fx, fy = fx - x, fy - y
                if not np.nanmax(np.hypot(fx, fy) / (1 + target), initial=0.0) > 1e-14:
                    break
                determinant = a * d - b * c
                u, v = u - (d * fx - b * fy) / determinant, v - (a * fy - c * fx) / determinant
            lost = ~(np.hypot(fx, fy) < 1e-10 * (1 + target)) | (np.hypot(u, v) > self.limit * (1 + 1e-12))
        return np.where(lost, np.nan, u), np.where(lost, np.nan, v)

    def stretch(self, x: F64, y: F64) -> F64:
        """Area of the distorted picture over that of the undistorted."""
        a, b, c, d = self._jacobian(x, y)
        return np.asarray(a * d - b * c)

    def _jacobian(self, x: F64, y: F64) -> tuple[F64, F64, F64, F64]:
        s = x * x + y * y
        radial = 1 + s * (self.k1 + s * (self.k2 + s * self.k3))
        slope = 2 * (self.k1 + s * (2 * self.k2 + 3 * s * self.k3))  # d(radial)/dx / x
        mixed = x * y * slope + 2 * self.p1 * x + 2 * self.p2 * y
        return (
            radial + x * x * slope + 2 * self.p1 * y + 6 * self.p2 * x, mixed, mixed,
            radial + y * y * slope + 2 * self.p2 * x + 6 * self.p1 * y,
        )  # fmt: skip
