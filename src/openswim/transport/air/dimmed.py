"""Air in the moon's shadow. Where it is, little light comes but from air that the sun still lights, far around.

The shells are alike on all sides of the sun's axis, and the shadow is not. So they are given what is left of the sun
over the scene's origin, and the diffuse light that arrives there from all around; what lies elsewhere, and has more of
the sun or less, is added along every ray. All of it follows from shells that are solved without a shadow: at each place
they are lit as much as the sun is left there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.lights.eclipses.shadow import MoonShadow
from openswim.optics import Background
from openswim.transport.air.shells import (
    beam_transmission,
    clear_radiance,
    gathering,
    no_volume,
    phase_moments,
    source_of,
)
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.march import Marched, ground_radiance_rows, march_rays
from openswim.transport.march.volume import Shells, tidy

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_EDGES_M = 1e3 * np.array([0, 12, 25, 40, 60, 85, 115, 155, 210, 290, 420, 650.0])
_WITHIN = (0.2113, 0.7887)  # of a piece of a ray, where its sun is looked at
_ROUNDS = 3  # orders of scattering within the shadow
_STEP = 1.5
_FAR_M = 1e7


@dataclass(frozen=True, eq=False)
class Dimmed:
    """The moon's shadow over a scene at PACK wavelengths. here (PACK,): what is left of the sun at the scene's origin;
    moments (level, harmonic, PACK), source (level, zenith, azimuth, PACK), flux (PACK,): the diffuse light there."""

    shadow: MoonShadow
    sun: F64
    wavelengths_nm: F64
    here: F64
    moments: F32
    source: F32
    flux: F64

    @classmethod
    def over(
        cls, shadow: MoonShadow, sun: F64, wavelengths_nm: F64, lit: Shells, air: Background | None
    ) -> Dimmed:
        """From shells that know no shadow, and the profile of their air."""
        place = np.array([[0.0, 0.0, lit.ground_m]])
        here = shadow.left(place, wavelengths_nm)[0]
        empty = np.zeros_like(lit.moments[:, 0]), np.zeros_like(lit.source[:, 0])
        made = cls(shadow, sun, wavelengths_nm, here, *empty, np.zeros(PACK))
        if air is None:
            return made
        rays, phase = gathering(lit), phase_moments(air)[1]
        turn = np.arctan2(sun[1], sun[0])
        # on both sides of the sun: moments are of what is alike there
        sides = [_turned(rays.direction * [1, side, 1], turn) for side in (1, -1)]
        around = sum(made.from_around(rays.origin, way, lit) for way in sides) / 2
        shells = lit
        for n in range(_ROUNDS):
            # at first as if all of the air were lit as it is here
            own = clear_radiance(rays.origin, sides[0], sun, lit if n == 0 else shells, _STEP) * (here if n == 0 else 1)
            radiance = np.maximum(around + own, 0).reshape(rays.levels, -1, PACK)
            moments = np.asarray(rays.weighted @ radiance, FLOAT)
            source = source_of(lit, np.repeat(moments[:, None], lit.moments.shape[1], axis=1), phase)[:, 0]
            made = cls(shadow, sun, wavelengths_nm, here, moments, source, rays.down @ radiance[0])
            shells = made.of(lit)
        return made

    def of(self, lit: Shells) -> Shells:
        """Shells that know no shadow, with what is left of their light at the scene's origin in its place."""
        slant = lit.slant.copy()
        slant[..., :PACK] -= np.log(self.here)
        direct = lit.ground_flux * self.here
        if lit.rows.any():
            mu = _sun_cosines(lit)
            direct = beam_transmission(lit, mu) * np.maximum(mu, 0)[:, None] * self.here
        return tidy(lit._replace(
            slant=slant.astype(FLOAT), ground_flux=(direct + self.flux).astype(FLOAT),
            moments=np.repeat(self.moments[:, None], lit.moments.shape[1], axis=1),
            source=np.repeat(self.source[:, None], lit.source.shape[1], axis=1),
        ))  # fmt: skip

    def left(self, place_m: F64) -> F64:
        """What is left of the sun's light (n, PACK) at places (n, 3)."""
        return self.shadow.left(place_m, self.wavelengths_nm)

    def brighter(self, place_m: F64, lit: Shells) -> F64:
        """How many times the light that falls on the ground at the scene's origin falls at places (n, 3)."""
        whole = np.maximum(lit.ground_flux.max(axis=0).astype(float), 1e-30)
        glow = np.minimum(self.flux / whole, 1.0)
        return (self.left(place_m) + glow) / (self.here + glow)

    def from_around(
        self, origin: F64, direction: F64, lit: Shells, start_m: F64 | None = None, ground: bool = True
    ) -> F64:
        """L' (n, PACK) that clear air and ground around send along rays (n, 3) beyond what they would if they had the
        sun of the scene's origin; from a distance on (n,), where that is given; ``lit``: without a shadow. ground:
        whether that of the ground, too."""
        n = len(direction)
        out, through = np.zeros((n, PACK)), np.ones((n, PACK))
        before = np.zeros(n) if start_m is None else np.asarray(start_m, float)
        enters = _enters(origin, direction, lit)
        before = np.maximum(before, enters)
        if start_m is not None:
            some = np.flatnonzero(before > enters)
            if some.size:
                first = march_rays(
                    origin[some], direction[some], self.sun, _NO_PEAKS, lit, no_volume(), _STEP, ends=-before[some]
                )
                through[some] = first.scaled * ~_ended(first, before[some])[:, None]
        going = np.flatnonzero(np.isfinite(before) & (through.max(axis=1) > 1e-6))
        for near, far in zip(_EDGES_M, np.append(_EDGES_M[1:], _FAR_M), strict=True):
            if going.size == 0:
                break
            way = direction[going]
            o = origin[going] + (before[going] + near)[:, None] * way
            seen = march_rays(o, way, self.sun, _NO_PEAKS, lit, no_volume(), _STEP, ends=np.full(len(o), near - far))
            light = seen.radiance.astype(float)
            ended = _ended(seen, far - near)
            hit = np.flatnonzero(ended)
            met = o[hit] + way[hit] * seen.distance_m[hit, None]
            more = self._more(o, way, np.minimum(far - near, 2e5))
            light *= more
            if hit.size and ground:
                below = seen.scaled[hit] * ground_radiance_rows(met, self.sun, lit)
                light[hit] += below * (self.left(met) - self.here)
            out[going] += through[going] * light
            through[going] *= seen.scaled
            going = going[~ended & (through[going].max(axis=1) > 1e-6)]
        return out

    def _more(self, origin: F64, direction: F64, length_m: float) -> F64:
        """How much more of the sun there is along pieces of rays than at the scene's origin."""
        return np.mean([self.left(origin + part * length_m * direction) for part in _WITHIN], axis=0) - self.here


