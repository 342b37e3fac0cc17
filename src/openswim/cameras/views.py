"""The views that may be asked for by name, on the command line and in plans, and what each of them takes."""

from inspect import signature

from openswim.cameras.camera import Camera

_OF_PYTHON_ALONE = {"earth_radius_m"}


def options_of(view: str) -> tuple[str, ...]:
    """What the constructor of a view takes, in its order."""
    return tuple(name for name in signature(getattr(Camera, view)).parameters if name not in _OF_PYTHON_ALONE)


VIEWS = {view: options_of(view) for view in ("allsky", "panorama", "sphere", "perspective", "satellite")}
