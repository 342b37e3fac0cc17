"""What files a plan may name: those below its own folder, unless it is trusted."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.system.inputs import check_within

MOST_FILES = 100_000
_TRUST = "give --allow-references, if you trust the plan"


@dataclass(frozen=True)
class Names:
    """A plan's folder, from which the names in it count."""

    folder: Path
    anywhere: bool = False

    def beside(self, name: str, what: str) -> Path:
        """A file or folder, there or not yet."""
        path = self.folder / name
        self._check(path, name, what)
        return path

    def files(self, names: Sequence[str], what: str, awaited: bool = False) -> tuple[Path, ...]:
        """The files that names and patterns with * ? [ ] stand for, each once, in order.

        awaited: others put them there, so there may be none, and links among them that lead out are left out.
        """
        found: list[Path] = []
        for name in names:
            path = self.folder / name
            if os.path.lexists(path) or not any(mark in name for mark in "*?["):
                self._check(path, name, what)
                found.append(path)
                continue
            pattern = Path(name)
            if not self.anywhere and (pattern.is_absolute() or ".." in pattern.parts):
                raise UserError(f"{what} {shown(name)} leads out of the plan's folder: {_TRUST}")
            if "**" in name:
                raise UserError(f"{what} {shown(name)}: ** would look into every folder: name the folders")
            start = self.folder / pattern.anchor  # an absolute name's own root
            hits = sorted(islice(start.glob(str(pattern.relative_to(pattern.anchor))), MOST_FILES + 1))
            if not (hits or awaited):
                raise UserError(f"{what} {shown(name)}: no file matches this pattern")
            if awaited:
                hits = [hit for hit in hits if self._allows(hit)]
            for hit in hits:
                self._check(hit, str(hit), what)
            found += hits
        if len(found) > MOST_FILES:
            raise UserError(f"{what}: more than {MOST_FILES} files: make several plans")
        return tuple(dict.fromkeys(found))

    def _check(self, path: Path, name: str, what: str) -> None:
        folder = None if self.anywhere else self.folder
        check_within(path, folder, f"{what} {shown(name)}", f"the plan's folder: {_TRUST}")

    def _allows(self, path: Path) -> bool:
        return self.anywhere or Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self.folder))


def stamp_of(time: np.datetime64 | None, member: int | None) -> str:
    """ "20050828T180000", with "_m003" of a member; what files are called after, may be empty."""
    text = "" if time is None else re.sub(r"[-:]", "", str(time.astype("datetime64[ms]"))).replace(".000", "")
    return "_".join(part for part in (text.replace(".", ""), "" if member is None else f"m{member:03d}") if part)