class Eclipse(NamedTuple):
    """The moon's shadow on a scene, and its shells as they are without it."""

    dimmed: Dimmed
    lit: Shells


def eclipse_of(
    shadow: MoonShadow | None, sun: F64, wavelengths_nm: F64, lit: Shells, air: Background | None
) -> Eclipse | None:
    """What the moon's shadow does to shells that know nothing of it."""
    return None if shadow is None else Eclipse(Dimmed.over(shadow, sun, wavelengths_nm, lit, air), lit)


_NO_PEAKS = np.zeros((1, 2, 2, PACK), FLOAT)


def _ended(seen: Marched, limit_m: F64 | float) -> NDArray[np.bool_]:
    """Which rays (n,) met the ground, and did not just stop at their limit."""
    return np.asarray((seen.distance_m >= 0) & (seen.distance_m < limit_m - 0.01))


def _enters(origin: F64, direction: F64, lit: Shells) -> F64:
    """Distances (n,) after which rays from above are in the air; infinite where they miss it."""
    p = origin + np.array([0.0, 0.0, lit.radius_m])
    along, top = (p * direction).sum(-1), lit.radius_m + lit.top_m
    above2 = (p * p).sum(-1) - top**2
    half2 = along**2 - above2
    into = -along - np.sqrt(np.maximum(half2, 0.0))
    return np.where(above2 <= 0, 0.0, np.where((half2 > 0) & (along < 0), into, np.inf))


def _turned(direction: F64, angle: float) -> F64:
    """Vectors (n, 3) turned about the vertical."""
    x, y = direction[:, 0], direction[:, 1]
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * x - s * y, s * x + c * y, direction[:, 2]], axis=-1)


def _sun_cosines(lit: Shells) -> F64:
    """Of the suns of `Shells.ground_flux`."""
    mu, table = np.linspace(-1, 1, len(lit.moment_sun_table)), lit.moment_sun_table
    number = np.arange(len(lit.ground_flux), dtype=float)
    first = np.minimum(np.searchsorted(table, number - 1e-9), len(mu) - 1)
    first[0] = max(np.searchsorted(table, 1e-9) - 1, 0)
    return np.asarray(mu[first])
