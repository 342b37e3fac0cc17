"""OpenSWIm: a weather model's file in, a believable sky out.

    scene = openswim.open_scene("wrfout_d01_...", time="2005-08-28T18:00")
    image = openswim.render(scene, openswim.Camera.panorama(lat=24.5, lon=-90, height_m=2))
    openswim.to_rgb(image)

The folders follow the light: `readers` and `scene` (the world), `optics`, `lights`, `transport`, `ground`,
`cameras`, `fluxes`, `heavens`, `pictures`, `colour`. Names are imported on first use, so `import openswim` itself
costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from openswim.assimilation import Background as Background
    from openswim.assimilation import analyse as analyse
    from openswim.assimilation import observe as observe
    from openswim.assimilation import write_observations as write_observations
    from openswim.batches import batch as batch
    from openswim.cameras import Camera as Camera
    from openswim.cameras.files import load_camera as load_camera
    from openswim.cameras.files import save_camera as save_camera
    from openswim.colour import save as save
    from openswim.colour import to_rgb as to_rgb
    from openswim.comparison import compare as compare
    from openswim.comparison import correct_clouds as correct_clouds
    from openswim.errors import UserError as UserError
    from openswim.films import film as film
    from openswim.ground import Ground as Ground
    from openswim.lighting import light as light
    from openswim.lighting import open_light as open_light
    from openswim.readers import open_scene as open_scene
    from openswim.rendering import render as render
    from openswim.scene import Scene as Scene
    from openswim.solver import Solver as Solver
    from openswim.stations.through_time import irradiance as irradiance

_HOME = {
    "Background": "openswim.assimilation",
    "Camera": "openswim.cameras",
    "Ground": "openswim.ground",
    "Scene": "openswim.scene",
    "Solver": "openswim.solver",
    "UserError": "openswim.errors",
    "analyse": "openswim.assimilation",
    "batch": "openswim.batches",
    "compare": "openswim.comparison",
    "correct_clouds": "openswim.comparison",
    "film": "openswim.films",
    "irradiance": "openswim.stations.through_time",
    "light": "openswim.lighting",
    "observe": "openswim.assimilation",
    "load_camera": "openswim.cameras.files",
    "open_light": "openswim.lighting",
    "open_scene": "openswim.readers",
    "render": "openswim.rendering",
    "save": "openswim.colour",
    "save_camera": "openswim.cameras.files",
    "to_rgb": "openswim.colour",
    "write_observations": "openswim.assimilation",
}

__all__ = [
    "Background", "Camera", "Ground", "Scene", "Solver", "UserError", "__version__", "analyse", "batch", "compare",
    "correct_clouds", "film", "irradiance", "light", "load_camera", "observe", "open_light", "open_scene", "render",
    "save", "save_camera", "to_rgb", "write_observations",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    value = getattr(import_module(_HOME[name]), name) if name in _HOME else _room(name)
    globals()[name] = value
    return value


def _room(name: str) -> Any:
    """A module of the package, such as `colour`: it may be named without having been imported."""
    if not name.startswith("_"):
        try:
            return import_module(f"openswim.{name}")
        except ModuleNotFoundError as error:
            if error.name != f"openswim.{name}":
                raise
    raise AttributeError(f"module 'openswim' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
