"""Phase functions: how light scatters with angle. All have a mean of 1 over the sphere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError

FloatArray = NDArray[np.float64]


class PhaseFunction(ABC):
    """P(scattering angle) with (1/2) integral of P over cos(angle) = 1."""

    @abstractmethod
    def value(self, cos_scattering_angle: ArrayLike) -> FloatArray:
        """P (same shape as the argument), dimensionless."""

    @abstractmethod
    def moments(self, n: int) -> FloatArray:
        """Legendre moments chi_l = (1/2) integral P(mu) P_l(mu) dmu for l < n; chi_0 = 1, chi_1 = g."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """A JSON-ready description with a "type"; `phase_from_dict` is the inverse."""

    @property
    def asymmetry(self) -> float:
        """Mean cosine of the scattering angle, g."""
        return float(self.moments(2)[1])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PhaseFunction) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(str(self.to_dict()))

    def __repr__(self) -> str:
        arguments = ", ".join(f"{k}={v!r}" for k, v in self.to_dict().items() if k != "type")
        return f"{type(self).__name__}({arguments if len(arguments) < 200 else '...'})"


class HenyeyGreenstein(PhaseFunction):
    """(1 - g^2) / (1 + g^2 - 2 g mu)^(3/2), -1 < g < 1 (Henyey & Greenstein 1941; Albers et al. 2020, Eq.
    9)."""

    def __init__(self, g: float):
        self.g = _asymmetry_in_range(g)

    def value(self, cos_scattering_angle: ArrayLike) -> FloatArray:
        g, mu = self.g, np.asarray(cos_scattering_angle, float)
        # (1 - g)^2 + 2 g (1 - mu) keeps the sharp forward peak free of cancellation.
        return (1 - g * g) / ((1 - g) ** 2 + 2 * g * (1 - mu)) ** 1.5

    def moments(self, n: int) -> FloatArray:
        return np.power(self.g, np.arange(n, dtype=float))

    def to_dict(self) -> dict[str, Any]:
        return {"type": "henyey_greenstein", "g": self.g}


class Mixture(PhaseFunction):
    """Weighted sum of phase functions (Albers et al. 2020, Eq. 10); weights must sum to 1 within 1 %.

    They are scaled to sum to 1. Negative weights are allowed as long as the sum is positive everywhere
    (checked every half degree).
    """

    def __init__(self, weights: Sequence[float], phases: Sequence[PhaseFunction]):
        if len(weights) != len(phases) or not phases:
            raise UserError(f"phase mixture: {len(weights)} weights for {len(phases)} phase functions")
        total = float(sum(weights))
        if not abs(total - 1.0) <= 0.01:
            raise UserError(f"phase mixture: the weights must sum to 1, they sum to {total:g}")
        self.weights = tuple(float(w) / total for w in weights)
        self.phases = tuple(phases)
        if min(self.weights) < 0 and self.value(np.cos(np.radians(np.arange(0.0, 180.1, 0.5)))).min() < 0:
            raise UserError("phase mixture: negative at some scattering angle; reduce the negative weights")

    def value(self, cos_scattering_angle: ArrayLike) -> FloatArray:
        mu = np.asarray(cos_scattering_angle, float)
        return np.asarray(sum(w * p.value(mu) for w, p in zip(self.weights, self.phases, strict=True)))

    def moments(self, n: int) -> FloatArray:
        return np.asarray(sum(w * p.moments(n) for w, p in zip(self.weights, self.phases, strict=True)))

    def to_dict(self) -> dict[str, Any]:
        return {
            "type": "mixture",
            "weights": list(self.weights),
            "phases": [p.to_dict() for p in self.phases],
        }


class DoubleHenyeyGreenstein(Mixture):
    """forward_fraction of HG(g_forward) and the rest of HG(g_backward)."""

    def __init__(self, g_forward: float, g_backward: float, forward_fraction: float):
        super().__init__(
            (forward_fraction, 1.0 - forward_fraction),
            (HenyeyGreenstein(g_forward), HenyeyGreenstein(g_backward)),
        )


class AlbersDHG(PhaseFunction):
    """HG with a quadratic backward term (Albers et al. 2020, Eq. 27, corrected: power 3/2 in both
    denominators).

    P = (1 - g^2) [ (1 + g^2 - 2 g mu)^(-3/2) + f_b (3 mu^2 - 1) / (2 (1 + g^2)^(3/2)) ], positive for f_b <
    2.
    """

    def __init__(self, g: float, f_b: float):
        self.g = _asymmetry_in_range(g)
        if not 0 <= f_b <= 1.7:
            raise UserError(f"double Henyey-Greenstein: f_b must lie in 0..1.7, got {f_b}")
        self.f_b = float(f_b)

    @property
    def _second_order(self) -> float:
        return self.f_b * (1 - self.g**2) / (1 + self.g**2) ** 1.5

    def value(self, cos_scattering_angle: ArrayLike) -> FloatArray:
        mu = np.asarray(cos_scattering_angle, float)
        return HenyeyGreenstein(self.g).value(mu) + self._second_order * (1.5 * mu**2 - 0.5)

    def moments(self, n: int) -> FloatArray:
        chi = HenyeyGreenstein(self.g).moments(n)
        if n > 2:
            chi[2] += self._second_order / 5
        return chi

    def to_dict(self) -> dict[str, Any]:
        return {"type": "albers_dhg", "g": self.g, "f_b": self.f_b}


class Rayleigh(PhaseFunction):
    """Molecular scattering of unpolarised light with depolarisation factor rho (Chandrasekhar 1960; Bucholtz
    1995).

    P = 3 / (4 (1 + 2 gamma)) [ (1 + 3 gamma) + (1 - gamma) mu^2 ], gamma = rho / (2 - rho). Scalar: without
    polarisation, sky radiance is off by -6 to +8 %.
    """

    def __init__(self, depolarisation: float = 0.0279):
        if not 0 <= depolarisation < 1:
            raise UserError(f"Rayleigh: the depolarisation factor must lie in 0..1, got {depolarisation}")
        self.depolarisation = float(depolarisation)

    @property
    def _gamma(self) -> float:
        return self.depolarisation / (2 - self.depolarisation)

    def value(self, cos_scattering_angle: ArrayLike) -> FloatArray:
        mu, gamma = np.asarray(cos_scattering_angle, float), self._gamma
        return 0.75 / (1 + 2 * gamma) * ((1 + 3 * gamma) + (1 - gamma) * mu**2)

    def moments(self, n: int) -> FloatArray:
        chi = np.zeros(n)
        chi[:3] = (1.0, 0.0, 0.1 * (1 - self._gamma) / (1 + 2 * self._gamma))[:n]
        return chi

    def to_dict(self) -> dict[str, Any]:
        return {"type": "rayleigh", "depolarisation": self.depolarisation}


def phases_at(
    phase: PhaseFunction | Mapping[float, PhaseFunction], wavelengths_nm: ArrayLike
) -> list[PhaseFunction]:
    """One phase function per wavelength: the same one, or interpolated linearly in a {wavelength_nm: phase}
    mapping.

    Beyond the mapping's ends the nearest one holds.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    if isinstance(phase, PhaseFunction):
        return [phase] * wavelengths.size
    known = np.array(sorted(phase))
    return [_blend(phase, known, wl) for wl in wavelengths]


def _blend(phase: Mapping[float, PhaseFunction], known: FloatArray, wavelength_nm: float) -> PhaseFunction:
    position = float(np.interp(wavelength_nm, known, np.arange(known.size)))
    lower = int(position)
    share = position - lower
    if share < 1e-9:
        return phase[known[lower]]
    return Mixture((1 - share, share), (phase[known[lower]], phase[known[lower + 1]]))


def _asymmetry_in_range(g: float) -> float:
    if not -1 < g < 1:
        raise UserError(f"Henyey-Greenstein: g must lie between -1 and 1, got {g}")
    return float(g)
