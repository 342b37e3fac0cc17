"""The sources of light: where the sun stands, its disc and its spectrum."""

from openswim.lights.disc import disc_coverage, disc_profile
from openswim.lights.spectrum import SOLAR_CONSTANT_W_M2, solar_irradiance
from openswim.lights.sun import Sun, subsolar_point, sun_position

__all__ = [
    "SOLAR_CONSTANT_W_M2",
    "Sun",
    "disc_coverage",
    "disc_profile",
    "solar_irradiance",
    "subsolar_point",
    "sun_position",
]
