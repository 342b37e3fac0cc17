"""The sources of light: where sun, moon, planets and stars stand, how bright they and the night sky are, eclipses."""

from openswim.lights.disc import disc_coverage, disc_points, disc_profile
from openswim.lights.moon import Moon, moon_position
from openswim.lights.moonlight import moon_irradiance
from openswim.lights.night_sky import NightSky
from openswim.lights.planets import PLANETS, Planet, planet_position
from openswim.lights.refraction import refracted_altitude_deg, refraction_deg
from openswim.lights.spectrum import SOLAR_CONSTANT_W_M2, solar_irradiance
from openswim.lights.stars import Stars, star_positions
from openswim.lights.sun import Sun, SunTrack, subsolar_point, sun_position, sun_track

__all__ = [
    "PLANETS",
    "SOLAR_CONSTANT_W_M2",
    "Moon",
    "NightSky",
    "Planet",
    "Stars",
    "Sun",
    "SunTrack",
    "disc_coverage",
    "disc_points",
    "disc_profile",
    "moon_irradiance",
    "moon_position",
    "planet_position",
    "refracted_altitude_deg",
    "refraction_deg",
    "solar_irradiance",
    "star_positions",
    "subsolar_point",
    "sun_position",
    "sun_track",
]
