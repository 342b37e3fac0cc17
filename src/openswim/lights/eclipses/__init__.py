"""Eclipses of sun and moon: contacts, and how much light is left."""

from openswim.lights.eclipses.lunar import LunarEclipse, lunar_eclipse, moonlight_left
from openswim.lights.eclipses.shadow import MoonShadow
from openswim.lights.eclipses.solar import SolarEclipse, light_left, obscuration, solar_eclipse

__all__ = [
    "LunarEclipse", "MoonShadow", "SolarEclipse", "light_left", "lunar_eclipse", "moonlight_left", "obscuration",
    "solar_eclipse",
]  # fmt: skip
