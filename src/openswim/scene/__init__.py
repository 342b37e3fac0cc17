"""The world that light travels through: grid, fields, gas and ground, place and time."""

from openswim.scene.choosing import only
from openswim.scene.grid import Grid
from openswim.scene.ground import Ground
from openswim.scene.optics import Optics
from openswim.scene.scene import Scene

__all__ = ["Grid", "Ground", "Optics", "Scene", "only"]
