"""Cameras: which way each pixel looks."""

from openswim.cameras.camera import Camera
from openswim.cameras.lenses import Lens
from openswim.cameras.optics import Optics
from openswim.cameras.pixels import Pixels
from openswim.scene.rays import Rays

__all__ = ["Camera", "Lens", "Optics", "Pixels", "Rays"]
