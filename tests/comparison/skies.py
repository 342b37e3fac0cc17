"""Frames of made-up cameras: simulated skies, written as a camera would."""

import numpy as np
from PIL import Image

from openswim import Camera, Scene, render
from openswim.cameras.files import CameraFile, FrameSettings
from openswim.comparison.response import encoded
from openswim.scene.atmosphere import AerosolProfile, Atmosphere

LAT, LON = 47.0, 8.0
TIME = "2024-06-20T08:00:00"
NAME = "sky_20240620_080000.png"


def small_camera(columns=96):
    camera = Camera.fisheye(LAT, LON, size=columns, lens="equisolid", rotation_deg=33.0)
    return CameraFile(camera, "made-up", FrameSettings(utc_offset_h=0.0))


def clear_radiance(camera, time=TIME, aod=0.1):
    """(ny, nx, 3), 0 outside."""
    air = Atmosphere.us_standard(aerosol=AerosolProfile(optical_depth=aod))
    return np.nan_to_num(render(Scene.clear(LAT, LON, air), camera, time=time).radiance.values)


def write_frame(path, radiance, exposure=(4.0, 4.0, 4.0), encoding="srgb", full=255):
    share = encoded(np.clip(radiance * np.asarray(exposure), 0, 1), encoding)
    Image.fromarray(np.round(share * full).astype(np.uint8)).save(path)
    return path
