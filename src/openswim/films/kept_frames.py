"""Frames of a film in the making: each is written whole as it is done, so that a film goes on where it was stopped."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.progress import tell
from openswim.scene.files import written_whole
from openswim.system.archives import arrays_of
from openswim.system.workshops import alone_in, sweep

_PLAN = "film.json"
_FRAMES = "frame_*.npz"
_LONGEST_NAME = 200  # bytes: file systems take 255, and the folder's has more than the film's
T = TypeVar("T")


@dataclass(frozen=True)
class KeptFrame:
    """One frame: its linear light (y, x, 3) at the exposure that it wants by itself, what is known of it, that exposure
    among it, and its radiance (y, x, w) where that is asked for."""

    light: NDArray[np.float16]
    facts: dict[str, Any]
    radiance: NDArray[np.float32] | None = None


class KeptFrames:
    """The folder beside a film, in which its frames wait; `remove` it when the film is whole."""

    def __init__(self, output: Path, plan: dict[str, Any]) -> None:
        """``plan``: all that the frames depend on, as JSON takes it."""
        name = output.name if len(os.fsencode(output.name)) <= _LONGEST_NAME else _hash(output.name)
        self.folder = output.parent / f".film-{name}.frames"
        self._output, self._print = output, _hash(json.dumps(plan, sort_keys=True, default=str))

    @contextmanager
    def held(self) -> Iterator[KeptFrames]:
        """These, which nobody else makes meanwhile; frames of another plan are thrown away."""
        if self.folder.is_symlink() or (self.folder.exists() and not self.folder.is_dir()):
            raise UserError(f"{self.folder}: is in the way of the film's frames: remove it")
        with ExitStack() as stack:
            try:
                stack.enter_context(alone_in(self.folder))
            except BlockingIOError:
                raise UserError(
                    f"{self._output}: is being made by another process: wait for it, or choose another name"
                ) from None
            except OSError as error:
                raise UserError(f"{self.folder}: cannot be made ({error.strerror}): choose another folder") from error
            self._begin()
            try:
                yield self
            finally:
                if not any(self.folder.glob(_FRAMES)):  # a film that was refused leaves nothing
                    self.remove()

    def _begin(self) -> None:
        sweep(self.folder)
        left = list(self.folder.iterdir())
        if left and not (self.folder / _PLAN).is_file():
            raise UserError(f"{self.folder}: holds what is no film's: move it away, frames are kept there")
        frames = sum(each.match(_FRAMES) for each in left)
        if self._is_of_plan():
            if frames:
                tell(f"note: {self._output}: frames that are there already: {frames}")
        else:
            if frames:
                tell(f"note: {self._output}: frames of other options, or of files that have changed since, are thrown "
                     f"away: {frames}")  # fmt: skip
            for each in left:
                shutil.rmtree(each) if each.is_dir() and not each.is_symlink() else each.unlink()
        with written_whole(self.folder / _PLAN) as partial:
            partial.write_text(json.dumps({"fingerprint": self._print}))

    def _is_of_plan(self) -> bool:
        try:
            return bool(json.loads((self.folder / _PLAN).read_text())["fingerprint"] == self._print)
        except (OSError, ValueError, KeyError, TypeError):
            return False

    def has(self, number: int) -> bool:
        """Whether a frame is there whole."""
        return self._path(number).is_file()

    def put(self, number: int, frame: KeptFrame) -> None:
        """Write a frame, whole or not at all."""
        facts = np.frombuffer(json.dumps(frame.facts).encode(), np.uint8)
        arrays: dict[str, Any] = {"light": frame.light, "facts": facts}
        if frame.radiance is not None:
            arrays["radiance"] = frame.radiance
        with written_whole(self._path(number)) as partial, zipfile.ZipFile(
            partial, "w", zipfile.ZIP_DEFLATED, compresslevel=1
        ) as archive:
            for name, array in arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)

    def get(self, number: int) -> KeptFrame:
        """A frame that was put; UserError where its file is damaged."""
        return self._read(number, lambda path: _frame(arrays_of(path)))

    def facts(self, number: int) -> dict[str, Any]:
        """What is known of a frame, without its pixels."""
        return self._read(number, lambda path: _facts(arrays_of(path, ["facts"])))

    def _read(self, number: int, read: Callable[[Path], T]) -> T:
        path = self._path(number)
        try:
            return read(path)
        except (ValueError, KeyError) as error:
            raise UserError(f"{path}: damaged ({error}): remove it and start again, the others are kept") from error

    def each(self, count: int) -> Iterator[KeptFrame]:
        return (self.get(number) for number in range(count))

    def remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, number: int) -> Path:
        # by the plan, lest frames of two films be mixed where the system locks no folders
        return self.folder / f"frame_{number + 1:06d}_{self._print[:12]}.npz"


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()


def _frame(arrays: dict[str, Any]) -> KeptFrame:
    return KeptFrame(arrays["light"], _facts(arrays), arrays.get("radiance"))


def _facts(arrays: dict[str, Any]) -> dict[str, Any]:
    return dict(json.loads(arrays["facts"].tobytes().decode()))
