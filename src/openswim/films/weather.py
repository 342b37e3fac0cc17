"""The weather of a film: model times as they are asked for, and scenes in between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.films.between import Motion, between
from openswim.kept_light import fingerprint
from openswim.scene import Scene


class Weather:
    """Model times (ascending, datetime64[ms]) whose scenes ``open_at`` reads; two of them are held at a time.

    identity: text that is another one where the weather is.
    """

    def __init__(
        self, times: Sequence[np.datetime64], open_at: Callable[[np.datetime64], Scene], identity: Sequence[str]
    ) -> None:
        self.times: NDArray[np.datetime64] = np.unique(np.asarray(times, "datetime64[ms]"))
        if not self.times.size:
            raise UserError("no model times: a film needs scenes with valid times")
        self._open, self.identity = open_at, list(identity)
        self._held: dict[np.datetime64, Scene] = {}
        self._motion: tuple[Any, Motion] | None = None

    @classmethod
    def of_scenes(cls, scenes: Sequence[Scene]) -> Weather:
        """Of scenes with valid times, in any order; a single one may have none."""
        identity = [fingerprint(scene) for scene in scenes]
        if len(scenes) == 1 and scenes[0].time is None:
            return cls([np.datetime64("NaT", "ms")], lambda _: scenes[0], identity)
        by_time = {scene.time: scene for scene in scenes if scene.time is not None}
        if len(by_time) < len(scenes):
            raise UserError("scenes of a film need valid times, each another one")
        return cls(list(by_time), lambda time: by_time[time], identity)

    @classmethod
    def of_files(cls, path: Any, **options: Any) -> Weather:
        """Of a model's files; ``options`` go to `openswim.open_scene`. Winds are read where there are several times."""
        from openswim.readers import describe, files_of, open_scene

        info = describe(path, allow_references=options.get("allow_references", False))
        held = [(file, file.stat()) for file in files_of(path)]
        identity = [f"{file.absolute()} {about.st_size} {about.st_mtime_ns}" for file, about in held]
        identity += [f"{name} {value!r}" for name, value in sorted(options.items())]
        times = sorted({np.datetime64(time, "ms") for each in (info, *info.others) for time in each.times})
        if not times:
            scene = open_scene(path, **options)
            return cls.of_scenes([scene])
        if len(times) > 1:  # clouds travel from one time to the next
            options = {"winds": True} | options
        return cls(times, lambda time: open_scene(path, time=time, **options), identity)

    @property
    def first(self) -> Scene:
        """The scene of the first time."""
        return self._scene(self.times[0])

    def at(self, time: np.datetime64) -> Scene:
        """The scene of a time; before the first model time the first, after the last the last."""
        if self.times.size == 1 or time <= self.times[0]:
            return self._scene(self.times[0])
        if time >= self.times[-1]:
            return self._scene(self.times[-1])
        later = int(np.searchsorted(self.times, time))
        if self.times[later] == time:
            return self._scene(self.times[later])
        pair = self.times[later - 1], self.times[later]
        before, after = self._scene(pair[0]), self._scene(pair[1])
        if self._motion is None or self._motion[0] != pair:
            self._motion = pair, Motion.between(before, after)
        return between(before, after, time, self._motion[1])

    def _scene(self, time: np.datetime64) -> Scene:
        if time not in self._held:
            while len(self._held) > 1:
                self._held.pop(next(iter(self._held)))
            self._held[time] = self._open(time)
        return self._held[time]
