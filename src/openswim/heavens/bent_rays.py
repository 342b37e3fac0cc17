"""Rays bent by the air: how far they are lifted, and how much air they go through."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.optics.rayleigh import BOLTZMANN_J_PER_K, STANDARD_NUMBER_PER_M3, refractivity
from openswim.optics.species import background
from openswim.scene.atmosphere import TOP_M, Atmosphere
from openswim.scene.frame import horizon_dip_deg
from openswim.scene.grid import EARTH_RADIUS_M

F64 = NDArray[np.float64]

_STEPS = 1500
_LEVELS_M = np.concatenate([np.arange(0, 12e3, 50), np.arange(12e3, 40e3, 250), np.arange(40e3, TOP_M + 1, 2000)])


@dataclass(frozen=True)
class BentRays:
    """Rays (n,) from one place through the air, each followed until it leaves it or ends on the ground.

    refraction_deg: apparent less true altitude; NaN where a ray ends on the ground. height_m, length_m (steps, n): the
    middle and the length of its parts.
    """

    apparent_altitude_deg: F64
    refraction_deg: F64
    height_m: F64
    length_m: F64

    def depth(self, levels_m: F64, extinction_per_m: F64) -> F64:
        """Optical depth (n,) of a profile that is linear between levels."""
        return np.asarray((np.interp(self.height_m, levels_m, extinction_per_m) * self.length_m).sum(axis=0))


def bent_rays(
    air: Atmosphere, apparent_altitude_deg: ArrayLike, height_m: float = 0.0, wavelength_nm: float = 550.0,
    radius_m: float = EARTH_RADIUS_M, straight: bool = False,
) -> BentRays:  # fmt: skip
    """Rays that arrive at a height (m above sea level) from apparent altitudes (n,), over a ground at sea level.

    Steps of the ray equations in polar coordinates; n - 1 goes with the air's density. Within .001 degrees of finer
    steps at the horizon. straight: as if the air bent nothing.
    """
    pressure, temperature, _ = air.at(_LEVELS_M)
    number = pressure / (BOLTZMANN_J_PER_K * temperature)
    altitude = np.atleast_1d(np.asarray(apparent_altitude_deg, float))
    if straight:
        return BentRays(altitude, *_straight(altitude, height_m, radius_m))
    excess = float(refractivity(wavelength_nm)) * number / STANDARD_NUMBER_PER_M3
    return BentRays(altitude, *_bent(excess.tobytes(), altitude.tobytes(), height_m, radius_m))


def _parts(altitude: F64, height_m: float, radius_m: float) -> tuple[F64, F64]:
    """Zenith angles (n,), and where the parts of rays end (steps + 1, n), m from the eye.

    They are short where the air is dense: near the eye, or, downward, about the lowest point.
    """
    zenith = np.radians(90.0 - altitude)
    start, top = radius_m + height_m, radius_m + TOP_M
    whole = -start * np.cos(zenith) + np.sqrt(np.maximum(top**2 - (start * np.sin(zenith)) ** 2, 0)) + 2e4
    middle = np.maximum(-start * np.cos(zenith), 0)
    u = np.linspace(0, 1, _STEPS + 1)[:, None]
    a, b = np.cbrt(-middle), np.cbrt(whole - middle)
    return zenith, middle + (a + (b - a) * u) ** 3


def _free(heights: F64, steps: F64, height_m: float) -> tuple[F64, NDArray[np.bool_]]:
    """Lengths of the parts (steps, n) in the air, zero from the ground on or the top; which rays end on the ground."""
    low = heights < min(height_m, 0.0) - 1.0  # eyes may be below the sea's level
    aloft = np.logical_and.accumulate(~low & (heights < TOP_M), axis=0)
    before = np.vstack([np.ones((1, low.shape[1]), bool), aloft[:-1]])
    return np.where(aloft, steps, 0.0), (low & before).any(axis=0)


def _straight(altitude: F64, height_m: float, radius_m: float) -> tuple[F64, F64, F64]:
    """Refraction, heights and lengths of rays that nothing bends."""
    zenith, s = _parts(altitude, height_m, radius_m)
    steps, at, start = np.diff(s, axis=0), 0.5 * (s[1:] + s[:-1]), radius_m + height_m
    heights = np.sqrt(start**2 + at * (at + 2 * start * np.cos(zenith))) - radius_m
    lengths, on_ground = _free(heights, steps, height_m)
    return np.where(on_ground, np.nan, 0.0), heights, lengths


@lru_cache(maxsize=4)  # an eye asks for two, again for every picture
def _bent(excess_bytes: bytes, altitude_bytes: bytes, height_m: float, radius_m: float) -> tuple[F64, F64, F64]:
    """The same of rays in air of a refractive index less one at `_LEVELS_M`."""
    excess, altitude = np.frombuffer(excess_bytes), np.frombuffer(altitude_bytes)
    slope = np.gradient(excess, _LEVELS_M)
    zenith, s = _parts(altitude, height_m, radius_m)
    steps = np.diff(s, axis=0)
    psi, r, theta = zenith.copy(), np.full(altitude.shape, radius_m + height_m), np.zeros(altitude.shape)
    heights = np.empty(steps.shape)
    for k, ds in enumerate(steps):
        dr, dtheta, dpsi = _slopes(psi, r, slope, excess, radius_m)
        h = 0.5 * ds
        dr, dtheta, dpsi = _slopes(psi + h * dpsi, r + h * dr, slope, excess, radius_m)
        heights[k] = r + h * dr - radius_m
        psi, r, theta = psi + ds * dpsi, r + ds * dr, theta + ds * dtheta
    lengths, on_ground = _free(heights, steps, height_m)
    found = np.where(on_ground, np.nan, np.degrees(psi + theta - zenith)), heights, lengths
    for each in found:
        each.flags.writeable = False
    return found


def _slopes(psi: F64, r: F64, slope: F64, excess: F64, radius_m: float) -> tuple[F64, F64, F64]:
    """Along the ray: of its distance from the Earth's centre, of the angle there, and of its zenith angle."""
    height = np.maximum(r - radius_m, 0.0)
    gradient = np.where(height < TOP_M, np.interp(height, _LEVELS_M, slope), 0.0)
    sine = np.sin(psi)
    index = 1 + np.interp(height, _LEVELS_M, excess)
    return np.cos(psi), sine / r, -sine * (1 / r + gradient / index)


