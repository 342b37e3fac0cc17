"""Films: a sky over model times, or along a camera's path, as a video, a folder of frames or radiance."""

from openswim.films.between import between
from openswim.films.camera_path import CameraPath
from openswim.films.making import film
from openswim.films.weather import Weather

__all__ = ["CameraPath", "Weather", "between", "film"]
