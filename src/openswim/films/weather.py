"""The weather of a film: model times as they are asked for, and scenes in between."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from copy import copy
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import paths
from openswim.errors import UserError
from openswim.films.between import Motion, between, check_still, same_place
from openswim.kept_light import fingerprint
from openswim.scene import Grid, Ground, Scene
from openswim.system.inputs import size_and_change


class Weather:
    """Model times (ascending, datetime64[ms]) whose scenes ``open_at`` reads; two of them are held at a time.

    identity: text that is another one where the weather is. grids_at: the grids of a time, and where they come from,
    where they can be had without reading its scene. inputs: the files that are read, which nothing may replace.
    """

    def __init__(
        self, times: Sequence[np.datetime64], open_at: Callable[[np.datetime64], Scene], identity: Sequence[str],
        grids_at: Callable[[np.datetime64], Sequence[tuple[str, Grid]]] = lambda _: (), inputs: Sequence[Path] = (),
    ) -> None:  # fmt: skip
        self.times: NDArray[np.datetime64] = np.unique(np.asarray(times, "datetime64[ms]"))
        if not self.times.size:
            raise UserError("no model times: a film needs scenes with valid times")
        self._open, self.identity, self._grids, self.inputs = open_at, list(identity), grids_at, tuple(inputs)
        self._were: dict[Path, tuple[int, int]] = {}  # of files: size and time of change
        self._held: dict[np.datetime64, Scene] = {}
        self._motion: tuple[Any, Motion] | None = None
        self._speeds: dict[tuple[np.datetime64, np.datetime64], NDArray[np.float64]] = {}
        self._domains: dict[np.datetime64, tuple[np.datetime64, list[Grid]]] = {}

    @classmethod
    def of_scenes(cls, scenes: Sequence[Scene]) -> Weather:
        """Of scenes with valid times, in any order; a single one may have none."""
        grounds = [scene.ground for scene in scenes]
        identity, inputs = [*map(fingerprint, scenes), *_maps(grounds)], _map_names(grounds)
        if len(scenes) == 1 and scenes[0].time is None:
            return cls([np.datetime64("NaT", "ms")], lambda _: scenes[0], identity, inputs=inputs)
        by_time = {scene.time: scene for scene in scenes if scene.time is not None}
        if len(by_time) < len(scenes):
            raise UserError("scenes of a film need valid times, each another one")
        return cls(list(by_time), lambda time: by_time[time], identity, lambda time: _grids_of(by_time[time]), inputs)

    @classmethod
    def of_files(cls, path: Any, **options: Any) -> Weather:
        """Of a model's files; ``options`` go to `openswim.open_scene`. Winds are read where there are several times."""
        from openswim.readers import files_of, grids_of, open_scene, states_of

        references = options.get("allow_references", False)
        states = states_of(path, references)
        listed = files_of(path)
        were = {Path(file): size_and_change(file) for file in listed}
        identity = [f"{file.absolute()} {about}" for file, about in were.items()]
        identity += [f"{name} {value!r}" for name, value in sorted(options.items())]
        identity += _maps([options.get("ground")])
        inputs = [*listed, *_map_names([options.get("ground")])]
        files = {time: own for time, own in states if time is not None}
        if not files:
            found = cls.of_scenes([open_scene(path, **options)])
            found.inputs, found._were = tuple(inputs), were
            return found
        if len(files) > 1:  # clouds travel from one time to the next
            options = {"winds": True} | options
        found = cls(
            list(files), lambda time: open_scene(files[time], time=time, **options), identity,
            lambda time: grids_of(files[time], time, references), inputs,
        )  # fmt: skip
        found._were = were
        return found

    @property
    def first(self) -> Scene:
        """The scene of the first time."""
        return self._scene(self.times[0])

    def check_unchanged(self) -> None:
        """Raise UserError where a file that frames were made of is now another one; one that is gone mixes nothing."""
        for path, about in self._were.items():
            with suppress(OSError):
                if size_and_change(path) != about:
                    raise UserError(f"{path}: has changed while the film was made: make it again")

    def spanned(self, times: Sequence[np.datetime64], most: int) -> Iterator[Scene]:
        """Scenes of model times of which those of ``times`` are made, no more than so many of them, evenly chosen."""
        first, last = np.min(times), np.max(times)
        low = max(int(np.searchsorted(self.times, first, side="right")) - 1, 0)
        high = max(min(int(np.searchsorted(self.times, last)), self.times.size - 1), low)
        chosen = np.unique(np.linspace(low, high, min(most, high - low + 1)).round().astype(int))
        for k in chosen:
            yield self._scene(self.times[k])

    def check_between(self, times: Sequence[np.datetime64]) -> None:
        """Raise UserError where some of the times lie between those of the model and its grid moves, before any scene
        is read."""
        asked = np.asarray(times)
        between_them = asked[(asked > self.times[0]) & (asked < self.times[-1]) & ~np.isin(asked, self.times)]
        if not between_them.size:
            return
        first = self.times[self.times < between_them.min()][-1]
        last = self.times[self.times > between_them.max()][0]
        for (source, one), (_, other) in zip(self._grids(first), self._grids(last), strict=False):
            check_still(one, other, source, first, last)

    def domain(self, time: np.datetime64) -> tuple[np.datetime64, list[Grid]]:
        """The grids of the weather of a time, and the first model time that has them: that of the first scene, or
        where a nest has moved a later one's, whose scene is not read."""
        last = self.times[max(int(np.searchsorted(self.times, time, side="right")) - 1, 0)]
        if last not in self._domains:
            first = [level.grid for level in self.first.levels if level.grid is not None]
            there, here = (self._grids(each) for each in (self.times[0], last))
            still = all(same_place(one, other) for (_, one), (_, other) in zip(there, here, strict=False))
            self._domains[last] = (self.times[0], first) if still else (last, [grid for _, grid in here])
        return self._domains[last]

    def at(self, time: np.datetime64, drifting: bool = False) -> Scene:
        """The scene of a time; before the first model time the first, after the last the last. ``drifting``: invented
        detail has come with the clouds since the first time, at their mean speed."""
        scene = self._at(time)
        drift = self._drift(time) if drifting else np.zeros(2)
        return _with_drift(scene, (float(drift[0]), float(drift[1]))) if drift.any() else scene

    def _drift(self, time: np.datetime64) -> NDArray[np.float64]:
        """How far clouds have come (2,) to the east and north since the first time, m."""
        total = np.zeros(2)
        for before, after in pairwise(self.times):
            if time <= before:
                break
            if (before, after) not in self._speeds:
                one, other = self._scene(before), self._scene(after)
                self._speeds[before, after] = self._motion_between(before, after).of_clouds(one, other)
            total += self._speeds[before, after] * float((min(time, after) - before) / np.timedelta64(1, "s"))
        return total

    def _motion_between(self, before: np.datetime64, after: np.datetime64) -> Motion:
        if self._motion is None or self._motion[0] != (before, after):
            self._motion = (before, after), Motion.between(self._scene(before), self._scene(after))
        return self._motion[1]

    def _at(self, time: np.datetime64) -> Scene:
        if self.times.size == 1 or time <= self.times[0]:
            return self._scene(self.times[0])
        if time >= self.times[-1]:
            return self._scene(self.times[-1])
        later = int(np.searchsorted(self.times, time))
        if self.times[later] == time:
            return self._scene(self.times[later])
        pair = self.times[later - 1], self.times[later]
        before, after = self._scene(pair[0]), self._scene(pair[1])
        return between(before, after, time, self._motion_between(*pair))

    def _scene(self, time: np.datetime64) -> Scene:
        if time not in self._held:
            while len(self._held) > 1:
                self._held.pop(next(iter(self._held)))
            self._held[time] = self._open(time)
        return self._held[time]


def _grids_of(scene: Scene) -> list[tuple[str, Grid]]:
    return [(level.source, level.grid) for level in scene.levels if level.grid is not None]


def _with_drift(scene: Scene, drift_m: tuple[float, float]) -> Scene:
    """The scene, and the wider ones around it, with detail that has drifted."""
    out = copy(scene)
    out.drift_m = drift_m
    out.wider = None if scene.wider is None else _with_drift(scene.wider, drift_m)
    return out


def _map_names(grounds: Sequence[Ground | None]) -> list[Path]:
    """The maps of the ground that are there; of others it will be told when they are opened."""
    names = {
        str(name) for ground in grounds if ground is not None
        for kind in ("albedo", "height", "lights") for name in paths(kind, getattr(ground, kind))
    }  # fmt: skip
    return [Path(name) for name in sorted(names) if Path(name).is_file()]


def _maps(grounds: Sequence[Ground | None]) -> list[str]:
    """What the maps of the ground hold, wherever they lie."""
    found = []
    for name in _map_names(grounds):
        with open(name, "rb") as file:
            found.append(hashlib.file_digest(file, "sha256").hexdigest())
    return sorted(found)
