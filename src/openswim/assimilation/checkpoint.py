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

from openswim.assimilation.background import Space
from openswim.errors import UserError
from openswim.pictures.observer import place_of
from openswim.scene.files import check_target, written_whole
from openswim.system.archives import Damaged, arrays_of
from openswim.system.inputs import check_ordinary

F64 = NDArray[np.float64]

EVERY_S = 30.0
_BESIDE = 2**20  # bytes of all that is kept beside v, at most


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
    def of(
        cls, path: str | os.PathLike[str] | None, space: Space, observed: xr.Dataset, settings: tuple[Any, ...]
    ) -> Checkpoint:
        """That of a file, if there is one; raises UserError where it is of another analysis."""
        v, mark = np.zeros(space.size), _mark(space, observed, settings)
        if path is None:
            return cls(v, mark)
        check_target(path, name="checkpoint")
        target = Path(path)
        if not target.exists():
            return cls(v, mark, target)
        check_ordinary(target, "checkpoint")
        try:
            found = arrays_of(target, ("v", "mark", "loop", "done", "costs"), v.nbytes + _BESIDE)
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


def default_checkpoint(output: Path) -> Path:
    """Beside an output, hidden."""
    return output.with_name(f".{output.stem}.analysis.npz")


def _mark(space: Space, observed: xr.Dataset, settings: tuple[Any, ...]) -> str:
    """What the way depends on."""
    rows = space.rows
    names = [each.name for each in rows.controls.variables]
    quantities = [each.quantity.name for each in rows.instruments]
    plain = (space.background, space.transform, settings, names, quantities, rows.controls.floor_per_m)
    digest = hashlib.blake2b(repr(plain).encode(), digest_size=16)
    arrays = [rows.wavelengths_nm, rows.points, rows.controls.where]
    for one in rows.of_times:
        arrays += [one.daylight.direction, *one.base]
        if one.carrier is not None:
            arrays += [one.carrier.matrix.data, one.carrier.matrix.indices]
    for each in rows.instruments:
        camera, pixels = each.camera, each.camera.pixels()
        arrays += [np.array([*place_of(camera), camera.height_m]), pixels.azimuth_deg, pixels.altitude_deg]
    arrays += [observed[name].values for name in ("value", "error", "use")]
    arrays += [space.first[name].values for name in names]
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