@dataclass(frozen=True)
class Refraction:
    """Refraction seen from one place, ready for any number of directions."""

    apparent_deg: F64  # ascending, from the horizon on
    true_deg: F64

    @classmethod
    def at(cls, air: Atmosphere, height_m: float = 0.0, wavelength_nm: float = 550.0) -> "Refraction":
        """From a height above sea level."""
        dip = -horizon_dip_deg(height_m)
        above = np.concatenate([np.linspace(0, 3, 61), np.linspace(3.25, 10, 28), np.linspace(11, 90, 80)])
        apparent = np.unique(np.concatenate([np.linspace(dip, 0.0, 41)[:-1], above])) if dip < -1e-3 else above
        rays = bent_rays(air, apparent, height_m, wavelength_nm)
        free = np.isfinite(rays.refraction_deg)
        return cls(apparent[free], (apparent - rays.refraction_deg)[free])

    def true_altitude_deg(self, apparent_deg: ArrayLike) -> F64:
        """Where that stands which appears at an altitude; below the horizon lifted as at it."""
        apparent = np.asarray(apparent_deg, float)
        lowest = np.minimum(apparent - self.apparent_deg[0], 0.0)
        return np.asarray(np.interp(apparent, self.apparent_deg, self.true_deg) + lowest)

    def apparent_altitude_deg(self, true_deg: ArrayLike) -> F64:
        """Where that appears which stands at an altitude."""
        true = np.asarray(true_deg, float)
        lowest = np.minimum(true - self.true_deg[0], 0.0)
        return np.asarray(np.interp(true, self.true_deg, self.apparent_deg) + lowest)


@dataclass(frozen=True, eq=False)
class LongerWay:
    """What the way of a bent ray through clear air has more than that of a straight one that arrives likewise."""

    altitude_deg: F64  # ascending
    depth: F64  # (n, nw), optical

    @classmethod
    def at(cls, air: Atmosphere, height_m: float, wavelengths_nm: F64) -> "LongerWay":
        """From a height above sea level."""
        altitude = np.concatenate([np.linspace(0, 3, 16), np.linspace(3.5, 12, 10), [15.0, 20.0, 90.0]])
        found = background(air, wavelengths_nm, _LEVELS_M)
        extinction = found.rayleigh_per_m + found.absorption_per_m + found.aerosol_per_m
        bent, straight = (bent_rays(air, altitude, height_m, straight=way) for way in (False, True))
        more = [bent.depth(_LEVELS_M, one) - straight.depth(_LEVELS_M, one) for one in extinction]
        return cls(altitude, np.stack(more, axis=-1))

    def transmittance(self, altitude_deg: ArrayLike) -> F64:
        """What it leaves (n, nw) of light from apparent altitudes (n,)."""
        altitude = np.asarray(altitude_deg, float)
        return np.exp(-np.stack([np.interp(altitude, self.altitude_deg, one) for one in self.depth.T], axis=-1))
