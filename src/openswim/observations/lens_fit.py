"""Fitting a mounted lens to directions whose places in the picture are known."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.lenses import Lens
from openswim.cameras.optics import Optics

F64 = NDArray[np.float64]

FOLDS = 5
_FAR_PX = 1e4  # what a direction costs that the lens does not see


@dataclass(frozen=True)
class Freedom:
    """What a fit may change besides focal length and rotation."""

    centre: bool = True
    tilt: bool = True
    coefficients: int = 0

    @property
    def count(self) -> int:
        return 2 + 2 * self.centre + 2 * self.tilt + self.coefficients


# lens models that calibrations choose among: model, coefficients that are fitted
CANDIDATES = (
    ("equidistant", 0), ("equisolid", 0), ("stereographic", 0), ("orthographic", 0), ("polynomial", 1),
    ("polynomial", 2),
)  # fmt: skip


def name_of(model: str, coefficients: int) -> str:
    """Of a candidate, for people."""
    return model if not coefficients else f"{model}, {coefficients} coefficient{'s' * (coefficients > 1)}"


def fit(start: Optics, direction: F64, place: F64, freedom: Freedom, scale_px: float = 3.0) -> Optics:
    """Least squares with a soft L1 loss of `scale_px`: `direction` (n, 3), `place` (n, 2) row and column."""
    from scipy.optimize import least_squares

    zero = _values(start, freedom)
    unit = _units(start, freedom)

    def misses(values: F64) -> F64:
        return (residuals(_optics(start, freedom, zero + unit * values), direction, place) / scale_px).ravel()

    found = least_squares(misses, np.zeros(zero.size), loss="soft_l1", method="trf", x_scale=1.0, max_nfev=60)
    return _optics(start, freedom, zero + unit * found.x)


def residuals(optics: Optics, direction: F64, place: F64) -> F64:
    """(n, 2): observed less fitted row and column, pixels."""
    row, column = optics.project(direction)
    miss = place - np.stack([row, column], axis=-1)
    return np.where(np.isfinite(miss), miss, _FAR_PX)


def held_out_px(start: Optics, direction: F64, place: F64, freedom: Freedom, seed: int = 1) -> F64:
    """(n,) distances of each place from where a fit to the other folds has it."""
    n = len(direction)
    fold = np.random.default_rng(seed).permutation(np.arange(n) % FOLDS)
    away = np.empty(n)
    for k in range(FOLDS):
        kept, out = fold != k, fold == k
        optics = fit(start, direction[kept], place[kept], freedom)
        away[out] = np.linalg.norm(residuals(optics, direction[out], place[out]), axis=-1)
    return away


def with_lens(optics: Optics, model: str, coefficients: int, at_rad: float = 0.9) -> Optics:
    """The same mount with another lens, as wide at an angle as this one is."""
    if (optics.lens.model, len(optics.lens.coefficients)) == (model, coefficients):
        return optics
    radius = float(optics.lens.radius_px(at_rad))
    focal = radius / float(Lens(model, 1.0).radius_px(at_rad))
    return replace(optics, lens=Lens(model, focal, (0.0,) * coefficients))


def _values(optics: Optics, freedom: Freedom) -> F64:
    values = [np.log(optics.lens.focal_px), np.radians(optics.rotation_deg)]
    if freedom.centre:
        values += [optics.centre_row, optics.centre_column]
    if freedom.tilt:
        lean, toward = np.radians(optics.tilt_deg), np.radians(optics.tilt_azimuth_deg)
        values += [lean * np.sin(toward), lean * np.cos(toward)]
    return np.array([*values, *optics.lens.coefficients[: freedom.coefficients]])


def _units(optics: Optics, freedom: Freedom) -> F64:
    """Steps that move the picture's rim by about a pixel each."""
    f = optics.lens.focal_px
    units = [1 / f, 1 / f] + [1.0, 1.0] * freedom.centre + [1 / f, 1 / f] * freedom.tilt
    return np.array([*units, *([1.0] * freedom.coefficients)])


def _optics(start: Optics, freedom: Freedom, values: F64) -> Optics:
    v = [float(x) for x in values]
    focal, rotation = math.exp(min(max(v[0], -5.0), 15.0)), math.degrees(v[1])
    rest = v[2:]
    changes: dict[str, float] = {"rotation_deg": (rotation + 180) % 360 - 180}
    if freedom.centre:
        changes |= {"centre_row": min(max(rest[0], -1e5), 1e5), "centre_column": min(max(rest[1], -1e5), 1e5)}
        rest = rest[2:]
    if freedom.tilt:
        changes |= {
            "tilt_deg": min(math.degrees(math.hypot(rest[0], rest[1])), 180.0),
            "tilt_azimuth_deg": math.degrees(math.atan2(rest[0], rest[1])) % 360,
        }
        rest = rest[2:]
    lens = replace(start.lens, focal_px=focal, coefficients=tuple(rest) or start.lens.coefficients)
    return replace(start, lens=lens, **changes)  # type: ignore[arg-type]
