"""The operator that a configuration asks for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from openswim.assimilation.config import Configuration
from openswim.assimilation.observing.observe import observe
from openswim.assimilation.observing.operator import Operator
from openswim.assimilation.observing.window import observe_window
from openswim.errors import UserError
from openswim.readers import open_scene
from openswim.scene import Scene

COVER = "cloud_area_fraction"


def operator_of(config: Configuration) -> Operator:
    """Of the model's file; where there are times of their own, with the wind by which its cloud is carried."""
    settings: dict[str, Any] = {"sun": config.sun, **config.observe}
    if not config.window:
        scene = _opened(config)
        return observe(scene, config.cameras, config.points, time=config.time, **settings)
    wind = settings.pop("wind", None)
    scene = _opened(config, winds=wind is None)
    cameras = _by_time(config.camera_times, config.cameras)
    return observe_window(scene, cameras, _by_time(config.point_times, config.points), wind, **settings)


def _opened(config: Configuration, winds: bool = False) -> Scene:
    scene = open_scene(list(config.models), config.time, winds=winds, member=config.member)
    if not config.cover and COVER in scene.data:
        scene.data = scene.data.drop_vars(COVER)
        scene.notes.append("the model's cloud cover is left out: clouds fill their cells")
    curved = scene.grid is not None and scene.grid.curved
    if any(on_earth != curved for on_earth in config.points_on_earth):
        remedy = "lies on the Earth: give lat and lon" if curved else "is flat: give x_m and y_m"
        raise UserError(f"{config.path}: [[pyranometer]]: the model {remedy}")
    return scene


def _by_time(times: Sequence[np.datetime64 | None], each: Sequence[Any]) -> dict[Any, list[Any]]:
    out: dict[Any, list[Any]] = {}
    for time, one in zip(times, each, strict=True):
        out.setdefault(time, []).append(one)
    return out
