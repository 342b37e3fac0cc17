"""The way of an analysis on disk, so that one that was stopped goes on."""

from __future__ import annotations

import hashlib
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.assimilation.background import Background, Space
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError
from openswim.scene.files import written_whole
from openswim.system.archives import Damaged, arrays_of

F64 = NDArray[np.float64]

EVERY_S = 30.0


@dataclass
class Checkpoint:
    """v, the outer loop and the iterations that are done, and all costs; in a file where there is a path."""

    v: F64
    mark: str
    path: Path | None = None
    loop: int = 0
    done: int = 0
    costs: list[float] = field(default_factory=list)
    _saved: float = field(default_factory=time.monotonic)

    @classmethod
    def of(cls, path: str | os.PathLike[str] | None, rows: Rows, observed: xr.Dataset, first: xr.Dataset,
           background: Background, settings: tuple[Any, ...]) -> Checkpoint:  # fmt: skip
        """That of a file, if there is one; raises UserError where it is of another analysis."""
        v = np.zeros(Space(rows, first, background, str(settings[0])).size)
        mark = _mark(rows, observed, first, background, settings)
        if path is None:
            return cls(v, mark)
        target = Path(path)
        if not target.exists():
            return cls(v, mark, target)
        try:
            found = arrays_of(target, ("v", "mark", "loop", "done", "costs"))
        except Damaged as error:
            raise UserError(f"{target}: is no checkpoint of an analysis ({error}); remove it") from None
        if str(found["mark"]) != mark or found["v"].shape != v.shape:
            raise UserError(f"{target}: is the checkpoint of another analysis; remove it, or name another file")
        return cls(found["v"], mark, target, int(found["loop"]), int(found["done"]), found["costs"].tolist())

    def save(self) -> None:
        if self.path is None:
            return
        with written_whole(self.path) as partial, partial.open("wb") as stream:
            np.savez(stream, v=self.v, mark=self.mark, loop=self.loop, done=self.done, costs=np.array(self.costs))
        self._saved = time.monotonic()

    def save_now_and_then(self) -> None:
        if time.monotonic() - self._saved > EVERY_S:
            self.save()


def _mark(rows: Rows, observed: xr.Dataset, first: xr.Dataset, background: Background, settings: Any) -> str:
    """What the way depends on."""
    digest = hashlib.blake2b(repr((background, settings, rows.wavelengths_nm.tolist())).encode(), digest_size=16)
    for name in ("value", "error", "use"):
        digest.update(np.ascontiguousarray(observed[name].values).tobytes())
    for variable in rows.controls.variables:
        digest.update(np.ascontiguousarray(first[variable.name].values).tobytes())
    return digest.hexdigest()
