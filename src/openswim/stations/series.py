"""Scenes through time: model times, and what each scene counts for in between."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import check_kind
from openswim.errors import UserError
from openswim.scene import Scene

_REMEDY = "give a Scene, a list of scenes in order of time, or openswim.stations.Series.open(paths)"


@dataclass(frozen=True)
class Series:
    """Model times, and the scene of each, opened when it is needed. One scene without a time stands for all times."""

    times: NDArray[np.datetime64]
    scene: Callable[[int], Scene]

    @classmethod
    def of(cls, given: Scene | Sequence[Scene] | Series) -> Series:
        if isinstance(given, Series):
            return given
        scenes = [given] if isinstance(given, Scene) else given
        check_kind("scene", scenes, (list, tuple), _REMEDY)
        for scene in scenes:
            check_kind("scene", scene, Scene, _REMEDY)
        if not scenes:
            raise UserError(f"no scene: {_REMEDY}")
        if len(scenes) == 1:
            return cls(np.zeros(1, "datetime64[ms]"), scenes.__getitem__)
        return cls(_in_order([scene.time for scene in scenes]), scenes.__getitem__)

    @classmethod
    def open(cls, paths: Any, **options: Any) -> Series:
        """All times of a model's files; `options` are those of `openswim.open_scene`."""
        from openswim.readers import describe, open_scene

        times = sorted({np.datetime64(time, "ms") for time in describe(paths).times})
        which: list[dict[str, Any]] = [{}] if len(times) < 2 else [{"time": time} for time in times]

        @lru_cache(maxsize=1)  # who asks what a series will cost opens the first, too
        def opened(number: int) -> Scene:
            return open_scene(paths, **which[number], **options)

        return cls(np.zeros(1, "datetime64[ms]") if len(times) < 2 else np.array(times), opened)

    def weights(self, times: NDArray[np.datetime64]) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """Each model time that is needed, and the weight (nt,) of its light at `times`: linear between model times.

        Raises UserError for times before the first model time or after the last.
        """
        if self.times.size == 1:
            yield 0, np.ones(times.size)
            return
        outside = (times < self.times[0]) | (times > self.times[-1])
        if outside.any():
            raise UserError(
                f"time {times[outside][0]} lies outside the model times {self.times[0]} to {self.times[-1]}: give "
                "times within, or one scene alone to have it stand for all times"
            )
        seconds, nodes = (
            (each - self.times[0]) / np.timedelta64(1, "s") for each in (times.astype("datetime64[ms]"), self.times)
        )
        for number in range(self.times.size):
            share = np.interp(seconds, nodes, np.eye(self.times.size)[number])
            if share.any():
                yield number, share


def _in_order(times: Sequence[Any]) -> NDArray[np.datetime64]:
    if any(time is None for time in times):
        raise UserError("a series of scenes of which one has no time: give each its time")
    stamps = np.array(times, "datetime64[ms]")
    if not (np.diff(stamps) > np.timedelta64(0, "ns")).all():
        raise UserError("a series of scenes that are not in order of time: sort them, each time once")
    return stamps
