"""Scattering by size distributions of homogeneous spheres: Mie theory, by miepython (an optional dependency)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.optics.irregular import irregular_value, share
from openswim.scene.phase import TablePhase

FloatArray = NDArray[np.float64]


_LARGEST_UM = 1000.0  # of aerosol; Mie series are as long as particles are large


@dataclass(frozen=True)
class Mode:
    """A lognormal mode: median radius (um) and geometric standard deviation of its number or of its volume.

    `amount` is the mode's share of the particles' number (by="number") or volume (by="volume"); only the ratios of
    the modes' amounts count.
    """

    median_radius_um: float
    geometric_std: float
    amount: float = 1.0
    by: str = "number"

    def __post_init__(self) -> None:
        if not (1e-4 <= self.median_radius_um <= 1e3):
            raise UserError(f"size mode: the median radius must lie in 1e-4..1000 um, got {self.median_radius_um:g}")
        if not (1.0 < self.geometric_std <= 5.0):
            raise UserError(
                f"size mode: the geometric standard deviation must lie in 1..5, got {self.geometric_std:g} "
                "(give exp(sigma) where sigma is that of ln r)"
            )
        if not (np.isfinite(self.amount) and self.amount > 0):
            raise UserError(f"size mode: the amount must be positive, got {self.amount:g}")
        if self.by not in ("number", "volume"):
            raise UserError(f"size mode: amounts are by number or volume, got {self.by!r}")


@dataclass(frozen=True)
class Sizes:
    """Radii (n,) in um and the relative number of particles (n,) of each."""

    radius_um: FloatArray
    number: FloatArray

    @property
    def effective_radius_um(self) -> float:
        """Ratio of the third to the second moment of the radius (Hansen & Travis 1974)."""
        return float((self.number * self.radius_um**3).sum() / (self.number * self.radius_um**2).sum())


@dataclass(frozen=True)
class SphereOptics:
    """Bulk optics of a size distribution at one wavelength.

    value: phase function (mean 1) at angle_deg; efficiency: extinction over geometric cross section.
    """

    angle_deg: FloatArray
    value: FloatArray
    single_scattering_albedo: float
    efficiency: float

    @property
    def phase(self) -> TablePhase:
        return TablePhase(self.angle_deg, self.value)


def gamma_sizes(
    effective_radius_um: float, variance: float, smallest_um: float, largest_um: float, count: int
) -> Sizes:
    """Gamma distribution n ~ r^((1-3v)/v) exp(-r/(r_eff v)) (Hansen & Travis 1974, Eq. 2.56) on even steps of ln r."""
    radius, step = _log_steps(smallest_um, largest_um, count)
    log_number = (1 - 3 * variance) / variance * np.log(radius / effective_radius_um) - radius / (
        effective_radius_um * variance
    )
    return Sizes(radius, np.exp(log_number - log_number.max()) * radius * step)


def lognormal_sizes(modes: Sequence[Mode], count: int = 400) -> Sizes:
    """Sum of lognormal modes, on even steps of ln r that hold all but 1e-3 of their cross section."""
    if not modes:
        raise UserError("size distribution: give at least one mode")
    ranges = [_extent(mode) for mode in modes]
    if (largest := max(high for _, high in ranges)) > _LARGEST_UM:
        raise UserError(
            f"size distribution: its particles have radii up to {largest:.3g} um, more than {_LARGEST_UM:g} um: "
            "give a smaller median or standard deviation"
        )
    radius, step = _log_steps(min(low for low, _ in ranges), max(high for _, high in ranges), count)
    number = np.zeros_like(radius)
    for mode in modes:
        sigma = np.log(mode.geometric_std)
        density = np.exp(-0.5 * (np.log(radius / mode.median_radius_um) / sigma) ** 2) / (np.sqrt(2 * np.pi) * sigma)
        per_particle = 1.0 if mode.by == "number" else 4 / 3 * np.pi * radius**3
        number += mode.amount * density * step / per_particle
    return Sizes(radius, number)


def scattering_by_spheres(
    sizes: Sizes,
    refractive_index: complex,
    wavelength_nm: float,
    angle_deg: ArrayLike | None = None,
    irregular: bool = False,
) -> SphereOptics:
    """Mean optics of spheres of `refractive_index` (n + ik or n - ik, k absorbs) in air, by Mie theory.

    `irregular`: particles of size parameters above 3-8 scatter as dust does (`openswim.optics.irregular`).
    """
    mie = _miepython()
    index = complex(refractive_index.real, -abs(refractive_index.imag))  # miepython's sign
    if not (0.1 < index.real < 10 and abs(index.imag) < 10):
        raise UserError(f"refractive index {refractive_index:g}: the real part must lie in .1..10, the other below 10")
    angle = scattering_angles() if angle_deg is None else np.asarray(angle_deg, float)
    mu = np.cos(np.radians(angle))
    intensity, scattered, lost, shadow = np.zeros_like(mu), 0.0, 0.0, 0.0
    for radius, number in zip(sizes.radius_um, sizes.number, strict=True):
        x = 2 * np.pi * radius / (wavelength_nm * 1e-3)
        extinction, scattering, _, g = mie.efficiencies_mx(index, x)
        area = number * np.pi * radius**2
        dusty = share(x) if irregular else 0.0
        if dusty < 1:
            s1, s2 = mie.S1_S2(index, x, mu, norm="qsca")
            intensity += (1 - dusty) * area * (np.abs(s1) ** 2 + np.abs(s2) ** 2) * 2 * np.pi
        if dusty > 0:
            intensity += dusty * area * scattering * irregular_value(mu, x, index, float(scattering), float(g))
        scattered += area * float(scattering)
        lost += area * float(extinction)
        shadow += area
    return SphereOptics(angle, intensity / scattered, scattered / lost, lost / shadow)


def scattering_angles(smallest_deg: float = 0.05) -> FloatArray:
    """Angles for tables, 0 to 180 degrees: logarithmic through the forward peak, fine at bows and glory."""
    return np.unique(
        np.concatenate(
            [
                [0.0],
                np.geomspace(smallest_deg, 10.0, 120),
                np.arange(10.5, 60, 1.0),
                np.arange(60, 120, 1.5),
                np.arange(120.0, 148, 0.5),
                np.arange(148, 170, 1.0),
                np.arange(170, 176, 0.25),
                np.linspace(176, 180, 33),
            ]
        )
    )


def _extent(mode: Mode) -> tuple[float, float]:
    """Radii that hold nearly all of a mode's cross section (~ r^2 n), and of its scattering where that is ~ r^6 n."""
    sigma = np.log(mode.geometric_std)
    centre = np.log(mode.median_radius_um) - (3 * sigma**2 if mode.by == "volume" else 0.0)
    return float(np.exp(centre + 2 * sigma**2 - 3.5 * sigma)), float(np.exp(centre + 4 * sigma**2 + 3.5 * sigma))


def _log_steps(smallest: float, largest: float, count: int) -> tuple[FloatArray, float]:
    """Middles of `count` even steps of the logarithm, and the step."""
    edges = np.linspace(np.log(smallest), np.log(largest), count + 1)
    return np.exp(0.5 * (edges[1:] + edges[:-1])), float(edges[1] - edges[0])


def _miepython() -> ModuleType:
    os.environ.setdefault("MIEPYTHON_USE_JIT", "1")  # read when it is first imported; 20 times faster
    try:
        import miepython
    except ImportError as error:
        raise UserError("Mie theory needs the package miepython: pip install 'openswim[mie]'") from error
    return cast(ModuleType, miepython)
