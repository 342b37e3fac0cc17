"""Films: a sky over model times, or along a camera's path, as a video, a folder of frames or radiance."""

from openswim.films.between import between
from openswim.films.camera_path import CameraPath
from openswim.films.film import film

__all__ = ["CameraPath", "between", "film"]
