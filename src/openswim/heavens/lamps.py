"""Which lights shine on a scene, and how much of each: light is linear, so each is solved by itself and all are added.

Every light is solved as the sun is, for an irradiance of one, and counts by its own over the sun's: a picture stays in
solar-relative radiance, whatever lit it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from openswim.ground.cities import city_radiance, lamp_spectrum
from openswim.lights import NightSky, moon_irradiance, moon_position, solar_irradiance
from openswim.lights.daylight import Daylight
from openswim.lights.eclipses import MoonShadow, moonlight_left
from openswim.lights.illuminance import NIGHT_SKY_LX, moon_lux, shares, sun_lux
from openswim.scene.frame import Frame
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.ground import Ground
from openswim.scene.times import Time

F64 = NDArray[np.float64]

_LUX_PER_NW = 4e-4
_BESIDE_M = 3e5  # from a scene, where the moon's shadow is seen from within it
_TOTALITY = 1e-5  # of the sun's light, what comes from outside the moon's shadow into its middle, or more
_WORDS = {"moon": "moonlight", "sky": "the night's sky and towns"}
_DAY_LX = 200.0  # of the sun, beside which moon, night sky and towns add less than `illuminance.LEAST`


@dataclass(frozen=True, eq=False)
class Lamp:
    """A light to be solved: from a ``direction`` (3,) in the scene frame, or, where that is None, from all the sky
    beyond the air and from towns. ``strength`` (nw,): what its solar-relative radiance counts; ``towns`` (nw,): that of
    ground which shines with 1 nW cm-2 sr-1, over the sky's. ``shadow``: the moon's, in which the sun is weaker by what
    it takes at each place."""

    name: str
    direction: F64 | None
    strength: F64
    towns: F64 | None = None
    shadow: MoonShadow | None = None


@dataclass(frozen=True, eq=False)
class Lamps:
    """The lights over a place (latitude, longitude) at a time. in_field (nw,): what of the night sky's mean radiance is
    solved for with the lamps, W m-2 sr-1 nm-1. shadow: the moon's, where it is on the scene or
    near it. left_out: what shines and is not solved for."""

    every: tuple[Lamp, ...]
    time: Time
    place: tuple[float, float]
    in_field: F64
    shadow: MoonShadow | None = None
    left_out: tuple[str, ...] = ()

    @cached_property
    def night(self) -> NightSky:
        """What is to be seen of the sky behind; worked out when it is asked for, which is not by day."""
        return NightSky.at(self.time, *self.place, np.eye(3))

    def sun_alone(self) -> Lamps:
        """Where none but the sun is solved for."""
        sun = tuple(lamp for lamp in self.every if lamp.name == "sun")
        left_out = tuple(_WORDS[lamp.name] for lamp in self.every if lamp.name != "sun")
        return replace(self, every=sun, in_field=np.zeros_like(self.in_field), left_out=left_out)

    def stated(self) -> list[str]:
        """What of this is to be said of a picture."""
        if not self.left_out:
            return []
        return [f"air, clouds and ground are lit by the sun alone, without {' and '.join(self.left_out)}"]


def toa_irradiance(wavelengths_nm: F64, day: Daylight) -> F64:
    """The sun's, W m-2 nm-1 (nw,), by which all radiance is counted."""
    return np.asarray(solar_irradiance(wavelengths_nm) / day.distance_au**2)


def shadow_over(time: Time, place: tuple[float, float], reach_deg: float) -> MoonShadow | None:
    """The moon's, where it is on a scene or near it; the scene as in `lamps_of`."""
    return MoonShadow.near(np.radians(reach_deg) * EARTH_RADIUS_M + _BESIDE_M, time, *place)


def lamps_of(
    time: Time, place: tuple[float, float], frame: Frame, day: Daylight, wavelengths_nm: F64,
    ground: Ground | None = None, reach_deg: float = 0.0, towns: bool = True,
) -> Lamps:  # fmt: skip
    """Sun, moon and night sky over the middle of a scene, ``place`` its latitude and longitude; ``reach_deg``: how far
    it goes, over the Earth. towns: whether the ground may shine.

    A light that adds less than a hundredth to what falls on the ground fades out, and is not solved for at a third of
    that. The moon is what it is for the middle of the scene.
    """
    toa = toa_irradiance(wavelengths_nm, day)
    altitude = float(np.degrees(np.arcsin(np.clip(day.direction[2], -1, 1))))
    shadow = shadow_over(time, place, reach_deg)
    left = 1.0 if shadow is None else float(shadow.left(np.zeros((1, 3)), wavelengths_nm).mean())
    none, whole = np.zeros(len(wavelengths_nm)), np.ones(len(wavelengths_nm))
    sun = sun_lux(altitude) * max(left, _TOTALITY)
    if sun > _DAY_LX:
        return Lamps((Lamp("sun", day.direction, whole, shadow=shadow),), time, place, none, shadow)
    moon = moon_position(time, *place)
    eclipsed = moonlight_left(time, wavelengths_nm)
    lux = {
        "sun": sun, "moon": moon_lux(moon) * float(eclipsed.mean()),
        "sky": NIGHT_SKY_LX + (_town_lux(place, ground) if towns else 0.0),
    }  # fmt: skip
    part, found = shares(lux), Lamps((), time, place, none, shadow)
    # it may be up elsewhere in a wide scene
    part["sun"] = shares(lux | {"sun": sun_lux(min(altitude + reach_deg, 90.0)) * max(left, _TOTALITY)})["sun"]
    lamps = []
    if part["sun"] > 0:
        lamps.append(Lamp("sun", day.direction, part["sun"] * whole, shadow=shadow))
    if part["moon"] > 0:
        toward = frame.direction(moon.azimuth_deg, moon.refracted_altitude_deg, *_middle(frame))
        lamps.append(Lamp("moon", toward, part["moon"] * eclipsed * moon_irradiance(moon, wavelengths_nm) / toa))
    mean = none
    if part["sky"] > 0:
        whole = found.night.mean(wavelengths_nm)
        mean = part["sky"] * whole
        shine = lamp_spectrum(wavelengths_nm) / whole if towns else None
        lamps.append(Lamp("sky", None, 4 * np.pi * mean / toa, shine))
    return replace(found, every=tuple(lamps), in_field=mean)


def _town_lux(place: tuple[float, float], ground: Ground | None) -> float:
    """What clear air sends down of the light of towns around, roughly."""
    north, east = np.meshgrid([-0.2, 0.0, 0.2], [-0.3, 0.0, 0.3])
    around = city_radiance(np.clip(place[0] + north, -90, 90), place[1] + east, ground)
    return float(_LUX_PER_NW * around.mean())


def _middle(frame: Frame) -> tuple[float, float]:
    return (frame.lat, frame.lon) if frame.curved else (0.0, 0.0)
