"""From radiance at a few wavelengths to what the eye sees, and to a picture in a file."""

from openswim.colour.picture import check_writable, save
from openswim.colour.rgb import auto_exposure, to_linear_rgb, to_rgb, to_xyz

__all__ = ["auto_exposure", "check_writable", "save", "to_linear_rgb", "to_rgb", "to_xyz"]
