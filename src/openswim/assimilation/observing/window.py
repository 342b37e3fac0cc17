"""`observe_window`: what is seen at several times, as a function of the clouds of one time, which the wind carries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from openswim.arguments import check_kind, shown
from openswim.assimilation.observing.carrying import Carrier, motion_of
from openswim.assimilation.observing.controls import Controls, Fill
from openswim.assimilation.observing.core import Images
from openswim.assimilation.observing.observe import nodes_that_change, observe
from openswim.assimilation.observing.operator import Operator
from openswim.assimilation.observing.variables import variables_of
from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.ground.surface import settled
from openswim.scene import Scene
from openswim.scene.times import parse_time

LONGEST_S = 3 * 3600.0  # from a state's time, for which cloud may be thought to be carried alone


@dataclass(frozen=True, eq=False, repr=False)
class Window(Operator):
    """An operator whose cameras and pyranometers are those of several operators, one after the other; each of these
    sees, at its own time, what the wind has made of the same state. The core, time and sun are the first one's."""

    of_times: tuple[Operator, ...] = ()

    def light(self, fill: Fill, start: Any = None) -> tuple[Images, Any]:
        starts = [None] * len(self.of_times) if start is None else start
        both = [one.light(fill, near) for one, near in zip(self.of_times, starts, strict=True)]
        return _joined([images for images, _ in both]), [light for _, light in both]

    def light_tangent(self, light: Any, change: Fill, loosely: float = 1.0) -> Images:
        return _joined([one.light_tangent(own, change, loosely) for one, own in zip(self.of_times, light, strict=True)])

    def light_adjoint(self, light: Any, residual: Images, loosely: float = 1.0) -> Fill:
        fills = [
            one.light_adjoint(own, part, loosely)
            for one, own, part in zip(self.of_times, light, self._parted(residual), strict=True)
        ]
        extinction = {name: np.sum([fill.extinction[name] for fill in fills], axis=0) for name in fills[0].extinction}
        return Fill(extinction, np.sum([fill.albedo for fill in fills if fill.albedo is not None], axis=0))

    def _parted(self, images: Images) -> Iterator[Images]:
        """What is each operator's."""
        views = np.cumsum([0, *(len(one.instruments) for one in self.of_times)])
        points = np.cumsum([0, *(len(one.points) for one in self.of_times)])
        for (a, b), (c, d) in zip(pairwise(views), pairwise(points), strict=True):
            yield Images(images.radiance[a:b], images.ghi[:, c:d])


def _joined(parts: Sequence[Images]) -> Images:
    radiance = [view for part in parts for view in part.radiance]
    return Images(radiance, np.concatenate([part.ghi for part in parts], axis=1))


def observe_window(
    scene: Scene,
    cameras: Mapping[Any, Sequence[Camera] | Camera] | None = None,
    irradiance: Mapping[Any, Sequence[Any]] | None = None,
    wind: Any = None,
    **settings: Any,
) -> Operator:
    """An operator of observations of several times, whose state is that of the scene's time.

    cameras, irradiance : of each time, what `observe` takes. Rows and pictures go through the cameras in this order,
        time by time, then through the pyranometers. The scene's own time need not be among them.
    wind : (east, north) in m/s, numbers or rows by level, that carries cloud along its levels and stays as it is; by
        default the scene's own (`open_scene(..., winds=True)`).
    settings : of `observe`, but for its time; a ``sun`` stands for all times.
    """
    check_kind("scene", scene, Scene, "give one: open_scene(path) first")
    given: dict[str, dict[np.datetime64, Any]] = {}
    for name, of in (("cameras", cameras or {}), ("irradiance", irradiance or {})):
        check_kind(f"observe_window: {name}", of, Mapping, "give what is seen of each time, {time: ...}")
        given[name] = {_time(key): value for key, value in of.items()}
    scene = settled(scene)
    if scene.grid is None or scene.time is None:
        raise UserError("observe_window: the scene needs a grid and a time, from which its cloud is carried")
    times = sorted(given["cameras"] | given["irradiance"])
    if not times:
        raise UserError("observe_window: there are neither cameras nor pyranometers")
    unknown = {"time", "core"} & settings.keys()
    if unknown:
        raise UserError(f"observe_window: {unknown.pop()} is for observe: a window has times, and a core for each")
    names = settings.get("controls", ("cloud_liquid",))
    where = nodes_that_change(
        scene, variables_of(scene, names), settings.pop("where", None), settings.pop("heights_m", None)
    )  # fmt: skip
    motion, found = motion_of(scene, wind), []
    for time in times:
        seconds = float((time - scene.time) / np.timedelta64(1, "s"))
        if abs(seconds) > LONGEST_S:
            raise UserError(f"observe_window: {time} is {seconds / 60:.0f} minutes from the scene's time: 180 at most")
        carrier = Carrier.of(motion, scene.grid.shape, seconds) if seconds else None
        there = scene if carrier is None else carrier.scene(scene)
        seen = given["cameras"].get(time, ()), given["irradiance"].get(time, ())
        op = observe(there, *seen, time=time, where=where, **settings)
        found.append(replace(op, scene=scene, carrier=carrier))
    first = found[0]
    cameras_in_all = sum(len(one.instruments) for one in found)
    controls = Controls.of(
        scene, names, first.wavelengths_nm, where, first.controls.albedo, cameras_in_all, first.controls.floor_per_m
    )  # fmt: skip
    found = [replace(one, controls=controls) for one in found]
    return Window(
        scene, first.core, controls, tuple(each for one in found for each in one.instruments),
        np.concatenate([one.points for one in found]), first.relative,
        np.concatenate([one.watts for one in found], axis=1), first.daylight, first.time, first.sun,
        of_times=tuple(found),
    )  # fmt: skip


def _time(given: Any) -> np.datetime64:
    time = parse_time(given)
    if time is None:
        raise UserError(f"observe_window: {shown(given)} is no time, such as 2024-06-21T12:30")
    return time
