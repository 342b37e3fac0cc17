"""Sums over the paths of `reference` in a file, to go on from."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import openswim
from openswim.errors import UserError
from openswim.options import Options
from openswim.scene.files import check_target, written_whole
from openswim.system.archives import Damaged, arrays_of
from openswim.transport.montecarlo.sums import Sums

F64 = NDArray[np.float64]

_PARTS = ("total", "squares", "paths")  # of what a checkpoint knows of a view
_STORED = re.compile(f"[0-9a-f]{{16}}_({'|'.join(_PARTS)})")


@dataclass
class Checkpoint:
    """A file in which sums over paths outlive the process; views are told apart by a fingerprint."""

    path: Path
    key: str

    @classmethod
    def of(cls, options: Options, *view: Any) -> Checkpoint | None:
        """``view``: all that its sums depend on, as arrays, numbers and (named) tuples of them."""
        if options.checkpoint is None:
            return None
        check_target(options.checkpoint, name="checkpoint")
        digest = hashlib.sha256()
        _feed(digest, (openswim.__version__, view))
        return cls(Path(options.checkpoint), digest.hexdigest()[:16])

    def _stored(self) -> dict[str, Any]:
        if not self.path.exists():
            return {}
        try:
            stored = arrays_of(self.path)
        except Damaged as error:
            raise self._wrong() from error
        if not all(_STORED.fullmatch(name) for name in stored):
            raise self._wrong()
        return stored

    def _wrong(self) -> UserError:
        return UserError(f"checkpoint {self.path}: damaged, or no checkpoint; choose another name, or remove it")

    def load(self, sums: Sums) -> None:
        """Go on from what is stored, if it is of this very view."""
        stored = self._stored()
        found = [stored[name] for name in (f"{self.key}_{part}" for part in _PARTS) if name in stored]
        if not found:
            return
        if [each.shape for each in found] != [sums.total.shape, sums.total.shape, ()]:
            raise self._wrong()
        numbers = all(each.dtype.kind in "fiu" and np.isfinite(each).all() for each in found)
        if not numbers or (found[1] < 0).any() or found[2] < 1:  # what no paths sum to
            raise self._wrong()
        sums.total, sums.squares, sums.paths = found[0], found[1], int(found[2])

    def save(self, sums: Sums) -> None:
        """Replace the file: whole or not at all."""
        own = zip(_PARTS, (sums.total, sums.squares, np.array(sums.paths)), strict=True)
        stored = self._stored() | {f"{self.key}_{part}": values for part, values in own}
        with written_whole(self.path) as partial, partial.open("wb") as file:
            np.savez(file, **stored)


def _feed(digest: hashlib._Hash, value: Any) -> None:
    """Add all arrays, numbers and names in (named) tuples and lists."""
    if isinstance(value, tuple | list):
        for each in value:
            _feed(digest, each)
        return
    array = np.asarray(value)
    assert array.dtype != object  # of which the bytes are addresses
    digest.update(f"{array.dtype.str} {array.shape}".encode())
    digest.update(array.tobytes())
