"""A clear sky minute by minute around the clock: how bright the zenith is, and how much light falls on level ground."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Rays
from openswim.colour.photometry import illuminance_lx
from openswim.fluxes import Quadrature, quadrature_directions
from openswim.heavens.lamps import Lamp, Lamps, lamps_of, toa_irradiance
from openswim.heavens.seen import DUSK_DEG, Heavens
from openswim.heavens.sun_disc import Disc, beam_of
from openswim.lighting import daylight
from openswim.lights.daylight import Daylight
from openswim.lights.units import magnitude_of_radiance
from openswim.scene import Scene
from openswim.scene.frame import Frame, azimuth_altitude, horizon_vector, scene_frame
from openswim.scene.times import parse_time
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.view.skies import wide_shells

F64 = NDArray[np.float64]

WAVELENGTHS_NM = np.array([615.0, 550.0, 450.0])
_GREEN = 1
_DIRECTIONS = 8
_RADIUS_DEG = {"sun": 0.2666, "moon": 0.2591}


@dataclass(frozen=True, eq=False)
class Skies:
    """The clear sky over a place under any sun, solved once for all of them; outside of eclipses."""

    scene: Scene
    frame: Frame
    beam: Field
    starlit: Field

    @classmethod
    def over(cls, lat: float, lon: float) -> Skies:
        scene = Scene.clear(lat, lon)
        frame = scene_frame(scene)
        beam = Solver().solve(scene, np.array([0.0, 0.0, 1.0]), WAVELENGTHS_NM)
        starlit = Solver().solve_starlit(scene, WAVELENGTHS_NM)
        assert isinstance(beam, Field)
        assert isinstance(starlit, Field)
        return cls(scene, frame, beam, starlit)

    def at(self, time: str | np.datetime64) -> tuple[float, float]:
        """Radiance of the zenith at 550 nm, W m-2 sr-1 nm-1, and illuminance of level ground, lx, at a time (UTC), as
        `openswim.light` has them for a clear scene."""
        when = parse_time(time)
        assert when is not None
        day = daylight(self.scene, when)
        lamps = self._lamps(when, day)
        rule = quadrature_directions(_DIRECTIONS, *azimuth_altitude(day.direction))
        falling = _falling(self._diffuse(lamps, horizon_vector(rule.azimuth_deg, rule.altitude_deg)), rule)
        for lamp in lamps.every:
            falling = falling + self._beam(lamp, self._field(lamp), self._origin)
        zenith = self.toward(when, np.array([[0.0, 0.0, 1.0]]))[0] * toa_irradiance(WAVELENGTHS_NM, day) / (4 * np.pi)
        return float(zenith[_GREEN]), illuminance_lx(falling, WAVELENGTHS_NM, day.distance_au)

    def toward(self, time: str | np.datetime64, direction: F64) -> F64:
        """Solar-relative radiance (n, nw) toward unit vectors (n, 3), east, north, up, without discs and stars."""
        when = parse_time(time)
        assert when is not None
        day = daylight(self.scene, when)
        lamps, place, altitude = self._lamps(when, day), self.scene.place, azimuth_altitude(day.direction)[1]
        radiance, axes = self._diffuse(lamps, direction), self.frame.enu(*place)
        if altitude < DUSK_DEG:
            air, toa = self.scene.atmosphere, toa_irradiance(WAVELENGTHS_NM, day)
            heavens = Heavens(lamps, when, place, 2.0, axes, air, WAVELENGTHS_NM, toa, altitude, self._origin)
            through = self.beam.view(Rays(self._origin, direction @ axes))
            radiance = radiance + heavens.behind(direction @ axes, through.transmittance, through.hit)
        return radiance

    @property
    def _origin(self) -> F64:
        return self.frame.position(*self.scene.place, 2.0)

    def _lamps(self, when: np.datetime64, day: Daylight) -> Lamps:
        return lamps_of(when, self.scene.place, self.frame, day, WAVELENGTHS_NM, towns=False)

    def _diffuse(self, lamps: Lamps, direction: F64) -> F64:
        """What the air sends from unit vectors (n, 3), east, north, up, in all lights; solar-relative (n, nw)."""
        rays, radiance = Rays(self._origin, direction @ self.frame.enu(*self.scene.place)), np.zeros(1)
        for lamp in lamps.every:
            radiance = radiance + self._field(lamp).view(rays).radiance * lamp.strength
        return radiance

    def _field(self, lamp: Lamp) -> Field:
        if lamp.direction is None:
            return self.starlit
        first = self.beam.packs[0]
        assert isinstance(first, LitGrid)
        return replace(self.beam, packs=[replace(first, sun=lamp.direction, shells=wide_shells(first))])

    def _beam(self, lamp: Lamp, field: Field, origin: F64) -> F64 | float:
        """What of its own light falls on level ground, over the sun's outside of the air."""
        if lamp.direction is None:
            return 0.0

        def through(local: F64, width_rad: float) -> tuple[NDArray, NDArray[np.bool_]]:
            seen = field.view(Rays(origin, local @ self.frame.enu(*self.scene.place), width_rad))
            return seen.transmittance, seen.hit

        azimuth, altitude = azimuth_altitude(lamp.direction)
        if altitude < -1.0:
            return 0.0
        found = beam_of(Disc(azimuth, altitude, _RADIUS_DEG[lamp.name], WAVELENGTHS_NM), through)
        return np.asarray(found.direct * lamp.strength * max(np.sin(np.radians(found.altitude_deg)), 0.0))


def steps(zenith: F64) -> tuple[F64, F64]:
    """By how many magnitudes the zenith changes from one minute to the next, and by how much that differs from the
    minute before."""
    change = np.diff(magnitude_of_radiance(zenith))
    return np.abs(change), np.abs(np.diff(change))


def _falling(radiance: F64, rule: Quadrature) -> F64:
    """Through the horizontal, over the sun's outside of the air."""
    return np.asarray(rule.solid_angle_sr * np.sin(np.radians(rule.altitude_deg)) @ radiance / (4 * np.pi))
