"""The tasks of a plan: each is one time of one member of one run, with all its cameras."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import openswim
from openswim.batches.names import stamp_of
from openswim.batches.plan import Plan, Weather
from openswim.batches.plan_cameras import PlannedCamera
from openswim.errors import UserError
from openswim.readers import members_of, states_of
from openswim.readers.common.base import iso, times_text
from openswim.readers.common.prober import prober
from openswim.system.inputs import size_and_change

MOST_PICTURES = 1_000_000  # of all cameras
NO_STAMP = "one"  # the name of a task without a time and a member


@dataclass(frozen=True)
class Task:
    """One solve. mark: fingerprint of its files and of all that holds for every camera."""

    weather: str
    files: tuple[str, ...]
    time: np.datetime64 | None
    member: int | None
    mark: str

    @property
    def stamp(self) -> str:
        """What its files have in their names."""
        return stamp_of(self.time, self.member)

    @property
    def name(self) -> str:
        """Of the task, unique in its plan."""
        return "/".join(part for part in (self.weather, self.stamp or NO_STAMP) if part)

    def targets(self, camera: PlannedCamera) -> list[str]:
        """The files of a camera that are asked for, from the plan's folder."""
        stem = "_".join(part for part in (camera.name, self.stamp) if part)
        return ["/".join(part for part in (self.weather, f"{stem}{suffix}") if part) for suffix in camera.suffixes]

    def mark_of(self, camera: PlannedCamera) -> str:
        """Fingerprint of all that a camera's pictures depend on."""
        return hashlib.sha256(f"{self.mark} {camera.fingerprint}".encode()).hexdigest()[:32]


def tasks_of(plan: Plan, unreadable: dict[Path, str] | None = None) -> list[Task]:
    """All tasks of a plan, by weather, time and member; raises UserError.

    unreadable: gets those of several files or runs that cannot be read, with the reason; without it they are an error.
    """
    common = _common(plan)
    tasks = []
    for weather in plan.weathers:
        marks: dict[str, str] = {}
        members: dict[tuple[Path, ...], Sequence[int | None]] = {}
        found = _states(plan, weather, unreadable)
        for time, files in _wanted(plan, weather, found) if found else ():
            for member in _members(plan, weather, tuple(files), members):
                mark = _mark([common, *(_file_mark(path, marks) for path in files), str(time), str(member)])
                tasks.append(Task(weather.name, tuple(str(path.absolute()) for path in files), time, member, mark))
                if len(tasks) * len(plan.cameras) > MOST_PICTURES:
                    raise UserError(f"more than {MOST_PICTURES} times, members and cameras: make several plans")
    _check_targets(plan, tasks)
    return tasks


def check_any(plan: Plan, tasks: Sequence[Task], unreadable: dict[Path, str]) -> None:
    """Raise UserError where there are none, since no file can be read, or no time of the files is wanted."""
    if tasks:
        return
    states = [state for weather in plan.weathers for state in _states(plan, weather, unreadable)]
    if not states:
        raise UserError(next(iter(unreadable.values())))
    times = np.unique(np.array([time for time, _ in states if time is not None], "datetime64[ms]"))
    ends = (("from", plan.start), ("to", plan.end))
    asked = " ".join(f"{name} {iso(time)}" for name, time in ends if time is not None)
    raise UserError(f"{states[0][1][0]}: no time {asked} in it and the others; they have {times_text(times)}: change "
                    "the plan's from and to")  # fmt: skip


def _members(
    plan: Plan, weather: Weather, files: tuple[Path, ...], known: dict[tuple[Path, ...], Sequence[int | None]]
) -> Sequence[int | None]:
    """The members that are wanted of the files of a time; files are looked at once."""
    if not weather.all_members:
        return weather.members
    if files not in known:
        known[files] = members_of(files, plan.allow_references) or [None]
    return known[files]


