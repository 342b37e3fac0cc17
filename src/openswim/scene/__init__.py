"""The world that light travels through: grid, fields, gas and ground, place and time."""

from openswim.scene.grid import Grid
from openswim.scene.scene import Optics, Scene

__all__ = ["Grid", "Optics", "Scene"]
