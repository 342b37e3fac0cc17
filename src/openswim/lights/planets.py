"""The planets as seen from one place."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.lights.ephemeris import bodies, observer_at, standard_pressure_pa
from openswim.lights.refraction import refracted_altitude_deg
from openswim.scene.times import Time

PLANETS = ("mercury", "venus", "mars", "jupiter", "saturn", "uranus", "neptune")
RADIUS_KM = {
    "mercury": 2440.5, "venus": 6051.8, "mars": 3396.2, "jupiter": 71492.0, "saturn": 60268.0, "uranus": 25559.0,
    "neptune": 24764.0,
}  # fmt: skip  # equatorial, Archinal et al. 2018


@dataclass(frozen=True)
class Planet:
    """A planet from one place, apparent and topocentric."""

    name: str
    altitude_deg: float  # geometric, without refraction
    azimuth_deg: float
    refracted_altitude_deg: float
    distance_au: float
    angular_radius_deg: float  # equatorial
    phase_angle_deg: float
    illuminated: float  # share of the disc
    magnitude: float  # V, without the air's extinction (Mallama & Hilton 2018); NaN where they give none


def planet_position(name: str, time: Time, lat: float, lon: float, height_m: float = 0.0) -> Planet:
    """One of `PLANETS` at a time (UTC; before 1972 UT1) from a place on the WGS84 ellipsoid."""
    if name not in PLANETS:
        raise UserError(f"planet {shown(name)} is unknown: choose one of {', '.join(PLANETS)}")
    here = observer_at(time, lat, lon, height_m)
    seen = here.observe(bodies()[name if name in ("mercury", "venus", "mars") else f"{name} barycenter"])
    apparent = seen.apparent()
    altitude, azimuth, distance = apparent.altaz()
    phase = float(apparent.phase_angle(bodies()["sun"]).radians)
    return Planet(
        name=name,
        altitude_deg=float(altitude.degrees),
        azimuth_deg=float(azimuth.degrees),
        refracted_altitude_deg=float(refracted_altitude_deg(altitude.degrees, standard_pressure_pa(height_m))),
        distance_au=float(distance.au),
        angular_radius_deg=float(np.degrees(np.arcsin(RADIUS_KM[name] / distance.km))),
        phase_angle_deg=float(np.degrees(phase)),
        illuminated=float((1 + np.cos(phase)) / 2),
        magnitude=_magnitude(seen),
    )


def _magnitude(seen: Any) -> float:
    from skyfield.magnitudelib import planetary_magnitude

    with warnings.catch_warnings():  # the square root of what it does not know
        warnings.simplefilter("ignore", RuntimeWarning)
        return float(planetary_magnitude(seen))
