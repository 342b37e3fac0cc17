"""The weather between two model times: clouds carried by the wind from both sides and blended.

Cross-fading two states shows every cloud twice. Here fields of the earlier state are moved forward, and those of the
later one backward, to where the wind takes them at the time asked for (semi-Lagrangian, Staniforth and Cote 1991).
The two are blended by their nearness in time. Clouds so drift, shear and grow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene import Grid, Scene
from openswim.scene.times import Time, parse_time
from openswim.scene.variables import LEVEL_DIMS
from openswim.transport.engine.drift import drift_of

F32 = NDArray[np.float32]

WIND = ("wind_east", "wind_north")
_STILL = ("air_pressure", "air_temperature", *WIND)  # they do not travel with the wind, but change in their place


@dataclass(frozen=True)
class Motion:
    """Cells per second by which what is on each level of a grid moves along its axes: (nz, ny, nx), or (nz, 1, 1)."""

    x: F32
    y: F32
    source: str

    @classmethod
    def between(cls, before: Scene, after: Scene) -> Motion:
        """By the wind of both scenes where they have it, else by how the clouds of each level have moved."""
        grid = _one_grid(before, after)
        if all(name in scene.data for scene in (before, after) for name in WIND):
            east, north = (
                0.5 * (before.data[name].values + after.data[name].values).astype(np.float32) for name in WIND
            )
            return cls.of_wind(grid, east, north, "the model's wind")
        seconds = _seconds(before, after)
        moved = drift_of(_cloud(before), _cloud(after), grid.periodic) / seconds
        x, y = (moved[:, axis, None, None].astype(np.float32) for axis in (0, 1))
        return cls(x, y, "the clouds' own drift")

    @classmethod
    def of_wind(cls, grid: Grid, east: NDArray, north: NDArray, source: str) -> Motion:
        """By a wind in m/s, (nz, ny, nx) or what becomes that."""
        dx, dy, angle = _axes(grid)
        along = east * np.cos(angle) + north * np.sin(angle)
        across = north * np.cos(angle) - east * np.sin(angle)
        return cls((along / dx).astype(np.float32), (across / dy).astype(np.float32), source)

    def came_from(self, k: int, seconds: float, shape: tuple[int, int], mode: str) -> tuple[F32, F32]:
        """Rows and columns (ny, nx) from which air on level k has come so many seconds before: by the wind at the
        middle of its way."""
        from scipy.ndimage import map_coordinates

        along, across = (each[min(k, len(each) - 1)] * seconds for each in (self.x, self.y))
        along, across = np.broadcast_to(along, shape), np.broadcast_to(across, shape)
        here = np.indices(shape, np.float32)
        y, x = here[0] - across, here[1] - along
        for _ in range(2):
            middle = [here[0] + 0.5 * (y - here[0]), here[1] + 0.5 * (x - here[1])]
            y = here[0] - map_coordinates(across, middle, order=1, mode=mode)
            x = here[1] - map_coordinates(along, middle, order=1, mode=mode)
        return y, x

    def of_clouds(self, before: Scene, after: Scene) -> NDArray[np.float64]:
        """Mean speed (2,) of the clouds of two scenes to the east and north at the middle of their grid, m/s; 0 where
        there are none."""
        grid = _one_grid(before, after)
        if not any(_is_cloud(str(name)) for name in before.data.data_vars):
            return np.zeros(2)
        cloud = _cloud(before) + _cloud(after)
        if not cloud.any():
            return np.zeros(2)
        dx, dy, _ = _axes(grid)
        # along the grid's axes: east is another way from column to column, around a pole any
        parts = (np.broadcast_to(part, cloud.shape) for part in (self.x * dx, self.y * dy))
        along, across = (np.average(part, weights=cloud) for part in parts)
        angle = grid.axis_angle(*grid.centre_index)
        east = along * np.cos(angle) - across * np.sin(angle)
        return np.array([east, across * np.cos(angle) + along * np.sin(angle)])


def between(before: Scene, after: Scene, time: Time, motion: Motion | None = None) -> Scene:
    """The scene at a time between those of two scenes of the same grid and model.

    Contents, numbers, extinctions and cloud cover travel by ``motion`` (worked out if not given); radii follow so that
    extinction is kept; pressure, temperature and the ground change linearly in their place. Vertical wind is left out.
    Raises UserError where the grids differ, as those of moving nests do, or the time is not between the two.
    """
    grid = _one_grid(before, after)
    when = parse_time(time)
    seconds = _seconds(before, after)
    assert when is not None
    assert before.time is not None
    passed = float((when - before.time) / np.timedelta64(1, "s"))
    if not 0.0 <= passed <= seconds:
        raise UserError(f"time {when}: not between {before.time} and {after.time}")
    share = passed / seconds
    if share in (0.0, 1.0):
        return before if share == 0.0 else after
    motion = Motion.between(before, after) if motion is None else motion
    forward = _Carrier(motion, passed, grid.periodic)
    backward = _Carrier(motion, passed - seconds, grid.periodic)
    fields: dict[str, xr.DataArray] = {}
    names = [str(name) for name in before.data.data_vars if name in after.data]
    for name in names:
        one, other = before.data[name], after.data[name]
        travels = one.dims == LEVEL_DIMS and name not in _STILL
        if travels and name.endswith("_effective_radius"):
            continue
        values = _mixed(one, other, share, forward if travels else None, backward)
        fields[name] = one.copy(data=values)
    for name in names:
        if name.endswith("_effective_radius"):
            content = name.replace("_effective_radius", "_content")
            fields[name] = before.data[name].copy(
                data=_radius(before.data, after.data, name, content, share, forward, backward)
            )
    height = grid.height_m
    if height.ndim == 3:
        assert after.grid is not None
        height = (1 - share) * height + share * after.grid.height_m
    data = before.data.copy(deep=False)
    for name, field in fields.items():
        data[name] = field
    return Scene(
        Grid(grid.x, grid.y, height, grid.crs, grid.earth_radius_m, grid.periodic), data, before.atmosphere,
        before.optics, when, before.source,
        [*before.notes, f"weather between {before.time} and {after.time}, carried by {motion.source}"],
        before.ground, _wider(before, after, when), before.cut,
    )  # fmt: skip


def _wider(before: Scene, after: Scene, when: np.datetime64) -> Scene | None:
    """The wider scene around, at the time as well."""
    if before.wider is None or after.wider is None:
        return before.wider
    return between(before.wider, after.wider, when)


def _mixed(
    one: xr.DataArray, other: xr.DataArray, share: float, forward: _Carrier | None, backward: _Carrier
) -> NDArray:
    a, b = one.values, other.values
    if forward is not None:
        a, b = forward(a), backward(b)
    return ((1 - share) * a + share * b).astype(one.dtype)


def _radius(
    before: xr.Dataset, after: xr.Dataset, name: str, content: str, share: float, forward: _Carrier, backward: _Carrier
) -> NDArray:
    """Radii so that content over radius, which is extinction, is that of both sides; where there is nothing, the
    larger of both."""
    sides = []
    for data, carry in ((before, forward), (after, backward)):
        radius = np.nan_to_num(data[name].values)
        known = radius > 0  # where it is 0 nobody knows it
        mass = np.where(known, data[content].values if content in data else 1.0, 0.0)
        sides.append((carry(mass), carry(mass / np.where(known, radius, 1.0)), radius))
    (mass_a, optical_a, radius_a), (mass_b, optical_b, radius_b) = sides
    mass, optical = (1 - share) * mass_a + share * mass_b, (1 - share) * optical_a + share * optical_b
    fallback = np.maximum(radius_a, radius_b)
    return np.where(optical > 1e-12, mass / np.maximum(optical, 1e-12), fallback).astype(before[name].dtype)


class _Carrier:
    """Moves fields on levels (nz, ny, nx) by so many seconds of a motion."""

    def __init__(self, motion: Motion, seconds: float, periodic: bool) -> None:
        self.motion, self.seconds, self.mode = motion, seconds, "grid-wrap" if periodic else "nearest"

    def __call__(self, field: NDArray) -> F32:
        out = np.empty(field.shape, np.float32)
        for k, level in enumerate(field):
            out[k] = level if level.min() == level.max() else self._carried(level, k)
        return out

    def _carried(self, level: NDArray, k: int) -> F32:
        from scipy.ndimage import map_coordinates

        y, x = self.motion.came_from(k, self.seconds, level.shape, self.mode)
        smooth = map_coordinates(level, [y, x], order=3, mode=self.mode)
        # a cubic keeps edges sharp; the four nodes around bound it, so that it makes nothing of clear air
        low, high = np.full(level.shape, np.inf, np.float32), np.full(level.shape, -np.inf, np.float32)
        for j in (np.floor(y), np.floor(y) + 1):
            for i in (np.floor(x), np.floor(x) + 1):
                corner = map_coordinates(level, [j, i], order=0, mode=self.mode)
                low, high = np.minimum(low, corner), np.maximum(high, corner)
        return np.clip(smooth, low, high).astype(np.float32)


def _is_cloud(name: str) -> bool:
    return name.endswith("_content") or name.startswith("extinction_")


def _cloud(scene: Scene) -> F32:
    """All that drifts and is seen, (nz, ny, nx), on a scale of its own."""
    total = None
    for name in scene.data.data_vars:
        if _is_cloud(str(name)):
            values = np.asarray(scene.data[name].values, np.float32)
            values = values / max(float(values.max()), 1e-30)
            total = values if total is None else total + values
    if total is None:
        raise UserError("no clouds in these scenes: there is nothing to carry between them")
    return total


def _axes(grid: Grid) -> tuple[NDArray, float, NDArray]:
    """Metres per cell along x, (ny, 1), and y, and the angle of the x axis to the east, radians, (ny, nx)."""
    _, ny, nx = grid.shape
    dx, dy = grid.spacing_m()
    iy, ix = np.mgrid[:ny, :nx]
    angle = grid.axis_angle(ix, iy) if grid.curved else np.zeros((ny, nx))
    narrower = np.ones(ny)
    if grid.in_degrees:  # meridians meet at the poles
        cosines = np.maximum(np.cos(np.radians(grid.y)), 0.01)
        narrower = cosines / cosines[ny // 2]
    return (dx * narrower)[:, None], dy, angle


def _one_grid(before: Scene, after: Scene) -> Grid:
    one, other = before.grid, after.grid
    if one is None or other is None:
        raise UserError("scenes without a grid have no times in between")
    check_still(one, other, before.source, before.time, after.time)
    return one


def same_place(one: Grid, other: Grid) -> bool:
    """Whether two grids have their columns at the same places."""
    return one.shape == other.shape and bool(np.allclose(one.x, other.x) and np.allclose(one.y, other.y))


def check_still(one: Grid, other: Grid, source: str, time: Time, later: Time) -> None:
    """Raise UserError where the grids of a model at two times lie at different places."""
    if not same_place(one, other):
        raise UserError(
            f"{source}: its grid at {time} is not that at {later}, as where a nest moves, so that nothing between "
            "them can be shown: leave out --every; for a --path give a file of one time"
        )


def _seconds(before: Scene, after: Scene) -> float:
    if before.time is None or after.time is None or after.time <= before.time:
        raise UserError("two scenes with valid times are needed, the earlier one first")
    return float((after.time - before.time) / np.timedelta64(1, "s"))
