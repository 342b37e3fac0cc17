"""Files, and Zarr folders, that arrive in a folder: those that have stopped growing."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from pathlib import Path

from openswim.batches.names import Names
from openswim.system.inputs import size_and_change

SETTLED_S = 20.0  # without a change of size or time, after which a file is taken to be whole


Arrival = tuple[Path, int, int]  # with size and time of change


class Arrivals:
    """A folder that is looked at now and then."""

    def __init__(self, folder: Path, patterns: Sequence[str], anywhere: bool = False, settled_s: float = SETTLED_S
                 ) -> None:  # fmt: skip
        self.names, self.patterns, self.settled_s = Names(folder, anywhere), patterns, settled_s
        self._seen: dict[Path, tuple[int, int, float]] = {}  # size, time of change, and since when both are so

    def whole(self) -> list[Arrival]:
        """The files that match and have stopped growing, with size and time of change; hidden and empty ones are left
        out."""
        now = clock.monotonic()
        seen: dict[Path, tuple[int, int, float]] = {}
        found: list[Arrival] = []
        for path in self.names.files(self.patterns, "--watch", awaited=True):
            try:
                size, changed = size_and_change(path)
            except OSError:  # gone meanwhile
                continue
            if size == 0 or path.name.startswith("."):
                continue
            *before, since = self._seen.get(path, (-1, -1, now))
            if before != [size, changed]:
                old = not self._seen and clock.time() - 1e-9 * changed > self.settled_s  # when we came it was there
                since = now - self.settled_s if old else now
            seen[path] = size, changed, since
            if now - since >= self.settled_s:
                found.append((path, size, changed))
        self._seen = seen or self._seen
        return found