def part_of(tasks: Sequence[Task], part: tuple[int, int]) -> list[Task]:
    """The share of one of several machines: part = (which, of how many), counted from 1."""
    which, count = part
    if not 1 <= which <= count:
        raise UserError(f"--part {which}/{count}: write WHICH/HOW_MANY, such as 3/16")
    return list(tasks[which - 1 :: count])


def _readable(plan: Plan, files: Sequence[Path], unreadable: dict[Path, str]) -> list[Path]:
    """Those of several files that can be read; the others are told."""
    good = []
    with prober():
        for path in files:
            try:
                states_of([path], plan.allow_references)
                good.append(path)
            except UserError as error:
                unreadable[path] = str(error)
    return good


def _states(
    plan: Plan, weather: Weather, unreadable: dict[Path, str] | None
) -> list[tuple[np.datetime64 | None, list[Path]]]:
    """The times of the files, each with those that have it; none of one of several runs that cannot be read at all."""
    try:
        return states_of(weather.files, plan.allow_references)
    except UserError:
        good = [] if unreadable is None else _readable(plan, weather.files, unreadable)
        if not good and unreadable is not None and len(plan.weathers) > 1:
            return []
        if not good or len(good) == len(weather.files):
            raise
        return states_of(good, plan.allow_references)


def _wanted(
    plan: Plan, weather: Weather, found: Sequence[tuple[np.datetime64 | None, list[Path]]]
) -> list[tuple[np.datetime64 | None, list[Path]]]:
    if plan.times:
        return _nearest(weather.files[0], found, plan.times)
    return [
        (time, files) for time, files in found
        if time is None or not ((plan.start is not None and time < plan.start)
                                or (plan.end is not None and time > plan.end))
    ]  # fmt: skip


def _nearest(
    path: Path, found: Sequence[tuple[np.datetime64 | None, list[Path]]], wanted: Sequence[np.datetime64]
) -> list[tuple[np.datetime64 | None, list[Path]]]:
    """Those that are wanted, to a second."""
    held = [(time, files) for time, files in found if time is not None]
    times = np.array([time for time, _ in held], "datetime64[ms]")
    chosen = set()
    for each in wanted:
        away = np.abs(times - each)
        if not away.size or away.min() > np.timedelta64(1, "s"):
            raise UserError(f"{path}: no time {each} in it and the others; they have {times_text(times)}")
        chosen.add(int(away.argmin()))
    return [held[n] for n in sorted(chosen)]


def _common(plan: Plan) -> str:
    """What every picture depends on, but for its camera and its files."""
    return _mark([
        openswim.__version__, repr(plan.solver), repr(plan.wavelengths_nm), repr(plan.sun), repr(plan.only),
        repr((plan.aerosol, plan.aod)), repr(plan.look), repr(plan.ensemble is not None),
    ])  # fmt: skip


def _file_mark(path: Path, known: dict[str, str]) -> str:
    """Size and time of change of a file; of a folder, of all in it."""
    key = str(path)
    if key not in known:
        try:
            size, changed = size_and_change(path)
        except OSError as error:
            raise UserError(f"{path}: cannot be looked at ({error.strerror})") from None
        known[key] = f"{path.name} {size} {changed}"
    return known[key]


def _mark(parts: Sequence[str]) -> str:
    return hashlib.sha256(json.dumps(list(parts)).encode()).hexdigest()


def _check_targets(plan: Plan, tasks: Sequence[Task]) -> None:
    """No picture replaces a file that is read, or another picture."""
    inputs = {os.path.realpath(file) for task in tasks for file in task.files}
    folder, seen = os.path.realpath(plan.folder), set()
    for task in tasks:
        for camera in plan.cameras:
            for target in task.targets(camera):
                path = os.path.join(folder, target)
                if path in inputs:
                    raise UserError(f"output {path}: would replace a file that is read: choose another output")
                if path in seen:
                    raise UserError(f"output {path}: two pictures would have this name: choose other names")
                seen.add(path)
