"""Whether the cameras of a film are where its weather is, and its weather is of their time; asked before any work."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.films.weather import Weather
from openswim.pictures.observer import SPACE_M, extent_of
from openswim.readers import reach_m
from openswim.scene import Grid
from openswim.scene.frame import scene_frame
from openswim.scene.grid import EDGE, great_circle_m

FAR = np.timedelta64(3, "h")  # from the only time of a model, after which clouds are others


def told_of_places(sky: Weather, times: Sequence[np.datetime64], cameras: Sequence[Camera]) -> str:
    """What is to be told of frames whose cameras fly beside the model's domain; empty where all are over it.

    UserError where a camera stands on ground that the model does not have, or flies so far away that nothing of the
    model is seen.
    """
    cameras[0].check_frame(scene_frame(sky.first).curved)
    beside = []
    for time, camera in zip(times, cameras, strict=True):
        since, grids = sky.domain(time)
        if not grids or any(grid.periodic for grid in grids) or camera.height_m >= SPACE_M:
            continue
        away_m = min(_away_m(grid, camera) for grid in grids)
        if away_m == 0.0:
            continue
        extent = extent_of(max(grids, key=lambda grid: np.prod(grid.size_m())))
        if camera.above != "sea level":
            moved = f" that the model has from {_iso(since)} on" if since != sky.times[0] else ""
            remedy = ": choose another place, or an earlier end; " if moved else ": "
            raise UserError(f"the observer is outside the domain{moved}{remedy}{extent}")
        where = f"at latitude {camera.lat:.2f}, longitude {camera.lon:.2f} at {_iso(time)}"
        if away_m > reach_m(camera.height_m):
            raise UserError(
                f"film: the path is {where}, {away_m / 1e3:.0f} km outside the domain, too far to see its clouds: "
                f"choose a path over it; {extent}"
            )
        beside.append((where, extent))
    if not beside:
        return ""
    where, extent = beside[0]
    return (
        f"{len(beside)} of {len(cameras)} frames are outside the domain, the first {where}: there are no clouds and no "
        f"hills around them; {extent}"
    )


def told_of_times(model: NDArray[np.datetime64], times: Sequence[np.datetime64]) -> str:
    """What is to be told of frames that are farther before or after a model's times than these are apart; where there
    is only one, than three hours."""
    asked = np.asarray(times, "datetime64[ms]")
    if np.isnat(model).any() or np.isnat(asked).any():
        return ""
    apart = FAR if model.size < 2 else np.diff(model).max()
    for end, most, side in ((model[0], asked.min(), "before"), (model[-1], asked.max(), "after")):
        ahead = end - most if side == "before" else most - end
        if ahead > apart:
            hours = ahead / np.timedelta64(1, "h")
            return (
                f"weather of {_iso(end)}, light of {_iso(most)}, {hours:.1f} hours {side} it: clouds do not move "
                "between them"
            )
    return ""


def told_of_drift(model: NDArray[np.datetime64]) -> str:
    """What is to be told of the light at one place in frames between a model's times."""
    if model.size < 2:
        return ""
    return (
        "clouds smaller than the model's cells drift with the others: they lie elsewhere than in a picture of the same "
        "time, and direct light at the camera is that between other ones"
    )


def _away_m(grid: Grid, camera: Camera) -> float:
    """How far a camera is outside of a grid, m; 0 within."""
    x, y = (camera.lon, camera.lat) if grid.curved else (camera.x_m, camera.y_m)
    assert x is not None  # the camera's frame has been checked
    assert y is not None
    ix, iy = (float(each) for each in grid.place(x, y))
    _, ny, nx = grid.shape
    inner_x, inner_y = min(max(ix, 0.0), nx - 1.0), min(max(iy, 0.0), ny - 1.0)
    if max(abs(ix - inner_x), abs(iy - inner_y)) < EDGE:
        return 0.0
    if not grid.curved:
        return float(np.hypot((ix - inner_x) * grid.step[0], (iy - inner_y) * grid.step[1]))
    lon, lat = grid.lonlat(inner_x, inner_y)
    return great_circle_m([x, float(lon)], [y, float(lat)], grid.earth_radius_m)


def _iso(time: np.datetime64) -> str:
    return f"{np.datetime_as_string(time, 's')}Z"
