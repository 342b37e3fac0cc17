"""Members of an ensemble: which there are in a file, and which one is taken."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from openswim.errors import UserError

MEMBER_DIMS = (
    "number", "member", "members", "ensemble", "ensemble_member", "ensemble_number", "ens", "ens_member",
    "realization", "realisation", "realization_index", "perturbationNumber",
)  # fmt: skip
_MOST = 100_000  # members; more are damage


def member_index(
    path: Path, data: xr.Dataset, member: int | None, notes: list[str], beside: Sequence[xr.Dataset] = ()
) -> dict[Any, int] | None:
    """Index along each ensemble dimension of a dataset, by its coordinate (else counted from 0); the first by default,
    with a note where there are several. beside: of the same variables in other files, which may hold other members;
    None where one of these holds that which is taken."""
    chosen: dict[Any, int] = {}
    for name, own in member_names(data).items():
        every = [*own, *(each for other in beside for each in member_names(other).get(name, ()) if each not in own)]
        if beside:
            every = sorted(every) if all(isinstance(each, int) for each in every) else every
        if member is not None and not any(isinstance(each, int) for each in every):
            raise _not_numbered(path, name, every[0])
        taken = every[picked(path, every, member, notes)]
        if taken not in own:
            return None
        if name in data.dims:
            chosen[name] = own.index(taken)
    return chosen


def check_ensemble(path: Path, files: Iterable[xr.Dataset], member: int | None) -> None:
    """Raise UserError where a member is asked of files of a single run, which may be called 0."""
    every = {each for data in files for own in member_names(data).values() for each in own}
    if member is not None and every <= {0} and member not in every:
        raise UserError(f"{path}: no ensemble members in it: leave out member (--member)")


def member_numbers(path: Path, data: xr.Dataset) -> set[int]:
    """The members of a dataset, by their own numbers; none where it holds no ensemble."""
    found: list[set[int]] = []
    for name, own in member_names(data).items():
        if not all(isinstance(each, int) for each in own):
            raise _not_numbered(path, name, own[0])
        found.append(set(own))
    return set.intersection(*found) if found else set()


def member_names(data: xr.Dataset) -> dict[str, list[Any]]:
    """The file's own names of its members along each ensemble dimension, else numbers from 0; of a file of one member,
    which may have no such dimension, by a number beside it."""
    found: dict[str, list[Any]] = {}
    for name in MEMBER_DIMS:
        held = data.variables.get(name)
        if name in data.dims:
            some = slice(0, _MOST)
            own = range(data.sizes[name])[some] if held is None or held.dims != (name,) else held[some].values
            found[name] = [_number(each) for each in own]
        elif held is not None and held.ndim == 0 and isinstance(_number(held.values), int):
            found[name] = [_number(held.values)]
    return found


def _number(name: Any) -> Any:
    """A whole number where a name is one, also as text."""
    try:
        value = float(name)
    except (TypeError, ValueError):
        return str(name)
    return int(value) if np.isfinite(value) and value == round(value) else str(name)


def _not_numbered(path: Path, name: str, own: Any) -> UserError:
    return UserError(f"{path}: its members are not numbered ({name} has {own!s:.20}): number them")


def picked(path: Path, members: Sequence[Any], member: int | None, notes: list[str]) -> int:
    """Index of a member among those of a file, or of several."""
    listed = ", ".join(f"{each}" for each in members[:8]) + (f" ... {members[-1]}" if len(members) > 8 else "")
    if member is None:
        if len(members) > 1:
            notes.append(f"{len(members)} ensemble members in the file ({listed}): {members[0]} is shown (--member)")
        return 0
    hits = [index for index, each in enumerate(members) if each == member]
    if not hits:
        raise UserError(f"{path}: no ensemble member {member} in it; it has {listed}: choose one of these (--member)")
    return hits[0]


def of_member(reader: Any, paths: Sequence[Path], member: int) -> list[Path]:
    """Those of several files, each of states of its own, that hold a member; all where none says so."""
    if len(paths) == 1 or hasattr(reader, "read_parts") or not hasattr(reader, "members"):
        return list(paths)
    return [path for path in paths if member in reader.members(path)] or list(paths)


class OneMember:
    """A reader that reads one member of ensembles."""

    def __init__(self, reader: Any, member: int) -> None:
        if "member" not in signature(reader.read).parameters:
            raise UserError(f"member {member}: files of {reader.name} hold no ensemble: leave out member (--member)")
        self.reader, self.member = reader, member

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.reader, name)
        return partial(found, member=self.member) if name in ("read", "read_parts") else found
