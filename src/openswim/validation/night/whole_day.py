"""A clear sky minute by minute around the clock: how bright the zenith is, and how much light falls on level ground."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Rays
from openswim.colour.photometry import illuminance_lx
from openswim.fluxes import Quadrature, quadrature_directions
from openswim.heavens.lamps import Lamp, lamps_of, toa_irradiance
from openswim.heavens.seen import DUSK_DEG, Heavens
from openswim.lighting import daylight
from openswim.lights.units import magnitude_of_radiance
from openswim.scene import Scene
from openswim.scene.frame import Frame, azimuth_altitude, horizon_vector, scene_frame
from openswim.scene.times import parse_time
from openswim.solver import Solver
from openswim.sun_disc import Disc, beam_of
from openswim.transport import Field
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.view.viewer import wide_shells

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
        place = self.scene.place
        lamps = lamps_of(when, place, self.frame, day, WAVELENGTHS_NM, towns=False)
        toa = toa_irradiance(WAVELENGTHS_NM, day)
        origin, axes = self.frame.position(*place, 2.0), self.frame.enu(*place)
        azimuth, altitude = azimuth_altitude(day.direction)
        rule = quadrature_directions(_DIRECTIONS, azimuth, altitude)
        up = np.vstack([[0.0, 0.0, 1.0], horizon_vector(rule.azimuth_deg, rule.altitude_deg)]) @ axes
        radiance, falling = np.zeros((len(up), len(WAVELENGTHS_NM))), np.zeros(len(WAVELENGTHS_NM))
        for lamp in lamps.every:
            field = self._field(lamp)
            radiance += field.view(Rays(origin, up)).radiance * lamp.strength
            falling += self._beam(lamp, field, origin)
        falling += _falling(radiance[1:], rule)
        zenith = radiance[0]
        if altitude < DUSK_DEG:
            air = self.scene.atmosphere
            heavens = Heavens(lamps, when, place, 2.0, axes, air, WAVELENGTHS_NM, toa, altitude, origin)
            through = self.beam.view(Rays(origin, up[:1]))
            zenith = zenith + heavens.behind(up[:1], through.transmittance, through.hit)[0]
        lux = illuminance_lx(falling, WAVELENGTHS_NM, day.distance_au)
        return float((zenith * toa / (4 * np.pi))[_GREEN]), lux

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
