"""What of a batch is done: a small file for each task, written after its pictures, and the manifest of all."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import openswim
from openswim.batches.plan_cameras import SUFFIXES, PlannedCamera
from openswim.batches.tasks import NO_STAMP, Task
from openswim.batches.values import check_name
from openswim.colour.beside import BESIDE
from openswim.errors import UserError
from openswim.scene.files import check_ours, check_target, written_whole
from openswim.system.inputs import check_within
from openswim.system.workshops import sweep

FOLDER = ".batch"
MANIFEST = "manifest.jsonl"
_KIND = '"kind": "openswim batch"'  # in the first line of ours
_ENDINGS = "|".join(map(re.escape, (*SUFFIXES, *BESIDE)))  # of the files that we make
_LONGEST = 1 << 24  # bytes of a record, of a thousand cameras


@dataclass(frozen=True)
class Record:
    """What was made of one task: of each camera the files, from the batch's folder, and their bytes (-1: a folder)."""

    path: Path
    task: str
    weather: str
    time: str
    files: dict[str, dict[str, int]]


class Records:
    """Which pictures of a batch stand whole in its folder, made as they would be made now."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def prepare(self, tasks: Iterable[Task]) -> None:
        """Make the folders, the batch's own even without a task, and remove what dead processes have left in them."""
        inner = (part / weather for weather in sorted({task.weather for task in tasks})
                 for part in (self.folder, self.folder / FOLDER))  # fmt: skip
        for made in dict.fromkeys((self.folder, *inner)):
            try:
                made.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise UserError(f"{made}: cannot be made ({error.strerror}): choose another folder") from None
            sweep(made)
        check_ours(self.folder / MANIFEST, _KIND, "choose another folder with -o")

    def missing(self, task: Task, cameras: Iterable[PlannedCamera]) -> list[PlannedCamera]:
        """The cameras whose pictures are to be made."""
        kept = self._read(task)
        return [camera for camera in cameras if not self._stands(kept.get(camera.name), task, camera)]

    def add(self, task: Task, camera: PlannedCamera, files: Iterable[str]) -> None:
        """A camera's pictures are there."""
        kept = self._read(task)
        kept[camera.name] = {"mark": task.mark_of(camera),
                             "files": {name: _size(self.folder / name) for name in sorted(files)}}  # fmt: skip
        about = {"task": task.name, "weather": task.weather, "time": str(task.time), "member": task.member}
        with written_whole(self._path(task)) as partial:
            partial.write_text(json.dumps(about | {"cameras": kept}, sort_keys=True))

    def standing(self) -> list[Record]:
        """All that was ever recorded and not removed, by time and name; what is damaged is left out, and so are files
        that no batch calls like that."""
        found, kept_in = [], self.folder / FOLDER
        for path in kept_in.glob("**/*.json"):
            with suppress(OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, UserError):
                if path.stat().st_size > _LONGEST:
                    continue
                kept, task = json.loads(path.read_text("utf-8")), path.relative_to(kept_in).with_suffix("").as_posix()
                files = {camera: {name: size for name, size in each["files"].items()
                                  if _made_of(task, camera).fullmatch(name)}
                         for camera, each in kept["cameras"].items()}  # fmt: skip
                found.append(Record(path, task, str(kept["weather"]), str(kept["time"]), files))
        return sorted(found, key=lambda record: (record.time, record.task))

    def remove(self, record: Record) -> None:
        """Remove the files of a record that are as we made them, and the record last."""
        for name, size in (each for files in record.files.values() for each in files.items()):
            path = self.folder / name
            with suppress(OSError, UserError):
                check_within(path, self.folder, name, "the batch's folder")  # by a link
                if path.is_symlink() or _size(path) != size:
                    continue
                if path.is_dir():
                    check_target(path)  # a Zarr store and nothing else
                    shutil.rmtree(path)
                else:
                    path.unlink()
        with suppress(OSError):
            record.path.unlink()

    def write_manifest(self, tasks: Iterable[Task], cameras: Iterable[PlannedCamera]) -> None:
        """One line for each task of which pictures are there, with the cameras that have them, after a line about the
        batch."""
        cameras = list(cameras)
        with written_whole(self.folder / MANIFEST) as partial, partial.open("w", encoding="utf-8") as out:
            out.write(f'{{{_KIND}, "openswim": {json.dumps(openswim.__version__)}}}\n')
            for task in tasks:
                kept = self._read(task)
                standing = [each for each in cameras if self._stands(kept.get(each.name), task, each)]
                if standing:
                    line = {"task": task.name, "time": None if task.time is None else str(task.time),
                            "member": task.member, "weather": task.weather,
                            "cameras": {camera.name: kept[camera.name] for camera in standing}}  # fmt: skip
                    out.write(json.dumps(line, sort_keys=True) + "\n")

    def _stands(self, kept: Any, task: Task, camera: PlannedCamera) -> bool:
        if not isinstance(kept, dict) or kept.get("mark") != task.mark_of(camera):
            return False
        files = kept.get("files")
        if not isinstance(files, dict) or not set(task.targets(camera)) <= set(files):
            return False
        return all(_size(self.folder / name) == size for name, size in files.items())

    def _path(self, task: Task) -> Path:
        return self.folder / FOLDER / f"{task.name}.json"

    def _read(self, task: Task) -> dict[str, Any]:
        """By camera; what is damaged counts as not done."""
        with suppress(OSError, ValueError, RecursionError):
            path = self._path(task)
            if path.stat().st_size <= _LONGEST:
                kept = json.loads(path.read_text("utf-8"))["cameras"]
                return dict(kept) if isinstance(kept, dict) else {}
        return {}


def _made_of(task: str, camera: str) -> re.Pattern[str]:
    """What the files of a camera can be called, in any plan, as `Task.targets` has it."""
    folder, slash, stamp = task.rpartition("/")
    check_name("a record's camera", camera)
    stem = camera if stamp == NO_STAMP else f"{camera}_{stamp}"
    return re.compile(f"{re.escape(folder + slash + stem)}(_mean|_cloud)?({_ENDINGS})")


def _size(path: Path) -> int | None:
    """Bytes of a file; of a folder that is there, -1; None of nothing."""
    try:
        return -1 if path.is_dir() else os.stat(path).st_size
    except OSError:
        return None
